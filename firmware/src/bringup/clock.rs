//! Clocks and power as the drive has set them up, and the core's clock against the two oscillators inside the chip.
//!
//! TIM16 captures edges (RM0440 31.4.5; TI1SEL: MCO is 2, LSI is 6) at the core's clock. HSI16 goes there as MCO / 16, with
//! no pin taking part. HSI16 is trimmed to 1 % (DS12288, features): it tells a wrong crystal. LSI is 29.5 to 34 kHz (DS12288, LSI): it
//! says how far the watchdog's time is off.

use super::{pause, put, wait_until};
use link::bringup::{ClockReading, EDGES_A_CAPTURE, HSI_CAPTURES, LSI_CAPTURES};
use stm32g4xx_hal::stm32::{DBGMCU, FLASH, PWR, RCC, TIM16, rcc, tim16};

const TI1_MCO: u32 = 2;
const TI1_LSI: u32 = 6;

pub(super) fn read(words: &ClockReading) {
    // SAFETY: interrupts are masked and the drive's start is over: nobody else is at these registers.
    let (rcc, power, flash, timer) =
        unsafe { (&*RCC::ptr(), &*PWR::ptr(), &*FLASH::ptr(), &*TIM16::ptr()) };
    put(&words.apb1enr1, rcc.apb1enr1().read().bits());
    // Without its clock the power control reads as if all were well (boost mode is a 0).
    rcc.apb1enr1().modify(|_, w| w.pwren().set_bit());
    let _ = rcc.apb1enr1().read();
    put(&words.pwr_cr1, power.cr1().read().bits());
    put(&words.pwr_cr5, power.cr5().read().bits());
    put(&words.pwr_sr2, power.sr2().read().bits());
    put(&words.flash_acr, flash.acr().read().bits());
    put(&words.flash_optr, flash.optr().read().bits());
    // SAFETY: a register is read, which changes nothing.
    let debug = unsafe { &*DBGMCU::ptr() };
    put(&words.idcode, debug.idcode().read().bits());
    put(&words.rcc_cr, rcc.cr().read().bits());
    put(&words.rcc_cfgr, rcc.cfgr().read().bits());
    put(&words.rcc_pllcfgr, rcc.pllcfgr().read().bits());

    rcc.apb2enr().modify(|_, w| w.tim16en().set_bit());
    let _ = rcc.apb2enr().read();
    put(&words.hsi, hsi(rcc, timer));
    put(&words.lsi, lsi(rcc, timer));
}

/// HSI16 / 16 by MCO: 1 MHz.
fn hsi(rcc: &rcc::RegisterBlock, timer: &tim16::RegisterBlock) -> u32 {
    const LOOKS: u32 = 10_000;
    rcc.cr().modify(|_, w| w.hsion().set_bit());
    let there = wait_until(LOOKS, || rcc.cr().read().hsirdy().bit_is_set());
    rcc.cfgr().modify(|_, w| w.mcopre().div16().mcosel().hsi());
    let counts = captured(timer, TI1_MCO, HSI_CAPTURES);
    rcc.cfgr().modify(|_, w| w.mcosel().none());
    if there { counts } else { 0 }
}

fn lsi(rcc: &rcc::RegisterBlock, timer: &tim16::RegisterBlock) -> u32 {
    // It starts within 130 us, and is stable after 180 us (DS12288, LSI); a look is about ten cycles.
    const LOOKS: u32 = 10_000;
    const STABLE_US: u32 = 180;
    rcc.csr().modify(|_, w| w.lsion().set_bit());
    let there = wait_until(LOOKS, || rcc.csr().read().lsirdy().bit_is_set());
    pause(STABLE_US);
    let counts = captured(timer, TI1_LSI, LSI_CAPTURES);
    if there { counts } else { 0 }
}

/// Timer counts from the first capture to the last, `captures` later; 0 if one does not come.
fn captured(timer: &tim16::RegisterBlock, input: u32, captures: u32) -> u32 {
    // Longest wait: eight periods of LSI, 271 us or 46 100 cycles.
    const LOOKS: u32 = 20_000;
    const CC1IF: u32 = 1 << 1;
    const { assert!(EDGES_A_CAPTURE == 8) };
    // SAFETY: values of the fields (RM0440, TIMx_TISEL, CCMR1: CC1S 1, IC1PSC 3; CCER: CC1E; ARR; CR1: CEN).
    unsafe {
        timer.cr1().write(|w| w.bits(0));
        timer.ccer().write(|w| w.bits(0));
        timer.tisel().write(|w| w.bits(input));
        timer.ccmr1_input().write(|w| w.bits(1 | 3 << 2));
        timer.arr().write(|w| w.bits(0xFFFF));
        timer.ccer().write(|w| w.bits(1));
        timer.cr1().write(|w| w.bits(1));
        timer.sr().write(|w| w.bits(0));
    }
    let capture = || {
        // Reading the capture clears its flag.
        let there = wait_until(LOOKS, || timer.sr().read().bits() & CC1IF != 0);
        there.then(|| timer.ccr1().read().bits() & 0xFFFF)
    };
    let mut sum = 0u32;
    let mut last = capture();
    for _ in 0..captures {
        let (Some(before), Some(now)) = (last, capture()) else {
            return 0;
        };
        sum = sum.wrapping_add(now.wrapping_sub(before) & 0xFFFF);
        last = Some(now);
    }
    sum
}
