//! A probe: a torque that grows until something moves, then both windings shorted until all stands again.
//!
//! It grows by the same part each step. From the break-away on the motion is then the same in time whatever part of the
//! current makes torque, and so the current at which it is seen is in proportion to one over that part: the rotor's inertia
//! drops out of the ratio of two. Friction and the shorted windings stop what moves: a rotor whose friction a load takes up, and
//! whose torque over its angle helps that load, creeps down instead of running away.

use super::MotorAlignment;
use crate::base::format::{Angle, Current};

/// Where a ramp begins, 2^-16 of the limit.
const FIRST: u16 = 1 << 12;
/// Doublings of what is motion, by which both rotors may move together while they should part.
const TOGETHER: u8 = 3;

/// Times of a probe, and what counts as motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbeConfig {
    /// By what the torque grows in a step, 2^-16 of it: from a sixteenth of the limit to the limit.
    pub growth: u16,
    /// What stands for so many steps, stands.
    pub rest_steps: u16,
    /// Rests until the load is taken to move by itself.
    pub rests_max: u8,
    /// The angle that is motion, 2^-32 turn.
    pub motion: u32,
}

impl ProbeConfig {
    /// The same, of which motion is `2^doublings` times as far.
    pub(super) const fn coarser(self, doublings: u8) -> Self {
        Self {
            motion: self.motion.saturating_mul(1 << doublings),
            ..self
        }
    }
}

/// A probe on its way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Probe {
    level: u16,
    step: u16,
    rests: u8,
    /// Angles at the start, and then at the start of each rest.
    from: [Angle; 2],
    found: Option<Broken>,
    /// Of the rests so far, the sum of how far each encoder is from `from`, and the mean of the one before, from the same place.
    sum: [i64; 2],
    before: Option<[i64; 2]>,
    /// Where the encoders were a step ago, and the largest jump of one since the last rest, 2^-32 turn.
    last: Option<[i32; 2]>,
    jump: u32,
    gives_way: GivesWay,
    /// Which way each went in the rest before.
    ways: [i32; 2],
}

/// Rests at most while none turns round: shafts that coast together may creep from one place where they cog to the next, which took
/// up to 130 rests on the mains board. An encoder that is disturbed goes to and fro.
const CREEPS_MAX: u8 = 250;

/// What ends a probe's torque.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum GivesWay {
    /// A rotor moves.
    #[default]
    Either,
    /// The rotors move against each other; both count the same way where they turn together, or not.
    Apart(bool),
}

/// What a probe found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Broken {
    /// How far each encoder had moved, 2^-32 turn; less than what is motion if nothing gave way to the whole torque.
    pub(super) moved: [i32; 2],
    /// The torque at which that was, 2^-16 of the limit.
    pub(super) level: u16,
}

impl Broken {
    /// Both moved, by an eighth of what is motion at least: their signs are the same. `None` if one stood. The pair's friction takes the
    /// other along, and elastic friction lets it follow by a part.
    pub(super) fn together(&self, config: &ProbeConfig) -> Option<bool> {
        let [screw, nut] = self.moved;
        let mut both = self.moved.into_iter();
        both.all(|moved| moved.unsigned_abs() >= config.motion >> 3)
            .then_some((screw < 0) == (nut < 0))
    }

    /// The sign of the motion of `motor`; 0 if it held.
    pub(super) fn sign(&self, config: &ProbeConfig, motor: usize) -> i32 {
        let moved = self.moved.get(motor).copied().unwrap_or(0);
        // Half of it: what takes the other along moves no further than that.
        if moved.unsigned_abs() < config.motion >> 1 {
            0
        } else {
            moved.signum()
        }
    }
}

/// What a probe asks for in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProbeStep {
    /// This torque, 2^-16 of the limit.
    Ramp(u16),
    /// No torque.
    Rest,
    /// No torque, and everything stands: what was found.
    Found(Broken),
    /// Something still moves after the longest rest: which of both encoders.
    Moves([bool; 2]),
}

impl Probe {
    /// A probe that only waits until everything stands.
    pub(super) fn resting(theta: [Angle; 2]) -> Self {
        Self {
            from: theta,
            found: Some(Broken::default()),
            ..Self::default()
        }
    }

    /// A probe of torques against each other. One motor may take the other along before they part: that does not end the probe, within
    /// [`TOGETHER`] of what is motion.
    pub(super) fn apart(same: bool) -> Self {
        Self {
            gives_way: GivesWay::Apart(same),
            ..Self::default()
        }
    }

    /// The torque has moved what it should.
    fn gave_way(&self, config: &ProbeConfig, moved: [i32; 2]) -> bool {
        let GivesWay::Apart(same) = self.gives_way else {
            return moves(config, moved);
        };
        let [screw, nut] = moved;
        let nut = if same { nut } else { nut.wrapping_neg() };
        screw.wrapping_sub(nut).unsigned_abs() >= config.motion
            || moves(&config.coarser(TOGETHER), moved)
    }

    /// What moves stays about its place, and without jumps: it is shaken, and its encoder is not disturbed. It keeps the mean over the
    /// rest that ends, counted from where it ends.
    fn shakes(&mut self, config: &ProbeConfig, moved: [i32; 2]) -> bool {
        let mean = self
            .sum
            .map(|sum| sum.checked_div(self.step.into()).unwrap_or(0));
        self.sum = [0; 2];
        let [screw, nut] = mean;
        let stays = |mean: i64, before: i64| {
            mean.saturating_sub(before).unsigned_abs() <= u64::from(config.motion >> 3)
        };
        let jumps = core::mem::take(&mut self.jump) > config.motion >> 1;
        self.last = None;
        let shaken = !jumps
            && self.before.is_some_and(|[screw_before, nut_before]| {
                stays(screw, screw_before) && stays(nut, nut_before)
            });
        let [screw_moved, nut_moved] = moved;
        self.before = Some([
            screw.saturating_sub(screw_moved.into()),
            nut.saturating_sub(nut_moved.into()),
        ]);
        shaken
    }

    /// One step, with both encoders' angles. The first step of a fresh probe begins it.
    pub(super) fn step(&mut self, config: &ProbeConfig, theta: [Angle; 2]) -> ProbeStep {
        if self.level == 0 && self.found.is_none() {
            self.from = theta;
        }
        let moved = moved(theta, self.from);
        let gave_way = self.gave_way(config, moved);
        let Some(found) = self.found else {
            if gave_way || self.level == u16::MAX {
                self.found = Some(Broken {
                    moved,
                    level: self.level,
                });
                self.from = theta;
                return ProbeStep::Rest;
            }
            // A part of the level, and one: below 2^17.
            let more = (u32::from(self.level).wrapping_mul(u32::from(config.growth)) >> 16)
                .wrapping_add(1);
            let level = u32::from(self.level.max(FIRST)).wrapping_add(more);
            self.level = u16::try_from(level).unwrap_or(u16::MAX);
            return ProbeStep::Ramp(self.level);
        };
        self.step = self.step.saturating_add(1);
        for (sum, moved) in self.sum.iter_mut().zip(moved) {
            *sum = sum.saturating_add(moved.into());
        }
        let jumps = moved
            .into_iter()
            .zip(self.last.replace(moved).unwrap_or(moved));
        for (moved, last) in jumps {
            self.jump = self.jump.max(moved.wrapping_sub(last).unsigned_abs());
        }
        if self.step < config.rest_steps {
            return ProbeStep::Rest;
        }
        let goes_on = moved.map(|moved| moved.unsigned_abs() > config.motion >> 3);
        if goes_on == [false; 2] || self.shakes(config, moved) {
            return ProbeStep::Found(found);
        }
        self.step = 0;
        self.from = theta;
        self.rests = self.rests.saturating_add(1);
        let ways = moved.map(i32::signum);
        let before = core::mem::replace(&mut self.ways, ways);
        let turns_round = ways
            .into_iter()
            .zip(before)
            .any(|(way, before)| way != 0 && way == before.wrapping_neg());
        if self.rests < config.rests_max || !turns_round && self.rests < CREEPS_MAX {
            ProbeStep::Rest
        } else {
            ProbeStep::Moves(goes_on)
        }
    }
}

/// The part `level`, 2^-16, of a current.
pub(super) fn current(limit: Current, level: u16) -> Current {
    let wide = i64::from(limit.to_bits()).wrapping_mul(i64::from(level)) >> 16;
    // A part of the limit.
    #[allow(clippy::cast_possible_truncation)]
    Current::from_bits(wide as i32)
}

/// The part `level`, 2^-16, of the stronger motor's torque limit, in 2^-35 of an ampere's torque of the motor with the most.
pub(super) fn torque(motors: &[MotorAlignment; 2], level: u16) -> i64 {
    let [screw, nut] = motors.each_ref().map(MotorAlignment::torque_limit);
    // 2^46 at most: 2^31 times 2^15.
    (screw.max(nut) >> 16).wrapping_mul(level.into())
}

/// How far both have moved.
pub(super) fn moved([screw, nut]: [Angle; 2], [screw_from, nut_from]: [Angle; 2]) -> [i32; 2] {
    [screw.minus(screw_from), nut.minus(nut_from)]
}

/// One of both has moved.
pub(super) fn moves(config: &ProbeConfig, moved: [i32; 2]) -> bool {
    let mut each = moved.into_iter();
    each.any(|moved| moved.unsigned_abs() >= config.motion)
}
