//! A burst: what one motor's current loop knew in every PWM period around a trigger.
//!
//! The drive keeps [`SAMPLES`] periods, or each `divider`th. A trigger that comes before all samples that were asked before it
//! are kept is taken: the burst then has fewer before it, and more after it.

use crate::scale;
use control::codes;
use serde::{Deserialize, Serialize};

/// Samples of a burst: 25.6 ms at 20 kHz.
pub const SAMPLES: usize = 512;
/// Samples that go into a frame.
pub const SAMPLES_A_FRAME: usize = 6;

codes! {
    /// What begins a burst.
    Trigger {
        Now = 0, "now", "The burst begins at once.";
        Fault = 1, "fault", "A fault stops the drive.";
        State = 2, "state", "The drive's state becomes another.";
        Rises = 3, "rises", "A signal rises through a level.";
        Falls = 4, "falls", "A signal falls through a level.";
    }
}

codes! {
    /// What a trigger can look at: named as the column of a burst that it is.
    Signal {
        PhaseA = 0, "ia_a", "current of phase a";
        PhaseB = 1, "ib_a", "current of phase b";
        TorqueCurrent = 2, "iq_a", "torque current";
        TorqueReference = 3, "iq_ref_a", "torque current reference";
        VoltageD = 4, "ud_v", "d voltage";
        VoltageQ = 5, "uq_v", "q voltage";
        Speed = 6, "speed_rpm", "speed";
    }
}

impl Signal {
    /// Fraction bits of its level's word: A, V, or mechanical rad/s.
    #[must_use]
    pub const fn fraction(self) -> u32 {
        match self {
            Self::PhaseA | Self::PhaseB | Self::TorqueCurrent | Self::TorqueReference => {
                scale::CURRENT
            }
            Self::VoltageD | Self::VoltageQ => scale::VOLTAGE,
            Self::Speed => scale::BASE_SPEED,
        }
    }
}

codes! {
    /// How a burst is going.
    BurstState {
        None = 0, "none", "No burst was asked since the drive's start, or it was ended.";
        Waiting = 1, "waiting", "The burst waits for its trigger.";
        Filling = 2, "filling", "The trigger has come, and samples after it are being kept.";
        Complete = 3, "complete", "The burst is complete, and can be read.";
    }
}

/// A burst that is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BurstRequest {
    /// 0 is the screw, 1 the nut.
    pub motor: u8,
    /// A [`Trigger`]'s word.
    pub trigger: u32,
    /// A [`Signal`]'s word; of no meaning where the trigger takes none.
    pub signal: u32,
    /// The level, in the signal's [`fraction`](Signal::fraction) of its unit.
    pub level: i32,
    /// Samples before the trigger's: at most [`SAMPLES`] less 1.
    pub before: u16,
    /// Each how manieth period is kept; above 0.
    pub divider: u8,
}

/// How a burst is going.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BurstStatus {
    /// A [`BurstState`]'s word.
    pub state: u32,
    /// What was asked last.
    pub request: BurstRequest,
    /// Samples before the trigger that are kept.
    pub before: u16,
    /// The motor's PWM period, modulo 2^32, in which the trigger came; of no meaning before it.
    pub period: u32,
    /// The motor's encoder counts down while its rotor turns forwards.
    pub reversed: bool,
}

/// One motor in one period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BurstSample {
    /// The encoder's count within the turn.
    pub encoder: u32,
    /// Measured current of phases a and b, 2^-12 A.
    pub phases: [i32; 2],
    /// Measured torque current, in the frame that is controlled, 2^-12 A.
    pub i_q: i32,
    /// Its reference, 2^-12 A.
    pub i_q_ref: i32,
    /// d and q voltage commanded for the control period that ends with the sample, 2^-13 V.
    pub voltage: [i32; 2],
}
