//! Supply and clocks: 170 MHz from the board's crystal in boost mode, watched by the clock security system; flash
//! accelerator on; and the clocks of the peripherals in use.
//!
//! What a clock or a supply that fails does, without an instruction of the drive:
//!
//! | what | by | what happens |
//! | --- | --- | --- |
//! | crystal stops | clock security system (RM0440 7.2.10) | breaks TIM1 and TIM8, runs on from the HSI, NMI |
//! | supply below 2.9 V | PVD with its lock (RM0440 6.2.2, SYSCFG_CFGR2.PVDL) | breaks TIM1 and TIM8 |
//! | supply below 2.8 V | brown-out reset level 4, an option byte (RM0440 6.2.3) | reset: all pins released |
//! | flash or RAM with a wrong bit | ECC and parity locks (SYSCFG_CFGR2.ECCL, SPL) | breaks TIM1 and TIM8, NMI |

use crate::crash;
use crate::hw::flash::two_banks;
use stm32g4xx_hal::pwr::{PwrExt, VoltageScale};
use stm32g4xx_hal::rcc::{
    Config, PllConfig, PllMDiv, PllNMul, PllPDiv, PllRDiv, PllSrc, Rcc, RccExt,
};
use stm32g4xx_hal::signature::FlashSize;
use stm32g4xx_hal::stm32::{DBGMCU, FLASH, PWR, RCC};
use stm32g4xx_hal::time::RateExtU32;

/// Core and timer clock, Hz.
pub(crate) const CORE_HZ: u32 = 170_000_000;
/// The ADCs' clock, Hz: the PLL's P output, undivided; see [`crate::hw::analog`].
pub(crate) const ADC_HZ: u32 = CORE_HZ / 4;
/// The board's crystal, Hz.
pub(crate) const CRYSTAL_HZ: u32 = 24_000_000;

/// Runs the core and all buses at [`CORE_HZ`] from the crystal: 24 / 6 * 85 / 2.
///
/// Refuses to start if the crystal does not, or if the regulator is not in boost mode, without which 170 MHz are not
/// allowed (RM0440 6.1.5: range 1 normal ends at 150 MHz).
pub(crate) fn start(rcc: RCC, pwr: PWR, flash: &FLASH) -> Rcc {
    // PWR's registers have a clock of their own, which reset leaves off (RM0440 7.4.19, APB1ENR1.PWREN); a write without
    // it is lost. The read back takes the two cycles until it runs.
    rcc.apb1enr1().modify(|_, w| w.pwren().set_bit());
    let _ = rcc.apb1enr1().read();
    // UCPD1's dead-battery pull-downs load PB4 and PB6 while PA10 and PA9 are high (RM0440 6.4.3, PWR_CR3.UCPD1_DBDIS).
    pwr.cr3().modify(|_, w| w.ucpd1_dbdis().set_bit());
    // PVD level 6, 2.9 V falling (DS12288 Rev 6: 2.84 to 2.96 V).
    // SAFETY: a value of the field (RM0440 6.4.2, PWR_CR2.PVDLS).
    pwr.cr2()
        .modify(|_, w| unsafe { w.pvdls().bits(6).pvde().set_bit() });

    rcc.cr().modify(|_, w| w.hseon().set_bit());
    // A crystal of 8 MHz takes 2 ms, typically (DS12288 Rev 6, HSE; no maximum is given); this is 60 ms and more at the HSI's 16 MHz.
    const LOOKS: u32 = 200_000;
    let starts = (0..LOOKS).any(|_| rcc.cr().read().hserdy().bit_is_set());
    if !starts {
        crash::refuse("the crystal does not start: check the board's 24 MHz and its capacitors");
    }

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
        // 340 MHz by 8: the ADCs'.
        p: Some(PllPDiv::DIV_8),
    };
    let rcc = rcc.freeze(Config::pll().pll_cfg(pll), boost);
    if !boosted() {
        crash::refuse("the core's regulator is not in boost mode, which 170 MHz need: R1MODE is 1");
    }
    // From here on a crystal that stops opens both bridges in hardware and raises the NMI.
    rcc.cr().modify(|_, w| w.csson().set_bit());
    // RM0440 5.3.4: prefetch helps where the caches miss; both caches are on after reset, the prefetch is not.
    flash
        .acr()
        .modify(|_, w| w.prften().set_bit().icen().set_bit().dcen().set_bit());
    rcc
}

/// The regulator is in range 1, boost mode (RM0440 6.4.15, PWR_CR5.R1MODE is 0).
pub(crate) fn boosted() -> bool {
    const RANGE_1: u8 = 1;
    // SAFETY: registers are read, which changes nothing.
    let pwr = unsafe { &*PWR::ptr() };
    pwr.cr1().read().vos().bits() == RANGE_1 && pwr.cr5().read().r1mode().bit_is_clear()
}

/// Has the crystal failed? Cleared by this look.
pub(crate) fn crystal_failed() -> bool {
    // SAFETY: a flag is read, and cleared by writing one.
    let rcc = unsafe { &*RCC::ptr() };
    let failed = rcc.cifr().read().cssf().bit_is_set();
    rcc.cicr().write(|w| w.cssc().set_bit());
    failed
}

/// Says what the option bytes leave open (RM0440 3.7.8, FLASH_OPTR), each with the word that `STM32_Programmer_CLI -c port=SWD -ob` sets
/// it by: they are the chip's, not the firmware's.
pub(crate) fn report_option_bytes(flash: &FLASH) {
    const BROWN_OUT_LEVEL_4: u8 = 4;
    let options = flash.optr().read();
    let level = options.bor_lev().bits();
    if level != BROWN_OUT_LEVEL_4 {
        defmt::warn!(
            "brown-out level {=u8}, not 4: below 2.8 V the pins are undefined; set the option bytes by `-ob BOR_LEV=4`",
            level
        );
    }
    // 0: the check is on.
    if options.sram2_pe().bit_is_set() {
        defmt::warn!("SRAM parity is not checked; set the option bytes by `-ob SRAM_PE=0`");
    }
    if options.n_swboot0().bit_is_set() {
        defmt::warn!(
            "PB8 picks what boots: pull it down, or set the option bytes by `-ob nSWBOOT0=0 nBOOT0=1`"
        );
    }
    if !two_banks() {
        defmt::warn!(
            "the flash has {=u16} KB in one bank, not 512 in two: settings cannot be stored; set `-ob DBANK=1`, or take an STM32G474RE",
            FlashSize::get().kilo_bytes()
        );
    }
}

/// The chip's silicon revision, on which the errata depend (RM0440, DBGMCU_IDCODE.REV_ID).
pub(crate) fn revision(debug: &DBGMCU) -> u16 {
    debug.idcode().read().rev_id().bits()
}

/// Clocks of what this firmware uses and the HAL does not switch on.
pub(crate) fn enable_peripherals(rcc: &Rcc) {
    rcc.ahb1enr()
        .modify(|_, w| w.dma1en().set_bit().dmamux1en().set_bit());
    // The PLL's P output (RM0440, RCC_CCIPR.ADC12SEL and ADC345SEL).
    const PLL_P: u8 = 1;
    // SAFETY: a value of the fields.
    rcc.ccipr()
        .modify(|_, w| unsafe { w.adc12sel().bits(PLL_P).adc345sel().bits(PLL_P) });
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
    rcc.apb1enr2().modify(|_, w| w.lpuart1en().set_bit());
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
