//! The digital pins that the board has claimed, for code that asks the board instead of driving it.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
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

/// In the order in which they were claimed, one byte each: owner, function, port, pin; 0: none.
static CLAIMED: [AtomicU32; PINS] = [const { AtomicU32::new(0) }; PINS];

/// Remembers a pin of timer `T`. More than there is room for are not asked.
pub(super) fn claim<T: Owned>(pin: &impl PinExt, function: PinUse) {
    let bytes = [pin.pin_id(), pin.port_id(), function as u8, T::OWNER as u8];
    if let Some(free) = CLAIMED.iter().find(|word| word.load(Relaxed) == 0) {
        free.store(u32::from_le_bytes(bytes), Relaxed);
    }
}

/// All of them.
pub(crate) fn claimed() -> impl Iterator<Item = Claimed> + Clone {
    CLAIMED.iter().filter_map(|word| {
        let [pin, port, function, owner] = word.load(Relaxed).to_le_bytes();
        Some(Claimed {
            port,
            pin,
            function: PinUse::of_word(function.into())?,
            owner: Owner::of_word(owner.into())?,
        })
    })
}
