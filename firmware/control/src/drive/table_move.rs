//! A move of the table by a distance: velocities for the coordinator, from the table's scale.
//!
//! The coordinator takes its reference from 0 to a velocity and back on the same curve, one the other's mirror image. So a
//! velocity `v` that is asked for the time `distance / v` moves the reference by the distance, whatever acceleration and
//! jerk it has, as long as the velocity is reached in between: [`MovePlan`] takes the largest `v` that is, and a whole
//! number of steps. Then a position loop on the scale takes out what the motors or the load have left.
//!
//! One step is made at a fixed rate, that of the speed task or slower, after it. It holds the table until it is told
//! otherwise.

use crate::base::format::TableVelocity;
use crate::plate::FeedPlate;

/// The table is in its place within this, m, or two counts of its scale if they are more. Ours, as the figures below are:
/// above a scale's noise, below what a feed's position is wanted to.
const TOLERANCE_M: f64 = 1e-6;
/// And has been for so long, s.
const HELD_S: f64 = 0.02;
/// Longest that the position loop may take, s.
const SETTLE_S: f64 = 3.0;
/// Cutoff of the position loop, of the speed loops': low enough that they and the jerk limit do not matter to it.
const POSITION_CUTOFF: f64 = 0.1;
/// Largest velocity of the position loop, m/s.
const SETTLE_M_S: f64 = 1e-3;
/// Part of the largest velocity that leaves the reference time to reach it.
const REACHED: f64 = 0.98;

/// Steps after which the references are those of the command.
pub(crate) const TAKEN: u32 = 2;

/// Why a move is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoveError {
    /// No distance, one beyond the scale's range, or one that takes days.
    Distance,
    /// A velocity that is not above 0, or above the feed's.
    Velocity,
}

/// A move, planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovePlan {
    /// Counts of the scale from start to end.
    distance: i32,
    /// On the way.
    velocity: TableVelocity,
    /// Steps on the way.
    steps: u32,
    /// Position loop: 2^-28 m/s a count, times 2^16.
    gain: i64,
    /// Its largest velocity, 2^-28 m/s.
    settle_max: i32,
    /// In its place within so many counts, for so many steps, after so many at most.
    tolerance: u32,
    held: u32,
    settle_steps: u32,
}

impl MovePlan {
    /// A move by `distance_m` at `velocity_max` or less, of a feed whose scale has counts of `scale_count_m`, in steps of
    /// `step_s`; `speed_rad_s` is the cutoff of the speed loops.
    ///
    /// # Errors
    /// [`MoveError`].
    #[allow(
        clippy::float_arithmetic,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    pub fn new(
        feed: &FeedPlate,
        scale_count_m: f64,
        speed_rad_s: f64,
        step_s: f64,
        distance_m: f64,
        velocity_max: f64,
    ) -> Result<Self, MoveError> {
        if !(velocity_max > 0.0 && velocity_max <= feed.velocity_max) {
            return Err(MoveError::Velocity);
        }
        let counts = distance_m / scale_count_m;
        let way = distance_m.abs();
        if !(counts.abs() >= 1.0 && counts.abs() < f64::from(i32::MAX)) {
            return Err(MoveError::Distance);
        }
        // The largest velocity that is reached on half of the way: by halving.
        let (mut fits, mut beyond) = (0.0, velocity_max);
        if reached(feed, velocity_max, way) {
            fits = velocity_max;
        } else {
            for _ in 0..50 {
                let middle = 0.5 * (fits + beyond);
                if reached(feed, middle, way) {
                    fits = middle;
                } else {
                    beyond = middle;
                }
            }
        }
        let steps = (way / (REACHED * fits * step_s)) as u32;
        if !(2..u32::MAX / 2).contains(&steps) {
            return Err(MoveError::Distance);
        }
        let velocity = distance_m / (f64::from(steps) * step_s);
        let steps_of = |seconds: f64| (seconds / step_s) as u32;
        let word = f64::from(1 << TableVelocity::FRAC_NBITS);
        let settle = if SETTLE_M_S < feed.velocity_max {
            SETTLE_M_S
        } else {
            feed.velocity_max
        };
        let tolerance = (TOLERANCE_M / scale_count_m) as u32;
        Ok(Self {
            distance: counts as i32,
            velocity: TableVelocity::saturating_from_num(velocity),
            steps,
            gain: (POSITION_CUTOFF * speed_rad_s * scale_count_m * word * 65_536.0) as i64,
            settle_max: (settle * word) as i32,
            tolerance: if tolerance < 2 { 2 } else { tolerance },
            held: steps_of(HELD_S),
            settle_steps: steps_of(SETTLE_S),
        })
    }

    /// How long the table is on its way at that velocity, steps.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.steps
    }
}

/// Whether `velocity` is reached before it has to be left again for a move of `way`: up and down take `velocity` times the
/// time of the one, `v/a + a/j` where the acceleration reaches its limit and `2 sqrt(v/j)` where not.
#[allow(clippy::float_arithmetic)]
fn reached(feed: &FeedPlate, velocity: f64, way: f64) -> bool {
    let (v, a, j) = (velocity, feed.acceleration_max, feed.jerk_max);
    if v * j >= a * a {
        v * (v / a + a / j) <= way
    } else {
        4.0 * v * v * v <= way * way * j
    }
}

/// How a move is going.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MoveProgress {
    /// Both motors come to the base speed.
    #[default]
    Starting,
    /// On its way.
    Moving,
    /// The way is done; its end is reached by the scale.
    Settling,
    /// In its place, and held there.
    Done,
    /// Not in its place in time; held where it is.
    NotSettled,
}

/// A move under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TableMove {
    progress: MoveProgress,
    /// The scale at the start.
    start: i32,
    /// Steps of this part of the move, and in a row in the place.
    steps: u32,
    held: u32,
}

impl TableMove {
    /// A move from where the scale counts `start`: what the table moves while the motors take over its load is in the way.
    #[must_use]
    pub const fn new(start: i32) -> Self {
        Self {
            progress: MoveProgress::Starting,
            start,
            steps: 0,
            held: 0,
        }
    }

    /// How it is going.
    #[must_use]
    pub const fn progress(&self) -> MoveProgress {
        self.progress
    }

    /// One step: the scale's counts, and whether the references have arrived at what was asked -> the velocity to ask.
    #[must_use]
    pub fn step(&mut self, plan: &MovePlan, scale: i32, arrived: bool) -> TableVelocity {
        self.steps = self.steps.saturating_add(1);
        match self.progress {
            MoveProgress::Starting if arrived && self.steps > TAKEN => {
                self.enter(MoveProgress::Moving);
                plan.velocity
            }
            MoveProgress::Starting => TableVelocity::ZERO,
            MoveProgress::Moving if self.steps < plan.steps => plan.velocity,
            // At rest again: its first step still says that the velocity has arrived.
            MoveProgress::Moving if self.steps == plan.steps || !arrived => TableVelocity::ZERO,
            MoveProgress::Moving => {
                self.enter(MoveProgress::Settling);
                TableVelocity::ZERO
            }
            MoveProgress::Settling => self.settle(plan, scale),
            MoveProgress::Done | MoveProgress::NotSettled => TableVelocity::ZERO,
        }
    }

    fn enter(&mut self, progress: MoveProgress) {
        self.progress = progress;
        self.steps = 0;
    }

    fn settle(&mut self, plan: &MovePlan, scale: i32) -> TableVelocity {
        let target = self.start.wrapping_add(plan.distance);
        let error = target.wrapping_sub(scale);
        self.held = if error.unsigned_abs() <= plan.tolerance {
            self.held.saturating_add(1)
        } else {
            0
        };
        if self.held >= plan.held {
            self.enter(MoveProgress::Done);
            return TableVelocity::ZERO;
        }
        if self.steps >= plan.settle_steps {
            self.enter(MoveProgress::NotSettled);
            return TableVelocity::ZERO;
        }
        let wanted = plan.gain.saturating_mul(i64::from(error)) >> 16;
        let most = i64::from(plan.settle_max);
        // Within a word, as its ends are.
        #[allow(clippy::cast_possible_truncation)]
        TableVelocity::from_bits(wanted.clamp(most.saturating_neg(), most) as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use crate::speed::profile::Profile;
    use proptest::prelude::*;

    const COUNT_M: f64 = 10e-9;
    const STEP_S: f64 = 200e-6;

    fn plan(distance_m: f64, velocity: f64) -> Result<MovePlan, MoveError> {
        let plate = test_plate();
        MovePlan::new(
            &plate.feed,
            COUNT_M,
            plate.tuning.speed_rad_s,
            STEP_S,
            distance_m,
            velocity,
        )
    }

    /// A table that follows the coordinator's profile and is `lag_m` short at the end of the way: where it is at the end, how
    /// far it was beyond that, and the largest velocity.
    fn run(plan: &MovePlan, lag_m: f64) -> (MoveProgress, f64, f64) {
        let plate = test_plate();
        let config = plate.config().unwrap().coordinator;
        let (mut table, mut motion) = (Profile::default(), TableMove::new(0));
        let per_metre = core::f64::consts::TAU / plate.feed.lead_m;
        let (mut position, mut fastest, mut asked) = (0.0, 0.0f64, TableVelocity::ZERO);
        for _ in 0..2_000_000 {
            let target = asked.to_num::<f64>() * per_metre;
            table.step(
                &config.table,
                crate::base::format::ProfileState::from_num(target),
            );
            let velocity = table.value.to_num::<f64>() / per_metre;
            position += velocity * STEP_S;
            fastest = fastest.max(velocity.abs());
            let arrived = table.value == crate::base::format::ProfileState::from_num(target);
            let scale = ((position - lag_m) / COUNT_M) as i64 as i32;
            asked = motion.step(plan, scale, arrived);
            if matches!(
                motion.progress(),
                MoveProgress::Done | MoveProgress::NotSettled
            ) {
                break;
            }
        }
        (motion.progress(), position, fastest)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The way by the plan alone ends where it should, before the scale's loop has done anything.
        #[test]
        fn the_reference_s_way_is_the_distance(
            distance_mm in 0.01..300.0f64, back: bool, velocity_mm_s in 1.0..100.0f64,
        ) {
            let distance = distance_mm * 1e-3 * if back { -1.0 } else { 1.0 };
            let plan = plan(distance, velocity_mm_s * 1e-3).unwrap();
            let (progress, position, fastest) = run(&plan, 0.0);
            prop_assert_eq!(progress, MoveProgress::Done);
            prop_assert!((position - distance).abs() < 2e-6, "{} m of {}", position, distance);
            prop_assert!(fastest <= velocity_mm_s * 1e-3 * 1.000_001, "{} m/s", fastest);
        }

        #[test]
        fn what_the_motors_left_is_taken_out_by_the_scale(lag_um in -400.0..400.0f64) {
            let lag = lag_um * 1e-6;
            let plan = plan(5e-3, 20e-3).unwrap();
            let (progress, position, _) = run(&plan, lag);
            prop_assert_eq!(progress, MoveProgress::Done);
            let error = position - lag - 5e-3;
            prop_assert!(error.abs() < 1.2e-6, "{} m off", error);
        }

        #[test]
        fn any_move_is_planned_or_refused(distance: f64, velocity: f64, scale: i32, arrived: bool) {
            if let Ok(plan) = plan(distance, velocity) {
                let mut motion = TableMove::new(0);
                for _ in 0..100 {
                    let asked = motion.step(&plan, scale, arrived);
                    prop_assert!(asked.to_num::<f64>().abs() <= test_plate().feed.velocity_max);
                }
            }
        }
    }

    #[test]
    fn a_table_that_stays_away_is_told() {
        let plan = plan(1e-3, 10e-3).unwrap();
        let mut motion = TableMove::new(0);
        for _ in 0..plan.steps() + 20_000 {
            let _ = motion.step(&plan, 0, true);
        }
        assert_eq!(motion.progress(), MoveProgress::NotSettled);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for (distance, velocity, error) in [
            (0.0, 0.01, MoveError::Distance),
            (f64::NAN, 0.01, MoveError::Distance),
            (30.0, 0.01, MoveError::Distance),
            (0.01, 0.0, MoveError::Velocity),
            (0.01, 0.2, MoveError::Velocity),
            (0.01, f64::NAN, MoveError::Velocity),
        ] {
            assert_eq!(plan(distance, velocity), Err(error), "{distance} m");
        }
    }
}
