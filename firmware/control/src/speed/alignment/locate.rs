//! Where a rotor stands and which way its encoder counts, by motion of a degree or two.
//!
//! A current vector of length `i` at an angle `delta` from the flux makes the torque `p*flux*i*sin(delta)`, and the rotor
//! breaks away where that passes what holds it. So the break-away vectors of one direction end on a line along the flux,
//! those of the other on a second one opposite; friction and a held load are how far the lines are from zero, and move neither's
//! direction. Three looks at them, each finer:
//!
//! 1. *Scan*: eight directions 45 degrees apart, each tried with a growing current. `sum(+-1/i * (cos, sin))` points along the
//!    axis of torque: what is left of `1/i` where the limit moves nothing is symmetric about it, and eight directions hold
//!    its first harmonic apart from all but the seventh and ninth.
//! 2. *Two*: at `+gamma` and `-gamma` from that axis, `tan(off) * tan(gamma) = (i2 - i1) / (i1 + i2)`.
//! 3. The same a little further on. The axis has gone with the rotor if the encoder counts with the field, and against it
//!    if it counts backwards: at one place alone an encoder that counts backwards looks like a rotor half an electrical turn away.
//!
//! How well it does: 5 % of scatter in break-away is 2 degrees at gamma = 45; the two directions of counting lie twice the
//! electrical angle of the move apart, 14 degrees on five pole pairs and 1.4 degrees of move.

use super::back::Return;
use super::probe::{Broken, Probe, ProbeConfig, ProbeStep, current};
use super::vector;
use super::{MotorAlignment, Reason};
use crate::base::format::{Angle, Current, Speed};
use crate::current::observer::EncoderAlignment;
use crate::speed::speed_loop::{SpeedLoop, SpeedReference};
use core::cmp::Ordering;

/// Directions of a scan.
const DIRECTIONS: u8 = 8;

/// How often the direction of counting is tried.
const ATTEMPTS: u8 = 5;

/// The vote of an attempt: how far the axis turned, by how far that of an encoder would that counts forwards. On drawn
/// machines it is 1 or -1 with a standard deviation of a half, and with outliers, which are cut.
const VOTE: i64 = 256;
const VOTE_MAX: i64 = 320;
/// Votes that settle it; and where that contradicts the plate, or what one motor did to the other, and one outlier shall not:
/// the logarithm of the likelihoods' ratio is eight votes (Wald 1945).
const CLEAR: u64 = 64;
const SURE: u64 = 400;

/// Angles beside the axis: cosine and sine in 2^-14, and the largest part of the limit that the break-away on the axis may
/// take, in 2^-7: the cosine of eighteen degrees more.
const BESIDE: [(i64, i64, u32, u16); 4] = [
    (10_531, 12_551, 0x238E_38E4, 48),
    (12_551, 10_531, 0x1C71_C71C, 68),
    (14_189, 8192, 0x1555_5555, 86),
    (15_396, 5604, 0x0E38_E38E, 101),
];

/// The last of these.
const NEAREST: u8 = 3;

/// Probes at a place: forwards and backwards ahead of the axis, behind it, and ahead of it again in the first ones' stead.
/// Those began from where a longer way had left guideway and pair: the spring between them remembers.
const PROBES: u8 = 6;

/// The probe of this number is ahead of the axis.
const fn ahead(count: u8) -> bool {
    count < 2 || count >= 4
}

/// Break-away at a place: currents at `+gamma` and at `-gamma`, forwards and backwards, 2^-16 of the limit; 0 of none.
type Pair = [[u16; 2]; 2];

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    /// Direction of the scan.
    #[default]
    Scan,
    /// The table comes back first, if both motors can do that.
    Back,
    /// Number of the probe: at the near place.
    Near,
    /// To the far one.
    Going,
    Arriving,
    /// At the far place.
    Far,
    Returning,
    Returned,
}

/// State of a rotor's location.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Locate {
    phase: Phase,
    probe: Probe,
    return_to_start: Return,
    count: u8,
    attempt: u8,
    /// Of the scan.
    sum: [i64; 2],
    weight: i64,
    /// How often its own encoder moved, and how often only the other motor's.
    own: u8,
    others: u8,
    /// Least currents that moved it forwards, backwards, 2^-16 of the limit; 0 of none.
    least: [u16; 2],
    /// How often the other motor was taken along: forwards, backwards.
    along: [u8; 2],
    /// And whether both encoders then counted the same way: more often, or less.
    same: i8,
    /// Electrical angle of a current that moves the encoder's count up.
    axis: Angle,
    beside: u8,
    near: Pair,
    far: Pair,
    near_at: Angle,
    other_at: Angle,
    /// How far the table was away at the start of the way.
    away: Option<i32>,
    /// To the far place: up or down.
    down: bool,
    step: u16,
    speed: SpeedLoop,
    /// Sum of the attempts' votes that the encoder counts forwards.
    votes: i64,
    /// Something else says that it counts the other way.
    doubted: bool,
    found: Option<EncoderAlignment>,
}

/// What a location asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LocateStep {
    /// No current.
    Rest,
    /// This current along this electrical angle.
    Vector(Angle, Current),
    /// This part of the torque limits, 2^-16, of both motors against each other: of this one along this electrical angle, and
    /// whether that moves its count up.
    Against(Angle, u16, bool),
    /// Found.
    Found(EncoderAlignment),
    /// Not to be found.
    Failed(Reason),
    /// Not to be found while encoders move although no current flows: which.
    Moves([bool; 2]),
}

impl Locate {
    /// How much more often both encoders counted the same way than opposite ways, while one motor took the other along,
    /// since this was last asked.
    pub(super) fn take_same(&mut self) -> i8 {
        core::mem::take(&mut self.same)
    }

    /// Its encoder stood while only the other motor's moved, again and again: what is taken along goes no further than what takes it.
    /// A rotor that no friction holds goes on alone too, but less often.
    pub(super) const fn suspects_exchange(&self) -> bool {
        self.others > 2 && self.others > self.own >> 2
    }

    /// The same place again, after something has contradicted the direction of counting that was found.
    pub(super) fn doubted(&self) -> Self {
        Self {
            phase: Phase::Back,
            return_to_start: Return::default(),
            probe: Probe::default(),
            count: 0,
            attempt: 0,
            near: Pair::default(),
            far: Pair::default(),
            doubted: true,
            found: None,
            ..*self
        }
    }

    /// The votes on its direction of counting, of which more are needed; `None` if it was doubted before.
    pub(super) const fn doubtful(&self) -> Option<u64> {
        if self.doubted {
            None
        } else {
            Some(self.votes.unsigned_abs())
        }
    }

    /// One step for `motor`, with both encoders' angles, this one's speed, electrical rad/s in the encoder's direction, how
    /// far it is from where the table stood at the start, 2^-32 turn of its encoder, and how near is near enough; `None` if the other
    /// motor cannot help it back.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn step(
        &mut self,
        config: &MotorAlignment,
        probes: &ProbeConfig,
        motor: usize,
        theta: [Angle; 2],
        omega_e: Speed,
        away: i32,
        near: Option<u32>,
    ) -> LocateStep {
        let own = theta.get(motor).copied().unwrap_or_default();
        match self.phase {
            Phase::Scan | Phase::Near | Phase::Far => {
                let at = self.direction();
                match self.probe.step(probes, theta) {
                    ProbeStep::Rest => LocateStep::Rest,
                    ProbeStep::Ramp(level) => LocateStep::Vector(at, current(config.limit, level)),
                    ProbeStep::Moves(moving) => LocateStep::Moves(moving),
                    ProbeStep::Found(broken) => {
                        self.probe = Probe::default();
                        let taken = self.take(config, probes, motor, &broken, theta, away);
                        self.count = self.count.wrapping_add(1);
                        match taken {
                            Ok(()) => LocateStep::Rest,
                            Err(reason) => LocateStep::Failed(reason),
                        }
                    }
                }
            }
            Phase::Back => self.go_back(probes, theta, away, near),
            Phase::Going | Phase::Returning => {
                let other = theta.get(motor ^ 1).copied().unwrap_or_default();
                self.go(config, probes, [own, other], theta, omega_e, away)
            }
            Phase::Arriving | Phase::Returned => match self.probe.step(probes, theta) {
                ProbeStep::Moves(moving) => LocateStep::Moves(moving),
                ProbeStep::Found(_) => {
                    self.probe = Probe::default();
                    self.count = 0;
                    if self.phase == Phase::Arriving {
                        self.phase = Phase::Far;
                        return LocateStep::Rest;
                    }
                    if let Some(found) = self.found {
                        return LocateStep::Found(found);
                    }
                    (self.near, self.far) = (Pair::default(), Pair::default());
                    self.begin_attempt();
                    LocateStep::Rest
                }
                ProbeStep::Rest | ProbeStep::Ramp(_) => LocateStep::Rest,
            },
        }
    }

    /// The electrical angle of the probe that is due.
    fn direction(&self) -> Angle {
        let half = Angle(if self.count & 1 == 1 { 1 << 31 } else { 0 });
        let along = if self.phase == Phase::Scan {
            // An eighth of a turn; each is followed by its opposite, which takes back its motion.
            Angle(0x2000_0000u32.wrapping_mul(u32::from(self.count >> 1)))
        } else {
            let (_, _, gamma, _) = self.beside();
            if ahead(self.count) {
                self.axis.plus(Angle(gamma))
            } else {
                self.axis.plus(Angle(gamma.wrapping_neg()))
            }
        };
        along.plus(half)
    }

    fn beside(&self) -> (i64, i64, u32, u16) {
        let [first, ..] = BESIDE;
        BESIDE
            .get(usize::from(self.beside))
            .copied()
            .unwrap_or(first)
    }

    /// Takes what a probe found.
    fn take(
        &mut self,
        config: &MotorAlignment,
        probes: &ProbeConfig,
        motor: usize,
        broken: &Broken,
        theta: [Angle; 2],
        away: i32,
    ) -> Result<(), Reason> {
        let sign = broken.sign(probes, motor);
        if sign != 0 {
            self.own = self.own.saturating_add(1);
        } else if broken.sign(probes, motor ^ 1) != 0 {
            self.others = self.others.saturating_add(1);
        }
        if self.phase == Phase::Scan {
            self.take_scanned(probes, broken, sign);
            if self.count.saturating_add(1) == DIRECTIONS {
                self.choose()?;
                self.begin_attempt();
                self.count = u8::MAX;
            }
            return Ok(());
        }
        let backwards = self.count & 1 == 1;
        if sign != 0 {
            if (sign < 0) != backwards {
                return Err(Reason::Unsteady);
            }
            let pair = if self.phase == Phase::Near {
                &mut self.near
            } else {
                &mut self.far
            };
            let side = pair.get_mut(usize::from(backwards));
            if let Some(level) = side.and_then(|side| side.get_mut(usize::from(!ahead(self.count))))
            {
                *level = broken.level;
            }
        }
        if self.count.saturating_add(1) < PROBES {
            return Ok(());
        }
        self.count = u8::MAX;
        let [own, other] = [motor, motor ^ 1].map(|k| theta.get(k).copied().unwrap_or_default());
        if self.phase == Phase::Near {
            self.near_at = own;
            self.other_at = other;
            self.down = self.way(away);
            self.begin_move(Phase::Going);
        } else {
            self.conclude(config, own)?;
            let went_along = other.minus(self.other_at).unsigned_abs() > config.reach >> 1;
            if !went_along && self.can_return() {
                self.down = !self.down;
                self.begin_move(Phase::Returning);
            } else {
                self.phase = Phase::Returned;
            }
        }
        Ok(())
    }

    /// Whether the far place is down from the near one: where the other motor is taken along, so that the table stays; or
    /// where it brings the table back, which this motor has gone `away` with; as far as the torque limit moves it at all.
    fn way(&self, away: i32) -> bool {
        let ([up, down], [up_along, down_along]) = (self.least, self.along);
        if up == 0 || down == 0 {
            return up == 0;
        }
        match up_along.cmp(&down_along) {
            Ordering::Less => true,
            Ordering::Greater => false,
            Ordering::Equal => away > 0,
        }
    }

    /// The torque limit moves it back.
    fn can_return(&self) -> bool {
        let [up, down] = self.least;
        if self.down { up != 0 } else { down != 0 }
    }

    fn take_scanned(&mut self, probes: &ProbeConfig, broken: &Broken, sign: i32) {
        let level = broken.level;
        if sign == 0 {
            return;
        }
        let [up, down] = &mut self.least;
        let [up_along, down_along] = &mut self.along;
        let (side, along) = if sign > 0 {
            (up, up_along)
        } else {
            (down, down_along)
        };
        if let Some(same) = broken.together(probes) {
            *along = along.saturating_add(1);
            let vote = if same { 1 } else { -1 };
            self.same = self.same.saturating_add(vote);
        }
        if *side == 0 || level < *side {
            *side = level;
        }
        // At most sixteen times that of the limit.
        let weight = (1i64 << 24).checked_div(level.into()).unwrap_or(0);
        let (cos, sin) = self.direction().cos_sin();
        let part = |unit: crate::base::format::Unit| {
            i64::from(unit.to_bits() >> 15)
                .wrapping_mul(weight)
                .wrapping_mul(i64::from(sign))
        };
        let [x, y] = self.sum;
        self.sum = [x.saturating_add(part(cos)), y.saturating_add(part(sin))];
        self.weight = self.weight.saturating_add(weight);
    }

    /// The axis from the scan, and how far beside it the finer looks are.
    fn choose(&mut self) -> Result<(), Reason> {
        if self.others > self.own {
            return Err(Reason::Exchanged);
        }
        let [x, y] = self.sum;
        // Half of what they would be long if all pointed the same way; they spread over less than half a turn.
        let (x16, y16) = (x >> 16, y >> 16);
        let long = x16
            .saturating_mul(x16)
            .saturating_add(y16.saturating_mul(y16));
        let half = self.weight >> 1;
        if self.own == 0 {
            return Err(Reason::Held);
        }
        if long < half.saturating_mul(half) {
            return Err(Reason::Unsteady);
        }
        self.axis = vector::angle(x, y);
        let [up, down] = self.least;
        let fits = |least: u16| {
            let fits = |limit: u16| {
                u32::from(least).wrapping_mul(128) <= (1u32 << 16).wrapping_mul(u32::from(limit))
            };
            let beside = BESIDE.iter().position(|(_, _, _, limit)| fits(*limit));
            beside.and_then(|index| u8::try_from(index).ok())
        };
        // Both directions, if they move; or the easier one.
        let easier = if up == 0 || down != 0 && down < up {
            down
        } else {
            up
        };
        let both = if up == 0 || down == 0 {
            None
        } else {
            fits(up.max(down))
        };
        self.beside = both.or_else(|| fits(easier)).ok_or(Reason::Held)?;
        Ok(())
    }

    fn begin_attempt(&mut self) {
        self.phase = Phase::Back;
        self.return_to_start = Return::default();
    }

    /// Both motors against each other, until the table is near its start.
    fn go_back(
        &mut self,
        probes: &ProbeConfig,
        theta: [Angle; 2],
        away: i32,
        near: Option<u32>,
    ) -> LocateStep {
        let near = near.unwrap_or(u32::MAX);
        self.return_to_start.begin(away, near);
        let Some(from) = self.return_to_start.away() else {
            self.phase = Phase::Near;
            return LocateStep::Rest;
        };
        match self.probe.step(probes, theta) {
            ProbeStep::Rest => LocateStep::Rest,
            ProbeStep::Ramp(level) => {
                let up = from < 0;
                let along = Angle(if up { 0 } else { 1 << 31 });
                LocateStep::Against(self.axis.plus(along), level, up)
            }
            ProbeStep::Moves(moving) => LocateStep::Moves(moving),
            ProbeStep::Found(_) => {
                self.probe = Probe::default();
                self.return_to_start.go_on(away, near);
                LocateStep::Rest
            }
        }
    }

    fn begin_move(&mut self, phase: Phase) {
        self.phase = phase;
        self.step = 0;
        self.away = None;
        self.speed = SpeedLoop::new();
        self.probe = Probe::default();
    }

    /// Moves the rotor along the axis, at a speed, until it has gone as far as it shall.
    fn go(
        &mut self,
        config: &MotorAlignment,
        probes: &ProbeConfig,
        [own, other]: [Angle; 2],
        theta: [Angle; 2],
        omega_e: Speed,
        away: i32,
    ) -> LocateStep {
        self.step = self.step.saturating_add(1);
        let before = *self.away.get_or_insert(away);
        // What is taken along may go on by itself, with the load: no further than this one would have moved the table alone.
        let slides = away.saturating_sub(before).unsigned_abs()
            > config.reach.saturating_add(probes.motion.saturating_mul(2));
        let target = self.near_at;
        let gone = own.minus(target);
        let returning = self.phase == Phase::Returning;
        let arrived = match (returning, self.down) {
            (false, true) => gone <= 0i32.saturating_sub_unsigned(config.reach),
            (false, false) => gone >= 0i32.saturating_add_unsigned(config.reach),
            (true, true) => gone <= 0,
            (true, false) => gone >= 0,
        };
        if arrived || slides || self.step >= config.reach_steps {
            if !arrived && !returning && gone.unsigned_abs() < config.reach >> 1 {
                // What is taken along goes no further than what takes it.
                let further = other.minus(self.other_at).unsigned_abs() > config.reach;
                return LocateStep::Failed(if further {
                    Reason::Exchanged
                } else {
                    Reason::Held
                });
            }
            self.phase = if returning {
                Phase::Returned
            } else {
                Phase::Arriving
            };
            self.probe = Probe::resting(theta);
            return LocateStep::Rest;
        }
        let omega = if self.down {
            config.reach_speed.saturating_neg()
        } else {
            config.reach_speed
        };
        let reference = SpeedReference {
            omega_e: omega,
            change: Speed::ZERO,
        };
        let asked = self
            .speed
            .step(&config.speed_loop, reference, omega_e, false);
        LocateStep::Vector(self.axis, asked.i_q)
    }

    /// The near and the far place -> where the rotor is and how its encoder counts.
    fn conclude(&mut self, config: &MotorAlignment, own: Angle) -> Result<(), Reason> {
        // Of each direction of motion, what both places have: what is wrong in the same way at both drops out of how far it turned.
        let [up, down] = [0, 1].map(|side: usize| {
            let pair = |pair: &Pair| pair.get(side).and_then(|side| self.off(side));
            Some((pair(&self.near)?, pair(&self.far)?))
        });
        let (near, far) = match (up, down) {
            (Some(up), Some(down)) => (mean(up.0, down.0), mean(up.1, down.1)),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) if self.attempt < ATTEMPTS => {
                // Nearer to the axis less is needed.
                self.attempt = self.attempt.saturating_add(1);
                self.beside = self.beside.saturating_add(1).min(NEAREST);
                return Ok(());
            }
            (None, None) => return Err(Reason::Unsteady),
        };
        let way = own.minus(self.near_at);
        let electrical = way.wrapping_mul(config.pole_pairs.cast_signed());
        let turned = i64::from(far.wrapping_sub(near)).wrapping_mul(VOTE);
        let vote = turned.checked_div(electrical.into()).unwrap_or(0);
        let vote = vote.clamp(VOTE_MAX.wrapping_neg(), VOTE_MAX);
        self.votes = self.votes.saturating_add(vote);
        self.attempt = self.attempt.saturating_add(1);
        let looks_reversed = self.votes < 0;
        let contradicted = config.reversed.is_some_and(|it| it != looks_reversed);
        let needed = if contradicted || self.doubted {
            SURE
        } else {
            CLEAR
        };
        let reversed = if self.votes.unsigned_abs() >= needed {
            looks_reversed
        } else if self.attempt < ATTEMPTS {
            return Ok(());
        } else {
            // What the plate says is checked again when the rotor turns.
            config.reversed.ok_or(Reason::Unsteady)?
        };
        if config.reversed.is_some_and(|declared| declared != reversed) {
            return Err(Reason::Reversed);
        }
        // Both places' axes, in the middle between them.
        let axis = self.axis.turned(mean(near, far));
        let middle = self.near_at.turned(way >> 1);
        const QUARTER: i32 = 1 << 30;
        let mechanical = middle.times(config.pole_pairs);
        self.found = Some(if reversed {
            EncoderAlignment {
                reversed,
                theta_e_at_zero: axis.turned(QUARTER).plus(mechanical),
                index_awaited: false,
            }
        } else {
            EncoderAlignment {
                reversed,
                theta_e_at_zero: Angle(
                    axis.turned(QUARTER.wrapping_neg())
                        .0
                        .wrapping_sub(mechanical.0),
                ),
                index_awaited: false,
            }
        });
        Ok(())
    }

    /// How far the axis of torque is from the scan's, by the break-away of one direction, 2^-32 turn.
    fn off(&self, &[ahead, behind]: &[u16; 2]) -> Option<i32> {
        if ahead == 0 || behind == 0 {
            return None;
        }
        let (cos, sin, _, _) = self.beside();
        let (ahead, behind) = (i64::from(ahead), i64::from(behind));
        let along = ahead.wrapping_add(behind).wrapping_mul(sin);
        let across = behind.wrapping_sub(ahead).wrapping_mul(cos);
        Some(vector::angle(along, across).minus(Angle(0)))
    }
}

fn mean(a: i32, b: i32) -> i32 {
    (a >> 1).wrapping_add(b >> 1)
}
