//! The lines to hosts: the serial port, and RTT's link channels. The application answers what comes.

use crate::config::{Change, configured, words};
use crate::debug_view::DRIVE_VIEW;
use crate::hw::cycles;
use crate::hw::flash::SettingsPages;
use crate::hw::serial::Serial;
use crate::motor_loop::exchanges;
use application::burst::Burst;
use application::drive::{Access, LinesParts, World};
use application::exchange::TelemetryExchange;
use application::keep::Keeper;
use application::lines::Ports;
use application::orders::Orders;
use application::server::{NotSet, Server};
use control::journal::Journal;
use cortex_m::peripheral::SCB;
use link::frame::FRAME_MAX;
use link::settings::Settings;
use rtic::Mutex;
use rtt_target::{ChannelMode, DownChannel, UpChannel};

/// Bytes of the link's RTT channels: to the host, telemetry for 45 ms at 5 kHz; from the host, a few commands.
pub(crate) const RTT_UP_BYTES: usize = 11_500;
pub(crate) const RTT_DOWN_BYTES: usize = 512;

/// What the speed task tells the lines.
///
/// A static, for its address is a constant to the speed task. By a reference that RTIC holds that task takes 35 cycles more; what is
/// `Shared` by value would be cleared with the timers running.
pub(crate) static TELEMETRY: TelemetryExchange = TelemetryExchange::new();

/// Line 0: the serial port. Line 1: RTT.
struct Both {
    serial: Serial,
    up: UpChannel,
    down: DownChannel,
}

impl Ports for Both {
    fn take(&mut self, line: usize) -> Option<u8> {
        if line == 0 {
            return self.serial.take();
        }
        let mut byte = [0];
        (self.down.read(&mut byte) == 1).then_some(byte[0])
    }

    /// Whether RTT has room shows when it is written. A host that reads nothing gets no answer.
    fn has_room(&self, line: usize) -> bool {
        line != 0 || self.serial.has_room()
    }

    fn put(&mut self, line: usize, frame: &[u8]) -> bool {
        if line == 0 {
            return self.serial.put(frame);
        }
        // A debugger may have told the channel to wait for room.
        self.up.set_mode(ChannelMode::NoBlockSkip);
        self.up.write(frame) == frame.len()
    }

    fn put_telemetry(&mut self, line: usize, frame: &[u8]) -> bool {
        (line != 0 || self.serial.room() >= frame.len() + FRAME_MAX) && self.put(line, frame)
    }

    fn flush(&mut self) {
        self.serial.go_on();
    }
}

/// What another task uses too, under RTIC's lock.
struct Locked<'a, M>(&'a mut M);

impl<T: 'static, M: Mutex<T = &'static mut T>> Access<T> for Locked<'_, M> {
    fn with<R>(&mut self, look: impl FnOnce(&mut T) -> R) -> R {
        self.0.lock(|it| look(it))
    }
}

/// The real drive.
struct Board {
    /// What the last settings that were tried make.
    change: Change,
    /// It is to hold.
    changed: bool,
}

impl World for Board {
    const SIMULATED: bool = false;

    fn fits(&mut self, settings: &Settings, before: &Settings) -> Result<(), NotSet> {
        self.change.fits(settings, before)
    }

    fn take_up(&mut self) {
        self.changed = true;
    }
}

/// All lines, and the one drive.
pub struct Lines {
    /// Once they are started, and the settings that the drive runs on.
    ports: Option<(Both, &'static Burst, &'static mut Keeper<SettingsPages>)>,
    lines: application::lines::Lines<[Server; 2]>,
    board: Board,
}

impl Lines {
    /// Without a port.
    pub(crate) const fn new() -> Self {
        Self {
            ports: None,
            lines: application::lines::Lines::new([const { Server::new() }; 2]),
            board: Board {
                change: Change::new(),
                changed: false,
            },
        }
    }

    /// Serves these ports from now on.
    #[inline(never)]
    pub(crate) fn start(
        &mut self,
        serial: Serial,
        up: UpChannel,
        down: DownChannel,
        burst: &'static Burst,
        keeper: &'static mut Keeper<SettingsPages>,
    ) {
        self.ports = Some((Both { serial, up, down }, burst, keeper));
    }

    /// A look at all lines: what came is answered, and what waits goes. `readers` holds off the tasks that read the configuration.
    pub(crate) fn step(
        &mut self,
        orders: &mut impl Mutex<T = &'static mut Orders>,
        journal: &mut impl Mutex<T = &'static mut Journal>,
        readers: &mut impl Mutex<T = ()>,
    ) {
        let Some((both, burst, keeper)) = &mut self.ports else {
            return;
        };
        let mut parts = LinesParts {
            configured: configured(),
            words: words(),
            telemetry: &TELEMETRY,
            burst,
            view: &DRIVE_VIEW,
            motors: exchanges(),
            keeper: *keeper,
            orders: &mut Locked(orders),
            journal: &mut Locked(journal),
            world: &mut self.board,
        };
        if self.lines.step(cycles::now, both, &mut parts) {
            SCB::sys_reset();
        }
        if core::mem::take(&mut self.board.changed) {
            // SAFETY: it was tried before. This step has ended with the old one.
            readers.lock(|()| unsafe { self.board.change.take_up() });
        }
    }
}
