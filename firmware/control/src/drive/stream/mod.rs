//! A host streams positions of the table: velocities for the coordinator, from set-points with times.
//!
//! Each set-point carries its time in the stream. The drive keeps set-points for a delay and interpolates on its own clock, so that
//! when a set-point comes does not matter as long as it comes before its turn. Between two set-points the position is a cubic with
//! the velocities at its ends (Hermite): the velocity has no step. See [`segment`].
//!
//! The velocity that is asked is what the interpolated position goes in the next step, plus a position loop on the scale. The
//! coordinator's profile limits velocity, acceleration and jerk. It lags behind a velocity that changes by `a` a second by
//! `a^2 / (2 J)`, which is added.
//!
//! Where the next set-point is missing at its turn, the stream ends: the drive comes to rest as it does on a stop. The host's clock
//! and the drive's differ: the drive's goes slower or faster by 1/2000 while the set-points come less than half of the delay early,
//! or more than one and a half.
//!
//! One step is made at a fixed rate, slower than the speed task.

mod queue;
mod segment;

use crate::base::format::TableVelocity;
use crate::drive::table_move::TAKEN;
use crate::plate::DrivePlate;
use queue::Queue;
use segment::{Knot, NM_BITS, Segment};

/// Most set-points that wait.
pub const WAITING: usize = 64;
/// Shortest and longest delay, ms.
pub const DELAY_MS: [u16; 2] = [5, 200];
/// Shortest and longest time between two set-points, us.
pub const SPACING_US: [u32; 2] = [1000, 50_000];
/// Furthest that the table may stand from the first set-point, nm.
pub const START_NM: u64 = 100_000;
/// Furthest position, nm: 70 km.
const FURTHEST_NM: u64 = 1 << 46;
/// Cutoff of the position loop, of the speed loops'. As that of a [`move`](crate::table_move).
const POSITION_CUTOFF: f64 = 0.1;
/// Steps in which the clock is put right by a microsecond.
const TRIM_STEPS: u32 = 2;

/// Fraction bits of a [`StreamConfig`].
const GAIN_BITS: u32 = 32;
const VELOCITY_BITS: u32 = 16;
const LAG_BITS: u32 = 44;
const TIME_BITS: u32 = 12;

/// A position, and when it is the table's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetPoint {
    /// Time in the stream, us, which wraps.
    pub at_us: u32,
    /// Position from the stream's zero, nm.
    pub position_nm: i64,
    /// Velocity there; `None`: that of its neighbours.
    pub velocity: Option<TableVelocity>,
}

/// What a stream takes of the feed, computed when the drive is configured: the chip has no double float unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StreamConfig {
    /// Largest velocity, 2^-28 m/s.
    velocity_max: i32,
    /// A count of the scale, 2^-16 nm.
    nm_per_count: i64,
    /// Velocity of a way of 2^-16 nm a step, 2^-28 m/s, 2^-16.
    velocity_per_way: i64,
    /// Position loop: velocity for 2^-16 nm, 2^-28 m/s, 2^-32.
    gain: i64,
    /// Its largest velocity, 2^-28 m/s.
    correction_max: i32,
    /// What a velocity lags at most: that of the largest acceleration, 2^-28 m/s.
    lag_max: i32,
    /// `1 / (2 J)` for the square of a velocity's change in a step, 2^-44 of 2^-28 m/s.
    lag: i64,
    /// A step, us.
    step_us: u32,
}

impl StreamConfig {
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
        let feed = &plate.feed;
        let word = (1u64 << TableVelocity::FRAC_NBITS) as f64;
        let way = 1e-9 / (1u64 << NM_BITS) as f64;
        let cutoff = POSITION_CUTOFF * plate.tuning.speed_rad_s;
        // The profile follows a correction of this size as the position loop asks: half of acceleration and jerk.
        let correction = (0.5 * feed.acceleration_max / cutoff)
            .min(0.5 * feed.jerk_max / (cutoff * cutoff))
            .min(feed.velocity_max);
        Self {
            velocity_max: (feed.velocity_max * word) as i32,
            nm_per_count: (feed.scale_count_m * 1e9 * (1u64 << NM_BITS) as f64) as i64,
            velocity_per_way: (way / step_s * word * (1u64 << VELOCITY_BITS) as f64) as i64,
            gain: (way * cutoff * word * (1u64 << GAIN_BITS) as f64) as i64,
            correction_max: (correction * word) as i32,
            lag_max: (0.5 * feed.acceleration_max * feed.acceleration_max / feed.jerk_max * word)
                as i32,
            lag: (1.0 / (2.0 * feed.jerk_max * step_s * step_s) / word * (1u64 << LAG_BITS) as f64)
                as i64,
            step_us: (step_s * 1e6 + 0.5) as u32,
        }
    }

    /// Where the table stands, nm, whose scale counts so many from the stream's zero.
    fn position_nm(&self, counts: i32) -> i64 {
        i64::from(counts).saturating_mul(self.nm_per_count) >> NM_BITS
    }

    /// The table may go `way_nm` in `us`.
    #[allow(clippy::arithmetic_side_effects)]
    fn reaches(&self, way_nm: u64, us: u32) -> bool {
        // In 2^-28 m/s times a nm: at most 2^31 times 2^26, and 2^64 times 2^28.
        let most = i128::from(self.velocity_max) * i128::from(us) * 1000;
        (i128::from(way_nm) << TableVelocity::FRAC_NBITS) <= most
    }
}

/// Why a set-point is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetPointError {
    /// No stream is open.
    Closed,
    /// Too many wait.
    Full,
    /// Its time is not [`SPACING_US`] behind the last one's.
    Spacing,
    /// It is further from the last one, or from the table, than the feed goes meanwhile.
    Step,
    /// Its velocity is above the feed's.
    Velocity,
}

/// How a stream is going.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StreamProgress {
    /// The first set-point is awaited, or the motors.
    #[default]
    Waiting,
    /// The table follows.
    Following,
    /// A set-point was missing at its turn, or the last one is reached.
    Ended,
}

/// How the drive stands to a set-point that it has taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// How long before its turn it has come, us.
    pub ahead_us: i32,
    /// What the table was behind the stream's position in the last step, nm.
    pub error_nm: i32,
}

/// A stream.
#[derive(Clone, Debug)]
pub struct Stream {
    progress: StreamProgress,
    queue: Queue,
    /// The last that was taken.
    last: Option<SetPoint>,
    /// The scale at position zero.
    zero: i32,
    delay_us: u32,
    /// Time in the stream, us.
    clock_us: u32,
    /// The clock goes slower (-1) or faster (1).
    trim: i32,
    steps: u32,
    segment: Segment,
    /// Where the table should be now, 2^-16 nm, and how fast in the last step.
    position: i64,
    velocity: i32,
    error_nm: i32,
}

impl Stream {
    /// None that is open.
    #[must_use]
    pub const fn closed() -> Self {
        Self {
            progress: StreamProgress::Ended,
            queue: Queue::new(),
            last: None,
            zero: 0,
            delay_us: 0,
            clock_us: 0,
            trim: 0,
            steps: 0,
            segment: Segment::NONE,
            position: 0,
            velocity: 0,
            error_nm: 0,
        }
    }

    /// Opens another: positions count from where the scale counts `zero`, and set-points wait for `delay_ms`, which is cut to
    /// [`DELAY_MS`].
    pub fn open(&mut self, zero: i32, delay_ms: u16) {
        let [least, most] = DELAY_MS;
        *self = Self::closed();
        self.progress = StreamProgress::Waiting;
        self.zero = zero;
        self.delay_us = u32::from(delay_ms.clamp(least, most)).saturating_mul(1000);
    }

    /// How it is going.
    #[must_use]
    pub const fn progress(&self) -> StreamProgress {
        self.progress
    }

    /// The scale's count at position zero.
    #[must_use]
    pub const fn zero(&self) -> i32 {
        self.zero
    }

    /// No further set-point is taken.
    pub fn close(&mut self) {
        self.progress = StreamProgress::Ended;
    }

    /// Takes a set-point, while the scale counts `scale`.
    ///
    /// # Errors
    /// [`SetPointError`]; nothing is changed then.
    pub fn push(
        &mut self,
        config: &StreamConfig,
        point: SetPoint,
        scale: i32,
    ) -> Result<Followed, SetPointError> {
        if self.progress == StreamProgress::Ended {
            return Err(SetPointError::Closed);
        }
        let fast = |velocity: TableVelocity| {
            velocity.to_bits().unsigned_abs() > config.velocity_max.unsigned_abs()
        };
        if point.velocity.is_some_and(fast) {
            return Err(SetPointError::Velocity);
        }
        let way_nm = |from: i64| point.position_nm.saturating_sub(from).unsigned_abs();
        let fits = match self.last {
            None => {
                let here = config.position_nm(scale.wrapping_sub(self.zero));
                self.clock_us = point.at_us.wrapping_sub(self.delay_us);
                way_nm(here) <= START_NM
            }
            Some(last) => {
                let us = point.at_us.wrapping_sub(last.at_us);
                let [least, most] = SPACING_US;
                if !(least..=most).contains(&us) {
                    return Err(SetPointError::Spacing);
                }
                config.reaches(way_nm(last.position_nm), us)
            }
        };
        if !fits || point.position_nm.unsigned_abs() > FURTHEST_NM {
            return Err(SetPointError::Step);
        }
        self.queue.push(point)?;
        self.last = Some(point);
        let ahead = point.at_us.wrapping_sub(self.clock_us).cast_signed();
        if self.progress == StreamProgress::Following {
            let off = ahead.saturating_sub_unsigned(self.delay_us);
            self.trim = if off.unsigned_abs() > self.delay_us >> 1 {
                off.signum()
            } else {
                0
            };
        }
        Ok(Followed {
            ahead_us: ahead,
            error_nm: self.error_nm,
        })
    }

    /// One step: the scale's counts, and whether the references have arrived at what was asked -> the velocity to ask.
    pub fn step(&mut self, config: &StreamConfig, scale: i32, arrived: bool) -> TableVelocity {
        self.steps = self.steps.saturating_add(1);
        if self.progress == StreamProgress::Waiting
            && arrived
            && self.steps > TAKEN
            && let Some(first) = self.queue.pop()
        {
            self.progress = StreamProgress::Following;
            self.clock_us = first.at_us.wrapping_sub(self.delay_us);
            let knot = Knot::of(first, TableVelocity::ZERO);
            self.segment = Segment::new(knot, knot);
            self.position = knot.position;
        }
        if self.progress != StreamProgress::Following {
            return TableVelocity::ZERO;
        }
        // Where it should be now, and at the end of this step.
        let before = self.position;
        self.go_on(config);
        if self.progress != StreamProgress::Following {
            return TableVelocity::ZERO;
        }
        let here = i64::from(scale.wrapping_sub(self.zero)).saturating_mul(config.nm_per_count);
        let error = before.saturating_sub(here);
        let nm = (error >> NM_BITS).clamp(i32::MIN.into(), i32::MAX.into());
        let way = self.position.saturating_sub(before);
        let velocity = scaled(way, config.velocity_per_way, VELOCITY_BITS);
        let change = i64::from(velocity.saturating_sub(self.velocity));
        let square = change.saturating_mul(change.saturating_abs());
        let lag = scaled(square, config.lag, LAG_BITS);
        let correction = scaled(error, config.gain, GAIN_BITS);
        self.velocity = velocity;
        let asked = velocity
            .saturating_add(within(lag, config.lag_max))
            .saturating_add(within(correction, config.correction_max));
        // Clamped to 32 bits.
        #[allow(clippy::cast_possible_truncation)]
        {
            self.error_nm = nm as i32;
        }
        TableVelocity::from_bits(within(asked, config.velocity_max))
    }

    /// The clock's next step, and the position then.
    fn go_on(&mut self, config: &StreamConfig) {
        let trim = match self.steps.checked_rem(TRIM_STEPS) {
            Some(0) => self.trim,
            _ => 0,
        };
        let step_us = config.step_us.saturating_add_signed(trim);
        self.clock_us = self.clock_us.wrapping_add(step_us);
        // A step is hardly longer than the shortest segment, so that two ends are passed at most.
        for _ in 0..2 {
            if !self.segment.is_over(self.clock_us) {
                break;
            }
            let Some(next) = self.queue.pop() else {
                // The end of the last one is reached first.
                if self.clock_us.wrapping_sub(self.segment.end_us()) >= step_us {
                    self.progress = StreamProgress::Ended;
                }
                break;
            };
            self.segment = self.segment.followed_by(next, self.queue.front());
        }
        self.position = self.segment.at(self.clock_us);
    }
}

/// `x`, cut to ±`most`, which is not below 0.
fn within(x: i32, most: i32) -> i32 {
    x.min(most).max(most.saturating_neg())
}

/// `x` times a gain of so many fraction bits, saturated.
#[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
fn scaled(x: i64, gain: i64, bits: u32) -> i32 {
    // Two of 63 bits.
    let product = (i128::from(x) * i128::from(gain)) >> bits;
    product.clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

#[cfg(test)]
mod tests;
