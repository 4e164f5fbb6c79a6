//! Families of effects, and shapes that are of none.

use crate::signal::along::Along;
use crate::signal::channel::Channel;

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
    /// `lead_scale`.
    LeadScale,
    /// `ball_passage`.
    BallPassage,
    /// `axial_compliance`.
    AxialCompliance,
    /// `position_load`.
    PositionLoad,
    /// `backlash`.
    Backlash,
    /// What has no kind.
    Unnamed(Unnamed),
}

impl Family {
    /// All whose effects have a kind.
    pub const NAMED: [Family; 16] = {
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
            LeadScale,
            BallPassage,
            AxialCompliance,
            PositionLoad,
            Backlash,
        ]
    };

    /// Whether it is of a motor and its drive, so that a motor alone can have it.
    pub fn is_of_a_motor(self) -> bool {
        use Family::*;
        match self {
            CurrentOffset | CurrentGain | DeadTime | ResistanceDrift | FluxDrift | AngleTorque
            | TimePeriodic | FluxHarmonic | EncoderEccentricity | StribeckFriction => true,
            LeadError | LeadScale | BallPassage | AxialCompliance | PositionLoad | Backlash => {
                false
            }
            Unnamed(_) => true,
        }
    }
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
