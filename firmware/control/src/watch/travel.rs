//! Soft limits: the ends of the table's travel by its homed position.
//!
//! Each look computes how far the table still goes if the reference went to rest from now on: the profile brings an acceleration
//! `a` to nothing in `T = a/J` and the velocity to `v1 = v + a T/2` meanwhile, in `v1 T - J T^3/6`; from there it comes to rest in
//! at most `v1^2/(2A) + v1 A/(2J)` (equal where the acceleration reaches its limit `A`, and more than it takes where it does not).
//! Where that and [`STANDS_BEFORE_M`] do not fit before a limit any more, the way to it is blocked: the reference goes to rest
//! within its acceleration and jerk. It stays blocked until the reference stands and another velocity is asked, so that a table
//! does not creep to its limit in jerks.
//!
//! What is seen is acted on [`LATENCY_S`] later: the acceleration is taken as that much further, and the table goes on at `v1`
//! for it and for the speed loops' lag.
//!
//! A table that is past a limit all the same, pushed or not to be stopped with the torque that there is, is a fault; away from it
//! the drive runs. Without a homed position nothing of this acts.

use crate::base::fault::Fault;
use crate::base::format::{Speed, SpeedChange, TableVelocity};

/// The reference comes to rest so far before a limit at least, m: above what a table that stands gives way to a load.
pub const STANDS_BEFORE_M: f64 = 100e-6;
/// From a look at scale and reference to a reference that goes to rest, s: a look of the speed task each way, one of the
/// supervision, and as much again that it may be late.
pub const LATENCY_S: f64 = 4e-3;
/// Fraction bits of a time, s.
pub(crate) const TIME_BITS: u32 = 20;
/// Of what a count is, nm, and of a velocity's word, nm/s.
pub(crate) const LENGTH_BITS: u32 = 16;
/// Of the time that a word of acceleration takes to be brought to nothing, in 2^-20 s.
pub(crate) const TIME_PER_WORD_BITS: u32 = 32;
/// Velocities are squared without so many bits, and the square is used without twice as many less four.
pub(crate) const SQUARED_BITS: u32 = 10;
/// Of `1/(2A)`.
pub(crate) const PER_ACCELERATION_BITS: u32 = 8;

/// The limits, and how the reference comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TravelConfig {
    /// One count of the scale, 2^-16 nm.
    pub(crate) nm_per_count: i64,
    /// Minimum and maximum position, nm; `None`: there is no limit.
    pub(crate) ends_nm: Option<[i64; 2]>,
    /// [`STANDS_BEFORE_M`], nm.
    pub(crate) stands_before_nm: i64,
    /// A word of the reference, 2^-16 nm/s.
    pub(crate) velocity_per_word: i64,
    /// `1/J` for a word of its change, in 2^-52 s.
    pub(crate) time_per_word: i64,
    /// A word of its change, 2^-16 nm/s^2.
    pub(crate) acceleration_per_word: i64,
    /// How much the acceleration grows in the latency, nm/s^2.
    pub(crate) acceleration_more: i64,
    /// The latency, 2^-20 s.
    pub(crate) latency: i64,
    /// `A/(2J)`, the latency, and the speed loops' lag, 2^-20 s.
    pub(crate) time: i64,
    /// `1/(2A)` for squares in 2^36 nm^2/s^2, in 2^-8 nm.
    pub(crate) per_acceleration: i64,
}

/// What is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TravelLook {
    /// The table's scale, counts, which wrap.
    pub scale: i32,
    /// The scale's count at position zero; `None`: the drive is not homed.
    pub origin: Option<i32>,
    /// Both motors follow their references.
    pub driven: bool,
    /// What the table's share turns the screw by against the nut, and its change a step.
    pub reference: (Speed, SpeedChange),
    /// The table velocity that is asked.
    pub asked: TableVelocity,
}

/// What came of a look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TravelSeen {
    /// The table may not go forwards, backwards.
    pub blocked: [bool; 2],
    /// The table is past a limit.
    pub fault: Option<Fault>,
}

/// The watch of one side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Side {
    /// The velocity that was asked when the way was blocked.
    blocked_for: Option<TableVelocity>,
    /// The table was within the limit since the drive began to drive.
    was_within: bool,
}

/// State of the watch: forwards, backwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Travel {
    sides: [Side; 2],
}

impl TravelConfig {
    /// Where the table is by a homed scale, nm.
    #[must_use]
    pub const fn position_nm(&self, scale: i32, origin: i32) -> i64 {
        let counts = scale.wrapping_sub(origin) as i64;
        counts.saturating_mul(self.nm_per_count) >> LENGTH_BITS
    }

    /// A table that goes so many nm from where its scale counts `scale` stands before both limits; without a homed position none
    /// acts.
    #[must_use]
    pub fn allows(&self, scale: i32, origin: Option<i32>, distance_nm: i64) -> bool {
        let (Some([least, most]), Some(origin)) = (self.ends_nm, origin) else {
            return true;
        };
        let position_nm = self.position_nm(scale, origin).saturating_add(distance_nm);
        let before = self.stands_before_nm;
        position_nm >= least.saturating_add(before) && position_nm <= most.saturating_sub(before)
    }

    /// How far the table goes at most, nm, if the reference, in nm/s and words of its change a step, goes to rest from now on.
    fn way_to_rest(&self, velocity: i64, change: i64) -> i64 {
        let time = change.saturating_mul(self.time_per_word) >> TIME_PER_WORD_BITS;
        let time = time.saturating_add(self.latency);
        let acceleration = change.saturating_mul(self.acceleration_per_word) >> LENGTH_BITS;
        let acceleration = acceleration.saturating_add(self.acceleration_more);
        // Both have one sign.
        let more = (acceleration >> SQUARED_BITS).saturating_mul(time)
            >> TIME_BITS.saturating_sub(SQUARED_BITS).saturating_add(1);
        // A reference that goes away from the limit ever faster does not turn.
        if velocity <= 0 && time <= 0 {
            return 0;
        }
        let velocity = velocity.saturating_add(more);
        if velocity <= 0 {
            return 0;
        }
        let root = (velocity >> SQUARED_BITS).saturating_add(1);
        let square = (root.saturating_mul(root) >> LENGTH_BITS).saturating_add(1);
        let braking = square.saturating_mul(self.per_acceleration) >> PER_ACCELERATION_BITS;
        let going = velocity.saturating_mul(self.time.saturating_add(time)) >> TIME_BITS;
        // A third by 2^-16.
        let third = more.saturating_mul(time) >> TIME_BITS;
        let less = third.saturating_mul(21_845) >> 16;
        braking.saturating_add(going).saturating_sub(less).max(0)
    }
}

impl Travel {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        const NONE: Side = Side {
            blocked_for: None,
            was_within: false,
        };
        Self { sides: [NONE; 2] }
    }

    /// One look, once a millisecond or more often.
    pub fn step(&mut self, config: &TravelConfig, look: &TravelLook) -> TravelSeen {
        let (Some([least, most]), Some(origin)) = (config.ends_nm, look.origin) else {
            *self = Self::new();
            return TravelSeen::default();
        };
        let position = config.position_nm(look.scale, origin);
        let (velocity, change) = look.reference;
        let word = i64::from(velocity.to_bits());
        let velocity = word.saturating_mul(config.velocity_per_word) >> LENGTH_BITS;
        let change = i64::from(change.to_bits());
        let stands = word == 0 && change == 0;
        let [forwards, backwards] = &mut self.sides;
        let asked = look.asked;
        let forwards = forwards.step(
            config,
            look.driven,
            most.saturating_sub(position),
            [velocity, change],
            stands,
            asked,
        );
        let backwards = backwards.step(
            config,
            look.driven,
            position.saturating_sub(least),
            [velocity.saturating_neg(), change.saturating_neg()],
            stands,
            asked.saturating_neg(),
        );
        TravelSeen {
            blocked: [forwards.0, backwards.0],
            fault: if forwards.1 {
                Some(Fault::TravelForward)
            } else if backwards.1 {
                Some(Fault::TravelBackward)
            } else {
                None
            },
        }
    }
}

impl Side {
    /// How much way is `left`, nm, the reference and what is asked, all towards this side's limit: it is blocked, and past.
    fn step(
        &mut self,
        config: &TravelConfig,
        driven: bool,
        left: i64,
        [velocity, change]: [i64; 2],
        stands: bool,
        asked: TableVelocity,
    ) -> (bool, bool) {
        let towards = asked > TableVelocity::ZERO;
        let past = driven && left < 0 && (towards || self.was_within);
        self.was_within = driven && (self.was_within || left >= 0);
        if !towards || stands && self.blocked_for != Some(asked) {
            self.blocked_for = None;
        }
        let fits =
            left.saturating_sub(config.stands_before_nm) > config.way_to_rest(velocity, change);
        if towards && !fits && self.blocked_for.is_none() {
            self.blocked_for = Some(asked);
        }
        (self.blocked_for.is_some(), past)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{DrivePlate, test_plate};
    use crate::speed::coordinator::{Command, Coordinator, Following};
    use proptest::prelude::*;

    const COUNT_M: f64 = 100e-9;
    /// Steps of the speed task between its looks, and between those of the supervision.
    const LOOK: u32 = 4;
    const MILLISECOND: u32 = 5;

    fn plate(acceleration: f64, jerk: f64, soft_m: [f64; 2]) -> DrivePlate {
        let mut plate = test_plate();
        (plate.feed.acceleration_max, plate.feed.jerk_max) = (acceleration, jerk);
        [plate.travel.soft_least_m, plate.travel.soft_most_m] = soft_m;
        plate.feed.scale_count_m = COUNT_M;
        plate
    }

    /// A table whose reference is the coordinator's, behind it by the speed loops' lag, with the looks as late as they may be.
    struct Table {
        plate: DrivePlate,
        coordinator: Coordinator,
        travel: Travel,
        config: TravelConfig,
        asked: f64,
        /// As it was published, as it was seen, and as it acts.
        published: (Speed, SpeedChange),
        seen: TravelSeen,
        blocked: [bool; 2],
        velocity: f64,
        position: f64,
        homed: bool,
        steps: u32,
    }

    impl Table {
        fn new(plate: DrivePlate, position: f64) -> Self {
            Self {
                config: plate.travel_config(),
                plate,
                coordinator: Coordinator::new(),
                travel: Travel::new(),
                asked: 0.0,
                published: (Speed::ZERO, SpeedChange::ZERO),
                seen: TravelSeen::default(),
                blocked: [false; 2],
                velocity: 0.0,
                position,
                homed: true,
                steps: 0,
            }
        }

        fn step(&mut self) {
            let config = self.plate.config().unwrap().coordinator;
            self.step_with(&config);
        }

        fn step_with(&mut self, config: &crate::speed::coordinator::CoordinatorConfig) {
            self.steps += 1;
            let asked = TableVelocity::from_num(self.asked);
            if self.steps.is_multiple_of(MILLISECOND) {
                self.seen = self.travel.step(
                    &self.config,
                    &TravelLook {
                        scale: (self.position / COUNT_M).round() as i32,
                        origin: self.homed.then_some(0),
                        driven: true,
                        reference: self.published,
                        asked,
                    },
                );
            }
            if self.steps.is_multiple_of(LOOK) {
                self.published = self.coordinator.planned();
                self.blocked = self.seen.blocked;
            }
            let command = Command {
                velocity: asked,
                ..Command::rest()
            };
            self.coordinator
                .command(config, command.within(self.blocked))
                .unwrap();
            self.coordinator.step(config, [Following::default(); 2]);
            let feed = &self.plate.feed;
            let reference =
                self.coordinator.relative().to_num::<f64>() * feed.lead_m / core::f64::consts::TAU;
            let step = self.plate.speed_step();
            self.velocity +=
                (reference - self.velocity) * (step * self.plate.tuning.speed_rad_s).min(1.0);
            self.position += self.velocity * step;
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever is asked when, the table stands before both limits, and neither is a fault.
        #[test]
        fn from_any_speed_the_table_stands_before_its_limit(
            asked in prop::collection::vec((-0.1..0.1f64, 1..1500u32), 1..12),
            last in prop_oneof![0.001..0.1f64, -0.1..-0.001f64],
            acceleration in 0.1..5.0f64,
            rise in 0.002..0.1f64,
            start in 0.1..0.9f64,
        ) {
            let ends = [-5e-3, 35e-3];
            let plate = plate(acceleration, acceleration / rise, ends);
            let config = plate.config().unwrap().coordinator;
            let mut table = Table::new(plate, ends[0] + start * (ends[1] - ends[0]));
            let mut came = false;
            for (asked, steps) in asked.into_iter().chain([(last, 400_000)]) {
                table.asked = asked;
                for _ in 0..steps {
                    table.step_with(&config);
                    let at = table.position;
                    prop_assert!(at > ends[0] && at < ends[1], "at {at} m");
                    prop_assert_eq!(table.seen.fault, None);
                    came |= steps == 400_000 && table.blocked == [false; 2] && table.coordinator.arrived();
                    if steps == 400_000 && table.blocked != [false; 2] && table.coordinator.planned() == (Speed::ZERO, SpeedChange::ZERO) {
                        break;
                    }
                }
            }
            prop_assert_eq!(table.coordinator.planned(), (Speed::ZERO, SpeedChange::ZERO));
            // Not further before it than the latency and the lag may take, where it came there with the last velocity; one that was
            // still accelerated was stopped where that velocity would have needed the way.
            let left = if last > 0.0 { ends[1] - table.position } else { table.position - ends[0] };
            let most = STANDS_BEFORE_M + 0.1 * (2.0 * LATENCY_S + 2e-3 + 1.0 / table.plate.tuning.speed_rad_s) + 0.1 * rise;
            let most = if came { most } else { most + last * last / (2.0 * acceleration) + 2.0 * rise * last.abs() };
            prop_assert!(left < most, "stands {left} m before its limit, {most} m at most");
        }

        /// Debug builds panic where a sum would leave its word.
        #[test]
        fn no_look_overflows(
            looks in prop::collection::vec((any::<i32>(), any::<Option<i32>>(), any::<bool>(), any::<[i32; 3]>()), 1..100),
            ends in any::<[i64; 2]>(),
            words in any::<[i64; 8]>(),
        ) {
            let [a, b, c, d, e, f, g, h] = words;
            let config = TravelConfig {
                nm_per_count: a, ends_nm: Some(ends), stands_before_nm: b, velocity_per_word: c, time_per_word: d,
                acceleration_per_word: e, acceleration_more: f, latency: g, time: h, per_acceleration: a ^ h,
            };
            let mut travel = Travel::new();
            for (scale, origin, driven, [velocity, change, asked]) in looks {
                let reference = (Speed::from_bits(velocity), SpeedChange::from_bits(change));
                let asked = TableVelocity::from_bits(asked);
                travel.step(&config, &TravelLook { scale, origin, driven, reference, asked });
            }
        }
    }

    #[test]
    fn a_blocked_table_goes_away_and_on_by_another_command_only() {
        let mut table = Table::new(plate(0.25, 10.0, [0.0, 10e-3]), 5e-3);
        let pass = |table: &mut Table, mm_s: f64| {
            table.asked = mm_s * 1e-3;
            (0..10_000).for_each(|_| table.step());
            table.position
        };
        let stood = pass(&mut table, 20.0);
        assert!(stood > 9e-3 && stood < 9.9e-3 && table.blocked == [true, false]);
        assert_eq!(pass(&mut table, 20.0), stood, "the same again");
        let closer = pass(&mut table, 1.0);
        assert!(closer > stood && closer < 9.9e-3, "{closer} m");
        let away = pass(&mut table, -1.0);
        assert!((closer - away - 2e-3).abs() < 0.1e-3, "{away} m");
        assert_eq!(table.blocked, [false; 2]);
    }

    #[test]
    fn a_table_that_is_not_homed_has_no_limits() {
        let mut table = Table::new(plate(0.25, 10.0, [0.0, 10e-3]), 5e-3);
        table.homed = false;
        table.asked = 20e-3;
        (0..10_000).for_each(|_| table.step());
        assert!(table.position > 40e-3 && table.blocked == [false; 2]);
        assert_eq!(table.seen.fault, None);
    }

    #[test]
    fn past_a_limit_is_a_fault_unless_it_began_there_and_goes_away() {
        let config = plate(0.25, 10.0, [0.0, 10e-3]).travel_config();
        let mut travel = Travel::new();
        let mut look = |mm: f64, driven: bool, asked: f64| {
            let look = TravelLook {
                scale: (mm * 1e-3 / COUNT_M) as i32,
                origin: Some(0),
                driven,
                asked: TableVelocity::from_num(asked),
                ..TravelLook::default()
            };
            travel.step(&config, &look).fault
        };
        let (forwards, backwards) = (Some(Fault::TravelForward), Some(Fault::TravelBackward));
        assert_eq!(look(10.1, false, 0.01), None, "it rests");
        assert_eq!(look(10.1, true, 0.01), forwards, "it is to go further");
        assert_eq!(look(10.1, false, 0.0), None);
        assert_eq!(look(10.1, true, -0.01), None, "it goes back");
        assert_eq!(look(9.9, true, 0.0), None);
        assert_eq!(look(10.1, true, 0.0), forwards, "it was pushed");
        assert_eq!(look(-0.1, false, 0.0), None);
        assert_eq!(look(-0.1, true, -0.01), backwards);
    }
}
