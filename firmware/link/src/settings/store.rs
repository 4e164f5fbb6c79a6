//! Settings in flash: all of them in one page, a new page each time, so that a power cut leaves the old ones or the new.
//!
//! A page is erased, programmed from its beginning and never touched again until it is erased. The newest page that is whole
//! holds; what is written next goes to the page after it, around the ring, which spreads the wear evenly. Nothing is
//! programmed into a page that was not erased just before: a word that lost power half programmed may read as erased, or
//! raise an ECC error (RM0440 3.3.2, 3.3.7), and is not met again. A page that cannot be read is none.
//!
//! | bytes | what |
//! | --- | --- |
//! | 0 to 3 | `DDFS` |
//! | 4 to 7 | sequence: the highest is the newest |
//! | 8 to 11 | bytes of the settings, and the layout's number in the upper half |
//! | 12 to 15 | CRC-32 (ISO-HDLC) of bytes 4 to 11 and the settings |
//! | 16 on | settings: postcard's number and value of each, in any order |
//!
//! A setting that a page has and the firmware not is left out, one that the firmware has and the page not has its default:
//! numbers are for ever, so an update of the firmware needs no migration until a setting's meaning changes, which gives it a
//! new number.

use super::{Settings, Value};
use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage::nor_flash::NorFlash;

/// Page of the STM32G474's flash in dual-bank mode, bytes (RM0440 3.3.1).
pub const PAGE: usize = 2048;
/// What is programmed at once: a double word.
const WORD: usize = 8;
const HEADER: usize = 16;
const MAGIC: [u8; 4] = *b"DDFS";
const LAYOUT: u16 = 1;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Settings as they were found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loaded {
    /// With their defaults where they were not stored, or not as they may be.
    pub settings: Settings,
    /// Stored settings that this firmware does not have.
    pub unknown: u32,
    /// Stored values that are beyond their ranges.
    pub refused: u32,
}

/// Why settings could not be stored. What held before still holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// They are longer than a page.
    TooLong,
    /// No page could be erased, programmed and read back.
    Flash,
}

impl core::fmt::Display for StoreError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the settings are longer than a page of the flash",
            Self::Flash => {
                "no page of the flash could be written and read back: it is worn out, or locked"
            }
        })
    }
}

impl core::error::Error for StoreError {}

/// The store, on a flash of pages of [`PAGE`] bytes of which two or more are its own.
#[derive(Clone, Debug)]
pub struct Store<F> {
    flash: F,
    /// Page and sequence of what holds.
    newest: Option<(u32, u32)>,
}

impl<F: NorFlash> Store<F> {
    const FITS: () = assert!(
        F::ERASE_SIZE == PAGE && WORD.is_multiple_of(F::WRITE_SIZE) && F::READ_SIZE <= WORD,
        "the store is made for pages of 2 KB and words of 8 bytes"
    );

    /// The store on `flash`, and what it holds; `None` if that is nothing.
    pub fn open(mut flash: F) -> (Self, Option<Loaded>) {
        const { Self::FITS };
        let mut newest = None;
        let mut page = [0; PAGE];
        for k in 0..pages(&flash) {
            if let Some((sequence, _)) = read(&mut flash, k, &mut page)
                && newest.is_none_or(|(_, best)| sequence > best)
            {
                newest = Some((k, sequence));
            }
        }
        let loaded = newest.and_then(|(k, _)| {
            let (_, settings) = read(&mut flash, k, &mut page)?;
            Some(load(settings))
        });
        (Self { flash, newest }, loaded)
    }

    /// Makes `settings` hold.
    ///
    /// # Errors
    /// [`StoreError`]; what held before still does.
    pub fn save(&mut self, settings: &Settings) -> Result<(), StoreError> {
        let (newest, sequence) = match self.newest {
            Some((page, sequence)) => (Some(page), sequence.saturating_add(1)),
            None => (None, 1),
        };
        let mut page = [0xFF; PAGE];
        let end = image(settings, sequence, &mut page).ok_or(StoreError::TooLong)?;
        let all = pages(&self.flash);
        let first = newest.map_or(0, |page| page + 1);
        // A page that does not hold what is written is passed over; the one that holds what holds is never touched.
        for k in (first..first + all).map(|k| k % all.max(1)) {
            if Some(k) == newest {
                continue;
            }
            let begin = k * PAGE as u32;
            let written = self
                .flash
                .erase(begin, begin + PAGE as u32)
                .and_then(|()| self.flash.write(begin, page.get(..end).unwrap_or(&[])));
            let mut back = [0; PAGE];
            if written.is_ok()
                && read(&mut self.flash, k, &mut back).is_some_and(|(found, _)| found == sequence)
                && back.get(..end) == page.get(..end)
            {
                self.newest = Some((k, sequence));
                return Ok(());
            }
        }
        Err(StoreError::Flash)
    }

    /// The flash.
    pub fn flash(&mut self) -> &mut F {
        &mut self.flash
    }

    /// The flash, the store being closed.
    pub fn release(self) -> F {
        self.flash
    }
}

fn pages<F: NorFlash>(flash: &F) -> u32 {
    u32::try_from(flash.capacity() / PAGE).unwrap_or(0)
}

/// The page of `settings`; how long it is, in whole words. `None` if it is too long.
fn image(settings: &Settings, sequence: u32, page: &mut [u8; PAGE]) -> Option<usize> {
    let (header, content) = page.split_at_mut(HEADER);
    let mut length = 0;
    for setting in Settings::all() {
        let value = settings.get(setting.id)?;
        let place = content.get_mut(length..)?;
        length += postcard::to_slice(&(setting.id, value), place).ok()?.len();
    }
    let sizes = u32::try_from(length).ok()? | u32::from(LAYOUT) << 16;
    header.get_mut(..4)?.copy_from_slice(&MAGIC);
    header
        .get_mut(4..8)?
        .copy_from_slice(&sequence.to_le_bytes());
    header.get_mut(8..12)?.copy_from_slice(&sizes.to_le_bytes());
    let check = check(header.get(4..12)?, content.get(..length)?);
    header.get_mut(12..)?.copy_from_slice(&check.to_le_bytes());
    Some((HEADER + length).next_multiple_of(WORD))
}

fn check(header: &[u8], content: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(header);
    digest.update(content);
    digest.finalize()
}

/// The sequence and the settings of page `k`, if it is whole.
fn read<'p, F: NorFlash>(
    flash: &mut F,
    k: u32,
    page: &'p mut [u8; PAGE],
) -> Option<(u32, &'p [u8])> {
    let begin = k * PAGE as u32;
    let (header, content) = page.split_at_mut(HEADER);
    flash.read(begin, header).ok()?;
    let word = |at: usize| {
        let bytes = header.get(at..at + 4)?;
        Some(u32::from_le_bytes(bytes.try_into().ok()?))
    };
    let (sequence, sizes, expected) = (word(4)?, word(8)?, word(12)?);
    if header.get(..4)? != MAGIC || sizes >> 16 != u32::from(LAYOUT) {
        return None;
    }
    let length = (sizes & 0xFFFF) as usize;
    let padded = content.get_mut(..length.next_multiple_of(WORD))?;
    flash.read(begin + HEADER as u32, padded).ok()?;
    let content = padded.get(..length)?;
    (check(header.get(4..12)?, content) == expected).then_some((sequence, content))
}

fn load(mut stored: &[u8]) -> Loaded {
    let mut loaded = Loaded {
        settings: Settings::DEFAULT,
        unknown: 0,
        refused: 0,
    };
    while let Ok(((id, value), rest)) = postcard::take_from_bytes::<(u16, Value)>(stored) {
        stored = rest;
        match loaded.settings.set(id, value) {
            Ok(()) => {}
            Err(super::SettingError::Unknown { .. }) => loaded.unknown += 1,
            Err(_) => loaded.refused += 1,
        }
    }
    loaded
}
