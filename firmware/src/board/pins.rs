//! Bounds that a board's pins must meet: what does not fit its peripheral does not compile.

use core::marker::PhantomData;
use embedded_hal_02::adc::Channel;
use stm32g4xx_hal::adc::Ad;
use stm32g4xx_hal::comparator::PositiveInput;
use stm32g4xx_hal::gpio::{gpioa, gpiob, gpioc};
use stm32g4xx_hal::pwm::{C1, C2, C3, ComplementaryDisabled, ComplementaryImpossible, NPins, Pins};

/// The pins of the ports that come out of the 64-pin package.
pub(crate) struct Ports {
    pub(crate) a: gpioa::Parts,
    pub(crate) b: gpiob::Parts,
    pub(crate) c: gpioc::Parts,
}

/// The six outputs of the bridge on timer `T`.
pub(crate) struct Bridge<T>(PhantomData<T>);

impl<T> Bridge<T> {
    /// Takes the high sides and the low sides of phases a, b, c.
    pub(crate) fn claim<A, B, C, AN, BN, CN>(_high: (A, B, C), _low: (AN, BN, CN))
    where
        A: Pins<T, C1, ComplementaryDisabled>,
        B: Pins<T, C2, ComplementaryDisabled>,
        C: Pins<T, C3, ComplementaryDisabled>,
        AN: NPins<T, C1>,
        BN: NPins<T, C2>,
        CN: NPins<T, C3>,
    {
    }
}

/// Takes channels A and B of an encoder on timer `T`.
pub(crate) fn encoder<T, A, B>(_a: A, _b: B)
where
    A: Pins<T, C1, ComplementaryImpossible>,
    B: Pins<T, C2, ComplementaryImpossible>,
{
}

/// Checks that a shunt's pin is the non-inverting input of comparator `C`.
pub(crate) fn comparator<C, P: PositiveInput<C>>(_pin: &P) {}

/// The channel that a pin is on `A`.
pub(crate) fn converted<A, P: Channel<Ad<A>, ID = u8>>(_pin: &P) -> u8 {
    P::channel()
}
