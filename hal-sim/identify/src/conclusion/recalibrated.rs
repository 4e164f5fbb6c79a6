//! The declared parameters as the record has them, and the new model.

use crate::effects::parameter::{MotorParameter, Parameter};
use crate::machines::{Machine, declared_or_unit};
use crate::regression::normal::{Normal, Solution};
use crate::search::case::Case;
use plant::Axis;
use plant::effects::EffectModel;
use plant::model::Model;

/// Name of a declared parameter in a model file; `None` for a nuisance.
fn declared_name(parameter: Parameter, machine: &dyn Machine) -> Option<String> {
    Some(match parameter {
        Parameter::Motor(axis, which) => {
            let key = match which {
                MotorParameter::Inertia => "inertia_kg_m2",
                MotorParameter::Viscous => "viscous_nm_s",
                MotorParameter::Coulomb => "coulomb_nm",
                MotorParameter::Flux => "flux_wb",
                MotorParameter::Resistance => "resistance_ohm",
                MotorParameter::Inductance => "inductance_h",
                _ => return None,
            };
            match machine.has_feed() {
                true => format!("{}.{key}", axis.name()),
                false => format!("motor.{key}"),
            }
        }
        Parameter::Pair => "feed.pair_coulomb_nm".into(),
        Parameter::GuidewayCoulomb => "feed.guideway_coulomb_n".into(),
        Parameter::GuidewayViscous => "feed.guideway_viscous_n_s_per_m".into(),
        Parameter::Load => "feed.load_n".into(),
        Parameter::TableMass { .. } => "feed.table_mass_kg".into(),
        Parameter::Curve(_)
        | Parameter::GuidewayShare
        | Parameter::EndSpeed { .. }
        | Parameter::TableOrigin { .. }
        | Parameter::RestOffset { .. }
        | Parameter::RestDrift { .. } => return None,
    })
}

pub(crate) fn calibration(case: &Case, solution: &Solution) -> Vec<(String, f64, f64)> {
    case.base
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(k, (parameter, _))| {
            Some((
                declared_name(*parameter, case.balance.signals.machine)?,
                parameter.within_interval(case.balance.model, solution.values[k]),
                solution.covariance[(k, k)].max(0.0).sqrt(),
            ))
        })
        .collect()
}

/// Places of the plate values that the record has at an end of their tolerance.
pub(crate) fn at_ends(case: &Case, solution: &Solution) -> Vec<usize> {
    let is_plate = |k: &usize| {
        let own = case.base.parameters.get(*k);
        own.is_some_and(|(own, _)| own.is_of_the_plate())
    };
    let held = solution.held.iter().map(|(k, _)| *k);
    held.filter(is_plate).collect()
}

/// Their names in a model file.
pub(crate) fn names_at_ends(case: &Case, solution: &Solution) -> Vec<String> {
    let name = |k: usize| {
        let (parameter, _) = case.base.parameters[k];
        declared_name(parameter, case.balance.signals.machine)
    };
    at_ends(case, solution)
        .into_iter()
        .filter_map(name)
        .collect()
}

/// The load that a motor alone is taken to have, N m.
pub(crate) fn load_nm(case: &Case, solution: &Solution) -> Option<f64> {
    let is_load =
        |(own, _): &(Parameter, _)| matches!(own, Parameter::Motor(_, MotorParameter::Load));
    let at = case.base.parameters.iter().position(is_load)?;
    let alone = !case.balance.signals.machine.has_feed();
    alone.then(|| solution.values[at])
}

/// Minimum electrical angle of an encoder's zero that is reported, rad: half a degree, which an alignment may leave.
const LEAST_ZERO: f64 = 0.009;
/// Standard deviations that it must be away from none.
const ZERO_SIGMAS: f64 = 4.0;

/// Electrical angles by which encoders' zeros are taken to be off, rad, of those that are.
pub(crate) fn angle_zeros(case: &Case, solution: &Solution) -> Vec<(Axis, f64)> {
    let parameters = case.base.parameters.iter().enumerate();
    let of = |(k, (parameter, _)): (usize, &(Parameter, _))| match parameter {
        Parameter::Motor(axis, MotorParameter::AngleZero) => {
            let (value, variance) = (solution.values[k], solution.covariance[(k, k)]);
            let least = (ZERO_SIGMAS * variance.max(0.0).sqrt()).max(LEAST_ZERO);
            (value.abs() > least).then_some((*axis, value))
        }
        _ => None,
    };
    parameters.filter_map(of).collect()
}

/// How much of each curve of its base a record has.
pub(crate) fn curve_shares(case: &Case, solution: &Solution) -> Vec<f64> {
    let parameters = case.base.parameters.iter().zip(solution.values.iter());
    let curves = parameters.filter(|((parameter, _), _)| matches!(parameter, Parameter::Curve(_)));
    curves.map(|(_, share)| *share).collect()
}

/// A relative change; of what is not declared, the value itself. No friction and no inertia is below nothing.
fn add(declared: &mut f64, value: f64) {
    *declared = (*declared + declared_or_unit(*declared) * value).max(0.0);
}

/// Changes what a model declares of one parameter, relative.
fn change(model: &mut Model, parameter: Parameter, value: f64) {
    let factor = 1.0 + value;
    match parameter {
        Parameter::Motor(axis, which) => {
            let motor = model.motor_mut(axis);
            match which {
                MotorParameter::Inertia => add(&mut motor.inertia_kg_m2, value),
                MotorParameter::Viscous => add(&mut motor.viscous_nm_s, value),
                MotorParameter::Coulomb => add(&mut motor.coulomb_nm, value),
                MotorParameter::Flux => motor.flux_wb *= factor,
                MotorParameter::Resistance => motor.resistance_ohm *= factor,
                MotorParameter::Inductance => motor.inductance_h *= factor,
                _ => {}
            }
        }
        Parameter::Pair => model.feed.pair_coulomb_nm *= factor,
        Parameter::GuidewayCoulomb => model.feed.guideway_coulomb_n *= factor,
        Parameter::GuidewayViscous => model.feed.guideway_viscous_n_s_per_m *= factor,
        Parameter::Load => model.feed.load_n *= factor,
        Parameter::GuidewayShare
        | Parameter::TableMass { .. }
        | Parameter::Curve(_)
        | Parameter::EndSpeed { .. }
        | Parameter::TableOrigin { .. }
        | Parameter::RestOffset { .. }
        | Parameter::RestDrift { .. } => {}
    }
}

/// Minimum and maximum factor on a plate value that is proposed: beyond that something else is wrong.
const FACTORS: [f64; 2] = [0.3, 3.0];

/// A plate value as the fit record has it, beyond its tolerance.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Released {
    /// Its name in a model file.
    pub name: String,
    parameter: Parameter,
    /// On what is declared.
    pub factor: f64,
}

/// How many plate values are proposed together at most: of more a record says little, and each number of them is a search of its own.
const MOST_RELEASED: usize = 2;

/// Part of what is beyond the noise that they must bring: with more left something else is missing.
const OF_THE_EXCESS: f64 = 0.5;

/// Plate values that leave their tolerance where the record lets them: of those at an end the one that brings most is let free, then that
/// with another one. None where one leaves what a plate may be, or where they bring little. `rows` is what noise alone would cost.
pub(crate) fn released(case: &Case, normal: &Normal, rows: f64) -> Vec<Vec<Released>> {
    let (mut free, mut solution) = (normal.clone(), normal.solve(None));
    let before = normal.cost(&solution.values);
    let (mut places, mut sets) = (Vec::new(), Vec::new());
    let most = |ends: &[usize], free: &Normal| {
        let falls = ends.iter().map(|&k| (k, free.fall_without_priors(&[k])));
        falls.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    while places.len() < MOST_RELEASED
        && let Some(k) = most(&at_ends(case, &solution), &free)
    {
        free.release(k);
        places.push(k);
        solution = free.solve(None);
        if before - free.cost(&solution.values) < OF_THE_EXCESS * (before - rows) {
            continue;
        }
        let own = places.iter().map(|&k| {
            let (parameter, _) = case.base.parameters[k];
            let factor = 1.0 + solution.values[k];
            let name = declared_name(parameter, case.balance.signals.machine)?;
            let may_be = (FACTORS[0]..FACTORS[1]).contains(&factor);
            may_be.then_some(Released {
                name,
                parameter,
                factor,
            })
        });
        sets.extend(own.collect::<Option<Vec<_>>>());
    }
    sets
}

/// A model with plate values as the record has them.
pub(crate) fn corrected(model: &Model, released: &[Released]) -> Model {
    let mut model = model.clone();
    for own in released {
        change(&mut model, own.parameter, own.factor - 1.0);
    }
    model
}

/// Part of its measured mass that a table has at least.
const LIGHTEST: f64 = 0.05;

pub(crate) fn new_model(
    case: &Case,
    solution: &Solution,
    effects: impl Iterator<Item = EffectModel>,
) -> Model {
    let mut model = case.balance.model.clone();
    model.feed.axial_damping_ratio = case.balance.damping;
    let (mut share, mut heavier) = (0.0, 1.0);
    for (k, (parameter, _)) in case.base.parameters.iter().enumerate() {
        let value = parameter.within_interval(case.balance.model, solution.values[k]);
        match *parameter {
            Parameter::GuidewayShare => share = value.clamp(0.0, 1.0),
            Parameter::TableMass { .. } => heavier = (1.0 + value).max(LIGHTEST),
            _ => change(&mut model, *parameter, value),
        }
    }
    let feed = &mut model.feed;
    // The resonance was measured, and so was how far friction winds up the screw: both stay.
    feed.table_mass_kg *= heavier;
    feed.axial_stiffness_n_per_m *= heavier;
    let share = f64::min(share * heavier, 1.0);
    feed.guideway_coulomb_n += share * feed.pair_coulomb_nm / feed.travel_per_radian().abs();
    feed.pair_coulomb_nm *= 1.0 - share;
    model.effects.extend(effects);
    model
}
