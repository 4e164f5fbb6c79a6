//! An encoder that is not to be trusted.
//!
//! Standing still: a torn cable or a dead encoder leaves its last count. The drive would then see a shaft at rest, push
//! harder, and commutate on an angle that is not there. The observer's speed cannot fall faster than the torque allows,
//! so a healthy encoder lets it turn only so far while the count stands: furthest when the shaft reverses at full
//! torque. There the speed lags the shaft's by `2*zeta*a / omega_0`, and within one count of the turning point the count
//! stands for `2*sqrt(2*count / a)`.
//!
//! Wrong: a frame that did not arrive whole, or a count that jumps further than full torque can turn the shaft. A wrong
//! frame is ridden through on the observer's prediction, which full torque takes off by `a/2 * (n*T)^2` in `n` periods:
//! 2e-4 rad in eight of 50 us at 2.8e3 rad/s^2, a hundredth of what the currents notice. So eight in a row are
//! tolerated, and a rate of one in sixteen; past that the encoder has failed. A jump is counted in the same tally: an
//! index that corrects a lost count makes one. A count that an index has put right before has no more to be put right than what
//! was lost within a turn: where a jump turns the electrical angle by more than the voltage may be off by, either the counts
//! before it were wrong or those after it are, and the encoder has failed. So it has while the bridge is open.

use crate::base::tolerance::{Tally, Tolerance};
use crate::current::observer::Motion;
use core::hint::cold_path;

/// How many wrong readings are put up with.
pub const WRONG_READINGS: Tolerance = Tolerance {
    weight: 16,
    events: 8,
};

/// What fills the tally at once.
const LOST: u32 = 2 * WRONG_READINGS.events;

/// Configuration of an encoder's watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderWatchConfig {
    /// Furthest that the observer may turn while the count stands, 2^-32 mechanical turn.
    pub travel_max: u32,
    /// Furthest that a count may be from the observer's prediction, 2^-32 mechanical turn.
    pub jump_max: u32,
    /// The same while the drive is aligned, with less torque: an index that moves the count by less than [`jump_max`](Self::jump_max)
    /// looked like a speed, to which the speed loop answered with all the torque there is.
    pub jump_max_aligning: u32,
    /// Most that an index may put right, 2^-32 mechanical turn; a reading that did not jump by itself, but arrived wrong, may be off by
    /// any angle.
    pub lost_max: u32,
    /// Readings can be wrong; otherwise only a standing count is looked for.
    pub checked: bool,
}

/// What a watch saw in a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// The reading is wrong.
    pub wrong: bool,
    /// The encoder is found not to be trusted. That it was found before says [`EncoderWatch::failed`].
    pub failed: bool,
}

/// State of an encoder's watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderWatch {
    counts: u32,
    travel: u32,
    wrong: Tally,
    /// The last count was further from the prediction than the shaft can turn.
    off: bool,
    /// Too many were wrong, or the count stood; it stays so while the drive is on.
    failed: bool,
}

impl EncoderWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            counts: 0,
            travel: 0,
            wrong: Tally::new(),
            off: false,
            failed: false,
        }
    }

    /// Takes a sample's count, `None` if it did not arrive whole, and what the observer made of it. A failure stays, as
    /// [`EncoderWatch::failed`] says, while `drive`; without it only frames are watched. `aligning`: the drive asks for no more than
    /// the alignment's torque.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &EncoderWatchConfig,
        counts: Option<u32>,
        motion: &Motion,
        drive: bool,
        aligning: impl FnOnce() -> bool,
    ) -> Seen {
        let mut seen = Seen::default();
        if config.checked {
            // A jump is one, however long the observer takes to follow it.
            let aligning = aligning();
            let jump_max = if aligning {
                config.jump_max_aligning
            } else {
                config.jump_max
            };
            let jump = motion.innovation.unsigned_abs();
            let off = drive && jump > jump_max;
            seen.wrong = counts.is_none() || off && !self.off;
            self.off = off;
            // Also at rest, where nobody would look at the count again before a start: a tally that is full lasts for 128 samples.
            let lost = !aligning && jump > config.lost_max;
            let events = if lost { LOST } else { u32::from(seen.wrong) };
            let failed = self.wrong.step(WRONG_READINGS, events);
            self.failed = failed || drive && self.failed;
            seen.failed = self.failed;
        }
        if drive {
            seen.failed |= self.stuck(config, counts, motion.theta_step);
        } else {
            (self.counts, self.travel) = (0, 0);
            self.failed &= config.checked;
        }
        seen
    }

    /// The encoder has failed, in the last sample or before it.
    #[must_use]
    #[inline(always)]
    pub const fn failed(&self) -> bool {
        self.failed
    }

    /// The count stands while the shaft turns, in this sample: what a current loop pays for that in each period is a
    /// comparison.
    #[inline(always)]
    fn stuck(&mut self, config: &EncoderWatchConfig, counts: Option<u32>, turned: i32) -> bool {
        match counts {
            Some(counts) if counts == self.counts => {
                cold_path();
                self.travel = self.travel.saturating_add(turned.unsigned_abs());
                let stuck = self.travel > config.travel_max;
                self.failed |= stuck;
                stuck
            }
            Some(counts) => {
                self.counts = counts;
                self.travel = 0;
                false
            }
            // A reading that did not arrive says nothing of where the count stands.
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::encoder::Interface;
    use crate::current::observer::{EncoderAlignment, Observer};
    use crate::plate::test_plate;

    /// Runs observer and watch over a shaft whose angle (turns) is a function of time (s); the sample at which the
    /// watch fires, and how many readings were wrong until then.
    fn watch(
        interface: Interface,
        counts_per_turn: u32,
        samples: u32,
        angle: impl Fn(f64) -> f64,
        arrives: impl Fn(u32) -> bool,
    ) -> (Option<u32>, u32) {
        let mut plate = test_plate();
        plate.motors[0].encoder.counts_per_turn = counts_per_turn;
        plate.motors[0].encoder.interface = interface;
        let config = plate.motors[0].current_loop(&plate).unwrap();
        let count = |k: u32| {
            let turns = angle(f64::from(k) * 50e-6).rem_euclid(1.0);
            (turns * f64::from(counts_per_turn)) as u32 % counts_per_turn
        };
        let mut watch = EncoderWatch::new();
        let mut observer = Observer::at(&config.observer, EncoderAlignment::default(), count(0));
        let mut wrong = 0;
        let fired = (0..samples).find(|&k| {
            let counts = arrives(k).then(|| count(k));
            let motion = observer.follow(&config.observer, counts);
            // The observer finds the speed while the drive is off.
            let drive = k >= 400;
            let seen = watch.step(&config.encoder_watch, counts, &motion, drive, || false);
            wrong += u32::from(seen.wrong);
            assert_eq!(seen.failed, watch.failed());
            seen.failed
        });
        (fired, wrong)
    }

    fn fires(counts_per_turn: u32, samples: u32, angle: impl Fn(f64) -> f64) -> Option<u32> {
        watch(
            Interface::Incremental,
            counts_per_turn,
            samples,
            angle,
            |_| true,
        )
        .0
    }

    /// Full torque, in turns/s^2.
    fn hardest() -> f64 {
        let motor = test_plate().motors[0];
        motor.torque_max_nm / motor.inertia_kg_m2 / core::f64::consts::TAU
    }

    #[test]
    fn a_healthy_encoder_never_fires() {
        // Full torque through the turning point, and a slow crawl.
        for (interface, counts_per_turn) in [
            (Interface::Incremental, 1 << 20),
            (Interface::Incremental, 10_000),
            (Interface::Incremental, 1024),
            (Interface::IncrementalWithIndex, 10_000),
            (Interface::Mt6835, 1 << 21),
        ] {
            let reversal = |t: f64| hardest() / 2.0 * (t - 0.0503).powi(2);
            let seen = |samples, angle: &dyn Fn(f64) -> f64| {
                watch(interface, counts_per_turn, samples, angle, |_| true)
            };
            let healthy = (None, 0);
            assert_eq!(seen(2000, &reversal), healthy, "{counts_per_turn}");
            assert_eq!(seen(20_000, &|t| 1e-3 * t), healthy, "{counts_per_turn}");
            assert_eq!(seen(2000, &|t| hardest() / 2.0 * t * t), healthy);
        }
    }

    #[test]
    fn a_stuck_one_fires_at_once_at_speed_and_before_the_angle_matters_when_slow() {
        for (rpm, within) in [(800.0, 1), (300.0, 2), (30.0, 12)] {
            let stuck_at = 0.05;
            let angle = |t: f64| rpm / 60.0 * t.min(stuck_at);
            let first = (stuck_at / 50e-6).ceil() as u32 + 1;
            let fired = fires(1 << 20, 4000, angle).unwrap();
            assert!(
                (first..first + within).contains(&fired),
                "{rpm} rpm: {fired} after {first}"
            );
        }
    }

    #[test]
    fn wrong_frames_are_ridden_through_up_to_the_limit() {
        let turning = |t: f64| hardest() / 2.0 * t * t;
        let seen = |arrives: &dyn Fn(u32) -> bool| {
            watch(Interface::Mt6835, 1 << 21, 4000, turning, arrives)
        };
        // Eight in a row, at full torque; each is counted, and no jump when the readings come back.
        assert_eq!(seen(&|k| !(1000..1008).contains(&k)), (None, 8));
        assert_eq!(
            seen(&|k| k < 1000),
            (Some(1008), 9),
            "the ninth is too much"
        );
        assert_eq!(seen(&|k| k % 20 != 7), (None, 200), "one in twenty");
        let (failed, _) = seen(&|k| k % 10 != 7);
        assert!(failed.is_some_and(|at| at < 300), "one in ten: {failed:?}");
    }

    #[test]
    fn wrong_frames_do_not_hide_that_the_count_stands() {
        let stuck = |t: f64| 30.0 / 60.0 * t.min(0.05);
        let counts = 1 << 21;
        let fires = |arrives: &dyn Fn(u32) -> bool| {
            let seen = watch(Interface::Mt6835, counts, 4000, stuck, arrives);
            seen.0.unwrap()
        };
        let whole = fires(&|_| true);
        let last_wrong = fires(&|k| k + 1 != whole);
        assert!(last_wrong <= whole + 1, "{last_wrong}, {whole} without");
    }

    #[test]
    fn a_jump_of_the_count_is_wrong_once() {
        // The index corrects forty lost counts of 10 000.
        let jumping = |t: f64| 5.0 * t + if t < 0.05 { 0.004 } else { 0.0 };
        let seen = watch(
            Interface::IncrementalWithIndex,
            10_000,
            4000,
            jumping,
            |_| true,
        );
        assert_eq!(seen, (None, 1));
    }

    /// What an index puts right was lost within a turn: past that one of both counts is wrong.
    #[test]
    fn a_jump_past_what_can_be_lost_fails_an_encoder_with_an_index() {
        let jumping = |t: f64| 5.0 * t + if t < 0.05 { 0.02 } else { 0.0 };
        for (interface, counts_per_turn, fired) in [
            (Interface::IncrementalWithIndex, 10_000, Some(1000)),
            // A frame that passes its check and is wrong is followed by one that is right.
            (Interface::Mt6835, 1 << 21, None),
        ] {
            let (seen, _) = watch(interface, counts_per_turn, 4000, jumping, |_| true);
            assert_eq!(seen, fired, "{interface:?}");
        }
    }
}
