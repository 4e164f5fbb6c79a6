//! Lines of bytes to a simulated drive, and its time.

use super::SimulatedDrive;
use application::lines::Ports;
use std::collections::VecDeque;

/// Looks at the lines in a millisecond, of 64 bytes a line each: more than a serial port of 2 Mbaud brings, so that a flood on one
/// line takes no time from the drive.
const LOOKS_A_MS: u32 = 4;
/// Bytes that may wait on a line before it is read no further.
const WAITING_IN: usize = 16 * 1024;
/// Bytes that may wait for a host before telemetry waits too.
const WAITING_OUT: usize = 64 * 1024;

/// A line's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LineId(u32);

#[derive(Debug, Default)]
struct Line {
    came: VecDeque<u8>,
    goes: Vec<u8>,
}

/// The lines by number. A number whose host is gone has none, and is taken again.
#[derive(Debug, Default)]
struct Open(Vec<Option<(LineId, Line)>>);

impl Open {
    fn line(&self, id: LineId) -> Option<&Line> {
        let mut lines = self.0.iter().flatten();
        lines.find(|(other, _)| *other == id).map(|(_, line)| line)
    }

    fn line_mut(&mut self, id: LineId) -> Option<&mut Line> {
        let mut lines = self.0.iter_mut().flatten();
        lines.find(|(other, _)| *other == id).map(|(_, line)| line)
    }

    fn at(&mut self, line: usize) -> Option<&mut Line> {
        self.0
            .get_mut(line)
            .and_then(|line| line.as_mut().map(|(_, line)| line))
    }
}

impl Ports for Open {
    fn take(&mut self, line: usize) -> Option<u8> {
        self.at(line)?.came.pop_front()
    }

    fn has_room(&self, _: usize) -> bool {
        true
    }

    fn put(&mut self, line: usize, frame: &[u8]) -> bool {
        // What nobody hears is gone.
        if let Some(line) = self.at(line) {
            line.goes.extend_from_slice(frame);
        }
        true
    }

    fn put_telemetry(&mut self, line: usize, frame: &[u8]) -> bool {
        let full = |line: &mut Line| line.goes.len() >= WAITING_OUT;
        !self.at(line).is_some_and(full) && self.put(line, frame)
    }
}

/// A simulated drive and the lines to it.
#[derive(Debug)]
pub struct Serving {
    drive: SimulatedDrive,
    lines: Open,
    next: u32,
    ms: u64,
}

impl Serving {
    /// A drive with no line yet.
    #[must_use]
    pub fn new(drive: SimulatedDrive) -> Self {
        Self {
            drive,
            lines: Open::default(),
            next: 0,
            ms: 0,
        }
    }

    /// A host connects.
    pub fn open(&mut self) -> LineId {
        self.next += 1;
        let id = LineId(self.next);
        let lines = &mut self.lines.0;
        let free = lines.iter().position(Option::is_none);
        let line = free.unwrap_or(lines.len());
        if free.is_none() {
            lines.push(None);
        }
        lines[line] = Some((id, Line::default()));
        self.drive.open_line(line);
        id
    }

    /// A host is gone. What it asked goes on until its heartbeat is missed.
    pub fn close(&mut self, id: LineId) {
        for line in &mut self.lines.0 {
            if line.as_ref().is_some_and(|(other, _)| *other == id) {
                *line = None;
            }
        }
    }

    /// How many more bytes of a line may come before it is to be read no further.
    #[must_use]
    pub fn room(&self, id: LineId) -> usize {
        let waiting = self.lines.line(id).map_or(0, |line| line.came.len());
        WAITING_IN.saturating_sub(waiting)
    }

    /// Bytes have come on a line.
    pub fn receive(&mut self, id: LineId, bytes: &[u8]) {
        if let Some(line) = self.lines.line_mut(id) {
            line.came.extend(bytes);
        }
    }

    /// Bytes that go out on a line; what was sent is to be [`sent`](Self::sent).
    #[must_use]
    pub fn outgoing(&self, id: LineId) -> &[u8] {
        self.lines.line(id).map_or(&[], |line| &line.goes)
    }

    /// So many of them have gone.
    pub fn sent(&mut self, id: LineId, bytes: usize) {
        if let Some(line) = self.lines.line_mut(id) {
            line.goes.drain(..bytes.min(line.goes.len()));
        }
    }

    /// A host takes its bytes slower than they come.
    #[must_use]
    pub fn is_full(&self) -> bool {
        let mut lines = self.lines.0.iter().flatten();
        lines.any(|(_, line)| line.goes.len() >= WAITING_OUT)
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

    /// Milliseconds that have passed.
    #[must_use]
    pub fn ms(&self) -> u64 {
        self.ms
    }

    /// A millisecond: what came is answered, then the machine moves on.
    pub fn millisecond(&mut self) {
        for _ in 0..LOOKS_A_MS {
            self.drive.serve(&mut self.lines);
        }
        self.ms += 1;
        let until = self.drive.periods_until(self.ms);
        while self.drive.periods() < until {
            self.drive.period();
        }
        self.drive.serve(&mut self.lines);
    }
}
