//! The residual of a motor's current when its orders are in, and what it looks like.

use super::fit::Fit;
use super::orders::HIGHEST;
use crate::conclusion::rest::{ABOVE, Place, Remnant, Rest};
use crate::signal::fourier::slope;
use crate::signal::leftover::Form;
use std::f64::consts::TAU;

/// Lowest order per turn, whole or not.
const LOWEST: f64 = 0.3;
/// Lowest frequency, Hz.
const LOWEST_HZ: f64 = 0.5;

/// What `fit` leaves of both records, whose angles are `positions`, above `noise` and below `hz`.
pub(super) fn remnants(
    fit: &Fit,
    positions: [&Vec<f64>; 2],
    open: [Vec<bool>; 2],
    rate: f64,
    noise: f64,
    highest: u32,
    hz: f64,
) -> Vec<Remnant> {
    let clock = |position: &Vec<f64>| {
        (0..position.len())
            .map(|row| TAU * row as f64 / rate)
            .collect()
    };
    let places = [
        Place {
            name: "angle of the motor",
            values: positions.map(Vec::clone),
            form: Form::Repeats(LOWEST..f64::from(HIGHEST.min(highest.max(1)))),
            in_time: false,
            signs: None,
        },
        Place {
            name: "speed of the motor",
            values: positions.map(|position| slope(position, rate)),
            form: Form::Curve,
            in_time: false,
            signs: None,
        },
        Place {
            name: "time",
            values: positions.map(clock),
            form: Form::Repeats(LOWEST_HZ..hz),
            in_time: true,
            signs: None,
        },
    ];
    let rest = Rest {
        open,
        values: fit.left.clone(),
        rate,
        during: Vec::new(),
        floor: noise.is_finite().then_some([noise; 2]),
        above: ABOVE,
    };
    rest.remnants(&places)
}
