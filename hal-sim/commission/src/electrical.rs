//! Resistance, inductance, flux, the offset of the angle, and what the dead time takes.
//!
//! Both motors turn together at two speeds, both ways, each with currents along d of four levels. At each the means of
//! voltage and current over whole turns of the shaft are two equations a motor,
//!
//! ```text
//! v_d = R i_d - w L i_q - w flux sin(delta) + D i_d / |i| - K w i_q / |i|
//! v_q = R i_q + w L i_d + w flux cos(delta) + D i_q / |i| + K w i_d / |i|
//! ```
//!
//! linear in `R`, `L`, `flux cos(delta)`, `flux sin(delta)` and `D`. `delta` is the angle by which the drive's idea of the
//! rotor is behind it. `D` is the fundamental of the voltage that the dead time takes beyond what the drive compensates: the
//! dead time is a slope's intercept, the resistance its slope. `K` is known: the drive compensates its dead time along the
//! current that it has sampled, and that acts one and a half PWM periods later, when the current has turned on. Over whole turns the rest of the dead time, the ripple of the
//! flux, and offset and gain errors of the current channels cancel.

use crate::fit::{Estimate, Fit};
use crate::session::{MotorPoint, Point, Session};
use crate::{Bound, Failure};
use anyhow::{Result, bail};
use link::host::client::Line;
use link::settings::{MotorSettings, PER_KRPM, Settings};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Speeds of both motors, of the slower one's largest.
pub const SPEEDS: &[f64] = &[0.12, 0.3];
/// The same, where the angle is what is wanted.
pub const FAST: &[f64] = &[0.3];
/// Currents along d, of the largest: all far above the currents at which a dead time and its compensation are not whole.
const LEVELS: [f64; 4] = [0.4, 1.0, -1.0, -0.4];
/// Shortest mean, s; it is of whole turns.
const MEAN_S: f64 = 0.15;
/// What a current takes to be steady, s: many periods of any current loop.
const SETTLE_S: f64 = 0.05;
/// Largest current along d, of the rated one, of the largest torque's, and of what opens the bridge.
const OF_RATED: f64 = 0.9;
const OF_LARGEST: f64 = 0.9;
const OF_OVER_CURRENT: f64 = 0.6;

/// The vector of what each phase loses with its current's sign, of that: the fundamental of a square wave is 4 / pi times as
/// high, a vector sqrt(3/2) times as long as a phase's amplitude.
const DEAD_TIME_VECTOR: f64 = 4.0 / PI * 1.224_744_871_391_589;

/// By how many half intervals a dead time is above none.
const SURE: f64 = 2.0;
/// The largest that the drive compensates, ns.
const DEAD_TIME_NS: f64 = 10_000.0;

/// What was measured of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotorElectrical {
    /// Resistance of a phase, ohm.
    pub resistance_ohm: Estimate,
    /// Inductance of a phase, H.
    pub inductance_h: Estimate,
    /// Magnet flux, Wb, power invariant.
    pub flux_wb: Estimate,
    /// By how much the drive's angle is behind the rotor's, electrical degrees.
    pub offset_deg: Estimate,
    /// Voltage that a phase loses to the dead time beyond what is compensated, V.
    pub dead_time_v: Estimate,
}

/// What was measured, and how near the limits were.
#[derive(Clone, Debug, PartialEq)]
pub struct Electrical {
    /// Screw, nut.
    pub motors: [MotorElectrical; 2],
    /// Current of screw and nut, A, as a vector.
    pub current_a: [Bound; 2],
    /// Table's travel, m.
    pub travel_m: Bound,
}

/// Largest current along d, A.
pub(crate) fn largest(motor: &MotorSettings, settings: &Settings) -> f64 {
    let rated = motor
        .thermal
        .rated_current_a_rms
        .min(settings.bridge.thermal.rated_current_a_rms);
    // A vector is sqrt(3) times the rms of a phase, sqrt(3/2) times its amplitude.
    (OF_RATED * 3f64.sqrt() * rated)
        .min(OF_LARGEST * current_max(motor))
        .min(OF_OVER_CURRENT * 1.5f64.sqrt() * settings.bridge.over_current_a)
}

/// Current of the largest torque, A, as a vector.
fn current_max(motor: &MotorSettings) -> f64 {
    motor.torque_max_nm / (motor.voltage_constant_v_rms_per_krpm / PER_KRPM)
}

/// Sums over a mean.
#[derive(Clone, Copy, Default)]
struct Mean {
    count: f64,
    current: [f64; 2],
    voltage: [f64; 2],
    /// `i / |i|`.
    direction: [f64; 2],
    /// Angle and time at the beginning and at the end.
    ends: Option<[(f64, f64); 2]>,
}

impl Mean {
    /// One more sample. Below `fade`, the current where a dead time is whole, it is a part of the resistance.
    fn take(&mut self, time: f64, motor: &MotorPoint, fade: f64) {
        self.count += 1.0;
        let [i_d, i_q] = motor.current;
        let size = i_d.hypot(i_q).hypot(fade);
        for k in 0..2 {
            self.direction[k] += motor.current[k] / size;
            self.current[k] += motor.current[k];
            self.voltage[k] += motor.voltage[k];
        }
        let now = (motor.angle, time);
        self.ends = Some([self.ends.map_or(now, |[first, _]| first), now]);
    }

    /// Mechanical rad/s.
    fn speed(&self) -> f64 {
        self.ends.map_or(0.0, |[first, last]| {
            (last.0 - first.0) / (last.1 - first.1).max(1e-9)
        })
    }
}

/// Two equations of a mean; `lag` is `K`.
fn add(fit: &mut Fit, mean: &Mean, pole_pairs: f64, lag: f64) {
    let of = |sums: [f64; 2]| sums.map(|sum| sum / mean.count);
    let ([i_d, i_q], [v_d, v_q], [e_d, e_q]) =
        (of(mean.current), of(mean.voltage), of(mean.direction));
    let w = pole_pairs * mean.speed();
    fit.add(&[i_d, -w * i_q, 0.0, -w, e_d], v_d + lag * w * e_q);
    fit.add(&[i_q, w * i_d, w, 0.0, e_q], v_q - lag * w * e_d);
}

/// Measures both motors of an armed drive at these parts of the largest speed. The table rests; `travel_m` is what it may move.
///
/// # Errors
/// [`Failure`], a fault, or a drive that is lost.
pub fn measure<L: Line>(
    session: &mut Session<L>,
    speeds: &[f64],
    travel_m: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<Electrical> {
    let settings = *session.settings();
    let motors = [&settings.screw, &settings.nut];
    let most = motors.map(|motor| largest(motor, &settings));
    let speed = motors
        .iter()
        .map(|motor| motor.speed_max_rpm * TAU / 60.0)
        .fold(f64::INFINITY, f64::min);
    let fade = settings.bridge.dead_time_fade_a;
    let period_s = session.pwm_period_s();
    let compensated_v = settings.bridge.dead_time_ns * 1e-9 / period_s * session.bus_v();
    let lag = 1.5 * period_s * DEAD_TIME_VECTOR * compensated_v;
    let mut fits = [Fit::new(5, 1.0), Fit::new(5, 1.0)];
    let mut bounds = motors.map(|motor| {
        Bound::of(current_max(motor).min(1.5f64.sqrt() * settings.bridge.over_current_a))
    });
    let mut travel = Bound::of(travel_m);
    let mut from = None;
    let mut watch = |point: &Point| {
        travel.take(point.table - *from.get_or_insert(point.table));
        for (bound, motor) in bounds.iter_mut().zip(&point.motors) {
            bound.take(motor.current[0].hypot(motor.current[1]));
        }
    };
    let stations: Vec<f64> = speeds
        .iter()
        .flat_map(|part| [*part, -part])
        .map(|part| part * speed)
        .collect();
    for (k, base) in stations.iter().enumerate() {
        session.direct_off_and_go(*base, &mut watch)?;
        for (level, part) in LEVELS.iter().enumerate() {
            progress((k as f64 + level as f64 / LEVELS.len() as f64) / stations.len() as f64);
            session.direct(most.map(|most| part * most))?;
            session.hold(SETTLE_S, &mut watch)?;
            let turns = (MEAN_S * base.abs() / TAU).ceil().max(1.0);
            let mut means = [Mean::default(); 2];
            let seconds = turns * TAU / base.abs();
            let mut begun = None;
            session.hold(seconds, &mut |point| {
                watch(point);
                if point.time - *begun.get_or_insert(point.time) < seconds {
                    for (mean, motor) in means.iter_mut().zip(&point.motors) {
                        mean.take(point.time, motor, fade);
                    }
                }
            })?;
            for ((fit, mean), motor) in fits.iter_mut().zip(&means).zip(motors) {
                add(fit, mean, f64::from(motor.pole_pairs), lag);
            }
        }
    }
    session.direct([0.0; 2])?;
    session.go(0.0, 0.0, &mut watch)?;
    session.rest()?;
    let [screw, nut] = fits;
    Ok(Electrical {
        motors: [solve(&screw, "screw")?, solve(&nut, "nut")?],
        current_a: bounds,
        travel_m: travel,
    })
}

fn solve(fit: &Fit, motor: &str) -> Result<MotorElectrical> {
    let Some([resistance, inductance, cosine, sine, dead]) = fit
        .solve()
        .and_then(|all| <[Estimate; 5]>::try_from(all).ok())
    else {
        bail!(Failure {
            measured: format!("the {motor}'s voltages do not tell its parameters apart"),
            expected: "currents along d as they were asked, at four speeds".to_owned(),
            check: "its rated current and largest speed in the settings, and the bus voltage"
                .to_owned(),
        });
    };
    for (name, estimate) in [
        ("resistance, ohm", resistance),
        ("inductance, H", inductance),
        ("flux, Wb", cosine),
    ] {
        if !(estimate.value > 0.0 && estimate.plus_minus < estimate.value) {
            bail!(Failure {
                measured: format!(
                    "the {motor}'s {name}: {:.4e} +- {:.1e}",
                    estimate.value, estimate.plus_minus
                ),
                expected: "a value above 0 that is known better than to its own size".to_owned(),
                check: "phases, current gains and the bus voltage's measurement".to_owned(),
            });
        }
    }
    let flux = cosine.value.hypot(sine.value);
    Ok(MotorElectrical {
        resistance_ohm: resistance,
        inductance_h: inductance,
        flux_wb: Estimate {
            value: flux,
            plus_minus: cosine.plus_minus,
        },
        offset_deg: Estimate {
            value: sine.value.atan2(cosine.value).to_degrees(),
            plus_minus: (sine.plus_minus / flux).to_degrees(),
        },
        dead_time_v: dead.times(1.0 / DEAD_TIME_VECTOR),
    })
}

impl Electrical {
    /// The dead time that the drive does not compensate yet, s; 0 if it is not known from none. One setting is of both bridges: the
    /// smaller one, for what is compensated in excess drives a current.
    #[must_use]
    pub fn dead_time_s(&self, pwm_period_s: f64, bus_v: f64) -> f64 {
        let least = |motor: &MotorElectrical| {
            let volts = motor.dead_time_v;
            if volts.value > SURE * volts.plus_minus {
                volts.value
            } else {
                0.0
            }
        };
        let [screw, nut] = self.motors.each_ref().map(least);
        screw.min(nut) / bus_v * pwm_period_s
    }

    /// The settings with what was measured, and with `dead_time_s` more to compensate.
    #[must_use]
    pub fn applied(&self, settings: &Settings, dead_time_s: f64) -> Settings {
        let mut new = *settings;
        new.bridge.dead_time_ns = (new.bridge.dead_time_ns + 1e9 * dead_time_s).min(DEAD_TIME_NS);
        for (motor, measured) in [&mut new.screw, &mut new.nut].into_iter().zip(&self.motors) {
            motor.resistance_line_to_line_ohm = 2.0 * measured.resistance_ohm.value;
            motor.inductance_line_to_line_mh = 2e3 * measured.inductance_h.value;
            motor.voltage_constant_v_rms_per_krpm =
                measured.flux_wb.value * f64::from(motor.pole_pairs) * PER_KRPM;
        }
        new
    }
}

impl<L: Line> Session<L> {
    /// Without currents along d: to a base speed, by way of no current at the old one.
    fn direct_off_and_go(&mut self, base: f64, watch: &mut dyn FnMut(&Point)) -> Result<()> {
        if self.is_moving() {
            self.direct([0.0; 2])?;
        }
        self.go(0.0, base, watch)
    }
}
