//! An encoder whose count stands while the observer says that the shaft turns.
//!
//! A torn cable or a dead encoder leaves its last count. The drive would then see a shaft at rest, push harder, and
//! commutate on an angle that is not there. The observer's speed cannot fall faster than the torque allows, so a
//! healthy encoder lets it turn only so far while the count stands: furthest when the shaft reverses at full torque.
//! There the speed lags the shaft's by `2*zeta*a / omega_0`, and within one count of the turning point the count
//! stands for `2*sqrt(2*count / a)`.

use core::hint::cold_path;

/// Configuration of an encoder's watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderWatchConfig {
    /// Furthest that the observer may turn while the count stands, 2^-32 mechanical turn.
    pub travel_max: u32,
}

/// State of an encoder's watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderWatch {
    counts: u32,
    /// How far the observer has turned since the count last changed.
    travel: u32,
    stuck: bool,
}

impl EncoderWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            counts: 0,
            travel: 0,
            stuck: false,
        }
    }

    /// The encoder was found stuck; it stays so until a new watch is started.
    #[must_use]
    #[inline(always)]
    pub const fn stuck(&self) -> bool {
        self.stuck
    }

    /// Takes a count and how far the observer turned in its sample, 2^-32 mechanical turn. `true` if the encoder is found
    /// stuck now.
    #[inline(always)]
    pub fn step(&mut self, config: &EncoderWatchConfig, counts: u32, turned: i32) -> bool {
        if counts == self.counts {
            cold_path();
            self.travel = self.travel.saturating_add(turned.unsigned_abs());
            self.stuck = self.travel > config.travel_max;
            return self.stuck;
        }
        self.counts = counts;
        self.travel = 0;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Observer;
    use crate::plate::test_plate;

    /// Runs observer and watch over a shaft whose angle (turns) is a function of time (s); the sample at which the
    /// watch fires.
    fn fires(counts_per_turn: u32, samples: u32, angle: impl Fn(f64) -> f64) -> Option<u32> {
        let mut plate = test_plate();
        plate.motors[0].encoder.counts_per_turn = counts_per_turn;
        let config = plate.motors[0].current_loop(&plate).unwrap();
        let counts = |k: u32| {
            let turns = angle(f64::from(k) * 50e-6).rem_euclid(1.0);
            (turns * f64::from(counts_per_turn)) as u32 % counts_per_turn
        };
        let (mut observer, mut watch) = (
            Observer::at(&config.observer, counts(0)),
            EncoderWatch::new(),
        );
        let first = (0..samples).find(|&k| {
            let motion = observer.step(&config.observer, counts(k));
            watch.step(&config.encoder_watch, counts(k), motion.theta_step)
        });
        assert_eq!(watch.stuck(), first.is_some());
        first
    }

    #[test]
    fn a_healthy_encoder_never_fires() {
        let plate = test_plate();
        let torque = plate.motors[0].torque_max_nm;
        // Full torque through the turning point, in turns/s^2, and a slow crawl.
        let hardest = torque / plate.motors[0].inertia_kg_m2 / core::f64::consts::TAU;
        for counts_per_turn in [1 << 20, 10_000, 1024] {
            let reversal = |t: f64| hardest / 2.0 * (t - 0.0503).powi(2);
            assert_eq!(
                fires(counts_per_turn, 2000, reversal),
                None,
                "{counts_per_turn}"
            );
            assert_eq!(
                fires(counts_per_turn, 20_000, |t| 1e-3 * t),
                None,
                "{counts_per_turn}"
            );
            assert_eq!(
                fires(counts_per_turn, 2000, |t| 10.0 * t),
                None,
                "{counts_per_turn}"
            );
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
}
