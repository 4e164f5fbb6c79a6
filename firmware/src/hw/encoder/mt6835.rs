//! An MT6835 on SPI1, read by hardware alone: at the top of the motor's PWM its frame is in memory.
//!
//! A timer is put to zero at each top of the motor's PWM. Its channel 1 is the sensor's chip select: it falls [`LEAD`]
//! before the next top, when the sensor is taken to latch its angle, and rises there. Channels 2 to 4 each ask the DMA for
//! one of the three words of the burst read shortly after, which the SPI's buffer takes at once; what comes back another
//! DMA channel writes to memory. The interrupt begins 0.9 us after the top, when the currents are converted, and finds the
//! frame there: it costs a load.
//!
//! | what | when, before the top |
//! | --- | --- |
//! | chip select falls, the angle is latched | 5.50 us |
//! | the first word goes out | 5.26 us |
//! | 48 bits at 10.6 MHz (the sensor's limit is 16 MHz) are in | 0.74 us |
//! | the last word is in memory | about 0.6 us |
//!
//! When within a frame the sensor latches its angle, and how old that is by then, is not in what could be read of its
//! datasheet: measure it on a bench, by the shift of the found offset with speed. A microsecond is 0.018 degrees at 3000
//! rpm, 0.09 electrical with five pole pairs; [`LEAD`] corrects what is assumed here.

use super::{Encoder, TopOf};
use control::encoder::Interface;
use control::mt6835::BURST_READ;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use stm32g4xx_hal::stm32::{DMA1, DMAMUX, SPI1, TIM2, dma1};

/// How long before the top the chip select falls, timer counts of 1/170 us.
const LEAD: u32 = 935;
/// The same, s: the age of the angle when the currents are sampled.
pub(crate) const LEAD_S: f64 = LEAD as f64 / 170e6;
/// From the chip select's fall to the first word, timer counts: 235 ns for the sensor to get ready.
const SELECT: u32 = 40;
/// Between two words' requests, timer counts: each waits for the DMA's arbitration at most.
const NEXT: u32 = 20;

/// The words to send. A static, for the DMA has its address, in flash.
static COMMAND: [u16; 3] = BURST_READ;

/// Where the DMA writes what came back: half a word unused, then three halves of which the last two are the frame.
/// A static, for the DMA has its address.
static FRAME: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

/// DMA1's channels, from 0: 2 to 4 send, 5 receives. Requests: RM0440 table 91.
const SEND: [(usize, u32); 3] = [(2, 57), (3, 58), (4, 59)];
const RECEIVE: (usize, u32) = (5, 10);
/// Half words on both sides, circular, highest priority.
const HALVES: u32 = 1 << 8 | 1 << 10 | 1 << 5 | 3 << 12;
const ENABLE: u32 = 1;
const FROM_MEMORY: u32 = 1 << 4;
const MEMORY_COUNTS_UP: u32 = 1 << 7;

/// The sensor on SPI1, framed by TIM2.
pub(crate) struct Mt6835 {
    spi: SPI1,
    _frames: TIM2,
}

impl Mt6835 {
    /// Sets everything up; the frames begin with the PWM timer of `top`, whose period is `period` timer counts.
    pub(crate) fn start(
        spi: SPI1,
        frames: TIM2,
        (dma, mux): (&DMA1, &DMAMUX),
        top: TopOf,
        period: u32,
    ) -> Self {
        // The sensor starts with the chip and may take longer: its first frames would count as wrong.
        cortex_m::asm::delay(crate::hw::clock::CORE_HZ / 100);

        // 16 bits (DS 15), received by DMA. Mode 3, master, own select (SSM, SSI), 170 MHz / 16 (BR 3).
        // SAFETY: values of the fields (RM0440, SPI_CR2 and SPI_CR1).
        unsafe {
            spi.cr2().write(|w| w.bits(15 << 8 | 1));
            spi.cr1()
                .write(|w| w.bits(1 << 9 | 1 << 8 | 1 << 6 | 3 << 3 | 1 << 2 | 0b11));
        }
        let data = spi.dr().as_ptr() as u32;
        for ((channel, request), word) in SEND.into_iter().zip(&COMMAND) {
            // SAFETY: request and channel belong together; the addresses are a data register's and a constant's.
            unsafe {
                mux.ccr(channel).write(|w| w.bits(request));
                let channel = dma.ch(channel);
                channel.par().write(|w| w.bits(data));
                channel
                    .mar()
                    .write(|w| w.bits(core::ptr::from_ref(word) as u32));
                channel.ndtr().write(|w| w.bits(1));
                channel
                    .cr()
                    .write(|w| w.bits(HALVES | FROM_MEMORY | ENABLE));
            }
        }
        // SAFETY: as above.
        unsafe {
            mux.ccr(RECEIVE.0).write(|w| w.bits(RECEIVE.1));
            dma.ch(RECEIVE.0).par().write(|w| w.bits(data));
        }
        receive(dma);

        let select = period - LEAD;
        // SAFETY: values of the fields (RM0440, TIMx_CCRx, CCMR1, CCER, DIER, SMCR). Channel 1: PWM mode 1 (6), high until
        // its compare value. Channels 2 to 4 ask for DMA. Slave mode 8: a trigger puts the counter to zero and starts it.
        unsafe {
            frames.ccr1().write(|w| w.bits(select));
            frames.ccr2().write(|w| w.bits(select + SELECT));
            frames.ccr3().write(|w| w.bits(select + SELECT + NEXT));
            frames.ccr4().write(|w| w.bits(select + SELECT + 2 * NEXT));
            frames.ccmr1_output().write(|w| w.bits(6 << 4));
            frames.ccer().write(|w| w.bits(1));
            frames.dier().write(|w| w.bits(0b111 << 10));
            frames.smcr().write(|w| w.bits(1 << 16 | top as u32));
        }
        Self {
            spi,
            _frames: frames,
        }
    }
}

/// Lets the DMA receive, beginning with a frame's first word.
fn receive(dma: &dma1::RegisterBlock) {
    let channel = dma.ch(RECEIVE.0);
    // SAFETY: the DMA writes six bytes from the static's third on; they are atomic, so it may at any time.
    unsafe {
        channel.cr().write(|w| w.bits(0));
        channel.mar().write(|w| w.bits(FRAME.as_ptr() as u32 + 2));
        channel.ndtr().write(|w| w.bits(3));
        channel
            .cr()
            .write(|w| w.bits(HALVES | MEMORY_COUNTS_UP | ENABLE));
    }
}

impl Encoder for Mt6835 {
    const INTERFACE: Interface = Interface::Mt6835;

    #[inline(always)]
    fn word(&self) -> u32 {
        // The frame's first half was received first and lies in the lower half.
        FRAME[1].load(Relaxed).rotate_left(16)
    }

    /// Begins with a frame's first word again, should the DMA have come out of step. At the top no frame is under way.
    #[cold]
    #[inline(never)]
    fn restart(&self) {
        const RXNE: u16 = 1;
        // The buffer holds two words.
        for _ in 0..2 {
            if self.spi.sr().read().bits() & RXNE != 0 {
                let _ = self.spi.dr().read();
            }
        }
        // SAFETY: once it is started, nothing but this touches the receiving channel.
        receive(unsafe { &*DMA1::ptr() });
    }
}
