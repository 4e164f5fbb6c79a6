//! Lines of bytes to a simulated drive, and its time.

use super::SimulatedDrive;
use link::frame::{FRAME_MAX, encode};
use link::message::DriveFrame;
use link::server::{Commander, Server};
use std::collections::{BTreeMap, VecDeque};

/// Bytes of a line that are looked at in a millisecond: more than a serial port of 2 Mbaud brings, so that a flood on one
/// line takes no time from the drive.
const BYTES_A_MS: usize = 256;
/// Bytes that may wait on a line before it is read no further.
const WAITING_IN: usize = 16 * 1024;
/// Bytes that may wait for a host before telemetry waits too.
const WAITING_OUT: usize = 64 * 1024;

/// A line's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LineId(u32);

#[derive(Debug, Default)]
struct Line {
    server: Server,
    came: VecDeque<u8>,
    goes: Vec<u8>,
}

/// A simulated drive and the lines to it.
#[derive(Debug)]
pub struct Serving {
    drive: SimulatedDrive,
    commander: Commander,
    lines: BTreeMap<LineId, Line>,
    next: u32,
    /// The line that the telemetry goes to.
    recorded_by: Option<LineId>,
    ms: u64,
}

impl Serving {
    /// A drive with no line yet.
    #[must_use]
    pub fn new(drive: SimulatedDrive) -> Self {
        Self {
            drive,
            // A simulated drive is another with each start: nobody has frames of an earlier one.
            commander: Commander::new(0),
            lines: BTreeMap::new(),
            next: 0,
            recorded_by: None,
            ms: 0,
        }
    }

    /// A host connects.
    pub fn open(&mut self) -> LineId {
        self.next += 1;
        let id = LineId(self.next);
        self.lines.insert(id, Line::default());
        id
    }

    /// A host is gone. What it asked goes on until its heartbeat is missed.
    pub fn close(&mut self, id: LineId) {
        self.lines.remove(&id);
    }

    /// How many more bytes of a line may come before it is to be read no further.
    #[must_use]
    pub fn room(&self, id: LineId) -> usize {
        let waiting = self.lines.get(&id).map_or(0, |line| line.came.len());
        WAITING_IN.saturating_sub(waiting)
    }

    /// Bytes have come on a line.
    pub fn receive(&mut self, id: LineId, bytes: &[u8]) {
        if let Some(line) = self.lines.get_mut(&id) {
            line.came.extend(bytes);
        }
    }

    /// Bytes that go out on a line; what was sent is to be [`sent`](Self::sent).
    #[must_use]
    pub fn outgoing(&self, id: LineId) -> &[u8] {
        self.lines.get(&id).map_or(&[], |line| &line.goes)
    }

    /// So many of them have gone.
    pub fn sent(&mut self, id: LineId, bytes: usize) {
        if let Some(line) = self.lines.get_mut(&id) {
            line.goes.drain(..bytes.min(line.goes.len()));
        }
    }

    /// A host takes its bytes slower than they come.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.lines
            .values()
            .any(|line| line.goes.len() >= WAITING_OUT)
    }

    /// The drive.
    #[must_use]
    pub fn drive(&self) -> &SimulatedDrive {
        &self.drive
    }

    /// The same, to look into its flash.
    pub fn drive_mut(&mut self) -> &mut SimulatedDrive {
        &mut self.drive
    }

    /// A millisecond: what came is answered, then the machine moves on.
    pub fn millisecond(&mut self) {
        let Self {
            drive,
            commander,
            lines,
            recorded_by,
            ..
        } = self;
        let now_ms = drive.uptime_ms();
        for (id, line) in lines.iter_mut() {
            let count = line.came.len().min(BYTES_A_MS);
            for byte in line.came.drain(..count) {
                let records = drive.records();
                let goes = &mut line.goes;
                line.server.take(byte, now_ms, commander, drive, |bytes| {
                    goes.extend_from_slice(bytes);
                });
                if drive.records() != records {
                    *recorded_by = Some(*id);
                }
            }
        }
        self.ms += 1;
        let until = self.drive.periods_until(self.ms);
        while self.drive.periods() < until {
            self.drive.period();
        }
        let event = self
            .commander
            .look(self.drive.drive().state(), self.drive.uptime_ms());
        if let Some(event) = event {
            for line in self.lines.values_mut() {
                put(&mut line.goes, &DriveFrame::Event(event));
            }
        }
        let line = self.recorded_by.and_then(|id| self.lines.get_mut(&id));
        if let Some(line) = line {
            while line.goes.len() < WAITING_OUT
                && let Some(frame) = self.drive.take_telemetry()
            {
                put(&mut line.goes, &DriveFrame::Telemetry(frame));
            }
        }
    }
}

fn put(goes: &mut Vec<u8>, frame: &DriveFrame) {
    if let Some(bytes) = encode(frame, &mut [0; FRAME_MAX]) {
        goes.extend_from_slice(bytes);
    }
}
