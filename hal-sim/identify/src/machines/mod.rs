//! The kinds of machine: what each can show, what is known of it before it runs, and what may be looked for.
//!
//! One engine identifies them all. A single motor is the screw's motor of a double drive without nut and feed; what it
//! cannot show has no channel, and a family whose effects have no channel is not tried.

mod double_drive;
pub mod feed_axis;
pub mod motor;
pub mod pmsm;
pub(crate) mod pmsm_file;
pub(crate) mod voltage_frame;

pub use double_drive::DoubleDrive;
pub use pmsm::Pmsm;

use crate::effects::family::Family;
use crate::effects::parameter::Parameter;
use crate::signal::along::{Along, Factor};
use crate::signal::channel::Channel;
use plant::Axis;
use plant::effects::Place;
use std::fmt::Debug;
use std::path::Path;

/// A kind of machine.
pub trait Machine: Debug + Sync {
    /// The balances that its record gives.
    fn channels(&self) -> &'static [Channel];

    /// Its motors.
    fn axes(&self) -> &'static [Axis];

    /// Declared parameters and nuisances, in the order of the regression.
    fn parameters(&self) -> Vec<Parameter>;

    /// Whether its effects can be of a family.
    fn can_have(&self, family: Family) -> bool;

    /// Whether it has screw, nut and table.
    fn has_feed(&self) -> bool {
        false
    }

    /// Whether its records have a coordinate.
    fn has(&self, along: Along) -> bool {
        match along {
            Along::Angle(axis)
            | Along::Speed(axis)
            | Along::SinceReversal(axis)
            | Along::AngleTimes(axis, _)
            | Along::SpeedTimes(axis, Factor::Current(_))
            | Along::TimeTimes(
                Factor::Direction(axis) | Factor::Speed(axis) | Factor::Current(axis),
            ) => self.axes().contains(&axis),
            Along::Clock | Along::Time => true,
            _ => self.has_feed(),
        }
    }

    /// A channel's name in a report.
    fn name(&self, channel: Channel) -> &'static str {
        channel.name()
    }

    /// A channel's unit.
    fn unit(&self, channel: Channel) -> &'static str {
        channel.unit()
    }

    /// The `where` of an effect.
    fn place(&self, place: Place) -> &'static str {
        place.name()
    }
}

/// Why a model file could not be used.
#[derive(Debug, thiserror::Error)]
#[error("{origin}: {reason}")]
pub struct ModelFileError {
    origin: String,
    reason: String,
}

impl ModelFileError {
    pub(crate) fn new(origin: &str, reason: String) -> Self {
        let origin = origin.to_owned();
        ModelFileError { origin, reason }
    }

    /// Reads a file and what its text says.
    fn read<T>(path: &Path, parse: fn(&str, &str) -> Result<T, Self>) -> Result<T, Self> {
        let origin = path.display().to_string();
        let text = std::fs::read_to_string(path);
        let text = text.map_err(|error| Self::new(&origin, error.to_string()))?;
        parse(&text, &origin)
    }
}

/// What a motor's value counts in where a file declares it, and where it does not: then per unit, and from nothing.
pub(crate) fn declared_or_unit(value: f64) -> f64 {
    match value == 0.0 {
        true => 1.0,
        false => value,
    }
}
