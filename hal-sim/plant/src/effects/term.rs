//! The common shape of all effects: at a [`Site`], as a [`Law`] of a [`Coordinate`].

use std::f64::consts::TAU;
use std::sync::Arc;

/// Where a term acts and what its value means there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Site {
    /// N m, added to the torque on the shaft, positive in the direction of positive speed.
    ShaftTorque,
    /// Relative change of the flux, in back-EMF and torque alike.
    Flux,
    /// Relative change of the phase resistance.
    Resistance,
    /// A, added to the reading of phase a.
    CurrentReadingA,
    /// A, added to the reading of phase b.
    CurrentReadingB,
    /// V, added to the voltage of each phase at the motor's terminals.
    PhaseVoltage,
    /// rad, added to the angle that the encoder reads.
    EncoderReading,
    /// Added to the level of Coulomb friction: N m of a motor's bearing, N of the feed's guideway.
    Friction,
    /// m, added to the travel that the relative angle of screw and nut gives.
    Travel,
    /// N m between screw and nut: taken from the screw's torque and added to the nut's, as the pair's friction is.
    PairTorque,
    /// N against positive travel, added to the load.
    TableForce,
    /// Hz: resonance of the table on the axial stiffness, in place of the declared stiffness.
    AxialResonance,
    /// m, added to the width of the dead zone in the axial spring.
    AxialGap,
}

/// What a term depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coordinate {
    /// Nothing.
    None,
    /// Electrical angle, pole pairs x true angle, rad.
    ElectricalAngle,
    /// True mechanical angle, rad.
    MechanicalAngle,
    /// True angle of the screw less that of the nut, rad.
    RelativeAngle,
    /// Nominal travel, lead / 2 pi x relative angle, m.
    NominalTravel,
    /// Position of the table, m.
    TablePosition,
    /// Speed of the friction's surfaces: of the shaft, rad/s, or of the table, m/s.
    Speed,
    /// Current of the phase concerned, A.
    PhaseCurrent,
    /// Time from the start of the run, s.
    Time,
}

/// A term's value over its coordinate `x`. Linear in its amplitude in every case, so that `value` at amplitude 1 is the
/// regressor of an identification.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// `value`.
    Constant {
        /// The value.
        value: f64,
    },
    /// `slope * x`.
    Linear {
        /// Per unit of the coordinate.
        slope: f64,
    },
    /// `amplitude * cos(order * x + phase)`.
    Periodic {
        /// Periods per 2 pi of the coordinate.
        order: f64,
        /// Amplitude.
        amplitude: f64,
        /// Phase, rad.
        phase: f64,
    },
    /// `value * x / duration` from 0 to `duration`, 0 before, `value` after.
    Ramp {
        /// Final value.
        value: f64,
        /// Length of the ramp in units of the coordinate.
        duration: f64,
    },
    /// `amplitude * exp(-(x / width)^2)`.
    Decay {
        /// Value at 0.
        amplitude: f64,
        /// Where it has fallen to 1/e.
        width: f64,
    },
    /// `-value * sign(x)`.
    Opposing {
        /// Size.
        value: f64,
    },
    /// Straight between values at even distances over a range; beyond it 0, or the same again.
    Table {
        /// First and last coordinate.
        range: [f64; 2],
        /// Whether it is the same again beyond it.
        repeats: bool,
        /// Values from the first coordinate to the last.
        values: Arc<[f64]>,
    },
}

/// Where a coordinate is between two values of a table: the first of them, and the share of the way to the second.
#[inline]
fn between(range: [f64; 2], repeats: bool, values: &[f64], x: f64) -> Option<(usize, f64)> {
    let share = (x - range[0]) / (range[1] - range[0]);
    let share = if repeats {
        share.rem_euclid(1.0)
    } else {
        share
    };
    let last = values.len().checked_sub(2)?;
    if !(0.0..=1.0).contains(&share) {
        return None;
    }
    let at = share * (last + 1) as f64;
    let first = (at as usize).min(last);
    Some((first, at - first as f64))
}

impl Law {
    /// The value at a coordinate.
    #[inline]
    pub fn value(&self, x: f64) -> f64 {
        match *self {
            Law::Table {
                range,
                repeats,
                ref values,
            } => between(range, repeats, values, x).map_or(0.0, |(k, share)| {
                values[k] + share * (values[k + 1] - values[k])
            }),
            Law::Constant { value } => value,
            Law::Linear { slope } => slope * x,
            Law::Periodic {
                order,
                amplitude,
                phase,
            } => amplitude * (order * x + phase).cos(),
            Law::Ramp { value, duration } => value * (x / duration).clamp(0.0, 1.0),
            Law::Decay { amplitude, width } => amplitude * (-(x / width).powi(2)).exp(),
            Law::Opposing { value } if x == 0.0 => 0.0 * value,
            Law::Opposing { value } => -value * x.signum(),
        }
    }

    /// The derivative by the coordinate.
    #[inline]
    pub fn slope(&self, x: f64) -> f64 {
        match *self {
            Law::Table {
                range,
                repeats,
                ref values,
            } => between(range, repeats, values, x).map_or(0.0, |(k, _)| {
                (values[k + 1] - values[k]) * (values.len() - 1) as f64 / (range[1] - range[0])
            }),
            Law::Constant { .. } | Law::Opposing { .. } => 0.0,
            Law::Linear { slope } => slope,
            Law::Periodic {
                order,
                amplitude,
                phase,
            } => -amplitude * order * (order * x + phase).sin(),
            Law::Ramp { value, duration } if (0.0..duration).contains(&x) => value / duration,
            Law::Ramp { .. } => 0.0,
            Law::Decay { width, .. } => -2.0 * x / (width * width) * self.value(x),
        }
    }
}

/// One addition to the machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// Where it acts.
    pub site: Site,
    /// What it depends on.
    pub coordinate: Coordinate,
    /// How.
    pub law: Law,
}

impl Term {
    /// A term that depends on nothing.
    pub(crate) fn constant(site: Site, value: f64) -> Self {
        Term {
            site,
            coordinate: Coordinate::None,
            law: Law::Constant { value },
        }
    }

    /// `amplitude * cos(order * coordinate + phase)`.
    pub(crate) fn periodic(
        site: Site,
        coordinate: Coordinate,
        order: f64,
        amplitude: f64,
        phase: f64,
    ) -> Self {
        Term {
            site,
            coordinate,
            law: Law::Periodic {
                order,
                amplitude,
                phase,
            },
        }
    }

    /// `amplitude * cos(2 pi hz t + phase)`.
    pub(crate) fn oscillation(site: Site, hz: f64, amplitude: f64, phase: f64) -> Self {
        Self::periodic(site, Coordinate::Time, TAU * hz, amplitude, phase)
    }
}
