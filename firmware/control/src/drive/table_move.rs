//! A move of the table by a distance: velocities for the coordinator, from the table's scale.
//!
//! The coordinator takes its reference from 0 to a velocity and back on the same curve, one the other's mirror image. So a
//! velocity `v` that is asked for the time `distance / v` moves the reference by the distance, whatever acceleration and
//! jerk it has, as long as the velocity is reached in between: [`MovePlan`] takes the largest `v` that is, and a whole
//! number of steps. Then a position loop on the scale takes out what the motors or the load have left.
//!
//! One step is made at a fixed rate, that of the speed task or slower, after it. It holds the table until it is commanded
//! otherwise.

use crate::base::format::TableVelocity;
use crate::plate::DrivePlate;

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
/// Part of the largest velocity that leaves the reference time to reach it, %.
const REACHED_PERCENT: u128 = 98;

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

/// What a plan takes of the feed, computed when the drive is configured: the chip has no double float unit.
///
/// A velocity is a word of [`TableVelocity`], 2^-28 m/s; a way is in nm, as the link has it. Products are taken in 128 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MoveConfig {
    /// Counts of the scale in a nm, 2^-48: a count of 1 um has 38 bits, and 2^31 counts are right to a hundredth.
    counts_per_nm: i64,
    /// Largest velocity.
    velocity_max: i32,
    /// `1/A` for a word of velocity, 2^-62 s: 34 bits at 1 m/s^2.
    time_per_word: u64,
    /// `A/J`, 2^-30 s: a rise of 1 ms is right to a millionth.
    rise: u64,
    /// `A^2/J`, the velocity from which on acceleration reaches its limit, words.
    rounded: u64,
    /// `J/4` for squares in nm^2 and cubes of words, 2^-84 m^3/s^3: 43 bits at 1 m/s^3.
    jerk: u64,
    /// A nm a step, 2^-24 words: 33 bits at 1 ms.
    velocity_per_nm: u64,
    /// Position loop: 2^-28 m/s a count, times 2^16.
    gain: i64,
    /// Its largest velocity, 2^-28 m/s.
    settle_max: i32,
    /// In its place within so many counts, for so many steps, after so many at most.
    tolerance: u32,
    held: u32,
    settle_steps: u32,
}

/// Fraction bits of a [`MoveConfig`].
const COUNT_BITS: u32 = 48;
const TIME_BITS: u32 = 30;
const TIME_PER_WORD_BITS: u32 = 62;
const STEP_BITS: u32 = 24;
/// A nm in 2^-58 m, which a word of velocity is in 2^-30 s.
const NM: u128 = (1u128 << (TableVelocity::FRAC_NBITS + TIME_BITS)) / 1_000_000_000;
/// Longest way, nm: 70 km. Its square times a jerk of 2^36 words still fits.
const WAY_MAX_NM: u64 = 1 << 46;

impl MoveConfig {
    /// Of a plate's feed and tuning, in steps of `step_s`.
    // Inlined where the drive is configured, which is apart from what the tasks call.
    #[must_use]
    #[inline(always)]
    #[allow(
        clippy::float_arithmetic,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    pub const fn new(plate: &DrivePlate, step_s: f64) -> Self {
        let (feed, a, j) = (
            &plate.feed,
            plate.feed.acceleration_max,
            plate.feed.jerk_max,
        );
        let word = (1u64 << TableVelocity::FRAC_NBITS) as f64;
        let time = (1u64 << TIME_BITS) as f64;
        let settle = if SETTLE_M_S < feed.velocity_max {
            SETTLE_M_S
        } else {
            feed.velocity_max
        };
        let tolerance = (TOLERANCE_M / feed.scale_count_m) as u32;
        let per_word = (1u64 << (TIME_PER_WORD_BITS - TableVelocity::FRAC_NBITS)) as f64;
        let cube = word * word * word;
        Self {
            counts_per_nm: (1e-9 / feed.scale_count_m * (1u64 << COUNT_BITS) as f64) as i64,
            velocity_max: (feed.velocity_max * word) as i32,
            time_per_word: (per_word / a) as u64,
            rise: (a / j * time) as u64,
            rounded: (a * a / j * word) as u64,
            jerk: (0.25e-18 * j * cube) as u64,
            velocity_per_nm: (1e-9 * word / step_s * (1u64 << STEP_BITS) as f64) as u64,
            gain: (POSITION_CUTOFF
                * plate.tuning.speed_rad_s
                * feed.scale_count_m
                * word
                * 65_536.0) as i64,
            settle_max: (settle * word) as i32,
            tolerance: if tolerance < 2 { 2 } else { tolerance },
            held: (HELD_S / step_s) as u32,
            settle_steps: (SETTLE_S / step_s) as u32,
        }
    }

    /// Whether the velocity is reached before it has to be left again for a move of `way_nm`: up and down take it times the
    /// time of the one, `v/A + A/J` where the acceleration reaches its limit and `2 sqrt(v/J)` where not.
    #[allow(clippy::arithmetic_side_effects)]
    fn reaches(&self, velocity: u32, way_nm: u64) -> bool {
        let (v, way) = (u128::from(velocity), u128::from(way_nm));
        if u64::from(velocity) >= self.rounded {
            // At most 2^31 times 2^64.
            let rise = (v * u128::from(self.time_per_word)) >> (TIME_PER_WORD_BITS - TIME_BITS);
            // At most 2^31 times 2^65 on the one side, 2^46 times 2^29 on the other.
            v * (rise + u128::from(self.rise)) <= way * NM
        } else {
            // At most 2^93 on the one side; a saturated other is beyond it.
            v * v * v <= (way * way).saturating_mul(u128::from(self.jerk))
        }
    }

    /// The largest velocity that is reached on half of the way, from 0 to `most`: bit by bit.
    fn largest(&self, most: u32, way_nm: u64) -> u32 {
        if self.reaches(most, way_nm) {
            return most;
        }
        let mut fits = 0;
        for bit in (0..31).rev() {
            let next = fits | 1 << bit;
            if next < most && self.reaches(next, way_nm) {
                fits = next;
            }
        }
        fits
    }
}

/// A move, planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MovePlan {
    config: MoveConfig,
    /// Counts of the scale from start to end.
    distance: i32,
    /// On the way.
    velocity: TableVelocity,
    /// Steps on the way.
    steps: u32,
}

impl MovePlan {
    /// A move by `distance_nm` at a velocity of `most` or less.
    ///
    /// # Errors
    /// [`MoveError`].
    #[allow(clippy::arithmetic_side_effects, clippy::cast_possible_truncation)]
    pub fn new(
        config: &MoveConfig,
        distance_nm: i64,
        most: TableVelocity,
    ) -> Result<Self, MoveError> {
        let most = most.to_bits();
        if !(1..=config.velocity_max).contains(&most) {
            return Err(MoveError::Velocity);
        }
        let way = distance_nm.unsigned_abs();
        if way > WAY_MAX_NM {
            return Err(MoveError::Distance);
        }
        // At most 2^46 times 2^63.
        let counts = i128::from(distance_nm) * i128::from(config.counts_per_nm);
        let counts = (counts + (1 << (COUNT_BITS - 1))) >> COUNT_BITS;
        let distance = i32::try_from(counts).map_err(|_| MoveError::Distance)?;
        let velocity = config.largest(most.unsigned_abs(), way);
        // The way's velocity if it took one step, 2^-24 words: at most 2^46 times 2^64.
        let at_once = u128::from(way) * u128::from(config.velocity_per_nm);
        let reached = (u128::from(velocity) << STEP_BITS) * REACHED_PERCENT;
        let steps = (at_once * 100).checked_div(reached);
        let steps = steps.and_then(|steps| u32::try_from(steps).ok());
        let steps = steps.filter(|steps| (2..u32::MAX / 2).contains(steps));
        let mut steps = steps.ok_or(MoveError::Distance)?;
        if distance == 0 {
            return Err(MoveError::Distance);
        }
        let asked = |steps: u32| {
            let steps = u128::from(steps) << STEP_BITS;
            (at_once + steps / 2).checked_div(steps).unwrap_or_default()
        };
        // A few steps cut to a whole number could ask for more than was said.
        if asked(steps) > u128::from(most.unsigned_abs()) {
            steps += 1;
        }
        // Within what was said, so in 31 bits.
        let velocity = asked(steps) as i32;
        Ok(Self {
            config: *config,
            distance,
            velocity: TableVelocity::from_bits(if distance_nm < 0 { -velocity } else { velocity }),
            steps,
        })
    }

    /// How long the table is on its way at that velocity, steps.
    #[must_use]
    pub const fn steps(&self) -> u32 {
        self.steps
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
        self.held = if error.unsigned_abs() <= plan.config.tolerance {
            self.held.saturating_add(1)
        } else {
            0
        };
        if self.held >= plan.config.held {
            self.enter(MoveProgress::Done);
            return TableVelocity::ZERO;
        }
        if self.steps >= plan.config.settle_steps {
            self.enter(MoveProgress::NotSettled);
            return TableVelocity::ZERO;
        }
        let wanted = plan.config.gain.saturating_mul(i64::from(error)) >> 16;
        let most = i64::from(plan.config.settle_max);
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
        MovePlan::new(
            &MoveConfig::new(&test_plate(), STEP_S),
            (distance_m * 1e9).round() as i64,
            TableVelocity::saturating_from_num(velocity),
        )
    }

    /// The same in floats: steps and velocity.
    fn by_floats(plate: &DrivePlate, distance_m: f64, most: f64) -> Option<(u32, f64)> {
        let (a, j) = (plate.feed.acceleration_max, plate.feed.jerk_max);
        let way = distance_m.abs();
        let reached = |v: f64| {
            if v * j >= a * a {
                v * (v / a + a / j) <= way
            } else {
                4.0 * v * v * v <= way * way * j
            }
        };
        let (mut fits, mut beyond) = (0.0, most);
        if reached(most) {
            fits = most;
        } else {
            for _ in 0..50 {
                let middle = 0.5 * (fits + beyond);
                if reached(middle) {
                    fits = middle;
                } else {
                    beyond = middle;
                }
            }
        }
        let steps = (way / (0.98 * fits * STEP_S)) as u32;
        (2..u32::MAX / 2)
            .contains(&steps)
            .then(|| (steps, distance_m / (f64::from(steps) * STEP_S)))
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

        /// Over all feeds and ways: a step and a millionth, as a word of velocity is 4 nm/s.
        #[test]
        fn a_plan_is_that_of_floats(
            distance_nm in 1i64..5_000_000_000, back: bool, log_velocity in -5.0..0.8f64,
            log_acceleration in -2.0..2.0f64, log_jerk in -1.0..5.0f64, log_count in -9.0..-6.0f64,
        ) {
            let mut plate = test_plate();
            plate.feed.velocity_max = 7.9;
            plate.feed.acceleration_max = 10f64.powf(log_acceleration);
            plate.feed.jerk_max = 10f64.powf(log_jerk);
            plate.feed.scale_count_m = 10f64.powf(log_count);
            let distance_nm = if back { -distance_nm } else { distance_nm };
            let distance_m = distance_nm as f64 * 1e-9;
            let most = TableVelocity::from_num(10f64.powf(log_velocity));
            let config = MoveConfig::new(&plate, STEP_S);
            let counts = distance_m / plate.feed.scale_count_m;
            let Ok(plan) = MovePlan::new(&config, distance_nm, most) else {
                prop_assert!(counts.abs() < 1.0 || counts.abs() > 2.1e9
                    || by_floats(&plate, distance_m, most.to_num()).is_none_or(|(steps, _)| steps < 4));
                return Ok(());
            };
            prop_assert!((f64::from(plan.distance) - counts).abs() < 0.6, "{} counts of {}", plan.distance, counts);
            prop_assert!(plan.velocity.abs() <= most, "{} m/s of {}", plan.velocity, most);
            let (steps, velocity) = by_floats(&plate, distance_m, most.to_num()).unwrap();
            let word = TableVelocity::DELTA.to_num::<f64>();
            // What the lowest bit of the largest velocity is worth.
            let apart = 1e-6 + 2.0 * word / velocity.abs();
            let off = f64::from(plan.steps) - f64::from(steps);
            prop_assert!(off.abs() <= 1.0 + apart * f64::from(steps), "{} steps of {}", plan.steps, steps);
            let way = plan.velocity.to_num::<f64>() * f64::from(plan.steps) * STEP_S;
            prop_assert!((way - distance_m).abs() <= 0.6 * word * f64::from(plan.steps) * STEP_S, "{} m of {}", way, distance_m);
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
        fn any_move_is_planned_or_refused(distance: i64, velocity: i32, scale: i32, arrived: bool) {
            let config = MoveConfig::new(&test_plate(), STEP_S);
            if let Ok(plan) = MovePlan::new(&config, distance, TableVelocity::from_bits(velocity)) {
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
            (30.0, 0.01, MoveError::Distance),
            (1e6, 0.01, MoveError::Distance),
            (0.01, 0.0, MoveError::Velocity),
            (0.01, 0.2, MoveError::Velocity),
            (0.01, -0.01, MoveError::Velocity),
        ] {
            assert_eq!(plan(distance, velocity), Err(error), "{distance} m");
        }
    }
}
