//! Physical units -> the loops' fixed-point formats, once: the whole drive's configuration.

mod alignment;
mod board;
mod compensation;
mod elementary;
mod friction;
mod limits;
mod motor;
mod rejection;
mod runaway;
mod travel;

use crate::base::format::{
    CurrentScale, Gain, MechanicalSpeed, Misfit, SpeedChange, Voltage, fixed_point, quantise,
};
use crate::base::rates::STEPS_PER_LOOK;
use crate::current::current_loop::CurrentLoopConfig;
use crate::plate::{BasePoint, DrivePlate};
use crate::speed::alignment::AlignmentConfig;
use crate::speed::brake::BrakeConfig;
use crate::speed::compensation::CompensationConfig;
use crate::speed::coordinator::{CoordinatorConfig, WanderConfig};
use crate::speed::current_limit::RegenerationConfig;
use crate::speed::disturbance::DisturbanceConfig;
use crate::speed::friction::FrictionConfig;
use crate::speed::notch::NotchConfig;
use crate::speed::profile::ProfileConfig;
use crate::speed::speed_loop::SpeedLoopConfig;
use crate::speed::thermal::HeatConfig;
use crate::watch::follow::BLIND_M;
use crate::watch::runaway::RunawayConfig;
use core::f64::consts::TAU;

/// `?` for `const fn`.
macro_rules! attempt {
    ($result:expr) => {
        match $result {
            Ok(value) => value,
            Err(misfit) => return Err(misfit),
        }
    };
}
use attempt;

/// A brake that takes longer, s, is none.
const BRAKE_MAX_S: f64 = 10.0;

/// Everything that the drive's steps are configured with, in the order in which it lies in memory: what each step of the speed task
/// reads comes first, so that one address in a register serves for that and for the task's state before it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct DriveConfig {
    /// Screw, nut.
    pub speed_loops: [SpeedLoopConfig; 2],
    /// The pair.
    pub coordinator: CoordinatorConfig,
    /// When a motor's motion is not in hand: screw, nut.
    pub runaway: [RunawayConfig; 2],
    /// Where braking fades out: screw, nut.
    pub regeneration: [RegenerationConfig; 2],
    /// What keeps a disturbance from the table: screw, nut.
    pub disturbance: [DisturbanceConfig; 2],
    /// What of both current references is left out.
    pub notch: NotchConfig,
    /// What is fed forward against friction.
    pub friction: FrictionConfig,
    /// Screw, nut.
    pub current_loops: [CurrentLoopConfig; 2],
    /// How windings and bridges warm up: screw, nut.
    pub heat: [HeatConfig; 2],
    /// What holds the table while the bridges are off.
    pub brake: BrakeConfig,
    /// Looks at the interlock in which a command must be renewed.
    pub heartbeat_looks: u32,
    /// Current-loop periods per step of the speed task.
    pub speed_divider: u32,
    /// Furthest that a motor which brings the table to rest may turn while the scale does not count, 2^-32 turn.
    pub blind_max: u32,
    /// What repeats with an angle and is compensated.
    pub compensation: CompensationConfig,
    /// The alignment of both rotors.
    pub alignment: AlignmentConfig,
}

impl DrivePlate {
    /// The drive's configuration.
    ///
    /// # Errors
    /// [`Misfit`] naming the first number that does not fit its format or its physical range.
    pub const fn config(&self) -> Result<DriveConfig, Misfit> {
        attempt!(self.bounds());
        let current_loops = attempt!(self.current_loops());
        let speed_loops = attempt!(self.speed_loops());
        let coordinator = attempt!(self.coordinator());
        Ok(DriveConfig {
            current_loops,
            speed_loops,
            coordinator,
            alignment: attempt!(self.alignment(&speed_loops, &coordinator)),
            runaway: attempt!(self.runaways()),
            heat: attempt!(self.heats()),
            regeneration: attempt!(self.regenerations()),
            compensation: attempt!(self.compensation()),
            friction: attempt!(self.friction()),
            disturbance: attempt!(self.disturbances()),
            notch: attempt!(self.notch()),
            brake: attempt!(self.brake()),
            heartbeat_looks: attempt!(self.heartbeat_looks()),
            speed_divider: self.board.speed_divider,
            blind_max: self.blind_max(),
        })
    }

    /// The same in the place of another, part by part: a whole configuration is more than a drive has on its stack.
    ///
    /// # Errors
    /// As [`DrivePlate::config`]; some parts are those of this plate then, and the others not.
    pub fn configure(&self, config: &mut DriveConfig) -> Result<(), Misfit> {
        let DriveConfig {
            current_loops,
            speed_loops,
            coordinator,
            alignment,
            runaway,
            heat,
            regeneration,
            compensation,
            friction,
            disturbance,
            notch,
            brake,
            heartbeat_looks,
            speed_divider,
            blind_max,
        } = config;
        self.bounds()?;
        put(current_loops, || self.current_loops())?;
        put(speed_loops, || self.speed_loops())?;
        put(coordinator, || self.coordinator())?;
        put(alignment, || self.alignment(speed_loops, coordinator))?;
        put(runaway, || self.runaways())?;
        put(heat, || self.heats())?;
        put(regeneration, || self.regenerations())?;
        put(compensation, || self.compensation())?;
        put(friction, || self.friction())?;
        put(disturbance, || self.disturbances())?;
        put(notch, || self.notch())?;
        put(brake, || self.brake())?;
        put(heartbeat_looks, || self.heartbeat_looks())?;
        *speed_divider = self.board.speed_divider;
        *blind_max = self.blind_max();
        Ok(())
    }

    /// The same for a plate that differs in what takes effect [at once](crate::plate::parameter::Effect::AtOnce): the other parts stay.
    ///
    /// # Errors
    /// As [`DrivePlate::configure`].
    pub fn configure_at_once(&self, config: &mut DriveConfig) -> Result<(), Misfit> {
        let DriveConfig {
            speed_loops,
            coordinator,
            alignment,
            compensation,
            friction,
            ..
        } = config;
        self.bounds()?;
        put(speed_loops, || self.speed_loops())?;
        put(coordinator, || self.coordinator())?;
        put(alignment, || self.alignment(speed_loops, coordinator))?;
        put(compensation, || self.compensation())?;
        put(friction, || self.friction())
    }

    /// What no part of the configuration says.
    const fn bounds(&self) -> Result<(), Misfit> {
        attempt!(within(
            "speed divider",
            "periods",
            self.board.speed_divider as f64,
            0.5,
            64.5
        ));
        self.travel_fits()
    }

    const fn current_loops(&self) -> Result<[CurrentLoopConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([
            attempt!(screw.current_loop(self)),
            attempt!(nut.current_loop(self)),
        ])
    }

    const fn speed_loops(&self) -> Result<[SpeedLoopConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([
            attempt!(screw.speed_loop(self)),
            attempt!(nut.speed_loop(self)),
        ])
    }

    const fn runaways(&self) -> Result<[RunawayConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([attempt!(screw.runaway(self)), attempt!(nut.runaway(self))])
    }

    const fn heats(&self) -> Result<[HeatConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([attempt!(screw.heat(self)), attempt!(nut.heat(self))])
    }

    const fn regenerations(&self) -> Result<[RegenerationConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([
            attempt!(screw.regeneration(self)),
            attempt!(nut.regeneration(self)),
        ])
    }

    const fn disturbances(&self) -> Result<[DisturbanceConfig; 2], Misfit> {
        let [screw, nut] = &self.motors;
        Ok([
            attempt!(screw.disturbance(self)),
            attempt!(nut.disturbance(self)),
        ])
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    const fn brake(&self) -> Result<BrakeConfig, Misfit> {
        let (brake, step) = (&self.brake, self.speed_step());
        attempt!(within(
            "time in which the brake closes",
            "s",
            brake.closing_s,
            -step,
            BRAKE_MAX_S
        ));
        attempt!(within(
            "time in which the brake opens",
            "s",
            brake.opening_s,
            -step,
            BRAKE_MAX_S
        ));
        Ok(BrakeConfig {
            fitted: brake.fitted,
            closing_steps: (brake.closing_s / step + 0.5) as u32,
            opening_steps: (brake.opening_s / step + 0.5) as u32,
        })
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    const fn blind_max(&self) -> u32 {
        // The cast saturates; a turn or more never ends it.
        (BLIND_M / self.feed.lead_m * 4_294_967_296.0) as u32
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    const fn heartbeat_looks(&self) -> Result<u32, Misfit> {
        let looks = self.command.heartbeat_s / (self.speed_step() * STEPS_PER_LOOK as f64);
        attempt!(within(
            "time of the heartbeat",
            "looks of the speed task",
            looks,
            1.0,
            1_000_000.0
        ));
        Ok(looks as u32)
    }

    const fn coordinator(&self) -> Result<CoordinatorConfig, Misfit> {
        let (feed, step) = (&self.feed, self.speed_step());
        let [screw, nut] = &self.motors;
        attempt!(positive("lead", "m", feed.lead_m));
        let per_metre = TAU / feed.lead_m;
        let table = attempt!(profile(
            ["table acceleration", "table jerk"],
            feed.acceleration_max * per_metre * step,
            feed.jerk_max * per_metre * step * step,
        ));
        let base = attempt!(profile(
            ["base acceleration", "base jerk"],
            feed.base_acceleration_max * step,
            feed.base_jerk_max * step * step,
        ));
        attempt!(self.base_table());
        Ok(CoordinatorConfig {
            pole_pairs: [screw.pole_pairs.cast_signed(), nut.pole_pairs.cast_signed()],
            radians_per_metre: attempt!(fixed_point("screw turns per metre", "rad/m", per_metre)),
            velocity_max: attempt!(fixed_point(
                "table velocity limit",
                "m/s",
                feed.velocity_max
            )),
            speed_max: [
                attempt!(fixed_point("screw speed limit", "rad/s", screw.speed_max())),
                attempt!(fixed_point("nut speed limit", "rad/s", nut.speed_max())),
            ],
            table,
            base,
            wander: attempt!(self.wander()),
        })
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    const fn wander(&self) -> Result<WanderConfig, Misfit> {
        let (plate, feed) = (&self.base, &self.feed);
        if plate.wander_rad_s == 0.0 {
            return Ok(WanderConfig {
                step: 0,
                half: MechanicalSpeed::ZERO,
            });
        }
        let half = plate.wander_rad_s / 2.0;
        let steps = plate.wander_s / self.speed_step();
        attempt!(within(
            "time of a wander",
            "steps of the speed task",
            steps,
            100.0,
            4e9
        ));
        let omega = TAU / plate.wander_s;
        // A cosine's acceleration and jerk.
        attempt!(within(
            "acceleration of a wander",
            "rad/s^2",
            half * omega,
            0.0,
            feed.base_acceleration_max
        ));
        attempt!(within(
            "jerk of a wander",
            "rad/s^3",
            half * omega * omega,
            0.0,
            feed.base_jerk_max
        ));
        Ok(WanderConfig {
            step: (4_294_967_296.0 / steps) as u32,
            half: attempt!(fixed_point("half of a wander", "rad/s", half)),
        })
    }

    /// # Errors
    /// [`Misfit`] if the table of base speeds does not rise or ends beyond the feed's velocity. Whether motors turn that fast is
    /// checked with each command.
    const fn base_table(&self) -> Result<(), Misfit> {
        let mut left: &[BasePoint] = &self.base.table;
        let (mut below, mut ended) = (0.0, false);
        while let [point, more @ ..] = left {
            if point.velocity == 0.0 {
                ended = true;
            } else {
                // After the end none may follow.
                let most = if ended {
                    0.0
                } else {
                    self.feed.velocity_max * 1.000_001
                };
                attempt!(within(
                    "table velocity of a base speed",
                    "m/s",
                    point.velocity,
                    below,
                    most
                ));
                below = point.velocity;
            }
            left = more;
        }
        Ok(())
    }
}

/// A part of a configuration, where it belongs.
#[inline(never)]
fn put<T>(part: &mut T, made: impl FnOnce() -> Result<T, Misfit>) -> Result<(), Misfit> {
    // Not by `?`, which would have the part on the stack once more.
    match made() {
        Ok(made) => *part = made,
        Err(misfit) => return Err(misfit),
    }
    Ok(())
}

/// Square root by Newton's method, for configuration; 0 of what has none.
#[inline(never)]
const fn square_root(x: f64) -> f64 {
    if !(x > 0.0 && x < f64::MAX) {
        return 0.0;
    }
    let mut root = if x > 1.0 { x } else { 1.0 };
    let mut step = 0u32;
    // Halves down to the root's size first: 600 steps are enough for any f64.
    while step < 600 {
        root = 0.5 * (root + x / root);
        step = step.saturating_add(1);
    }
    root
}

impl DriveConfig {
    /// The same of a drive that takes its encoders to lie as `plate` says, and so is ready without an alignment.
    #[must_use]
    pub const fn aligned(mut self, plate: &DrivePlate) -> Self {
        let [screw, nut] = &mut self.current_loops;
        let [screw_plate, nut_plate] = &plate.motors;
        screw.alignment = Some(screw_plate.encoder.alignment());
        nut.alignment = Some(nut_plate.encoder.alignment());
        self
    }
}

#[inline(never)]
const fn profile(
    [acceleration_name, jerk_name]: [&'static str; 2],
    acceleration: f64,
    jerk: f64,
) -> Result<ProfileConfig, Misfit> {
    let acceleration = attempt!(quantise(
        acceleration_name,
        "rad/s a step",
        acceleration,
        28
    ));
    let jerk = attempt!(quantise(jerk_name, "rad/s a step^2", jerk, 28));
    attempt!(within(
        acceleration_name,
        "2^-28 rad/s a step",
        acceleration as f64,
        -0.5,
        2.2e9
    ));
    attempt!(within(
        jerk_name,
        "2^-28 rad/s a step^2",
        jerk as f64,
        -0.5,
        2.2e9
    ));
    Ok(ProfileConfig::new(
        SpeedChange::from_bits(acceleration),
        SpeedChange::from_bits(jerk),
    ))
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;

const fn power_of_two(n: u32) -> f64 {
    1u64.wrapping_shl(n) as f64
}

#[allow(clippy::cast_possible_truncation)]
const fn rounded([a, b, c]: [f64; 3]) -> [i32; 3] {
    [
        (a + half(a)) as i32,
        (b + half(b)) as i32,
        (c + half(c)) as i32,
    ]
}

const fn half(x: f64) -> f64 {
    if x < 0.0 { -0.5 } else { 0.5 }
}

/// A gain of the current loop, from V/A, for currents of `scale`: at most 2048 V/A.
/// Halvings, 16 at most, that bring a [`Gain`]'s multiplier within its word.
const fn shift_of(multiplier: f64) -> u32 {
    let mut shift = 0u32;
    while multiplier / power_of_two(shift) >= 2_147_483_647.0 && shift < 16 {
        shift = shift.saturating_add(1);
    }
    shift
}

const fn gain(name: &'static str, gain: f64, scale: CurrentScale) -> Result<Gain, Misfit> {
    attempt!(within(name, "V/A", gain, -2048.0, 2048.0));
    // Times 2^32 it makes a voltage's last steps of a current's.
    let fraction = Voltage::FRAC_NBITS
        .saturating_add(32)
        .saturating_sub(scale.fraction);
    let shift = shift_of(gain.abs() * power_of_two(fraction));
    let multiplier = attempt!(quantise(name, "V/A", gain, fraction.saturating_sub(shift)));
    Ok(Gain { multiplier, shift })
}

#[inline(never)]
const fn within(
    name: &'static str,
    unit: &'static str,
    value: f64,
    above: f64,
    below: f64,
) -> Result<(), Misfit> {
    if value > above && value < below {
        Ok(())
    } else {
        Err(Misfit {
            name,
            unit,
            value,
            least: above,
            below,
        })
    }
}

const fn positive(name: &'static str, unit: &'static str, value: f64) -> Result<(), Misfit> {
    within(name, unit, value, 0.0, f64::MAX)
}
