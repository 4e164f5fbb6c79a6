//! Bounds that a board's pins must meet: what does not fit its peripheral does not compile.

use super::claimed::{Claims, Owned};
use crate::hw::analog::{Channels, Input, Sampling};
use crate::hw::inputs::{FaultLine, Inputs};
use crate::hw::outputs::{Level, Outputs};
use crate::hw::protection::DriverFault;
use control::plate::MotorPlate;
use core::marker::PhantomData;
use embedded_hal_02::adc::Channel;
use link::bringup::PinUse;
use stm32g4xx_hal::adc::Ad;
use stm32g4xx_hal::comparator::PositiveInput;
use stm32g4xx_hal::gpio::{
    AF2, GpioExt, PinExt, PinPull, PinSpeed, Pull, Speed, gpioa, gpiob, gpioc, gpiod,
};
use stm32g4xx_hal::pwm::{
    C1, C2, C3, ComplementaryDisabled, ComplementaryImpossible, FaultPins, NPins, Pins as TimerPin,
};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::serial::{RxPin, TxPin};
use stm32g4xx_hal::spi::{PinMiso, PinMosi, PinSck};
use stm32g4xx_hal::stm32::{DMA1, DMAMUX, GPIOA, GPIOB, GPIOC, GPIOD, SPI1, TIM2, TIM5};

/// The pins of the ports that come out of the 64-pin package.
pub(crate) struct Ports {
    pub(crate) a: gpioa::Parts,
    pub(crate) b: gpiob::Parts,
    pub(crate) c: gpioc::Parts,
    /// Of which that package has PD2 alone.
    pub(crate) d: gpiod::Parts,
}

impl Ports {
    /// With their clocks on.
    pub(crate) fn split((a, b, c, d): (GPIOA, GPIOB, GPIOC, GPIOD), rcc: &mut Rcc) -> Self {
        Self {
            a: a.split(rcc),
            b: b.split(rcc),
            c: c.split(rcc),
            d: d.split(rcc),
        }
    }
}

/// What a board's pins carry.
pub(crate) struct Pins {
    /// The ADC channels that the measurements are on: ADC1 to ADC4.
    pub(crate) channels: [Channels; 4],
    /// What it switches.
    pub(crate) outputs: Outputs,
    /// Its contacts.
    pub(crate) inputs: Inputs,
    /// The gate drivers' fault lines: screw, nut.
    pub(crate) fault_lines: [FaultLine; 2],
    /// Those that a bring-up asks.
    pub(crate) claims: Claims,
}

/// What a board's motor encoders may be made of.
#[allow(dead_code, reason = "a board takes what its encoders need")]
pub(crate) struct EncoderParts<'a> {
    pub(crate) tim2: TIM2,
    pub(crate) tim5: TIM5,
    pub(crate) spi1: SPI1,
    pub(crate) dma: (&'a DMA1, &'a DMAMUX),
    /// The motors that they are on.
    pub(crate) motors: &'a [MotorPlate; 2],
    /// PWM period, timer counts.
    pub(crate) period: u32,
}

/// The six outputs of the bridge on timer `T`.
pub(crate) struct Bridge<T>(PhantomData<T>);

impl<T: Owned> Bridge<T> {
    /// Takes the high sides and the low sides of phases a, b, c. Their edges are those of a pin of medium speed: a gate
    /// driver's input threshold is passed in 10 ns instead of 25 and more (DS12288 Rev 6, I/O AC characteristics), and
    /// the dead time is what the timer makes it.
    pub(crate) fn claim<A, B, C, AN, BN, CN>(
        claims: &mut Claims,
        (a, b, c): (A, B, C),
        (an, bn, cn): (AN, BN, CN),
    ) where
        A: TimerPin<T, C1, ComplementaryDisabled> + PinExt + PinSpeed,
        B: TimerPin<T, C2, ComplementaryDisabled> + PinExt + PinSpeed,
        C: TimerPin<T, C3, ComplementaryDisabled> + PinExt + PinSpeed,
        AN: NPins<T, C1> + PinExt + PinSpeed,
        BN: NPins<T, C2> + PinExt + PinSpeed,
        CN: NPins<T, C3> + PinExt + PinSpeed,
    {
        claims.add::<T>(&a.speed(Speed::Medium), PinUse::HighA);
        claims.add::<T>(&b.speed(Speed::Medium), PinUse::HighB);
        claims.add::<T>(&c.speed(Speed::Medium), PinUse::HighC);
        claims.add::<T>(&an.speed(Speed::Medium), PinUse::LowA);
        claims.add::<T>(&bn.speed(Speed::Medium), PinUse::LowB);
        claims.add::<T>(&cn.speed(Speed::Medium), PinUse::LowC);
    }
}

/// Takes channels A and B of an encoder on timer `T`.
pub(crate) fn encoder<T: Owned, A, B>(claims: &mut Claims, a: A, b: B)
where
    A: TimerPin<T, C1, ComplementaryImpossible> + PinExt,
    B: TimerPin<T, C2, ComplementaryImpossible> + PinExt,
{
    claims.add::<T>(&a, PinUse::EncoderA);
    claims.add::<T>(&b, PinUse::EncoderB);
}

/// Checks that a shunt's pin is the non-inverting input of comparator `C`.
pub(crate) fn comparator<C, P: PositiveInput<C>>(_pin: &P) {}

/// The channel that a pin is on `A`, sampled for as long as what stands before it needs.
pub(crate) fn converted<A, P: Channel<Ad<A>, ID = u8>>(_pin: &P, sampling: Sampling) -> Input {
    Input {
        channel: P::channel(),
        sampling,
    }
}

/// Takes the pin of a gate driver's fault output, on the break input of timer `T`. The pull holds an open line at the level
/// that is not a fault; a driver's output is an open drain.
pub(crate) fn driver_fault<T: Owned, P>(
    claims: &mut Claims,
    pin: P,
    fault: DriverFault,
) -> FaultLine
where
    P: FaultPins<T> + PinExt + PinPull,
{
    let pull = match fault.level {
        Level::Low => Pull::Up,
        Level::High => Pull::Down,
    };
    let pin = pin.internal_resistor(pull);
    claims.add::<T>(&pin, PinUse::Fault);
    FaultLine::at(&pin, fault)
}

/// Takes the pins of the serial port `U`: sends, receives. The pull-up holds an open line at rest; edges of a few megabits need
/// more than the lowest speed's 5 MHz at 50 pF (DS12288 Rev 6, I/O AC characteristics).
pub(crate) fn serial<U, T, R>(sends: T, receives: R)
where
    T: TxPin<U> + PinSpeed,
    R: RxPin<U> + PinPull,
{
    let _ = sends.speed(Speed::Medium);
    let _ = receives.internal_resistor(Pull::Up);
}

/// A pin that carries the index of the encoder on timer `T`.
pub(crate) trait IndexPin<T> {}
// TIM5_ETR (datasheet, alternate functions).
impl IndexPin<TIM5> for gpiob::PB12<AF2> {}

/// Takes the index of an encoder on timer `T`.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn index<T: Owned, I: IndexPin<T> + PinExt>(claims: &mut Claims, index: I) {
    claims.add::<T>(&index, PinUse::Index);
}

/// Takes the pins of a sensor on `S`, whose chip select channel 1 of timer `T` makes.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn framed_spi<S, T: Owned, K, I, O, N>(
    claims: &mut Claims,
    sck: K,
    miso: I,
    mosi: O,
    select: N,
) where
    K: PinSck<S> + PinExt + PinSpeed,
    I: PinMiso<S> + PinExt,
    O: PinMosi<S> + PinExt + PinSpeed,
    N: TimerPin<T, C1, ComplementaryImpossible> + PinExt + PinSpeed,
{
    // A clock of 10.6 MHz is beyond the lowest speed's 5 MHz at 50 pF (DS12288 Rev 6, I/O AC characteristics).
    claims.add::<T>(&sck.speed(Speed::High), PinUse::Clock);
    claims.add::<T>(&miso, PinUse::DataIn);
    claims.add::<T>(&mosi.speed(Speed::High), PinUse::DataOut);
    claims.add::<T>(&select.speed(Speed::High), PinUse::Select);
}
