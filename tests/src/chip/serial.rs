//! LPUART1 with DMA both ways (RM0440 38): bytes at its pins, at the rate that is set.
//!
//! A piece that the firmware gives the DMA is read from memory when it is given: the firmware must leave it as it is until it
//! has gone. Bytes go one after the other without a pause. Parity, flow control and interrupts are not modelled.

use super::registers::Registers;
use std::collections::VecDeque;

/// Requests to DMAMUX1 (RM0440 table 91).
pub const RECEIVED: u32 = 34;
/// The transmitter takes a byte.
pub const SENDS: u32 = 35;
/// Data registers.
pub const RDR: u32 = 0x4000_8024;
/// The other.
pub const TDR: u32 = 0x4000_8028;

const CR1: u32 = 0x00;
const CR3: u32 = 0x08;

/// LPUART1, and the wire at its pins.
pub struct Serial {
    registers: Registers,
    /// What a host has sent, and when its next byte is there.
    coming: VecDeque<u8>,
    next: Option<u64>,
    /// The piece under way, since when, and how much of it has gone.
    piece: Vec<u8>,
    since: u64,
    gone: usize,
    /// What has gone, for the host.
    sent: Vec<u8>,
    /// Bytes that came while nobody listened.
    pub lost: u64,
}

impl Serial {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        Self {
            registers: Registers::new(
                "LPUART1",
                &[
                    ("CR1", CR1, 0),
                    ("CR2", 0x04, 0),
                    ("CR3", CR3, 0),
                    ("BRR", 0x0C, 0),
                    ("PRESC", 0x2C, 0),
                ],
            ),
            coming: VecDeque::new(),
            next: None,
            piece: Vec::new(),
            since: 0,
            gone: 0,
            sent: Vec::new(),
            lost: 0,
        }
    }

    /// Core cycles of a byte with its start and stop bit (RM0440 38.4.7): 256 cycles of the clock make the divider.
    fn byte_cycles(&self) -> Result<u64, String> {
        let (cr1, divider) = (self.registers.get("CR1"), self.registers.get("BRR"));
        const FIFOEN: u32 = 1 << 29;
        if cr1 & !FIFOEN != 0b1101 || self.registers.get("CR2") != 0 {
            return Err(format!(
                "LPUART1 is not on both ways with eight bits, no parity and one stop bit (CR1 {cr1:#x})"
            ));
        }
        if !(0x300..1 << 20).contains(&divider) {
            return Err(format!(
                "LPUART1 is not set to 3 to 4096 clocks a bit (BRR {divider:#x})"
            ));
        }
        Ok(u64::from(divider) * 10 / 256)
    }

    fn needs(&self, bit: u32, name: &str) -> Result<(), String> {
        match self.registers.get("CR3") & bit {
            0 => Err(format!("LPUART1's {name} is off")),
            _ => Ok(()),
        }
    }

    /// Bits a second that it is set to, and `None` while it is off.
    #[must_use]
    pub fn baud(&self) -> Option<f64> {
        self.byte_cycles().ok()?;
        Some(super::CORE_HZ as f64 * 256.0 / f64::from(self.registers.get("BRR")))
    }

    /// A host sends bytes from now on.
    pub fn host_sends(&mut self, bytes: &[u8], now: u64) {
        let Ok(cycles) = self.byte_cycles() else {
            self.lost += bytes.len() as u64;
            return;
        };
        self.coming.extend(bytes);
        if self.next.is_none() && !self.coming.is_empty() {
            self.next = Some(now + cycles);
        }
    }

    /// What has gone to the host since the last call.
    pub fn host_takes(&mut self, now: u64) -> Vec<u8> {
        self.pass(now);
        std::mem::take(&mut self.sent)
    }

    /// When the next byte has come.
    #[must_use]
    pub fn next_at(&self) -> Option<u64> {
        self.next
    }

    /// A byte has come.
    ///
    /// # Errors
    /// The port is not set up for it.
    pub fn come(&mut self, now: u64) -> Result<u8, String> {
        const DMAR: u32 = 1 << 6;
        const OVRDIS: u32 = 1 << 12;
        self.needs(DMAR, "DMA of what it receives")?;
        self.needs(OVRDIS, "way to go on after an overrun")?;
        let byte = self.coming.pop_front().unwrap_or_default();
        self.next = match self.coming.is_empty() {
            true => None,
            false => Some(now + self.byte_cycles()?),
        };
        Ok(byte)
    }

    /// The DMA was given a piece.
    ///
    /// # Errors
    /// The port is not set up for it, or the last piece has not gone.
    pub fn give(&mut self, piece: Vec<u8>, now: u64) -> Result<(), String> {
        const DMAT: u32 = 1 << 7;
        self.needs(DMAT, "DMA of what it sends")?;
        self.byte_cycles()?;
        self.pass(now);
        if self.gone < self.piece.len() {
            return Err("LPUART1 is given a piece while another goes".into());
        }
        (self.piece, self.since, self.gone) = (piece, now, 0);
        Ok(())
    }

    /// Time has passed: bytes of the piece that have not gone yet.
    pub fn pass(&mut self, now: u64) -> usize {
        if let Ok(cycles) = self.byte_cycles() {
            let gone = usize::try_from((now - self.since) / cycles).unwrap_or(usize::MAX);
            let gone = gone.min(self.piece.len());
            self.sent.extend(&self.piece[self.gone..gone]);
            self.gone = gone;
        }
        self.piece.len() - self.gone
    }

    /// The registers.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        self.registers.read(offset)
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        self.registers.write(offset, value).map(|_| ())
    }
}

impl Default for Serial {
    fn default() -> Self {
        Self::new()
    }
}
