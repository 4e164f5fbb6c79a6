//! SPI1 as a master of 16-bit words (RM0440, SPI), and the MT6835 at its pins.

use super::registers::Registers;
use std::collections::VecDeque;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SR: u32 = 0x08;
const DR: u32 = 0x0C;

/// Words that the transmit buffer holds beside the one that is being sent, and that the receive buffer holds.
const BUFFER: usize = 2;

/// What the sensor's line reads while it does not drive it: the board pulls it up.
const PULLED_UP: u16 = 0xFFFF;

/// The sensor.
#[derive(Default)]
struct Sensor {
    /// The frame that was latched when it was selected.
    frame: Option<u32>,
    /// The command's first word was a burst read of the angle.
    asked: bool,
    words: usize,
}

impl Sensor {
    /// A word is exchanged: what it sends for `word`.
    fn exchange(&mut self, word: u16) -> u16 {
        const BURST_READ_OF_THE_ANGLE: u16 = 0xA003;
        let Some(frame) = self.frame else {
            return PULLED_UP;
        };
        self.words += 1;
        #[allow(clippy::cast_possible_truncation)]
        match self.words {
            1 => {
                self.asked = word == BURST_READ_OF_THE_ANGLE;
                PULLED_UP
            }
            2 if self.asked => (frame >> 16) as u16,
            3 if self.asked => frame as u16,
            _ => PULLED_UP,
        }
    }
}

/// SPI1 with its sensor.
pub struct Spi {
    registers: Registers,
    sending: VecDeque<u16>,
    /// When the word under way has been exchanged.
    done: Option<u64>,
    received: VecDeque<u16>,
    sensor: Sensor,
    /// When the last word was exchanged.
    pub last: u64,
}

impl Spi {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        Self {
            registers: Registers::new("SPI1", &[("CR1", CR1, 0), ("CR2", CR2, 0x0700)]),
            sending: VecDeque::new(),
            done: None,
            received: VecDeque::new(),
            sensor: Sensor::default(),
            last: 0,
        }
    }

    /// The chip select falls, and the sensor latches `frame`; or it rises.
    pub fn select(&mut self, frame: Option<u32>) {
        self.sensor = Sensor {
            frame,
            ..Sensor::default()
        };
    }

    /// When the word under way has been exchanged.
    #[must_use]
    pub fn done_at(&self) -> Option<u64> {
        self.done
    }

    fn word_time(&self) -> Result<u64, String> {
        // CPHA, CPOL, MSTR, SPE, SSI, SSM; 16 bits. The sensor takes 16 MHz at most.
        let (cr1, cr2) = (self.registers.get("CR1"), self.registers.get("CR2"));
        if cr1 & !(7 << 3) != 0b11_0100_0111 || cr2 >> 8 & 15 != 15 {
            return Err(format!(
                "SPI1 is not a master in mode 3 with words of 16 bits (CR1 {cr1:#x}, CR2 {cr2:#x})"
            ));
        }
        let divider = 2u64 << (cr1 >> 3 & 7);
        if super::CORE_HZ / divider > 16_000_000 {
            return Err("SPI1 is faster than its sensor's 16 MHz".into());
        }
        Ok(16 * divider)
    }

    /// The data register is written.
    ///
    /// # Errors
    /// The buffer is full, or the SPI is not set up as the sensor needs it.
    pub fn send(&mut self, word: u16, now: u64) -> Result<(), String> {
        if self.sending.len() > BUFFER {
            return Err("SPI1's transmit buffer is full".into());
        }
        self.sending.push_back(word);
        if self.done.is_none() {
            self.done = Some(now + self.word_time()?);
        }
        Ok(())
    }

    /// The word under way has been exchanged: `true` if the DMA is asked to fetch what came.
    ///
    /// # Errors
    /// Nobody has fetched what came before.
    pub fn finish(&mut self, now: u64) -> Result<bool, String> {
        let Some(word) = self.sending.pop_front() else {
            return Ok(false);
        };
        self.last = now;
        self.done = match self.sending.is_empty() {
            true => None,
            false => Some(now + self.word_time()?),
        };
        if self.received.len() == BUFFER {
            return Err("SPI1's receive buffer overflows".into());
        }
        self.received.push_back(self.sensor.exchange(word));
        Ok(self.registers.get("CR2") & 1 == 1)
    }

    /// The data register is read.
    pub fn receive(&mut self) -> u16 {
        self.received.pop_front().unwrap_or(0)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&mut self, offset: u32) -> Result<u32, String> {
        const TXE: u32 = 2;
        Ok(match offset {
            SR => u32::from(!self.received.is_empty()) | TXE,
            DR => u32::from(self.receive()),
            _ => self.registers.read(offset)?,
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        self.registers.write(offset, value).map(|_| ())
    }
}

impl Default for Spi {
    fn default() -> Self {
        Self::new()
    }
}
