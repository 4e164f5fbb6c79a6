//! The Black Magic Probe's remote protocol, version 1: a command is `!`, letters, hex digits and `#`; an answer `&`, a letter, hex
//! digits and `#`. What a debugger sends beyond it is answered as unknown.

use super::port::{Port, Register};
use super::swd::Wire;
use crate::emulator::Emulator;
use std::fmt::Write;

/// Bytes of a command at most, as the probe's own buffer has them.
pub const LONGEST: usize = 1024;
/// Clock of the wire that is said to be set, kHz.
const SPEED_KHZ: u32 = 24_000;

/// The probe.
#[derive(Debug, Default)]
pub struct Remote {
    wire: Wire,
    /// The probe listened last.
    listens: bool,
    port: Port,
}

/// An answer.
enum Answer {
    Done(String),
    /// The chip refused it.
    Failed,
    /// The command's digits are not as they should be.
    Wrong,
    /// There is no such command.
    Unknown,
}

impl Remote {
    /// Answers a command, without its `!` and `#`. What the chip refused is said to `refused`.
    pub fn answer(
        &mut self,
        command: &str,
        chip: &mut Emulator,
        refused: &mut dyn FnMut(String),
    ) -> String {
        let answer = self.carry_out(command, chip);
        let error = self.port.refused.take();
        if let Some(error) = error {
            refused(error);
        }
        match answer {
            Answer::Done(digits) => format!("&K{digits}#"),
            Answer::Failed => "&E1#".into(),
            Answer::Wrong => "&P1#".into(),
            Answer::Unknown => "&N0#".into(),
        }
    }

    fn carry_out(&mut self, command: &str, chip: &mut Emulator) -> Answer {
        let Some((kind, digits)) = command.split_at_checked(2) else {
            return Answer::Unknown;
        };
        let nothing = || Answer::Done("0".into());
        match kind {
            "GA" => Answer::Done("Emulated STM32G474".into()),
            "HC" => Answer::Done("1".into()),
            // The reset line is not connected.
            "GZ" if digits == "0" => nothing(),
            "GV" => Answer::Done("3.3V".into()),
            "GF" | "SS" => nothing(),
            "Gf" => Answer::Done(format!("{SPEED_KHZ:x}")),
            "So" => self
                .drive(digits, chip)
                .map_or(Answer::Wrong, |()| nothing()),
            "Si" => self
                .listen(digits, chip)
                .map_or(Answer::Wrong, |bits| Answer::Done(format!("{bits:x}"))),
            "HL" | "Hd" | "Ha" | "HA" | "HM" | "Hm" if Port::is_closed(chip) => Answer::Failed,
            "HL" => self.raw(digits, chip).unwrap_or(Answer::Wrong),
            "Hd" => self.read_debug_port(digits, chip).unwrap_or(Answer::Wrong),
            "Ha" => self.read_access_port(digits, chip).unwrap_or(Answer::Wrong),
            "HA" => self
                .write_access_port(digits, chip)
                .unwrap_or(Answer::Wrong),
            "HM" => self.read_memory(digits, chip).unwrap_or(Answer::Wrong),
            "Hm" => self.write_memory(digits, chip).unwrap_or(Answer::Wrong),
            _ => Answer::Unknown,
        }
    }

    /// The line changes hands for a clock when the probe begins to drive or to listen.
    fn turn(&mut self, listens: bool, chip: &mut Emulator) {
        if self.listens != listens {
            self.wire.clock(None, &mut self.port, chip);
            self.listens = listens;
        }
    }

    fn drive(&mut self, digits: &str, chip: &mut Emulator) -> Option<()> {
        let mut digits = Digits(digits);
        let count = digits.take(2).filter(|count| *count <= 32)?;
        let bits = digits.rest()?;
        self.turn(false, chip);
        for k in 0..count {
            let bit = bits >> k & 1 == 1;
            self.wire.clock(Some(bit), &mut self.port, chip);
        }
        Some(())
    }

    fn listen(&mut self, digits: &str, chip: &mut Emulator) -> Option<u64> {
        let count = Digits(digits).rest().filter(|count| *count <= 32)?;
        self.turn(true, chip);
        let mut bits = 0;
        for k in 0..count {
            let bit = self.wire.clock(None, &mut self.port, chip);
            bits |= u64::from(bit) << k;
        }
        Some(bits)
    }

    /// A request as it is on the wire. The address has the access port's bit.
    fn raw(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let (_, reads) = (digits.take(2)?, digits.take(2)? != 0);
        let (address, value) = (digits.take(4)?, digits.rest()?);
        let register = register(address);
        if reads {
            return Some(self.read_register(register, chip));
        }
        #[allow(clippy::cast_possible_truncation)]
        self.port.write(register, value as u32, chip);
        Some(Answer::Done("0".into()))
    }

    fn read_register(&mut self, register: Register, chip: &mut Emulator) -> Answer {
        let (_, mut word) = self.port.read(register, chip);
        if register.access {
            (_, word) = self.port.read(Port::buffer(), chip);
        }
        self.answered(word)
    }

    fn read_debug_port(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let _ = (digits.take(2)?, digits.take(2)?);
        Some(self.read_register(register(digits.rest()?), chip))
    }

    fn read_access_port(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let (_, port, address) = (digits.take(2)?, digits.take(2)?, digits.rest()?);
        #[allow(clippy::cast_possible_truncation)]
        let word = self
            .port
            .read_access(port as u32, address as u32 & 0xFF, chip);
        Some(self.answered(word))
    }

    fn write_access_port(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let (_, port) = (digits.take(2)?, digits.take(2)?);
        let (address, value) = (digits.take(4)?, digits.rest()?);
        #[allow(clippy::cast_possible_truncation)]
        let (port, address, value) = (port as u32, address as u32 & 0xFF, value as u32);
        self.port.write_access(port, address, value, chip);
        Some(match self.failed() {
            true => Answer::Failed,
            false => Answer::Done("0".into()),
        })
    }

    fn read_memory(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let _ = (digits.take(2)?, digits.take(2)?, digits.take(8)?);
        let (address, count) = (digits.take(8)?, digits.rest()?);
        let mut bytes = vec![
            0;
            usize::try_from(count)
                .ok()
                .filter(|count| *count <= LONGEST)?
        ];
        #[allow(clippy::cast_possible_truncation)]
        let read = chip.debugger_reads(address as u32, &mut bytes);
        self.port.note(read);
        if self.failed() {
            return Some(Answer::Failed);
        }
        let mut text = String::with_capacity(2 * bytes.len());
        for byte in bytes {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        Some(Answer::Done(text))
    }

    fn write_memory(&mut self, digits: &str, chip: &mut Emulator) -> Option<Answer> {
        let mut digits = Digits(digits);
        let _ = (
            digits.take(2)?,
            digits.take(2)?,
            digits.take(8)?,
            digits.take(2)?,
        );
        let (address, count) = (digits.take(8)?, digits.take(8)?);
        let mut bytes = Vec::new();
        for _ in 0..usize::try_from(count)
            .ok()
            .filter(|count| *count <= LONGEST)?
        {
            bytes.push(u8::try_from(digits.take(2)?).ok()?);
        }
        #[allow(clippy::cast_possible_truncation)]
        let written = chip.debugger_writes(address as u32, &bytes);
        self.port.note(written);
        Some(match self.failed() {
            true => Answer::Failed,
            false => Answer::Done("0".into()),
        })
    }

    /// The probe clears an error that the port holds, once it has told it.
    fn failed(&mut self) -> bool {
        let error = self.port.take_error();
        let failed = error.is_some();
        self.port.refused = error;
        failed
    }

    /// A word is answered with its bytes in the chip's order.
    fn answered(&mut self, word: u32) -> Answer {
        match self.failed() {
            true => Answer::Failed,
            false => Answer::Done(format!("{:08x}", word.swap_bytes())),
        }
    }
}

/// The register that an address with the access port's bit means.
fn register(address: u64) -> Register {
    const ACCESS_PORT: u64 = 0x100;
    #[allow(clippy::cast_possible_truncation)]
    let within = address as u32 & 0xC;
    Register {
        access: address & ACCESS_PORT != 0,
        address: within,
    }
}

/// Hex digits that are left.
struct Digits<'a>(&'a str);

impl Digits<'_> {
    fn take(&mut self, count: usize) -> Option<u64> {
        let (digits, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        u64::from_str_radix(digits, 16).ok()
    }

    fn rest(&mut self) -> Option<u64> {
        u64::from_str_radix(std::mem::take(&mut self.0), 16).ok()
    }
}
