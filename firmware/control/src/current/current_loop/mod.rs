//! One motor's current loop: raw sample in, compare values out, once a PWM period.
//!
//! [`CurrentLoop::period`] is the whole of it, on the registers of a [`MotorIo`] and the words of a [`MotorExchange`]. Board
//! and host run this same code.
//!
//! Timing: the sample is taken at the counter's turn; the compare values of this step take effect at the next turn
//! and act for one period, so on average one and a half periods after the sample. The voltage is turned forward by
//! the angle that the rotor gains in that time.

pub(crate) mod config;
pub(crate) mod words;

pub use config::CurrentLoopConfig;
pub use words::{Calibration, CurrentReference, Frame, Measured, Mode, Rested};

use crate::base::format::{Angle, ScaledCurrent, multiply_upper};
use crate::current::encoder::Interface;
use crate::current::encoder_watch::{EncoderWatch, EncoderWatchConfig, Seen};
use crate::current::exchange::{Asked, MotorExchange};
use crate::current::motor_io::{MotorIo, Sensing};
use crate::current::observer::{EncoderAlignment, Motion, Observer};
use crate::current::regulator::Regulator;
use crate::current::sense::{Codes, CurrentSense, ZeroCalibration};
use crate::current::transform::{DirectQuadrature, Rotation};

/// What a board reads at the counter's turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MotorSample {
    /// ADC counts of the shunts in phases a, b, c.
    pub current: [u16; 3],
    /// ADC counts of the bus voltage.
    pub bus: u16,
    /// The encoder's raw word: see [`Interface`].
    pub encoder: u32,
    /// The break input has stopped the bridge.
    pub broken: bool,
}

/// What the bridge shall do from the next turn of its counter on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PwmCommand {
    /// Timer compare values of phases a, b, c.
    pub compare: [u16; 3],
    /// The six outputs follow the compare values; otherwise all are off.
    pub enable: bool,
}

/// How the loop left its bridge. The break may have opened it since.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bridge {
    Open,
    /// The low sides closed, which charges the high sides' drivers for so many periods more.
    Charging(u32),
    /// Closed for currents in a commanded frame.
    ClosedCommanded,
    /// Closed for currents in the rotor's frame: its angle is known.
    Closed,
}

/// Where the frame of the currents is, and how far it turns in a period, 2^-32 turn.
#[derive(Clone, Copy)]
struct FrameMotion {
    theta_e: Angle,
    step: i32,
}

impl FrameMotion {
    /// The rotor's own.
    #[inline(always)]
    fn of_rotor(motion: &Motion) -> Self {
        Self {
            theta_e: motion.theta_e,
            step: motion.theta_e_step,
        }
    }
}

/// State of one motor's current loop. The configuration comes with each step.
#[derive(Clone, Copy, Debug)]
pub struct CurrentLoop {
    observer: Observer,
    encoder_watch: EncoderWatch,
    regulator: Regulator,
    /// Zeros of the current channels.
    zeros: Codes,
    bridge: Bridge,
    zero_calibration: ZeroCalibration,
    calibration: Calibration,
    /// How the encoder lies to its rotor, as far as it is known. The observer has it too.
    alignment: Option<EncoderAlignment>,
    /// The observer knows where the shaft is.
    started: bool,
    /// A current was beyond its limit; it stays so while the drive is asked to be on.
    over_current: bool,
}

impl CurrentLoop {
    /// A loop at rest with nominal current zeros.
    #[must_use]
    pub const fn new(config: &CurrentLoopConfig) -> Self {
        let alignment = match config.alignment {
            Some(alignment) => alignment,
            None => EncoderAlignment::straight(),
        };
        Self {
            observer: Observer::new(alignment),
            encoder_watch: EncoderWatch::new(),
            regulator: Regulator::new(),
            zeros: config.sense.zeros,
            bridge: Bridge::Open,
            zero_calibration: ZeroCalibration::new(),
            calibration: if config.measure_zeros {
                Calibration::Pending
            } else {
                Calibration::Done
            },
            alignment: config.alignment,
            started: false,
            over_current: false,
        }
    }

    /// One PWM period: sample, step, apply, publish. Each register is read where it is needed. `say_stale` is called when the
    /// reference is stale: the speed task, which says what the drive is doing, cannot.
    #[inline(always)]
    pub fn period(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        say_stale: impl FnOnce(),
    ) {
        let broken = io.acknowledge();
        let asked_to_drive = exchange.begin_period();
        if asked_to_drive && !broken {
            self.drive_in_rotor_frame(config, io, exchange);
        } else {
            self.any_other_period(config, io, exchange, broken, say_stale);
        }
        if !io.in_time() {
            exchange.publish_missed();
        }
    }

    /// Where the shaft is, in the rotor's sense, and how far it turns in a period, 2^-32 turn.
    #[must_use]
    pub fn shaft(&self) -> (Angle, i32) {
        self.observer.shaft()
    }

    /// A period of a drive at work: the bridge is closed, or something opened it since the reference was asked, and then it
    /// stays open.
    #[inline(always)]
    fn drive_in_rotor_frame(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
    ) {
        let (motion, seen) = self.observe(config, io, exchange, true);
        let rotor = FrameMotion::of_rotor(&motion);
        if !seen.failed {
            let measured = self.measure(config, io, exchange, rotor);
            if !over_current(config, measured) {
                self.drive(config, io, exchange, rotor, measured);
                return;
            }
        }
        let asked = Asked {
            mode: Mode::Drive,
            ..Asked::default()
        };
        self.close_or_rest(config, io, exchange, asked, rotor, false);
    }

    /// A period with the bridge off, or with currents in a commanded frame.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn any_other_period(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        broken: bool,
        say_stale: impl FnOnce(),
    ) {
        let asked = exchange.asked();
        if asked.stale {
            say_stale();
        }
        self.take_alignment(exchange.alignment());
        let drive = asked.mode == Mode::Drive;
        let (motion, _) = self.observe(config, io, exchange, drive);
        let rotor = FrameMotion::of_rotor(&motion);
        self.close_or_rest(config, io, exchange, asked, rotor, broken);
    }

    /// The one place that closes and opens the bridge: it is closed while that is asked, the break has not opened it, nothing
    /// that was measured forbids it, and the frame of the currents is known.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn close_or_rest(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        asked: Asked,
        rotor: FrameMotion,
        broken: bool,
    ) {
        let short = asked.mode == Mode::Short;
        let close = asked.mode == Mode::Drive || short;
        let (bridge, frame) = match asked.frame {
            Frame::Rotor => (Bridge::Closed, rotor),
            Frame::Commanded(theta_e) => {
                (Bridge::ClosedCommanded, FrameMotion { theta_e, step: 0 })
            }
        };
        // The sample is still in its registers.
        let measured = self.measure(config, io, exchange, frame);
        let over_current = over_current(config, measured);
        self.over_current = close && (self.over_current || over_current);
        let placed = self.alignment.is_some() || bridge == Bridge::ClosedCommanded || short;
        let forbidden =
            broken || self.encoder_watch.failed() || self.over_current || !self.started || !placed;
        if close && !forbidden {
            // Samples of a current that flows are no zeros: what was begun begins again when it rests.
            self.zero_calibration = ZeroCalibration::new();
            if !self.shorts(config, io, exchange, short) {
                self.drive(config, io, exchange, frame, measured);
                if self.bridge == Bridge::Open {
                    io.close();
                }
                self.bridge = bridge;
            }
        } else {
            self.rest(config, io, exchange, asked.mode);
            if self.bridge != Bridge::Open {
                self.bridge = Bridge::Open;
                io.open();
            }
            io.write([0; 3]);
        }
        exchange.publish_rest(
            Rested {
                calibration: self.calibration,
                broken,
                over_current: self.over_current,
                encoder_stuck: self.encoder_watch.failed(),
                angle_known: self.alignment.is_some(),
                closed: self.bridge == Bridge::Closed,
            },
            asked.stale,
        );
    }

    /// The encoder's raw word -> where the shaft is, how fast it turns, and whether the encoder is to be trusted; `drive`: the
    /// bridge is asked to be closed.
    #[inline(always)]
    fn observe(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        drive: bool,
    ) -> (Motion, Seen) {
        let counts = io.sensing().encoder.counts(io.encoder());
        let mut motion = self.observer.follow(&config.observer, counts);
        exchange.publish_shaft(counts, motion.theta_step);
        let watch = EncoderWatchConfig {
            checked: io.sensing().encoder.is_checked(),
            ..config.encoder_watch
        };
        let alignment = self.alignment;
        let aligning = || alignment.is_none_or(|alignment| alignment.index_awaited);
        let seen = (self.encoder_watch).step(&watch, counts, &motion, drive, aligning);
        if seen.wrong {
            let jumped = counts.filter(|_| io.sensing().encoder == Interface::IncrementalWithIndex);
            self.wrong_reading(config, exchange, jumped, motion.innovation);
            motion = self.observer.motion(&config.observer);
        }
        (motion, seen)
    }

    /// A reading that is wrong, or one that the first index has moved. `jumped`: the count, where it jumped and stays there.
    ///
    /// A jump is no speed: the shaft turns as before. Taken as a speed, 1.8 degrees made the motor 50 rpm faster for 3 ms.
    #[cold]
    #[inline(never)]
    fn wrong_reading(
        &mut self,
        config: &CurrentLoopConfig,
        exchange: &MotorExchange,
        jumped: Option<u32>,
        innovation: i32,
    ) {
        let awaited = self.alignment.filter(|alignment| alignment.index_awaited);
        if awaited.is_none() {
            exchange.publish_wrong_reading();
        }
        let Some(counts) = jumped else {
            return;
        };
        let jump = self.observer.jumped(&config.observer, innovation, counts);
        if let Some(alignment) = awaited {
            let alignment = alignment.past_index(jump, config.observer.pole_pairs);
            self.alignment = Some(alignment);
            self.observer.align(alignment);
            exchange.publish_index(alignment);
        }
        let (_, theta_step) = self.observer.shaft();
        exchange.publish_shaft(Some(counts), theta_step);
    }

    /// ADC counts of the phases -> currents.
    #[inline(always)]
    fn measure(
        &self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        frame: FrameMotion,
    ) -> DirectQuadrature<ScaledCurrent> {
        let sensing = io.sensing();
        let codes = CurrentSense::codes_at(sensing.code_shift, io.current(), self.zeros);
        let rotation = Rotation::new(frame.theta_e);
        let measured = Measured {
            codes,
            current: rotation.park(config.sense.vector_of(sensing.shunts, codes)),
        };
        exchange.publish_currents(&measured, sensing.shunts);
        measured.current
    }

    /// Current error -> voltage -> compare values, turned to where the frame will be in the middle of their period.
    #[inline(always)]
    fn drive(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        frame: FrameMotion,
        current: DirectQuadrature<ScaledCurrent>,
    ) {
        let (reference, bus) = (exchange.reference(), io.bus());
        #[allow(clippy::cast_possible_truncation)]
        exchange.publish_bus(bus as u16);
        let output = self
            .regulator
            .step(&config.regulator, reference, current, frame.step, || {
                config.modulation.circle(bus)
            });
        if output.limited {
            exchange.publish_limited();
        }
        exchange.publish_voltage(output.voltage);
        let realised_at = frame.theta_e.plus(three_halves(frame.step));
        let v = Rotation::second(realised_at).inverse_park(output.voltage);
        let scale = exchange.bus_scale();
        // Where they were left, so that no register had to keep them.
        let codes = exchange.codes();
        let Sensing {
            shunts, fraction, ..
        } = io.sensing();
        let modulation = &config.modulation;
        io.write(modulation.compare_of(shunts, fraction, v, codes, scale, bus));
    }

    /// A period with the bridge off: the regulator is emptied, and with [`Mode::Calibrate`] the current zeros are measured,
    /// again and again, so that those in use are never older than two averages when the bridge is closed.
    fn rest(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        mode: Mode,
    ) {
        let counts = io.sensing().encoder.counts(io.encoder());
        if let (false, Some(counts)) = (self.started, counts) {
            let alignment = self.alignment.unwrap_or_default();
            self.observer = Observer::at(&config.observer, alignment, counts);
            self.started = true;
        }
        self.regulator = Regulator::new();
        match mode {
            Mode::Reset => {
                io.clear_break();
                if config.measure_zeros {
                    // A zero that was wrong may be right by now: it is measured again.
                    self.zero_calibration = ZeroCalibration::new();
                    self.calibration = Calibration::Pending;
                }
            }
            Mode::Calibrate if config.measure_zeros => {
                self.calibrate(&config.sense, io.current());
            }
            _ => {}
        }
        #[allow(clippy::cast_possible_truncation)]
        exchange.publish_bus(io.bus() as u16);
        exchange.publish_voltage(DirectQuadrature::default());
    }

    /// The low sides are closed where that is asked, and before the bridge is driven, so that the high sides' drivers have
    /// their supply. `true` in those periods.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn shorts(
        &mut self,
        config: &CurrentLoopConfig,
        io: &mut impl MotorIo,
        exchange: &MotorExchange,
        asked: bool,
    ) -> bool {
        let left = match self.bridge {
            Bridge::Open => config.bootstrap_periods,
            Bridge::Charging(left) => left,
            Bridge::ClosedCommanded | Bridge::Closed => 0,
        };
        if left == 0 && !asked {
            return false;
        }
        self.regulator = Regulator::new();
        io.write([0; 3]);
        if self.bridge == Bridge::Open {
            io.close();
        }
        self.bridge = Bridge::Charging(left.saturating_sub(1));
        #[allow(clippy::cast_possible_truncation)]
        exchange.publish_bus(io.bus() as u16);
        exchange.publish_voltage(DirectQuadrature::default());
        true
    }

    /// Takes over how the encoder lies to its rotor.
    pub fn take_alignment(&mut self, alignment: Option<EncoderAlignment>) {
        if alignment != self.alignment {
            self.alignment = alignment;
            self.observer.align(alignment.unwrap_or_default());
        }
    }

    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn calibrate(&mut self, sense: &CurrentSense, counts: [u16; 3]) {
        let Some(zeros) = self.zero_calibration.take(sense, counts) else {
            return;
        };
        if sense.healthy(zeros) {
            self.zeros = zeros;
            self.calibration = Calibration::Done;
        } else {
            self.calibration = Calibration::OutOfRange;
        }
    }
}

/// The current is beyond its limit, whatever its sign: a sum of squares, of which a phase's is two thirds at most.
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn over_current(config: &CurrentLoopConfig, current: DirectQuadrature<ScaledCurrent>) -> bool {
    // A current is within 0.87 * 2^30: the upper words of the squares are within 2^28 together.
    let square = |ScaledCurrent(x): ScaledCurrent| multiply_upper(x, x);
    square(current.d) + square(current.q) > config.current_max_square
}

/// The angle gained in one and a half samples, of a quarter turn each at most.
#[allow(clippy::arithmetic_side_effects)]
fn three_halves(step: i32) -> Angle {
    Angle((step + (step >> 1)).cast_unsigned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::format::Current;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    /// What a loop reads and writes, in memory.
    struct Registers {
        sample: MotorSample,
        command: PwmCommand,
        sensing: Sensing,
    }

    impl MotorIo for Registers {
        fn acknowledge(&mut self) -> bool {
            self.sample.broken
        }
        fn encoder(&mut self) -> u32 {
            self.sample.encoder
        }
        fn sensing(&self) -> Sensing {
            self.sensing
        }
        fn current(&mut self) -> [u16; 3] {
            self.sample.current
        }
        fn bus(&mut self) -> u32 {
            self.sample.bus.into()
        }
        fn write(&mut self, compare: [u16; 3]) {
            self.command.compare = compare;
        }
        fn close(&mut self) {
            assert!(!self.command.enable, "closed twice");
            self.command.enable = true;
        }
        fn open(&mut self) {
            assert!(self.command.enable, "opened twice");
            self.command.enable = false;
        }
        fn clear_break(&mut self) {}
        fn in_time(&mut self) -> bool {
            true
        }
    }

    /// A loop with its configuration, its words and its registers.
    struct Bench {
        config: CurrentLoopConfig,
        control: CurrentLoop,
        exchange: MotorExchange,
        registers: Registers,
    }

    impl Bench {
        fn new(config: CurrentLoopConfig) -> Self {
            Self {
                config,
                control: CurrentLoop::new(&config),
                exchange: MotorExchange::new(&config, 4),
                registers: Registers {
                    sample: sample([2048; 3]),
                    command: PwmCommand::default(),
                    sensing: config.sensing(),
                },
            }
        }

        fn step(&mut self, sample: &MotorSample, reference: CurrentReference) -> PwmCommand {
            self.exchange.publish_bus(sample.bus);
            self.exchange.expect_bus(&self.config);
            self.exchange.ask(reference, &self.config);
            self.registers.sample = *sample;
            let Self {
                config,
                control,
                exchange,
                registers,
            } = self;
            control.period(config, registers, exchange, || panic!("stale"));
            registers.command
        }

        fn voltage(&self) -> DirectQuadrature<f64> {
            let voltage = self.exchange.voltage(self.exchange.periods());
            DirectQuadrature {
                d: voltage.d.to_num(),
                q: voltage.q.to_num(),
            }
        }
    }

    fn config() -> CurrentLoopConfig {
        let plate = test_plate();
        CurrentLoopConfig {
            alignment: Some(plate.motors[0].encoder.alignment()),
            ..plate.motors[0].current_loop(&plate).unwrap()
        }
    }

    fn current_loop() -> Bench {
        let mut started = Bench::new(config());
        // The first period of every drive: the observer learns where the shaft is.
        started.step(&sample([2048; 3]), CurrentReference::default());
        started
    }

    fn sample(current: [u16; 3]) -> MotorSample {
        MotorSample {
            current,
            bus: 2818,
            encoder: 0,
            broken: false,
        }
    }

    const ONE_AMPERE: CurrentReference = CurrentReference {
        mode: Mode::Drive,
        frame: Frame::Rotor,
        i_d: Current::ZERO,
        i_q: Current::ONE,
    };

    #[test]
    fn torque_current_is_ninety_degrees_ahead_of_the_flux() {
        let mut current_loop = current_loop();
        let command = current_loop.step(&sample([2048; 3]), ONE_AMPERE);
        assert!(command.enable);
        let [a, b, c] = command.compare.map(i32::from);
        // At theta_e = 0 the q axis is beta: b above, c below, a between.
        assert!(
            b > a && a > c && (b - a - (a - c)).abs() <= 1,
            "{a} {b} {c}"
        );
        assert!((current_loop.voltage().q - 23.08).abs() < 0.01);
    }

    /// Without current, the voltage is the back-EMF: it must point along q as the rotor will stand in the middle of the
    /// period in which the compare values act, one and a half periods after the sample.
    #[test]
    fn the_voltage_is_turned_to_where_the_rotor_will_be() {
        let mut current_loop = current_loop();
        for rpm in [3000.0, -1500.0f64] {
            let turns_a_period = rpm / 60.0 * 50e-6;
            let at = |k: i32| (turns_a_period * f64::from(k)).rem_euclid(1.0);
            let mut command = PwmCommand::default();
            for k in 0..2000 {
                let sample = MotorSample {
                    encoder: (at(k) * f64::from(1 << 20)) as u32 % (1 << 20),
                    ..sample([2048; 3])
                };
                let reference = CurrentReference {
                    mode: Mode::Drive,
                    ..CurrentReference::default()
                };
                command = current_loop.step(&sample, reference);
            }
            let [a, b, c] = command.compare.map(f64::from);
            let angle = (3f64.sqrt() * (b - c)).atan2(2.0 * a - b - c);
            let rotor = core::f64::consts::TAU * 5.0 * (at(1999) + 1.5 * turns_a_period);
            let expected = rotor + core::f64::consts::FRAC_PI_2.copysign(rpm);
            let off = (angle - expected).sin().atan2((angle - expected).cos());
            // Half a period at 3000 rpm is 0.04 rad; an LSB of the PWM is 0.001.
            assert!(off.abs() < 0.005, "{off} rad off at {rpm} rpm");
        }
    }

    #[test]
    fn the_low_sides_are_closed_alone_before_the_bridge_is_driven() {
        let mut bench = Bench::new(CurrentLoopConfig {
            bootstrap_periods: 3,
            ..config()
        });
        bench.step(&sample([2048; 3]), CurrentReference::default());
        // Each time that it is closed, in either frame; a break in between begins again.
        let commanded = CurrentReference {
            frame: Frame::Commanded(Angle::from_turns(0.0)),
            ..ONE_AMPERE
        };
        let low_sides = PwmCommand {
            compare: [0; 3],
            enable: true,
        };
        for reference in [ONE_AMPERE, commanded] {
            for charged in [1, 3] {
                for _ in 0..charged {
                    assert_eq!(bench.step(&sample([2048; 3]), reference), low_sides);
                }
                let command = bench.step(
                    &MotorSample {
                        broken: charged < 3,
                        ..sample([2048; 3])
                    },
                    reference,
                );
                assert_eq!(command.enable, charged == 3);
                assert_eq!(command.compare != [0; 3], charged == 3);
            }
            bench.step(&sample([2048; 3]), CurrentReference::default());
        }
    }

    #[test]
    fn off_broken_and_calibrating_leave_the_outputs_off() {
        let mut current_loop = current_loop();
        for (mode, broken) in [
            (Mode::Off, false),
            (Mode::Calibrate, false),
            (Mode::Drive, true),
        ] {
            let sample = MotorSample {
                broken,
                ..sample([2048; 3])
            };
            let command = current_loop.step(&sample, CurrentReference { mode, ..ONE_AMPERE });
            assert_eq!(command, PwmCommand::default());
            assert_eq!(current_loop.exchange.status().broken, broken);
        }
    }

    /// Wherever the rotor is, and though its angle is not known; a current beyond its limit opens the bridge all the same.
    #[test]
    fn a_shorted_winding_has_its_low_sides_closed_until_a_current_is_too_large() {
        let mut bench = Bench::new(CurrentLoopConfig {
            alignment: None,
            ..config()
        });
        let short = CurrentReference {
            mode: Mode::Short,
            ..CurrentReference::default()
        };
        bench.step(&sample([2048; 3]), CurrentReference::default());
        let closed = PwmCommand {
            compare: [0; 3],
            enable: true,
        };
        for _ in 0..10 {
            assert_eq!(bench.step(&sample([2100, 2000, 2048]), short), closed);
        }
        assert!(!bench.exchange.status().over_current);
        let command = bench.step(&sample([4095, 2048, 2048]), short);
        assert_eq!(command, PwmCommand::default(), "a current past its limit");
        assert!(bench.exchange.status().over_current);
        let command = bench.step(&sample([2048; 3]), short);
        assert_eq!(command, PwmCommand::default(), "closed again while asked");
    }

    #[test]
    fn calibration_finds_the_zeros_or_says_that_a_sensor_is_wrong() {
        for (zero, expected) in [(2060, Calibration::Done), (3000, Calibration::OutOfRange)] {
            let mut current_loop = current_loop();
            let ask = CurrentReference {
                mode: Mode::Calibrate,
                ..ONE_AMPERE
            };
            let mut last = Calibration::Pending;
            for _ in 0..1024 {
                assert_eq!(last, Calibration::Pending);
                current_loop.step(&sample([zero, 2048, 0]), ask);
                last = current_loop.exchange.status().calibration;
            }
            assert_eq!(last, expected);
            current_loop.step(&sample([zero, 2048, 0]), ask);
            let [a, ..] = current_loop.exchange.codes();
            assert_eq!(a == 0, expected == Calibration::Done);
        }
    }

    /// A zero that was out of its place is measured again after a reset, and zeros that drift are followed while the bridge
    /// rests, also where a start cut an average short.
    #[test]
    fn zeros_are_measured_anew_after_a_reset_and_before_each_start() {
        let mut current_loop = current_loop();
        let ask = |mode| CurrentReference { mode, ..ONE_AMPERE };
        let zeros = |bench: &mut Bench, counts: u16, periods: u32| {
            for _ in 0..periods {
                bench.step(&sample([counts, 2048, 0]), ask(Mode::Calibrate));
            }
            let status = bench.exchange.status();
            // What a sample at 2060 counts is taken for.
            bench.step(&sample([2060, 2048, 0]), ask(Mode::Off));
            (status.calibration, bench.exchange.codes()[0] >> 16)
        };
        let count = |counts: i32| counts << (config().sense.code_shift - 16);
        assert_eq!(
            zeros(&mut current_loop, 3000, 1024),
            (Calibration::OutOfRange, count(2060 - 2048))
        );
        current_loop.step(&sample([2060, 2048, 0]), ask(Mode::Reset));
        let status = current_loop.exchange.status();
        assert_eq!(status.calibration, Calibration::Pending, "after a reset");
        let found = zeros(&mut current_loop, 2060, 1024);
        assert_eq!(found, (Calibration::Done, 0));
        assert_eq!(
            zeros(&mut current_loop, 2052, 1024),
            (Calibration::Done, count(2060 - 2052)),
            "drifted at rest"
        );
        // Half an average, a start whose samples are of a current, and a whole one.
        zeros(&mut current_loop, 2052, 512);
        for _ in 0..10 {
            let command = current_loop.step(&sample([2400, 2048, 0]), ONE_AMPERE);
            assert!(command.enable);
        }
        assert_eq!(
            zeros(&mut current_loop, 2060, 1024),
            (Calibration::Done, 0),
            "samples of before the start are in the zeros of after it"
        );
        // A sensor that breaks at rest is found before the next start.
        let (broken, _) = zeros(&mut current_loop, 4095, 1024);
        assert_eq!(broken, Calibration::OutOfRange);
    }

    proptest! {
        #[test]
        fn any_samples_give_compares_within_the_period(
            samples in prop::collection::vec((any::<[u16; 3]>(), any::<u16>(), any::<u32>(), any::<i32>()), 1..100),
        ) {
            let mut current_loop = current_loop();
            for (current, bus, encoder, i_q) in samples {
                let (current, bus) = (current.map(|n| n % 4096), bus % 4096);
                let sample = MotorSample { current, bus, encoder, broken: false };
                let reference = CurrentReference { mode: Mode::Drive, i_q: Current::from_bits(i_q), ..CurrentReference::default() };
                let command = current_loop.step(&sample, reference);
                prop_assert!(command.compare.iter().all(|&c| c <= 4250));
            }
        }
    }

    /// A drive that is asked to run from its first period on, or whose encoder does not answer: nothing is driven before the
    /// encoder was read once.
    #[test]
    fn nothing_is_driven_before_the_encoder_is_read() {
        let mut bench = Bench::new(config());
        let read = MotorSample {
            encoder: 700_000,
            ..sample([2048; 3])
        };
        assert_eq!(
            bench.step(&read, ONE_AMPERE),
            PwmCommand::default(),
            "driven in the first period of all, when the observer stands at angle 0"
        );
        assert!(bench.step(&read, ONE_AMPERE).enable);

        let absolute = CurrentLoopConfig {
            encoder: Interface::Mt6835,
            ..config()
        };
        let silent = MotorSample {
            encoder: u32::MAX,
            ..sample([2048; 3])
        };
        assert_eq!(absolute.encoder.counts(silent.encoder), None);
        for frame in [Frame::Rotor, Frame::Commanded(Angle::from_turns(0.3))] {
            let mut bench = Bench::new(absolute);
            for period in 0..8 {
                let command = bench.step(
                    &silent,
                    CurrentReference {
                        frame,
                        ..ONE_AMPERE
                    },
                );
                assert_eq!(
                    command,
                    PwmCommand::default(),
                    "period {period}, {frame:?}: driven without a word of the encoder"
                );
            }
        }
    }

    /// A current in a commanded frame points where it is commanded, wherever the encoder stands; in the rotor's frame nothing
    /// is driven before the rotor's angle is known.
    #[test]
    fn only_a_commanded_frame_is_driven_before_the_angle_is_known() {
        let mut bench = Bench::new(CurrentLoopConfig {
            alignment: None,
            ..config()
        });
        bench.step(&sample([2048; 3]), CurrentReference::default());
        for _ in 0..3 {
            let command = bench.step(&sample([2048; 3]), ONE_AMPERE);
            assert_eq!(command, PwmCommand::default());
            assert!(!bench.exchange.status().angle_known);
        }
        for turns in [0.0, 0.25, 0.7] {
            let mut bench = Bench::new(bench.config);
            let reference = CurrentReference {
                mode: Mode::Drive,
                frame: Frame::Commanded(Angle::from_turns(turns)),
                i_d: Current::ONE,
                i_q: Current::ZERO,
            };
            let stands = MotorSample {
                encoder: 123_456,
                ..sample([2048; 3])
            };
            bench.step(&stands, CurrentReference::default());
            let command = bench.step(&stands, reference);
            assert!(command.enable);
            let [a, b, c] = command.compare.map(f64::from);
            let angle = (3f64.sqrt() * (b - c)).atan2(2.0 * a - b - c);
            let off = angle - turns * core::f64::consts::TAU;
            assert!(off.sin().abs() < 0.01 && off.cos() > 0.0, "{off} rad off");
            // The frame changes with the bridge closed only once the angle is known.
            assert!(!bench.step(&stands, ONE_AMPERE).enable);
            assert!(bench.step(&stands, reference).enable);
            bench
                .exchange
                .align(None, Some(EncoderAlignment::default()));
            assert!(bench.step(&stands, reference).enable);
            assert!(bench.exchange.status().angle_known);
            assert!(bench.step(&stands, ONE_AMPERE).enable);
        }
    }

    /// An encoder that counts backwards and starts anywhere makes the same drive.
    #[test]
    fn the_alignment_is_undone() {
        const ZERO: u32 = 77_000;
        let alignment = EncoderAlignment {
            reversed: true,
            theta_e_at_zero: Angle::from_turns(5.0 * f64::from(ZERO) / f64::from(1 << 20)),
            index_awaited: false,
        };
        let (mut straight, mut reversed) = (current_loop(), Bench::new(config()));
        reversed.exchange.align(None, Some(alignment));
        let at = |counts: u32| MotorSample {
            encoder: counts % (1 << 20),
            ..sample([2100, 2000, 2048])
        };
        straight.step(&at(0), CurrentReference::default());
        reversed.step(&at(ZERO), CurrentReference::default());
        for k in 0..2000u32 {
            let counts = 100 * k;
            let commands = [
                straight.step(&at(counts), ONE_AMPERE),
                reversed.step(&at((1 << 20) + ZERO - counts % (1 << 20)), ONE_AMPERE),
            ];
            let [a, b] = commands.map(|command| command.compare);
            let near = a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near, "{commands:?} in period {k}");
        }
        let [a, b] = [&straight, &reversed].map(|bench| bench.exchange.status().theta_step);
        assert!(a > 0 && a.abs_diff(b) < 10_000, "{a} and {b}");
    }

    /// Lost counts, and the index that puts them right, move the angle. The shaft turns as fast as before.
    #[test]
    fn a_jump_of_an_indexed_count_is_no_speed() {
        const TURN: u32 = 10_000;
        let mut plate = test_plate();
        plate.motors[0].encoder.counts_per_turn = TURN;
        plate.motors[0].encoder.interface = Interface::IncrementalWithIndex;
        let mut bench = Bench::new(CurrentLoopConfig {
            alignment: Some(EncoderAlignment::default()),
            ..plate.motors[0].current_loop(&plate).unwrap()
        });
        let mut wrong = 0;
        for k in 0..6000u32 {
            // Forty counts are 1.4 mechanical degrees.
            let lost = if (2000..4000).contains(&k) { 40 } else { 0 };
            let stands = MotorSample {
                encoder: (k * 3 + TURN - lost) % TURN,
                ..sample([2048; 3])
            };
            let asked = if k == 0 {
                CurrentReference::default()
            } else {
                ONE_AMPERE
            };
            bench.step(&stands, asked);
            wrong += u32::from(k == 2000 || k == 4000);
            if k > 1000 {
                // Three counts a period are 600 rpm at 20 kHz.
                let step =
                    f64::from(bench.exchange.status().theta_step) * f64::from(TURN) / 2f64.powi(32);
                assert!((step - 3.0).abs() < 0.01, "{step} counts in period {k}");
                assert_eq!(bench.exchange.wrong_readings(), wrong, "in period {k}");
            }
        }
    }
}
