//! The queue of telemetry rows between the speed task and the lowest one: no lock, no wait, and nothing that can panic,
//! which the ready-made queues' division by their length could.

use core::sync::atomic::{AtomicU32, Ordering};

/// Words of a row.
pub(crate) const WORDS: usize = 16;
/// Rows that it holds, a power of two: 12.8 ms at 5 kHz.
pub(crate) const ROWS: usize = 64;
const _: () = assert!(ROWS.is_power_of_two());

/// One writer, one reader.
#[derive(Debug)]
pub(crate) struct Rows {
    rows: [[AtomicU32; WORDS]; ROWS],
    /// Rows written and read since the start. Their difference is what it holds.
    written: AtomicU32,
    read: AtomicU32,
}

impl Rows {
    pub(crate) const fn new() -> Self {
        Self {
            rows: [const { [const { AtomicU32::new(0) }; WORDS] }; ROWS],
            written: AtomicU32::new(0),
            read: AtomicU32::new(0),
        }
    }

    /// The writer: adds a row. `false` if there is no room.
    #[inline(always)]
    pub(crate) fn push(&self, row: [u32; WORDS]) -> bool {
        let written = self.written.load(Ordering::Relaxed);
        if written.wrapping_sub(self.read.load(Ordering::Acquire)) >= ROWS as u32 {
            return false;
        }
        for (slot, word) in self.slots(written).iter().zip(row) {
            slot.store(word, Ordering::Relaxed);
        }
        self.written
            .store(written.wrapping_add(1), Ordering::Release);
        true
    }

    /// The reader: the oldest row.
    pub(crate) fn first(&self) -> Option<[u32; WORDS]> {
        let read = self.read.load(Ordering::Relaxed);
        (self.written.load(Ordering::Acquire) != read).then(|| {
            self.slots(read)
                .each_ref()
                .map(|w| w.load(Ordering::Relaxed))
        })
    }

    /// The reader: done with the oldest row.
    pub(crate) fn drop_first(&self) {
        let read = self.read.load(Ordering::Relaxed);
        self.read.store(read.wrapping_add(1), Ordering::Release);
    }

    /// The reader: done with all rows.
    pub(crate) fn clear(&self) {
        self.read
            .store(self.written.load(Ordering::Acquire), Ordering::Release);
    }

    fn slots(&self, row: u32) -> &[AtomicU32; WORDS] {
        &self.rows[row as usize & (ROWS - 1)]
    }
}
