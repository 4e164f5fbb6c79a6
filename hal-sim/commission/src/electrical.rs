//! Resistance, inductance, flux, the offset of the angle, and what the dead time takes.
//!
//! Both motors turn together at two speeds, both ways, each with currents along d of six levels. At each the means of
//! voltage and current over whole turns of the shaft are two equations a motor,
//!
//! ```text
//! v_d + C_d + l C_q = R i_d - w L i_q - w flux sin(delta) + D_d + w t D_q
//! v_q + C_q - l C_d = R i_q + w L i_d + w flux cos(delta) + D_q - w t D_d
//! ```
//!
//! `delta` is the angle by which the drive's idea of the rotor is behind it. `D` is the voltage that the phases lose to the dead time
//! ([`DeadTime`]). A leg loses by the currents at its edges, which the ripple of a small inductance takes away from the sample. The loss at
//! large currents and the turning current are fitted. So are `R`, `L`,
//! `flux cos(delta)`, `flux sin(delta)` and the time `t` from the sample of a current to its loss. A loss that is taken as the same at all currents makes a resistance of its slope: 15 % of
//! the mains board's. `C` is what the drive adds: all from `bridge.dead_time_fade_a` on, a part below. It acts one and a half PWM periods
//! after its current was sampled, when the rotor has turned on by the angle `l`. Over whole turns the ripple of the flux, and offset and
//! gain errors of the current channels cancel.

use crate::fit::{Estimate, Fit};
use crate::session::{MotorPoint, Point, Session};
use crate::{Bound, Failure};
use anyhow::{Result, bail};
use link::host::dialogue::Dialogue;
use link::settings::{MotorSettings, PER_KRPM, Settings};
use plant::leg::{DeadTime, Period};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Speeds of both motors, of the slower one's largest.
pub const SPEEDS: &[f64] = &[0.12, 0.3];
/// The same, where the angle is what is wanted.
pub const FAST: &[f64] = &[0.3];
/// Currents along d, of the largest. Three sizes tell a resistance, a dead time and its turning current apart.
const LEVELS: [f64; 6] = [0.3, 0.6, 1.0, -1.0, -0.6, -0.3];
/// Shortest mean, s; it is of whole turns.
const MEAN_S: f64 = 0.15;
/// What a current takes to be steady, s: many periods of any current loop.
const SETTLE_S: f64 = 0.05;
/// A step of a current along d, of the largest, and how long it lasts, s.
const RAMP: f64 = 0.2;
const RAMP_S: f64 = 2e-3;
/// Largest current along d, of the rated one, of the largest torque's, and of what opens the bridge.
const OF_RATED: f64 = 0.9;
const OF_LARGEST: f64 = 0.9;
const OF_OVER_CURRENT: f64 = 0.6;

/// Steps of the fit of a turning current, and the change of it, of the current, that ends them.
const STEPS: usize = 30;
const SMALL: f64 = 1e-4;
/// The largest turning current, of the largest amplitude: past it no loss is whole.
const TURNING_MAX: f64 = 0.8;

/// Largest half interval, as a share of the current, at which a turning current counts as measured. Legs without capacitance gave
/// 0.45.
const CLEAR: f64 = 1.0 / 3.0;

/// Smallest current of full compensation, of the currents' noise at rest: a smaller one would be switched by the noise.
const FULL_NOISE: f64 = 14.0;

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
    /// Voltage that a phase loses to the dead time at large currents, beyond what is compensated, V.
    pub dead_time_v: Estimate,
    /// Phase current that turns a leg within the dead time, A; 0 where it is not known from none.
    #[serde(default)]
    pub turning_a: Estimate,
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
    /// Standard deviation of the phases' currents at rest, A.
    pub noise_a: f64,
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

/// The phases at one instant.
#[derive(Clone)]
struct PhaseSample {
    /// Sine and cosine of the electrical angle.
    angle: (f64, f64),
    period: Period,
}

/// Whole turns at one speed and current.
#[derive(Clone, Default)]
struct Turns {
    samples: Vec<PhaseSample>,
    current: [f64; 2],
    voltage: [f64; 2],
    /// Angle and time at the beginning and at the end.
    ends: Option<[(f64, f64); 2]>,
}

impl Turns {
    fn take(&mut self, time: f64, motor: &MotorPoint, measured: &Motor) {
        let [a, b] = motor.phases;
        let (angle, amps) = (motor.electrical.sin_cos(), [a, b, -a - b]);
        let period = measured.period(angle, motor.voltage, amps);
        self.samples.push(PhaseSample { angle, period });
        for k in 0..2 {
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

    fn mean(&self, sums: [f64; 2]) -> [f64; 2] {
        sums.map(|sum| sum / self.samples.len().max(1) as f64)
    }

    /// The mean along d and q of what the phases have by their sample, power invariant.
    fn of_phases(&self, parts: impl Fn(&PhaseSample) -> [f64; 3]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for sample in &self.samples {
            let (sin, cos) = sample.angle;
            let [a, b, c] = parts(sample);
            let alpha = (2.0 * a - b - c) / 6f64.sqrt();
            let beta = (b - c) / 2f64.sqrt();
            sums[0] += cos * alpha + sin * beta;
            sums[1] += cos * beta - sin * alpha;
        }
        self.mean(sums)
    }
}

/// Whole turns, and what of their equations does not change while the fit goes on.
struct Station {
    turns: Turns,
    /// Electrical, rad/s.
    w: f64,
    /// Means of current, A, and of voltage with what the drive adds for the dead time, V.
    current: [f64; 2],
    voltage: [f64; 2],
}

impl Station {
    fn of(turns: Turns, motor: &Motor) -> Self {
        let w = motor.pole_pairs * turns.speed();
        let [v_d, v_q] = turns.mean(turns.voltage);
        let [c_d, c_q] = turns.of_phases(|sample| motor.added(sample.period.amps));
        let turned = motor.lag_s * w;
        Self {
            w,
            current: turns.mean(turns.current),
            voltage: [v_d + c_d + turned * c_q, v_q + c_q - turned * c_d],
            turns,
        }
    }

    /// What the dead time takes, of that at large currents, and its part that grows with its delay.
    fn lost(&self, dead_time: DeadTime) -> [[f64; 2]; 2] {
        let [d, q] = self
            .turns
            .of_phases(|sample| dead_time.lost_parts(&sample.period));
        [[d, q], [self.w * q, -self.w * d]]
    }

    /// Its two equations. `drop` are the coefficients of what else there is along d and q, and `known` of it is known.
    fn add(&self, fit: &mut Fit, drop: &[[f64; 2]], known: [f64; 2]) {
        let ([i_d, i_q], w) = (self.current, self.w);
        let windings = [[i_d, -w * i_q, 0.0, -w], [i_q, w * i_d, w, 0.0]];
        for (k, winding) in windings.into_iter().enumerate() {
            let mut row = winding.to_vec();
            row.extend(drop.iter().map(|coefficient| coefficient[k]));
            fit.add(&row, self.voltage[k] - known[k]);
        }
    }
}

/// A motor that is measured, and what the drive adds for its dead time.
struct Motor {
    pole_pairs: f64,
    /// At large currents, V.
    compensated_v: f64,
    /// The phase current where it is whole, A.
    full_a: f64,
    /// From the sample to the middle of its effect, s.
    lag_s: f64,
    bus_v: f64,
    period_s: f64,
    /// Inductance by the settings, H.
    declared_h: f64,
    stations: Vec<Station>,
}

/// Resistance, inductance, both parts of the flux, what the dead time takes of a phase, V, and how late that comes times it, V s.
type Winding = [Estimate; 6];

impl Motor {
    /// Phase voltages that the drive adds for the dead time, V.
    fn added(&self, amps: [f64; 3]) -> [f64; 3] {
        amps.map(|amps| self.compensated_v * (amps / self.full_a).clamp(-1.0, 1.0))
    }

    /// The period of a steady voltage in the rotor's frame. The highest and the lowest duty lie symmetrically, as the drive has them.
    fn period(&self, (sin, cos): (f64, f64), [d, q]: [f64; 2], amps: [f64; 3]) -> Period {
        let (alpha, beta) = (cos * d - sin * q, sin * d + cos * q);
        let [b, c] = [1.0, -1.0].map(|sign| sign * beta / 2f64.sqrt() - alpha / 6f64.sqrt());
        let (phases, added) = ([alpha * (2f64 / 3.0).sqrt(), b, c], self.added(amps));
        let legs = [0, 1, 2].map(|k| phases[k] + added[k]);
        let [low, high] = [f64::min, f64::max].map(|of| legs.into_iter().fold(legs[0], of));
        Period {
            duties: legs.map(|leg| 0.5 + (leg - 0.5 * (low + high)) / self.bus_v),
            amps,
            balance: phases.map(|phase| phase / self.bus_v),
        }
    }

    /// The fit where the shape of the loss is known.
    fn with_loss(&self, dead_time: DeadTime) -> Option<Winding> {
        let mut fit = Fit::new(6, 1.0);
        for station in &self.stations {
            station.add(&mut fit, &station.lost(dead_time), [0.0; 2]);
        }
        fit.solve()?.try_into().ok()
    }

    /// A step of Gauss and Newton: all but the turning current is linear.
    fn with_loss_near(&self, dead_time: DeadTime, whole_v: f64) -> Option<(Winding, Estimate)> {
        let mut fit = Fit::new(7, 1.0);
        let turning_a = dead_time.turning_a;
        let step = 1e-3 * turning_a;
        for station in &self.stations {
            let [above, below] = [step, -step].map(|step| {
                let turning_a = turning_a + step;
                station.lost(DeadTime {
                    turning_a,
                    ..dead_time
                })[0]
            });
            let slope = [0, 1].map(|k| whole_v * (above[k] - below[k]) / (2.0 * step));
            let [lost, late] = station.lost(dead_time);
            let known = slope.map(|slope| -slope * turning_a);
            station.add(&mut fit, &[lost, late, slope], known);
        }
        let [r, l, cosine, sine, whole, late, turning] = fit.solve()?.try_into().ok()?;
        Some(([r, l, cosine, sine, whole, late], turning))
    }

    /// The winding and the turning current, A; that is 0 if the currents do not tell it. What is found of the dead time and of the
    /// inductance shapes the loss by which they are found.
    fn fit(&self) -> Option<(Winding, Estimate)> {
        let (mut inductance_h, mut whole_v) = (self.declared_h, self.compensated_v);
        let mut found = self.shaped(inductance_h, whole_v)?;
        for _ in 0..STEPS {
            let before = inductance_h;
            (inductance_h, whole_v) = (found.0[1].value, found.0[4].value.max(0.0));
            if inductance_h <= 0.0 || (inductance_h - before).abs() < SMALL * before {
                break;
            }
            found = self.shaped(inductance_h, whole_v)?;
        }
        Some(found)
    }

    /// The same by the loss that a dead time of that voltage has on that inductance.
    fn shaped(&self, inductance_h: f64, whole_v: f64) -> Option<(Winding, Estimate)> {
        let with = |turning_a| DeadTime {
            part: whole_v / self.bus_v,
            turning_a,
            bus_a: self.bus_v * self.period_s / inductance_h,
        };
        let samples = self
            .stations
            .iter()
            .flat_map(|station| &station.turns.samples);
        let most = samples.fold(0.0, |most, sample| {
            f64::max(most, sample.period.amps[0].abs())
        });
        let [low, high] = [SMALL * most, TURNING_MAX * most];
        // The sentence of that setting asks for twice the turning current.
        let declared = (0.5 * self.full_a).clamp(low, high);
        let mut turning = declared;
        let mut whole = self.with_loss(with(turning))?[4].value;
        for _ in 0..STEPS {
            let Some((winding, found)) = self.with_loss_near(with(turning), whole) else {
                break;
            };
            let before = turning;
            (whole, turning) = (winding[4].value, found.value.clamp(low, high));
            if (turning - before).abs() < SMALL * most {
                if found.plus_minus < CLEAR * found.value && turning < high {
                    return Some((winding, found));
                }
                break;
            }
        }
        // The declared one is taken then. It may be anything from none to twice that.
        let mut winding = self.with_loss(with(declared))?;
        let none = self.with_loss(with(low))?;
        let twice = self.with_loss(with((2.0 * declared).min(high)))?;
        for (k, found) in winding.iter_mut().enumerate() {
            let half = 0.5 * (twice[k].value - none[k].value);
            found.plus_minus = found.plus_minus.hypot(half);
        }
        Some((winding, Estimate::default()))
    }
}

/// The slower motor's largest speed, rad/s: what both can turn at together.
pub(crate) fn slowest_rad_s(settings: &Settings) -> f64 {
    [&settings.screw, &settings.nut]
        .map(|motor| motor.speed_max_rpm * TAU / 60.0)
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Measures both motors of an armed drive at these parts of the largest speed. The table rests; `travel_m` is what it may move.
///
/// # Errors
/// [`Failure`], a fault, or a drive that is lost.
pub async fn measure<D: Dialogue>(
    session: &mut Session<D>,
    speeds: &[f64],
    travel_m: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<Electrical> {
    let settings = *session.settings();
    let motors = [&settings.screw, &settings.nut];
    let most = motors.map(|motor| largest(motor, &settings));
    let speed = slowest_rad_s(&settings);
    let period_s = session.pwm_period_s();
    let mut measured = motors.map(|motor| Motor {
        pole_pairs: f64::from(motor.pole_pairs),
        compensated_v: settings.bridge.dead_time_ns * 1e-9 / period_s * session.bus_v(),
        full_a: settings.bridge.dead_time_fade_a,
        lag_s: 1.5 * period_s,
        bus_v: session.bus_v(),
        period_s,
        declared_h: motor.inductance_line_to_line_mh / 2e3,
        stations: Vec::new(),
    });
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
        session.go(0.0, *base, &mut watch).await?;
        let mut held = 0.0;
        for (level, part) in LEVELS.iter().enumerate() {
            progress((k as f64 + level as f64 / LEVELS.len() as f64) / stations.len() as f64);
            session.ramp_direct(most, [held, *part], &mut watch).await?;
            held = *part;
            session.hold(SETTLE_S, &mut watch).await?;
            let count = (MEAN_S * base.abs() / TAU).ceil().max(1.0);
            let mut turns = [Turns::default(), Turns::default()];
            let seconds = count * TAU / base.abs();
            let mut begun = None;
            session
                .hold(seconds, &mut |point| {
                    watch(point);
                    if point.time - *begun.get_or_insert(point.time) < seconds {
                        for (k, turns) in turns.iter_mut().enumerate() {
                            turns.take(point.time, &point.motors[k], &measured[k]);
                        }
                    }
                })
                .await?;
            for (motor, turns) in measured.iter_mut().zip(turns) {
                let station = Station::of(turns, motor);
                motor.stations.push(station);
            }
        }
        session.ramp_direct(most, [held, 0.0], &mut watch).await?;
    }
    session.go(0.0, 0.0, &mut watch).await?;
    session.rest().await?;
    let [screw, nut] = measured;
    Ok(Electrical {
        motors: [solve(&screw, "screw")?, solve(&nut, "nut")?],
        current_a: bounds,
        travel_m: travel,
        noise_a: session.noise_a(),
    })
}

fn solve(measured: &Motor, motor: &str) -> Result<MotorElectrical> {
    let Some(([resistance, inductance, cosine, sine, lost, _], turning)) = measured.fit() else {
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
        dead_time_v: Estimate {
            value: lost.value - measured.compensated_v,
            ..lost
        },
        turning_a: turning,
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

    /// Phase current at which the compensation is to be full, A: twice the turning current, by the larger end of its interval, and
    /// above the noise of the current sensors. `None` if a motor does not tell it.
    #[must_use]
    pub fn full_a(&self) -> Option<f64> {
        let each = self.motors.iter().map(|motor| {
            let Estimate { value, plus_minus } = motor.turning_a;
            (value > 0.0).then_some(2.0 * (value + plus_minus))
        });
        let both: Option<Vec<f64>> = each.collect();
        Some(both?.into_iter().fold(FULL_NOISE * self.noise_a, f64::max))
    }

    /// The settings with what was measured, and with `dead_time_s` more to compensate.
    #[must_use]
    pub fn applied(&self, settings: &Settings, dead_time_s: f64) -> Settings {
        let mut new = *settings;
        new.bridge.dead_time_ns = (new.bridge.dead_time_ns + 1e9 * dead_time_s).min(DEAD_TIME_NS);
        new.bridge.dead_time_fade_a = self.full_a().unwrap_or(new.bridge.dead_time_fade_a);
        for (motor, measured) in [&mut new.screw, &mut new.nut].into_iter().zip(&self.motors) {
            motor.resistance_line_to_line_ohm = 2.0 * measured.resistance_ohm.value;
            motor.inductance_line_to_line_mh = 2e3 * measured.inductance_h.value;
            motor.voltage_constant_v_rms_per_krpm =
                measured.flux_wb.value * f64::from(motor.pole_pairs) * PER_KRPM;
        }
        new
    }
}

impl<D: Dialogue> Session<D> {
    /// Takes the currents along d from one part of `most`, A, to another in steps that a current loop's overshoot keeps small.
    async fn ramp_direct(
        &mut self,
        most: [f64; 2],
        [from, to]: [f64; 2],
        watch: &mut dyn FnMut(&Point),
    ) -> Result<()> {
        let steps = ((to - from).abs() / RAMP).ceil();
        for step in 1..=steps as u32 {
            let part = from + (to - from) * f64::from(step) / steps;
            self.direct(most.map(|most| part * most)).await?;
            self.hold(RAMP_S, watch).await?;
        }
        Ok(())
    }
}
