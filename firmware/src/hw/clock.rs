//! Clocks: 170 MHz from the board's crystal, flash accelerator on, and the clocks of the peripherals in use.

use stm32g4xx_hal::pwr::{PwrExt, VoltageScale};
use stm32g4xx_hal::rcc::{Config, PllConfig, PllMDiv, PllNMul, PllRDiv, PllSrc, Rcc, RccExt};
use stm32g4xx_hal::stm32::{FLASH, PWR, RCC};
use stm32g4xx_hal::time::RateExtU32;

/// Core and timer clock, Hz.
pub(crate) const CORE_HZ: u32 = 170_000_000;
/// The board's crystal, Hz.
pub(crate) const CRYSTAL_HZ: u32 = 24_000_000;

/// Runs the core and all buses at [`CORE_HZ`] from a 24 MHz crystal: 24 / 6 * 85 / 2.
pub(crate) fn start(rcc: RCC, pwr: PWR, flash: &FLASH) -> Rcc {
    let boost = pwr
        .constrain()
        .vos(VoltageScale::Range1 { enable_boost: true })
        .freeze();
    let pll = PllConfig {
        mux: PllSrc::HSE(CRYSTAL_HZ.Hz()),
        m: PllMDiv::DIV_6,
        n: PllNMul::MUL_85,
        r: Some(PllRDiv::DIV_2),
        q: None,
        p: None,
    };
    let rcc = rcc.freeze(Config::pll().pll_cfg(pll), boost);
    // RM0440 5.3.4: prefetch helps where the caches miss; both caches are on after reset, the prefetch is not.
    flash
        .acr()
        .modify(|_, w| w.prften().set_bit().icen().set_bit().dcen().set_bit());
    rcc
}

/// Clocks of what this firmware uses and the HAL does not switch on.
pub(crate) fn enable_peripherals(rcc: &Rcc) {
    rcc.ahb1enr()
        .modify(|_, w| w.dma1en().set_bit().dmamux1en().set_bit());
    rcc.ahb2enr().modify(|_, w| {
        w.adc12en()
            .set_bit()
            .adc345en()
            .set_bit()
            .dac3en()
            .set_bit()
            .dac4en()
            .set_bit()
    });
    rcc.apb1enr1().modify(|_, w| {
        w.tim2en()
            .set_bit()
            .tim4en()
            .set_bit()
            .tim5en()
            .set_bit()
            .tim7en()
            .set_bit()
    });
    rcc.apb2enr().modify(|_, w| {
        w.tim1en()
            .set_bit()
            .tim8en()
            .set_bit()
            .spi1en()
            .set_bit()
            .syscfgen()
            .set_bit()
    });
    // RM0440 7.2.17: a peripheral may be accessed two clock cycles after its enable bit; a read back takes that.
    let _ = rcc.apb2enr().read();
}
