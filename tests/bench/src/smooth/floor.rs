//! What sets the ripple that is left: each imperfection switched off alone.

use super::bench::{COLD_S, LEARNING_S};
use super::machine::without_ripple;
use super::{Machine, Smoothness, drive, orders, settle, setup, smoothness, velocities};
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use hal_sim::seam::Straight;
use hal_sim::sensors::Sensors;
use plant::effects::AnyEffect;

/// What is switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Without {
    /// Nothing.
    Nothing,
    /// Noise of the current sensors' converters.
    CurrentNoise,
    /// The same and their counts: 16 bits.
    Adc,
    /// The encoders' counts: 30 bits.
    Encoders,
    /// Counts and noise of the table's scale.
    Scale,
    /// The timer's counts: three times as many a period: the formats hold no more.
    Pwm,
    /// The bridges' dead time.
    DeadTime,
    /// The residual of the ripple that the orders compensate: no defect of motors and feed but the load.
    Defects,
    /// All of these but the last.
    Sensors,
}

impl Without {
    /// All.
    pub const ALL: [Self; 9] = [
        Self::Nothing,
        Self::CurrentNoise,
        Self::Adc,
        Self::Encoders,
        Self::Scale,
        Self::Pwm,
        Self::DeadTime,
        Self::Defects,
        Self::Sensors,
    ];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::CurrentNoise => "noise of the current sensors",
            Self::Adc => "noise and counts of the current sensors",
            Self::Encoders => "counts of the encoders",
            Self::Scale => "counts and noise of the scale",
            Self::Pwm => "two thirds of the counts of the PWM",
            Self::DeadTime => "dead time",
            Self::Defects => "all harmonics and errors of motors and feed",
            Self::Sensors => "all of these: sensors, PWM, dead time",
        }
    }

    fn apply(self, setup: &mut Setup) {
        let ideal = Sensors::ideal();
        let (board, all) = (&mut setup.board, self == Self::Sensors);
        let sensors = &mut board.sensors;
        if self == Self::CurrentNoise {
            sensors.current.noise = 0.0;
        }
        if all || self == Self::Adc {
            // One converter for both.
            (sensors.current, sensors.bus) = (ideal.current, ideal.bus);
        }
        if all || self == Self::Encoders {
            sensors.encoders = ideal.encoders;
        }
        if all || self == Self::Scale {
            sensors.scale_count_m = 1e-9;
            sensors.scale_noise_m = 0.0;
        }
        if all || self == Self::Pwm {
            board.timer_hz *= 3.0;
        }
        let effects = &mut setup.model.effects;
        if all || self == Self::DeadTime {
            effects.retain(|effect| !matches!(effect.effect(), AnyEffect::DeadTime(_)));
        }
        if self == Self::Defects {
            without_ripple(&mut setup.model);
        }
    }
}

/// What ours leaves at a table velocity, m/s, after it has learned, with one thing switched off.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured, or leaves the point by a fault.
pub fn floor(
    machine: Machine,
    nut_rpm: f64,
    velocity: f64,
    without: Without,
) -> Result<Smoothness, ExperimentError> {
    let mut setup = setup(machine, 1);
    without.apply(&mut setup);
    let plate = orders(&setup, LEARNING_S, true);
    let point = OperatingPoint {
        velocity,
        base: nut_rpm * RPM,
    };
    smoothness(&mut drive(&setup, plate)?, point, COLD_S)
}

/// What the single drive leaves at a table velocity, m/s, from cold: it has learned at that velocity in the double drive, whose shafts turn
/// fast. What is learned of a torque does not depend on the speed.
///
/// # Errors
/// As [`floor`].
pub fn learned_in_double_drive(
    machine: Machine,
    velocity: f64,
    nut_rpm: f64,
    seconds: f64,
    seed: u64,
) -> Result<Smoothness, ExperimentError> {
    let setup = setup(machine, seed);
    let mut drive = drive(&setup, orders(&setup, LEARNING_S, true))?;
    let learns = OperatingPoint {
        velocity,
        base: nut_rpm * RPM,
    };
    settle(&mut drive, learns, &mut Straight)?;
    velocities(&mut drive, seconds, &mut Straight)?;
    smoothness(
        &mut drive,
        OperatingPoint {
            base: 0.0,
            ..learns
        },
        0.0,
    )
}

/// What a board as it ships leaves at a table velocity, m/s, of a machine without any ripple, with nothing to learn: its sensors, PWM and dead time.
///
/// # Errors
/// As [`floor`].
pub fn board_alone(
    machine: Machine,
    nut_rpm: f64,
    velocity: f64,
    seed: u64,
) -> Result<Smoothness, ExperimentError> {
    let mut setup = setup(machine, seed);
    without_ripple(&mut setup.model);
    let point = OperatingPoint {
        velocity,
        base: nut_rpm * RPM,
    };
    smoothness(&mut setup.drive()?, point, 0.0)
}
