//! Both rotors together, thirty electrical degrees each way: which way does each encoder count?
//!
//! Screw and nut turn together, so that the table stays; no friction's history matters to what turns so far. Each rotor is driven by
//! a current along the axis that location has found, and a constant one across it. Turned by `x` from where that was, the torque is
//! `K (i cos x + i_across sin x)`. So a speed loop asks `i = friction / cos x - i_across tan x`. The electrical angle `x` is the
//! encoder's if it counts with the field, and minus that if it counts backwards: the sum of `i x` over a way there and back
//! has the sign of that. Friction drops out of it, as it is the same on both sides, and a load too.

use super::{AlignmentConfig, MotorAlignment, MotorSeen, Reason};
use crate::base::format::{Angle, Current, Speed};
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
    /// Sums of current times angle, and of the current across times the square of the angle in radians: what the first should be.
    sum: i64,
    expected: i64,
}

/// State of a swing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swing {
    phase: Phase,
    steps: u16,
    /// How far both should be from where they began, 2^-32 turn.
    asked: i32,
    from: Option<[Angle; 2]>,
    rotors: [Rotor; 2],
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

impl Swing {
    /// One step; `same`: both encoders count the same way where both turn together; `held`: whose speed is not known.
    pub(super) fn step(
        &mut self,
        config: &AlignmentConfig,
        seen: &[MotorSeen; 2],
        same: bool,
        held: [bool; 2],
    ) -> SwingStep {
        self.steps = self.steps.saturating_add(1);
        if self.steps > config.swing.steps {
            return SwingStep::Failed(self.late(), Reason::Held);
        }
        let theta = seen.map(|motor| motor.theta);
        let [screw_from, nut_from] = *self.from.get_or_insert(theta);
        let [screw, nut] = theta;
        let moved = [screw.minus(screw_from), nut.minus(nut_from)];
        let counts = [false, !same];
        let along = |motor: usize, x: i32| {
            if counts.get(motor).copied().unwrap_or(false) {
                x.wrapping_neg()
            } else {
                x
            }
        };
        let late = moved.into_iter().enumerate().any(|(motor, moved)| {
            let behind = self.asked.saturating_sub(along(motor, moved));
            behind.unsigned_abs() > config.swing.late
        });
        let limited = self.rotors.iter().any(|rotor| rotor.limited);
        let way = match self.phase {
            Phase::Up => 1i32,
            Phase::Down => -1,
            Phase::Back => 1,
        };
        let moves = !late && !limited;
        if moves {
            let step = config.swing.step.wrapping_mul(way);
            self.asked = self.asked.saturating_add(step);
        }
        let furthest = config.swing.furthest;
        self.phase = match self.phase {
            Phase::Up if self.asked >= furthest => Phase::Down,
            Phase::Down if self.asked <= furthest.saturating_neg() => Phase::Back,
            Phase::Back if self.asked >= 0 => return self.conclude(),
            phase => phase,
        };
        let mut currents = [[Current::ZERO; 2]; 2];
        let rotors = self.rotors.iter_mut().zip(&config.motors).zip(seen);
        let rotors = rotors.zip(moved).zip(held).zip(&mut currents);
        for (motor, (((((rotor, limits), seen), moved), held), current)) in rotors.enumerate() {
            let behind = along(motor, self.asked).saturating_sub(moved);
            let speed = if moves {
                along(motor, limits.swing.speed.to_bits().wrapping_mul(way))
            } else {
                0
            };
            rotor.step(limits, seen, moved, behind, Speed::from_bits(speed), held);
            *current = [rotor.asked, limits.swing.across];
        }
        SwingStep::Drive(currents)
    }

    /// Which is behind, where not both are.
    fn late(&self) -> usize {
        let [screw, nut] = &self.rotors;
        usize::from(nut.limited && !screw.limited)
    }

    fn conclude(&self) -> SwingStep {
        let mut reversed = [false; 2];
        for (motor, (rotor, reversed)) in self.rotors.iter().zip(&mut reversed).enumerate() {
            *reversed = rotor.sum > 0;
            if rotor.sum.unsigned_abs() < rotor.expected.unsigned_abs() >> 2 {
                return SwingStep::Failed(motor, Reason::Unsteady);
            }
        }
        SwingStep::Found(reversed)
    }
}

impl Rotor {
    fn step(
        &mut self,
        config: &MotorAlignment,
        seen: &MotorSeen,
        moved: i32,
        behind: i32,
        speed: Speed,
        held: bool,
    ) {
        // 2^-32 turn times the gain in 2^-32: 2^-16 rad/s, within 2^31.
        let catch_up = i64::from(behind).wrapping_mul(config.swing.gain) >> 32;
        let catch_up = catch_up.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
        #[allow(clippy::cast_possible_truncation)]
        let omega_e = speed.saturating_add(Speed::from_bits(catch_up as i32));
        let reference = SpeedReference {
            omega_e,
            change: Speed::ZERO,
        };
        let seen_omega_e = if held { omega_e } else { seen.omega_e };
        let output = self.speed.step(
            &config.swing.speed_loop,
            reference,
            seen_omega_e,
            seen.voltage_limited,
        );
        (self.asked, self.limited) = (output.i_q, output.limited);
        // Electrical, 2^-16 turn; a current in 2^-12 A: a product within 2^31.
        let x = i64::from(moved.wrapping_mul(config.pole_pairs.cast_signed()) >> 16);
        let product = |i: Current, x: i64| i64::from(i.to_bits() >> 8).wrapping_mul(x);
        self.sum = self.sum.saturating_add(product(self.asked, x));
        /// `2 pi` in 2^-10.
        const TURN: i64 = 6434;
        let radians = x.wrapping_mul(TURN) >> 16;
        let expected = product(config.swing.across, x).wrapping_mul(radians) >> 10;
        self.expected = self.expected.saturating_add(expected);
    }
}
