//! The digital pins that the board has claimed, for code that asks the board instead of driving it.

use link::bringup::{Owner, PINS, PinUse};
use stm32g4xx_hal::gpio::PinExt;
use stm32g4xx_hal::stm32::{TIM1, TIM2, TIM4, TIM5, TIM8};

/// One of them.
#[derive(Clone, Copy)]
pub(crate) struct Claimed {
    /// 0 is A.
    pub(crate) port: u8,
    pub(crate) pin: u8,
    pub(crate) function: PinUse,
    pub(crate) owner: Owner,
}

/// Whose a timer's pins are.
pub(crate) trait Owned {
    const OWNER: Owner;
}

impl Owned for TIM1 {
    const OWNER: Owner = Owner::Screw;
}
impl Owned for TIM2 {
    const OWNER: Owner = Owner::Screw;
}
impl Owned for TIM4 {
    const OWNER: Owner = Owner::Table;
}
impl Owned for TIM5 {
    const OWNER: Owner = Owner::Nut;
}
impl Owned for TIM8 {
    const OWNER: Owner = Owner::Nut;
}

/// In the order in which they were claimed.
#[derive(Default)]
pub(crate) struct Claims([Option<Claimed>; PINS]);

impl Claims {
    /// Remembers a pin of timer `T`. More than there is room for are not asked.
    pub(super) fn add<T: Owned>(&mut self, pin: &impl PinExt, function: PinUse) {
        if let Some(free) = self.0.iter_mut().find(|claimed| claimed.is_none()) {
            *free = Some(Claimed {
                port: pin.port_id(),
                pin: pin.pin_id(),
                function,
                owner: T::OWNER,
            });
        }
    }

    /// All of them.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Claimed> + Clone {
        self.0.iter().copied().flatten()
    }
}
