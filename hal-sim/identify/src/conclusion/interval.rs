//! Confidence intervals of an effect's parameters.

use crate::conclusion::outcome::Found;
use crate::effects::family::Family;
use crate::regression::sandwich::NORMAL_95;

/// Standard deviation of a size that the balances themselves make (sampled voltages, currents between samples, products of what is
/// small): by how much the sizes of each family are off on drawn machines beyond what the covariance says (848 values, seeds
/// 600000 and 610000 on). Those machines are simulated: nothing is known of a real one's.
fn balance_error(family: Family, size: f64) -> f64 {
    let share = match family {
        Family::StribeckFriction => 0.02,
        Family::FluxHarmonic | Family::ResistanceDrift => 0.01,
        Family::DeadTime => 0.004,
        _ => 0.002,
    };
    let least = match family {
        // What the gains of both sensors have in common shows in the flux, and in what the balances are off in it.
        Family::CurrentGain => 5e-4,
        _ => 0.0,
    };
    (share * size).hypot(least)
}

/// A parameter with its 95 % interval.
pub struct Estimate {
    /// Name in a model file.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

/// All parameters of an effect. The length of a drift's run is no parameter of it.
pub fn estimates(found: &Found) -> Vec<Estimate> {
    found
        .effect
        .effect()
        .parameters()
        .into_iter()
        .filter(|(name, _)| name != "duration_s")
        .map(|(name, value)| {
            let half = NORMAL_95 * sigma(found, &name, value);
            Estimate {
                interval: [value - half, value + half],
                name,
                value,
            }
        })
        .collect()
}

/// Whether an effect has sizes and all of them may be zero. A frequency is no size.
pub(crate) fn may_be_nothing(found: &Found) -> bool {
    let is_size = |name: &str| !["phase", "order", "hz", "speed"].contains(&name);
    let mut sizes = estimates(found);
    sizes.retain(|own| is_size(&own.name));
    let may_be_zero = |own: &Estimate| {
        let [low, high] = own.interval;
        low <= 0.0 && high >= 0.0
    };
    !sizes.is_empty() && sizes.iter().all(may_be_zero)
}

fn sigma(found: &Found, name: &str, value: f64) -> f64 {
    let n = found.values.len();
    let variance = |k: usize| found.covariance[k * n + k].max(0.0);
    let family = found.hypothesis.family;
    let size = |own: f64| own.hypot(balance_error(family, value));
    match name {
        "order" if family == Family::AngleTorque => {
            // Torque harmonics count per electrical turn what was traced per mechanical turn.
            found.shape_sigma * value / found.hypothesis.shape
        }
        "order" | "hz" => found.shape_sigma,
        "speed" => size(found.shape_sigma),
        "amplitude" if n == 2 => {
            let [a, b] = [found.values[0], found.values[1]];
            let square = a * a + b * b;
            let own =
                (a * a * variance(0) + 2.0 * a * b * found.covariance[1] + b * b * variance(1))
                    / square;
            size(own.max(0.0).sqrt())
        }
        "phase" => {
            let [a, b] = [found.values[0], found.values[n - 1]];
            let square = a * a + b * b;
            let own = (b * b * variance(0) - 2.0 * a * b * found.covariance[1]
                + a * a * variance(n - 1))
                / (square * square);
            own.max(0.0).sqrt().hypot(balance_error(family, 1.0))
        }
        // A share of the current, from the reading's share of which the variance is.
        "gain_a" => size((1.0 + value).powi(2) * variance(0).sqrt()),
        "gain_b" => size((1.0 + value).powi(2) * variance(1).sqrt()),
        "off_b" => size(variance(1).sqrt()),
        _ => size(variance(0).sqrt()),
    }
}
