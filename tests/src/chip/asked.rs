//! What a bring-up asks of the chip that a running drive does not: levels of pins, outputs of comparators, clocks against
//! each other, conversions by software.

use super::adc::{self, Source};
use super::capture::{self, Clocks};
use super::faults;
use super::outside::{Circuit, Inside, Pin, gates};
use super::{Chip, Motor};
use hal_sim::sensors::Leg;

/// The pull-up resistor of a fault line on the power stage, ohm.
const FAULT_PULL_UP_OHM: f64 = 10e3;

/// The pull-downs of a USB-C device without a battery (RM0440 6.4.3, PWR_CR3.UCPD1_DBDIS), ohm: PB6 has one while PA9 is
/// high, PB4 while PA10 is.
const DEAD_BATTERY_OHM: f64 = 5100.0;
const DEAD_BATTERY: [(Pin, Pin); 2] = [((1, 6), (0, 9)), ((1, 4), (0, 10))];

impl Chip {
    /// What the chip does to a pin.
    fn inside(&self, (port, pin): Pin) -> Inside {
        let (mode, function) = self.system.pin_function(port, pin);
        // High sides a to c of a timer, then its low sides.
        let by_timer = || {
            let all = gates(self.wiring);
            let k = all
                .iter()
                .position(|(gate, needed, _)| *gate == (port, pin) && *needed == function)?;
            let timer = &self.pwm[all[k].2];
            let side = if k / 3 % 2 == 0 { Leg::High } else { Leg::Low };
            match timer.legs(self.now)[k % 3] {
                Leg::Open => timer.drives_idle().then_some(false),
                leg => Some(leg == side),
            }
        };
        Inside {
            drives: match mode {
                1 => self.system.output(port, pin),
                2 => by_timer(),
                _ => None,
            },
            pulls: self.system.pull(port, pin),
            grounds: self.dead_battery((port, pin)),
        }
    }

    /// The pull-down of a pin that a dead battery's detection has put there, ohm.
    fn dead_battery(&self, pin: Pin) -> Option<f64> {
        let (_, enable) = DEAD_BATTERY
            .into_iter()
            .find(|(loaded, _)| *loaded == pin)?;
        let on = !self.system.dead_battery_off() && self.level(enable);
        on.then_some(DEAD_BATTERY_OHM)
    }

    /// The level of a pin. A driver's fault line is an open output with a pull-up; it is low while the driver has a fault
    /// or sleeps.
    #[must_use]
    pub fn level(&self, pin: Pin) -> bool {
        let fault_line = |pin: Pin| {
            let index = (0..2).find(|index| {
                let (port, number, _) = self.wiring.driver(*index).fault;
                pin == (port, number)
            })?;
            let pulled =
                self.stages[index].pulls_fault(self.now) || self.provoked.driver_fault[index];
            Some(match pulled {
                false => Circuit::PullUp(FAULT_PULL_UP_OHM),
                true => Circuit::Driven(false),
            })
        };
        self.outside.reads(pin, |pin| self.inside(pin), fault_line)
    }

    /// GPIOx_IDR (RM0440 9.4.5): an analog pin reads low.
    pub(super) fn levels(&self, port: usize) -> u32 {
        (0..16)
            .filter(|pin| self.system.pin_function(port, *pin).0 != 3)
            .filter(|pin| self.level((port, *pin)))
            .fold(0, |levels, pin| levels | 1 << pin)
    }

    /// After a write to a port: what its pins are at, they stay at when they are let go.
    pub(super) fn charge_pins(&mut self) {
        // The port that is left out, F, has the crystal.
        for pin in (0..5).flat_map(|port| (0..16).map(move |pin| (port, pin))) {
            let level = self.level(pin);
            self.outside.charge(pin, level);
        }
    }

    /// The outputs of all comparators; bit n is COMPn.
    pub(super) fn comparator_outputs(&self) -> u32 {
        let dead = |dac: usize, counts: Option<u16>| match self.faults.dead_dacs[dac] {
            true => Some(0),
            false => counts,
        };
        let thresholds = [
            dead(0, self.dacs[0].output(1)),
            dead(0, self.dacs[0].output(2)),
            dead(1, self.dacs[1].output(1)),
        ];
        (0..2).fold(0, |outputs, index| {
            let mut current = self.sensors[index].current;
            if let Some((stage, fault)) = self.provoked.power_fault[index] {
                let legs = self.pwm[index].legs(self.now);
                for (phase, leg) in legs.into_iter().enumerate() {
                    current[phase] = stage.counts(fault, phase, leg);
                }
            }
            if self.amplifiers_are_silent(index) {
                current = [0; 3];
            }
            outputs
                | self
                    .comparators
                    .outputs(self.wiring, index, current, thresholds)
        }) & !self.faults.dead_comparators
    }

    /// What TIM16 can be given.
    pub(super) fn clocks(&self) -> Clocks {
        Clocks {
            mco: self.system.hsi_on_mco().then_some(1e6),
            lsi: self.system.lsi_on().then_some(self.faults.lsi_hz),
            core: capture::core_hz(self.faults.crystal_hz),
        }
    }

    /// The sequence that ADC `index` + 1 ends now was converted beside another ADC's, with clocks that are not in step.
    fn is_disturbed(&self, index: usize) -> bool {
        let adc = &self.adcs[index];
        let began = adc.began(self.now);
        let mut others = self.adcs.iter().enumerate().filter(|(k, _)| *k != index);
        adc.clock_is_divided() && others.any(|(_, other)| other.converts_between(began, self.now))
    }

    /// What a channel of ADC `index` + 1 is connected to. What the board samples at the timers' tops has its noise in it.
    pub(super) fn source(&self, index: usize, channel: u32) -> Option<Source> {
        const NOISE: f64 = 0.5;
        if (index, channel) == adc::REFERENCE {
            return self.adcs[index]
                .has_reference()
                .then(|| adc::reference(self.system.supply_v));
        }
        let by_software = self.adcs[index].by_software();
        let counts = if by_software {
            let machine = self.machine.borrow();
            let mut still = [Motor::Screw, Motor::Nut].map(|motor| machine.still(motor));
            for (stage, sensors) in still.iter_mut().enumerate() {
                self.as_stage_gives(stage, sensors);
            }
            self.wiring.input(index, channel, &still)?
        } else {
            self.wiring.input(index, channel, &self.sensors)?
        };
        let name = (index + 1, channel);
        let noise = faults::of(&self.faults.noise, name);
        Some(Source {
            counts: f64::from(faults::of(&self.faults.stuck_channel, name).unwrap_or(counts)),
            // Amplifiers and capacitors outside the chip.
            ohm: faults::of(&self.faults.source_ohm, name).unwrap_or(0.0),
            noise: noise.unwrap_or(if by_software { NOISE } else { 0.0 }),
            disturbance: if self.is_disturbed(index) {
                adc::DISTURBANCE
            } else {
                0.0
            },
        })
    }

    /// A PWM timer's register was written: what its break and its outputs depend on may have changed.
    pub(super) fn breaks_written(&mut self, offset: u32) {
        const BDTR: u32 = 0x44;
        const AF1: u32 = 0x60;
        if [BDTR, AF1].contains(&offset) {
            self.look_at_breaks();
            self.watch_gates();
        }
    }

    /// No output may be enabled on a pin of the power stage before the drive samples its currents.
    pub(super) fn watch_gates(&mut self) {
        for index in 0..2 {
            let armed = [&self.adcs[0], &self.adcs[3]][index].armed();
            if armed || !self.pwm[index].bridge().enabled {
                continue;
            }
            let driven = gates(self.wiring)
                .into_iter()
                .find(|(pin, function, timer)| {
                    *timer == index && self.system.pin_function(pin.0, pin.1) == (2, *function)
                });
            if let Some(((port, pin), ..)) = driven {
                let port = char::from(b'A' + port as u8);
                self.fail(format!(
                    "an output is enabled on P{port}{pin} while no current is sampled"
                ));
            }
        }
    }
}
