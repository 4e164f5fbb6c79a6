//! Inertia and friction of both motors, apart and together with the feed.
//!
//! The equations of motion, with the torques `T = pole_pairs flux i_q`:
//!
//! ```text
//! T_screw = J_s a_s + c_s sign(w_s) + b_s w_s + F
//! T_nut   = J_n a_n + c_n sign(w_n) + b_n w_n - F
//! F = M (a_s - a_n) + c_f sign(w_s - w_n) + b_f (w_s - w_n) + l
//! ```
//!
//! `F` is what ball pair, table and guideway take, at the screw; `M` the table's mass through the lead, `l` a load. Both are
//! weighed with smooth windows `p(t)` that vanish at their ends with their first derivatives, so that no measured angle is
//! differentiated: the mean of `p a` is that of `p'' theta` (modulating functions: Shinbrot, ASME Trans. 79, 1957). The same
//! means of the commanded speeds are the instruments of the fit ([`crate::fit`]): torque ripple and cogging accelerate the motors,
//! so that least squares takes a part of them for a smaller inertia.
//!
//! The common mode (both motors up and down together) shows `J`, `c`, `b` of each motor; the table goes slowly one way
//! meanwhile, or the pair's friction would stick, and share the torques between the motors as it likes. The differential mode
//! (the table to and fro at one base speed) shows `M`, `c_f`, `b_f`.

mod course;

use crate::axial::{AxialFit, Behind};
use crate::electrical::slowest_rad_s;
use crate::fit::{Estimate, Fit};
use crate::session::{Point, Session};
use crate::{Bound, Failure};
use anyhow::{Result, bail};
use course::{Course, SPEED, Speeds};
use link::host::dialogue::Dialogue;
use link::settings::{MotorSettings, PER_KRPM, Settings};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Length of a window, of a ramp's, and s.
const WINDOW: f64 = 0.3;
const WINDOW_S: [f64; 2] = [0.006, 0.06];
/// Windows begin each so-manieth part of one.
const OVERLAP: usize = 3;
/// Speed below which friction's sign is not sure, of the common mode's; between screw and nut, of the slow table's.
/// A table on a soft screw does not creep evenly. With half of the slow table's speed, one machine of 40 had too few windows.
const SLOW: f64 = 0.05;
const SLOW_APART: f64 = 0.25;
/// Stretches of a window in each of which a speed must have its sign.
const STRETCHES: usize = 10;
/// Shortest ramp from one end of the common mode's speeds to the other, s. A speed loop whose inertia is not known yet follows
/// it well enough for the table to go on one way.
const RAMP_S: f64 = 0.08;

/// What was measured of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotorMechanical {
    /// Inertia of all that turns with it, kg m^2, without the table.
    pub inertia_kg_m2: Estimate,
    /// Coulomb friction of its bearings, N m.
    pub coulomb_nm: Estimate,
    /// Viscous friction, N m s/rad.
    pub viscous_nm_s: Estimate,
}

/// What was measured, and how near the limits were.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanical {
    /// Screw, nut.
    pub motors: [MotorMechanical; 2],
    /// The table's mass through the lead, kg m^2.
    pub table_kg_m2: Estimate,
    /// Coulomb friction of ball pair and guideway, N m at the screw.
    pub feed_coulomb_nm: Estimate,
    /// Viscous friction of the same, N m s/rad.
    pub feed_viscous_nm_s: Estimate,
    /// Load, N m at the screw, against positive travel.
    pub load_nm: Estimate,
    /// Travel of the table a turn of screw against nut by its scale, m.
    pub lead_m: Estimate,
    /// The table's resonance on the screw, Hz; `None` where the scale does not show it.
    pub axial_hz: Option<Estimate>,
    /// Torque of screw and nut, N m.
    pub torque_nm: [Bound; 2],
    /// Table's travel, m.
    pub travel_m: Bound,
}

/// A run, and how it is looked at.
struct Run<'a> {
    /// The common and the differential mode, each with the length of its windows, s.
    parts: [(&'a [Point], f64); 2],
    /// Speed above which a motor's friction has its sign, rad/s; between screw and nut.
    least: f64,
    least_apart: f64,
}

/// A window and its derivatives, of length 1 in `n` points: `sin^4(pi s)`, scaled to a mean of 1.
struct Window {
    p: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Window {
    fn new(n: usize, step_s: f64) -> Self {
        let length = n as f64 * step_s;
        // The mean of sin^4 is 3/8; its second derivative 4 pi^2 (3 sin^2 cos^2 - sin^4).
        let scale = 8.0 / 3.0 / n as f64;
        let at = |k: usize| (PI * (k as f64 + 0.5) / n as f64).sin_cos();
        Self {
            p: (0..n).map(|k| scale * at(k).0.powi(4)).collect(),
            first: (0..n)
                .map(|k| {
                    let (s, c) = at(k);
                    scale * 4.0 * PI * s.powi(3) * c / length
                })
                .collect(),
            second: (0..n)
                .map(|k| {
                    let (s, c) = at(k);
                    let curve = 3.0 * s * s * c * c - s.powi(4);
                    scale * 4.0 * PI * PI * curve / (length * length)
                })
                .collect(),
        }
    }
}

/// What a window weighs.
#[derive(Clone, Copy, Default)]
struct Weighed {
    torque: f64,
    speed: f64,
    acceleration: f64,
}

impl Window {
    /// The means of a commanded speed and of its derivative.
    fn weigh_command(&self, points: &[Point], of: impl Fn(&Point) -> f64) -> Weighed {
        let mut weighed = Weighed::default();
        for (k, point) in points.iter().enumerate() {
            let speed = of(point);
            weighed.speed += self.p[k] * speed;
            weighed.acceleration -= self.first[k] * speed;
        }
        weighed
    }

    fn weigh(&self, points: &[Point], of: impl Fn(&Point) -> (f64, f64)) -> Weighed {
        let Some(first) = points.first() else {
            return Weighed::default();
        };
        let (origin, _) = of(first);
        let mut weighed = Weighed::default();
        for (k, point) in points.iter().enumerate() {
            let (angle, torque) = of(point);
            let angle = angle - origin;
            weighed.torque += self.p[k] * torque;
            weighed.speed -= self.first[k] * angle;
            weighed.acceleration += self.second[k] * angle;
        }
        weighed
    }
}

/// N m of an ampere along q.
fn torque_constant(motor: &MotorSettings) -> f64 {
    motor.voltage_constant_v_rms_per_krpm / PER_KRPM
}

/// Measures an armed drive whose electrical settings are right. The table may move by `travel_m` to each side.
///
/// # Errors
/// [`Failure`], a fault, or a drive that is lost.
pub async fn measure<D: Dialogue>(
    session: &mut Session<D>,
    travel_m: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<Mechanical> {
    let settings = *session.settings();
    let speeds = Speeds::of(&settings, travel_m);
    let mut course = Course::new(session, travel_m, progress);
    course.common_mode(&speeds).await?;
    let common = course.seen.points.len();
    course.differential_mode(&speeds).await?;
    let seen = course.rest().await?;
    let (of_common, of_differential) = seen.points.split_at(common);
    let window = |ramp: f64| (WINDOW * ramp).clamp(WINDOW_S[0], WINDOW_S[1]);
    let run = Run {
        parts: [
            (of_common, window(2.0 * speeds.common / speeds.acceleration)),
            (
                of_differential,
                window(2.0 * speeds.fast / speeds.table_acceleration),
            ),
        ],
        least: SLOW * speeds.common,
        least_apart: SLOW_APART * speeds.slow / (settings.feed.lead_mm * 1e-3) * TAU,
    };
    solve(&run, &settings, seen.torques, seen.travel)
}

/// Torques that accelerations, speeds and friction do not explain.
fn unclear(measured: &str) -> Failure {
    Failure {
        measured: measured.to_owned(),
        expected: "torques that accelerations, speeds and friction explain".to_owned(),
        check: "that nothing but the drive moves the table, the torque limits, and feed.base_acceleration_max_rpm_s"
            .to_owned(),
    }
}

/// The fits that the windows of a run go into.
struct Fits<'a> {
    run: &'a Run<'a>,
    constants: [f64; 2],
    lead_m: f64,
    /// J, c, b of screw and nut; M, c, b, l of the feed.
    torques: Fit,
    lead: Fit,
    axial: AxialFit,
    /// The first point, from which the table's position counts.
    origin: Option<Point>,
}

impl<'a> Fits<'a> {
    fn new(run: &'a Run<'a>, settings: &Settings) -> Self {
        Self {
            run,
            constants: [&settings.screw, &settings.nut].map(torque_constant),
            lead_m: settings.feed.lead_mm * 1e-3,
            torques: Fit::new(10, OVERLAP as f64),
            lead: Fit::new(1, OVERLAP as f64),
            axial: AxialFit::new(settings.feed.lead_mm * 1e-3, OVERLAP as f64),
            origin: None,
        }
    }

    /// All windows of a part of the run, of so many seconds each; `None` without telemetry.
    fn add_part(&mut self, points: &[Point], window_s: f64) -> Option<()> {
        let [first, second, ..] = points else {
            return None;
        };
        self.origin = self.origin.or(Some(*first));
        let step_s = second.time - first.time;
        let n = (window_s / step_s).round().max(STRETCHES as f64) as usize;
        let window = Window::new(n, step_s);
        for from in (0..points.len().saturating_sub(n)).step_by(n / OVERLAP) {
            let part = &points[from..from + n];
            // Where samples are missing, a window tells nothing.
            if (part[n - 1].time - part[0].time) <= 1.01 * (n - 1) as f64 * step_s {
                self.add_window(&window, part, step_s);
            }
        }
        Some(())
    }

    fn add_window(&mut self, window: &Window, part: &[Point], step_s: f64) {
        let (n, run) = (part.len(), self.run);
        let relative = |point: &Point| point.motors[0].angle - point.motors[1].angle;
        // By its angle, over stretches of the window.
        let clear = |of: &dyn Fn(&Point) -> f64, least: f64| {
            let stretch = (n / STRETCHES).max(1);
            let sign = (of(&part[n - 1]) - of(&part[0])).signum();
            (stretch..n)
                .step_by(stretch)
                .all(|k| {
                    sign * (of(&part[k]) - of(&part[k - stretch])) > least * stretch as f64 * step_s
                })
                .then_some(sign)
        };
        let apart = window.weigh(part, |p| (p.motors[0].angle - p.motors[1].angle, p.table));
        let table_speed = window.weigh(part, |p| (p.table, 0.0)).speed;
        if apart.speed.abs() > run.least_apart {
            self.lead.add(&[apart.speed / TAU], table_speed);
        }
        let Some(sign_apart) = clear(&relative, run.least_apart) else {
            return;
        };
        // Where the motors turn back, an elastic feed lets the table stand until its friction has turned too.
        if clear(&|p| p.table / self.lead_m * TAU, run.least_apart).is_none() {
            return;
        }
        let apart_command =
            window.weigh_command(part, |p| p.motors[0].speed_ref - p.motors[1].speed_ref);
        self.add_behind(window, part, [apart, apart_command], sign_apart);
        for (k, feed_sign) in [1.0, -1.0].into_iter().enumerate() {
            let of_motor = |p: &Point| p.motors[k].angle;
            let Some(sign) = clear(&of_motor, run.least) else {
                continue;
            };
            let constant = self.constants[k];
            let own = window.weigh(part, |p| {
                (p.motors[k].angle, constant * p.motors[k].current[1])
            });
            let command = window.weigh_command(part, |p| p.motors[k].speed_ref);
            let row = |own: Weighed, apart: Weighed| {
                let mut row = [0.0; 10];
                row[3 * k] = own.acceleration;
                row[3 * k + 1] = sign;
                row[3 * k + 2] = own.speed;
                row[6] = feed_sign * apart.acceleration;
                row[7] = feed_sign * sign_apart;
                row[8] = feed_sign * apart.speed;
                row[9] = feed_sign;
                row
            };
            self.torques
                .add_with(&row(command, apart_command), &row(own, apart), own.torque);
        }
    }
}

impl Fits<'_> {
    /// How far the table is behind screw and nut.
    fn add_behind(&mut self, window: &Window, part: &[Point], apart: [Weighed; 2], sign: f64) {
        let Some(origin) = self.origin else { return };
        let per_radian = self.lead_m / TAU;
        let travel = |p: &Point| {
            let [screw, nut] = [0, 1].map(|k| p.motors[k].angle - origin.motors[k].angle);
            per_radian * (screw - nut)
        };
        let mean = |of: &dyn Fn(&Point) -> f64| -> f64 {
            part.iter()
                .zip(&window.p)
                .map(|(p, weight)| weight * of(p))
                .sum()
        };
        let turned = |k: usize, of: fn(f64) -> f64| mean(&|p| of(p.motors[k].angle));
        let [seen, commanded] = apart.map(|apart| per_radian * apart.acceleration);
        self.axial.add(&Behind {
            table_m: mean(&|p| p.table - origin.table - travel(p)),
            travel_m: mean(&travel),
            turns: [
                turned(0, f64::sin),
                turned(0, f64::cos),
                turned(1, f64::sin),
                turned(1, f64::cos),
            ],
            together: per_radian * window.weigh(part, |p| (p.motors[1].angle, 0.0)).speed,
            sign,
            speed: per_radian * apart[0].speed,
            acceleration: seen,
            commanded,
        });
    }
}

fn solve(
    run: &Run,
    settings: &Settings,
    torque_nm: [Bound; 2],
    travel_m: Bound,
) -> Result<Mechanical> {
    let mut fits = Fits::new(run, settings);
    for (points, window_s) in run.parts {
        if fits.add_part(points, window_s).is_none() {
            bail!(unclear("no telemetry"));
        }
    }
    let Fits {
        torques,
        lead,
        axial,
        ..
    } = fits;
    let Some([js, cs, bs, jn, cn, bn, table, cf, bf, load]) = torques
        .solve()
        .and_then(|all| <[Estimate; 10]>::try_from(all).ok())
    else {
        bail!(unclear(
            "the torques do not tell inertias and frictions apart"
        ));
    };
    let Some(&[lead_m]) = lead.solve().as_deref() else {
        bail!(unclear("the table does not move by its scale"));
    };
    for (name, estimate) in [("screw", js), ("nut", jn)] {
        if !(estimate.value > 0.0 && estimate.plus_minus < 0.5 * estimate.value) {
            bail!(unclear(&format!(
                "the {name}'s inertia: {:.3e} +- {:.1e} kg m^2",
                estimate.value, estimate.plus_minus
            )));
        }
    }
    let motor = |inertia_kg_m2, coulomb_nm, viscous_nm_s| MotorMechanical {
        inertia_kg_m2,
        coulomb_nm,
        viscous_nm_s,
    };
    Ok(Mechanical {
        motors: [motor(js, cs, bs), motor(jn, cn, bn)],
        table_kg_m2: table,
        feed_coulomb_nm: cf,
        feed_viscous_nm_s: bf,
        load_nm: load,
        lead_m,
        axial_hz: axial.resonance_hz(),
        torque_nm,
        travel_m,
    })
}

impl Mechanical {
    /// What each motor moves, kg m^2: its own and the table's.
    #[must_use]
    pub fn moved_kg_m2(&self) -> [Estimate; 2] {
        let table = Estimate {
            value: self.table_kg_m2.value.max(0.0),
            ..self.table_kg_m2
        };
        self.motors.map(|motor| motor.inertia_kg_m2.plus(table))
    }

    /// The settings with what was measured.
    #[must_use]
    pub fn applied(&self, settings: &Settings) -> Settings {
        let mut new = *settings;
        let [screw, nut] = self.moved_kg_m2();
        new.screw.inertia_kg_cm2 = screw.value * 1e4;
        new.nut.inertia_kg_cm2 = nut.value * 1e4;
        new
    }
}

/// The settings with an acceleration of the base speed that this step can measure at.
#[must_use]
pub fn prepared(settings: &Settings) -> Settings {
    let most = 2.0 * SPEED * slowest_rad_s(settings) / RAMP_S * 60.0 / TAU;
    let mut new = *settings;
    let acceleration = &mut new.feed.base_acceleration_max_rpm_s;
    *acceleration = acceleration.min(most);
    new
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A window gives speed and acceleration of a parabola exactly, but for what a sum is off its integral.
    #[test]
    fn a_window_sees_speed_and_acceleration_of_a_parabola() {
        let (n, step) = (300, 2e-4);
        let window = Window::new(n, step);
        let points: Vec<Point> = (0..n)
            .map(|k| {
                let t = (k as f64 + 0.5) * step;
                let mut point = Point {
                    time: t,
                    ..Point::default()
                };
                point.motors[0].angle = 3.0 + 40.0 * t + 0.5 * 700.0 * t * t;
                point.motors[0].current[1] = 2.0;
                point
            })
            .collect();
        let seen = window.weigh(&points, |p| (p.motors[0].angle, p.motors[0].current[1]));
        let middle = 40.0 + 700.0 * 0.5 * n as f64 * step;
        for (name, measured, expected) in [
            ("speed", seen.speed, middle),
            ("acceleration", seen.acceleration, 700.0),
            ("torque", seen.torque, 2.0),
        ] {
            assert!(
                (measured / expected - 1.0).abs() < 1e-8,
                "{name}: measured {measured}, expected {expected}"
            );
        }
    }
}
