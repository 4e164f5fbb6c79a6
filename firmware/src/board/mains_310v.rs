//! A board for 310 V from the mains: an STM32G474RE with its own power stages and current amplifiers, an
//! absolute encoder on the screw's motor and an incremental one with index on the nut's. Its chip, and all that is wired
//! to it, is at mains potential: see `firmware/boards/mains_310v.md` before a cable is plugged in.
//!
//! | what | screw | nut |
//! | --- | --- | --- |
//! | high sides a, b, c | PC0, PC1, PC2 (TIM1) | PC6, PC7, PC8 (TIM8) |
//! | low sides a, b, c | PA11, PA12, PB9 | PC10, PC11, PB1 |
//! | shunts a, b, c | PA0, PA1, PA7 | PB14, PB0, PB13 |
//! | bus voltage | PC3 | PB15 |
//! | heat sink's temperature | PB11 | PC4 |
//! | gate driver: fault, low | PB10 (TIM1_BKIN) | PD2 (TIM8_BKIN) |
//! | gate driver: enable, high; pull-downs | PA4 | PC5 |
//! | encoder | PA5, PA6, PB5 (SPI1), PA15 (chip select by TIM2) | PB2, PC12, index PB12 (TIM5) |
//!
//! The table's scale is on PB6 and PB7 (TIM4). PA13 and PA14 are the debugger's, PF0 and PF1 the 24 MHz crystal's.
//!
//! All three phases are measured, so that a channel that is dead shows in their sum. The amplifiers are
//! outside the chip: of its own one reaches ADC3 and one ADC4, which sample the nut (`stm32g4xx-hal`, `adc/g4.rs` and `opamp.rs`, after
//! ST's tables), and a sum wants three that are alike. So the shunts are where the default board has them, and TIM1_CH3N is on PB9,
//! which leaves PB15 to the nut's bus.

use super::claimed::Claims;
use super::paper_machine;
use super::pins::{
    Bridge, EncoderParts, Pins, Ports, converted, driver_fault, encoder, framed_spi, index, serial,
};
use super::shunts::{self, Shunts};
use crate::hw::analog::{Sampling, WatchLimits};
use crate::hw::encoder::mt6835::{LEAD_S, Mt6835};
use crate::hw::encoder::{Flags, Incremental, InputFilter, TopOf};
use crate::hw::inputs::{Inputs, contact};
use crate::hw::outputs::{Level, Outputs, output};
use crate::hw::protection::{DriverFault, OverCurrent};
use control::guard::GuardConfig;
use stm32g4xx_hal::gpio::Pull;
use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC4, LPUART1, SPI1, TIM1, TIM2, TIM4, TIM5, TIM8};

#[path = "mains_plate.rs"]
mod plate;
pub(crate) use plate::GUARDS;
pub(crate) use plate::{PLATE, SETTINGS};

/// Comparators of each motor, one for each phase.
pub(crate) const OVER_CURRENT: [OverCurrent; 2] =
    shunts::over_current(&PLATE.board, plate::OVER_CURRENT_A);

/// The power stages' drivers pull their fault lines low.
const FAULT_LINE: DriverFault = DriverFault { level: Level::Low };
/// They are on the break pins.
pub(crate) const DRIVER_FAULT: Option<DriverFault> = Some(FAULT_LINE);

/// How long the drivers take to wake, s.
pub(crate) const DRIVER_WAKE_S: f64 = 1e-3;
/// Whether the current amplifiers sleep with the drivers: the amplifiers have the controller's supply.
pub(crate) const AMPLIFIERS_SLEEP: bool = false;

/// How long a fault must last until the bridge opens, s.
pub(crate) const BREAK_FILTER_S: f64 = 0.7e-6;

/// The guard's limits in counts.
pub(crate) const GUARD: GuardConfig = match GUARDS.config() {
    Ok(config) => config,
    Err(_) => panic!("a limit of the board is beyond its ADC"),
};

/// Limits of the analog watchdogs.
pub(crate) const WATCH_LIMITS: WatchLimits =
    shunts::watched(&PLATE.board, plate::WATCH_CURRENT_A, GUARD.bus_most);

/// The amplifiers' outputs have 2.2 nF behind a resistor, as the default board's.
const CURRENT_SAMPLING: Sampling = Sampling::of_at_least(250e-9);
/// The bus divider has 100 nF at the pin.
const BUS_SAMPLING: Sampling = Sampling::behind(100e-9);
/// The heat sink's divider has 100 nF at the pin.
const HEAT_SAMPLING: Sampling = Sampling::behind(100e-9);

// The number of the plate is that of the hardware.
const _: () = assert!((LEAD_S * 1e6 - plate::FRAME_LEAD_US).abs() < 1e-9);

/// What holds each input of the gate drivers low while the chip starts, ohm: a resistor at the power stage.
pub(crate) const GATE_PULL_DOWN_OHM: u32 = 10_000;

pub(crate) type ScrewEncoder = Mt6835;
pub(crate) type NutEncoder = Incremental<TIM5, true>;

/// Starts both motors' encoders.
pub(crate) fn start_encoders(parts: EncoderParts) -> (ScrewEncoder, NutEncoder) {
    let EncoderParts {
        tim2,
        tim5,
        spi1,
        dma,
        motors: [_, nut],
        period,
    } = parts;
    (
        Mt6835::start(spi1, tim2, dma, TopOf::Screw, period),
        Incremental::start(tim5, &nut.encoder, InputFilter::of_motor(nut), TopOf::Nut),
    )
}

/// What the encoders' timers saw since the last look: screw, nut.
pub(crate) fn take_encoder_flags() -> [Flags; 2] {
    // SAFETY: of this timer nobody else touches the flags.
    [Flags::default(), unsafe { Flags::take(&*TIM5::ptr()) }]
}

/// Puts every pin in its function and says where the measurements are. With a frame of its own: that of `init`
/// must not step over the stack's guard.
#[inline(never)]
pub(crate) fn claim(ports: Ports) -> Pins {
    let Ports { a, b, c, d } = ports;
    let mut claims = Claims::default();

    Bridge::<TIM1>::claim(
        &mut claims,
        (
            c.pc0.into_alternate::<2>(),
            c.pc1.into_alternate::<2>(),
            c.pc2.into_alternate::<2>(),
        ),
        (
            a.pa11.into_alternate::<6>(),
            a.pa12.into_alternate::<6>(),
            b.pb9.into_alternate::<12>(),
        ),
    );
    Bridge::<TIM8>::claim(
        &mut claims,
        (
            c.pc6.into_alternate::<4>(),
            c.pc7.into_alternate::<4>(),
            c.pc8.into_alternate::<4>(),
        ),
        (
            c.pc10.into_alternate::<4>(),
            c.pc11.into_alternate::<4>(),
            b.pb1.into_alternate::<4>(),
        ),
    );
    framed_spi::<SPI1, TIM2, _, _, _, _>(
        &mut claims,
        a.pa5.into_alternate::<5>(),
        // Without a sensor the line reads ones, which fail the frame's check.
        a.pa6.into_alternate::<5>().internal_resistor(Pull::Up),
        b.pb5.into_alternate::<5>(),
        a.pa15.into_alternate::<1>(),
    );
    encoder::<TIM5, _, _>(
        &mut claims,
        b.pb2.into_alternate::<2>(),
        c.pc12.into_alternate::<1>(),
    );
    index::<TIM5, _>(&mut claims, b.pb12.into_alternate::<2>());
    encoder::<TIM4, _, _>(
        &mut claims,
        b.pb6.into_alternate::<2>(),
        b.pb7.into_alternate::<2>(),
    );

    serial::<LPUART1, _, _>(a.pa2.into_alternate::<12>(), a.pa3.into_alternate::<12>());

    let fault_lines = [
        driver_fault::<TIM1, _>(&mut claims, b.pb10.into_alternate::<12>(), FAULT_LINE),
        driver_fault::<TIM8, _>(&mut claims, d.pd2.into_alternate::<4>(), FAULT_LINE),
    ];

    let shunts = Shunts {
        screw: (a.pa0, a.pa1, a.pa7),
        nut: (b.pb14, b.pb0, b.pb13),
        sampling: CURRENT_SAMPLING,
    };
    let channels = shunts.claim(
        [
            converted::<ADC1, _>(&c.pc3.into_analog(), BUS_SAMPLING),
            converted::<ADC4, _>(&b.pb15.into_analog(), BUS_SAMPLING),
        ],
        [
            converted::<ADC1, _>(&b.pb11.into_analog(), HEAT_SAMPLING),
            converted::<ADC2, _>(&c.pc4.into_analog(), HEAT_SAMPLING),
        ],
    );
    Pins {
        channels,
        fault_lines,
        claims,
        inputs: Inputs {
            enable: [contact(c.pc9), contact(a.pa9)],
            end_forward: contact(a.pa8),
            end_backward: contact(a.pa10),
        },
        outputs: Outputs {
            drivers: [
                Some(output(a.pa4, Level::High)),
                Some(output(c.pc5, Level::High)),
            ],
            ..Outputs::default()
        },
    }
}
