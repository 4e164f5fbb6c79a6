//! What a record can show of an effect, and what an effect can be at most. A hypothesis that nothing excites is not tried,
//! and parameters beyond physics are not taken; either is counted, with its reason.

use crate::balance::Balance;
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::signal::signals::STICKING_RAD_S;
use plant::Axis;
use plant::effects::Place;
use plant::machine::DEFAULT_BUS_VOLTAGE;
use std::f64::consts::TAU;

/// Share of the rows that must show an order below the band's upper edge.
pub(crate) const SHOWN: f64 = 0.05;
/// Periods that an angle must cover at least for what repeats with it.
pub(super) const LEAST_PERIODS: f64 = 1.0;
/// By how much a friction that decays with speed must differ between the record's speeds, of its size at rest.
pub(super) const LEAST_DECAY: f64 = 0.1;
/// Speed of a friction that decays, at most in the record's greatest: `e^-2` of it is left there.
pub(crate) const MOST_OF_TOP: f64 = 0.7;
/// The same at least in the speed over which the balances let the sign of friction turn round: nearer to it `1 - tanh(w)` is as
/// good.
const LEAST_OF_ROUNDING: f64 = 1.25;
/// Smallest way of screw against nut for what grows with the table's position, turns.
pub(super) const LEAST_TRAVEL: f64 = 0.1;

/// Dead time of a bridge in its bus voltage: 5 us of 50 us.
pub(super) const MOST_DEAD_TIME: f64 = 0.1;
/// A sensor whose gain is off by more is broken.
pub(crate) const MOST_GAIN: f64 = 0.3;
/// By how much the gains of two sensors must differ, of their sum.
const LEAST_APART: f64 = 0.2;
/// An offset in the range of the current measurement, or in the record's own greatest current where that is not known.
pub(super) const MOST_OFFSET: f64 = 0.2;
/// Copper has 0.39 % per kelvin: 130 K.
pub(super) const MOST_RESISTANCE_DRIFT: f64 = 0.5;
/// NdFeB has -0.12 % per kelvin: 130 K.
pub(super) const MOST_FLUX_DRIFT: f64 = 0.16;
/// Share of the greatest current over which a dead time's sign may turn round: over more, its voltage is nearly proportional to the current.
const WIDEST_SIGN: f64 = 0.5;
/// A harmonic of a rotor's flux in its fundamental: a square wave's third.
const MOST_FLUX_HARMONIC: f64 = 1.0 / 3.0;
/// Error of an angle, electrical rad: beyond it the field is not oriented.
pub(super) const MOST_ANGLE_ERROR: f64 = 0.5;
/// Errors of the travel in a lead: per turn, of its scale, and play.
pub(super) const MOST_LEAD_ERROR: f64 = 0.02;
pub(super) const MOST_LEAD_SCALE: f64 = 0.01;

/// What no motor can make.
pub(crate) const TORQUE: &str = "more torque than the motor's greatest current makes";
/// Reasons that several machines have.
pub(crate) const ABOVE_BAND: &str =
    "the order is above the band that was sampled and filtered, or the shaft stood still";
pub(crate) const NOT_TURNED: &str = "the angle that it repeats with does not turn far enough";
pub(crate) const CONSTANT: &str = "the speeds of the record do not tell it from constant friction";
pub(crate) const FEEDS_IN: &str = "its sign would feed energy in";

pub(super) fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    (high - low).max(0.0)
}

/// Whether a record can show a hypothesis.
pub(crate) fn excited(hypothesis: &Hypothesis, balance: &Balance) -> Result<(), &'static str> {
    let signals = balance.signals;
    let turned = |axis: Axis| range(signals.motors[axis.index()].travel.iter().copied()) / TAU;
    let relative = || range(signals.relative.iter().copied()) / TAU;
    let enough = |turns: f64, order: f64| match turns * order >= LEAST_PERIODS {
        true => Ok(()),
        false => Err(NOT_TURNED),
    };
    let axes = || {
        Axis::ALL
            .into_iter()
            .filter(|&axis| hypothesis.place.has(axis))
    };
    let most_turned = || axes().map(turned).fold(0.0, f64::max);
    let pole_pairs = hypothesis
        .axis()
        .map_or(1.0, |axis| f64::from(balance.model.motor(axis).pole_pairs));
    match hypothesis.family {
        Family::AngleTorque | Family::EncoderEccentricity => {
            enough(most_turned(), hypothesis.shape)?;
            shown(hypothesis, hypothesis.shape, balance)
        }
        Family::FluxHarmonic => {
            enough(most_turned(), pole_pairs)?;
            shown(hypothesis, hypothesis.shape * pole_pairs, balance)
        }
        Family::CurrentOffset | Family::CurrentGain => enough(most_turned(), pole_pairs),
        Family::DeadTime | Family::FluxDrift => enough(most_turned(), pole_pairs),
        Family::LeadError | Family::BallPassage => enough(relative(), hypothesis.shape),
        Family::Linear(_) => hypothesis.excited(balance),
        Family::StribeckFriction => {
            let speed = |row: usize| match hypothesis
                .axis()
                .filter(|_| hypothesis.place != Place::Feed)
            {
                Some(axis) => signals.motors[axis.index()].omega[row],
                None => balance.lead * signals.relative_speed[row],
            };
            let rest = match hypothesis
                .axis()
                .filter(|_| hypothesis.place != Place::Feed)
            {
                Some(_) => STICKING_RAD_S,
                None => balance.lead * STICKING_RAD_S,
            };
            let rows = (0..signals.len()).step_by(balance.fourier.step());
            let moving = rows.map(speed).filter(|v| v.abs() > rest);
            let decay = range(moving.map(|v| (-(v / hypothesis.shape).powi(2)).exp()));
            match decay >= LEAST_DECAY {
                true => Ok(()),
                false => Err(CONSTANT),
            }
        }
        _ => Ok(()),
    }
}

/// Whether an order is below the band's upper edge on enough rows.
fn shown(hypothesis: &Hypothesis, order: f64, balance: &Balance) -> Result<(), &'static str> {
    let signals = balance.signals;
    let fourier = balance.fourier;
    let top = crate::signal::noise::USED * fourier.hz(fourier.bins());
    let rows = || (0..signals.len()).step_by(fourier.step());
    let Some(axis) = hypothesis.axis() else {
        return Ok(());
    };
    let k = axis.index();
    let (omega, rest) = (&signals.motors[k].omega, STICKING_RAD_S);
    let slow = rows().filter(|&row| {
        let speed = omega[row].abs();
        speed > rest && order * speed / TAU < top
    });
    match slow.count() as f64 >= SHOWN * rows().count() as f64 {
        true => Ok(()),
        false => Err(ABOVE_BAND),
    }
}

/// Refuses a value above a limit, for a reason.
fn below(value: f64, most: f64, reason: &'static str) -> Result<(), &'static str> {
    match value <= most {
        true => Ok(()),
        false => Err(reason),
    }
}

/// Refuses a value that drives where friction brakes.
fn positive(value: f64) -> Result<(), &'static str> {
    match value > 0.0 {
        true => Ok(()),
        false => Err(FEEDS_IN),
    }
}

/// What the greatest current of the record makes of a motor's torque, N m.
pub(crate) fn greatest_torque(balance: &Balance, axis: Axis) -> f64 {
    let motor = balance.model.motor(axis);
    let peak_a = balance.signals.motors[axis.index()].peak_a;
    f64::from(motor.pole_pairs) * motor.flux_wb * peak_a
}

/// Whether an effect with given linear parameters can be.
pub(crate) fn plausible(
    hypothesis: &Hypothesis,
    values: &[f64],
    balance: &Balance,
) -> Result<(), &'static str> {
    let size = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    let largest = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let model = balance.model;
    let axis = hypothesis.axis().unwrap_or(Axis::Screw);
    let motor = model.motor(axis);
    let pole_pairs = f64::from(motor.pole_pairs);
    let peak_current = balance.signals.motors[axis.index()].peak_a;
    let peak_torque = greatest_torque(balance, axis);
    match hypothesis.family {
        Family::CurrentOffset => {
            let range = 2048.0 * model.sensing.current_lsb_a;
            let most = MOST_OFFSET * range.max(peak_current);
            below(largest, most, "more than a fifth of the current's range")
        }
        Family::CurrentGain => {
            below(largest, MOST_GAIN, "a gain that is off by more than 30 %")?;
            let (common, apart) = (values[0] + values[1], values[0] - values[1]);
            let alike = "a gain of both sensors alike is not told from the torque constant";
            below(LEAST_APART * common.abs(), apart.abs(), alike)
        }
        Family::DeadTime => {
            positive(values[0])?;
            let wide = "its sign turns round over more current than flows: it is not told from a resistance";
            below(hypothesis.shape, WIDEST_SIGN * peak_current, wide)?;
            let most = MOST_DEAD_TIME * DEFAULT_BUS_VOLTAGE;
            below(values[0], most, "more than a tenth of the bus voltage")
        }
        Family::ResistanceDrift => below(
            size,
            MOST_RESISTANCE_DRIFT,
            "more than copper changes over 130 K",
        ),
        Family::FluxDrift => below(size, MOST_FLUX_DRIFT, "more than magnets change over 130 K"),
        Family::AngleTorque | Family::TimePeriodic => below(size, peak_torque, TORQUE),
        Family::FluxHarmonic => below(
            size,
            MOST_FLUX_HARMONIC,
            "more than a square wave of flux has",
        ),
        Family::EncoderEccentricity => below(
            pole_pairs * size,
            MOST_ANGLE_ERROR,
            "an angle error with which the motor would not run",
        ),
        Family::StribeckFriction => decays(hypothesis, values[0], balance, peak_torque),
        Family::LeadError => below(
            size,
            MOST_LEAD_ERROR * TAU * balance.lead.abs(),
            "more than 2 % of the lead",
        ),
        Family::BallPassage => below(size, peak_torque, TORQUE),
        Family::Linear(_) => hypothesis.within_site(values[0], balance),
        Family::Backlash => {
            positive(values[0])?;
            below(
                values[0],
                MOST_LEAD_ERROR * TAU * balance.lead.abs(),
                "more than 2 % of the lead",
            )
        }
        Family::AxialCompliance | Family::Unnamed(_) => Ok(()),
    }
}

/// Whether physics allows a friction that decays with speed. `value` is its size at rest.
fn decays(
    hypothesis: &Hypothesis,
    value: f64,
    balance: &Balance,
    peak_torque: f64,
) -> Result<(), &'static str> {
    positive(value)?;
    let axis = hypothesis.axis().unwrap_or(Axis::Screw);
    let rounding = balance.rounding;
    let (top, turns_round) = match hypothesis.place {
        Place::Feed => {
            let speeds = balance.signals.relative_speed.iter();
            let top = speeds.fold(0.0_f64, |most, w| most.max(w.abs()));
            (
                balance.lead.abs() * top,
                balance.lead.abs() * rounding.guideway,
            )
        }
        _ => (
            balance.signals.motors[axis.index()].top_speed,
            rounding.bearing,
        ),
    };
    below(hypothesis.shape, MOST_OF_TOP * top, CONSTANT)?;
    let sign = "it is not told from how the sign of friction turns round";
    below(LEAST_OF_ROUNDING * turns_round, hypothesis.shape, sign)?;
    let most = match hypothesis.place {
        Place::Feed => peak_torque / balance.lead.abs(),
        _ => peak_torque,
    };
    below(value, most, TORQUE)
}
