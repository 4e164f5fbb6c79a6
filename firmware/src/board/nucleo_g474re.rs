//! NUCLEO-G474RE (MB1367) with a three-phase power stage for each motor on its morpho connectors.
//!
//! | what | screw | nut |
//! | --- | --- | --- |
//! | high sides a, b, c | PA8, PA9, PA10 (TIM1) | PC6, PC7, PC8 (TIM8) |
//! | low sides a, b, c | PA11, PA12, PB15 | PC10, PC11, PB5 |
//! | shunts a, b, c | PA0, PA1, PA7 | PB14, PB0, PB13 |
//! | bus voltage | PC0 | PB12 |
//! | heat sink's temperature | PC1 | PC2 |
//! | encoder A, B | PA15, PB3 (TIM2) | PB2, PC12 (TIM5) |
//!
//! The table's scale is on PB6 and PB7 (TIM4). PA2 and PA3 (ST-LINK's serial port), PA5 (LED), PA13 and PA14 (SWD),
//! PC13 (button), PF0 and PF1 (24 MHz crystal) are left to the board.
//!
//! Each pin goes into `Pins` once, by value, behind a bound that only the right pin in the right alternate function
//! meets: a pin used twice, or with a wrong function, does not compile.

use super::pins::{Bridge, Ports, comparator, converted, encoder};
use crate::hw::analog::Channels;
use stm32g4xx_hal::comparator::{COMP1, COMP2, COMP3, COMP4, COMP5, COMP7};
use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC3, ADC4, TIM1, TIM2, TIM4, TIM5, TIM8};

#[path = "plate.rs"]
mod plate;
pub(crate) use plate::{PLATE, SCALE_COUNT_M};

/// Threshold of the over-current comparators, ADC counts: +4.5 A of a ±5 A channel.
pub(crate) const OVER_CURRENT_COUNTS: u16 = 3891;

/// Neither motor encoder's index is wired: its timers' index pins serve as encoder and bus inputs.
pub(crate) const ENCODER_INDEX: [bool; 2] = [false, false];

/// Puts every pin in its function and says which ADC channels the measurements are on: ADC1 to ADC4.
pub(crate) fn claim(ports: Ports) -> [Channels; 4] {
    let Ports { a, b, c } = ports;

    Bridge::<TIM1>::claim(
        (
            a.pa8.into_alternate::<6>(),
            a.pa9.into_alternate::<6>(),
            a.pa10.into_alternate::<6>(),
        ),
        (
            a.pa11.into_alternate::<6>(),
            a.pa12.into_alternate::<6>(),
            b.pb15.into_alternate::<4>(),
        ),
    );
    Bridge::<TIM8>::claim(
        (
            c.pc6.into_alternate::<4>(),
            c.pc7.into_alternate::<4>(),
            c.pc8.into_alternate::<4>(),
        ),
        (
            c.pc10.into_alternate::<4>(),
            c.pc11.into_alternate::<4>(),
            b.pb5.into_alternate::<3>(),
        ),
    );
    encoder::<TIM2, _, _>(a.pa15.into_alternate::<1>(), b.pb3.into_alternate::<1>());
    encoder::<TIM5, _, _>(b.pb2.into_alternate::<2>(), c.pc12.into_alternate::<1>());
    encoder::<TIM4, _, _>(b.pb6.into_alternate::<2>(), b.pb7.into_alternate::<2>());

    let (screw_a, screw_b, screw_c) = (
        a.pa0.into_analog(),
        a.pa1.into_analog(),
        a.pa7.into_analog(),
    );
    let (nut_a, nut_b, nut_c) = (
        b.pb14.into_analog(),
        b.pb0.into_analog(),
        b.pb13.into_analog(),
    );
    comparator::<COMP3, _>(&screw_a);
    comparator::<COMP1, _>(&screw_b);
    comparator::<COMP2, _>(&screw_c);
    comparator::<COMP7, _>(&nut_a);
    comparator::<COMP4, _>(&nut_b);
    comparator::<COMP5, _>(&nut_c);

    let (screw_bus, nut_bus) = (c.pc0.into_analog(), b.pb12.into_analog());
    let (screw_heat, nut_heat) = (c.pc1.into_analog(), c.pc2.into_analog());
    [
        Channels {
            injected: [
                converted::<ADC1, _>(&screw_a),
                converted::<ADC1, _>(&screw_bus),
            ],
            regular: Some(converted::<ADC1, _>(&screw_heat)),
        },
        Channels {
            injected: [
                converted::<ADC2, _>(&screw_b),
                converted::<ADC2, _>(&screw_c),
            ],
            regular: Some(converted::<ADC2, _>(&nut_heat)),
        },
        Channels {
            injected: [converted::<ADC3, _>(&nut_b), converted::<ADC3, _>(&nut_c)],
            regular: None,
        },
        Channels {
            injected: [converted::<ADC4, _>(&nut_a), converted::<ADC4, _>(&nut_bus)],
            regular: None,
        },
    ]
}
