//! An encoder that is dead at rest: its count stands from the start on, so that the observer has no speed which could be doubted.
//!
//! Torque winds every shaft, also one that friction or a stop holds: 1 N m turns 0.5 m of a 16 mm steel screw by
//! `32 M l / (pi d^4 G)`, 1 mrad, six counts of 40,000. So the encoder has failed where the asked torque has changed by [`CHANGED`] of its
//! limit since the last count. A shaft that friction holds and that a coarse encoder shows as still needs less friction than that.

use crate::current::current_loop::CurrentLoopConfig;
use crate::current::exchange::MotorExchange;
use crate::speed::speed_loop::SpeedLoopConfig;

/// So much of the torque limit, 2^-8: a quarter.
const CHANGED: i32 = 1 << 6;
/// Looks in a row which must show it.
const LOOKS: u8 = 3;
/// An angle that is less than a count, 2^-32 turn: encoders have fewer than 2^22 counts a turn, and the observer settles within it.
const COUNT: u32 = 1 << 10;

/// The torque that is asked of a motor, 2^-8 of its limit. The quotient of two words: one of longer ones is a loop in software.
#[must_use]
pub fn asked_torque(
    exchange: &MotorExchange,
    current_loop: &CurrentLoopConfig,
    speed_loop: &SpeedLoopConfig,
) -> i32 {
    let asked = current_loop.sense.scale.current(exchange.reference().q);
    // A limit of nothing has no part.
    let part = asked.to_bits().checked_div(speed_loop.i_max.to_bits() >> 8);
    part.unwrap_or(0)
}

/// State of one encoder's watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StandingWatch {
    /// Angle and torque at the last count.
    theta: u32,
    torque: i32,
    looks: u8,
}

impl StandingWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            theta: 0,
            torque: 0,
            looks: 0,
        }
    }

    /// One look at a motor: whether it follows its reference, its angle, 2^-32 turn, and its asked torque, 2^-8 of the limit. `true`:
    /// the encoder stands although the torque has changed.
    pub fn step(&mut self, driven: bool, theta: u32, torque: i32) -> bool {
        let turned = theta.wrapping_sub(self.theta).cast_signed();
        if !driven || turned.unsigned_abs() >= COUNT {
            *self = Self {
                theta,
                torque: if driven { torque } else { 0 },
                looks: 0,
            };
            return false;
        }
        self.looks = if torque.abs_diff(self.torque) > CHANGED.unsigned_abs() {
            self.looks.saturating_add(1)
        } else {
            0
        };
        self.looks >= LOOKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The look in which a torque that rises by `rate` a look is found at a shaft that turns by `turn` a look.
    fn found(rate: i32, turn: u32) -> Option<i32> {
        let mut watch = StandingWatch::new();
        watch.step(false, 7, 0);
        (1..1000i32).find(|look| watch.step(true, 7 + turn * look.unsigned_abs(), rate * look))
    }

    #[test]
    fn a_count_that_stands_under_a_rising_torque_is_found() {
        for rate in [3, -3] {
            let expected = CHANGED / 3 + i32::from(LOOKS);
            assert_eq!(found(rate, 0), Some(expected), "{rate} a look");
        }
    }

    #[test]
    fn a_shaft_that_winds_up_and_one_that_is_pressed_are_healthy() {
        assert_eq!(found(3, COUNT / 4), None, "a count in four looks");
        let mut watch = StandingWatch::new();
        watch.step(true, 1 << 20, 1 << 8);
        assert!((0..1000).all(|_| !watch.step(true, 1 << 20, 1 << 8)));
    }

    #[test]
    fn what_is_not_driven_is_not_looked_at() {
        let mut watch = StandingWatch::new();
        assert!((0..1000).all(|look| !watch.step(false, 0, look * 100)));
    }
}
