//! NUCLEO-G474RE (MB1367) with a BOOSTXL-DRV8323RH for each motor, 24 to 48 V.
//!
//! Which pin goes where, with what between, and how it is first switched on: `firmware/boards/nucleo_g474re.md`, whose
//! table of pins a test holds to this file.
//!
//! Each pin goes into `Pins` once, by value, behind a bound that only the right pin in the right alternate function
//! meets: a pin used twice, or with a wrong function, does not compile.

use super::claimed::Claims;
use super::paper_machine;
use super::pins::{Bridge, EncoderParts, Pins, Ports, converted, driver_fault, encoder, serial};
use super::shunts::{self, Shunts};
use crate::hw::analog::{Sampling, WatchLimits};
use crate::hw::encoder::{Flags, Incremental, InputFilter, TopOf};
use crate::hw::inputs::{Inputs, contact};
use crate::hw::outputs::{Level, Outputs, output};
use crate::hw::protection::{DriverFault, OverCurrent};
use control::guard::GuardConfig;
use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC4, LPUART1, TIM1, TIM2, TIM4, TIM5, TIM8};

#[path = "nucleo_plate.rs"]
mod plate;
pub(crate) use plate::GUARDS;
#[cfg(not(feature = "pwm-40khz"))]
pub(crate) use plate::PLATE;
#[cfg(feature = "pwm-40khz")]
pub(crate) use plate::PLATE_40_KHZ as PLATE;
pub(crate) use plate::SETTINGS;

/// Comparators of each motor, one for each phase.
pub(crate) const OVER_CURRENT: [OverCurrent; 2] =
    shunts::over_current(&PLATE.board, plate::OVER_CURRENT_A);

/// The power stages' drivers pull their fault lines low.
const FAULT_LINE: DriverFault = DriverFault { level: Level::Low };
/// They are on the break pins.
pub(crate) const DRIVER_FAULT: Option<DriverFault> = Some(FAULT_LINE);

/// How long the drivers take to wake, s: the wiring page's source 6.
pub(crate) const DRIVER_WAKE_S: f64 = 1e-3;
/// Whether the current amplifiers sleep with the drivers: the amplifiers are the drivers' own.
pub(crate) const AMPLIFIERS_SLEEP: bool = true;

/// How long a fault must last until the bridge opens, s: the edges ring for some hundred nanoseconds.
pub(crate) const BREAK_FILTER_S: f64 = 0.7e-6;

/// The guard's limits in counts.
pub(crate) const GUARD: GuardConfig = match GUARDS.config() {
    Ok(config) => config,
    Err(_) => panic!("a limit of the board is beyond its ADC"),
};

/// Limits of the analog watchdogs.
pub(crate) const WATCH_LIMITS: WatchLimits =
    shunts::watched(&PLATE.board, plate::WATCH_CURRENT_A, GUARD.bus_most);

/// The amplifiers' outputs have 2.2 nF behind a resistor: what the sampling takes of it is the same in each period, and in
/// the measured zeros too, once most of it is given back.
const CURRENT_SAMPLING: Sampling = Sampling::of_at_least(250e-9);
/// The power stages have 47 nF behind their bus dividers, which also keeps the bus watchdog from tripping on the bridges'
/// edges: 680 Hz.
const BUS_SAMPLING: Sampling = Sampling::behind(47e-9);
/// The thermistors' dividers have 100 nF at the pin.
const HEAT_SAMPLING: Sampling = Sampling::behind(100e-9);

/// What the stages put to ground at each input of their gate drivers beside the driver's own 100 kohm, ohm: nothing (the
/// wiring page, pull-downs).
pub(crate) const GATE_PULL_DOWN_OHM: u32 = 0;

pub(crate) type ScrewEncoder = Incremental<TIM2, false>;
pub(crate) type NutEncoder = Incremental<TIM5, false>;

/// Starts both motors' encoders. Neither index is wired: its timers' index pins serve as encoder and bus inputs.
pub(crate) fn start_encoders(parts: EncoderParts) -> (ScrewEncoder, NutEncoder) {
    let [screw, nut] = parts.motors;
    (
        Incremental::start(
            parts.tim2,
            &screw.encoder,
            InputFilter::of_motor(screw),
            TopOf::Screw,
        ),
        Incremental::start(
            parts.tim5,
            &nut.encoder,
            InputFilter::of_motor(nut),
            TopOf::Nut,
        ),
    )
}

/// What the encoders' timers saw since the last look: screw, nut.
pub(crate) fn take_encoder_flags() -> [Flags; 2] {
    // SAFETY: of these timers nobody else touches the flags.
    unsafe { [Flags::take(&*TIM2::ptr()), Flags::take(&*TIM5::ptr())] }
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
        &mut claims,
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
    encoder::<TIM2, _, _>(
        &mut claims,
        a.pa15.into_alternate::<1>(),
        b.pb3.into_alternate::<1>(),
    );
    encoder::<TIM5, _, _>(
        &mut claims,
        b.pb2.into_alternate::<2>(),
        c.pc12.into_alternate::<1>(),
    );
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
            converted::<ADC1, _>(&c.pc0.into_analog(), BUS_SAMPLING),
            converted::<ADC4, _>(&b.pb12.into_analog(), BUS_SAMPLING),
        ],
        [
            converted::<ADC1, _>(&c.pc1.into_analog(), HEAT_SAMPLING),
            converted::<ADC2, _>(&c.pc2.into_analog(), HEAT_SAMPLING),
        ],
    );
    Pins {
        channels,
        fault_lines,
        claims,
        inputs: Inputs {
            enable: [contact(c.pc9), contact(c.pc4)],
            end_forward: contact(b.pb9),
            end_backward: contact(b.pb11),
        },
        outputs: Outputs {
            drivers: [
                Some(output(a.pa4, Level::High)),
                Some(output(c.pc5, Level::High)),
            ],
            brake: Some(output(b.pb1, Level::High)),
            ..Outputs::default()
        },
    }
}
