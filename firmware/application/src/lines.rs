//! The lines to hosts. What came is answered, events are reported, telemetry goes to the host that asked.

use crate::drive::{Access, Asked, Commanded, LinesParts, World};
use crate::exchange::{TelemetryExchange, state};
use crate::orders::Orders;
use crate::server::{Commander, Server};
use crate::telemetry::LinkStream;
use control::journal::Journal;
use core::sync::atomic::Ordering::Relaxed;
use embedded_storage::nor_flash::NorFlash;
use link::frame::{FRAME_MAX, encode};
use link::message::DriveFrame;

/// How long an answer may take to reach its host before the drive restarts, ms.
const RESTART_MS: u32 = 50;

/// Bytes of a line that are looked at before its other work goes on.
const BYTES_AT_ONCE: usize = 64;

/// Lines of bytes, by number.
pub trait Ports {
    /// The next byte that has come on a line.
    fn take(&mut self, line: usize) -> Option<u8>;
    /// An answer will find room.
    fn has_room(&self, line: usize) -> bool;
    /// Sends a frame, whole; `false` if there is no room.
    fn put(&mut self, line: usize, frame: &[u8]) -> bool;
    /// The same, and room for an answer stays.
    fn put_telemetry(&mut self, line: usize, frame: &[u8]) -> bool;
    /// Begins to send what was put.
    fn flush(&mut self) {}
}

/// The drive's end of all lines.
#[derive(Clone, Debug)]
pub struct Lines<S> {
    servers: S,
    commander: Commander,
    asked: Asked,
    stream: LinkStream,
    /// The line that the telemetry goes to.
    recorded_by: usize,
    /// When the commander last looked, ms.
    looked: u32,
}

impl<S> Lines<S> {
    /// With a server for each line.
    pub const fn new(servers: S) -> Self {
        Self {
            servers,
            commander: Commander::new(0),
            asked: Asked::new(),
            stream: LinkStream::new(),
            recorded_by: 0,
            looked: 0,
        }
    }
}

impl<S: AsMut<[Server]>> Lines<S> {
    /// The servers.
    pub fn servers(&mut self) -> &mut S {
        &mut self.servers
    }

    /// The host of a line is gone: another may come.
    pub fn hang_up(&mut self, line: usize, telemetry: &TelemetryExchange) {
        if let Some(server) = self.servers.as_mut().get_mut(line) {
            *server = Server::new();
        }
        if line == self.recorded_by {
            self.stream = LinkStream::new();
            telemetry.end_stream();
        }
    }

    /// A look at all lines. `seed` is another with each byte. `true`: the drive is to restart.
    pub fn step<F, O, J, W>(
        &mut self,
        seed: impl Fn() -> u32,
        ports: &mut impl Ports,
        parts: &mut LinesParts<'_, F, O, J, W>,
    ) -> bool
    where
        F: NorFlash,
        O: Access<Orders>,
        J: Access<Journal>,
        W: World,
    {
        let view = parts.view;
        let now_ms = view.uptime_ms.load(Relaxed);
        if let Some(since) = self.asked.restart {
            // What is asked meanwhile is asked again.
            ports.flush();
            return now_ms.wrapping_sub(since) > RESTART_MS && !state(view).has_bridges_on();
        }
        for (line, server) in self.servers.as_mut().iter_mut().enumerate() {
            for _ in 0..BYTES_AT_ONCE {
                if !ports.has_room(line) {
                    break;
                }
                let Some(byte) = ports.take(line) else { break };
                self.commander.stir(seed());
                let now_ms = view.uptime_ms.load(Relaxed);
                let mut drive = Commanded {
                    asked: &mut self.asked,
                    parts,
                };
                server.take(byte, now_ms, &mut self.commander, &mut drive, |bytes| {
                    ports.put(line, bytes);
                });
                if self.asked.changed {
                    break;
                }
            }
            if let Some(request) = self.asked.record.take() {
                self.recorded_by = line;
                self.stream.start(parts.telemetry, request);
            }
            // The next step has the configuration that holds now.
            if core::mem::take(&mut self.asked.changed) {
                break;
            }
        }
        if now_ms != self.looked {
            self.looked = now_ms;
            if let Some(event) = self.commander.look(state(view), now_ms) {
                let mut buffer = [0; FRAME_MAX];
                if let Some(bytes) = encode(&DriveFrame::Event(event), &mut buffer) {
                    for (line, server) in self.servers.as_mut().iter().enumerate() {
                        if server.has_session() {
                            ports.put(line, bytes);
                        }
                    }
                }
            }
        }
        let line = self.recorded_by;
        self.stream
            .step(parts.configured, parts.telemetry, |bytes| {
                ports.put_telemetry(line, bytes)
            });
        ports.flush();
        false
    }
}
