//! One motor's current loop: raw sample in, compare values out, once a PWM period.
//!
//! Timing: the sample is taken at the counter's turn; the compare values of this step take effect at the next turn
//! and act for one period, so on average one and a half periods after the sample. The voltage is turned forward by
//! the angle that the rotor gains in that time.

use crate::encoder::Interface;
use crate::encoder_watch::{EncoderWatch, EncoderWatchConfig, Seen};
use crate::format::{Angle, Current, ScaledCurrent, Voltage};
use crate::modulation::{BusScale, ModulationConfig};
use crate::observer::{Motion, Observer, ObserverConfig};
use crate::regulator::{Regulator, RegulatorConfig, RegulatorOutput};
use crate::sense::{BusSense, Codes, CurrentSense, ZeroCalibration};
use crate::transform::{DirectQuadrature, Rotation};

/// Configuration of a motor's current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoopConfig {
    /// ADC counts to currents.
    pub sense: CurrentSense,
    /// ADC counts to bus voltage.
    pub bus: BusSense,
    /// Raw word to encoder counts.
    pub encoder: Interface,
    /// Encoder counts to angle and speed.
    pub observer: ObserverConfig,
    /// Whether the encoder is to be trusted.
    pub encoder_watch: EncoderWatchConfig,
    /// Current error to voltage.
    pub regulator: RegulatorConfig,
    /// Voltage to compare values.
    pub modulation: ModulationConfig,
    /// The current zeros are to be measured; otherwise the nominal ones are trusted.
    pub measure_zeros: bool,
}

/// What the board read at the counter's turn.
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

/// What a current loop does with its bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Outputs off.
    #[default]
    Off,
    /// Outputs off, zero currents being measured.
    Calibrate,
    /// Outputs on, currents controlled.
    Drive,
}

/// What the speed task asks of a current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentReference {
    /// What to do with the bridge.
    pub mode: Mode,
    /// Torque-making current, A; `i_d` is held at 0 (Eq 6).
    pub i_q: Current,
}

/// How far an offset calibration is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Calibration {
    /// Not done.
    #[default]
    Pending,
    /// The zeros are measured, or the nominal ones trusted, and in use.
    Done,
    /// A zero lies further from its nominal place than a healthy sensor's: the nominal ones stay in use.
    OutOfRange,
}

/// The phase currents of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Codes of the phases.
    pub codes: Codes,
    /// Current.
    pub current: DirectQuadrature<ScaledCurrent>,
}

/// What a current loop knows after a period with its bridge off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rested {
    /// How far the offset calibration is.
    pub calibration: Calibration,
    /// The break input has stopped the bridge.
    pub broken: bool,
    /// The encoder's count stands while the shaft turns, or too many of its readings are wrong.
    pub encoder_stuck: bool,
}

/// What a current loop knows after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorEstimate {
    /// Angle and speed.
    pub motion: Motion,
    /// Measured phase currents, A.
    pub phases: [Current; 3],
    /// Measured current, A.
    pub current: DirectQuadrature<Current>,
    /// Commanded voltage, V.
    pub voltage: DirectQuadrature<Voltage>,
    /// Measured bus voltage, V.
    pub bus: Voltage,
    /// The voltage circle cut the command.
    pub voltage_limited: bool,
    /// The break input has stopped the bridge.
    pub broken: bool,
    /// The encoder's count stands while the shaft turns, or too many of its readings are wrong: the bridge is off.
    pub encoder_stuck: bool,
    /// This reading of the encoder is wrong: the observer held what it predicted, or followed a jump.
    pub encoder_wrong: bool,
    /// How far the offset calibration is.
    pub calibration: Calibration,
}

/// What the bridge shall do from the next turn of its counter on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PwmCommand {
    /// Timer compare values of phases a, b, c.
    pub compare: [u16; 3],
    /// The six outputs follow the compare values; otherwise all are off.
    pub enable: bool,
}

/// State of one motor's current loop. The configuration comes with each step: where it is a constant, as in the
/// firmware, the compiler puts its numbers into the instructions.
#[derive(Clone, Copy, Debug)]
pub struct CurrentLoop {
    observer: Observer,
    encoder_watch: EncoderWatch,
    regulator: Regulator,
    /// Zeros of the current channels.
    zeros: Codes,
    zero_calibration: ZeroCalibration,
    calibration: Calibration,
    /// The observer knows where the shaft is.
    started: bool,
}

impl CurrentLoop {
    /// A loop at rest with nominal current zeros.
    #[must_use]
    pub const fn new(config: &CurrentLoopConfig) -> Self {
        Self {
            observer: Observer::new(),
            encoder_watch: EncoderWatch::new(),
            regulator: Regulator::new(),
            zeros: config.sense.zeros,
            zero_calibration: ZeroCalibration::new(),
            calibration: if config.measure_zeros {
                Calibration::Pending
            } else {
                Calibration::Done
            },
            started: false,
        }
    }

    /// One PWM period: the steps below in their order, with all that is known after them. The firmware takes the steps one
    /// by one, with its registers between them: each is read where it is needed.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &CurrentLoopConfig,
        sample: &MotorSample,
        reference: CurrentReference,
        scale: BusScale,
    ) -> (PwmCommand, MotorEstimate) {
        let (counts, motion) = self.observe(config, sample.encoder);
        let drive = reference.mode == Mode::Drive;
        let seen = self.watch(config, counts, &motion, drive);
        let measured = self.measure(config, sample.current, &motion);
        let amperes = config.sense.scale;
        let mut estimate = MotorEstimate {
            motion,
            phases: config.sense.phases(measured.codes),
            current: DirectQuadrature {
                d: amperes.current(measured.current.d),
                q: amperes.current(measured.current.q),
            },
            bus: config.bus.voltage(sample.bus),
            broken: sample.broken,
            encoder_wrong: seen.wrong,
            calibration: self.calibration,
            ..MotorEstimate::default()
        };
        let mut command = PwmCommand::default();
        if drive && !sample.broken && self.may_drive() {
            let i_q = amperes.scaled(reference.i_q);
            let output = self.regulate(config, i_q, &measured, &motion, sample.bus.into());
            command.compare = Self::modulate(
                config,
                output.voltage,
                &measured,
                &motion,
                scale,
                sample.bus.into(),
            );
            command.enable = true;
            estimate.voltage = output.voltage;
            estimate.voltage_limited = output.limited;
            return (command, estimate);
        }
        let rested = self.rest(config, sample, counts, reference.mode);
        estimate.calibration = rested.calibration;
        estimate.encoder_stuck = rested.encoder_stuck;
        (command, estimate)
    }

    /// The bridge may be closed: the shaft's place is known, and the encoder has not failed.
    #[must_use]
    #[inline(always)]
    pub fn may_drive(&self) -> bool {
        self.started && !self.encoder_watch.failed()
    }

    /// The encoder's raw word -> its counts, `None` of a reading that is wrong, where the shaft is and how fast it turns.
    #[inline(always)]
    pub fn observe(&mut self, config: &CurrentLoopConfig, encoder: u32) -> (Option<u32>, Motion) {
        let counts = config.encoder.counts(encoder);
        (counts, self.observer.follow(&config.observer, counts))
    }

    /// ADC counts of the phases -> currents.
    #[must_use]
    #[inline(always)]
    pub fn measure(
        &self,
        config: &CurrentLoopConfig,
        counts: [u16; 3],
        motion: &Motion,
    ) -> Measured {
        let codes = config.sense.codes(counts, self.zeros);
        let rotation = Rotation::new(motion.theta_e);
        let current = rotation.park(config.sense.vector(codes));
        Measured { codes, current }
    }

    /// Whether the encoder is to be trusted, once in each period; `drive`: the bridge is asked to be on.
    #[inline(always)]
    pub fn watch(
        &mut self,
        config: &CurrentLoopConfig,
        counts: Option<u32>,
        motion: &Motion,
        drive: bool,
    ) -> Seen {
        self.encoder_watch
            .step(&config.encoder_watch, counts, motion, drive)
    }

    /// Current error -> voltage, with the reference `i_q` in the loop's scale; `i_d` is held at 0.
    #[inline(always)]
    pub fn regulate(
        &mut self,
        config: &CurrentLoopConfig,
        i_q: ScaledCurrent,
        measured: &Measured,
        motion: &Motion,
        bus: u32,
    ) -> RegulatorOutput {
        self.regulator.step(
            &config.regulator,
            i_q,
            measured.current,
            motion.theta_e_step,
            || config.modulation.circle(bus),
        )
    }

    /// Voltage -> compare values, turned to where the rotor will be in the middle of their period.
    #[must_use]
    #[inline(always)]
    pub fn modulate(
        config: &CurrentLoopConfig,
        voltage: DirectQuadrature<Voltage>,
        measured: &Measured,
        motion: &Motion,
        scale: BusScale,
        bus: u32,
    ) -> [u16; 3] {
        let realised_at = motion.theta_e.plus(three_halves(motion.theta_e_step));
        let v = Rotation::second(realised_at).inverse_park(voltage);
        config.modulation.compare(v, measured.codes, scale, bus)
    }

    /// The rest of a period with the bridge off: the regulator is emptied, and with [`Mode::Calibrate`] the current
    /// zeros are measured.
    pub fn rest(
        &mut self,
        config: &CurrentLoopConfig,
        sample: &MotorSample,
        counts: Option<u32>,
        mode: Mode,
    ) -> Rested {
        if let (false, Some(counts)) = (self.started, counts) {
            self.observer = Observer::at(&config.observer, counts);
            self.started = true;
        }
        self.regulator = Regulator::new();
        if mode == Mode::Calibrate && self.calibration == Calibration::Pending {
            self.calibrate(&config.sense, sample.current);
        }
        Rested {
            calibration: self.calibration,
            broken: sample.broken,
            encoder_stuck: self.encoder_watch.failed(),
        }
    }

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

/// The angle gained in one and a half samples, of a quarter turn each at most.
#[allow(clippy::arithmetic_side_effects)]
fn three_halves(step: i32) -> Angle {
    Angle((step + (step >> 1)).cast_unsigned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    /// A loop with its configuration.
    struct Configured(CurrentLoopConfig, CurrentLoop);

    impl Configured {
        fn step(
            &mut self,
            sample: &MotorSample,
            reference: CurrentReference,
        ) -> (PwmCommand, MotorEstimate) {
            let scale = self.0.modulation.bus_scale(sample.bus);
            self.1.step(&self.0, sample, reference, scale)
        }
    }

    fn current_loop() -> Configured {
        let plate = test_plate();
        let config = plate.motors[0].current_loop(&plate).unwrap();
        let mut started = Configured(config, CurrentLoop::new(&config));
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
        i_q: Current::ONE,
    };

    #[test]
    fn torque_current_is_ninety_degrees_ahead_of_the_flux() {
        let (command, estimate) = current_loop().step(&sample([2048; 3]), ONE_AMPERE);
        assert!(command.enable);
        let [a, b, c] = command.compare.map(i32::from);
        // At theta_e = 0 the q axis is beta: b above, c below, a between.
        assert!(
            b > a && a > c && (b - a - (a - c)).abs() <= 1,
            "{a} {b} {c}"
        );
        assert!((estimate.voltage.q.to_num::<f64>() - 23.08).abs() < 0.01);
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
                    i_q: Current::ZERO,
                };
                command = current_loop.step(&sample, reference).0;
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
            let (command, estimate) =
                current_loop.step(&sample, CurrentReference { mode, ..ONE_AMPERE });
            assert_eq!(command, PwmCommand::default());
            assert_eq!(estimate.broken, broken);
        }
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
                last = current_loop
                    .step(&sample([zero, 2048, 0]), ask)
                    .1
                    .calibration;
            }
            assert_eq!(last, expected);
            let (_, estimate) = current_loop.step(&sample([zero, 2048, 0]), ask);
            assert_eq!(estimate.phases[0] == 0, expected == Calibration::Done);
        }
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
                let reference = CurrentReference { mode: Mode::Drive, i_q: Current::from_bits(i_q) };
                let (command, _) = current_loop.step(&sample, reference);
                prop_assert!(command.compare.iter().all(|&c| c <= 4250));
            }
        }
    }
}
