//! What was measured of a machine and has no cause.

use super::{Coordinate, Deserialize, Law, Places, Serialize, Site, Term};
use std::sync::Arc;

/// What a measured effect adds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// N m on a motor's shaft, positive in the direction of positive speed.
    Torque,
    /// N on the table, against positive travel.
    Force,
}

/// What it is over: of a motor's shaft, or of screw against nut and the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum MeasuredOver {
    /// Angle, rad: it repeats with the range.
    #[serde(rename = "angle")]
    Angle,
    /// Speed, rad/s of a motor, m/s of the table.
    #[serde(rename = "speed")]
    Speed,
    /// Position of the table, m.
    #[serde(rename = "position")]
    Position,
    /// Position of the table, m, of what brakes it either way.
    #[serde(rename = "position x direction")]
    PositionByDirection,
}

/// A curve through values at even distances over a range, straight between them. It is 0 outside of the range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// What it adds.
    pub quantity: Quantity,
    /// What it is over.
    pub over: MeasuredOver,
    /// First and last coordinate.
    #[serde(deserialize_with = "range")]
    pub range: [f64; 2],
    /// Values from the first coordinate to the last.
    #[serde(deserialize_with = "values")]
    pub value: Vec<f64>,
}

fn range<'de, D: serde::Deserializer<'de>>(input: D) -> Result<[f64; 2], D::Error> {
    let range = <[f64; 2]>::deserialize(input)?;
    match range[1] - range[0] {
        width if width.is_finite() && width > 0.0 => Ok(range),
        _ => Err(serde::de::Error::custom(format!(
            "read {range:?}, expected two finite numbers of which the second is larger"
        ))),
    }
}

fn values<'de, D: serde::Deserializer<'de>>(input: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::<f64>::deserialize(input)?;
    match values.len() > 1 && values.iter().all(|value| value.is_finite()) {
        true => Ok(values),
        false => Err(serde::de::Error::custom(format!(
            "read {} values, expected two or more finite ones",
            values.len()
        ))),
    }
}

impl Measured {
    /// The `kind` in a model file.
    pub const KIND: &'static str = "measured";

    /// The values of `where` that make sense.
    pub fn places(&self) -> Places {
        match self.quantity {
            Quantity::Torque => Places::Motor,
            Quantity::Force => Places::Feed,
        }
    }

    /// What it adds to the machine at each place it is at; nothing of a torque over a position, which no motor has.
    pub fn terms(&self) -> Vec<Term> {
        let is_torque = self.quantity == Quantity::Torque;
        let force = if is_torque {
            Site::ShaftTorque
        } else {
            Site::TableForce
        };
        let (site, coordinate) = match self.over {
            MeasuredOver::Angle if is_torque => (force, Coordinate::MechanicalAngle),
            MeasuredOver::Angle => (force, Coordinate::RelativeAngle),
            MeasuredOver::Speed => (force, Coordinate::Speed),
            _ if is_torque => return Vec::new(),
            MeasuredOver::Position => (force, Coordinate::TablePosition),
            MeasuredOver::PositionByDirection => (Site::Friction, Coordinate::TablePosition),
        };
        let law = Law::Table {
            range: self.range,
            repeats: self.over == MeasuredOver::Angle,
            values: Arc::from(&self.value[..]),
        };
        vec![Term {
            site,
            coordinate,
            law,
        }]
    }
}
