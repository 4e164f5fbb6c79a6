//! The boards that the chip can stand on: what is wired to its analog pins.

use crate::pins::Sensors;
use hal_sim::boards::BoardKind;

/// A board, as the firmware's board module of that name has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// `nucleo_g474re`: external amplifiers, incremental encoders.
    Nucleo,
    /// The same with its bridges at 40 kHz.
    Nucleo40kHz,
    /// `mains_310v`: on-chip amplifiers, the screw's encoder on SPI.
    Mains,
}

/// A gate driver's pins: port (0 is A), pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Driver {
    /// Its enable, active high.
    pub enable: (usize, u32),
    /// Its fault output, active low, and the alternate function that is the timer's break input.
    pub fault: (usize, u32, u32),
}

/// What an ADC channel sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// These counts, at a pin.
    Pin(u16),
    /// These counts, at the output of the amplifier of that number, if it is on.
    Amplifier(usize, u16),
}

impl Wiring {
    /// The board of `hal-sim` that it is.
    #[must_use]
    pub const fn kind(self) -> BoardKind {
        match self {
            Self::Nucleo => BoardKind::Nucleo,
            Self::Nucleo40kHz => BoardKind::Nucleo40kHz,
            Self::Mains => BoardKind::Mains,
        }
    }

    /// What channel `channel` of ADC `index` + 1 is wired to.
    #[must_use]
    pub fn input(self, index: usize, channel: u32, [screw, nut]: &[Sensors; 2]) -> Option<Input> {
        let nucleo = match (index + 1, channel) {
            (1, 1) => screw.current[0],
            (2, 2) => screw.current[1],
            (2, 4) => screw.current[2],
            (1, 6) => screw.bus,
            (1, 7) => screw.temperature,
            (4, 4) => nut.current[0],
            (3, 12) => nut.current[1],
            (3, 5) => nut.current[2],
            (4, 3) => nut.bus,
            (2, 8) => nut.temperature,
            _ => return self.mains_input(index, channel, [screw, nut]),
        };
        match self {
            Self::Nucleo | Self::Nucleo40kHz => Some(Input::Pin(nucleo)),
            Self::Mains => self.mains_input(index, channel, [screw, nut]),
        }
    }

    fn mains_input(self, index: usize, channel: u32, [screw, nut]: [&Sensors; 2]) -> Option<Input> {
        if self != Self::Mains {
            return None;
        }
        Some(match (index + 1, channel) {
            (1, 13) => Input::Amplifier(1, screw.current[0]),
            (2, 16) => Input::Amplifier(2, screw.current[1]),
            (1, 9) => Input::Pin(screw.bus),
            (1, 1) => Input::Pin(screw.temperature),
            (4, 17) => Input::Amplifier(6, nut.current[0]),
            (3, 13) => Input::Amplifier(3, nut.current[1]),
            (4, 4) => Input::Pin(nut.bus),
            (2, 5) => Input::Pin(nut.temperature),
            _ => return None,
        })
    }

    /// The gate driver of motor `index`; both boards have them on the same pins.
    #[must_use]
    pub fn driver(self, index: usize) -> Driver {
        // PA4, PB10 as TIM1_BKIN; PC5, PD2 as TIM8_BKIN.
        [
            Driver {
                enable: (0, 4),
                fault: (1, 10, 12),
            },
            Driver {
                enable: (2, 5),
                fault: (3, 2, 4),
            },
        ][index]
    }

    /// The comparators on the shunts of motor `index`: number, phase.
    #[must_use]
    pub fn comparators(self, index: usize) -> &'static [(usize, usize)] {
        match (self, index) {
            // PA0 COMP3, PA1 COMP1, PA7 COMP2; PB14 COMP7, PB0 COMP4, PB13 COMP5.
            (Self::Nucleo | Self::Nucleo40kHz, 0) => &[(3, 0), (1, 1), (2, 2)],
            (Self::Nucleo | Self::Nucleo40kHz, _) => &[(7, 0), (4, 1), (5, 2)],
            // PA1 COMP1, PA7 COMP2; PB13 COMP5, PB0 COMP4.
            (Self::Mains, 0) => &[(1, 0), (2, 1)],
            (Self::Mains, _) => &[(5, 0), (4, 1)],
        }
    }

    /// What a comparator's pin is at where the ADC reads `counts` of a current.
    #[must_use]
    pub fn at_comparator(self, counts: u16) -> u16 {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => counts,
            // Before the amplifiers, whose gain is 4.
            Self::Mains => counts / 4,
        }
    }

    /// The amplifiers by number, and the code of the pin that their input must be (`VP_SEL`).
    #[must_use]
    pub fn amplifiers(self) -> &'static [(usize, u32)] {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => &[],
            // PA1, PA7, PB0, PB13.
            Self::Mains => &[(1, 0), (2, 0), (3, 0), (6, 2)],
        }
    }
}
