//! What a term of a feed axis can be at most.

use super::axis::{Axis, Term};
use super::record::Record;
use crate::effects::limits::{CONSTANT, FEEDS_IN, MOST_GAIN, MOST_OF_TOP};

/// Whether a term with given parameters can be on an axis, as a record shows it.
pub(super) fn plausible_on_axis(
    term: Term,
    values: &[f64],
    axis: &Axis,
    record: &Record,
) -> Result<(), &'static str> {
    let force_n = axis.limit_v * record.force_per_volt.abs();
    let (coulomb_n, travel_m) = (axis.base[2], record.travelled().1);
    let size = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let (positive, below) = match term {
        // Friction may be lower at rest, where a spring before sliding takes its place.
        Term::Stribeck if values[1].abs() > MOST_OF_TOP * record.top_speed() => {
            return Err(CONSTANT);
        }
        Term::Stribeck => (coulomb_n + values[0] >= 0.0, values[0] <= force_n),
        Term::Lag | Term::Presliding => (values[0] > 0.0, true),
        Term::Periodic(_) => (true, size <= force_n),
        Term::PositionFriction | Term::PositionLoad => (true, size * travel_m <= force_n),
        Term::Saturation if values[0] < 0.0 => {
            return Err("friction that grows more than the speed is of another law");
        }
        Term::DirectionGain => (true, size <= MOST_GAIN),
        Term::Saturation | Term::Asymmetry | Term::Travel { .. } | Term::Measured { .. } => {
            (true, true)
        }
    };
    match (positive, below) {
        (true, true) => Ok(()),
        (false, _) => Err(FEEDS_IN),
        (_, false) => Err("more force than the motor makes"),
    }
}
