use super::*;
use crate::base::format::{ProfileState, SpeedChange};
use crate::plate::test_plate;
use crate::speed::profile::Profile;
use core::f64::consts::TAU;
use proptest::prelude::*;
use std::vec::Vec;

const STEP_S: f64 = 1e-3;
const TASK_S: f64 = 200e-6;
const COUNT_M: f64 = 10e-9;
const DELAY_MS: u16 = 20;

/// A table that follows the coordinator's profile, and a host.
struct Bench {
    config: StreamConfig,
    table: crate::speed::profile::ProfileConfig,
    per_metre: f64,
    stream: Stream,
    profile: Profile,
    position: f64,
    asked: TableVelocity,
    ms: u32,
}

/// What the table does in a millisecond in which it follows: stream time, s, position, m, and velocity at its end, m/s.
struct Row {
    seconds: f64,
    position: f64,
    velocity: f64,
}

impl Bench {
    fn new(delay_ms: u16) -> Self {
        let plate = test_plate();
        let mut stream = Stream::closed();
        stream.open(0, delay_ms);
        Self {
            config: StreamConfig::new(&plate, STEP_S),
            table: plate.config().unwrap().coordinator.table,
            per_metre: TAU / plate.feed.lead_m,
            stream,
            profile: Profile::default(),
            position: 0.0,
            asked: TableVelocity::ZERO,
            ms: 0,
        }
    }

    fn counts(&self) -> i32 {
        (self.position / COUNT_M).round() as i32
    }

    fn push(
        &mut self,
        seconds: f64,
        position_m: f64,
        velocity: Option<f64>,
    ) -> Result<Followed, SetPointError> {
        let point = SetPoint {
            at_us: (seconds * 1e6).round() as u64 as u32,
            position_nm: (position_m * 1e9).round() as i64,
            velocity: velocity.map(TableVelocity::from_num),
        };
        self.stream.push(&self.config, point, self.counts())
    }

    /// A millisecond.
    fn step(&mut self) -> Row {
        self.ms += 1;
        let target = ProfileState::from_num(self.asked.to_num::<f64>() * self.per_metre);
        let arrived = self.profile.value == target;
        let seconds = f64::from(self.stream.clock_us.cast_signed()) * 1e-6;
        let before = self.position;
        self.asked = self.stream.step(&self.config, self.counts(), arrived);
        let target = ProfileState::from_num(self.asked.to_num::<f64>() * self.per_metre);
        for _ in 0..5 {
            self.profile.step(&self.table, target);
            self.position += self.profile.value.to_num::<f64>() / self.per_metre * TASK_S;
        }
        Row {
            seconds,
            position: before,
            velocity: self.profile.value.to_num::<f64>() / self.per_metre,
        }
    }

    /// Streams `way` for so many seconds, each set-point `late_ms` after its time.
    fn run(
        &mut self,
        way: impl Fn(f64) -> f64,
        spacing_s: f64,
        seconds: f64,
        mut late_ms: impl FnMut(u32) -> f64,
    ) -> Vec<Row> {
        let mut rows = Vec::new();
        let mut next = 0u32;
        let mut free_ms = 0.0f64;
        loop {
            let at = f64::from(next) * spacing_s;
            // They come in their order.
            free_ms = free_ms.max(at * 1e3 + late_ms(next));
            while f64::from(self.ms) < free_ms {
                let row = self.step();
                assert_ne!(self.stream.progress(), StreamProgress::Ended, "at {at} s");
                if self.stream.progress() == StreamProgress::Following && row.seconds >= 0.0 {
                    rows.push(row);
                }
            }
            if at > seconds {
                return rows;
            }
            self.push(at, way(at), None).unwrap();
            next += 1;
        }
    }
}

fn sine(amplitude: f64, hz: f64) -> impl Fn(f64) -> f64 {
    // It begins at rest.
    move |seconds| amplitude * 0.5 * (1.0 - (TAU * hz * seconds).cos())
}

#[test]
fn a_sine_is_followed() {
    for (amplitude, hz, spacing_s, most_um) in [
        // Creep: up to 1.6 mm/s.
        (2e-3, 0.25, 5e-3, 0.3),
        (2e-3, 0.25, 1e-3, 0.3),
        (2e-3, 0.25, 20e-3, 0.5),
        // 94 mm/s, 0.6 m/s^2.
        (30e-3, 1.0, 5e-3, 20.0),
    ] {
        let mut bench = Bench::new(60);
        let way = sine(amplitude, hz);
        let mut worst = 0.0f64;
        for row in bench.run(&way, spacing_s, 3.0 / hz, |_| 0.0) {
            worst = worst.max((row.position - way(row.seconds)).abs());
        }
        std::println!(
            "{amplitude} m at {hz} Hz, each {spacing_s} s: {} um off",
            worst * 1e6
        );
        assert!(
            worst < most_um * 1e-6,
            "{amplitude} m at {hz} Hz, each {spacing_s} s: {} um off, expected less than {most_um}",
            worst * 1e6
        );
    }
}

/// When set-points come does not matter: the same velocities are asked.
#[test]
fn a_host_that_is_late_and_early_by_5_ms_changes_nothing() {
    let velocities = |jitter: bool| {
        let mut state = 1u32;
        let late = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if jitter {
                f64::from(state >> 16) / 6553.6
            } else {
                5.0
            }
        };
        let rows = Bench::new(DELAY_MS).run(sine(2e-3, 0.25), 5e-3, 8.0, late);
        rows.into_iter().map(|row| row.velocity).collect::<Vec<_>>()
    };
    let [even, late] = [velocities(false), velocities(true)];
    let rows = even.len().min(late.len());
    assert!(rows > 7900, "{rows} rows");
    assert!(even[..rows] == late[..rows], "the jitter is seen");
}

#[test]
fn a_stream_that_stalls_ends_after_its_delay() {
    let mut bench = Bench::new(DELAY_MS);
    bench.run(|at| 5e-3 * at, 5e-3, 0.5, |_| 0.0);
    let mut ms = 0;
    while bench.stream.progress() == StreamProgress::Following {
        bench.step();
        ms += 1;
        assert!(ms < 30, "it goes on for {ms} ms");
    }
    // The last came 5 ms before, and the clock waited 3 ms for the motors.
    assert!((15..=18).contains(&ms), "it ended after {ms} ms");
    assert_eq!(bench.asked, TableVelocity::ZERO);
    assert_eq!(bench.push(0.6, 3e-3, None), Err(SetPointError::Closed));
    while bench.profile.value != ProfileState::ZERO {
        bench.step();
        ms += 1;
        assert!(ms < 60, "it rests after more than {ms} ms");
    }
    assert_eq!(bench.profile.change, SpeedChange::ZERO);
}

/// 400 ppm either way, for five minutes.
#[test]
fn a_clock_that_differs_neither_starves_nor_floods_it() {
    for part in [0.9996, 1.0004] {
        let mut bench = Bench::new(DELAY_MS);
        let way = |at: f64| 2e-3 * at.min(1.0);
        let mut points = 0u32;
        while bench.ms < 300_000 {
            while f64::from(points) * 5.0 <= f64::from(bench.ms) * part {
                let at = f64::from(points) * 5e-3;
                bench.push(at, way(at), None).unwrap();
                points += 1;
            }
            bench.step();
            assert_ne!(
                bench.stream.progress(),
                StreamProgress::Ended,
                "{part} after {} ms",
                bench.ms
            );
        }
    }
}

#[test]
fn what_the_table_cannot_follow_is_refused() {
    use SetPointError::{Full, Spacing, Step, Velocity};
    let mut bench = Bench::new(DELAY_MS);
    assert_eq!(
        bench.push(0.0, 110e-6, None),
        Err(Step),
        "the table stands elsewhere"
    );
    assert_eq!(bench.push(0.0, 0.0, Some(0.11)), Err(Velocity));
    bench.push(0.0, 0.0, None).unwrap();
    assert_eq!(bench.push(0.0, 0.0, None), Err(Spacing));
    assert_eq!(bench.push(-0.005, 0.0, None), Err(Spacing));
    assert_eq!(bench.push(0.06, 0.0, None), Err(Spacing));
    // 100 mm/s.
    assert_eq!(bench.push(0.005, 501e-6, None), Err(Step));
    bench.push(0.005, 499e-6, None).unwrap();
    assert_eq!(bench.push(0.010, -2e-6, None), Err(Step));
    let mut taken = 2;
    while bench.push(0.005 * f64::from(taken), 499e-6, None).is_ok() {
        taken += 1;
    }
    assert_eq!(taken, WAITING as u32);
    assert_eq!(
        bench.push(0.005 * f64::from(taken), 499e-6, None),
        Err(Full)
    );
}

/// Velocities that are given are had.
#[test]
fn a_velocity_that_is_given_is_that_of_its_set_point() {
    let (way, hz) = (sine(2e-3, 0.5), 0.5);
    let mut bench = Bench::new(60);
    let mut worst = 0.0f64;
    let mut points = 0u32;
    for ms in 0..4000 {
        if ms % 20 == 0 {
            let at = f64::from(points) * 20e-3;
            let velocity = 1e-3 * TAU * hz * (TAU * hz * at).sin();
            bench.push(at, way(at), Some(velocity)).unwrap();
            points += 1;
        }
        let row = bench.step();
        if row.seconds > 0.0 && bench.stream.progress() == StreamProgress::Following {
            worst = worst.max((row.position - way(row.seconds)).abs());
        }
    }
    assert!(worst < 0.3e-6, "{} um off", worst * 1e6);
}

proptest! {
    /// A segment ends where its set-points are, and has no step of the velocity.
    #[test]
    fn segments_join(ways in prop::collection::vec((-4000i64..4000, 1u32..50), 3..20)) {
        let mut segment = Segment::NONE;
        let (mut at_us, mut position_nm) = (0u32, 0i64);
        let mut points: Vec<SetPoint> = Vec::new();
        for (way, ms) in ways {
            at_us += ms * 1000;
            position_nm += way * i64::from(ms);
            points.push(SetPoint { at_us, position_nm, velocity: None });
        }
        for (k, point) in points.iter().enumerate() {
            let next = segment.followed_by(*point, points.get(k + 1).copied());
            let begins = segment.end_us();
            prop_assert_eq!(next.at(begins), segment.at(begins));
            prop_assert_eq!(next.at(point.at_us), point.position_nm << NM_BITS);
            if k > 0 {
                let slope =
                    |segment: &Segment, from: u32| (segment.at(from + 1) - segment.at(from)) as f64;
                let off = (slope(&next, begins) - slope(&segment, begins - 1)).abs() / 65536.0;
                // A cubic over 1 ms with ends of up to 8 um/ms bends by less than a tenth of a nm in a us.
                prop_assert!(off < 0.1, "{} nm in a us", off);
            }
            segment = next;
        }
    }

    #[test]
    fn any_stream_is_followed_or_refused(
        delay: u16, zero: i32,
        steps in prop::collection::vec((any::<u32>(), any::<i64>(), any::<Option<i32>>(), any::<i32>(), any::<bool>(), 0u32..20), 1..60),
    ) {
        let mut plate = test_plate();
        plate.feed.velocity_max = 7.9;
        let config = StreamConfig::new(&plate, STEP_S);
        let mut stream = Stream::closed();
        stream.open(zero, delay);
        let mut at_us = 0u32;
        for (time, position, velocity, scale, arrived, passes) in steps {
            at_us = at_us.wrapping_add(if time & 1 == 0 { 1000 + (time >> 1) % 49_000 } else { time });
            let small = position % 20_000_000;
            let position_nm = if position & 1 == 0 { small } else { position };
            let point = SetPoint { at_us, position_nm, velocity: velocity.map(TableVelocity::from_bits) };
            let _ = stream.push(&config, point, scale);
            for _ in 0..passes {
                let asked = stream.step(&config, scale, arrived);
                prop_assert!(asked.to_num::<f64>().abs() <= 7.9);
            }
        }
    }
}
