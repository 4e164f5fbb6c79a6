//! The residual of a motor's current when its orders are in, and what it looks like.

use super::fit::Fit;
use super::orders::HIGHEST;
use crate::conclusion::rest::{ABOVE, Place, Remnant, Rest, TIME};
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
    let orders = LOWEST..f64::from(HIGHEST.min(highest.max(1)));
    let places = [
        Place::plain(
            "angle of the motor",
            positions.map(Vec::clone),
            Form::Repeats(orders),
        ),
        Place::plain(
            "speed of the motor",
            positions.map(|position| slope(position, rate)),
            Form::Curve,
        ),
        Place::plain(TIME, positions.map(clock), Form::Repeats(LOWEST_HZ..hz)),
    ];
    let rest = Rest {
        open,
        values: fit.left.clone(),
        rate,
        during: Vec::new(),
        floor: noise.is_finite().then_some([noise; 2]),
        above: ABOVE,
    };
    rest.remnants(&places.each_ref())
}
