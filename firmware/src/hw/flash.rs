//! The flash's controller: pages of the second bank are erased, and their double words programmed, while the core goes on in the
//! first, where all lies that interrupts call (RM0440 3.3.5 to 3.3.8; `memory.x`).
//!
//! A page takes 22 ms, at most 24.5, to erase, a double word 82 us, at most 83.4, to program (DS12288, flash memory
//! characteristics). With one bank (option byte DBANK 0) each fetch would wait for that, longer than the watchdog does:
//! there is no store then.
//!
//! A double word that lost power while it was programmed may have two wrong bits, which raise the NMI when it is read (RM0440
//! 3.3.8, FLASH_ECCR.ECCD). What FLASH_ECCR then says of bank and address may be wrong (ES0430 2.2.3, quoted by others). So
//! [`forgive_torn`] asks who reads, not that register.

use core::sync::atomic::{AtomicBool, Ordering::Relaxed};
use cortex_m::asm;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use link::settings::store::{PAGE, PAGES};
use stm32g4xx_hal::signature::FlashSize;
use stm32g4xx_hal::stm32::{FLASH, flash as registers};

const BANK_2: u32 = 0x0804_0000;
/// The settings' pages, below the bring-up's two.
const FIRST: u32 = 0x0808_0000 - (2 + PAGES as u32) * PAGE as u32;

const DBANK: u32 = 1 << 22;
const BSY: u32 = 1 << 16;
/// All errors of FLASH_SR and EOP, cleared by writing one.
const CLEAR: u32 = 0xC3FB;
/// The errors alone.
pub(crate) const ERRORS: u32 = CLEAR & !1;
const PG: u32 = 1;
const PER: u32 = 1 << 1;
const SECOND_BANK: u32 = 1 << 11;
const START: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;

/// The settings' pages are being read. A static, as the next: the NMI's handler is outside of RTIC.
static READING: AtomicBool = AtomicBool::new(false);
/// A double word with wrong bits was read since this was last cleared.
static TORN: AtomicBool = AtomicBool::new(false);

fn interface() -> &'static registers::RegisterBlock {
    // SAFETY: the start configures it before anybody else comes here; after that only the code below all tasks does, the NMI's
    // handler, which touches ECCR alone, and the bring-up, which ends in a reset.
    unsafe { &*FLASH::ptr() }
}

/// The flash has two banks, and the second is where the settings are: a smaller chip's is elsewhere.
pub(crate) fn two_banks() -> bool {
    const KILOBYTES: u16 = 512;
    FlashSize::get().kilo_bytes() == KILOBYTES && interface().optr().read().bits() & DBANK != 0
}

/// In the NMI: it is for wrong bits that were found while the settings' pages were read. The reader asks. A wrong bit of the
/// code that runs in these two reads and their barriers would be forgiven too; the lock of SYSCFG_CFGR2 opens the bridges all the same.
pub(crate) fn forgive_torn() -> bool {
    let ours = interface().eccr().read().eccd().bit_is_set() && READING.load(Relaxed);
    if ours {
        TORN.store(true, Relaxed);
        interface().eccr().modify(|_, w| w.eccd().set_bit());
    }
    ours
}

/// Lets the controller erase and program, with `work`, and takes that back.
///
/// The data cache is off meanwhile, and forgets what it held: it does not see what is programmed, and a read of the other bank
/// would damage it (ES0430, data cache during read-while-write; RM0440 3.3.4: it must be off to be reset).
pub(crate) fn unlocked<T>(work: impl FnOnce() -> T) -> T {
    let interface = interface();
    interface.acr().modify(|_, w| w.dcen().clear_bit());
    if interface.cr().read().bits() & LOCK != 0 {
        // SAFETY: the two keys, in their order (RM0440 3.3.5).
        unsafe {
            interface.keyr().write(|w| w.bits(0x4567_0123));
            interface.keyr().write(|w| w.bits(0xCDEF_89AB));
        }
    }
    let done = work();
    // SAFETY: locked again.
    interface.cr().write(|w| unsafe { w.bits(LOCK) });
    interface.acr().modify(|_, w| w.dcrst().set_bit());
    interface.acr().modify(|_, w| w.dcrst().clear_bit());
    interface.acr().modify(|_, w| w.dcen().set_bit());
    done
}

/// Erases a page of the second bank, or of the one that there is, [`unlocked`]: FLASH_SR afterwards.
pub(crate) fn erase(page: u32) -> u32 {
    let bank = if two_banks() { SECOND_BANK } else { 0 };
    command(PER | page << 3 | bank, || {
        // SAFETY: the same page.
        interface()
            .cr()
            .modify(|r, w| unsafe { w.bits(r.bits() | START) });
    })
}

/// Programs an erased double word, [`unlocked`]: FLASH_SR afterwards.
///
/// # Safety
/// `at` is a double word of the flash that is nobody's but the caller's.
pub(crate) unsafe fn program(at: u32, [low, high]: [u32; 2]) -> u32 {
    command(PG, || {
        let at = at as *mut u32;
        // SAFETY: the caller's; two words, the lower first (RM0440 3.3.7).
        unsafe {
            at.write_volatile(low);
            at.wrapping_add(1).write_volatile(high);
        }
    })
}

/// Sets CR, starts, waits: the status afterwards.
fn command(control: u32, start: impl FnOnce()) -> u32 {
    // An erase takes 25 ms at most, 4.2 million cycles; a look is about ten.
    const LOOKS: u32 = 1_000_000;
    let interface = interface();
    // SAFETY: flags that are cleared by writing one; values of the fields.
    unsafe {
        interface.sr().write(|w| w.bits(CLEAR));
        interface.cr().write(|w| w.bits(control));
    }
    start();
    let mut looks = 0..LOOKS;
    looks.any(|_| interface.sr().read().bits() & BSY == 0);
    let status = interface.sr().read().bits();
    // SAFETY: no operation is chosen.
    interface.cr().write(|w| unsafe { w.bits(0) });
    status
}

/// The settings' pages.
pub(crate) struct SettingsPages(());

impl SettingsPages {
    /// There is one, of the code below all tasks.
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

impl ErrorType for SettingsPages {
    type Error = NorFlashErrorKind;
}

fn done(status: u32) -> Result<(), NorFlashErrorKind> {
    if status & (ERRORS | BSY) == 0 {
        Ok(())
    } else {
        Err(NorFlashErrorKind::Other)
    }
}

impl ReadNorFlash for SettingsPages {
    const READ_SIZE: usize = 8;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        check_read(self, offset, bytes.len())?;
        for (at, bytes) in (FIRST + offset..)
            .step_by(8)
            .zip(bytes.as_chunks_mut::<8>().0)
        {
            TORN.store(false, Relaxed);
            READING.store(true, Relaxed);
            // SAFETY: a double word of the settings' pages.
            let [low, high] =
                [0, 4].map(|half| unsafe { ((at + half) as *const u32).read_volatile() });
            // The NMI comes before what follows.
            asm::dsb();
            asm::isb();
            READING.store(false, Relaxed);
            if TORN.load(Relaxed) || interface().eccr().read().eccd().bit_is_set() {
                return Err(NorFlashErrorKind::Other);
            }
            *bytes = (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        if two_banks() { PAGES * PAGE } else { 0 }
    }
}

impl NorFlash for SettingsPages {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        check_erase(self, from, to)?;
        unlocked(|| {
            let mut pages = (FIRST + from..FIRST + to).step_by(PAGE);
            pages.try_for_each(|at| done(erase((at - BANK_2) / PAGE as u32)))
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        check_write(self, offset, bytes.len())?;
        unlocked(|| {
            let mut words = (FIRST + offset..).step_by(8).zip(bytes.as_chunks::<8>().0);
            words.try_for_each(|(at, bytes)| {
                let word = u64::from_le_bytes(*bytes);
                #[allow(clippy::cast_possible_truncation)]
                let halves = [word as u32, (word >> 32) as u32];
                // SAFETY: a double word of the settings' pages.
                done(unsafe { program(at, halves) })
            })
        })
    }
}
