//! The board: what the control code touches, joined to the machine.
//!
//! Time goes from one turn of a bridge's counter to the next. At its turn a bridge takes over the compare values that
//! were written since the turn before, and the ADCs sample; so a compare value acts one period after the sample that
//! it was computed from. The nut's counter is half a period behind the screw's.

use crate::sensors::{BUS_V, CurrentSensing, Leg, Sensors, encoder_word};
use crate::switching::{Rails, SAME_S, SwitchedBridge, Switching};
use crate::wiring::{MotorWiring, Wiring};
use control::controller_supply::{CALIBRATED_AT_MV, SupplyReading};
use control::current_loop::{MotorSample, PwmCommand};
use control::encoder::Interface;
use control::sense::Shunts;
use plant::Axis;
use plant::leg::{DeadTime, Period};
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

/// The controller's supply, V.
pub const SUPPLY_V: f64 = 3.3;
/// Its internal reference, V (datasheet, embedded voltage reference: typical; memory).
pub const REFERENCE_V: f64 = 1.212;
/// Counts of its ADCs.
const ADC_COUNTS: f64 = 4096.0;

/// What the comparators on a break input see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comparators {
    /// The true current of each phase, either sign.
    Ideal,
    /// What the current amplifiers of the phases that have a sensor show, into the motor only, as on both boards.
    Amplifiers,
}

/// A brake resistor on the bus, switched by its own comparator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chopper {
    /// Switches on above, off below, V.
    pub on_off_v: [f64; 2],
    /// Resistance, ohm.
    pub ohm: f64,
}

/// What the board is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardConfig {
    /// Clock of the PWM timers, Hz.
    pub timer_hz: f64,
    /// PWM frequency, Hz.
    pub pwm_hz: f64,
    /// Bus voltage, V: what the supply holds.
    pub bus_v: f64,
    /// Capacity of the bus, F, behind a supply that takes no current back; 0: a supply that holds its voltage both ways.
    pub bus_f: f64,
    /// What burns what the bus does not take; it has an effect on a bus with a capacity only.
    pub chopper: Option<Chopper>,
    /// Dead time of the bridges, s.
    pub dead_time_s: f64,
    /// Capacitance of each switch of a leg, F: its charge takes a part of the dead time. 0: a leg turns at once.
    pub leg_f: f64,
    /// The bridges switch; `None`: they hold the mean of a period's voltages.
    pub switching: Option<Switching>,
    /// Phase current that trips the break input, A.
    pub break_a: f64,
    /// What the comparators on the break input see.
    pub comparators: Comparators,
    /// What measures the machine.
    pub sensors: Sensors,
    /// Which phases have a current sensor.
    pub shunts: Shunts,
    /// Where it is.
    pub sensing: CurrentSensing,
    /// The drive measures its current zeros before it starts, which hides a constant offset from it.
    pub measure_zeros: bool,
    /// How motors and encoders are connected.
    pub wiring: Wiring,
    /// Integration steps per half PWM period.
    pub substeps: u32,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for BoardConfig {
    /// 170 MHz, 20 kHz, 310 V, no dead time, two shunts, real sensors, nominal current zeros, one integration step per half period.
    fn default() -> Self {
        Self {
            timer_hz: 170e6,
            pwm_hz: 20e3,
            bus_v: BUS_V,
            bus_f: 0.0,
            chopper: None,
            dead_time_s: 0.0,
            leg_f: 0.0,
            switching: None,
            break_a: 8.0,
            comparators: Comparators::Ideal,
            sensors: Sensors::real(),
            shunts: Shunts::Two,
            sensing: CurrentSensing::InLine,
            measure_zeros: false,
            wiring: Wiring::right(),
            substeps: 1,
            seed: 1,
        }
    }
}

impl BoardConfig {
    /// Top of the centre-aligned counters.
    #[must_use]
    pub fn period(&self) -> u16 {
        (self.timer_hz / (2.0 * self.pwm_hz))
            .round()
            .clamp(1.0, 65_535.0) as u16
    }

    /// The current that turns a leg from one end of the bus to the other within the dead time, A: both its switches' charge over
    /// the dead time.
    #[must_use]
    pub fn turning_a(&self) -> f64 {
        2.0 * self.leg_f * self.bus_v / self.dead_time_s
    }

    /// PWM period that the counters make, s.
    #[must_use]
    pub fn pwm_period_s(&self) -> f64 {
        2.0 * f64::from(self.period()) / self.timer_hz
    }
}

/// The period before, of a bridge that was driven.
#[derive(Clone, Copy, Debug)]
struct LastPeriod {
    /// Currents into the motor at its begin, A.
    amps: [f64; 3],
    /// Mean voltages of its legs to the middle of the bus, of that.
    legs: [f64; 3],
}

impl LastPeriod {
    /// Phase voltages that would have kept its currents, of the bus: `amps` are those at its end.
    fn balance(&self, amps: [f64; 3], bus_a: f64) -> [f64; 3] {
        let mean = self.legs.iter().sum::<f64>() / 3.0;
        [0, 1, 2].map(|k| self.legs[k] - mean - (amps[k] - self.amps[k]) / bus_a)
    }
}

/// One bridge as its timer drives it.
#[derive(Clone, Copy, Debug, Default)]
struct BridgeState {
    written: PwmCommand,
    active: PwmCommand,
    broken: bool,
    /// The gate driver's line has done that, and not the comparators.
    pulled: bool,
    /// The chip itself has done that: its supply.
    system: bool,
    /// Its gate driver holds it open.
    held_open: bool,
}

/// The peripherals of both motors, on the machine.
#[derive(Clone, Debug)]
pub struct Board {
    /// The machine itself, for what no sensor sees.
    pub machine: Machine,
    config: BoardConfig,
    bridges: [BridgeState; 2],
    /// What the bridges put on the windings, in the mean of half a period.
    driven: [Bridge; 2],
    /// The legs of bridges that switch.
    switched: [SwitchedBridge; 2],
    /// Where a dead time is lost.
    last: [Option<LastPeriod>; 2],
    /// Frames of absolute encoders, latched since the last turn of a counter.
    frames: [Option<u32>; 2],
    random: Xoshiro256PlusPlus,
    /// Bus voltage now, V.
    bus_v: f64,
    /// The chopper is on.
    chops: bool,
    /// Shaft angles at which the counts of the encoders' inputs are zero, rad.
    encoder_zeros: [f64; 2],
    /// Whole turns of the shafts, by which an index is passed.
    turns: [f64; 2],
    index_passed: [bool; 2],
    /// Half a PWM period, s.
    half_s: f64,
    step_s: f64,
    /// Where legs and channels of a motor are not in their places.
    miswired: [Option<MotorWiring>; 2],
    /// Top of the counters, see [`BoardConfig::period`], and the duty of a compare count.
    period: u16,
    duty_per_count: f64,
    /// Part of the bus voltage that a phase loses to the dead time.
    dead_part: f64,
    /// The inverse of the phases' inductances, 1/H.
    per_henry: [f64; 2],
    /// The ADC's reference, of what it should be.
    reference: f64,
    /// The factor by which the chip's clock is slow.
    slow: f64,
}

/// Sum of the products.
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Board {
    /// A board with all outputs off on a machine at rest.
    #[must_use]
    pub fn new(model: &Model, coupling: Coupling, config: BoardConfig) -> Self {
        let mut machine = Machine::new(model, coupling);
        machine.set_bus_voltage(config.bus_v);
        for axis in Axis::ALL {
            machine.set_open_phase(axis, config.wiring.motor(axis).open);
        }
        Self {
            machine,
            config,
            bridges: [BridgeState::default(); 2],
            driven: [Bridge::Open; 2],
            switched: [SwitchedBridge::default(); 2],
            last: [None; 2],
            frames: [None; 2],
            random: Xoshiro256PlusPlus::seed_from_u64(config.seed),
            bus_v: config.bus_v,
            chops: false,
            encoder_zeros: [0.0; 2],
            turns: [0.0; 2],
            index_passed: [false; 2],
            half_s: config.pwm_period_s() / 2.0,
            step_s: config.pwm_period_s() / 2.0 / f64::from(config.substeps.max(1)),
            miswired: config
                .wiring
                .motors
                .map(|wiring| Some(wiring).filter(|wiring| !wiring.is_straight())),
            period: config.period(),
            duty_per_count: f64::from(config.period()).recip(),
            dead_part: config.dead_time_s / config.pwm_period_s(),
            per_henry: Axis::ALL.map(|axis| model.motor(axis).inductance_h.recip()),
            reference: 1.0,
            slow: 1.0,
        }
    }

    /// What the board is made of.
    #[must_use]
    pub fn config(&self) -> &BoardConfig {
        &self.config
    }

    /// Changes the bus voltage from now on, V.
    pub fn set_bus_voltage(&mut self, volts: f64) {
        self.config.bus_v = volts;
        self.bus_v = volts;
        self.machine.set_bus_voltage(volts);
    }

    /// Changes what the supply holds, V; a bus with a capacity of its own follows as its load lets it.
    pub fn set_supply(&mut self, volts: f64) {
        self.config.bus_v = volts;
    }

    /// The bus voltage now, V.
    #[must_use]
    pub fn bus_voltage(&self) -> f64 {
        self.bus_v
    }

    /// Power that the bridge of `axis` puts into its motor now, W; negative while it brakes.
    #[must_use]
    pub fn power_w(&self, axis: Axis) -> f64 {
        let Bridge::Driven(volts) = self.driven[axis.index()] else {
            return 0.0;
        };
        dot(volts, self.machine.phase_currents(axis))
    }

    /// What the bridges have taken from the bus's capacity and put back in `seconds`, in which the currents went from `before` to
    /// what they are: by their mean. By either end alone a voltage that alternates, as noise makes it, would charge the bus.
    fn charge_bus(&mut self, before: [[f64; 3]; 2], seconds: f64) {
        let mut power = 0.0;
        for (axis, before) in Axis::ALL.into_iter().zip(before) {
            if let Bridge::Driven(volts) = self.driven[axis.index()] {
                power += 0.5 * (dot(volts, before) + dot(volts, self.machine.phase_currents(axis)));
            }
        }
        if let Some(chopper) = self.config.chopper {
            let [on, off] = chopper.on_off_v;
            self.chops = self.bus_v > if self.chops { off } else { on };
            if self.chops {
                power += self.bus_v * self.bus_v / chopper.ohm;
            }
        }
        let energy = self.bus_v * self.bus_v - 2.0 * power * seconds / self.config.bus_f;
        self.bus_v = energy.max(0.0).sqrt().max(self.config.bus_v);
        self.machine.set_bus_voltage(self.bus_v);
    }

    /// The counter of `axis` turns: the written compare values become active, the ADCs and the encoder are read.
    pub fn turn(&mut self, axis: Axis) -> MotorSample {
        self.turn_through(axis, |_| ())
    }

    /// The same; `amplified` may change what the current amplifiers show, A into the motor.
    pub fn turn_through(
        &mut self,
        axis: Axis,
        amplified: impl FnOnce(&mut [f64; 3]),
    ) -> MotorSample {
        let miswired = self.miswired[axis.index()].as_ref();
        let (true_currents, mut amps) = self.leg_currents(axis);
        // The comparators' DACs have the ADC's reference.
        let break_a = self.config.break_a * self.reference;
        let bridge = &mut self.bridges[axis.index()];
        // A break holds until it is cleared.
        bridge.broken |= self.config.comparators == Comparators::Ideal
            && true_currents.iter().any(|i| i.abs() > break_a);
        bridge.active = bridge.written;
        let active = bridge.active;

        if self.config.sensing != CurrentSensing::InLine {
            // At the top, where the samples are taken.
            let closed = active.enable && !bridge.broken && !bridge.held_open;
            for (channel, amps) in amps.iter_mut().enumerate() {
                let at = miswired.map_or(channel, |wiring| wiring.channels[channel]);
                let leg = match active.compare[at] {
                    _ if !closed => Leg::Open,
                    compare if compare >= self.period => Leg::High,
                    _ => Leg::Low,
                };
                *amps = self.config.sensing.seen(*amps, leg);
            }
        }
        amplified(&mut amps);
        let sensed = match self.config.shunts {
            Shunts::Two => &amps[..2],
            Shunts::Three => &amps[..],
        };
        bridge.broken |= self.config.comparators == Comparators::Amplifiers
            && sensed.iter().any(|i| *i > break_a);
        let broken = bridge.broken;
        let open = broken || bridge.held_open;
        let driven = self.voltages(axis, active, open, true_currents);
        if self.config.switching.is_some() {
            let bridge = &mut self.switched[axis.index()];
            match driven {
                Bridge::Driven(_) => bridge.turn(active, self.period, self.config.dead_time_s),
                Bridge::Shorted | Bridge::Open => bridge.open(),
            }
        }
        self.driven[axis.index()] = driven;
        self.machine.set_bridge(axis, driven);

        let encoder = match self.frames[axis.index()] {
            Some(frame) => frame,
            None => {
                let late_s = self.encoder_late_s();
                self.encoder_word(axis, late_s)
            }
        };
        let Sensors { current, bus, .. } = &self.config.sensors;
        let gain = self.reference.recip();
        let [a, b, c] = amps.map(|amps| amps * gain);
        let mut convert = |i| current.convert(i, &mut self.random);
        MotorSample {
            // A phase without a sensor reads 0.
            current: [
                convert(a),
                convert(b),
                match self.config.shunts {
                    Shunts::Two => 0,
                    Shunts::Three => convert(c),
                },
            ],
            bus: bus.convert(self.bus_v * gain, &mut self.random),
            encoder,
            broken,
        }
    }

    /// Currents into the legs of `axis`, and what the amplifiers of its channels make of them at their samples, A.
    #[inline(always)]
    fn leg_currents(&self, axis: Axis) -> ([f64; 3], [f64; 3]) {
        let miswired = self.miswired[axis.index()].as_ref();
        let mut true_currents = self.machine.phase_currents(axis);
        let mut amps = self.machine.current_readings(axis);
        if let Some(wiring) = miswired {
            true_currents = wiring.legs(true_currents);
            amps = wiring.legs(amps);
        }
        if let Some(switching) = &self.config.switching
            && self.config.sensing == CurrentSensing::LowSide
        {
            amps = self.switched[axis.index()].shown(amps, switching);
        }
        if let Some(wiring) = miswired {
            amps = wiring.channels(amps);
        }
        (true_currents, amps)
    }

    /// The raw word of the encoder of `axis`, of a reading that is for a sample `later_s` from now.
    #[must_use]
    #[inline]
    pub fn encoder_word(&self, axis: Axis, later_s: f64) -> u32 {
        let encoder = &self.config.sensors.encoders[axis.index()];
        let there = self.config.wiring.encoder_at(axis);
        let angle = self.machine.encoder_angle(there) - self.encoder_zeros[axis.index()];
        let turned = self.machine.motor(there).omega * (later_s - encoder.age_s);
        encoder_word(encoder, self.encoder_sense(axis) * (angle + turned))
    }

    /// By how much an encoder's angle is taken too late this time, s.
    #[inline]
    fn encoder_late_s(&mut self) -> f64 {
        let jitter_s = self.config.sensors.encoder_jitter_s;
        if jitter_s > 0.0 {
            let unit: f64 = StandardNormal.sample(&mut self.random);
            unit * jitter_s
        } else {
            0.0
        }
    }

    /// Power comes up: an incremental encoder's count begins at zero where its shaft stands now.
    pub fn wake_encoders(&mut self) {
        for axis in Axis::ALL {
            let there = self.config.wiring.encoder_at(axis);
            let encoder = &self.config.sensors.encoders[axis.index()];
            if !encoder.interface.is_absolute() {
                let angle = self.machine.encoder_angle(there);
                self.encoder_zeros[axis.index()] = angle;
                self.turns[axis.index()] = (angle / TAU).floor();
            }
        }
    }

    /// How the encoder of `axis` is read.
    #[must_use]
    pub fn interface(&self, axis: Axis) -> Interface {
        self.config.sensors.encoders[axis.index()].interface
    }

    fn encoder_sense(&self, axis: Axis) -> f64 {
        if self.config.wiring.motor(axis).encoder_reversed {
            -1.0
        } else {
            1.0
        }
    }

    /// Writes compare values; they act from the counter's next turn on.
    pub fn write(&mut self, axis: Axis, command: PwmCommand) {
        self.bridges[axis.index()].written = command;
    }

    /// Switches the outputs of `axis` off now: its timer's main output enable is no compare value, and waits for no turn of the
    /// counter. On the chip that is some microseconds after the sample, in the interrupt.
    pub fn open(&mut self, axis: Axis) {
        let bridge = &mut self.bridges[axis.index()];
        (bridge.written.enable, bridge.active.enable) = (false, false);
        self.driven[axis.index()] = Bridge::Open;
        self.machine.set_bridge(axis, Bridge::Open);
    }

    /// Trips the break input of `axis`, as its gate driver's fault line does: the bridge opens now.
    pub fn trip_break(&mut self, axis: Axis) {
        let bridge = &mut self.bridges[axis.index()];
        (bridge.broken, bridge.pulled) = (true, true);
        self.driven[axis.index()] = Bridge::Open;
        self.machine.set_bridge(axis, Bridge::Open);
    }

    /// The gate driver of `axis` opens its bridge by itself, whatever the timer drives, until it does so no longer.
    pub fn hold_open(&mut self, axis: Axis, open: bool) {
        self.bridges[axis.index()].held_open = open;
    }

    /// Clears the break latch of `axis`.
    pub fn clear_break(&mut self, axis: Axis) {
        let bridge = &mut self.bridges[axis.index()];
        (bridge.broken, bridge.pulled, bridge.system) = (false, false, false);
    }

    /// The chip breaks both timers for a fault of its own: the bridges open now.
    pub fn break_system(&mut self) {
        for axis in Axis::ALL {
            self.open(axis);
            let bridge = &mut self.bridges[axis.index()];
            (bridge.broken, bridge.system) = (true, true);
        }
    }

    /// The chip itself has broken the timers since the breaks were cleared.
    #[must_use]
    pub fn broken_by_system(&self) -> bool {
        self.bridges.iter().any(|bridge| bridge.system)
    }

    /// The chip is reset: its outputs are off, its breaks cleared, and incremental counts begin at zero when it starts.
    pub fn reset(&mut self) {
        for axis in Axis::ALL {
            self.open(axis);
            self.clear_break(axis);
        }
        self.wake_encoders();
    }

    /// The chip's clock runs slow by this factor, or fast: all its times with it.
    pub fn set_clock(&mut self, slow: f64) {
        if slow != self.slow {
            self.slow = slow;
            self.half_s = self.config.pwm_period_s() / 2.0 * slow;
            self.step_s = self.half_s / f64::from(self.config.substeps.max(1));
        }
    }

    /// The ADC's reference is this part of what it should be: so much more it reads of what does not go with it. The current
    /// amplifiers' zeros go with it on both boards.
    pub fn set_reference(&mut self, part: f64) {
        self.reference = part;
    }

    /// The controller's supply as its ADC reads it.
    #[must_use]
    pub fn supply(&self) -> SupplyReading {
        let counts = |supply: f64| (REFERENCE_V / supply * ADC_COUNTS).round() as u16;
        SupplyReading {
            reference: counts(SUPPLY_V * self.reference),
            calibrated: counts(f64::from(CALIBRATED_AT_MV) * 1e-3),
        }
    }

    /// A PWM period as it is now, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        2.0 * self.half_s
    }

    /// The gate drivers' fault lines that have tripped a break since it was cleared: screw, nut.
    #[must_use]
    pub fn fault_lines(&self) -> [bool; 2] {
        Axis::ALL.map(|axis| self.bridges[axis.index()].pulled)
    }

    /// Half a PWM period passes. An absolute encoder latches the angle that its frame brings before the period's end.
    pub fn advance(&mut self) {
        let half_period = self.half_s;
        for axis in Axis::ALL {
            let encoder = &self.config.sensors.encoders[axis.index()];
            if encoder.interface == Interface::Mt6835 {
                let late_s = half_period + self.encoder_late_s();
                self.frames[axis.index()] = Some(self.encoder_word(axis, late_s));
            }
        }
        let before = (self.config.bus_f > 0.0)
            .then(|| Axis::ALL.map(|axis| self.machine.phase_currents(axis)));
        match self.config.switching {
            None => {
                for _ in 0..self.config.substeps.max(1) {
                    self.machine.advance(self.step_s);
                }
            }
            Some(switching) => self.advance_switched(switching),
        }
        if let Some(before) = before {
            self.charge_bus(before, half_period);
        }
        self.pass_indices();
    }

    /// Half a PWM period of bridges that switch, from edge to edge.
    fn advance_switched(&mut self, switching: Switching) {
        /// Each of six legs has an edge and the ends of two dead times, and then the half period ends.
        const SEGMENTS: u32 = 6 * 3 + 1;
        let rails = Rails {
            bus_v: self.bus_v,
            leg_f: self.config.leg_f,
            diode_v: switching.diode_v,
        };
        let driven = self
            .driven
            .map(|bridge| matches!(bridge, Bridge::Driven(_)));
        for (bridge, driven) in self.switched.iter_mut().zip(driven) {
            if driven {
                bridge.begin_half(self.half_s);
            }
        }
        let (mut at, mut volt_seconds) = (0.0, [[0.0; 3]; 2]);
        for segment in 1..=SEGMENTS {
            let mut dt = self.half_s - at;
            for (bridge, driven) in self.switched.iter_mut().zip(driven) {
                if driven {
                    bridge.take_edges(at, self.config.dead_time_s);
                    dt = bridge.steady_for(at, dt);
                }
            }
            for axis in Axis::ALL.into_iter().filter(|axis| driven[axis.index()]) {
                let k = axis.index();
                let currents = self.machine.phase_currents(axis);
                let wiring = self.miswired[k].as_ref();
                let legs = wiring.map_or(currents, |wiring| wiring.legs(currents));
                let nodes = self.switched[k].pass(legs, dt, &rails);
                let windings = wiring.map_or(nodes, |wiring| wiring.windings(nodes));
                for (sum, volts) in volt_seconds[k].iter_mut().zip(windings) {
                    *sum += volts * dt;
                }
                self.machine.set_bridge(axis, Bridge::Driven(windings));
            }
            self.machine.advance(dt);
            at += dt;
            if self.half_s - at < SAME_S || segment == SEGMENTS {
                break;
            }
        }
        for axis in Axis::ALL.into_iter().filter(|axis| driven[axis.index()]) {
            let mean = volt_seconds[axis.index()].map(|sum| sum / at);
            self.driven[axis.index()] = Bridge::Driven(mean);
        }
    }

    /// The encoder of `axis` has passed its index since this was last asked.
    pub fn take_index_passed(&mut self, axis: Axis) -> bool {
        std::mem::take(&mut self.index_passed[axis.index()])
    }

    /// A shaft that has passed the index of its encoder, at angle 0, has put its count to zero there.
    fn pass_indices(&mut self) {
        for axis in Axis::ALL {
            let k = axis.index();
            if self.config.sensors.encoders[k].interface != Interface::IncrementalWithIndex {
                continue;
            }
            let angle = self
                .machine
                .encoder_angle(self.config.wiring.encoder_at(axis));
            let turn = (angle / TAU).floor();
            if turn != std::mem::replace(&mut self.turns[k], turn) {
                self.encoder_zeros[k] = 0.0;
                self.index_passed[k] = true;
            }
        }
    }

    /// Counts of the table's scale.
    pub fn scale_counts(&mut self) -> i64 {
        let sensors = &self.config.sensors;
        let noise = if sensors.scale_noise_m > 0.0 {
            let unit: f64 = StandardNormal.sample(&mut self.random);
            unit * sensors.scale_noise_m
        } else {
            0.0
        };
        let position = self.machine.table_position();
        let error = sensors.scale_error_m * (TAU * position / sensors.scale_period_m).sin();
        ((position + error + noise) / sensors.scale_count_m).round() as i64
    }

    /// Mean phase voltages over a period, to the middle of the bus.
    #[inline(always)]
    fn voltages(&mut self, axis: Axis, command: PwmCommand, open: bool, amps: [f64; 3]) -> Bridge {
        let last = self.last[axis.index()].take();
        if !command.enable || open {
            return Bridge::Open;
        }
        // At 0 and from the period on a leg does not switch (RM0440, PWM mode: OCxREF is held).
        let [a, b, c] = command.compare;
        if a.max(b).max(c) == 0 || a.min(b).min(c) >= self.period {
            return Bridge::Shorted;
        }
        let duty = |compare| (f64::from(compare) * self.duty_per_count).min(1.0);
        let duties = [a, b, c].map(duty);
        let mut legs = duties.map(|duty| duty - 0.5);
        if self.dead_part > 0.0 {
            let bus_a = self.bus_v * self.period_s() * self.per_henry[axis.index()];
            let dead_time = DeadTime {
                part: self.dead_part,
                // Without capacitance a leg that is held has two thirds of the bus across its phase. A current up to
                // `2/3 V t / L` ends within the dead time `t`, and loses that part of it. So does a leg whose charge turns
                // at half of that current.
                turning_a: (self.config.turning_a()).max(self.dead_part * bus_a / 3.0),
                bus_a,
            };
            let lost = dead_time.lost_parts(&Period {
                duties,
                amps,
                balance: last.map_or([0.0; 3], |last| last.balance(amps, bus_a)),
            });
            for (leg, lost) in legs.iter_mut().zip(lost) {
                *leg -= self.dead_part * lost;
            }
            self.last[axis.index()] = Some(LastPeriod { amps, legs });
        }
        let legs = legs.map(|part| self.bus_v * part);
        Bridge::Driven(match &self.miswired[axis.index()] {
            None => legs,
            Some(wiring) => wiring.windings(legs),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::leg::lost_part;

    /// The node of a leg, a nanosecond at a time: a current pulls it down from when the high side opens, and the low side takes it
    /// the rest of the way when the dead time is over; on the way up a diode keeps it down through the dead time.
    #[test]
    fn a_leg_loses_what_its_node_does_in_the_dead_time() {
        let config = BoardConfig {
            dead_time_s: 800e-9,
            leg_f: 300e-12,
            ..BoardConfig::default()
        };
        for amps in [0.01, 0.1, 0.2, 0.25, 0.5, 2.0, 10.0] {
            let (step_s, bus) = (1e-10, config.bus_v);
            let (mut node, mut gained) = (bus, 0.0);
            for _ in 0..(config.dead_time_s / step_s).round() as u32 {
                gained += node / bus * step_s;
                node = (node - amps * step_s / (2.0 * config.leg_f)).max(0.0);
            }
            let expected = 1.0 - gained / config.dead_time_s;
            let got = lost_part(amps / config.turning_a());
            assert!(
                (got - expected).abs() < 1e-3,
                "{amps} A: {got:.4} of the dead time, expected {expected:.4}"
            );
            assert_eq!(lost_part(-amps / config.turning_a()), -got);
        }
    }
}
