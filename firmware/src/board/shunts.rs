//! Three shunts a motor, behind amplifiers outside the chip: the pins that two ADCs and three comparators a motor can have
//! together. Both boards have them there.
//!
//! | phase | screw | nut |
//! | --- | --- | --- |
//! | a | PA0: ADC1, COMP3 | PB14: ADC4, COMP7 |
//! | b | PA1: ADC2, COMP1 | PB0: ADC3, COMP4 |
//! | c | PA7: ADC2, COMP2 | PB13: ADC3, COMP5 |
//!
//! The other channel of ADC1 and ADC4 at the top is the bus; ADC1 and ADC2 convert the heat sinks' temperatures between, ADC4 the chip's
//! internal reference.

use super::pins::{comparator, converted};
use crate::hw::analog::{Channels, Input, REFERENCE, Sampling, WatchLimits, watch_limits};
use crate::hw::protection::OverCurrent;
use control::plate::BoardPlate;
use stm32g4xx_hal::comparator::{COMP1, COMP2, COMP3, COMP4, COMP5, COMP7};
use stm32g4xx_hal::gpio::{gpioa, gpiob};
use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC3, ADC4};

/// What a pin reads at a phase current, counts: the comparators see the ADCs' pins.
const fn counts(board: &BoardPlate, amps: f64) -> f64 {
    board.zero_counts + amps / board.amps_per_count
}

/// Comparators of each motor, one for each phase, that trip past so many A.
pub(super) const fn over_current(board: &BoardPlate, amps: f64) -> [OverCurrent; 2] {
    let (threshold, zero) = (counts(board, amps), counts(board, 0.0));
    [
        OverCurrent::past(&[3, 1, 2], threshold, zero),
        OverCurrent::past(&[7, 4, 5], threshold, zero),
    ]
}

/// Limits of the analog watchdogs: so many A either way, and counts of the bus.
pub(super) const fn watched(board: &BoardPlate, amps: f64, bus: u16) -> WatchLimits {
    WatchLimits {
        current: watch_limits(counts(board, -amps), counts(board, amps)),
        bus,
        shunts: board.shunts,
    }
}

/// The pins, of ports as they come out of reset: screw, nut.
pub(super) struct Shunts {
    pub(super) screw: (gpioa::PA0, gpioa::PA1, gpioa::PA7),
    pub(super) nut: (gpiob::PB14, gpiob::PB0, gpiob::PB13),
    pub(super) sampling: Sampling,
}

impl Shunts {
    /// The channels that ADC1 to ADC4 convert, with the bus on ADC1 and ADC4, and temperatures on ADC1 and ADC2.
    pub(super) fn claim(self, bus: [Input; 2], heat: [Input; 2]) -> [Channels; 4] {
        let (screw_a, screw_b, screw_c) = self.screw;
        let (nut_a, nut_b, nut_c) = self.nut;
        let (screw_a, screw_b, screw_c) = (
            screw_a.into_analog(),
            screw_b.into_analog(),
            screw_c.into_analog(),
        );
        let (nut_a, nut_b, nut_c) = (
            nut_a.into_analog(),
            nut_b.into_analog(),
            nut_c.into_analog(),
        );
        comparator::<COMP3, _>(&screw_a);
        comparator::<COMP1, _>(&screw_b);
        comparator::<COMP2, _>(&screw_c);
        comparator::<COMP7, _>(&nut_a);
        comparator::<COMP4, _>(&nut_b);
        comparator::<COMP5, _>(&nut_c);
        let ([screw_bus, nut_bus], [screw_heat, nut_heat]) = (bus, heat);
        [
            Channels {
                injected: [converted::<ADC1, _>(&screw_a, self.sampling), screw_bus],
                regular: Some(screw_heat),
            },
            Channels {
                injected: [
                    converted::<ADC2, _>(&screw_b, self.sampling),
                    converted::<ADC2, _>(&screw_c, self.sampling),
                ],
                regular: Some(nut_heat),
            },
            Channels {
                injected: [
                    converted::<ADC3, _>(&nut_b, self.sampling),
                    converted::<ADC3, _>(&nut_c, self.sampling),
                ],
                regular: None,
            },
            Channels {
                injected: [converted::<ADC4, _>(&nut_a, self.sampling), nut_bus],
                regular: Some(REFERENCE),
            },
        ]
    }
}
