//! Both rotors together, thirty electrical degrees each way: which way does each encoder count?
//!
//! Screw and nut turn together, so that the table stays. The way is long enough that presliding does not matter. Each rotor is
//! driven by a current along the axis that location has found, and a constant one across it. Turned by `x` from where that was, the torque is
//! `K (i cos x + i_across sin x)`. So a speed loop asks `i = friction / cos x - i_across tan x`. The electrical angle `x` is the
//! encoder's if it counts with the field, and minus that if it counts backwards: the sum of `i x` over a way there and back
//! has the sign of that. Friction and a load drop out of it, as they are the same on both sides.
//!
//! The ball pair's friction may carry one motor's torque over to the other, so only the sum of both is known. What torque depends on the
//! angle adds to it. Three swings separate all of them, with currents across of both, of the nut turned round, and of the screw turned round:
//! the first less the second is twice the nut's, the first less the third twice the screw's.

use super::{AlignmentConfig, MotorAlignment, MotorSeen, Reason, RotorSwing, SwingConfig};
use crate::base::format::{Angle, Current, ElectricalChange, Speed};
use crate::speed::speed_loop::{SpeedLoop, SpeedReference};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Up,
    Down,
    Back,
}

/// A rotor that swings.
#[derive(Clone, Copy, Debug, Default)]
struct Rotor {
    speed: SpeedLoop,
    /// Current along the axis that was asked, and the limit cut it.
    asked: Current,
    limited: bool,
    /// What the sum of a swing should be by its current across alone.
    expected: i64,
    /// Of the swing so far, the sums of its torque and of its angle, 2^-16 turn.
    torque: i64,
    angle: i64,
}

/// Swings, and whether a motor's current across is turned round in one: screw, nut.
const SWINGS: [[bool; 2]; 3] = [[false, false], [false, true], [true, false]];

/// State of a swing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swing {
    phase: Phase,
    steps: u16,
    /// Steps that it has waited for a rotor.
    waited: u16,
    /// How far both should be from their start, and how far the table has been moved back, 2^-32 turn.
    asked: i32,
    back: i32,
    /// How far the table was away when the swing began.
    away: Option<i32>,
    /// Speed, in parts of the swing's.
    speed: i32,
    from: Option<[Angle; 2]>,
    rotors: [Rotor; 2],
    swing: u8,
    /// How often all three were repeated.
    again: u8,
    /// Samples of the swing so far.
    samples: u16,
    /// Of each swing, the sum of both torques times the angle.
    sums: [i64; 3],
}

/// What a swing asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SwingStep {
    /// These currents along the axes, and those across.
    Drive([[Current; 2]; 2]),
    /// Which encoders count backwards.
    Found([bool; 2]),
    /// Not to be found: 0 is the screw.
    Failed(usize, Reason),
}

/// How far both rotors have turned since their start.
#[derive(Clone, Copy, Debug)]
struct Turned {
    moved: [i32; 2],
    /// Both encoders count the same way where both turn together.
    same: bool,
}

impl Turned {
    /// An angle of a motor's encoder as the screw's counts it, or back.
    fn along(&self, motor: usize, x: i32) -> i32 {
        if motor == 1 && !self.same {
            x.wrapping_neg()
        } else {
            x
        }
    }
}

impl Swing {
    /// One step; `same`: both encoders count the same way where both turn together; `away`: how far the table is from its start, in the
    /// screw's direction; `held`: whose speed is not known.
    pub(super) fn step(
        &mut self,
        config: &AlignmentConfig,
        seen: &[MotorSeen; 2],
        same: bool,
        away: i32,
        held: [bool; 2],
    ) -> SwingStep {
        self.steps = self.steps.saturating_add(1);
        if self.steps > config.swing.steps {
            return SwingStep::Failed(self.late(), Reason::Held);
        }
        let theta = seen.map(|motor| motor.theta);
        let [screw_from, nut_from] = *self.from.get_or_insert(theta);
        let [screw, nut] = theta;
        let turned = Turned {
            moved: [screw.minus(screw_from), nut.minus(nut_from)],
            same,
        };
        let away = *self.away.get_or_insert(away);
        let gives_up = self.advance(&config.swing, turned, away);
        self.turn_round(config, gives_up);
        if usize::from(self.swing) == SWINGS.len() {
            if let Some(end) = self.conclude() {
                return end;
            }
            (self.swing, self.steps) = (0, 0);
            self.again = self.again.saturating_add(1);
        }
        self.samples = self.samples.saturating_add(1);
        match self.drive(config, seen, turned, held) {
            Some(currents) => SwingStep::Drive(currents),
            None => SwingStep::Failed(self.late(), Reason::Unsteady),
        }
    }

    /// How far a rotor is behind what is asked.
    fn behind(&self, turned: Turned, motor: usize, moved: i32) -> i32 {
        let back = if motor == 0 {
            self.back.wrapping_neg()
        } else {
            self.back
        };
        let asked = self.asked.saturating_add(back >> 1);
        asked.saturating_sub(turned.along(motor, moved))
    }

    /// Asks both rotors to go on, unless one is behind; `true` if it has been for too long.
    fn advance(&mut self, config: &SwingConfig, turned: Turned, away: i32) -> bool {
        let [screw_moved, nut_moved] = turned.moved;
        let screw_behind = self.behind(turned, 0, screw_moved);
        let nut_behind = self.behind(turned, 1, nut_moved);
        let together = (screw_behind >> 1).saturating_add(nut_behind >> 1);
        let apart = screw_behind.saturating_sub(nut_behind);
        let late = together.unsigned_abs() > config.late || apart.unsigned_abs() >> 2 > config.late;
        let limited = self.rotors.iter().all(|rotor| rotor.limited);
        let waits = late || limited;
        self.accelerate(config, waits);
        self.waited = if waits {
            self.waited.saturating_add(1)
        } else {
            0
        };
        let gives_up = self.waited > config.waits;
        if gives_up {
            self.give_up(apart, limited);
        } else if !waits {
            let left = away.saturating_sub(self.back);
            let most = config.step >> 1;
            self.back = self
                .back
                .saturating_add(left.max(most.wrapping_neg()).min(most));
        }
        gives_up
    }

    /// Brings the speed to that of the phase, or to rest, and moves on by it.
    fn accelerate(&mut self, config: &SwingConfig, waits: bool) {
        let way = match self.phase {
            Phase::Up => 1i32,
            Phase::Down => -1,
            Phase::Back => 1,
        };
        let wanted = if waits { 0 } else { way.wrapping_mul(FULL) };
        let ramp = config.ramp;
        let more = wanted.saturating_sub(self.speed);
        self.speed = self
            .speed
            .saturating_add(more.max(ramp.wrapping_neg()).min(ramp));
        let step = config.step.wrapping_mul(self.speed) / FULL;
        self.asked = self.asked.saturating_add(step);
    }

    /// The table stays where it is: a load may be too much for its way back.
    fn give_up(&mut self, apart: i32, limited: bool) {
        self.waited = 0;
        self.back = self.back.saturating_add(apart);
        self.away = Some(self.back);
        if limited {
            for rotor in &mut self.rotors {
                (rotor.speed, rotor.limited) = (SpeedLoop::new(), false);
            }
        }
    }

    /// Turns round at the end of the way, or past a third of it where a rotor stays behind.
    fn turn_round(&mut self, config: &AlignmentConfig, gives_up: bool) {
        let furthest = if gives_up {
            config.swing.furthest / 3
        } else {
            config.swing.furthest
        };
        self.phase = match self.phase {
            Phase::Up if self.asked >= furthest => Phase::Down,
            Phase::Down if self.asked <= furthest.saturating_neg() => Phase::Back,
            Phase::Back if self.asked >= 0 => {
                self.centre(&config.motors);
                self.swing = self.swing.saturating_add(1);
                Phase::Up
            }
            phase => phase,
        };
    }

    /// Drives both rotors, and adds up what their torques say: their currents.
    fn drive(
        &mut self,
        config: &AlignmentConfig,
        seen: &[MotorSeen; 2],
        turned: Turned,
        held: [bool; 2],
    ) -> Option<[[Current; 2]; 2]> {
        let swing = usize::from(self.swing);
        let round = SWINGS.get(swing)?;
        let [screw_moved, nut_moved] = turned.moved;
        let behinds = [
            self.behind(turned, 0, screw_moved),
            self.behind(turned, 1, nut_moved),
        ];
        let sum = self.sums.get_mut(swing)?;
        let mut currents = [[Current::ZERO; 2]; 2];
        let rotors = self.rotors.iter_mut().zip(&config.motors).zip(seen);
        let rotors = rotors.zip(turned.moved).zip(behinds);
        let rotors = rotors.zip(held).zip(round).zip(&mut currents);
        for (motor, (((((((rotor, limits), seen), moved), behind), held), round), current)) in
            rotors.enumerate()
        {
            let behind = turned.along(motor, behind);
            // Within 2^31: a speed of some hundred rad/s in 2^-16.
            let speed = (limits.swing.speed.to_bits() / FULL).wrapping_mul(self.speed);
            let speed = turned.along(motor, speed);
            let late = config.swing.late;
            rotor.step(limits, seen, behind, late, Speed::from_bits(speed), held);
            // 2^-16 turn. The pair's friction carries torque from one motor to the other: by the mechanical angle, which is the same for
            // both, that drops out of the sum. A torque in 2^-15 of the larger motor's at 2^-12 A: a product within 2^46.
            let x = i64::from(moved >> 16);
            *sum = sum.saturating_add(limits.swing.product(rotor.asked, x));
            rotor.torque = rotor
                .torque
                .saturating_add(limits.swing.product(rotor.asked, 1));
            rotor.angle = rotor.angle.saturating_add(x);
            if self.swing == 0 {
                rotor.expected = rotor.expected.saturating_add(limits.expected(x));
            }
            let across = limits.swing.across;
            let across = if *round {
                across.saturating_neg()
            } else {
                across
            };
            *current = [rotor.asked, across];
        }
        Some(currents)
    }

    /// Counts each rotor's angle of a swing from its mean. The table was moved back by the rotors' difference, so they do not swing about
    /// their start, and friction and a load would not drop out.
    fn centre(&mut self, motors: &[MotorAlignment; 2]) {
        let samples = i64::from(self.samples);
        self.samples = 0;
        let Some(sum) = self.sums.get_mut(usize::from(self.swing)) else {
            return;
        };
        for (rotor, motor) in self.rotors.iter_mut().zip(motors) {
            let mean = rotor.angle.checked_div(samples).unwrap_or(0);
            // Below 2^60: a sum of torques within 2^46 times an angle within 2^14.
            *sum = sum.saturating_sub(rotor.torque.saturating_mul(mean));
            if self.swing == 0 {
                let all = motor.expected(mean).saturating_mul(samples);
                rotor.expected = rotor.expected.saturating_sub(all);
            }
            (rotor.torque, rotor.angle) = (0, 0);
        }
    }

    /// Which is behind, where not both are.
    fn late(&self) -> usize {
        let [screw, nut] = &self.rotors;
        usize::from(nut.limited && !screw.limited)
    }

    /// What the sums say; `None` if three more swings may say it better.
    ///
    /// Without other torques, a sum is twice the expected. Torque harmonics and friction take some of it. The first swings must show
    /// all of the expected, the last ones half of it: to mislead these, other torques would have to be 2.5 times the expected.
    fn conclude(&self) -> Option<SwingStep> {
        let [both, nut_round, screw_round] = self.sums;
        let twice = [
            both.saturating_sub(screw_round),
            both.saturating_sub(nut_round),
        ];
        let last = self.again >= AGAIN;
        let rotors = self.rotors.iter().zip(twice);
        let unsure = rotors
            .map(|(rotor, twice)| {
                let expected = rotor.expected.unsigned_abs();
                twice.unsigned_abs() < if last { expected >> 1 } else { expected }
            })
            .position(|unsure| unsure);
        match unsure {
            None => Some(SwingStep::Found(twice.map(|twice| twice > 0))),
            Some(_) if !last => None,
            Some(motor) => Some(SwingStep::Failed(motor, Reason::Unsteady)),
        }
    }
}

/// How often three swings are repeated that do not say enough.
const AGAIN: u8 = 2;
/// The swing's speed, in its parts.
pub(crate) const FULL: i32 = 1024;

/// `2 pi` in 2^-10.
const TURN: i64 = 6434;

impl MotorAlignment {
    /// Torque of the current across at an angle `x` from the middle, 2^-16 turn, times that angle.
    fn expected(&self, x: i64) -> i64 {
        let electrical = x.wrapping_mul(self.pole_pairs.into());
        let radians = electrical.wrapping_mul(TURN) >> 16;
        let product = self.swing.product(self.swing.across, x);
        product.wrapping_mul(radians) >> 10
    }
}

impl RotorSwing {
    /// A current's torque times an angle.
    fn product(&self, i: Current, x: i64) -> i64 {
        let torque = i64::from(i.to_bits() >> 8).wrapping_mul(self.torque_per_ampere.into());
        torque.wrapping_mul(x)
    }
}

impl Rotor {
    fn step(
        &mut self,
        config: &MotorAlignment,
        seen: &MotorSeen,
        behind: i32,
        late: u32,
        speed: Speed,
        held: bool,
    ) {
        // A rotor that friction holds is behind by more than half of what is late. Its integral then grows at a rate that is the same
        // for slow speed loops.
        let half = (late >> 1).cast_signed();
        let more = behind.saturating_sub(behind.min(half).max(half.saturating_neg()));
        let more = more.min(half).max(half.saturating_neg());
        // 2^-32 turn times the gain in 2^-32: 2^-16 rad/s. Both products are within 2^62.
        let catch_up = i64::from(behind).wrapping_mul(config.swing.gain);
        let break_away = i64::from(more).wrapping_mul(config.swing.break_away_gain);
        let catch_up = catch_up.saturating_add(break_away) >> 32;
        let catch_up = catch_up.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        #[allow(clippy::cast_possible_truncation)]
        let omega_e = speed.saturating_add(Speed::from_bits(catch_up as i32));
        let reference = SpeedReference {
            omega_e,
            change: ElectricalChange::ZERO,
        };
        let seen_omega_e = if held { omega_e } else { seen.omega_e };
        let output = self.speed.step(
            &config.swing.speed_loop,
            reference,
            seen_omega_e,
            seen.voltage_limited,
        );
        (self.asked, self.limited) = (output.i_q, output.limited);
    }
}
