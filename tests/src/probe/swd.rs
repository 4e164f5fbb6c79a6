//! Serial wire debug, bit by bit (ARM IHI 0031E, B4 and B5): what wakes the port, and its requests.
//!
//! A request need not begin where a command of the probe begins, so each clock is a step of one machine.

use super::port::{Acknowledge, Port, Register};
use crate::emulator::Emulator;

/// So many ones reset the line.
const RESET: u32 = 50;
/// The last bits, the newest highest: JTAG to SWD, SWD to JTAG; to the dormant state from SWD and from JTAG.
const JTAG_TO_SWD: u128 = 0xE79E;
const SWD_TO_JTAG: u128 = 0xE73C;
const SWD_TO_DORMANT: u128 = 0xE3BC;
const JTAG_TO_DORMANT: u128 = 0x33BB_BBBA;
/// Wakes a dormant port, and after four zeros selects SWD.
const ALERT: u128 = 0x19BC_0EA2_E3DD_AFE9_8685_2D95_6209_F392;
const ACTIVATION: u128 = 0x1A0;

/// What the port listens for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Jtag,
    Dormant,
    /// The selection alert has come.
    Alerted,
    Swd,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Request {
    register: Register,
    reads: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// After an error: until the line is reset.
    Lost,
    Idle,
    /// Bits of a request so far, and their number.
    Header(u32, u32),
    /// The line changes hands.
    Turn(Request),
    /// Bits of the acknowledgement that are out.
    Acknowledge(Request, Acknowledge, u32),
    /// Bits of data and parity that are out.
    Read(u64, u32),
    TurnToWrite(Request, Acknowledge),
    /// Bits of data and parity that are in, and their number.
    Write(Request, Acknowledge, u64, u32),
    TurnToIdle,
}

/// The wire's end at the chip.
#[derive(Clone, Debug)]
pub struct Wire {
    mode: Mode,
    phase: Phase,
    ones: u32,
    last: u128,
    /// What a read has found, while it goes out.
    word: u32,
}

impl Default for Wire {
    fn default() -> Self {
        Self {
            mode: Mode::Jtag,
            phase: Phase::Lost,
            ones: 0,
            last: 0,
            word: 0,
        }
    }
}

impl Wire {
    /// One clock, in which the probe drives the line or listens: the line's level. A line that nobody drives is high.
    pub fn clock(&mut self, driven: Option<bool>, port: &mut Port, chip: &mut Emulator) -> bool {
        let level = driven.unwrap_or(true);
        if Port::is_closed(chip) {
            return level;
        }
        if let Some(bit) = driven {
            self.listen(bit);
        }
        if self.mode != Mode::Swd {
            return level;
        }
        self.step(level, port, chip)
    }

    /// Looks for what switches the port and for a line reset.
    fn listen(&mut self, bit: bool) {
        self.last = self.last >> 1 | u128::from(bit) << 127;
        let ends = |bits: u32, code: u128| self.last >> (128 - bits) == code;
        self.mode = match self.mode {
            Mode::Jtag if ends(16, JTAG_TO_SWD) => Mode::Swd,
            Mode::Jtag if ends(31, JTAG_TO_DORMANT) => Mode::Dormant,
            // Within a request the same bits mean nothing.
            Mode::Swd if self.ones == 0 && self.phase == Phase::Lost && ends(16, SWD_TO_JTAG) => {
                Mode::Jtag
            }
            Mode::Swd if self.phase == Phase::Lost && ends(16, SWD_TO_DORMANT) => Mode::Dormant,
            Mode::Dormant if ends(128, ALERT) => Mode::Alerted,
            Mode::Alerted if ends(12, ACTIVATION) => Mode::Swd,
            mode => mode,
        };
        self.ones = if bit { self.ones + 1 } else { 0 };
        if self.ones >= RESET {
            self.phase = Phase::Idle;
        }
    }

    /// A clock of SWD: the line's level.
    fn step(&mut self, level: bool, port: &mut Port, chip: &mut Emulator) -> bool {
        let mut line = level;
        self.phase = match self.phase {
            Phase::Lost => Phase::Lost,
            // The ones of a line reset begin nothing.
            Phase::Idle if level && self.ones < RESET => Phase::Header(1, 1),
            Phase::Idle => Phase::Idle,
            Phase::Header(bits, count) => {
                let bits = bits | u32::from(level) << count;
                match count {
                    7 => request(bits).map_or(Phase::Lost, Phase::Turn),
                    _ => Phase::Header(bits, count + 1),
                }
            }
            Phase::Turn(request) => {
                let acknowledge = match request.reads {
                    true => {
                        let (acknowledge, word) = port.read(request.register, chip);
                        self.word = word;
                        acknowledge
                    }
                    false => port.accepts_write(request.register),
                };
                Phase::Acknowledge(request, acknowledge, 0)
            }
            Phase::Acknowledge(request, acknowledge, out) => {
                let code = match acknowledge {
                    Acknowledge::Ok => 0b001,
                    Acknowledge::Fault => 0b100,
                };
                line = code >> out & 1 == 1;
                let data = acknowledge == Acknowledge::Ok || port.detects_overrun();
                match (out, data, request.reads) {
                    (0 | 1, ..) => Phase::Acknowledge(request, acknowledge, out + 1),
                    (_, true, true) => Phase::Read(with_parity(self.word), 0),
                    (_, true, false) => Phase::TurnToWrite(request, acknowledge),
                    (_, false, _) => Phase::TurnToIdle,
                }
            }
            Phase::Read(bits, out) => {
                line = bits >> out & 1 == 1;
                match out {
                    32 => Phase::TurnToIdle,
                    _ => Phase::Read(bits, out + 1),
                }
            }
            Phase::TurnToWrite(request, acknowledge) => Phase::Write(request, acknowledge, 0, 0),
            Phase::Write(request, acknowledge, bits, count) => {
                let bits = bits | u64::from(level) << count;
                #[allow(clippy::cast_possible_truncation)]
                let word = bits as u32;
                match count {
                    32 if bits != with_parity(word) => Phase::Lost,
                    32 => {
                        if acknowledge == Acknowledge::Ok {
                            port.write(request.register, word, chip);
                        }
                        Phase::Idle
                    }
                    _ => Phase::Write(request, acknowledge, bits, count + 1),
                }
            }
            Phase::TurnToIdle => Phase::Idle,
        };
        line
    }
}

/// A word and its parity.
fn with_parity(word: u32) -> u64 {
    u64::from(word) | u64::from(word.count_ones() & 1) << 32
}

/// A request from its eight bits, the first lowest; `None`: it is none.
fn request(bits: u32) -> Option<Request> {
    let bit = |place: u32| bits >> place & 1;
    let fields = bit(1) + bit(2) + bit(3) + bit(4);
    let whole = bit(0) == 1 && bit(5) == fields & 1 && bit(6) == 0 && bit(7) == 1;
    whole.then_some(Request {
        register: Register {
            access: bit(1) == 1,
            address: (bits >> 3 & 3) << 2,
        },
        reads: bit(2) == 1,
    })
}
