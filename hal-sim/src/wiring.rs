//! How motors, current channels and encoders are connected to the board: as they should be, or not.

use plant::Axis;

/// The cables of one motor. Legs of its bridge and current channels are numbered 0 to 2 for a to c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorWiring {
    /// The leg that feeds each winding.
    pub legs: [usize; 3],
    /// The leg whose current each channel measures.
    pub channels: [usize; 3],
    /// Signs of the channels: 1 or -1.
    pub signs: [f64; 3],
    /// The winding whose cable is open.
    pub open: Option<usize>,
    /// The encoder counts down while the motor turns forwards.
    pub encoder_reversed: bool,
}

impl MotorWiring {
    /// Everything in its place.
    #[must_use]
    pub const fn right() -> Self {
        Self {
            legs: [0, 1, 2],
            channels: [0, 1, 2],
            signs: [1.0; 3],
            open: None,
            encoder_reversed: false,
        }
    }

    /// Legs and channels are in their places: what is wired does not show in voltages and currents.
    pub(crate) fn is_straight(&self) -> bool {
        let right = Self::right();
        (self.legs, self.channels, self.signs) == (right.legs, right.channels, right.signs)
    }

    /// What the legs give -> what the windings get.
    pub(crate) fn windings(&self, legs: [f64; 3]) -> [f64; 3] {
        self.legs.map(|leg| legs[leg])
    }

    /// What the windings carry -> what the legs carry.
    #[must_use]
    pub fn legs(&self, windings: [f64; 3]) -> [f64; 3] {
        let mut legs = [0.0; 3];
        for (leg, winding) in self.legs.into_iter().zip(windings) {
            legs[leg] = winding;
        }
        legs
    }

    /// What the legs carry -> what the channels read.
    pub(crate) fn channels(&self, legs: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k: usize| self.signs[k] * legs[self.channels[k]])
    }
}

/// The cables of both motors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiring {
    /// Screw, nut.
    pub motors: [MotorWiring; 2],
    /// Each motor's input has the other's encoder.
    pub encoders_exchanged: bool,
}

impl Wiring {
    /// Everything in its place.
    #[must_use]
    pub const fn right() -> Self {
        Self {
            motors: [MotorWiring::right(); 2],
            encoders_exchanged: false,
        }
    }

    /// The cables of the motor of `axis`.
    #[must_use]
    pub fn motor(&self, axis: Axis) -> &MotorWiring {
        &self.motors[axis.index()]
    }

    /// The axis whose encoder is at the input of `axis`.
    pub(crate) fn encoder_at(&self, axis: Axis) -> Axis {
        match (self.encoders_exchanged, axis) {
            (false, axis) => axis,
            (true, Axis::Screw) => Axis::Nut,
            (true, Axis::Nut) => Axis::Screw,
        }
    }
}
