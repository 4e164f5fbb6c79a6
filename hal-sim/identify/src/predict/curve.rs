//! The curve that predicts a residual, as a reader and a model file have it.

use super::basis::{Along, Group};
use super::judge::Judged;

/// What a part is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Over {
    /// Speed.
    Speed,
    /// Way since the last reversal, with the sign of the motion.
    SinceReversal,
    /// Position.
    Position,
    /// Position, with the sign of the motion.
    PositionByDirection,
    /// Angle of the turn.
    Turn,
    /// Angle of one period of an order that is not whole.
    Period,
    /// Angle of the turn, times the speed over the range's end.
    TurnBySpeed,
}

impl Over {
    /// All of them.
    pub const ALL: [Over; 7] = [
        Over::Speed,
        Over::SinceReversal,
        Over::Position,
        Over::PositionByDirection,
        Over::Turn,
        Over::Period,
        Over::TurnBySpeed,
    ];

    /// As in a model file.
    pub fn name(self) -> &'static str {
        match self {
            Over::Speed => "speed",
            Over::SinceReversal => "way since reversal",
            Over::Position => "position",
            Over::PositionByDirection => "position x direction",
            Over::Turn => "angle",
            Over::Period => "angle of a period",
            Over::TurnBySpeed => "angle x speed",
        }
    }
}

/// A part of it: a force or current over one coordinate, or over one with the sign or size of the speed.
#[derive(Debug, Clone)]
pub struct Curve {
    /// What it is over, for a model.
    pub over: Over,
    /// Top speed of the fit record, rad/s, by which a size that goes with the speed is counted.
    pub top_speed: f64,
    /// What it is over, for a reader.
    pub along: String,
    /// The order of the turn, where it has one.
    pub order: Option<f64>,
    /// Whether it is a wave whose size does not change.
    pub is_order: bool,
    /// Rms on the check record.
    pub size: f64,
    /// Coordinates, in rad, rad/s or rad since the reversal.
    pub at: Vec<f64>,
    /// Values there.
    pub values: Vec<f64>,
    /// Standard deviations of the values.
    pub sigmas: Vec<f64>,
    /// Range of the coordinate in which it was learnt; it is 0 outside of it.
    pub range: [f64; 2],
}

impl Judged {
    /// The curve's parts, if something carries over.
    pub(crate) fn curves(&self) -> Vec<Curve> {
        if !self.carries {
            return Vec::new();
        }
        let mut first = 0;
        let parts = self.groups.iter().zip(&self.sizes);
        parts
            .map(|((group, values), size)| {
                let count = values.iter().filter(|value| **value != 0.0).count();
                let own: Vec<usize> = (0..values.len()).filter(|k| values[*k] != 0.0).collect();
                let part = curve(group, values, *size, |k, j| {
                    let place =
                        |k: usize| own.iter().position(|own| *own == k).map(|at| first + at);
                    match (place(k), place(j), &self.covariance) {
                        (Some(k), Some(j), Some(covariance)) if k.max(j) < covariance.nrows() => {
                            covariance[(k, j)]
                        }
                        _ => 0.0,
                    }
                });
                first += count;
                part
            })
            .collect()
    }
}

fn curve(
    group: &Group,
    values: &[f64],
    size: f64,
    covariance: impl Fn(usize, usize) -> f64,
) -> Curve {
    let shown = group.shown();
    let functions: Vec<Vec<f64>> = shown
        .iter()
        .map(|at| (0..values.len()).map(|k| group.value(k, at)).collect())
        .collect();
    let sum = |functions: &Vec<f64>| {
        functions
            .iter()
            .zip(values)
            .map(|(f, v)| f * v)
            .sum::<f64>()
    };
    let mean = match group.along {
        // A constant is the offset's, which is declared.
        Along::Speed | Along::Position => {
            functions.iter().map(sum).sum::<f64>() / functions.len().max(1) as f64
        }
        _ => 0.0,
    };
    let sigma = |functions: &Vec<f64>| {
        let mut variance = 0.0;
        for k in 0..values.len() {
            for j in 0..values.len() {
                variance += functions[k] * functions[j] * covariance(k, j);
            }
        }
        variance.max(0.0).sqrt()
    };
    Curve {
        over: match group.along {
            Along::Speed => Over::Speed,
            Along::SinceReversal => Over::SinceReversal,
            Along::Position => Over::Position,
            Along::PositionByDirection => Over::PositionByDirection,
            Along::Order(order) if order.fract() != 0.0 => Over::Period,
            Along::Order(_) => Over::Turn,
            Along::OrderBySpeed(_) => Over::TurnBySpeed,
        },
        top_speed: group.range[0].abs().max(group.range[1].abs()),
        along: group.along.name(),
        order: group.along.order(),
        is_order: matches!(group.along, Along::Order(_)),
        size,
        at: shown
            .iter()
            .map(|at| match group.along {
                Along::OrderBySpeed(_) => at.angle,
                _ => group.coordinate(at),
            })
            .collect(),
        values: functions
            .iter()
            .map(|functions| sum(functions) - mean)
            .collect(),
        sigmas: functions.iter().map(sigma).collect(),
        range: group.range,
    }
}
