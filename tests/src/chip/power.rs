//! Faults of a power stage, as the pins of the current sensors and the gate driver's fault line show them at each instant:
//! what a sensor sees depends on which switch of its phase conducts.

use hal_sim::sensors::{CurrentSensing, Leg};

/// Where a fault's current flows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PowerFault {
    /// Into the motor, by phase, A: an overload, or a short from phase to phase.
    Motor([f64; 3]),
    /// From a phase's lead to earth or to the bus's minus, A: while its high side conducts.
    ToMinus {
        /// 0 is a.
        phase: usize,
        /// How much.
        amps: f64,
    },
    /// Through both switches of a leg, A.
    ShootThrough {
        /// 0 is a.
        phase: usize,
        /// How much.
        amps: f64,
    },
}

/// What the bench's power stage has: the sensors, and the current of a switch at which its gate driver says that there is a
/// fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerStage {
    /// Where the sensors are.
    pub sensing: CurrentSensing,
    /// A into the motor per count.
    pub amps_per_count: f64,
    /// Counts without current.
    pub zero: f64,
    /// The driver's limit, A.
    pub driver_a: f64,
}

impl PowerFault {
    /// The current into the motor's lead of a phase, and through its low side to minus beside that, A.
    fn currents(self, phase: usize, leg: Leg) -> (f64, f64) {
        match self {
            Self::Motor(amps) if leg != Leg::Open => (amps[phase], 0.0),
            Self::ToMinus { phase: at, amps } if at == phase && leg == Leg::High => (amps, 0.0),
            Self::ShootThrough { phase: at, amps } if at == phase && leg != Leg::Open => {
                (0.0, amps)
            }
            _ => (0.0, 0.0),
        }
    }
}

impl PowerStage {
    /// What the pin of a phase's sensor is at, counts of the ADC.
    #[must_use]
    pub fn counts(&self, fault: PowerFault, phase: usize, leg: Leg) -> u16 {
        let (line, through) = fault.currents(phase, leg);
        let seen = match self.sensing {
            CurrentSensing::InLine => line,
            // What goes through the leg flows there as what comes out of the motor does.
            CurrentSensing::LowSide => self.sensing.seen(line, leg) - through,
        };
        let counts = self.zero + seen / self.amps_per_count;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let counts = counts.round().clamp(0.0, 4095.0) as u16;
        counts
    }

    /// A switch of the phase carries more than the driver lets it.
    #[must_use]
    pub fn driver_trips(&self, fault: PowerFault, phase: usize, leg: Leg) -> bool {
        let (line, through) = fault.currents(phase, leg);
        line.abs().max(through) > self.driver_a
    }
}
