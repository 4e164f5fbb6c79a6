//! Settings in flash: all of them in one slot, a new slot each time, so that a power cut leaves the old ones or the new.
//!
//! A slot is erased, programmed from its beginning and never touched again until it is erased. The newest slot that is whole
//! holds; what is written next goes to the slot after it, around the ring, which spreads the wear evenly. Nothing is
//! programmed into a page that was not erased just before: a word that lost power half programmed may read as erased, or
//! raise an ECC error (RM0440 3.3.2, 3.3.7), and is not met again. A slot that cannot be read is none.
//!
//! | bytes | what |
//! | --- | --- |
//! | 0 to 3 | `DDFS` |
//! | 4 to 7 | sequence: the highest is the newest |
//! | 8 to 11 | bytes of the settings, and the layout's number in the upper half |
//! | 12 to 15 | CRC-32 (ISO-HDLC) of bytes 4 to 11 and the settings |
//! | 16 on | settings: postcard's number and value of each, in any order |
//!
//! A setting that a slot has and the firmware not is left out, one that the firmware has and the slot not is that of the drive
//! without a store: numbers are without end, so an update of the firmware needs no migration until a setting's meaning changes,
//! which gives it a new number.
//!
//! Nothing here holds more of a slot than a setting: the drive has its kilobytes on the stack of what else it does.

use super::{Settings, WireValue};
use crc::{CRC_32_ISO_HDLC, Crc, Digest};
use embedded_storage::nor_flash::NorFlash;

/// Page of the STM32G474's flash in dual-bank mode, bytes (RM0440 3.3.1).
pub const PAGE: usize = 2048;
/// What one set of settings has: a page would be full with the settings that there are.
pub const SLOT: usize = 2 * PAGE;
/// Pages of a drive's store: four slots, each of which bears 10,000 erases (DS12288, flash memory endurance).
pub const PAGES: usize = 8;
/// What is programmed at once: a double word.
const WORD: usize = 8;
const HEADER: usize = 16;
/// Longest setting: number, kind and value.
const ENTRY: usize = 16;
const MAGIC: [u8; 4] = *b"DDFS";
const LAYOUT: u16 = 1;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What was found beside the settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loaded {
    /// Stored settings that this firmware does not have.
    pub unknown: u32,
    /// Stored values that are beyond their ranges.
    pub refused: u32,
    /// Number of the first setting that has one; 0: none.
    pub first_refused: u16,
}

/// Why settings could not be stored. What held before still holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// They are longer than a slot.
    TooLong,
    /// No slot could be erased, programmed and read back.
    Flash,
}

impl core::fmt::Display for StoreError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the settings are longer than a slot of the flash",
            Self::Flash => {
                "no page of the flash could be written and read back: it is worn out, or locked"
            }
        })
    }
}

impl core::error::Error for StoreError {}

/// The store, on a flash of pages of [`PAGE`] bytes of which four or more are its own.
#[derive(Clone, Debug)]
pub struct Store<F> {
    flash: F,
    /// Slot and sequence of what holds.
    newest: Option<(u32, u32)>,
}

impl<F: NorFlash> Store<F> {
    const FITS: () = assert!(
        F::ERASE_SIZE == PAGE && WORD.is_multiple_of(F::WRITE_SIZE) && F::READ_SIZE <= WORD,
        "the store is made for pages of 2 KB and words of 8 bytes"
    );

    /// The store on `flash`.
    pub fn open(flash: F) -> Self {
        const { Self::FITS };
        let mut store = Self {
            flash,
            newest: None,
        };
        for slot in 0..store.slots() {
            if let Some(header) = store.whole(slot)
                && store.newest.is_none_or(|(_, best)| header.sequence > best)
            {
                store.newest = Some((slot, header.sequence));
            }
        }
        store
    }

    /// What it holds, put over the `settings` of a drive without a store: what is not stored, or not as it may be, stays. `None` if
    /// it holds nothing, or cannot be read to its end: the settings are of no use then.
    #[inline(never)]
    pub fn load(&mut self, settings: &mut Settings) -> Option<Loaded> {
        let (slot, _) = self.newest?;
        let mut left = self.header(slot)?.length;
        let mut loaded = Loaded::default();
        let mut window = [0; 2 * ENTRY];
        let (mut filled, mut word) = (0, 0);
        loop {
            // A word more as long as there is room for it.
            while left > 0 && filled + WORD <= window.len() {
                let bytes = self.word(slot, HEADER / WORD + word)?;
                window
                    .get_mut(filled..filled + WORD)?
                    .copy_from_slice(&bytes);
                filled += left.min(WORD);
                left = left.saturating_sub(WORD);
                word += 1;
            }
            let held = window.get(..filled)?;
            let Ok(((id, value), rest)) = postcard::take_from_bytes::<(u16, WireValue)>(held)
            else {
                return Some(loaded);
            };
            match settings.set(id, value.into()) {
                Ok(()) => {}
                Err(super::SettingError::Unknown { .. }) => loaded.unknown += 1,
                Err(_) => {
                    if loaded.refused == 0 {
                        loaded.first_refused = id;
                    }
                    loaded.refused += 1;
                }
            }
            let taken = filled - rest.len();
            window.copy_within(taken..filled, 0);
            filled -= taken;
        }
    }

    /// Makes `settings` hold.
    ///
    /// # Errors
    /// [`StoreError`]; what held before still does.
    #[inline(never)]
    pub fn save(&mut self, settings: &Settings) -> Result<(), StoreError> {
        let (newest, sequence) = match self.newest {
            Some((slot, sequence)) => (Some(slot), sequence.saturating_add(1)),
            None => (None, 1),
        };
        let header = Header::of(settings, sequence).ok_or(StoreError::TooLong)?;
        let all = self.slots();
        let first = newest.map_or(0, |slot| slot + 1);
        // A slot that does not hold what is written is passed over; the one that holds what holds is never touched.
        for slot in (first..first + all).map(|slot| slot % all.max(1)) {
            if Some(slot) == newest {
                continue;
            }
            if self.put(slot, &header, settings).is_some() && self.whole(slot) == Some(header) {
                self.newest = Some((slot, sequence));
                return Ok(());
            }
        }
        Err(StoreError::Flash)
    }

    /// Erases a slot and programs it; `None` if it could not, or does not read as it was written.
    fn put(&mut self, slot: u32, header: &Header, settings: &Settings) -> Option<()> {
        let begin = slot * SLOT as u32;
        self.flash.erase(begin, begin + SLOT as u32).ok()?;
        let mut at = 0;
        let mut done = true;
        let mut write = |bytes: [u8; WORD]| {
            done &= self.flash.write(begin + at, &bytes).is_ok();
            at += WORD as u32;
            done
        };
        let (head, tail) = header.words();
        let written = write(head) && write(tail) && each_word(settings, &mut write).is_some();
        (written && done).then_some(())?;
        let mut word = HEADER / WORD;
        let mut same = true;
        each_word(settings, &mut |bytes| {
            same &= self.word(slot, word) == Some(bytes);
            word += 1;
            same
        })?;
        same.then_some(())
    }

    /// The flash.
    pub fn flash(&mut self) -> &mut F {
        &mut self.flash
    }

    /// The flash, the store being closed.
    pub fn release(self) -> F {
        self.flash
    }

    fn slots(&self) -> u32 {
        u32::try_from(self.flash.capacity() / SLOT).unwrap_or(0)
    }

    fn word(&mut self, slot: u32, word: usize) -> Option<[u8; WORD]> {
        let mut bytes = [0; WORD];
        let at = slot * SLOT as u32 + u32::try_from(word * WORD).ok()?;
        self.flash.read(at, &mut bytes).ok()?;
        Some(bytes)
    }

    /// A slot's header, if it has one.
    fn header(&mut self, slot: u32) -> Option<Header> {
        Header::read(self.word(slot, 0)?, self.word(slot, 1)?)
    }

    /// A slot's header, if its settings are those that it was made for.
    fn whole(&mut self, slot: u32) -> Option<Header> {
        let header = self.header(slot)?;
        let mut digest = header.digest();
        let mut left = header.length;
        let mut word = HEADER / WORD;
        while left > 0 {
            let bytes = self.word(slot, word)?;
            digest.update(bytes.get(..left.min(WORD))?);
            left = left.saturating_sub(WORD);
            word += 1;
        }
        (digest.finalize() == header.check).then_some(header)
    }
}

/// What stands before a slot's settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Header {
    sequence: u32,
    /// Bytes of the settings.
    length: usize,
    check: u32,
}

impl Header {
    /// Of these settings; `None` if they are too long.
    fn of(settings: &Settings, sequence: u32) -> Option<Self> {
        let mut header = Self {
            sequence,
            length: 0,
            check: 0,
        };
        each_setting(settings, |bytes| {
            header.length += bytes.len();
            true
        })?;
        let mut digest = header.digest();
        each_setting(settings, |bytes| {
            digest.update(bytes);
            true
        })?;
        header.check = digest.finalize();
        (HEADER + header.length <= SLOT).then_some(header)
    }

    fn read(head: [u8; WORD], tail: [u8; WORD]) -> Option<Self> {
        let ([magic, sequence], [sizes, check]) = (halves(head), halves(tail));
        let sizes = u32::from_le_bytes(sizes);
        let length = (sizes & 0xFFFF) as usize;
        let ours = magic == MAGIC && sizes >> 16 == u32::from(LAYOUT) && HEADER + length <= SLOT;
        ours.then_some(Self {
            sequence: u32::from_le_bytes(sequence),
            length,
            check: u32::from_le_bytes(check),
        })
    }

    fn sizes(&self) -> u32 {
        self.length as u32 | u32::from(LAYOUT) << 16
    }

    fn words(&self) -> ([u8; WORD], [u8; WORD]) {
        (
            joined(MAGIC, self.sequence.to_le_bytes()),
            joined(self.sizes().to_le_bytes(), self.check.to_le_bytes()),
        )
    }

    /// The check's beginning.
    fn digest(&self) -> Digest<'static, u32> {
        let mut digest = CRC.digest();
        digest.update(&self.sequence.to_le_bytes());
        digest.update(&self.sizes().to_le_bytes());
        digest
    }
}

fn halves(word: [u8; WORD]) -> [[u8; 4]; 2] {
    let [a, b, c, d, e, f, g, h] = word;
    [[a, b, c, d], [e, f, g, h]]
}

fn joined([a, b, c, d]: [u8; 4], [e, f, g, h]: [u8; 4]) -> [u8; WORD] {
    [a, b, c, d, e, f, g, h]
}

/// Each setting as it is stored, as long as `take` wants more; `None` if it does not.
fn each_setting(settings: &Settings, mut take: impl FnMut(&[u8]) -> bool) -> Option<()> {
    for setting in Settings::all() {
        let value = settings.get(setting.id)?;
        let mut buffer = [0; ENTRY];
        let bytes = postcard::to_slice(&(setting.id, WireValue::from(value)), &mut buffer).ok()?;
        take(bytes).then_some(())?;
    }
    Some(())
}

/// The same as words, the last one padded as it was erased.
fn each_word(settings: &Settings, take: &mut impl FnMut([u8; WORD]) -> bool) -> Option<()> {
    let mut word = [0xFF; WORD];
    let mut filled = 0;
    each_setting(settings, |bytes| {
        for byte in bytes {
            if let Some(place) = word.get_mut(filled) {
                *place = *byte;
            }
            filled += 1;
            if filled == WORD {
                if !take(word) {
                    return false;
                }
                (word, filled) = ([0xFF; WORD], 0);
            }
        }
        true
    })?;
    (filled == 0 || take(word)).then_some(())
}
