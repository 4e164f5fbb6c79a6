//! The windings of a motor over one step: exact for constant voltage and back-EMF.

use super::clarke::{clarke, inverse_clarke};
use super::pair::{Pair, each};
use std::ops::{Add, Mul};

/// What drives the windings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bridge {
    /// Voltages of the phases a, b, c to the midpoint of the bus, V.
    Driven([f64; 3]),
    /// Each phase stays on the same rail: no leg switches, so no dead time takes a voltage.
    Shorted,
    /// All six switches off: the diodes drive each phase's current to zero against half the bus voltage.
    ///
    /// A current at zero stays there: the line back-EMF is taken to be below the bus voltage.
    Open,
}

/// Response of an R-L winding over one step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Response<T> {
    /// The residual of the current after the step.
    decay: T,
    /// Current after the step per volt held.
    gain: T,
    /// What the initial current contributes to the step's mean.
    mean_decay: T,
    /// Mean current per volt held.
    mean_gain: T,
}

impl Response<f64> {
    pub(super) fn new(resistance: f64, inductance: f64, dt: f64) -> Self {
        let ratio = resistance * dt / inductance;
        let loss = -(-ratio).exp_m1();
        let mean_decay = loss / ratio;
        Response {
            decay: 1.0 - loss,
            gain: loss / resistance,
            mean_decay,
            mean_gain: (1.0 - mean_decay) / resistance,
        }
    }
}

impl Response<Pair> {
    pub(super) fn side_by_side(of: [Response<f64>; 2]) -> Self {
        Response {
            decay: each(|k| of[k].decay),
            gain: each(|k| of[k].gain),
            mean_decay: each(|k| of[k].mean_decay),
            mean_gain: each(|k| of[k].mean_gain),
        }
    }

    /// That of one motor.
    pub(super) fn of(&self, k: usize) -> Response<f64> {
        Response {
            decay: self.decay.to_array()[k],
            gain: self.gain.to_array()[k],
            mean_decay: self.mean_decay.to_array()[k],
            mean_gain: self.mean_gain.to_array()[k],
        }
    }
}

/// Currents after a step and their mean over it, alpha and beta.
pub(super) struct Stepped<T> {
    pub(super) current: [T; 2],
    pub(super) mean: [T; 2],
}

/// Steps the currents under a held voltage less the back-EMF.
#[inline]
pub(super) fn driven<T: Copy + Add<Output = T> + Mul<Output = T>>(
    current: [T; 2],
    voltage: [T; 2],
    response: &Response<T>,
) -> Stepped<T> {
    let end = |k: usize| response.decay * current[k] + response.gain * voltage[k];
    let mean = |k: usize| response.mean_decay * current[k] + response.mean_gain * voltage[k];
    Stepped {
        current: [end(0), end(1)],
        mean: [mean(0), mean(1)],
    }
}

/// As [`driven`], with a voltage lost in each phase against the sign of its current.
///
/// The loss of a step can bring a phase's current to zero but not beyond: it is the value in `-lost..=lost` whose
/// current after the step has its sign or is zero. Three coupled conditions, solved phase by phase until they hold.
pub(super) fn driven_with_loss(
    current: [f64; 2],
    voltage: [f64; 2],
    lost: f64,
    response: &Response<f64>,
) -> Stepped<f64> {
    const SWEEPS: usize = 40;
    let free = inverse_clarke(driven(current, voltage, response).current);
    // A volt in one phase moves its current by 2/3 of the gain and the others by -1/3, since their sum is zero.
    let per_ampere = 1.5 / response.gain;
    let mut loss = free.map(|i| lost * sign(i));
    for _ in 0..SWEEPS {
        let mut change = 0.0_f64;
        for k in 0..3 {
            let common = (loss[0] + loss[1] + loss[2]) / 3.0;
            let i = free[k] - response.gain * (loss[k] - common);
            let next = (loss[k] + per_ampere * i).clamp(-lost, lost);
            change = change.max((next - loss[k]).abs());
            loss[k] = next;
        }
        if change <= 1e-9 * lost {
            break;
        }
    }
    let lost = clarke(loss);
    driven(
        current,
        [voltage[0] - lost[0], voltage[1] - lost[1]],
        response,
    )
}

/// Steps the currents with all switches off.
pub(super) fn open(
    current: [f64; 2],
    emf: [f64; 2],
    half_bus: f64,
    response: &Response<f64>,
) -> Stepped<f64> {
    let before = inverse_clarke(current);
    if before == [0.0; 3] {
        return Stepped {
            current: [0.0; 2],
            mean: [0.0; 2],
        };
    }
    let diodes = clarke(before.map(|i| -half_bus * sign(i)));
    let after =
        inverse_clarke(driven(current, [diodes[0] - emf[0], diodes[1] - emf[1]], response).current);
    // A phase that has reached zero floats; the two others are then in series.
    let done = [0, 1, 2].map(|k: usize| before[k] == 0.0 || after[k] * before[k] <= 0.0);
    let after = match done {
        [false, false, false] => after,
        [true, false, false] => [
            0.0,
            0.5 * (after[1] - after[2]),
            0.5 * (after[2] - after[1]),
        ],
        [false, true, false] => [
            0.5 * (after[0] - after[2]),
            0.0,
            0.5 * (after[2] - after[0]),
        ],
        [false, false, true] => [
            0.5 * (after[0] - after[1]),
            0.5 * (after[1] - after[0]),
            0.0,
        ],
        _ => [0.0; 3],
    };
    let mean = [0, 1, 2].map(|k: usize| 0.5 * (before[k] + after[k]));
    Stepped {
        current: clarke(after),
        mean: clarke(mean),
    }
}

/// -1, 0 or 1.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}
