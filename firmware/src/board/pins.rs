//! Bounds that a board's pins must meet: what does not fit its peripheral does not compile.

use super::claimed::{Owned, claim};
use crate::hw::amplifier::Amplifier;
use crate::hw::analog::Channels;
use core::marker::PhantomData;
use embedded_hal_02::adc::Channel;
use link::bringup::PinUse;
use stm32g4xx_hal::adc::Ad;
use stm32g4xx_hal::comparator::PositiveInput;
use stm32g4xx_hal::gpio::{AF2, PinExt, gpioa, gpiob, gpioc};
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

impl<T: Owned> Bridge<T> {
    /// Takes the high sides and the low sides of phases a, b, c.
    pub(crate) fn claim<A, B, C, AN, BN, CN>(high: (A, B, C), low: (AN, BN, CN))
    where
        A: TimerPin<T, C1, ComplementaryDisabled> + PinExt,
        B: TimerPin<T, C2, ComplementaryDisabled> + PinExt,
        C: TimerPin<T, C3, ComplementaryDisabled> + PinExt,
        AN: NPins<T, C1> + PinExt,
        BN: NPins<T, C2> + PinExt,
        CN: NPins<T, C3> + PinExt,
    {
        claim::<T>(&high.0, PinUse::HighA);
        claim::<T>(&high.1, PinUse::HighB);
        claim::<T>(&high.2, PinUse::HighC);
        claim::<T>(&low.0, PinUse::LowA);
        claim::<T>(&low.1, PinUse::LowB);
        claim::<T>(&low.2, PinUse::LowC);
    }
}

/// Takes channels A and B of an encoder on timer `T`.
pub(crate) fn encoder<T: Owned, A, B>(a: A, b: B)
where
    A: TimerPin<T, C1, ComplementaryImpossible> + PinExt,
    B: TimerPin<T, C2, ComplementaryImpossible> + PinExt,
{
    claim::<T>(&a, PinUse::EncoderA);
    claim::<T>(&b, PinUse::EncoderB);
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
pub(crate) fn index<T: Owned, I: IndexPin<T> + PinExt>(index: I) {
    claim::<T>(&index, PinUse::Index);
}

/// Takes the pins of a sensor on `S`, whose chip select channel 1 of timer `T` makes.
#[allow(dead_code, reason = "not every board has one")]
pub(crate) fn framed_spi<S, T: Owned, K, I, O, N>(sck: K, miso: I, mosi: O, select: N)
where
    K: PinSck<S> + PinExt,
    I: PinMiso<S> + PinExt,
    O: PinMosi<S> + PinExt,
    N: TimerPin<T, C1, ComplementaryImpossible> + PinExt,
{
    claim::<T>(&sck, PinUse::Clock);
    claim::<T>(&miso, PinUse::DataIn);
    claim::<T>(&mosi, PinUse::DataOut);
    claim::<T>(&select, PinUse::Select);
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
