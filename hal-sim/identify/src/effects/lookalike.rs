//! Which effects look like what the simplifications of another leave.
//!
//! The balances are linear in each effect: what two effects make together (the voltage that an offset of the current
//! needs over a resistance that drifts), and what an effect does to the machine's motion within a filter's length, is
//! left over. It is small, but it looks like certain other effects, and is not to be named as one.

use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use plant::Axis;
use plant::effects::Place;
use plant::model::Model;

/// Share of what an effect explains that its lookalike must explain beside it.
const SHARE: f64 = 0.01;

/// What `trial` must explain at least beside `found`, which explains `fall`.
pub(crate) fn least(found: &Hypothesis, fall: f64, trial: &Hypothesis, model: &Model) -> f64 {
    if shadows(found, trial, model) {
        SHARE * fall
    } else {
        0.0
    }
}

/// Whether an effect shows as a curve over a coordinate, or may do so over the little way that a table goes.
fn is_curve(trial: &Hypothesis) -> bool {
    use Family::{FluxDrift, ResistanceDrift, StribeckFriction};
    let differs = [StribeckFriction, ResistanceDrift, FluxDrift].contains(&trial.family);
    differs || trial.place == Place::Feed
}

/// Whether what `found` leaves looks like `trial`.
fn shadows(found: &Hypothesis, trial: &Hypothesis, model: &Model) -> bool {
    // A curve whose law nobody knows moves the plate's parameters, which all channels share.
    if let Family::Unnamed(unnamed) = found.family
        && !unnamed.along.repeats()
    {
        return is_curve(trial);
    }
    let at_one_motor = Axis::ALL
        .into_iter()
        .any(|axis| found.place.has(axis) && trial.place.has(axis));
    if at_one_motor {
        let pole_pairs = trial
            .axis()
            .map_or(1.0, |axis| f64::from(model.motor(axis).pole_pairs));
        // What repeats with the angle, per mechanical turn.
        let order = match trial.family {
            Family::AngleTorque | Family::EncoderEccentricity => Some(trial.shape),
            Family::FluxHarmonic => Some(trial.shape * pole_pairs),
            _ => None,
        };
        let is = |wanted: f64| order.is_some_and(|order| (order - wanted).abs() < 0.02 * wanted);
        return match found.family {
            Family::CurrentOffset => {
                trial.family == Family::CurrentGain || is(pole_pairs) || is(2.0 * pole_pairs)
            }
            Family::CurrentGain => {
                trial.family == Family::CurrentOffset
                    || trial.family == Family::FluxDrift
                    || is(2.0 * pole_pairs)
            }
            Family::EncoderEccentricity => is(found.shape) || is(2.0 * found.shape),
            Family::AngleTorque => is(found.shape),
            Family::DeadTime => {
                matches!(trial.family, Family::ResistanceDrift | Family::FluxDrift)
                    || is(6.0 * pole_pairs)
            }
            Family::FluxHarmonic => is(found.shape * pole_pairs),
            _ => false,
        };
    }
    if found.place != Place::Feed || trial.place != Place::Feed {
        return false;
    }
    use Family::{AxialCompliance, Backlash, Linear};
    match found.family {
        AxialCompliance => trial.family == Backlash,
        Backlash => trial.family == AxialCompliance,
        Linear("lead_scale") => trial.family == Linear("position_load"),
        _ => false,
    }
}
