//! What a current loop is asked, and what it says.

use crate::base::format::{Angle, Current, ScaledCurrent};
use crate::current::sense::Codes;
use crate::current::transform::DirectQuadrature;

/// What a current loop does with its bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Outputs off.
    #[default]
    Off,
    /// Outputs off, zero currents being measured, for as long as it is asked.
    Calibrate,
    /// Outputs on, currents controlled.
    Drive,
    /// Outputs on, all low sides closed: the shorted winding brakes its motor, whose angle need not be known.
    Short,
    /// Outputs off, the break acknowledged.
    Reset,
}

/// The frame in which currents are controlled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// The rotor's own, which the encoder gives once it is aligned.
    #[default]
    Rotor,
    /// One that stands at this electrical angle, whatever the encoder says: a current along its d axis pulls the magnets'
    /// flux there.
    Commanded(Angle),
}

/// What the speed task asks of a current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentReference {
    /// What to do with the bridge.
    pub mode: Mode,
    /// The frame of the currents.
    pub frame: Frame,
    /// Current along d, A: 0 in the rotor's frame (Eq 6).
    pub i_d: Current,
    /// Torque-making current, A.
    pub i_q: Current,
}

/// How far an offset calibration is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Calibration {
    /// Not done.
    #[default]
    Pending,
    /// The zeros are measured, or the nominal ones trusted, and in use.
    Done,
    /// A zero lies further from its nominal place than a healthy sensor's: the nominal ones stay in use.
    OutOfRange,
}

/// The phase currents of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Codes of the phases.
    pub codes: Codes,
    /// Current.
    pub current: DirectQuadrature<ScaledCurrent>,
}

/// What a current loop knows after a period that it did not drive in the rotor's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rested {
    /// How far the offset calibration is.
    pub calibration: Calibration,
    /// The break input has stopped the bridge.
    pub broken: bool,
    /// A measured current was beyond its limit.
    pub over_current: bool,
    /// The encoder's count stands while the shaft turns, or too many of its readings are wrong.
    pub encoder_stuck: bool,
    /// The rotor's angle is known.
    pub angle_known: bool,
    /// The bridge is closed for currents in the rotor's frame.
    pub closed: bool,
}
