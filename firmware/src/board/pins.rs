//! Bounds that a board's pins must meet: what does not fit its peripheral does not compile.

use crate::hw::amplifier::Amplifier;
use crate::hw::analog::Channels;
use core::marker::PhantomData;
use embedded_hal_02::adc::Channel;
use stm32g4xx_hal::adc::Ad;
use stm32g4xx_hal::comparator::PositiveInput;
use stm32g4xx_hal::gpio::{AF2, gpioa, gpiob, gpioc};
use stm32g4xx_hal::opamp::NonInverting;
use stm32g4xx_hal::pwm::{
    C1, C2, C3, ComplementaryDisabled, ComplementaryImpossible, NPins, Pins as TimerPin,
};
use stm32g4xx_hal::spi::{PinMiso, PinMosi, PinSck};
use stm32g4xx_hal::stm32::{DMA1, DMAMUX, SPI1, TIM2, TIM5};

/// The pins of the ports that come out of the 64-pin package.
pub(crate) struct Ports {
    pub(crate) a: gpioa::Parts,
    pub(crate) b: gpiob::Parts,
    pub(crate) c: gpioc::Parts,
}

/// What a board's pins carry.
pub(crate) struct Pins {
    /// The ADC channels that the measurements are on: ADC1 to ADC4.
    pub(crate) channels: [Channels; 4],
    /// The on-chip amplifiers before them.
    pub(crate) amplifiers: [Option<Amplifier>; 4],
}

/// What a board's motor encoders may be made of.
#[allow(dead_code, reason = "a board takes what its encoders need")]
pub(crate) struct EncoderParts<'a> {
    pub(crate) tim2: TIM2,
    pub(crate) tim5: TIM5,
    pub(crate) spi1: SPI1,
    pub(crate) dma: (&'a DMA1, &'a DMAMUX),
    /// PWM period, timer counts.
    pub(crate) period: u32,
}

/// The six outputs of the bridge on timer `T`.
pub(crate) struct Bridge<T>(PhantomData<T>);

impl<T> Bridge<T> {
    /// Takes the high sides and the low sides of phases a, b, c.
    pub(crate) fn claim<A, B, C, AN, BN, CN>(_high: (A, B, C), _low: (AN, BN, CN))
    where
        A: TimerPin<T, C1, ComplementaryDisabled>,
        B: TimerPin<T, C2, ComplementaryDisabled>,
        C: TimerPin<T, C3, ComplementaryDisabled>,
        AN: NPins<T, C1>,
        BN: NPins<T, C2>,
        CN: NPins<T, C3>,
    {
    }
}

/// Takes channels A and B of an encoder on timer `T`.
pub(crate) fn encoder<T, A, B>(_a: A, _b: B)
where
    A: TimerPin<T, C1, ComplementaryImpossible>,
    B: TimerPin<T, C2, ComplementaryImpossible>,
{
}

/// Checks that a shunt's pin is the non-inverting input of comparator `C`.
pub(crate) fn comparator<C, P: PositiveInput<C>>(_pin: &P) {}

/// The channel that a pin is on `A`.
pub(crate) fn converted<A, P: Channel<Ad<A>, ID = u8>>(_pin: &P) -> u8 {
    P::channel()
}

/// A pin that carries the index of the encoder on timer `T`.
pub(crate) trait IndexPin<T> {}
// TIM5_ETR (datasheet, alternate functions).
impl IndexPin<TIM5> for gpiob::PB12<AF2> {}

/// Takes the index of an encoder on timer `T`.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn index<T, I: IndexPin<T>>(_index: I) {}

/// Takes the pins of a sensor on `S`, whose chip select channel 1 of timer `T` makes.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn framed_spi<S, T, K, I, O, N>(_sck: K, _miso: I, _mosi: O, _select: N)
where
    K: PinSck<S>,
    I: PinMiso<S>,
    O: PinMosi<S>,
    N: TimerPin<T, C1, ComplementaryImpossible>,
{
}

/// The amplifier `O`, number `number`, with this pin as its non-inverting input.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn amplified<O, P>(_pin: &P, number: usize) -> Amplifier
where
    P: NonInverting<O>,
    P::VP_SEL: Into<u8>,
{
    Amplifier {
        number,
        input: P::VP_SEL.into(),
    }
}

/// The channel that an amplifier's output is on `A`, inside the chip.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn converted_output<A, O: Channel<Ad<A>, ID = u8>>() -> u8 {
    O::channel()
}
