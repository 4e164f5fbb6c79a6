//! The table's scale against both motors: what neither encoder sees by itself.
//!
//! The screw's angle less the nut's, by the lead, is where the table should be. Where the scale says otherwise by more than
//! the plate's limit, one of the three is wrong, or the mechanics between them: a coupling that slips, a nut that is not held,
//! an encoder that stands while its shaft turns, a scale that stands. Counted from where the drive began to drive.
//!
//! The limit has to be above what a healthy axis shows: the lead's error (23 um in 300 mm of tolerance grade 5, ISO 3408-3),
//! backlash, and what force over stiffness gives. A scale that has not counted since the start is taken as one that is not
//! there: one that is moves by its 0.1 or 1 um as soon as the motors have current.

use crate::base::format::Misfit;

/// What the scale and the feed are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleWatchPlate {
    /// One count, m; negative where it counts down towards positive velocity.
    pub count_m: f64,
    /// Lead, m a turn.
    pub lead_m: f64,
    /// Furthest that scale and motors may be apart, m.
    pub apart_max_m: f64,
}

impl ScaleWatchPlate {
    /// What is usual: 0.2 mm, several times what a healthy axis shows.
    #[must_use]
    pub const fn usual(count_m: f64, lead_m: f64) -> Self {
        Self {
            count_m,
            lead_m,
            apart_max_m: 0.2e-3,
        }
    }
}

/// The same in counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleWatchConfig {
    /// Counts a turn, 2^-8.
    pub counts_a_turn: i32,
    /// A turn of a count, 2^-40 turn.
    pub turn_a_count: i64,
    /// Furthest apart, 2^-8 counts.
    pub apart_max: i64,
}

impl ScaleWatchConfig {
    /// What the table counts where the screw turns so much more than the nut, 2^-32 turn, in 2^-8 counts.
    #[must_use]
    pub const fn counts_of(&self, turned: i64) -> i64 {
        // 256 turns and 2^31 counts a turn are within the word.
        (turned >> 8).saturating_mul(self.counts_a_turn as i64) >> 24
    }

    /// What so many counts of the table are as a turn of the screw against the nut, 2^-32 turn.
    #[must_use]
    pub const fn turned_by(&self, counted: i64) -> i64 {
        counted.saturating_mul(self.turn_a_count) >> 8
    }
}

impl ScaleWatchPlate {
    /// In counts.
    ///
    /// # Errors
    /// [`Misfit`] if a turn has too many counts.
    #[allow(clippy::cast_possible_truncation)]
    pub const fn config(&self) -> Result<ScaleWatchConfig, Misfit> {
        let turn = self.lead_m / self.count_m * 256.0;
        let most = 2_147_483_647.0;
        let apart = self.apart_max_m / self.count_m.abs() * 256.0;
        if !(turn.abs() >= 1.0 && turn.abs() < most && apart >= 1.0 && apart < most) {
            return Err(Misfit {
                name: "scale's counts a turn",
                unit: "2^-8 counts",
                value: turn.abs(),
                least: 1.0,
                below: most,
            });
        }
        Ok(ScaleWatchConfig {
            counts_a_turn: turn as i32,
            turn_a_count: (281_474_976_710_656.0 / turn) as i64,
            apart_max: apart as i64,
        })
    }
}

/// State of the watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScaleWatch {
    last: Option<u32>,
    /// The scale has counted since the start.
    there: bool,
    /// What the screw has turned more than the nut, 2^-32 turn.
    turned: i64,
    /// What the scale has counted.
    counted: i64,
}

impl ScaleWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            last: None,
            there: false,
            turned: 0,
            counted: 0,
        }
    }

    /// One look at what the screw has turned more than the nut since the last, 2^-32 turn, and the scale's count: scale and
    /// motors are too far apart.
    pub fn step(
        &mut self,
        config: &ScaleWatchConfig,
        driven: bool,
        moved: i64,
        scale: u32,
    ) -> bool {
        let last = self.last.replace(scale).unwrap_or(scale);
        let counted = i64::from(scale.wrapping_sub(last).cast_signed());
        self.there |= counted != 0;
        if !driven || !self.there {
            (self.turned, self.counted) = (0, 0);
            return false;
        }
        self.turned = self.turned.saturating_add(moved);
        self.counted = self.counted.saturating_add(counted);
        let expected = config.counts_of(self.turned);
        let apart = expected.saturating_sub(self.counted.saturating_mul(256));
        apart.unsigned_abs() > config.apart_max.unsigned_abs()
    }

    /// The scale has counted since the start.
    #[must_use]
    pub const fn is_there(&self) -> bool {
        self.there
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PLATE: ScaleWatchPlate = ScaleWatchPlate::usual(0.1e-6, 5e-3);

    /// The look at which it is found; `screw`, `nut` in turns and `table` in m by the look.
    fn found(
        looks: u32,
        plate: ScaleWatchPlate,
        at: impl Fn(u32) -> (f64, f64, f64),
    ) -> Option<u32> {
        let (config, mut watch) = (plate.config().unwrap(), ScaleWatch::new());
        let mut last = None;
        (0..looks).find(|&k| {
            let (screw, nut, table) = at(k);
            let turned = ((screw - nut) * 2f64.powi(32)) as i64;
            let moved = turned - last.replace(turned).unwrap_or(turned);
            let count = (table / plate.count_m).round() as i64 as u32;
            watch.step(&config, true, moved, count)
        })
    }

    proptest! {
        /// Whatever both turn by, over the wraps of angle and count, a table that goes with them is not a fault, in either sense
        /// of the scale.
        #[test]
        fn a_table_that_goes_with_its_motors_is_no_fault(
            screw in -0.05..0.05f64, nut in -0.05..0.05f64, start in -1e3..1e3f64, sign in any::<bool>(),
        ) {
            let plate = ScaleWatchPlate { count_m: if sign { 0.1e-6 } else { -0.1e-6 }, ..PLATE };
            let wobble = |k: u32| 50e-6 * (f64::from(k) / 30.0).sin();
            let at = |k: u32| {
                let n = f64::from(k);
                (screw * n, nut * n, start + 5e-3 * (screw - nut) * n + wobble(k))
            };
            prop_assert_eq!(found(3000, plate, at), None);
        }

        #[test]
        fn no_word_overflows(looks in prop::collection::vec((any::<i64>(), any::<u32>()), 1..500)) {
            let (config, mut watch) = (PLATE.config().unwrap(), ScaleWatch::new());
            for (moved, scale) in looks {
                watch.step(&config, true, moved, scale);
            }
        }
    }

    #[test]
    fn what_is_left_behind_is_found_at_the_limit() {
        // The nut turns at 2 turns/s although its encoder stands; the scale stands; it counts the other way; it jumps.
        let at = |k: u32| f64::from(k) * 2e-3;
        let limit = PLATE.apart_max_m / 5e-3;
        let looks = (limit / 2e-3) as u32;
        for (name, table, expected) in [
            ("nut", -1.0, 0.5 * f64::from(looks)),
            ("sign", -1.0, 0.5 * f64::from(looks)),
            ("slip", 0.5, 2.0 * f64::from(looks)),
        ] {
            let found = found(1000, PLATE, |k| (at(k), 0.0, 5e-3 * table * at(k)));
            let late = f64::from(found.unwrap()) - expected;
            assert!(
                (-1.0..=2.0).contains(&late),
                "{name}: found in look {found:?}, expected {expected}"
            );
        }
        let jumps = |k: u32| {
            (
                at(k),
                at(k),
                if k < 100 {
                    1e-9 * f64::from(k) * 2.0
                } else {
                    0.3e-3
                },
            )
        };
        assert_eq!(found(1000, PLATE, jumps), Some(100));
    }

    #[test]
    fn a_scale_that_never_counts_is_not_there_and_what_rests_is_not_looked_at() {
        let standing = |k: u32| (f64::from(k) * 2e-3, 0.0, 0.0);
        assert_eq!(found(5000, PLATE, standing), None);
        let (config, mut watch) = (PLATE.config().unwrap(), ScaleWatch::new());
        for k in 0..1000u32 {
            assert!(!watch.step(&config, false, 0, k * 100));
        }
        assert!(watch.is_there());
    }
}
