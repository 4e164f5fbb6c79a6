//! An angle that something may repeat with, over all holds.

use fft::Complex64;
use std::f64::consts::{PI, TAU};

/// Repetitions that a hold must have of an order.
pub(super) const LEAST_TURNS: f64 = 1.5;
/// Of the rows' rate, the fastest repetition.
const FASTEST: f64 = 0.35;

/// How a line's coefficient shows in a signal.
#[derive(Clone, Copy)]
pub(super) enum Shows {
    /// As a momentum: `c / (j order speed)`, with the other sign.
    Momentum,
    /// As a speed: `c speed`, with this sign.
    Speed(f64),
}

/// Mean speed over each hold, rad/s.
pub(super) fn mean_speeds(angles: &[Vec<f64>], interval_s: f64) -> Vec<f64> {
    let speed = |angle: &Vec<f64>| {
        let turned = angle[angle.len() - 1] - angle[0];
        turned / (interval_s * (angle.len() - 1) as f64)
    };
    angles.iter().map(speed).collect()
}

/// An angle that something may repeat with.
pub(super) struct Coordinate {
    /// Over each hold, rad.
    pub(super) angles: Vec<Vec<f64>>,
    /// Mean speed in each, rad/s.
    pub(super) speeds: Vec<f64>,
    shows: Shows,
    /// Lines that a drive has room for, and the highest order.
    pub(super) room: usize,
    pub(super) order_max: f64,
    /// What the rounding to whole counts makes of the angle at one frequency, rad.
    rounding: f64,
}

impl Coordinate {
    pub(super) fn new(
        angles: Vec<Vec<f64>>,
        interval_s: f64,
        shows: Shows,
        (room, order_max): (usize, f64),
        counts_per_turn: u32,
    ) -> Self {
        Self {
            speeds: mean_speeds(&angles, interval_s),
            angles,
            shows,
            room,
            order_max,
            // The first harmonic of a sawtooth of one count.
            rounding: TAU / f64::from(counts_per_turn) / PI,
        }
    }

    /// That an order in a hold is more than rounding makes, where it moves the shaft by `speed`, rad/s.
    pub(super) fn is_above_rounding(&self, hold: usize, order: f64, speed: f64) -> bool {
        speed > self.rounding * order * self.speeds[hold].abs()
    }

    /// Signal per coefficient in a hold; `None` where it does not show.
    pub(super) fn gain(&self, hold: usize, order: f64, interval_s: f64) -> Option<Complex64> {
        let speed = self.speeds[hold];
        let turns = order * speed.abs() / TAU;
        let seconds = interval_s * self.angles[hold].len() as f64;
        let shows = turns * seconds >= LEAST_TURNS && turns * interval_s <= FASTEST;
        shows.then(|| match self.shows {
            Shows::Momentum => Complex64::i() / (order * speed),
            Shows::Speed(sign) => Complex64::from(sign * speed),
        })
    }

    /// Orders closer than that are one over all holds: a quarter of one over the turns from the first row to the last.
    pub(super) fn finest(&self) -> f64 {
        let ends = self
            .angles
            .iter()
            .flat_map(|angle| [angle[0], angle[angle.len() - 1]]);
        let (least, most) = ends.fold((f64::MAX, f64::MIN), |(least, most), end| {
            (least.min(end), most.max(end))
        });
        0.25 * TAU / (most - least).max(TAU)
    }

    /// Turns of the longest hold: orders closer than one over that are one.
    pub(super) fn turns(&self) -> f64 {
        let turns = |angle: &Vec<f64>| (angle[angle.len() - 1] - angle[0]).abs() / TAU;
        self.angles.iter().map(turns).fold(0.0, f64::max)
    }
}
