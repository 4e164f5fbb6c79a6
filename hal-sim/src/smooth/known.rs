//! What a model knows of a machine, as what its drive compensates: each effect's order and coefficient.

use control::compensation::{ANGLES, TORQUES, TRAVELS};
use control::plate::{
    CompensationPlate, FrictionPlate, OrderPlate, RubbingPlate, TorqueOrderPlate,
};
use fft::Complex64;
use plant::Axis;
use plant::effects::{AnglePeriodic, AnyEffect, Cogging, CouplingMisalignment, EffectModel, Place};
use plant::model::{Model, MotorModel};
use std::f64::consts::{SQRT_2, TAU};

/// What a model's effects are to a compensation.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// Orders and coefficients.
    pub compensation: CompensationPlate,
    /// Friction, which the model declares.
    pub friction: FrictionPlate,
    /// Effects that no order compensates, by kind and place.
    pub left: Vec<String>,
}

/// Points of an electrical turn on which an error of current sensors is taken apart.
const POINTS: usize = 64;
/// Less than this of torque (A) and speed (1) is no order.
const LEAST: f64 = 1e-7;

/// Way over which friction rises where the model has it rise at once, rad: a hundredth of a second at the acceleration of a slow
/// reversal. Our choice.
const PRESLIDING_RAD: f64 = 1e-4;
/// Stribeck speed of friction that has none, rad/s: any.
const NO_STRIBECK_RAD_S: f64 = 1.0;

/// Complex amplitudes of an order: `Re(x e^(j order angle))`. The first is without a load. The second, of a torque, is added for each ampere
/// of the motor's load.
type Lines = Vec<(f64, [Complex64; 2])>;

impl Known {
    /// What `model` says. Harmonics of the flux and the gains of current sensors scale with the load, which the drive knows.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        let mut left = Vec::new();
        let r = model.feed.travel_per_radian();
        let mut torque: [Lines; 2] = Default::default();
        let mut angle: [Lines; 2] = Default::default();
        let mut travel: Lines = Vec::new();
        for axis in Axis::ALL {
            let motor = model.motor(axis);
            let per_amp = per_amp(motor);
            for harmonic in &motor.torque_harmonics {
                let amps = -harmonic.amplitude_nm / per_amp;
                torque[axis.index()].push((
                    harmonic.order * f64::from(motor.pole_pairs),
                    fixed(Complex64::from_polar(amps, harmonic.phase_rad)),
                ));
            }
        }
        for effect in &model.effects {
            let mut taken = of_feed(effect, r, &mut travel);
            for axis in Axis::ALL {
                if effect.place().has(axis) {
                    let k = axis.index();
                    taken |= of_motor(effect, model.motor(axis), &mut torque[k], &mut angle[k]);
                }
            }
            if !taken {
                left.push(format!(
                    "{} ({})",
                    effect.effect().kind(),
                    effect.place().name()
                ));
            }
        }
        let mut fit = |lines: Lines, most: usize, what: &str| {
            let mut lines = gathered(lines);
            for (order, _) in lines.iter().skip(most) {
                left.push(format!("order {order} of {what}: no more than {most} fit"));
            }
            lines.truncate(most);
            lines
        };
        let [screw_torque, nut_torque] = torque;
        let [screw_angle, nut_angle] = angle;
        let compensation = CompensationPlate {
            torque: [
                torque_plates(fit(screw_torque, TORQUES, "the screw's torque")),
                torque_plates(fit(nut_torque, TORQUES, "the nut's torque")),
            ],
            angle: [
                plates::<ANGLES>(fit(screw_angle, ANGLES, "the screw's encoder")),
                plates::<ANGLES>(fit(nut_angle, ANGLES, "the nut's encoder")),
            ],
            travel: plates::<TRAVELS>(fit(travel, TRAVELS, "the lead")),
            ..CompensationPlate::NONE
        };
        Self {
            compensation,
            friction: friction(model),
            left,
        }
    }
}

/// Friction of the model, and what of it sticks.
fn friction(model: &Model) -> FrictionPlate {
    let r = model.feed.travel_per_radian().abs();
    let rubbing = |coulomb_nm: f64, place: &dyn Fn(&EffectModel) -> bool, per: f64| {
        let mut plate = RubbingPlate {
            coulomb_nm,
            sticks_nm: 0.0,
            stribeck_rad_s: NO_STRIBECK_RAD_S,
            presliding_rad: PRESLIDING_RAD,
        };
        for effect in model.effects.iter().filter(|effect| place(effect)) {
            if let AnyEffect::StribeckFriction(one) = effect.effect() {
                plate.sticks_nm += one.amplitude * per;
                plate.stribeck_rad_s = one.speed / per;
            }
        }
        plate
    };
    let bearing = |axis: Axis| {
        let at = |effect: &EffectModel| effect.place().has(axis);
        rubbing(model.motor(axis).coulomb_nm, &at, 1.0)
    };
    let feed_nm = model.feed.pair_coulomb_nm + model.feed.guideway_coulomb_n * r;
    let at_feed = |effect: &EffectModel| effect.place() == Place::Feed;
    FrictionPlate {
        bearings: Axis::ALL.map(bearing),
        feed: rubbing(feed_nm, &at_feed, r),
    }
}

fn per_amp(motor: &MotorModel) -> f64 {
    f64::from(motor.pole_pairs) * motor.flux_wb
}

/// An effect of a motor: `true` if it has an order.
fn of_motor(
    effect: &EffectModel,
    motor: &MotorModel,
    torque: &mut Lines,
    angle: &mut Lines,
) -> bool {
    let p = f64::from(motor.pole_pairs);
    match effect.effect() {
        AnyEffect::TorqueHarmonic(one) => torque.push((
            one.order * p,
            fixed(Complex64::from_polar(
                -one.amplitude / per_amp(motor),
                one.phase,
            )),
        )),
        AnyEffect::Cogging(Cogging {
            order,
            amplitude,
            phase,
        })
        | AnyEffect::AnglePeriodic(AnglePeriodic {
            order,
            amplitude,
            phase,
        })
        | AnyEffect::CouplingMisalignment(CouplingMisalignment {
            order,
            amplitude,
            phase,
        }) => torque.push((
            *order,
            fixed(Complex64::from_polar(-amplitude / per_amp(motor), *phase)),
        )),
        AnyEffect::FluxHarmonic(one) => torque.push((
            one.order * p,
            per_ampere(Complex64::from_polar(-one.amplitude, one.phase)),
        )),
        AnyEffect::CurrentOffset(one) => sensed(torque, p, fixed, |_| [one.off_a, one.off_b]),
        AnyEffect::CurrentGain(one) => sensed(torque, p, per_ampere, |theta_e| {
            // Phase currents of a q current of 1 A (Eqs 5 and 6, power invariant).
            let phase = |k: f64| -(theta_e - k * TAU / 3.0).sin() * SQRT_2 / 3f64.sqrt();
            [one.gain_a * phase(0.0), one.gain_b * phase(1.0)]
        }),
        AnyEffect::EncoderEccentricity(one) => angle.push((
            one.order,
            fixed(Complex64::from_polar(one.amplitude * one.order, one.phase)),
        )),
        _ => return false,
    }
    true
}

/// An effect of the feed: `true` if it has an order.
fn of_feed(effect: &EffectModel, r: f64, travel: &mut Lines) -> bool {
    match effect.effect() {
        // The travel's slope is `r - amplitude * order * sin(..)`: the speed is raised where it is less.
        AnyEffect::LeadError(one) => {
            let part = one.amplitude * one.order / r;
            travel.push((
                one.order,
                fixed(Complex64::from_polar(part, one.phase) * -Complex64::i()),
            ));
            true
        }
        // A torque of the pair: what it does to the table's speed is learned from a scale, and not known before.
        AnyEffect::BallPassage(one) => {
            travel.push((one.order, fixed(Complex64::ZERO)));
            true
        }
        _ => false,
    }
}

/// What the readings of phases a and b are wrong by, over the electrical angle, is what the current loop makes the q current
/// wrong by, with the other sign: its reference is raised by the same.
fn sensed(
    torque: &mut Lines,
    pole_pairs: f64,
    scaled: impl Fn(Complex64) -> [Complex64; 2],
    errors: impl Fn(f64) -> [f64; 2],
) {
    let values: Vec<f64> = (0..POINTS)
        .map(|k| {
            let theta_e = TAU * k as f64 / POINTS as f64;
            let [a, b] = errors(theta_e);
            let q = |error: f64, k: f64| -(theta_e - k * TAU / 3.0).sin() * error;
            (q(a, 0.0) + q(b, 1.0) + q(-a - b, 2.0)) * SQRT_2 / 3f64.sqrt()
        })
        .collect();
    for harmonic in 1..=2 {
        let line: Complex64 = values
            .iter()
            .enumerate()
            .map(|(k, value)| {
                let angle = TAU * f64::from(harmonic) * k as f64 / POINTS as f64;
                Complex64::cis(-angle) * value * 2.0 / POINTS as f64
            })
            .sum();
        if line.norm() > LEAST {
            torque.push((f64::from(harmonic) * pole_pairs, scaled(line)));
        }
    }
}

/// Lines of one order together, the largest first.
fn gathered(lines: Lines) -> Lines {
    let mut sums: Lines = Vec::new();
    for (order, line) in lines {
        match sums.iter_mut().find(|(known, _)| *known == order) {
            Some((_, sums)) => {
                for (sum, part) in sums.iter_mut().zip(line) {
                    *sum += part;
                }
            }
            None => sums.push((order, line)),
        }
    }
    // An ampere of load: motors of all sizes have a few.
    let size = |[fixed, per_ampere]: &[Complex64; 2]| fixed.norm() + per_ampere.norm();
    sums.sort_by(|(_, a), (_, b)| size(b).total_cmp(&size(a)));
    sums
}

/// An amplitude that no load changes.
fn fixed(line: Complex64) -> [Complex64; 2] {
    [line, Complex64::ZERO]
}

/// An amplitude an ampere of load.
fn per_ampere(line: Complex64) -> [Complex64; 2] {
    [Complex64::ZERO, line]
}

fn torque_plates(lines: Lines) -> [TorqueOrderPlate; TORQUES] {
    let mut plates = [TorqueOrderPlate::NONE; TORQUES];
    for (plate, (order, [fixed, per_ampere])) in plates.iter_mut().zip(lines) {
        *plate = TorqueOrderPlate {
            order,
            re: fixed.re,
            im: fixed.im,
            re_per_a: per_ampere.re,
            im_per_a: per_ampere.im,
        };
    }
    plates
}

fn plates<const N: usize>(lines: Lines) -> [OrderPlate; N] {
    let mut plates = [OrderPlate::NONE; N];
    for (plate, (order, [line, _])) in plates.iter_mut().zip(lines) {
        *plate = OrderPlate {
            order,
            re: line.re,
            im: line.im,
        };
    }
    plates
}
