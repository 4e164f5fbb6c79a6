//! What the record itself could tell: the regression with the effects that the machine has, at their true shapes.
//!
//! It separates a search that went wrong (the truth explains more than what was found) from a model that is too simple
//! (what was found explains more than the truth) and from a record that cannot tell (the truth's values are off, or
//! explain nothing).

use identify::analysis::MATERIAL;
use identify::effects::family::Family;
use identify::effects::hypothesis::Hypothesis;
use identify::record::{Base, Record};
use identify::regression::design::Whitener;
use identify::search::roundings::balance;
use identify::search::select::Search;
use identify::signal::noise::Noise;
use plant::effects::{EffectModel, Place};
use plant::model::Model;

/// See the module.
pub struct Oracle {
    /// Sum of squares that is left with the true effects, less that with the found ones.
    pub behind: f64,
    /// Of each true effect: the fall it brings beside the others, as a share of what an effect must bring.
    pub falls: Vec<f64>,
    /// Of each true effect: its linear parameters, estimated.
    pub values: Vec<Vec<f64>>,
}

/// The hypothesis that an effect is.
pub fn hypothesis(model: &Model, effect: &EffectModel) -> Hypothesis {
    let parameter = |name: &str| {
        effect
            .effect()
            .parameters()
            .into_iter()
            .find(|(known, _)| known == name)
            .map_or(0.0, |(_, value)| value)
    };
    let order = parameter("order");
    let electrical = match effect.place() {
        Place::Nut => f64::from(model.nut.pole_pairs),
        _ => f64::from(model.screw.pole_pairs),
    };
    let (family, shape) = match effect.effect().kind() {
        "current_offset" => (Family::CurrentOffset, 0.0),
        "current_gain" => (Family::CurrentGain, 0.0),
        "dead_time" => (Family::DeadTime, 0.01),
        "resistance_drift" => (Family::ResistanceDrift, 0.0),
        "flux_drift" => (Family::FluxDrift, 0.0),
        "torque_harmonic" => (Family::AngleTorque, order * electrical),
        "cogging" | "coupling_misalignment" | "angle_periodic" => (Family::AngleTorque, order),
        "time_periodic" => (Family::TimePeriodic, parameter("hz")),
        "flux_harmonic" => (Family::FluxHarmonic, order),
        "encoder_eccentricity" => (Family::EncoderEccentricity, order),
        "stribeck_friction" => (Family::StribeckFriction, parameter("speed")),
        "lead_error" => (Family::LeadError, order),
        "ball_passage" => (Family::BallPassage, order),
        "axial_compliance" => (Family::AxialCompliance, parameter("hz")),
        "backlash" => (Family::Backlash, 0.0),
        other => (Family::Linear(other), 0.0),
    };
    Hypothesis::new(family, effect.place(), shape)
}

/// Asks the record of a machine about its true effects and about those that were found.
pub fn ask(model: &Model, record: &Record, truth: &[EffectModel], found: &[Hypothesis]) -> Oracle {
    let truth: Vec<Hypothesis> = truth.iter().map(|e| hypothesis(model, e)).collect();
    let balance = balance(record, model, &truth);
    let base = Base::new(&balance);
    let declared = Noise::declared(model, &record.signals, &record.fourier);
    let regression = |noise: &Noise, effects: &[Hypothesis]| {
        let whitener = Whitener::new(&record.signals, &record.fourier, noise);
        let mut search = Search::new(&balance, &whitener, base.normal(&whitener));
        effects.iter().for_each(|h| search.add(h));
        let solution = search.normal.solve(None);
        let cost = search.normal.cost(&solution.values);
        let left = search.normal.residual(&solution.values);
        let corrected = noise.corrected(&declared, &left.parts, &record.fourier);
        (cost, solution, corrected, whitener.used_rows())
    };
    let noise = regression(&declared, &truth).2;
    let (cost, solution, _, rows) = regression(&noise, &truth);
    let without = |k: usize| {
        let mut others = truth.clone();
        others.remove(k);
        regression(&noise, &others).0
    };
    let mut at = base.parameters.len();
    let values = truth
        .iter()
        .map(|h| {
            let own = solution
                .values
                .rows(at, h.columns())
                .iter()
                .copied()
                .collect();
            at += h.columns() + h.nuisances();
            own
        })
        .collect();
    Oracle {
        behind: cost - regression(&noise, found).0,
        falls: (0..truth.len())
            .map(|k| (without(k) - cost) / (MATERIAL * rows as f64))
            .collect(),
        values,
    }
}
