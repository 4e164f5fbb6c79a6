//! The effects of an axis one by one, each with the error on a record that nothing was fitted to.

use super::axis::{Axis, Term};
use super::fit::{FRICTION, FRICTION_FROM, Free, MARGIN, converged, covariance, fitted};
use super::left::{remnants, unsound};
use super::record::{Law, Record};
use super::select::{Trial, corrections, tried};
use super::stage::{Errors, Stage};
use super::width::of_best_width;
use crate::conclusion::rest::Remnant;
use crate::search::selection::MATERIAL_OF_ERROR;
use crate::signal::filter::{butterworth_100, decimated};
use crate::signal::white::white_below_100;
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Friction and offset that a record has of its own: the lubricant's temperature sets the one, the amplifier's the other.
pub struct OwnFriction {
    /// Changes against the fit record and their standard deviations: viscous friction, N s/m; Coulomb friction, N; offset,
    /// N.
    pub changes: [[f64; 2]; 3],
    /// On the test record from its first quarter on, with homing, friction and offset from that quarter.
    pub errors: Errors,
}

/// Standard deviations by which a parameter differs between two records: chance exceeds them once in 370 times.
const DIFFERS: f64 = 3.0;

impl OwnFriction {
    /// Of a test record whose homing is that of `homed`, where friction or offset of its first quarter differ from those of
    /// the fit record, whose covariance is given, and lower the error on the rest of it.
    fn new(homed: &Axis, test: &Record, of_fit: &DMatrix<f64>, without: &Errors) -> Option<Self> {
        let quarter = &test.first(test.len() / 4);
        let rows: Vec<usize> = (MARGIN..quarter.len() - MARGIN).collect();
        let own = fitted(homed, quarter, FRICTION, &rows);
        let of_test = covariance(&own, quarter, FRICTION, &rows);
        let changes = [0, 1, 2].map(|k: usize| {
            let at = FRICTION_FROM + k;
            let variance = of_fit[(at, at)] + of_test[(k, k)];
            [own.base[at] - homed.base[at], variance.sqrt()]
        });
        let errors = errors(&own, test, test.len() / 4);
        let differs = changes.iter().any(|[by, sigma]| by.abs() > DIFFERS * sigma);
        let less = errors.force_n < (1.0 - MATERIAL_OF_ERROR) * without.force_n;
        (differs && less).then_some(OwnFriction { changes, errors })
    }

    /// In a sentence, in which viscous and Coulomb friction of the fit record are given.
    pub fn sentence(&self, [viscous, coulomb]: [f64; 2]) -> String {
        let of = |name: &str, [by, sigma]: [f64; 2], unit: &str, whole: Option<f64>| {
            let share = whole.map_or_else(String::new, |whole| {
                format!(", {:.0} % of it", 100.0 * by.abs() / whole.abs())
            });
            let (low, high) = (by - 1.96 * sigma, by + 1.96 * sigma);
            (by.abs() > DIFFERS * sigma)
                .then(|| format!("{name} by {by:+.3} ({low:+.3} to {high:+.3}) {unit}{share}"))
        };
        let [first, second, third] = self.changes;
        let all = [
            of("viscous friction", first, "N s/m", Some(viscous)),
            of("Coulomb friction", second, "N", Some(coulomb)),
            of("offset", third, "N", None),
        ];
        let all: Vec<String> = all.into_iter().flatten().collect();
        format!(
            "The check record differs from the fit record: {}, from its first quarter; with that the error on the rest of it is {:.2} %.",
            all.join(", "),
            self.errors.force_percent
        )
    }
}

/// All stages.
pub struct Study {
    /// Inverse force error of the declared model on the estimation record and on the test record, %.
    pub inverse_percent: [f64; 2],
    /// The residual of the controller's output by its law with the derivative that suits it, V rms.
    pub law_left_v: f64,
    /// From lap to lap of a programme that repeats: what no model of the axis explains, N rms; NaN if none repeats.
    pub lap_to_lap_n: f64,
    /// Effects with which the optimiser stopped by its limit of evaluations and not at a minimum.
    pub stopped_early: Vec<String>,
    /// The declared model first, then with the controller's own derivative, then effect by effect.
    pub stages: Vec<Stage>,
    /// The last stage with corrections for which no hypothesis stands: they make the simulation better and are no effects.
    pub corrected: Option<Stage>,
    /// The stage in which nothing is added yet but mass and friction are fitted.
    pub refitted: usize,
    /// How the effects were chosen.
    pub search: Vec<Trial>,
    /// All effects of the last stage, fitted with the derivative taken as it is.
    pub ideal: Stage,
    /// Covariance of the last stage's parameters: the base four, the terms', then the orders.
    pub covariance: DMatrix<f64>,
    /// What the last stage leaves of both records above the noise from lap to lap.
    pub remnants: Vec<Remnant>,
    /// Of the test record, where it differs.
    pub own_friction: Option<OwnFriction>,
    /// On the test record from its first quarter on, with all parameters fitted to the test record: no prediction by these
    /// terms has less.
    pub fitted_to_test: Errors,
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// Errors of a model on a record from row `from` on.
fn errors(axis: &Axis, record: &Record, from: usize) -> Errors {
    let run = axis.simulate(record);
    let filtered = |values: &[f64]| butterworth_100(values, record.rate);
    let rows = from.max(MARGIN)..record.len() - MARGIN;
    let error =
        |simulated: &[f64], measured: &[f64]| rms(rows.clone().map(|k| simulated[k] - measured[k]));
    let size = |measured: &[f64]| rms(rows.clone().map(|k| measured[k]));
    let force = filtered(&record.force());
    let velocity = crate::signal::fourier::slope(&filtered(&record.position), record.rate);
    let force_n = error(&filtered(&run.force), &force);
    Errors {
        force_percent: 100.0 * force_n / size(&force),
        force_n,
        velocity_percent: 100.0 * error(&run.velocity, &velocity) / size(&velocity),
        position_um: 1e6 * error(&run.position, &record.position),
    }
}

/// Force error of the declared inverse model, %.
fn inverse(axis: &Axis, record: &Record) -> f64 {
    let [mass, viscous, coulomb, offset] = axis.base;
    let position = butterworth_100(&record.position, record.rate);
    let velocity = crate::signal::fourier::slope(&position, record.rate);
    let acceleration = crate::signal::fourier::slope(&velocity, record.rate);
    let model: Vec<f64> = velocity
        .iter()
        .zip(&acceleration)
        .map(|(v, a)| mass * a + viscous * v + coulomb * v.signum() + offset)
        .collect();
    let (model, force) = (decimated(&model), decimated(&record.force()));
    100.0 * rms(model.iter().zip(&force).map(|(m, f)| m - f)) / rms(force.iter().copied())
}

/// The homing that suits the first quarter of a record best.
fn homed(axis: &Axis, record: &Record) -> Axis {
    if !axis.repeats() {
        return axis.clone();
    }
    // What comes after the first quarter is not looked at.
    let record = &record.first(record.len() / 4);
    let rows: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
    let measured = butterworth_100(&record.force(), record.rate);
    let error = |axis: &Axis| {
        let simulated = butterworth_100(&axis.simulate(record).force, record.rate);
        rms(rows.iter().map(|&k| simulated[k] - measured[k]))
    };
    // High orders give several minima a turn: a search over the turn, then a fit.
    let best = (0..60)
        .map(|k| Axis {
            homing: TAU * f64::from(k) / 60.0,
            ..axis.clone()
        })
        .map(|axis| (error(&axis), axis))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((_, start)) => fitted(&start, record, Free::Homing, &rows),
        None => axis.clone(),
    }
}

/// Force that differs from lap to lap, N rms of one lap's share.
fn lap_to_lap(record: &Record) -> f64 {
    let reference = &record.reference;
    let top = reference.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let repeats = |lap: &usize| {
        (*lap..reference.len())
            .step_by(7)
            .all(|k| (reference[k] - reference[k - lap]).abs() < 1e-4 * top)
    };
    let least = record.rate as usize;
    let Some(lap) = (least..reference.len() / 2).find(repeats) else {
        return f64::NAN;
    };
    let force = butterworth_100(&record.force(), record.rate);
    let rows = lap + MARGIN..record.len() - MARGIN;
    rms(rows.map(|k| force[k] - force[k - lap])) / 2f64.sqrt()
}

/// The records of a study.
#[derive(Clone, Copy)]
struct Records<'r> {
    estimate: &'r Record,
    test: &'r Record,
    /// Rows of `estimate` that a model is fitted to.
    rows: &'r [usize],
}

impl Records<'_> {
    /// A model with its errors.
    fn stage(&self, added: String, axis: Axis) -> Stage {
        let unhomed = axis.without_what_repeats();
        let homed = homed(&axis, self.test);
        Stage {
            added,
            estimate: errors(&axis, self.estimate, 0),
            test: errors(&unhomed, self.test, 0),
            homed: errors(&homed, self.test, self.test.len() / 4),
            on_test: homed,
            axis,
        }
    }

    /// Errors of a model on the test record, with all parameters fitted to that.
    fn fitted_to_test(&self, on_test: &Axis) -> Errors {
        let test = self.test;
        let rows: Vec<usize> = (MARGIN..test.len() - MARGIN).collect();
        let own = fitted(on_test, test, Free::Orders, &rows);
        errors(&own, test, test.len() / 4)
    }

    /// A model with corrections for which no hypothesis stands.
    fn corrected(&self, axis: &Axis) -> Option<Stage> {
        let terms = corrections(axis, self.estimate)?;
        let mut with = axis.clone();
        let from = with.parameters().len();
        with.terms
            .extend(terms.into_iter().map(|term| (term, term.start())));
        let to = with.parameters().len();
        let with = fitted(&with, self.estimate, Free::Only { from, to }, self.rows);
        Some(self.stage("corrections without a name".into(), with))
    }
}

/// A model with effects.
struct Grown {
    axis: Axis,
    /// What it leaves of both records.
    left: Vec<Remnant>,
    /// Effects with which the optimiser stopped by its limit of evaluations.
    stopped_early: Vec<String>,
}

impl Grown {
    /// Adds the effects of a search to the last of `stages`, each as a further stage.
    /// A term loses where the check record does not confirm it, or where it leaves another law.
    fn new(records: Records, stages: &mut Vec<Stage>, search: &mut [Trial], floor: f64) -> Self {
        let refitted = stages.len() - 1;
        loop {
            stages.truncate(refitted + 1);
            let mut axis = stages[refitted].axis.clone();
            let mut stopped_early = Vec::new();
            for trial in search.iter().filter(|trial| trial.lost.is_none()) {
                axis.terms.push((trial.term, trial.term.start()));
                let at_minimum;
                (axis, at_minimum) = converged(&axis, records.estimate, Free::Orders, records.rows);
                if !at_minimum {
                    stopped_early.push(trial.term.name());
                }
                stages.push(records.stage(trial.term.name(), axis.clone()));
            }
            let on_test = &stages[stages.len() - 1].on_test;
            let left = remnants([&axis, on_test], [records.estimate, records.test], floor);
            let Some((k, reason)) = unsound(&stages[refitted..], &left, floor) else {
                return Grown {
                    axis,
                    left,
                    stopped_early,
                };
            };
            let named = search.iter_mut().filter(|trial| trial.lost.is_none());
            named
                .skip(k)
                .take(1)
                .for_each(|trial| trial.lost = Some(reason));
        }
    }
}

impl Study {
    /// Finds and fits on `estimate`, effect by effect, and scores on `test`.
    pub fn new(declared: &Axis, estimate: &Record, test: &Record) -> Self {
        let rows: Vec<usize> = (MARGIN..estimate.len() - MARGIN).collect();
        let records = Records {
            estimate,
            test,
            rows: &rows,
        };
        let mut stages = vec![records.stage("declared model".into(), declared.clone())];
        let (law, law_left_v) = estimate.law();
        let axis = Axis {
            law,
            ..declared.clone()
        };
        if let Law::Difference(periods) = law {
            let added = format!("controller's dq/dt over {periods} periods");
            stages.push(records.stage(added, axis.clone()));
        }
        let axis = fitted(&axis, estimate, Free::Model, &rows);
        let axis = of_best_width(&axis, estimate, &rows);
        stages.push(records.stage("mass and friction fitted".into(), axis.clone()));
        let refitted = stages.len() - 1;
        let lap_to_lap_n = lap_to_lap(estimate);
        let mut search = tried(&axis, estimate, lap_to_lap_n.is_finite());
        // What differs from lap to lap may be more than noise.
        let floor = lap_to_lap_n.min(white_below_100(&estimate.force(), estimate.rate));
        let Grown {
            axis,
            left,
            stopped_early,
        } = Grown::new(records, &mut stages, &mut search, floor);
        // As each effect, they must lower the check record's error.
        let uncorrected_n = stages.last().map_or(f64::NAN, |last| last.homed.force_n);
        let corrected = records.corrected(&axis);
        let corrected = corrected.filter(|with| with.homed.force_n < uncorrected_n);
        let ideal = Axis {
            law: Law::Ideal,
            ..axis.clone()
        };
        let ideal = fitted(&ideal, estimate, Free::Orders, &rows);
        let covariance = covariance(&axis, estimate, Free::Orders, &rows);
        let last = stages.last();
        let on_test = last.map_or(declared, |stage| &stage.on_test);
        Study {
            fitted_to_test: records.fitted_to_test(on_test),
            own_friction: last
                .and_then(|last| OwnFriction::new(&last.on_test, test, &covariance, &last.homed)),
            remnants: left,
            inverse_percent: [inverse(declared, estimate), inverse(declared, test)],
            law_left_v,
            lap_to_lap_n,
            stopped_early,
            stages,
            corrected,
            refitted,
            search,
            ideal: records.stage("all of it with dq/dt as it is".into(), ideal),
            covariance,
        }
    }

    /// The declared model.
    pub fn first(&self) -> &Stage {
        &self.stages[0]
    }

    /// The model that simulates best, and what it leaves.
    pub fn best(&self) -> &Stage {
        self.corrected.as_ref().unwrap_or_else(|| self.last())
    }

    /// The model with all effects.
    pub fn last(&self) -> &Stage {
        self.stages.last().unwrap_or(&self.ideal)
    }
}

impl Axis {
    /// Whether some of its force repeats with the screw.
    fn repeats(&self) -> bool {
        self.terms
            .iter()
            .any(|(term, _)| matches!(term, Term::Periodic(_)))
    }

    /// Without what repeats with the screw: its phase belongs to a record, and on another one it is not known.
    fn without_what_repeats(&self) -> Self {
        let mut axis = self.clone();
        axis.terms
            .retain(|(term, _)| !matches!(term, Term::Periodic(_)));
        axis
    }
}
