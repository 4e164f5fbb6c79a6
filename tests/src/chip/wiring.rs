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
    /// `mains_310v`: the same amplifiers' pins, the screw's encoder on SPI.
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

    /// The counts of what channel `channel` of ADC `index` + 1 is wired to.
    #[must_use]
    pub fn input(self, index: usize, channel: u32, [screw, nut]: &[Sensors; 2]) -> Option<u16> {
        Some(match (self, index + 1, channel) {
            (_, 1, 1) => screw.current[0],
            (_, 2, 2) => screw.current[1],
            (_, 2, 4) => screw.current[2],
            (_, 4, 4) => nut.current[0],
            (_, 3, 12) => nut.current[1],
            (_, 3, 5) => nut.current[2],
            (Self::Nucleo | Self::Nucleo40kHz, 1, 6) | (Self::Mains, 1, 9) => screw.bus,
            (Self::Nucleo | Self::Nucleo40kHz, 4, 3) | (Self::Mains, 4, 5) => nut.bus,
            (Self::Nucleo | Self::Nucleo40kHz, 1, 7) | (Self::Mains, 1, 14) => screw.temperature,
            (Self::Nucleo | Self::Nucleo40kHz, 2, 8) | (Self::Mains, 2, 5) => nut.temperature,
            _ => return None,
        })
    }

    /// The current amplifiers are the gate drivers' own, and sleep with them.
    #[must_use]
    pub const fn amplifiers_sleep(self) -> bool {
        matches!(self, Self::Nucleo | Self::Nucleo40kHz)
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

    /// The comparators on the shunts of motor `index`: number, phase; both boards have them on the same pins.
    #[must_use]
    pub fn comparators(self, index: usize) -> &'static [(usize, usize)] {
        // PA0 COMP3, PA1 COMP1, PA7 COMP2; PB14 COMP7, PB0 COMP4, PB13 COMP5.
        [&[(3, 0), (1, 1), (2, 2)], &[(7, 0), (4, 1), (5, 2)]][index]
    }
}
