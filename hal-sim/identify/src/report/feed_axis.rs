//! The report of a feed axis.

use super::{
    Calibrated, Channel, Coordinate, Effect, Errors, Left, Report, Residual, Selection, Stage,
    Tried,
};
use crate::conclusion::remains::whiteness;
use crate::conclusion::rest;
use crate::conclusion::verdict::{CheckChannel, Floor, Tally};
use crate::effects::refusals::Refusal;
use crate::machines::feed_axis::{self, Axis, Record, Study, Term};
use crate::records::DataQuality;
use crate::regression::sandwich::Wave;
use crate::search::selection::{MATERIAL_OF_ERROR, TOO_LITTLE};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Of what was found with an axis, from the records `accounts`.
pub fn feed_axis(study: &Study, fit: &Record, accounts: [DataQuality; 2]) -> Report {
    let (first, last) = (study.first(), study.last());
    let effects = effects(study);
    let time: Vec<f64> = (0..fit.len()).map(|k| k as f64 / fit.rate).collect();
    let channel = channel(study, fit, &time);
    let refitted = &study.stages[study.refitted];
    let unexplained: Vec<Left> = study
        .remnants
        .iter()
        .map(|remnant| Left::of(remnant, "force", "N"))
        .collect();
    // By the check record's force error, homed, against the difference from lap to lap.
    let known = match study.lap_to_lap_n.is_finite() {
        true => Floor::Laps,
        false => Floor::Unknown,
    };
    let found = Tally {
        names: effects.len(),
        curves: 0,
        left: unexplained.len(),
    };
    let rms = [refitted.test.force_n, last.homed.force_n];
    let judged = CheckChannel::of_rms(("force", "N"), rms, study.lap_to_lap_n).judged(found, known);
    let differs = study.own_friction.as_ref().map(|own| {
        let [_, viscous, coulomb, _] = last.axis.base;
        own.sentence([viscous, coulomb])
    });
    let mut said = judged.said;
    if let Some(differs) = differs {
        said.why = format!("{} {differs}", said.why);
    }
    Report {
        demo_seed: None,
        verdict: judged.verdict.name(),
        summary: said.sentence(),
        said,
        refused: refused(study),
        residual: vec![residual(study, &channel.residual[1], fit.rate)],
        effects,
        unexplained,
        calibration: calibration(study, &first.axis),
        correction: None,
        derivatives: "Position and force pass the benchmark's 100 Hz zero-phase Butterworth filter; derivatives are central \
                      differences of the filtered position."
            .into(),
        selection: selection(study),
        simulation: None,
        stages: stages(study),
        records: accounts.into(),
        channels: vec![channel],
        time,
        model: study.best().axis.to_toml(),
    }
}

/// The force's residual for the charts.
fn channel(study: &Study, fit: &Record, time: &[f64]) -> Channel {
    let last = &study.last().axis;
    let coordinate = |title: &str, folded, values: Vec<f64>| Coordinate {
        title: title.into(),
        folded,
        values,
    };
    let turns = fit.position.iter().map(|x| TAU * x / last.lead_m).collect();
    let marks = last.terms.iter().filter_map(|(term, _)| match term {
        Term::Periodic(order) => Some((*order, "angle periodic".to_owned())),
        _ => None,
    });
    Channel {
        name: "force".into(),
        unit: "N".into(),
        open: vec![true; fit.len()],
        residual: [&study.stages[study.refitted].axis, last].map(|axis| axis.left(fit)),
        turn: coordinate("Angle of the screw, turns", true, turns),
        marks: marks.collect(),
        over: vec![
            coordinate(
                "Velocity, m/s",
                false,
                crate::signal::fourier::slope(&fit.reference, fit.rate),
            ),
            coordinate("Position, m", false, fit.position.clone()),
            coordinate("Time, s", false, time.to_vec()),
        ],
    }
}

/// What was significant and not taken, and why.
fn refused(study: &Study) -> Vec<Refusal> {
    let trials = study.search.iter();
    trials
        .filter_map(|trial| {
            Some(Refusal {
                hypothesis: trial.term.kind().into(),
                place: trial.term.place().into(),
                reason: trial.lost.filter(|reason| *reason != TOO_LITTLE)?,
                trials: 1,
            })
        })
        .collect()
}

/// The force's residual in figures. `after` is what the last stage leaves of the fit record.
fn residual(study: &Study, after: &[f64], rate: f64) -> Residual {
    let (refitted, last) = (&study.stages[study.refitted], study.last());
    let step = ((rate / 200.0) as usize).max(1);
    let every: Vec<f64> = after.iter().copied().step_by(step).collect();
    Residual {
        channel: "force".into(),
        unit: "N".into(),
        fit_before: refitted.estimate.force_n,
        fit_after: last.estimate.force_n,
        check_before: refitted.test.force_n,
        check_after: last.homed.force_n,
        check_signal: None,
        noise_floor: study.lap_to_lap_n,
        whiteness: whiteness(&every),
    }
}

/// Errors of the stages one by one.
fn stages(study: &Study) -> Vec<Stage> {
    let stages = study.stages.iter().chain(&study.corrected);
    stages
        .chain([&study.ideal])
        .map(|stage| Stage {
            added: stage.added.clone(),
            fit: errors(&stage.estimate),
            check: errors(&stage.test),
            check_homed: errors(&stage.homed),
        })
        .collect()
}

fn errors(errors: &feed_axis::Errors) -> Errors {
    Errors {
        force_percent: errors.force_percent,
        velocity_percent: errors.velocity_percent,
        position_um: errors.position_um,
    }
}

/// The effects in the order in which they were found.
fn effects(study: &Study) -> Vec<Effect> {
    let axis = &study.last().axis;
    let declared = study.stages[study.refitted].estimate.force_n.powi(2);
    let mut at = axis.base.len();
    let mut order_at = study.covariance.nrows() - axis.orders().len();
    let mut effects = Vec::new();
    // Those that the declared model has come first, and are no findings.
    let known = study.first().axis.terms.len();
    for (k, (term, values)) in axis.terms.iter().enumerate() {
        let estimates = match term {
            Term::Periodic(order) => {
                order_at += 1;
                wave(
                    *order,
                    [values[0], values[1]],
                    &study.covariance,
                    [at, order_at - 1],
                )
            }
            _ => plain(*term, values, &study.covariance, at),
        };
        at += values.len();
        if let Some(found) = k.checked_sub(known) {
            let [before, after] = [0, 1].map(|next| &study.stages[study.refitted + found + next]);
            let fall = before.estimate.force_n.powi(2) - after.estimate.force_n.powi(2);
            effects.push(effect(*term, &estimates, fall / declared));
        }
    }
    effects
}

/// A parameter: name, value, variance, unit.
type Parameter = (&'static str, [f64; 2], &'static str);

/// Of cosine and sine, and of the order that was free with them.
fn wave(
    order: f64,
    pair: [f64; 2],
    covariance: &DMatrix<f64>,
    [at, order_at]: [usize; 2],
) -> Vec<Parameter> {
    let variance = |k: usize| covariance[(k, k)];
    let wave = Wave::new(
        pair,
        [variance(at), variance(at + 1)],
        covariance[(at, at + 1)],
    );
    vec![
        ("order", [order, variance(order_at)], "per turn"),
        ("amplitude", wave.amplitude, "N"),
        ("phase", wave.phase, "rad"),
    ]
}

fn plain(term: Term, values: &[f64], covariance: &DMatrix<f64>, at: usize) -> Vec<Parameter> {
    let named = term.names().iter().zip(values).enumerate();
    named
        .map(|(k, ((name, of), value))| {
            // Of a decay's speed only the size counts.
            let value = if *name == "speed" {
                value.abs()
            } else {
                *value
            };
            (*name, [value, covariance[(at + k, at + k)]], *of)
        })
        .collect()
}

fn effect(term: Term, estimates: &[Parameter], explained: f64) -> Effect {
    Effect {
        order: match term {
            Term::Periodic(order) => Some(order),
            _ => None,
        },
        ..Effect::fitted(
            term.kind(),
            term.place(),
            explained,
            estimates.iter().copied(),
        )
    }
}

fn calibration(study: &Study, declared: &Axis) -> Vec<Calibrated> {
    let names = ["mass_kg", "viscous_n_s_per_m", "coulomb_n", "offset_n"];
    let new = study.last().axis.base;
    names
        .iter()
        .enumerate()
        .map(|(k, name)| Calibrated {
            parameter: (*name).into(),
            relative_change: new[k] / declared.base[k] - 1.0,
            sigma: study.covariance[(k, k)].sqrt() / declared.base[k].abs(),
            value: None,
            unit: None,
        })
        .collect()
}

fn selection(study: &Study) -> Selection {
    let trials = study
        .search
        .iter()
        .map(|trial| Tried {
            hypothesis: trial.term.name(),
            place: trial.term.place().into(),
            shape: match trial.term {
                Term::Periodic(order) => Some(order),
                _ => None,
            },
            fall: trial.fall,
            outcome: trial.lost.unwrap_or("taken").into(),
        })
        .collect();
    Selection {
        rule: format!(
            "Chosen on the fit record alone by two-fold cross-validation: each stretch of one speed and direction belongs to one of \
             two folds, a model is fitted on either and judged by the force error on the other. A term stays if it lowers \
             that error by at least {:.0} % and is there in its size, more than three standard deviations from 0 (Newey and \
             West). A term is taken back that does not lower the check record's error, or beside which another law is left over \
             its own coordinate. The controller's output follows its law to {:.1} mV rms with dq/dt as the difference over the \
             periods that the table names; with dq/dt as it is the declared model's error is the first row's. Force error of \
             the declared inverse model: {:.2} % on the fit record, {:.2} % on the check record. {}{}",
            100.0 * MATERIAL_OF_ERROR,
            1e3 * study.law_left_v,
            study.inverse_percent[0],
            study.inverse_percent[1],
            match study.stopped_early.is_empty() {
                true => String::new(),
                false => format!(
                    "The fit stopped by its limit of evaluations, not at a minimum, with: {}. ",
                    study.stopped_early.join(", ")
                ),
            },
            rest::rule(),
        ),
        tried: study.search.len(),
        threshold: MATERIAL_OF_ERROR,
        measure: "share by which the force error falls on what was not fitted",
        trials,
    }
}
