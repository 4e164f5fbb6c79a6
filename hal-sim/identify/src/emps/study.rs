//! The effects of the axis one by one, each with the error on the record that nothing was fitted to.

use super::axis::{Axis, LEAD_M, Term};
use super::filter::{butterworth_100, decimated};
use super::fit::{Free, MARGIN, fitted};
use super::record::{RATE, Record};
use std::f64::consts::TAU;

/// Errors of a closed-loop simulation.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Force after the 100 Hz filter: rms of the error over rms of the force, %.
    pub force_percent: f64,
    /// Velocity, the same, %.
    pub velocity_percent: f64,
    /// Position, rms of the error, um.
    pub position_um: f64,
}

/// The model after one more effect.
pub struct Stage {
    /// What was added last.
    pub added: String,
    /// The model.
    pub axis: Axis,
    /// On the record that it was fitted to.
    pub estimate: Errors,
    /// On the test record, nothing fitted there.
    pub test: Errors,
    /// On the test record from its first quarter on, with the homing from that quarter.
    pub homed: Errors,
}

/// All stages, the published model first.
pub struct Study {
    /// Inverse force error of the published model on the estimation record and on the test record, %.
    pub inverse_percent: [f64; 2],
    /// The stages.
    pub stages: Vec<Stage>,
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / f64::max(count, 1.0))
}

/// Errors of a model on a record from row `from` on.
fn errors(axis: &Axis, record: &Record, from: usize) -> Errors {
    let run = axis.simulate(record);
    let rows = from.max(MARGIN)..record.len() - MARGIN;
    let relative = |simulated: &[f64], measured: &[f64]| {
        let error = rms(rows.clone().map(|k| simulated[k] - measured[k]));
        100.0 * error / rms(rows.clone().map(|k| measured[k]))
    };
    let force = butterworth_100(&record.force());
    let measured_position = butterworth_100(&record.position);
    let velocity = crate::fourier::slope(&measured_position, RATE);
    Errors {
        force_percent: relative(&butterworth_100(&run.force), &force),
        velocity_percent: relative(&run.velocity, &velocity),
        position_um: 1e6 * rms(rows.clone().map(|k| run.position[k] - record.position[k])),
    }
}

/// Force error of the published inverse model, %.
fn inverse(record: &Record) -> f64 {
    let [mass, viscous, coulomb, offset] = Axis::published().base;
    let position = butterworth_100(&record.position);
    let velocity = crate::fourier::slope(&position, RATE);
    let acceleration = crate::fourier::slope(&velocity, RATE);
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
    if !axis
        .terms
        .iter()
        .any(|(term, _)| matches!(term, Term::Periodic(_)))
    {
        return axis.clone();
    }
    // What comes after the first quarter is not looked at.
    let record = &record.first(record.len() / 4);
    let quarter = MARGIN..record.len() - MARGIN;
    let error = |axis: &Axis| {
        let run = axis.simulate(record);
        let (a, b) = (
            butterworth_100(&run.force),
            butterworth_100(&record.force()),
        );
        rms(quarter.clone().map(|k| a[k] - b[k]))
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
        Some((_, start)) => fitted(&start, record, Free::Homing, quarter),
        None => axis.clone(),
    }
}

impl Study {
    /// Fits on `estimate`, effect by effect, and scores on `test`.
    pub fn new(estimate: &Record, test: &Record) -> Self {
        let stage = |added: &str, axis: Axis| {
            let homed = homed(&axis, test);
            Stage {
                added: added.to_owned(),
                estimate: errors(&axis, estimate, 0),
                test: errors(&axis, test, 0),
                homed: errors(&homed, test, test.len() / 4),
                axis,
            }
        };
        let rows = MARGIN..estimate.len() - MARGIN;
        let mut axis = Axis::published();
        let mut stages = vec![stage("published model", axis.clone())];
        let steps: [&[Term]; 5] = [
            &[Term::Lag],
            &[Term::Stribeck, Term::Saturation],
            &[Term::Asymmetry],
            &[Term::Presliding],
            &[Term::PositionFriction, Term::PositionLoad],
        ];
        for terms in steps {
            axis.terms
                .extend(terms.iter().map(|term| (*term, term.start())));
            axis = fitted(&axis, estimate, Free::Model, rows.clone());
            let names: Vec<String> = terms.iter().map(|term| term.name()).collect();
            stages.push(stage(&names.join(", "), axis.clone()));
        }
        for _ in 0..3 {
            let orders = strongest_orders(&axis, estimate, 2);
            let mut names = Vec::new();
            for order in orders {
                let term = Term::Periodic(order);
                names.push(term.name());
                axis.terms.push((term, term.start()));
            }
            axis = fitted(&axis, estimate, Free::Model, rows.clone());
            stages.push(stage(&names.join(", "), axis.clone()));
        }
        Study {
            inverse_percent: [inverse(estimate), inverse(test)],
            stages,
        }
    }
}

/// The orders per turn of the screw at which the force error of a model is strongest and that it does not have yet.
fn strongest_orders(axis: &Axis, record: &Record, count: usize) -> Vec<f64> {
    let run = axis.simulate(record);
    let (simulated, measured) = (
        butterworth_100(&run.force),
        butterworth_100(&record.force()),
    );
    // At speed only: at rest an angle says nothing.
    let rows: Vec<usize> = (MARGIN..record.len() - MARGIN)
        .filter(|k| run.velocity[*k].abs() > 5e-3)
        .collect();
    let mut spectrum: Vec<(f64, f64)> = (70..4500)
        .map(|k| {
            let order = 0.01 * f64::from(k);
            let (c, s) = rows.iter().fold((0.0, 0.0), |(c, s), &k| {
                let (sin, cos) = (order * TAU * record.position[k] / LEAD_M).sin_cos();
                (
                    c + (simulated[k] - measured[k]) * cos,
                    s + (simulated[k] - measured[k]) * sin,
                )
            });
            (f64::hypot(c, s), order)
        })
        .collect();
    let has = |order: f64| {
        axis.terms
            .iter()
            .any(|(term, _)| matches!(term, Term::Periodic(known) if (known - order).abs() < 0.3))
    };
    spectrum.retain(|(_, order)| !has(*order) && *order > 0.7);
    spectrum.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut orders: Vec<f64> = Vec::new();
    for (_, order) in spectrum {
        let order = if (order - order.round()).abs() < 0.015 {
            order.round()
        } else {
            order
        };
        if orders.len() < count && orders.iter().all(|known| (known - order).abs() > 0.3) {
            orders.push(order);
        }
    }
    orders
}
