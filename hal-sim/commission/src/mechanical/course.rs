//! The way of a drive that is measured: both motors up and down together, and then the table to and fro.

use super::torque_constant;
use crate::Bound;
use crate::electrical::slowest_rad_s;
use crate::session::{Point, Session};
use anyhow::Result;
use link::host::dialogue::Dialogue;
use link::settings::Settings;
use std::f64::consts::TAU;

/// Speed of the common mode, of the slower motor's largest.
pub(super) const SPEED: f64 = 0.3;
/// How long each speed is held, s.
const HOLD_S: f64 = 0.15;
/// Directions of the common mode's speeds, one after the other; for each way of the table.
const PATTERN: [f64; 6] = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0];
/// How often the table goes to and fro in the differential mode.
const STROKES: usize = 6;
/// Runs of both modes.
const RUNS: usize = 2 * PATTERN.len() + STROKES;

/// How fast the modes are driven.
pub(super) struct Speeds {
    /// Of the common mode, rad/s, with its acceleration.
    pub(super) common: f64,
    pub(super) acceleration: f64,
    /// Of the table meanwhile, m/s.
    pub(super) slow: f64,
    /// Of the table in the differential mode, m/s, with its acceleration.
    pub(super) fast: f64,
    pub(super) table_acceleration: f64,
}

impl Speeds {
    pub(super) fn of(settings: &Settings, travel_m: f64) -> Self {
        let common = SPEED * slowest_rad_s(settings);
        let feed = &settings.feed;
        let acceleration = feed.base_acceleration_max_rpm_s * TAU / 60.0;
        // Both ways the table goes as slowly as its travel asks.
        let whole = 2.0 * common / acceleration + 2.0 * HOLD_S;
        let slow = (0.6 * travel_m / (PATTERN.len() as f64 * whole + 0.3))
            .min(0.25 * feed.velocity_max_mm_s * 1e-3);
        let table_acceleration = feed.acceleration_max_mm_s2 * 1e-3;
        let fast = (0.25 * table_acceleration * travel_m)
            .sqrt()
            .min(0.5 * feed.velocity_max_mm_s * 1e-3);
        Self {
            common,
            acceleration,
            slow,
            fast,
            table_acceleration,
        }
    }
}

/// What a drive has shown so far, and how near the limits it was.
pub(super) struct Seen {
    constants: [f64; 2],
    pub(super) torques: [Bound; 2],
    pub(super) travel: Bound,
    /// The table's place at the beginning.
    from: Option<f64>,
    pub(super) points: Vec<Point>,
}

impl Seen {
    fn take(&mut self, point: &Point) {
        let from = *self.from.get_or_insert(point.table);
        self.travel.take(point.table - from);
        let motors = self.torques.iter_mut().zip(&point.motors);
        for ((bound, motor), constant) in motors.zip(self.constants) {
            bound.take(motor.current[1] * constant);
        }
        self.points.push(*point);
    }
}

/// A drive on its way through both modes.
pub(super) struct Course<'a, D> {
    session: &'a mut Session<D>,
    pub(super) seen: Seen,
    progress: &'a mut dyn FnMut(f64),
    /// Runs that have begun, of [`RUNS`].
    begun: usize,
}

impl<'a, D: Dialogue> Course<'a, D> {
    pub(super) fn new(
        session: &'a mut Session<D>,
        travel_m: f64,
        progress: &'a mut dyn FnMut(f64),
    ) -> Self {
        let settings = session.settings();
        let motors = [&settings.screw, &settings.nut];
        let seen = Seen {
            constants: motors.map(torque_constant),
            torques: motors.map(|motor| Bound::of(motor.torque_max_nm)),
            travel: Bound::of(travel_m),
            from: None,
            points: Vec::new(),
        };
        Self {
            session,
            seen,
            progress,
            begun: 0,
        }
    }

    async fn go(&mut self, velocity: f64, base: f64) -> Result<()> {
        let seen = &mut self.seen;
        let mut take = |point: &Point| seen.take(point);
        self.session.go(velocity, base, &mut take).await
    }

    async fn hold(&mut self, seconds: f64) -> Result<()> {
        let seen = &mut self.seen;
        let mut take = |point: &Point| seen.take(point);
        self.session.hold(seconds, &mut take).await
    }

    fn begin_run(&mut self) {
        (self.progress)(self.begun as f64 / RUNS as f64);
        self.begun += 1;
    }

    pub(super) async fn common_mode(&mut self, speeds: &Speeds) -> Result<()> {
        for velocity in [speeds.slow, -speeds.slow] {
            for sign in PATTERN {
                self.begin_run();
                self.go(velocity, sign * speeds.common).await?;
                self.hold(HOLD_S).await?;
            }
            self.go(0.0, 0.0).await?;
        }
        Ok(())
    }

    pub(super) async fn differential_mode(&mut self, speeds: &Speeds) -> Result<()> {
        let base = 0.5 * speeds.common;
        self.go(0.0, base).await?;
        for stroke in 0..STROKES {
            self.begin_run();
            let sign = if stroke.is_multiple_of(2) { 1.0 } else { -1.0 };
            self.go(sign * speeds.fast, base).await?;
        }
        self.go(0.0, base).await?;
        self.go(0.0, 0.0).await
    }

    /// Comes to rest, and gives what was seen.
    pub(super) async fn rest(self) -> Result<Seen> {
        self.session.rest().await?;
        Ok(self.seen)
    }
}
