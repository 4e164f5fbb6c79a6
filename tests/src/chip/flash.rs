//! The flash's controller, and its last 4 KiB, which no program reaches (RM0440 5.3.5 to 5.3.7, 5.7).

use super::CORE_HZ;

/// Where the memory that the model has starts, and its size.
pub const START: u32 = 0x0807_F000;
/// Of two pages of 2 KiB.
pub const SIZE: usize = 4096;
/// Where it ends.
pub const END: u32 = START + SIZE as u32;

const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;

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

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Typical times (DS12288, flash memory characteristics; memory): a page, a double word.
const ERASE: u64 = CORE_HZ * 22 / 1000;
const PROGRAM: u64 = CORE_HZ * 85 / 1_000_000;

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
    pub memory: Vec<u8>,
    keys: usize,
    control: u32,
    status: u32,
    busy_until: u64,
    /// The first word of a double word that is being written.
    half: Option<(u32, u32)>,
    /// Faults put in from outside.
    pub worn: Worn,
}

impl Flash {
    /// As delivered: erased and locked.
    #[must_use]
    pub fn new() -> Self {
        Self {
            memory: vec![0xFF; SIZE],
            keys: 0,
            control: LOCK,
            status: 0,
            busy_until: 0,
            half: None,
            worn: Worn::default(),
        }
    }

    /// After a reset: locked; what it holds stays.
    pub fn reset(&mut self) {
        let memory = std::mem::take(&mut self.memory);
        *self = Self {
            memory,
            worn: self.worn,
            ..Self::new()
        };
    }

    /// Reads KEYR, SR or CR; `None`: another register.
    #[must_use]
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        match offset {
            SR => Some(self.status | if now < self.busy_until { BSY } else { 0 }),
            CR => Some(self.control),
            _ => None,
        }
    }

    /// Writes KEYR, SR or CR. `false`: another register.
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
        if self.control & PER == 0 || self.control & SECOND_BANK == 0 || page < 126 {
            return Err(format!(
                "this model erases the last two pages only (FLASH_CR {:#x})",
                self.control
            ));
        }
        if self.worn.protected {
            self.status |= WRPERR;
            return Ok(());
        }
        let start = (page as usize - 126) * SIZE / 2;
        self.memory[start..start + SIZE / 2].fill(0xFF);
        self.busy_until = now + ERASE;
        self.status |= EOP;
        Ok(())
    }

    /// The core reads a word of the memory.
    #[must_use]
    pub fn word(&self, address: u32) -> u32 {
        let at = (address - START) as usize & !3;
        let bytes = self.memory[at..at + 4].try_into().unwrap_or_default();
        u32::from_le_bytes(bytes)
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
        if (self.word(address), self.word(address + 4)) != (u32::MAX, u32::MAX) {
            self.status |= PROGERR;
            return;
        }
        let stuck = if self.worn.stuck { 0x0000_0100 } else { 0 };
        let at = (address - START) as usize;
        self.memory[at..at + 4].copy_from_slice(&(low | stuck).to_le_bytes());
        self.memory[at + 4..at + 8].copy_from_slice(&high.to_le_bytes());
        self.status |= EOP;
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}
