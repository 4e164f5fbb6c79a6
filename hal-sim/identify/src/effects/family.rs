//! Families of effects, and shapes that are of none.

use crate::signal::along::Along;
use crate::signal::channel::Channel;
use plant::effects::{AnyEffect, Place, Places};

/// A family of effects that share their columns. Families of torque over angle are distinguished by their order only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Family {
    /// `current_offset`.
    CurrentOffset,
    /// `current_gain`.
    CurrentGain,
    /// `dead_time`.
    DeadTime,
    /// `resistance_drift`.
    ResistanceDrift,
    /// `flux_drift`.
    FluxDrift,
    /// Torque over a motor's angle: `torque_harmonic`, `cogging`, `coupling_misalignment`, `angle_periodic`.
    AngleTorque,
    /// `time_periodic`.
    TimePeriodic,
    /// `flux_harmonic`.
    FluxHarmonic,
    /// `encoder_eccentricity`.
    EncoderEccentricity,
    /// `stribeck_friction`.
    StribeckFriction,
    /// `lead_error`.
    LeadError,
    /// `ball_passage`.
    BallPassage,
    /// `axial_compliance`.
    AxialCompliance,
    /// `backlash`.
    Backlash,
    /// A kind whose terms are linear in one number, by its name.
    Linear(&'static str),
    /// What has no kind.
    Unnamed(Unnamed),
}

impl Family {
    /// Those with code of their own.
    const OWN: [Family; 14] = {
        use Family::*;
        [
            CurrentOffset,
            CurrentGain,
            DeadTime,
            ResistanceDrift,
            FluxDrift,
            AngleTorque,
            TimePeriodic,
            FluxHarmonic,
            EncoderEccentricity,
            StribeckFriction,
            LeadError,
            BallPassage,
            AxialCompliance,
            Backlash,
        ]
    };

    /// All whose effects have a kind.
    pub fn named() -> impl Iterator<Item = Family> {
        Self::OWN.into_iter().chain(Self::linear())
    }

    /// Those of the kinds that are linear in one number.
    pub fn linear() -> impl Iterator<Item = Family> {
        let kinds = AnyEffect::CATALOGUE.iter();
        kinds.filter_map(|kind| kind.linear().map(|_| Family::Linear(kind.name)))
    }

    /// Whether a linear one makes sense there.
    pub(crate) fn is_at(self, place: Place) -> bool {
        matches!(self, Family::Linear(kind) if places_of(kind).contains(place))
    }

    /// Whether it is of a motor and its drive, so that a motor alone can have it.
    pub fn is_of_a_motor(self) -> bool {
        use Family::*;
        match self {
            CurrentOffset | CurrentGain | DeadTime | ResistanceDrift | FluxDrift | AngleTorque
            | TimePeriodic | FluxHarmonic | EncoderEccentricity | StribeckFriction => true,
            LeadError | BallPassage | AxialCompliance | Backlash => false,
            Linear(kind) => places_of(kind) != Places::Feed,
            Unnamed(_) => true,
        }
    }
}

/// Where a kind makes sense.
fn places_of(kind: &str) -> Places {
    AnyEffect::kind_named(kind).map_or(Places::MotorOrFeed, |kind| kind.places)
}

/// A shape over a coordinate in one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Unnamed {
    /// Where it shows.
    pub channel: Channel,
    /// What it is a shape over.
    pub along: Along,
    /// Whether it is a force on the table, which shows in both torques and bends the screw.
    pub is_force: bool,
    /// Ends of the fit record's range of the coordinate, as bits, so that it can be a key.
    pub(crate) extent: [u64; 2],
}
