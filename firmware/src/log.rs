//! The log's way out: defmt's frames into RTT channel 0, without masking an interrupt and without waiting.
//!
//! A frame is put together here and goes into the channel whole, or not at all if there is no room. No interrupt is held
//! off meanwhile: a line that an interrupt wants to write upon a lower one's is dropped. A debugger may tell a channel to
//! wait for room; that is undone before each frame, for a drive must not stand still because nobody reads.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU8, Ordering::Relaxed};
use rtt_target::{ChannelMode, UpChannel};

/// Longest frame, bytes: a crash's text and what defmt adds.
const FRAME: usize = 256;

/// How many lines are being written, one upon the other. A static, as the next: defmt hands its logger no state.
static DEPTH: AtomicU8 = AtomicU8::new(0);
static LOG: Shared = Shared(UnsafeCell::new(Log {
    channel: None,
    encoder: defmt::Encoder::new(),
    frame: Bytes {
        bytes: [0; FRAME],
        length: 0,
    },
}));

struct Log {
    channel: Option<UpChannel>,
    encoder: defmt::Encoder,
    frame: Bytes,
}

struct Bytes {
    bytes: [u8; FRAME],
    /// Beyond the end, if the frame is too long.
    length: usize,
}

impl Bytes {
    fn push(&mut self, bytes: &[u8]) {
        let end = self.length.saturating_add(bytes.len());
        if let Some(room) = self.bytes.get_mut(self.length..end) {
            room.copy_from_slice(bytes);
        }
        self.length = end;
    }
}

struct Shared(UnsafeCell<Log>);

// SAFETY: the inside is reached by `lowest` and `start` only, which see to it that nobody else does.
unsafe impl Sync for Shared {}

/// Gives the log its channel. Call it before interrupts are enabled.
pub(crate) fn start(channel: UpChannel) {
    // SAFETY: interrupts are off and no line is being written.
    unsafe { &mut *LOG.0.get() }.channel = Some(channel);
}

/// Does `work` on the log, if the line that is being written is the lowest.
fn lowest(work: impl FnOnce(&mut Log)) {
    if DEPTH.load(Relaxed) == 1 {
        // SAFETY: who finds a depth of 1 has brought it there. On this single core whoever interrupts it finds more,
        // leaves the inside alone, and brings the depth back before it returns.
        work(unsafe { &mut *LOG.0.get() });
    }
}

#[defmt::global_logger]
struct Logger;

// SAFETY: `lowest` lets the lines of one context at a time through; the others' are dropped whole.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        DEPTH.store(DEPTH.load(Relaxed).saturating_add(1), Relaxed);
        lowest(|log| {
            log.frame.length = 0;
            log.encoder.start_frame(|bytes| log.frame.push(bytes));
        });
    }

    unsafe fn flush() {}

    unsafe fn release() {
        lowest(|log| {
            log.encoder.end_frame(|bytes| log.frame.push(bytes));
            let frame = log.frame.bytes.get(..log.frame.length);
            if let (Some(channel), Some(frame)) = (&mut log.channel, frame) {
                channel.set_mode(ChannelMode::NoBlockSkip);
                channel.write(frame);
            }
        });
        DEPTH.store(DEPTH.load(Relaxed).saturating_sub(1), Relaxed);
    }

    unsafe fn write(bytes: &[u8]) {
        lowest(|log| log.encoder.write(bytes, |bytes| log.frame.push(bytes)));
    }
}
