//! A serial port by LPUART1 and DMA: bytes come and go without an interrupt.
//!
//! What comes the DMA writes into a ring, which goes round; what goes it takes from another, a piece at a time. The port's two
//! channels are DMA1's last: at one priority those with lower numbers, the encoder's and the ADCs', go first (RM0440 12.4.4).

use crate::hw::clock::CORE_HZ;
use core::sync::atomic::{AtomicU8, Ordering::Relaxed, compiler_fence};
use link::SERIAL_BAUD;
use link::frame::FRAME_MAX;
use stm32g4xx_hal::stm32::{DMA1, DMAMUX, LPUART1, dma1};

/// Bytes that may come while nobody looks: 2.5 ms at the full rate.
const CAME: usize = 1024;
/// Bytes that may wait: 10 ms at the full rate.
const GOES: usize = 4096;
const _: () = assert!(CAME.is_power_of_two() && GOES.is_power_of_two());

/// The two rings. Statics, for the DMA has their addresses.
static RECEIVED: [AtomicU8; CAME] = [const { AtomicU8::new(0) }; CAME];
static SENT: [AtomicU8; GOES] = [const { AtomicU8::new(0) }; GOES];

/// The divider: 256 clock cycles a bit (RM0440 38.4.7), of a clock that is the core's (RCC_CCIPR.LPUART1SEL 0, PCLK1).
const DIVIDER: u32 = {
    let rounded = (256 * CORE_HZ as u64 + SERIAL_BAUD as u64 / 2) / SERIAL_BAUD as u64;
    assert!(
        rounded >= 0x300 && rounded < 1 << 20,
        "the clock is 3 to 4096 times the rate"
    );
    rounded as u32
};

/// DMA1's channels, from 0, and their requests (RM0440 table 91).
const RECEIVE: (usize, u32) = (6, 34);
const SEND: (usize, u32) = (7, 35);

/// DMA_CCR: bytes on both sides, memory counts up.
const ENABLE: u32 = 1;
const FROM_MEMORY: u32 = 1 << 4;
const CIRCULAR: u32 = 1 << 5;
const MEMORY_COUNTS_UP: u32 = 1 << 7;

/// The port.
pub(crate) struct Serial {
    _port: LPUART1,
    /// Where the next byte that came is.
    read: usize,
    /// Bytes written and sent so far; their difference waits.
    written: usize,
    sent: usize,
    /// Bytes that the DMA was last given.
    given: usize,
}

impl Serial {
    /// Starts it: eight bits, no parity, one stop bit.
    pub(crate) fn start(port: LPUART1, mux: &DMAMUX) -> Self {
        let (from, to) = (port.rdr().as_ptr() as u32, port.tdr().as_ptr() as u32);
        let dma = dma();
        // SAFETY: values of the fields (RM0440, LPUART_BRR, CR3, CR1; DMA_CCR); the addresses are data registers' and statics',
        // which are atomic, so that the DMA may use them at any time. A byte that nobody took is overwritten (OVRDIS): its frame
        // is damaged and counted. Both ways have the FIFO.
        unsafe {
            const OVRDIS: u32 = 1 << 12;
            const DMAT: u32 = 1 << 7;
            const DMAR: u32 = 1 << 6;
            const FIFOEN: u32 = 1 << 29;
            const TE_RE_UE: u32 = 0b1101;
            port.brr().write(|w| w.bits(DIVIDER));
            port.cr3().write(|w| w.bits(OVRDIS | DMAT | DMAR));
            mux.ccr(RECEIVE.0).write(|w| w.bits(RECEIVE.1));
            mux.ccr(SEND.0).write(|w| w.bits(SEND.1));
            dma.ch(SEND.0).par().write(|w| w.bits(to));
            let receive = dma.ch(RECEIVE.0);
            receive.par().write(|w| w.bits(from));
            receive.mar().write(|w| w.bits(RECEIVED.as_ptr() as u32));
            receive.ndtr().write(|w| w.bits(CAME as u32));
            receive
                .cr()
                .write(|w| w.bits(CIRCULAR | MEMORY_COUNTS_UP | ENABLE));
            port.cr1().write(|w| w.bits(FIFOEN | TE_RE_UE));
        }
        Self {
            _port: port,
            read: 0,
            written: 0,
            sent: 0,
            given: 0,
        }
    }

    /// The next byte that has come.
    pub(crate) fn take(&mut self) -> Option<u8> {
        let left = dma().ch(RECEIVE.0).ndtr().read().bits() as usize;
        let write = CAME.wrapping_sub(left) & (CAME - 1);
        if self.read == write {
            return None;
        }
        let byte = RECEIVED[self.read & (CAME - 1)].load(Relaxed);
        self.read = (self.read + 1) & (CAME - 1);
        Some(byte)
    }

    /// Bytes that can be put.
    pub(crate) fn room(&self) -> usize {
        GOES - self.written.wrapping_sub(self.sent)
    }

    /// Sends bytes, all of them or, where there is no room, none: `false`.
    pub(crate) fn put(&mut self, bytes: &[u8]) -> bool {
        if bytes.len() > self.room() {
            return false;
        }
        for (k, byte) in bytes.iter().enumerate() {
            SENT[self.written.wrapping_add(k) & (GOES - 1)].store(*byte, Relaxed);
        }
        self.written = self.written.wrapping_add(bytes.len());
        true
    }

    /// Room for an answer, whatever else goes.
    pub(crate) fn has_room(&self) -> bool {
        self.room() >= FRAME_MAX
    }

    /// Gives the DMA what waits, up to the ring's end, if it has done the last.
    pub(crate) fn go_on(&mut self) {
        let channel = dma().ch(SEND.0);
        if self.given > 0 {
            if channel.ndtr().read().bits() > 0 {
                return;
            }
            self.sent = self.sent.wrapping_add(self.given);
            self.given = 0;
        }
        let waits = self.written.wrapping_sub(self.sent);
        if waits == 0 {
            return;
        }
        let first = self.sent & (GOES - 1);
        self.given = waits.min(GOES - first);
        // What the DMA reads is written.
        compiler_fence(core::sync::atomic::Ordering::SeqCst);
        // SAFETY: as in `start`; the piece is within the ring, and is not written before the DMA is done.
        unsafe {
            channel.cr().write(|w| w.bits(0));
            channel.mar().write(|w| w.bits(SENT[first].as_ptr() as u32));
            channel.ndtr().write(|w| w.bits(self.given as u32));
            channel
                .cr()
                .write(|w| w.bits(FROM_MEMORY | MEMORY_COUNTS_UP | ENABLE));
        }
    }
}

fn dma() -> &'static dma1::RegisterBlock {
    // SAFETY: once it is started, nothing but the port touches its two channels.
    unsafe { &*DMA1::ptr() }
}
