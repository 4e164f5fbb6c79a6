//! What counts as something, as the same, and as not distinguished.

use crate::balance::Balance;
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::regression::design::Whitener;
use crate::search::forward::Contender;
use crate::search::select::Trial;
use crate::signal::channel::Channel;
use crate::signal::noise::{SHARE_OF_DRIVE, declared_resonance_hz, drive_rms, torque_of_angle};
use crate::signal::signals::coarsest;
use plant::Axis;
use plant::effects::Place;
use std::f64::consts::{FRAC_1_PI, TAU};

/// Smallest amplitude of an error of angle or travel in encoder counts (through the lead). The reading of a shaft that turns is off by a
/// sawtooth of one count over the angle. Its first harmonic has an amplitude of 1/pi, the largest line that it can make of any order where
/// rows meet it. That of an encoder whose motor rests all along does not average out: half a count.
const LEAST_COUNTS: f64 = FRAC_1_PI;
const LEAST_AT_REST: f64 = 0.5;
/// Smallest dead time, V: 8 ns of a bridge at 310 V and 20 kHz, and no more than a current's ripple between two samples
/// makes.
const LEAST_DEAD_TIME_V: f64 = 0.05;

/// Turns that an angle covers.
fn turns(angle: &[f64]) -> f64 {
    let (low, high) = angle
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    ((high - low) / TAU).max(0.05)
}

/// Whether two hypotheses say the same within what the record resolves.
pub(crate) fn same(a: &Hypothesis, b: &Hypothesis, balance: &Balance) -> bool {
    let near = a.place == b.place || a.place == Place::Both || b.place == Place::Both;
    if a.family != b.family || !near {
        return false;
    }
    let signals = balance.signals;
    let resolution = match a.family {
        // Its scan has one best order.
        Family::Unnamed(_) => f64::INFINITY,
        Family::AngleTorque => 3.0 / turns(&signals.motors[a.axis().map_or(0, Axis::index)].travel),
        Family::LeadError | Family::BallPassage => 1.5 / turns(&signals.relative),
        Family::TimePeriodic => 3.0 / signals.run_s(),
        Family::FluxHarmonic | Family::EncoderEccentricity => 1e-9,
        _ => f64::INFINITY,
    };
    (a.shape - b.shape).abs() < resolution
}

/// Whether a trial makes enough of a motor's torque or voltage, rms, to count, or moves the table's reading. Of a torque, what friction within
/// its tolerance does as well does not count: it repeats no better.
pub(super) fn counts(trial: &Trial, balance: &Balance, whitener: &Whitener) -> bool {
    let whole = trial.hypothesis.whole(balance, &trial.gain.values);
    whole.0.iter().any(|(channel, spectrum)| {
        let drive = drive_rms(balance.model, balance.signals, *channel);
        let part = match channel {
            Channel::Torque(_) => trial.gain.own_part(&whitener.column(&whole)),
            _ => 1.0,
        };
        part * balance.fourier.rms(spectrum) > SHARE_OF_DRIVE * drive
    })
}

/// Whether a trial's size is more than what the encoders' resolution and sampling make.
pub(super) fn resolved(trial: &Trial, balance: &Balance) -> bool {
    let size = trial.gain.values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let coarsest = coarsest(&balance.model.sensing);
    let axis = trial.hypothesis.axis();
    let count = |axis: Option<Axis>| {
        TAU / f64::from(axis.map_or(coarsest, |axis| balance.model.sensing.counts_per_turn(axis)))
    };
    let rests = |reference: &Vec<f64>| reference.iter().all(|speed| *speed == 0.0);
    let least = match balance.signals.references.iter().any(rests) {
        true => LEAST_AT_REST,
        false => LEAST_COUNTS,
    };
    match trial.hypothesis.family {
        Family::LeadError => size > least * count(None) * balance.lead.abs(),
        Family::EncoderEccentricity => size > LEAST_COUNTS * count(axis),
        Family::DeadTime => size > LEAST_DEAD_TIME_V,
        // Two records at the same speeds have the rounding's lines at the same frequencies, and of one speed at the same orders.
        Family::TimePeriodic | Family::AngleTorque => axis.is_none_or(|axis| {
            let hz = match trial.hypothesis.family {
                Family::TimePeriodic => trial.hypothesis.shape,
                _ => trial.hypothesis.shape * balance.signals.motors[axis.index()].slow_speed / TAU,
            };
            let (model, resonance) = (balance.model, declared_resonance_hz(balance.model));
            let gain = torque_of_angle(model, balance.signals, [axis; 2], hz, resonance);
            size > LEAST_COUNTS * count(Some(axis)) * gain
        }),
        _ => true,
    }
}

/// Of contenders those that the record does not tell from a trial: they explain less by no more than what an effect must
/// explain at least to count.
pub(super) fn inseparable(
    trial: &Trial,
    contenders: &[Contender<Trial>],
    material: f64,
    balance: &Balance,
) -> Vec<Trial> {
    let least = trial.gain.fall - material;
    contenders
        .iter()
        .map(|contender| &contender.trial)
        .filter(|other| {
            other.gain.fall > least && !same(&other.hypothesis, &trial.hypothesis, balance)
        })
        .cloned()
        .collect()
}
