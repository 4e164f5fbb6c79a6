//! The flash and its controller (RM0440 3.3.5 to 3.3.8, 3.7). The core's engine holds a copy of what programs are in, which
//! [`Change`]s keep up; the pages that the firmware itself erases and writes are here alone: its settings', then the bring-up's
//! two, all at the end of the second bank.
//!
//! What runs lies in the first bank, which is read on while the second works; a reader of the second then waits until it has done.

use super::CORE_HZ;
use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use hal_sim::flash::{PAGE, SimulatedFlash};
use link::settings::store::PAGES;

/// Pages that are here alone.
const MODELLED: usize = PAGES + 2;
/// Bytes of them.
pub const SIZE: usize = MODELLED * PAGE;
/// Where the chip's flash ends.
pub const END: u32 = 0x0808_0000;
/// Where they start.
pub const START: u32 = END - SIZE as u32;
/// Where the chip's flash starts.
pub const BEGIN: u32 = 0x0800_0000;
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
const MASS: [u32; 2] = [1 << 2, 1 << 15];
const SECOND_BANK: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;

/// ECCR: two wrong bits, in the second bank.
const ECCD: u32 = 1 << 31;
const BK_ECC: u32 = 1 << 21;
/// ECCR: in the system memory.
const SYSF_ECC: u32 = 1 << 22;

/// A byte that is erased.
const ERASED: u8 = 0xFF;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Longest times (DS12288, flash memory characteristics), ns: a page, a bank, a double word.
const ERASE_NS: u64 = 24_470_000;
const MASS_ERASE_NS: u64 = 24_590_000;
const PROGRAM_NS: u64 = 83_350;

/// What has changed of the memory that programs are in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// So many bytes from an address on are erased.
    Erased(u32, u32),
    /// A double word was written at an address.
    Written(u32, u64),
}

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
    /// What the pages hold that are here alone.
    pub memory: SimulatedFlash,
    /// What the others hold.
    programs: Vec<u8>,
    /// What the engine's copy lacks.
    pub changes: Vec<Change>,
    /// The core's clock, which time is counted in.
    pub core_hz: u64,
    keys: usize,
    control: u32,
    status: u32,
    ecc: u32,
    busy_until: u64,
    /// The first word of a double word that is being written.
    half: Option<(u32, u32)>,
    /// Faults injected from outside.
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
            programs: vec![ERASED; (START - BEGIN) as usize],
            changes: Vec::new(),
            core_hz: CORE_HZ,
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

    /// `bytes` are at `address` from the start on. `None`: they do not fit the pages that programs are in.
    #[must_use]
    pub fn hold(&mut self, address: u32, bytes: &[u8]) -> Option<()> {
        let start = address.checked_sub(BEGIN)? as usize;
        let end = start.checked_add(bytes.len())?;
        self.programs.get_mut(start..end)?.copy_from_slice(bytes);
        Some(())
    }

    /// The half word at `address`, of the pages that programs are in.
    #[must_use]
    pub fn half_word(&self, address: u32) -> Option<u16> {
        let start = address.checked_sub(BEGIN)? as usize;
        let bytes = self.programs.get(start..start + 2)?;
        bytes.try_into().ok().map(u16::from_le_bytes)
    }

    /// As ST ships it: nothing is in it.
    pub fn deliver(&mut self) {
        self.clear(BEGIN, END - BEGIN);
    }

    /// After a reset: locked; what it holds stays.
    pub fn reset(&mut self) {
        self.memory.power_up();
        self.keys = 0;
        self.control = LOCK;
        (self.status, self.ecc, self.busy_until) = (0, 0, 0);
        self.half = None;
    }

    fn work(&mut self, now: u64, nanoseconds: u64) {
        self.busy_until = now + self.core_hz * nanoseconds / 1_000_000_000;
        self.status |= EOP;
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
        const BANK: u32 = BANK_2 - BEGIN;
        if self.worn.protected {
            self.status |= WRPERR;
            return Ok(());
        }
        if self.control & PER != 0 {
            let page = self.control >> 3 & 0x7F;
            let bank = if self.control & SECOND_BANK == 0 {
                BEGIN
            } else {
                BANK_2
            };
            self.clear(bank + page * PAGE as u32, PAGE as u32);
            self.work(now, ERASE_NS);
            return Ok(());
        }
        if MASS.iter().all(|bank| self.control & bank == 0) {
            return Err(format!(
                "an erasure starts of neither a page nor a bank (FLASH_CR {:#x})",
                self.control
            ));
        }
        for (bank, start) in MASS.into_iter().zip([BEGIN, BANK_2]) {
            if self.control & bank != 0 {
                self.clear(start, BANK);
            }
        }
        self.work(now, MASS_ERASE_NS);
        Ok(())
    }

    /// Erases whole pages.
    fn clear(&mut self, start: u32, bytes: u32) {
        let end = start + bytes;
        let programs = start..end.min(START);
        if !programs.is_empty() {
            let offset = |address: u32| (address - BEGIN) as usize;
            self.programs[offset(programs.start)..offset(programs.end)].fill(ERASED);
            self.changes
                .push(Change::Erased(start, programs.end - programs.start));
        }
        if end > START {
            // An error is power that was cut, which the chip looks for.
            let _ = self.memory.erase(start.max(START) - START, end - START);
        }
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
                self.store(first, low, value, now);
            }
            _ => self.status |= PGSERR,
        }
        Ok(())
    }

    fn store(&mut self, address: u32, low: u32, high: u32, now: u64) {
        if self.worn.protected {
            self.status |= WRPERR;
            return;
        }
        let stuck = if self.worn.stuck { 0x0000_0100 } else { 0 };
        let word = u64::from(high) << 32 | u64::from(low | stuck);
        self.work(now, PROGRAM_NS);
        if !self.put(address, word) {
            // It was not erased, or power was cut, which the chip looks for.
            self.status &= !EOP;
            self.status |= PROGERR;
        }
    }

    /// `false`: the double word was not erased, or power was cut.
    fn put(&mut self, address: u32, word: u64) -> bool {
        let bytes = word.to_le_bytes();
        if address >= START {
            return self.memory.write(address - START, &bytes).is_ok();
        }
        let offset = (address - BEGIN) as usize;
        let place = &mut self.programs[offset..offset + bytes.len()];
        if place.iter().any(|byte| *byte != ERASED) {
            return false;
        }
        place.copy_from_slice(&bytes);
        self.changes.push(Change::Written(address, word));
        true
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}
