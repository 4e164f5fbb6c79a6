//! The chip's flash as a store of settings sees it: pages of 2 KB, words of 8 bytes with ECC, and power that may be cut.
//!
//! A word is programmed once after an erase (RM0440 3.3.7: another program of it is refused, but for all zeros, which is
//! not used here). What a word or a page is that lost power half programmed or erased is drawn: as it was, as it was to be,
//! noise, or, for a word, unreadable by its ECC. A word that reads as erased and is not refuses to be programmed.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Bytes of a page.
pub const PAGE: usize = 2048;
const WORD: usize = 8;

/// What a word is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    Erased,
    Programmed,
    /// Reads as erased, but is not.
    Marginal,
    /// Its ECC does not agree.
    Unreadable,
}

/// A simulated flash.
#[derive(Clone, Debug)]
pub struct SimulatedFlash {
    bytes: Vec<u8>,
    words: Vec<Word>,
    /// Erases of each page.
    erased: Vec<u32>,
    /// Erases and programmed words until power is cut; `None`: it is not.
    left: Option<u32>,
    /// Erases and programmed words so far.
    operations: u32,
    random: Xoshiro256PlusPlus,
}

impl SimulatedFlash {
    /// An erased one of so many pages.
    #[must_use]
    pub fn new(pages: usize, seed: u64) -> Self {
        Self {
            bytes: vec![0xFF; pages * PAGE],
            words: vec![Word::Erased; pages * PAGE / WORD],
            erased: vec![0; pages],
            left: None,
            operations: 0,
            random: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// With these bytes; a word that is all ones is erased.
    #[must_use]
    pub fn of_bytes(bytes: &[u8]) -> Self {
        let mut flash = Self::new(bytes.len().div_ceil(PAGE), 0);
        flash.bytes[..bytes.len()].copy_from_slice(bytes);
        for (word, bytes) in flash.words.iter_mut().zip(flash.bytes.chunks(WORD)) {
            if bytes != [0xFF; WORD] {
                *word = Word::Programmed;
            }
        }
        flash
    }

    /// What it holds.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Power is cut in the operation after so many, an erase or a word's programming each.
    pub fn cut_after(&mut self, operations: u32) {
        self.left = Some(operations);
    }

    /// Power was cut, and is not back.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.left == Some(u32::MAX)
    }

    /// Power is back.
    pub fn power_up(&mut self) {
        self.left = None;
    }

    /// Erases and programmed words so far.
    #[must_use]
    pub fn operations(&self) -> u32 {
        self.operations
    }

    /// Erases of each page.
    #[must_use]
    pub fn erases(&self) -> &[u32] {
        &self.erased
    }

    /// The next operation has power to its end: `Ok(false)` if power is cut in it.
    fn begin(&mut self) -> Result<bool, NorFlashErrorKind> {
        match &mut self.left {
            // Nothing works any more.
            Some(u32::MAX) => Err(NorFlashErrorKind::Other),
            Some(0) => {
                self.left = Some(u32::MAX);
                Ok(false)
            }
            Some(left) => {
                *left -= 1;
                self.operations += 1;
                Ok(true)
            }
            None => {
                self.operations += 1;
                Ok(true)
            }
        }
    }

    fn put(&mut self, word: usize, bytes: [u8; WORD], is: Word) {
        self.bytes[word * WORD..(word + 1) * WORD].copy_from_slice(&bytes);
        self.words[word] = is;
    }

    fn noise(&mut self) -> [u8; WORD] {
        self.random.next_u64().to_le_bytes()
    }
}

impl ErrorType for SimulatedFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for SimulatedFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        check_read(self, offset, bytes.len())?;
        let (from, to) = (offset as usize, offset as usize + bytes.len());
        if self.words[from / WORD..to.div_ceil(WORD)].contains(&Word::Unreadable) {
            return Err(NorFlashErrorKind::Other);
        }
        bytes.copy_from_slice(&self.bytes[from..to]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for SimulatedFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        check_erase(self, from, to)?;
        for page in from as usize / PAGE..to as usize / PAGE {
            let whole = self.begin()?;
            let kind = self.random.next_u32() % 4;
            for word in page * PAGE / WORD..(page + 1) * PAGE / WORD {
                match (whole, kind) {
                    (true, _) => self.put(word, [0xFF; WORD], Word::Erased),
                    (false, 0) => {}
                    (false, 1) => self.put(word, [0xFF; WORD], Word::Marginal),
                    (false, 2) => {
                        let noise = self.noise();
                        self.put(word, noise, Word::Programmed);
                    }
                    // From word to word another.
                    (false, _) => match self.random.next_u32() % 4 {
                        0 => {}
                        1 => self.put(word, [0xFF; WORD], Word::Marginal),
                        2 => self.put(word, [0xFF; WORD], Word::Unreadable),
                        _ => {
                            let noise = self.noise();
                            self.put(word, noise, Word::Programmed);
                        }
                    },
                }
            }
            if !whole {
                return Err(NorFlashErrorKind::Other);
            }
            self.erased[page] += 1;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        check_write(self, offset, bytes.len())?;
        for (word, bytes) in (offset as usize / WORD..).zip(bytes.as_chunks::<WORD>().0) {
            if self.words[word] != Word::Erased {
                return Err(NorFlashErrorKind::Other);
            }
            if self.begin()? {
                self.put(word, *bytes, Word::Programmed);
                continue;
            }
            match self.random.next_u32() % 5 {
                0 => {}
                1 => self.put(word, [0xFF; WORD], Word::Marginal),
                2 => self.put(word, *bytes, Word::Programmed),
                3 => self.put(word, [0; WORD], Word::Unreadable),
                _ => {
                    // Bits that were to fall, some of which have.
                    let noise = self.noise();
                    let mut now = *bytes;
                    now.iter_mut()
                        .zip(noise)
                        .for_each(|(byte, keep)| *byte |= keep);
                    self.put(word, now, Word::Programmed);
                }
            }
            return Err(NorFlashErrorKind::Other);
        }
        Ok(())
    }
}
