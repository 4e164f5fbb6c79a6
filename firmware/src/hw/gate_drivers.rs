//! The gate drivers in a fault: a driver that pulls its fault line is put to sleep, and a reset wakes it.
//!
//! A gate-drive fault of the DRV8323 stays until its ENABLE was low for 8 to 40 us (SLVSDJ3D 8.3.6, quoted by a public review of a
//! board with this driver). Asleep it is low for a millisecond at least. The supervision counts the time until it is awake again, so
//! that no interrupt waits for it.

use crate::board;
use crate::hw::inputs::FaultLine;
use crate::hw::outputs::Output;

/// Looks, one a millisecond, for which a line is pulled until its driver is put to sleep. Before that the supervision has told an
/// emergency stop from a fault of the driver.
const PULLED_LOOKS: u32 = 5;
/// Looks until a driver is awake: the first may come at once.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const WAKE_LOOKS: u32 = (board::DRIVER_WAKE_S * 1e3) as u32 + 2;

/// One motor's driver.
struct Driver {
    enable: Output,
    line: FaultLine,
    asleep: bool,
    pulled: u32,
    waking: u32,
}

/// Both, as the supervision sees to them.
pub(crate) struct GateDrivers([Option<Driver>; 2]);

impl GateDrivers {
    /// Awake drivers: their enables and their fault lines. A driver without an enable stays as it is.
    pub(crate) fn new(enables: [Option<Output>; 2], [screw, nut]: [FaultLine; 2]) -> Self {
        let [screw_enable, nut_enable] = enables;
        let driver = |enable: Option<Output>, line| {
            enable.map(|enable| Driver {
                enable,
                line,
                asleep: false,
                pulled: 0,
                waking: 0,
            })
        };
        Self([driver(screw_enable, screw), driver(nut_enable, nut)])
    }

    /// Once a millisecond: whether the drive is in a fault, and whether it is asked to leave it. Gives those that the drive has put to
    /// sleep, or that wake: screw's, nut's.
    pub(crate) fn step(&mut self, fault: bool, reset: bool) -> [bool; 2] {
        self.0.each_mut().map(|driver| match driver {
            Some(driver) => driver.step(fault, reset),
            None => false,
        })
    }
}

impl Driver {
    /// Whether it sleeps from now on.
    fn step(&mut self, fault: bool, reset: bool) -> bool {
        self.pulled = if fault && self.line.is_pulled() {
            self.pulled.saturating_add(1)
        } else {
            0
        };
        self.waking = if self.asleep && reset {
            self.waking.saturating_add(1)
        } else {
            0
        };
        self.asleep = if self.asleep {
            self.waking <= WAKE_LOOKS
        } else {
            self.pulled >= PULLED_LOOKS
        };
        self.enable.switch(!self.asleep || self.waking > 0);
        self.asleep
    }
}
