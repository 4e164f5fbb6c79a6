//! The curve that predicts a residual, as a reader and a model file have it.

use super::basis::{Along, At};
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
        match self.carries {
            true => (0..self.groups.len()).map(|k| self.curve(k)).collect(),
            false => Vec::new(),
        }
    }

    /// Some groups together at given places: values and standard deviations.
    pub(crate) fn at(&self, groups: &[usize], places: &[At]) -> Vec<[f64; 2]> {
        // Only what is not 0 was fitted, and has a covariance.
        let fitted = |values: &[f64]| (0..values.len()).filter(|k| values[*k] != 0.0).collect();
        let members: Vec<Vec<usize>> = self.groups.iter().map(|(_, v)| fitted(v)).collect();
        let terms: Vec<(usize, usize, usize)> = groups
            .iter()
            .flat_map(|own| {
                let first: usize = members[..*own].iter().map(Vec::len).sum();
                let own_terms = members[*own].iter().enumerate();
                own_terms.map(move |(at, k)| (first + at, *own, *k))
            })
            .collect();
        let covariance = |k: usize, j: usize| {
            let known = self.covariance.as_ref();
            known.and_then(|c| c.get((k, j))).copied().unwrap_or(0.0)
        };
        let of = |at: &At| {
            let function = |(_, own, k): &(usize, usize, usize)| self.groups[*own].0.value(*k, at);
            let functions: Vec<f64> = terms.iter().map(function).collect();
            let (mut value, mut variance) = (0.0, 0.0);
            for ((row, own, k), f) in terms.iter().zip(&functions) {
                value += f * self.groups[*own].1[*k];
                for ((column, ..), g) in terms.iter().zip(&functions) {
                    variance += f * g * covariance(*row, *column);
                }
            }
            [value, variance.max(0.0).sqrt()]
        };
        places.iter().map(of).collect()
    }

    fn curve(&self, own: usize) -> Curve {
        let group = &self.groups[own].0;
        let shown = group.shown();
        let points = self.at(&[own], &shown);
        let mean = match group.along {
            // A constant is the offset's, which is declared.
            Along::Speed | Along::Position => {
                points.iter().map(|[value, _]| value).sum::<f64>() / points.len().max(1) as f64
            }
            _ => 0.0,
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
            size: self.sizes[own],
            at: shown
                .iter()
                .map(|at| match group.along {
                    Along::OrderBySpeed(_) => at.angle,
                    _ => group.coordinate(at),
                })
                .collect(),
            values: points.iter().map(|[value, _]| value - mean).collect(),
            sigmas: points.iter().map(|[_, sigma]| *sigma).collect(),
            range: group.range,
        }
    }
}
