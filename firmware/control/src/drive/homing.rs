//! Homing: an end switch gives the table's scale its zero.
//!
//! The table goes towards the switch until that opens, comes to rest, and leaves it slowly; where the switch closes is its place,
//! always in the same direction, so that its hysteresis does not matter. A table that stands on the switch leaves it at once. As in
//! [`table_move`](crate::table_move) one step is made at a fixed rate, that of the speed task or slower, after it.

use crate::base::format::TableVelocity;
use crate::drive::table_move::TAKEN;
use crate::plate::DrivePlate;

/// How long a switch must be open while it is looked for, s: contacts bounce that long, and bridges disturb.
const OPEN_S: f64 = 2e-3;
/// And closed after it was left.
const CLOSED_S: f64 = 20e-3;

/// A homing, planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomePlan {
    /// The switch is ahead of negative velocity.
    backwards: bool,
    towards: TableVelocity,
    away: TableVelocity,
    /// Steps that each of the two may take.
    seek_steps: u32,
    leave_steps: u32,
    /// Steps that a switch must be open, and closed.
    open: u32,
    closed: u32,
    /// Steps in which the slower velocity is reached.
    rise_steps: u32,
    /// Half of what the scale counts a step at that velocity, 2^-16.
    half_counts: i64,
    /// Where the switch closes, counts.
    position: i32,
}

impl HomePlan {
    /// Of a plate's feed and its homing, in steps of `step_s`.
    // Inlined where the drive is configured, which is apart from what the tasks call.
    #[must_use]
    #[inline(always)]
    #[allow(
        clippy::float_arithmetic,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    pub const fn new(plate: &DrivePlate, step_s: f64) -> Self {
        let (feed, home) = (&plate.feed, &plate.travel.home);
        let rise_to_limit = feed.acceleration_max / feed.jerk_max;
        let seeking = home.velocity.min(feed.velocity_max);
        let leaving = home.leaving_velocity.min(feed.velocity_max);
        let rise = leaving / feed.acceleration_max + rise_to_limit;
        let rise_seeking = seeking / feed.acceleration_max + rise_to_limit;
        let word = (1u64 << TableVelocity::FRAC_NBITS) as f64;
        let [towards, away] = [(seeking * word + 0.5) as i32, (leaving * word + 0.5) as i32];
        let [towards, away] = if home.forwards {
            [towards, away.saturating_neg()]
        } else {
            [towards.saturating_neg(), away]
        };
        let a_step = leaving * step_s / feed.scale_count_m.abs();
        Self {
            backwards: !home.forwards,
            towards: TableVelocity::from_bits(towards),
            away: TableVelocity::from_bits(away),
            seek_steps: ((home.furthest_m / seeking + rise_seeking) / step_s) as u32,
            leave_steps: ((home.furthest_m / leaving + rise) / step_s) as u32,
            open: (OPEN_S / step_s).max(1.0) as u32,
            closed: (CLOSED_S / step_s).max(1.0) as u32,
            rise_steps: (rise / step_s) as u32,
            half_counts: (a_step / 2.0 * 65_536.0) as i64,
            position: (home.position_m / feed.scale_count_m) as i32,
        }
    }

    /// Table velocities to the switch and off it.
    #[must_use]
    pub const fn velocities(&self) -> [TableVelocity; 2] {
        [self.towards, self.away]
    }

    /// Which switch is looked for: the one ahead of positive velocity, or of negative.
    #[must_use]
    pub const fn seeks(&self) -> [bool; 2] {
        [!self.backwards, self.backwards]
    }

    /// The switch that is looked for, of those ahead of positive velocity, and of negative.
    #[must_use]
    const fn is_open(&self, [forward, backward]: [bool; 2]) -> bool {
        if self.backwards { backward } else { forward }
    }
}

/// How a homing is going.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HomeProgress {
    /// Both motors come to the base speed.
    #[default]
    Starting,
    /// On the way to the switch.
    Seeking,
    /// It has opened, and the table comes to rest.
    Halting,
    /// The table leaves it.
    Leaving,
    /// It has closed, and the table comes to rest.
    Ending,
    /// The scale's count at position zero is known.
    Done(i32),
    /// The switch did not open on the way that homing may take.
    NotFound,
    /// It did not close again.
    NotLeft,
    /// The scale counted less than half of the way that was asked.
    ScaleStands,
}

impl HomeProgress {
    /// It goes on.
    #[must_use]
    pub const fn is_underway(self) -> bool {
        !matches!(
            self,
            Self::Done(_) | Self::NotFound | Self::NotLeft | Self::ScaleStands
        )
    }
}

/// A homing under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Homing {
    progress: HomeProgress,
    /// Steps of this part of it, and in a row in which the switch was as it is waited for.
    steps: u32,
    seen: u32,
    /// The scale at the beginning of this part, and where the switch closed.
    begun: i32,
    edge: i32,
}

impl Homing {
    /// How it is going.
    #[must_use]
    pub const fn progress(&self) -> HomeProgress {
        self.progress
    }

    /// One step: the scale's counts, whether the references have arrived at what was asked, and which end switches are open ->
    /// the velocity to ask.
    #[must_use]
    pub fn step(
        &mut self,
        plan: &HomePlan,
        scale: i32,
        arrived: bool,
        open: [bool; 2],
    ) -> TableVelocity {
        use HomeProgress::{Ending, Halting, Leaving, NotFound, NotLeft, Seeking, Starting};
        self.steps = self.steps.saturating_add(1);
        let open = plan.is_open(open);
        let arrived = arrived && self.steps > TAKEN;
        let waits_for = if self.progress == Leaving {
            !open
        } else {
            open
        };
        self.seen = if waits_for {
            self.seen.saturating_add(1)
        } else {
            0
        };
        match self.progress {
            Starting if arrived && open => self.enter(Leaving, scale),
            Starting if arrived => self.enter(Seeking, scale),
            Seeking if self.seen >= plan.open => self.enter(Halting, scale),
            Seeking if self.steps > plan.seek_steps => self.enter(NotFound, scale),
            Halting if arrived => self.enter(Leaving, scale),
            Leaving => self.leave(plan, scale),
            Ending if arrived => {
                self.progress = HomeProgress::Done(self.edge.wrapping_sub(plan.position));
            }
            _ => {}
        }
        if self.progress == Leaving && self.steps > plan.leave_steps {
            self.enter(NotLeft, scale);
        }
        match self.progress {
            Seeking => plan.towards,
            Leaving => plan.away,
            _ => TableVelocity::ZERO,
        }
    }

    fn enter(&mut self, progress: HomeProgress, scale: i32) {
        *self = Self {
            progress,
            begun: scale,
            edge: self.edge,
            ..Self::default()
        };
    }

    fn leave(&mut self, plan: &HomePlan, scale: i32) {
        if self.seen == 1 {
            self.edge = scale;
        }
        if self.seen < plan.closed {
            return;
        }
        let steps = self.steps.saturating_sub(plan.rise_steps);
        let least = i64::from(steps).saturating_mul(plan.half_counts) >> 16;
        let counted = i64::from(scale.wrapping_sub(self.begun)).saturating_abs();
        let progress = if counted < least {
            HomeProgress::ScaleStands
        } else {
            HomeProgress::Ending
        };
        self.enter(progress, scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{HomePlate, TravelPlate, test_plate};
    use crate::speed::profile::Profile;
    use core::f64::consts::TAU;
    use proptest::prelude::*;

    const COUNT_M: f64 = 10e-9;
    const STEP_S: f64 = 1e-3;

    struct Bench {
        home: HomePlate,
        /// The switch opens past it, and closes so much before, m.
        switch: f64,
        hysteresis: f64,
        /// What the scale makes of the way.
        scale: f64,
    }

    /// How it ended, where the table and how fast it was at most.
    fn run(bench: &Bench, start: f64) -> (HomeProgress, f64, f64) {
        let mut plate = test_plate();
        plate.feed.scale_count_m = COUNT_M;
        plate.travel.home = bench.home;
        let config = plate.config().unwrap().coordinator;
        let plan = HomePlan::new(&plate, STEP_S);
        let sign = if bench.home.forwards { 1.0 } else { -1.0 };
        let (mut homing, mut profile) = (Homing::default(), Profile::default());
        let (mut position, mut open, mut fastest) = (start, false, 0.0f64);
        let mut target = Default::default();
        for k in 0..400_000 {
            let from = bench.switch - if open { bench.hysteresis } else { 0.0 };
            open = sign * position > from;
            let ends = if bench.home.forwards {
                [open, false]
            } else {
                [false, open]
            };
            let scale = (bench.scale * position / COUNT_M).round() as i32;
            let arrived = profile.value == target && k > 0;
            let asked = homing.step(&plan, scale, arrived, ends);
            target = asked.wide_mul(config.radians_per_metre).to_num();
            for _ in 0..5 {
                profile.step(&config.table, target);
            }
            let velocity = profile.value.to_num::<f64>() * plate.feed.lead_m / TAU;
            fastest = fastest.max(velocity.abs());
            position += velocity * STEP_S;
            if !homing.progress().is_underway() {
                break;
            }
        }
        (homing.progress(), position, fastest)
    }

    fn bench(forwards: bool) -> Bench {
        let home = HomePlate {
            forwards,
            furthest_m: 0.1,
            position_m: if forwards { 0.12 } else { -0.02 },
            ..TravelPlate::UNLIMITED.home
        };
        Bench {
            home,
            switch: 0.02,
            hysteresis: 0.1e-3,
            scale: 1.0,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// From anywhere, also from on the switch, its place is where it closes, to what the table moves in a look.
        #[test]
        fn the_switch_s_place_is_found(start in -0.03..0.03f64, forwards in any::<bool>()) {
            let bench = bench(forwards);
            let sign = if forwards { 1.0 } else { -1.0 };
            let (progress, position, fastest) = run(&bench, sign * start);
            let HomeProgress::Done(origin) = progress else {
                return Err(TestCaseError::fail(std::format!("{progress:?}")));
            };
            let edge = sign * (bench.switch - bench.hysteresis);
            let found = edge - f64::from(origin) * COUNT_M - bench.home.position_m;
            prop_assert!(found.abs() < 2e-6, "the switch's place is {found} m off");
            prop_assert!(fastest <= bench.home.velocity * 1.000_001);
            prop_assert!(sign * position < bench.switch, "the table stands on its switch, at {position} m");
        }
    }

    #[test]
    fn what_is_missing_is_told() {
        let far = Bench {
            switch: 0.2,
            ..bench(false)
        };
        let (progress, position, _) = run(&far, 0.0);
        assert_eq!(progress, HomeProgress::NotFound);
        assert!((position + 0.1).abs() < 2e-3, "searched to {position} m");
        let stays_open = Bench {
            hysteresis: 1.0,
            ..bench(true)
        };
        assert_eq!(run(&stays_open, 0.0).0, HomeProgress::NotLeft);
        for scale in [0.0, 0.3] {
            let stands = Bench {
                scale,
                ..bench(true)
            };
            assert_eq!(run(&stands, 0.0).0, HomeProgress::ScaleStands);
        }
    }
}
