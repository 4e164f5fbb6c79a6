//! The paper's four measured ripples against its own linear model, and what single effects can do about the difference.
//!
//! An effect's shape over the four nut speeds is computed; its size is fitted, in-sample and leaving one out.

use fft::Complex64;
use plant::model::{Model, MotorModel};
use std::f64::consts::TAU;

/// Nut speeds of the paper's experiment, rpm; 0 is the CDFS.
pub const NUT_RPM: [f64; 4] = [0.0, 300.0, 500.0, 800.0];
/// Measured VRF, % (Figs 6 to 9).
pub const MEASURED: [f64; 4] = [20.1, 13.4, 10.6, 8.2];
/// Table velocity, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Rad/s of one rpm.
const RPM: f64 = TAU / 60.0;

/// One effect's attempt.
pub struct Attempt {
    /// What was added.
    pub name: &'static str,
    /// Size that fits best, in the effect's unit.
    pub size: f64,
    /// Unit of the size.
    pub unit: &'static str,
    /// Rms of model less measured with it, points of %.
    pub in_sample: f64,
    /// The same with each value predicted from the other three.
    pub leave_one_out: f64,
}

/// The model against the four values.
pub struct Study {
    /// VRF of the model, %.
    pub model: [f64; 4],
    /// Rms of model less measured, points of %.
    pub rms: f64,
    /// Effects, the best first.
    pub attempts: Vec<Attempt>,
}

/// A motor under the paper's loops (Eqs 9 to 12, 18) at an angular frequency.
struct Loop {
    /// Mechanical speed per shaft torque, rad/s per N m.
    sensitivity: Complex64,
    /// Speed per reading of the speed.
    tracking: Complex64,
}

fn closed(motor: &MotorModel, omega: f64) -> Loop {
    const CURRENT: f64 = 3000.0;
    const SPEED: f64 = 200.0;
    const DAMPING: f64 = 0.7;
    let s = Complex64::new(0.0, omega.max(1e-6));
    let p = f64::from(motor.pole_pairs);
    let (l, r, j, b) = (
        motor.inductance_h,
        motor.resistance_ohm,
        motor.inertia_kg_m2,
        motor.viscous_nm_s,
    );
    let (k_pc, k_ic) = (2.0 * DAMPING * l * CURRENT - r, l * CURRENT * CURRENT);
    let (k_pw, k_iw) = (
        2.0 * DAMPING * j * SPEED / (p * p * motor.flux_wb),
        j * SPEED * SPEED / (p * p * motor.flux_wb),
    );
    let current = (s * k_pc + k_ic) / (s * s * l + s * (r + k_pc) + k_ic);
    let open = (s * k_pw + k_iw) / s * current * p * p * motor.flux_wb;
    let sensitivity = 1.0 / (s * j + b + open);
    Loop {
        sensitivity,
        tracking: open * sensitivity,
    }
}

/// What disturbs a motor once per so many electrical turns.
#[derive(Clone, Copy)]
enum Cause {
    /// A torque, N m.
    Torque(f64),
    /// A torque that grows with the speed squared: its size at 800 rpm, N m.
    Imbalance(f64),
    /// An error of the encoder's angle, rad.
    Encoder(f64),
}

/// Peak-to-peak speed of the table, m/s, from causes `(order per electrical turn, cause)` on both motors: the sum of
/// both motors' own.
fn ripple(model: &Model, nut_rpm: f64, causes: &[(f64, Cause)]) -> f64 {
    let lead = model.feed.travel_per_radian();
    let nut = nut_rpm * RPM;
    let motor = |motor: &MotorModel, speed: f64| -> f64 {
        if speed == 0.0 {
            return 0.0;
        }
        let p = f64::from(motor.pole_pairs);
        let line = |(order, cause): &(f64, Cause)| {
            let omega = order * p * speed;
            let closed = closed(motor, omega);
            let speed = match cause {
                Cause::Torque(torque) => closed.sensitivity * torque,
                Cause::Imbalance(torque) => {
                    closed.sensitivity * torque * (speed / (800.0 * RPM)).powi(2)
                }
                Cause::Encoder(angle) => closed.tracking * (omega * angle),
            };
            (*order, speed)
        };
        let lines: Vec<(f64, Complex64)> = causes.iter().map(line).collect();
        let wave = |k: usize| -> f64 {
            // Ten electrical turns hold a period of all orders in tenths.
            let angle = 10.0 * TAU * k as f64 / 4000.0;
            lines
                .iter()
                .map(|(order, line)| (line * Complex64::from_polar(1.0, order * angle)).re)
                .sum()
        };
        let (low, high) = (0..4000)
            .map(wave)
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        high - low
    };
    lead * (motor(&model.screw, nut + VELOCITY / lead) + motor(&model.nut, nut))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    f64::sqrt(sum / n)
}

/// An effect's sizes, 0 and a logarithmic grid below `top`, and what each adds to the four values.
fn grid(shape: &dyn Fn(usize, f64) -> f64, top: f64) -> Vec<(f64, [f64; 4])> {
    const STEPS: i32 = 160;
    std::iter::once(0.0)
        .chain((0..=STEPS).map(|k| top * 10f64.powf(-4.0 + 4.0 * f64::from(k) / f64::from(STEPS))))
        .map(|size| (size, [0, 1, 2, 3].map(|k| shape(k, size))))
        .collect()
}

/// The size that is best for the values that count.
fn best(
    model: &[f64; 4],
    grid: &[(f64, [f64; 4])],
    counts: &dyn Fn(usize) -> bool,
) -> (f64, [f64; 4]) {
    let error = |added: &[f64; 4]| {
        rms((0..4)
            .filter(|k| counts(*k))
            .map(|k| model[k] + added[k] - MEASURED[k]))
    };
    grid.iter()
        .copied()
        .min_by(|a, b| error(&a.1).total_cmp(&error(&b.1)))
        .unwrap_or((0.0, [0.0; 4]))
}

/// An effect of free size that is a wave of an order per electrical turn.
struct Wave {
    name: &'static str,
    unit: &'static str,
    /// Largest size that is tried.
    top: f64,
    order: f64,
    /// The cause, of a given size.
    cause: fn(f64) -> Cause,
}

/// The waves that are tried on a motor with so many pole pairs.
fn waves(pole_pairs: f64) -> Vec<Wave> {
    let wave = |name, (unit, top), order, cause| Wave {
        name,
        unit,
        top,
        order,
        cause,
    };
    let torque = |name, order| wave(name, ("N m", 0.1), order, Cause::Torque);
    let encoder = |name, order| wave(name, ("rad", 0.01), order, Cause::Encoder);
    vec![
        wave(
            "imbalance: torque once per turn that grows with the speed squared",
            ("N m at 800 rpm", 0.1),
            1.0 / pole_pairs,
            Cause::Imbalance,
        ),
        torque("torque once per turn (coupling)", 1.0 / pole_pairs),
        torque("torque twice per turn (coupling)", 2.0 / pole_pairs),
        torque("torque once per electrical turn (current offset)", 1.0),
        torque("torque twice per electrical turn (current gain)", 2.0),
        torque("cogging, 36 per turn", 36.0 / pole_pairs),
        encoder("encoder error once per turn", 1.0 / pole_pairs),
        encoder("encoder error twice per turn", 2.0 / pole_pairs),
    ]
}

/// An effect of free size: name, unit, largest size, and what a size adds to a value of the model.
type Other = (&'static str, &'static str, f64, fn(f64, f64) -> f64);

/// The effects that are no wave of a motor.
const OTHERS: [Other; 3] = [
    (
        "measuring floor, independent of the ripple",
        "% of the velocity",
        20.0,
        |model, a| model.hypot(a) - model,
    ),
    (
        "lead error: the same ripple at every nut speed",
        "% of the velocity",
        20.0,
        |_, a| a,
    ),
    (
        "harmonics smaller than declared",
        "share",
        1.0,
        |model, a| -a * model,
    ),
];

/// The best that an effect of a name, a unit and a largest size can do.
/// `shape` is what a size adds to each value.
fn attempt(
    model: &[f64; 4],
    (name, unit, top): (&'static str, &'static str, f64),
    shape: &dyn Fn(usize, f64) -> f64,
) -> Attempt {
    let grid = grid(shape, top);
    let (size, added) = best(model, &grid, &|_| true);
    let out = |left: usize| {
        let (_, added) = best(model, &grid, &|k| k != left);
        model[left] + added[left] - MEASURED[left]
    };
    Attempt {
        name,
        size,
        unit,
        in_sample: rms((0..4).map(|k| model[k] + added[k] - MEASURED[k])),
        leave_one_out: rms((0..4).map(out)),
    }
}

impl Study {
    /// Of the paper's machine as a model declares it.
    pub fn new(paper: &Model) -> Self {
        let harmonics: Vec<(f64, Cause)> = paper
            .screw
            .torque_harmonics
            .iter()
            .map(|h| (h.order, Cause::Torque(h.amplitude_nm)))
            .collect();
        let vrf = |k: usize, more: &[(f64, Cause)]| {
            let causes: Vec<_> = harmonics.iter().chain(more).copied().collect();
            100.0 * ripple(paper, NUT_RPM[k], &causes) / VELOCITY
        };
        let model = [0, 1, 2, 3].map(|k| vrf(k, &[]));
        let poles = f64::from(paper.screw.pole_pairs);
        let adds = |k: usize, line| vrf(k, &[line]) - model[k];
        let waves = waves(poles).into_iter().map(|wave| {
            attempt(&model, (wave.name, wave.unit, wave.top), &|k, size| {
                adds(k, (wave.order, (wave.cause)(size)))
            })
        });
        let others = OTHERS.into_iter().map(|(name, unit, top, shape)| {
            attempt(&model, (name, unit, top), &|k, size| shape(model[k], size))
        });
        let mut attempts: Vec<Attempt> = waves.chain(others).collect();
        attempts.sort_by(|a, b| a.in_sample.total_cmp(&b.in_sample));
        Study {
            rms: rms((0..4).map(|k| model[k] - MEASURED[k])),
            model,
            attempts,
        }
    }

    /// What four numbers can say.
    pub fn sentence(&self) -> String {
        let least =
            |figure: fn(&Attempt) -> f64| self.attempts.iter().map(figure).fold(f64::MAX, f64::min);
        let near = least(|a| a.in_sample) + 0.3;
        format!(
            "Model less measured is {:.2} points rms. The best single effect of free size brings it to {:.2}, but {} that exclude \
             each other come within 0.3 points of it, and a value that is left out is predicted to {:.2} points at best: four \
             numbers cannot name the effect; a record of the table can.",
            self.rms,
            least(|a| a.in_sample),
            self.attempts.iter().filter(|a| a.in_sample < near).count(),
            least(|a| a.leave_one_out),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_model_meets_the_independent_figures() {
        let study = Study::new(&Model::paper());
        for (ours, independent) in study.model.iter().zip([20.75, 14.87, 9.30, 6.02]) {
            assert!(
                (ours / independent - 1.0).abs() < 0.03,
                "{ours} against {independent}"
            );
        }
        assert!((study.rms - 1.5).abs() < 0.1, "{}", study.rms);
    }

    /// Computed independently: the best is an imbalance with 0.94, and nothing that is left out is predicted better
    /// than to 1.17.
    #[test]
    fn no_single_effect_predicts_what_it_was_not_fitted_to() {
        let study = Study::new(&Model::paper());
        let best = &study.attempts[0];
        assert!(best.name.starts_with("imbalance"), "{}", best.name);
        assert!((best.in_sample - 0.94).abs() < 0.02, "{}", best.in_sample);
        let least = study.attempts.iter().map(|a| a.leave_one_out);
        let least = least.fold(f64::MAX, f64::min);
        assert!((least - 1.17).abs() < 0.03, "{least}");
    }
}
