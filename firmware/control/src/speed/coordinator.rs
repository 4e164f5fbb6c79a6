//! A table velocity and a base speed -> two speed references (Eqs 7 and 8).
//!
//! The screw turns at the base speed plus the table's share, the nut at the base speed; the table moves with the
//! difference, so a ramp of the base speed does not move it. Base speed 0 is the single drive (CDFS): the nut holds
//! still under control.
//!
//! When a motor is at its torque or voltage limit, the profiles ease off: a ramp slows to what the motor can follow. If
//! it falls behind all the same (the bus sags, the load grows), the pair gives way: the base speed is lowered by as
//! much as that motor lags, so that the other slows with it and their difference stays; only what the base speed
//! cannot give comes off the table's velocity. Neither changes its sign. Once the motor follows again, what was given
//! is taken back at an eighth of the acceleration limit, so that taking it back does not limit the motor again.
//!
//! The base speed is free, so it may wander while it stands at its target: `half (1 - cos)` away from 0, so that no order of a ripple
//! stays at the frequency of a resonance. It begins and, where the target changes, goes over to the profile without a
//! step in speed or acceleration.

use crate::base::format::{
    Angle, Current, ElectricalChange, MechanicalSpeed, ProfileState, Speed, SpeedChange,
    TableVelocity, narrow, narrow_bits,
};
use crate::speed::profile::{Profile, ProfileConfig};
use crate::speed::speed_loop::SpeedReference;
use fixed::types::I20F12;

/// Configuration of the coordinator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoordinatorConfig {
    /// Electrical turns a mechanical turn: screw, nut.
    pub pole_pairs: [i32; 2],
    /// `2*pi / lead`, rad/m: Eq 8 in mechanical angles.
    pub radians_per_metre: I20F12,
    /// Largest table velocity.
    pub velocity_max: TableVelocity,
    /// Largest speeds of screw and nut, mechanical.
    pub speed_max: [MechanicalSpeed; 2],
    /// Limits of the table's share, as an angular speed.
    pub table: ProfileConfig,
    /// Limits of the base speed.
    pub base: ProfileConfig,
    /// How the base speed wanders.
    pub wander: WanderConfig,
}

impl CoordinatorConfig {
    /// Fastest that the screw may turn against the nut.
    #[must_use]
    pub fn relative_max(&self) -> MechanicalSpeed {
        narrow(self.velocity_max.wide_mul(self.radians_per_metre))
    }
}

/// How the base speed wanders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WanderConfig {
    /// Of a whole wander in a step, 2^-32; 0: it does not.
    pub step: u32,
    /// Half of its way, not negative.
    pub half: MechanicalSpeed,
}

impl WanderConfig {
    /// Furthest from a base speed, with its sign; none from rest.
    #[inline(always)]
    fn furthest(&self, base: MechanicalSpeed) -> MechanicalSpeed {
        let way = self.half.saturating_add(self.half);
        if base < MechanicalSpeed::ZERO {
            way.saturating_neg()
        } else if base == MechanicalSpeed::ZERO {
            MechanicalSpeed::ZERO
        } else {
            way
        }
    }
}

/// What is asked of the pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Table velocity, m/s.
    pub velocity: TableVelocity,
    /// Base speed of both motors, mechanical rad/s; 0 is CDFS.
    pub base: MechanicalSpeed,
}

impl Command {
    /// The same, with the table at rest where its way is blocked: forwards, backwards.
    #[must_use]
    pub fn within(self, [forwards, backwards]: [bool; 2]) -> Self {
        let velocity = self.velocity;
        let stays = forwards && velocity > TableVelocity::ZERO
            || backwards && velocity < TableVelocity::ZERO;
        Self {
            velocity: if stays { TableVelocity::ZERO } else { velocity },
            ..self
        }
    }

    /// Not 0 if it is not the other.
    #[must_use]
    #[inline(always)]
    pub(crate) const fn differs(self, other: Self) -> u32 {
        let velocity = self.velocity.to_bits() ^ other.velocity.to_bits();
        let base = self.base.to_bits() ^ other.base.to_bits();
        (velocity | base).cast_unsigned()
    }

    /// Both motors still.
    #[must_use]
    pub const fn rest() -> Self {
        Self {
            velocity: TableVelocity::ZERO,
            base: MechanicalSpeed::ZERO,
        }
    }
}

/// Why a command is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CommandError {
    /// The table velocity is beyond the feed's limit.
    Velocity {
        /// What was asked, m/s.
        asked: TableVelocity,
        /// What is allowed, m/s.
        allowed: TableVelocity,
    },
    /// The screw would turn against the nut faster than the feed may move.
    Relative {
        /// What was asked, mechanical rad/s.
        asked: MechanicalSpeed,
        /// What is allowed, mechanical rad/s.
        allowed: MechanicalSpeed,
    },
    /// A motor's torque set-point is beyond its limit.
    Current {
        /// 0 is the screw, 1 the nut.
        motor: usize,
        /// What was asked of it, A.
        asked: Current,
        /// What is allowed, A.
        allowed: Current,
    },
    /// A motor would have to turn faster than it may.
    Speed {
        /// 0 is the screw, 1 the nut.
        motor: usize,
        /// What was asked of it, mechanical rad/s.
        asked: MechanicalSpeed,
        /// What is allowed, mechanical rad/s.
        allowed: MechanicalSpeed,
    },
}

impl core::fmt::Display for CommandError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Velocity { asked, allowed } => {
                write!(
                    f,
                    "a table velocity of {asked:.4} m/s was asked, but the feed allows ±{allowed:.4} m/s: ask for less"
                )
            }
            Self::Relative { asked, allowed } => write!(
                f,
                "the screw would turn against the nut at up to {asked:.1} rad/s, but the feed allows {allowed:.1} rad/s: lower the speed \
                 limit or the base speed"
            ),
            Self::Current {
                motor,
                asked,
                allowed,
            } => write!(
                f,
                "the {} was asked for {asked:.3} A along q, but its motor allows ±{allowed:.3} A: ask for less torque",
                if *motor == 0 { "screw" } else { "nut" }
            ),
            Self::Speed {
                motor,
                asked,
                allowed,
            } => write!(
                f,
                "the {} would have to turn at {asked:.1} rad/s, but its motor allows ±{allowed:.1} rad/s: lower the base \
                 speed or the table velocity",
                if *motor == 0 { "screw" } else { "nut" }
            ),
        }
    }
}

impl core::error::Error for CommandError {}

/// How a motor follows its reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Following {
    /// Its speed, electrical rad/s.
    pub omega_e: Speed,
    /// It is at its torque or voltage limit.
    pub limited: bool,
}

/// State of the coordinator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Coordinator {
    target_table: ProfileState,
    target_base: ProfileState,
    table: Profile,
    base: Profile,
    /// How much of the speed the pair gives way, mechanical rad/s, never negative.
    given: ProfileState,
    /// Where the base speed's wander is, and how fast it was there in the last step.
    wander: Wander,
    /// What a torque makes of the table's share.
    pushed: Profile,
}

/// State of a wander.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wander {
    /// Of the whole, 2^-32.
    phase: u32,
    value: ProfileState,
    change: SpeedChange,
    /// Steps on its straight line.
    steps: u8,
}

/// Steps until a torque that pushes the table towards a limit has ended at most: 6 ms at 5 kHz, above the latency of the soft limits.
const SEEN_STEPS: i64 = 32;

/// Steps of a wander's straight lines, as a power of two: a cosine a step would be 60 cycles of each.
const WANDER_BITS: u32 = 3;

impl Coordinator {
    /// At rest, and to stay so.
    #[must_use]
    pub const fn new() -> Self {
        let rest = Profile {
            value: ProfileState::ZERO,
            change: SpeedChange::ZERO,
        };
        Self {
            target_table: ProfileState::ZERO,
            target_base: ProfileState::ZERO,
            table: rest,
            base: rest,
            given: ProfileState::ZERO,
            wander: Wander {
                phase: 0,
                value: ProfileState::ZERO,
                change: SpeedChange::ZERO,
                steps: 0,
            },
            pushed: rest,
        }
    }

    /// Takes a new target; the references move there within the limits.
    ///
    /// # Errors
    /// [`CommandError`] if the feed or a motor may not move that fast; the old target stays.
    pub fn command(
        &mut self,
        config: &CoordinatorConfig,
        command: Command,
    ) -> Result<(), CommandError> {
        if command.velocity.saturating_abs() > config.velocity_max {
            return Err(CommandError::Velocity {
                asked: command.velocity,
                allowed: config.velocity_max,
            });
        }
        let table: MechanicalSpeed = narrow(command.velocity.wide_mul(config.radians_per_metre));
        let [screw_max, nut_max] = config.speed_max;
        let wandered = command
            .base
            .saturating_add(config.wander.furthest(command.base));
        let screw = command.base.saturating_add(table);
        let screw_wandered = wandered.saturating_add(table);
        for (motor, asked, allowed) in [
            (0, screw, screw_max),
            (1, command.base, nut_max),
            (0, screw_wandered, screw_max),
            (1, wandered, nut_max),
        ] {
            if asked.saturating_abs() > allowed {
                return Err(CommandError::Speed {
                    motor,
                    asked,
                    allowed,
                });
            }
        }
        self.target_table = table.into();
        self.target_base = command.base.into();
        Ok(())
    }

    /// One step: how the motors follow -> their speed references, screw first.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &CoordinatorConfig,
        following: [Following; 2],
    ) -> [SpeedReference; 2] {
        // Each by itself, as a pair would be written to memory for what is seldom called.
        let [screw, nut] = following;
        if config.wander.step != 0 {
            self.wander.steps = self.wander.steps.wrapping_add(1);
            if self.wander.steps >> WANDER_BITS != 0 {
                self.wander(config, screw.limited || nut.limited);
            }
            let change = ProfileState::from_bits(self.wander.change.to_bits().into());
            // Half of a wander is within 2^30 of 2^-18 rad/s.
            self.wander.value = self.wander.value.wrapping_add(change);
        }
        if screw.limited || nut.limited {
            self.wait(config);
        } else {
            self.table.step(&config.table, self.target_table);
            self.base.step(&config.base, self.target_base);
        }
        let (mut base, mut table) = (self.base.value, self.table.value);
        if screw.limited || nut.limited || self.given != ProfileState::ZERO {
            [base, table] = self.give_way(config, screw, nut);
        }

        let mut base_change = self.base.change;
        if config.wander.step != 0 {
            base = base.wrapping_add(self.wander.value);
            base_change = base_change.saturating_add(self.wander.change);
        }
        // What is given follows a motor, not a plan: no torque is fed forward for it.
        let [screw_pairs, nut_pairs] = config.pole_pairs;
        let reference =
            |omega: ProfileState, change: SpeedChange, pole_pairs: i32| SpeedReference {
                omega_e: electrical(omega, pole_pairs),
                change: electrical_change(change, pole_pairs),
            };
        let screw_change = base_change.saturating_add(self.table.change);
        // Two profiles within 2^33 each.
        #[allow(clippy::arithmetic_side_effects)]
        let screw_speed = base + table;
        [
            reference(screw_speed, screw_change, screw_pairs),
            reference(base, base_change, nut_pairs),
        ]
    }

    /// A motor is about to follow a torque: what is given way and wandered becomes the base speed's own.
    #[cold]
    pub(crate) fn begin_torque(&mut self) {
        let from_base = self.given.min(self.base.value.saturating_abs());
        let Wander { value, change, .. } = core::mem::take(&mut self.wander);
        self.base.value = towards_zero(self.base.value, from_base).saturating_add(value);
        self.base.change = self.base.change.saturating_add(change);
        self.given = ProfileState::ZERO;
        self.pushed = self.table;
    }

    /// One step in which a motor follows a torque, and `held` the base speed: its reference. `speeds` are those of screw and nut,
    /// electrical: the table's share is what they turn against each other, so that a plan begins where they are.
    pub(crate) fn step_torque(
        &mut self,
        config: &CoordinatorConfig,
        held: usize,
        limited: bool,
        speeds: [Speed; 2],
    ) -> SpeedReference {
        if limited {
            self.base.ease(&config.base);
        } else {
            self.base.step(&config.base, self.target_base);
        }
        let [screw, nut] = mechanical(config, speeds);
        let relative = screw.saturating_sub(nut);
        // Over 16 steps: the speeds are measured ones.
        let change = narrow_change(relative.saturating_sub(self.pushed.value));
        let more = change.saturating_sub(self.pushed.change).to_bits() >> 4;
        let gained = self
            .pushed
            .change
            .saturating_add(SpeedChange::from_bits(more));
        self.pushed = Profile {
            value: relative,
            change: gained,
        };
        // What the table gains ends with the torque, once that is seen.
        let gained = ProfileState::from(gained).saturating_mul_int(SEEN_STEPS);
        self.table = Profile {
            value: relative.saturating_add(gained),
            change: SpeedChange::ZERO,
        };
        let pole_pairs = config.pole_pairs.get(held).copied().unwrap_or_default();
        SpeedReference {
            omega_e: electrical(self.base.value, pole_pairs),
            change: electrical_change(self.base.change, pole_pairs),
        }
    }

    /// Motor 0 (screw) or 1 (nut) follows a torque no more: both references begin where the motors are. Gives what its motor's speed
    /// changed by in a step, electrical.
    #[cold]
    pub(crate) fn end_torque(
        &mut self,
        config: &CoordinatorConfig,
        motor: usize,
        speeds: [Speed; 2],
    ) -> ElectricalChange {
        let [screw, nut] = mechanical(config, speeds);
        let [screw_pairs, nut_pairs] = config.pole_pairs;
        let gained = self.pushed.change;
        if motor == 0 {
            self.table.value = screw.saturating_sub(self.base.value);
            electrical_change(gained, screw_pairs)
        } else {
            self.table.value = self.base.value.saturating_sub(nut);
            self.base = Profile {
                value: nut,
                change: SpeedChange::ZERO,
            };
            electrical_change(gained.saturating_neg(), nut_pairs)
        }
    }

    /// Neither reference is on its way to its target; the base speed may wander about it.
    #[must_use]
    #[inline(always)]
    pub fn steady(&self) -> bool {
        self.base.change == SpeedChange::ZERO && self.table.change == SpeedChange::ZERO
    }

    /// The next straight line of the wander, while the base speed stands at a target that is not rest; else the profile goes on from
    /// where the wander is.
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn wander(&mut self, config: &CoordinatorConfig, limited: bool) {
        let stands = self.base.value == self.target_base
            && self.base.change == SpeedChange::ZERO
            && self.target_base != ProfileState::ZERO
            && self.given == ProfileState::ZERO
            && !limited;
        if !stands {
            let Wander { value, change, .. } = core::mem::take(&mut self.wander);
            self.base.value = self.base.value.saturating_add(value);
            self.base.change = self.base.change.saturating_add(change);
            return;
        }
        let phase = (self.wander.phase).wrapping_add(config.wander.step << WANDER_BITS);
        let (cosine, _) = Angle(phase).cos_sin();
        // `1 - cos` is within 2^32 of 2^-31, half a speed within 2^30 of 2^-18.
        let way = (1i64 << 31).wrapping_sub(cosine.to_bits().into());
        let way = i64::from(config.wander.half.to_bits()).wrapping_mul(way) >> 21;
        let value = ProfileState::from_bits(if self.target_base.is_negative() {
            way.wrapping_neg()
        } else {
            way
        });
        let way = value.saturating_sub(self.wander.value).to_bits() >> WANDER_BITS;
        let change = narrow_change(ProfileState::from_bits(way));
        self.wander = Wander {
            phase,
            change,
            steps: 0,
            ..self.wander
        };
    }

    /// What the table's share turns the screw by against the nut, mechanical rad/s.
    #[must_use]
    #[inline(always)]
    pub fn relative(&self) -> Speed {
        narrow(self.table.value)
    }

    /// The same as its reference is planned, with its change a step.
    #[must_use]
    #[inline(always)]
    pub fn planned(&self) -> (Speed, SpeedChange) {
        (self.relative(), self.table.change)
    }

    /// Both references have arrived at rest.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.arrived()
            && self.target_table == ProfileState::ZERO
            && self.target_base == ProfileState::ZERO
    }

    /// Both references are at their targets and neither motor is given way to.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.table.value == self.target_table
            && self.base.value == self.target_base
            && self.given == ProfileState::ZERO
    }

    /// The references wait for a motor that is at its limit; but where it cannot go as fast as is asked, they still go towards
    /// rest: else a stop from there would never end.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn wait(&mut self, config: &CoordinatorConfig) {
        let gives_way = self.given != ProfileState::ZERO;
        let slows = |profile: &Profile, target: ProfileState| {
            gives_way && target.saturating_abs() < profile.value.saturating_abs()
        };
        if slows(&self.table, self.target_table) {
            self.table.step(&config.table, self.target_table);
        } else {
            self.table.ease(&config.table);
        }
        if slows(&self.base, self.target_base) {
            self.base.step(&config.base, self.target_base);
        } else {
            self.base.ease(&config.base);
        }
    }

    /// The pair goes slower than asked, for a motor that cannot follow.
    #[must_use]
    pub fn gives_way(&self) -> bool {
        self.given != ProfileState::ZERO
    }

    /// The speeds of base and table, less what is given way.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn give_way(
        &mut self,
        config: &CoordinatorConfig,
        screw: Following,
        nut: Following,
    ) -> [ProfileState; 2] {
        let [screw_pairs, nut_pairs] = config.pole_pairs;
        let asked = [
            self.base.value.saturating_add(self.table.value),
            self.base.value,
        ];
        let [screw_asked, nut_asked] = asked;
        let lag = lag(screw, screw_asked, screw_pairs).max(lag(nut, nut_asked, nut_pairs));
        let shortfall = lag.saturating_sub(self.given);
        self.given = if shortfall > ProfileState::ZERO {
            // An eighth of the way a step: 1.6 ms at 5 kHz, faster than the speed loop that has to follow.
            self.given.saturating_add(eighth(shortfall))
        } else {
            let limit = ProfileState::from(config.base.acceleration());
            self.given
                .saturating_sub(eighth(limit))
                .max(ProfileState::ZERO)
        };

        let from_base = self.given.min(self.base.value.saturating_abs());
        let from_table = self
            .given
            .saturating_sub(from_base)
            .min(self.table.value.saturating_abs());
        [
            towards_zero(self.base.value, from_base),
            towards_zero(self.table.value, from_table),
        ]
    }
}

/// At least the last bit, so that a rest does not stay without end.
fn eighth(x: ProfileState) -> ProfileState {
    ProfileState::from_bits((x.to_bits() >> 3).max(1))
}

/// By how much a limited motor is slower than asked, mechanical rad/s; 0 if it is not limited or not slower.
fn lag(following: Following, asked: ProfileState, pole_pairs: i32) -> ProfileState {
    if !following.limited {
        return ProfileState::ZERO;
    }
    // A 32-bit division, which the core has; the bits that a 64-bit one would keep are below 2^-16 rad/s.
    let speed = ProfileState::from(
        following
            .omega_e
            .checked_div_int(pole_pairs)
            .unwrap_or_default(),
    );
    let lag = asked.saturating_sub(speed);
    let lag = if asked.is_negative() {
        lag.saturating_neg()
    } else {
        lag
    };
    lag.min(asked.saturating_abs()).max(ProfileState::ZERO)
}

fn towards_zero(x: ProfileState, by: ProfileState) -> ProfileState {
    if x.is_negative() {
        x.saturating_add(by)
    } else {
        x.saturating_sub(by)
    }
}

/// A change of a profile, saturated to its format, which has the same fraction bits.
fn narrow_change(change: ProfileState) -> SpeedChange {
    let end = i64::from(i32::MAX);
    #[allow(clippy::cast_possible_truncation)]
    SpeedChange::from_bits(change.to_bits().clamp(end.wrapping_neg(), end) as i32)
}

/// Electrical speeds as mechanical ones: 32-bit divisions, which the core has.
fn mechanical(config: &CoordinatorConfig, [screw, nut]: [Speed; 2]) -> [ProfileState; 2] {
    let [screw_pairs, nut_pairs] = config.pole_pairs;
    [(screw, screw_pairs), (nut, nut_pairs)].map(|(omega_e, pole_pairs)| {
        ProfileState::from(omega_e.checked_div_int(pole_pairs).unwrap_or_default())
    })
}

#[inline(always)]
pub(crate) fn electrical(omega: ProfileState, pole_pairs: i32) -> Speed {
    let narrow_omega: MechanicalSpeed = narrow(omega);
    // 31 bits times 8.
    narrow_bits(
        i64::from(narrow_omega.to_bits()).wrapping_mul(i64::from(pole_pairs)),
        2,
    )
}

#[inline(always)]
fn electrical_change(change: SpeedChange, pole_pairs: i32) -> ElectricalChange {
    narrow_bits(
        i64::from(change.to_bits()).wrapping_mul(i64::from(pole_pairs)),
        8,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;
    use std::format;

    fn config() -> CoordinatorConfig {
        test_plate().config().unwrap().coordinator
    }

    fn command(velocity: f64, rpm: f64) -> Command {
        Command {
            velocity: TableVelocity::from_num(velocity),
            base: MechanicalSpeed::from_num(rpm * core::f64::consts::TAU / 60.0),
        }
    }

    /// The motors follow perfectly.
    fn run(coordinator: &mut Coordinator, config: &CoordinatorConfig, steps: usize) -> [f64; 2] {
        let mut out = [SpeedReference::default(); 2];
        for _ in 0..steps {
            let following = out.map(|r| Following {
                omega_e: r.omega_e,
                limited: false,
            });
            out = coordinator.step(config, following);
        }
        out.map(|r| r.omega_e.to_num::<f64>())
    }

    #[test]
    fn eq_7_and_eq_8() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator
            .command(&config, command(2.5e-3, 800.0))
            .unwrap();
        let [screw, nut] = run(&mut coordinator, &config, 20_000);
        let r = 5e-3 / (core::f64::consts::TAU * 5.0);
        assert!(((screw - nut) * r - 2.5e-3).abs() < 1e-8);
        assert!((nut / (800.0 / 60.0 * core::f64::consts::TAU * 5.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_base_ramp_does_not_move_the_table() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator.command(&config, command(2.5e-3, 0.0)).unwrap();
        let [screw, nut] = run(&mut coordinator, &config, 20_000);
        assert_eq!(nut, 0.0);
        coordinator
            .command(&config, command(2.5e-3, -500.0))
            .unwrap();
        for _ in 0..20_000 {
            let [s, n] = run(&mut coordinator, &config, 1);
            assert!(
                (s - n - screw).abs() < 1e-4,
                "the difference moved by {}",
                s - n - screw
            );
        }
    }

    /// What is fed forward to a motor is the change of its own reference: the nut's is the base speed's alone.
    #[test]
    fn each_motor_is_fed_its_own_acceleration() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator.command(&config, command(50e-3, 800.0)).unwrap();
        let mut before = [SpeedReference::default(); 2];
        let mut fed = [0.0f64; 2];
        for step in 0..20_000 {
            let out = coordinator.step(&config, [Following::default(); 2]);
            for (motor, (now, before)) in out.iter().zip(before).enumerate() {
                let moved = (now.omega_e - before.omega_e).to_num::<f64>();
                let change = now.change.to_num::<f64>();
                // Speed and change are each rounded down to 2^-16 rad/s, the speed from 2^-18 mechanical.
                assert!(
                    (moved - change).abs() < 2e-4,
                    "motor {motor} is fed {change} rad/s in step {step}, but its reference moved by {moved}"
                );
                fed[motor] += change;
            }
            before = out;
        }
        let [screw, nut] = fed;
        assert!(screw > 1.5 * nut && nut > 400.0, "fed {fed:?} rad/s in all");
    }

    /// What was given is taken back at an eighth of the base's acceleration limit: 400 rad/s at 62.5 rad/s^2.
    #[test]
    fn what_was_given_is_taken_back_at_an_eighth_of_the_acceleration() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator.command(&config, command(0.0, 1500.0)).unwrap();
        let [screw, nut] = run(&mut coordinator, &config, 40_000);
        let at = |omega_e: f64, limited| Following {
            omega_e: Speed::from_num(omega_e),
            limited,
        };
        for _ in 0..200 {
            coordinator.step(&config, [at(screw, false), at(0.5 * nut, true)]);
        }
        let given = coordinator.given.to_num::<f64>();
        assert!(given > 70.0, "only {given} rad/s were given");
        let steps = (1..100_000)
            .find(|_| {
                coordinator.step(&config, [at(screw, false), at(nut, false)]);
                coordinator.given == ProfileState::ZERO
            })
            .unwrap();
        let rate = config.base.acceleration().to_num::<f64>() / 8.0;
        let expected = given / rate;
        let part = f64::from(steps) / expected;
        assert!(
            (0.99..1.01).contains(&part),
            "{given:.1} rad/s were taken back in {steps} steps, not in {expected:.0}"
        );
    }

    fn wandering(rpm: f64, seconds: f64) -> CoordinatorConfig {
        let mut plate = test_plate();
        plate.base.wander_rad_s = rpm * core::f64::consts::TAU / 60.0;
        plate.base.wander_s = seconds;
        plate.config().unwrap().coordinator
    }

    /// It is `half (1 - cos)` of its period, and neither it nor its end, in the middle of its way, moves the table or exceeds the base
    /// speed's acceleration and jerk.
    #[test]
    fn a_wander_is_a_cosine_that_does_not_move_the_table() {
        let (config, step) = (wandering(120.0, 2.0), test_plate().speed_step());
        let feed = test_plate().feed;
        let mut coordinator = Coordinator::default();
        coordinator
            .command(&config, command(2.5e-3, 800.0))
            .unwrap();
        let mut last = [0.0; 3];
        let mut began = None;
        for k in 0..40_000 {
            if k == 30_000 {
                coordinator
                    .command(&config, command(2.5e-3, 300.0))
                    .unwrap();
            }
            let [screw, nut] = run(&mut coordinator, &config, 1);
            let rpm = nut / 5.0 * 60.0 / core::f64::consts::TAU;
            let acceleration = (nut - last[0]) / 5.0 / step;
            let jerk = (acceleration - last[1]) / step;
            // A speed is in 2^-16 rad/s: five counts of 2^-18 of the shaft.
            let count = 2f64.powi(-16) / 5.0 / step;
            assert!(
                acceleration.abs() < feed.base_acceleration_max + 2.0 * count,
                "{acceleration} rad/s^2 in step {k}"
            );
            if k > 20_000 {
                assert!(
                    (screw - nut - last[2]).abs() < 1e-4,
                    "the table moved in step {k}"
                );
                assert!(
                    jerk.abs() < feed.base_jerk_max + 4.0 * count / step,
                    "{jerk} rad/s^3 in step {k}"
                );
            }
            last = [nut, acceleration, screw - nut];
            if began.is_none() && coordinator.wander.phase != 0 {
                began = Some(k);
            }
            if k < 30_000
                && let Some(began) = began
            {
                let phase = core::f64::consts::TAU * f64::from(k - began + 1) * step / 2.0;
                let expected = 800.0 + 60.0 * (1.0 - phase.cos());
                assert!(
                    (rpm - expected).abs() < 0.01,
                    "{rpm} rpm in step {k}, expected {expected}"
                );
            }
        }
        assert!(began.is_some_and(|k| k < 10_000), "it began in {began:?}");
    }

    #[test]
    fn a_wander_beyond_a_motor_s_speed_is_refused_and_none_begins_from_rest() {
        let config = wandering(120.0, 2.0);
        let mut coordinator = Coordinator::default();
        assert!(coordinator.command(&config, command(0.0, 2950.0)).is_err());
        assert!(coordinator.command(&config, command(0.0, -2950.0)).is_err());
        coordinator.command(&config, command(2.5e-3, 0.0)).unwrap();
        let [_, nut] = run(&mut coordinator, &config, 20_000);
        assert_eq!(nut, 0.0);
    }

    /// Both motors are at their voltage limit at half the speed that is asked, and stay limited while it is more than that.
    #[test]
    fn a_stop_of_motors_that_could_not_follow_ends() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator
            .command(&config, command(10e-3, 1500.0))
            .unwrap();
        let most = 750.0 / 60.0 * core::f64::consts::TAU * 5.0;
        let follow = |coordinator: &mut Coordinator, out: &mut [SpeedReference; 2]| {
            let following = out.map(|reference| Following {
                omega_e: reference.omega_e.min(Speed::from_num(most)),
                limited: reference.omega_e > Speed::from_num(0.99 * most),
            });
            *out = coordinator.step(&config, following);
        };
        let mut out = [SpeedReference::default(); 2];
        for _ in 0..40_000 {
            follow(&mut coordinator, &mut out);
        }
        assert!(coordinator.gives_way(), "both motors follow");
        coordinator.command(&config, Command::rest()).unwrap();
        let steps = (0..400_000).find(|_| {
            follow(&mut coordinator, &mut out);
            coordinator.at_rest()
        });
        assert!(steps.is_some(), "not at rest after 80 s: {out:?}");
    }

    #[test]
    fn too_much_is_refused_and_the_old_target_kept() {
        let config = config();
        let mut coordinator = Coordinator::default();
        coordinator
            .command(&config, command(2.5e-3, 800.0))
            .unwrap();
        let kept = coordinator;
        let error = coordinator.command(&config, command(0.2, 0.0)).unwrap_err();
        assert_eq!(
            format!("{error}"),
            "a table velocity of 0.2000 m/s was asked, but the feed allows ±0.1000 m/s: ask for less"
        );
        let error = coordinator
            .command(&config, command(0.05, 2900.0))
            .unwrap_err();
        assert!(
            format!("{error}").starts_with("the screw would have to turn at 366.5 rad/s"),
            "{error}"
        );
        assert_eq!(coordinator, kept);
    }

    proptest! {
        #[test]
        fn giving_way_keeps_signs_and_the_difference(
            velocity in -0.05..0.05f64,
            rpm in -1500.0..1500.0f64,
            lags in prop::collection::vec((0.0..1.5f64, any::<bool>(), any::<bool>()), 1..200),
        ) {
            let config = config();
            let mut coordinator = Coordinator::default();
            coordinator.command(&config, command(velocity, rpm)).unwrap();
            let full = run(&mut coordinator, &config, 40_000);
            let (table, base) = (coordinator.table.value, coordinator.base.value);
            for (part, screw, nut) in lags {
                let at = |k: usize, limited| Following { omega_e: Speed::from_num(full[k] * (1.0 - part)), limited };
                let out = coordinator.step(&config, [at(0, screw), at(1, nut)]);
                let [s, n] = out.map(|r| r.omega_e.to_num::<f64>());
                let difference = (s - n) / 5.0;
                prop_assert!(difference * velocity >= -1e-3, "the table would reverse: {difference}");
                prop_assert!(n * rpm >= -1e-3);
                prop_assert!(difference.abs() <= table.to_num::<f64>().abs() + 1e-3);
                if coordinator.given <= base.saturating_abs() {
                    prop_assert!((difference - table.to_num::<f64>()).abs() < 1e-3, "only the base gives way first");
                }
            }
        }

        #[test]
        fn no_input_overflows(
            inputs in prop::collection::vec((any::<i32>(), any::<i32>(), any::<bool>(), any::<bool>()), 1..100),
            velocity in any::<i32>(), base in any::<i32>(),
        ) {
            let config = config();
            let mut coordinator = Coordinator::default();
            let _ = coordinator.command(&config, Command {
                velocity: TableVelocity::from_bits(velocity), base: MechanicalSpeed::from_bits(base) });
            for (s, n, a, b) in inputs {
                coordinator.step(&config, [
                    Following { omega_e: Speed::from_bits(s), limited: a },
                    Following { omega_e: Speed::from_bits(n), limited: b },
                ]);
            }
        }
    }
}
