//! What a term of a feed axis can be at most.

use super::axis::Term;
use crate::effects::limits::FEEDS_IN;

/// Whether a term of a feed axis with given parameters can be, beside its Coulomb friction, under a force of at most
/// `force_n` and over a travel.
pub(super) fn plausible_on_axis(
    term: Term,
    values: &[f64],
    coulomb_n: f64,
    force_n: f64,
    travel_m: f64,
) -> Result<(), &'static str> {
    let size = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (positive, below) = match term {
        // Friction may be lower at rest, where a spring before sliding takes its place.
        Term::Stribeck => (coulomb_n + values[0] >= 0.0, values[0] <= force_n),
        Term::Lag | Term::Presliding => (values[0] > 0.0, true),
        Term::Periodic(_) => (true, size <= force_n),
        Term::PositionFriction | Term::PositionLoad => (true, size * travel_m <= force_n),
        Term::Saturation | Term::Asymmetry => (true, true),
    };
    match (positive, below) {
        (true, true) => Ok(()),
        (false, _) => Err(FEEDS_IN),
        (_, false) => Err("more force than the motor makes"),
    }
}
