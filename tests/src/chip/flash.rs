//! The flash's controller, and the pages that the firmware erases and writes: its settings', then the bring-up's two, all at the
//! end of the second bank (RM0440 3.3.5 to 3.3.8, 3.7).
//!
//! What runs lies in the first bank, which is read on while the second works; who reads the second then waits until it has done.

use super::CORE_HZ;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use hal_sim::flash::{PAGE, SimulatedFlash};
use link::settings::store::PAGES;

/// Pages that the model has.
const MODELLED: usize = PAGES + 2;
/// Bytes of them.
pub const SIZE: usize = MODELLED * PAGE;
/// Where the chip's flash ends.
pub const END: u32 = 0x0808_0000;
/// Where they start.
pub const START: u32 = END - SIZE as u32;
/// Number of the first, of the 128 of its bank.
const FIRST: u32 = 128 - MODELLED as u32;
const BANK_2: u32 = 0x0804_0000;

const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;

const BSY: u32 = 1 << 16;
const EOP: u32 = 1;
const PROGERR: u32 = 1 << 3;
const WRPERR: u32 = 1 << 4;
const PGSERR: u32 = 1 << 7;
const FLAGS: u32 = 0xC3FB;

const PG: u32 = 1;
const PER: u32 = 1 << 1;
const SECOND_BANK: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;

/// ECCR: two wrong bits, in the second bank.
const ECCD: u32 = 1 << 31;
const BK_ECC: u32 = 1 << 21;
/// ECCR: in the system memory.
const SYSF_ECC: u32 = 1 << 22;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Longest times (DS12288, flash memory characteristics): a page, a double word.
const ERASE: u64 = CORE_HZ * 2447 / 100_000;
const PROGRAM: u64 = CORE_HZ * 8335 / 100_000_000;

/// What is wrong with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Worn {
    /// Bits that do not go to 0 when they are written.
    pub stuck: bool,
    /// The page is write-protected by option bytes.
    pub protected: bool,
}

/// Controller and memory.
pub struct Flash {
    /// What it holds.
    pub memory: SimulatedFlash,
    keys: usize,
    control: u32,
    status: u32,
    ecc: u32,
    busy_until: u64,
    /// The first word of a double word that is being written.
    half: Option<(u32, u32)>,
    /// Faults put in from outside.
    pub worn: Worn,
    /// ECCR says another bank and another address of a word that lost power (ES0430 2.2.3).
    pub wrong_ecc: bool,
}

impl Flash {
    /// As delivered: erased and locked.
    #[must_use]
    pub fn new() -> Self {
        Self {
            memory: SimulatedFlash::new(MODELLED, 1),
            keys: 0,
            control: LOCK,
            status: 0,
            ecc: 0,
            busy_until: 0,
            half: None,
            worn: Worn::default(),
            wrong_ecc: false,
        }
    }

    /// After a reset: locked; what it holds stays.
    pub fn reset(&mut self) {
        let mut memory = self.memory.clone();
        memory.power_up();
        *self = Self {
            memory,
            worn: self.worn,
            wrong_ecc: self.wrong_ecc,
            ..Self::new()
        };
    }

    /// Power was cut while it worked.
    #[must_use]
    pub fn lost_power(&self) -> bool {
        self.memory.is_cut()
    }

    /// Reads KEYR, SR, CR or ECCR; `None`: another register.
    #[must_use]
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        match offset {
            SR => Some(self.status | if now < self.busy_until { BSY } else { 0 }),
            CR => Some(self.control),
            ECCR => Some(self.ecc),
            _ => None,
        }
    }

    /// Writes KEYR, SR, CR or ECCR. `false`: another register.
    ///
    /// # Errors
    /// What would be a hard fault, or an access while it works.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<bool, String> {
        match offset {
            KEYR => {
                if KEYS.get(self.keys) != Some(&value) {
                    return Err("a wrong key locks the flash until the next reset".into());
                }
                self.keys += 1;
                if self.keys == KEYS.len() {
                    self.control &= !LOCK;
                }
            }
            SR => self.status &= !(value & FLAGS),
            // The flag is cleared by writing one.
            ECCR => self.ecc &= !(value & ECCD),
            CR if self.control & LOCK != 0 => return Err("FLASH_CR is locked".into()),
            CR if now < self.busy_until => return Err("FLASH_CR is written while it works".into()),
            CR => {
                if value & LOCK != 0 {
                    self.keys = 0;
                }
                self.control = value & !STRT;
                if value & STRT != 0 {
                    self.erase(now)?;
                }
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn erase(&mut self, now: u64) -> Result<(), String> {
        let page = self.control >> 3 & 0x7F;
        if self.control & PER == 0 || self.control & SECOND_BANK == 0 || page < FIRST {
            return Err(format!(
                "this model erases the last {MODELLED} pages only (FLASH_CR {:#x})",
                self.control
            ));
        }
        if self.worn.protected {
            self.status |= WRPERR;
            return Ok(());
        }
        let start = (page - FIRST) * PAGE as u32;
        // An error is power that was cut, which the chip looks for.
        let _ = self.memory.erase(start, start + PAGE as u32);
        self.busy_until = now + ERASE;
        self.status |= EOP;
        Ok(())
    }

    /// The word at `address`, in the second bank, is found to have two wrong bits.
    pub fn tear(&mut self, address: u32) {
        self.ecc = ECCD | BK_ECC | (address - BANK_2);
    }

    /// The core reads a word of the memory: what it gets, how long it waits, and whether the word is unreadable, which raises the
    /// NMI.
    pub fn load(&mut self, address: u32, now: u64) -> (u32, u64, bool) {
        let waits = self.busy_until.saturating_sub(now);
        let at = (address - START) & !7;
        let mut bytes = [0; 8];
        let torn = self.memory.read(at, &mut bytes).is_err();
        if torn {
            self.tear(START + at);
            if self.wrong_ecc {
                // The first bank's first word, in the system's memory.
                self.ecc = ECCD | SYSF_ECC;
            }
        }
        let word = u64::from_le_bytes(bytes) >> (8 * (address & 4));
        #[allow(clippy::cast_possible_truncation)]
        (word as u32, waits, torn)
    }

    /// The core writes a word of the memory.
    ///
    /// # Errors
    /// Programming is not on, or it still works.
    pub fn program(&mut self, address: u32, value: u32, now: u64) -> Result<(), String> {
        if self.control & (PG | LOCK) != PG {
            return Err("the flash is written while programming is off".into());
        }
        if now < self.busy_until {
            return Err("the flash is written while it works".into());
        }
        match self.half.take() {
            None if address.is_multiple_of(8) => self.half = Some((address, value)),
            Some((first, low)) if address == first + 4 => {
                self.busy_until = now + PROGRAM;
                self.store(first, low, value);
            }
            _ => self.status |= PGSERR,
        }
        Ok(())
    }

    fn store(&mut self, address: u32, low: u32, high: u32) {
        if self.worn.protected {
            self.status |= WRPERR;
            return;
        }
        let stuck = if self.worn.stuck { 0x0000_0100 } else { 0 };
        let word = u64::from(high) << 32 | u64::from(low | stuck);
        if self
            .memory
            .write(address - START, &word.to_le_bytes())
            .is_err()
        {
            // It was not erased, or power was cut, which the chip looks for.
            self.status |= PROGERR;
            return;
        }
        self.status |= EOP;
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}
