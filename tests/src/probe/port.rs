//! The chip's serial-wire debug port and its one access port, to the bus (ARM IHI 0031E, B2 and C2; RM0440 47.5).

use crate::emulator::Emulator;

/// What the port says to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acknowledge {
    /// It is done.
    Ok,
    /// An error holds, which the debugger must clear.
    Fault,
}

/// A request: of the debug port or the access port, the register's address within its bank.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Of the access port that is selected.
    pub access: bool,
    /// 0x0, 0x4, 0x8 or 0xC.
    pub address: u32,
}

/// DPIDR of the STM32G4: ARM, version 1 (RM0440 47.5.1, DP_DPIDR).
const IDENTITY: u32 = 0x2BA0_1477;
const ABORT: u32 = 0x0;
const CONTROL: u32 = 0x4;
const SELECT: u32 = 0x8;
const BUFFER: u32 = 0xC;

const OVERRUN_DETECT: u32 = 1;
const STICKY_OVERRUN: u32 = 1 << 1;
const STICKY_COMPARE: u32 = 1 << 4;
const STICKY_ERROR: u32 = 1 << 5;
const WRITE_ERROR: u32 = 1 << 7;
const STICKY: u32 = STICKY_OVERRUN | STICKY_COMPARE | STICKY_ERROR | WRITE_ERROR;
/// Debug and system power: request bits, which are acknowledged in the bit above each.
const POWER: u32 = 1 << 28 | 1 << 30;

const CSW: u32 = 0x00;
const TAR: u32 = 0x04;
const DRW: u32 = 0x0C;
const BD0: u32 = 0x10;
const BD3: u32 = 0x1C;
const CFG: u32 = 0xF4;
const BASE: u32 = 0xF8;
const IDR: u32 = 0xFC;
/// CSW: what can be written, and that the port works.
const CSW_BITS: u32 = 0x7F00_0037;
const DEVICE_ENABLED: u32 = 1 << 6;

/// The two ports.
#[derive(Clone, Debug, Default)]
pub struct Port {
    control: u32,
    select: u32,
    buffer: u32,
    csw: u32,
    address: u32,
    /// What went wrong on the bus last.
    pub refused: Option<String>,
}

impl Port {
    /// The chip lets nobody in (RM0440 3.5.1, read-out protection level 2).
    #[must_use]
    pub fn is_closed(chip: &mut Emulator) -> bool {
        chip.chip().system.readout_protection() == 2
    }

    /// A data phase follows whatever the acknowledgement.
    #[must_use]
    pub fn detects_overrun(&self) -> bool {
        self.control & OVERRUN_DETECT != 0
    }

    /// What it will say to a write.
    #[must_use]
    pub fn accepts_write(&self, register: Register) -> Acknowledge {
        let held = self.control & STICKY != 0;
        match held && (register.access || register.address != ABORT && register.address != SELECT) {
            true => Acknowledge::Fault,
            false => Acknowledge::Ok,
        }
    }

    /// A register is read. The access port's come a request late, as they do on the wire.
    pub fn read(&mut self, register: Register, chip: &mut Emulator) -> (Acknowledge, u32) {
        const DP_BANK: u32 = 0xF;
        let held = self.control & STICKY != 0;
        match (register.access, register.address) {
            (false, 0x0) => (Acknowledge::Ok, IDENTITY),
            (false, CONTROL) if self.select & DP_BANK == 0 => (Acknowledge::Ok, self.state()),
            // DLCR: a turnaround of one cycle.
            (false, CONTROL) => (Acknowledge::Ok, 0x40),
            _ if held => (Acknowledge::Fault, 0),
            (false, _) => (Acknowledge::Ok, self.buffer),
            (true, address) => {
                let before = self.buffer;
                self.buffer = self.read_access(self.selected(), self.bank() | address, chip);
                (Acknowledge::Ok, before)
            }
        }
    }

    /// A register is written.
    pub fn write(&mut self, register: Register, value: u32, chip: &mut Emulator) {
        match (register.access, register.address) {
            (false, ABORT) => {
                for (clears, flag) in [
                    (1, STICKY_COMPARE),
                    (2, STICKY_ERROR),
                    (3, WRITE_ERROR),
                    (4, STICKY_OVERRUN),
                ] {
                    if value >> clears & 1 == 1 {
                        self.control &= !flag;
                    }
                }
            }
            (false, CONTROL) => {
                self.control = self.control & STICKY | value & (POWER | OVERRUN_DETECT | 0xF0C);
            }
            (false, SELECT) => self.select = value,
            (false, _) => {}
            (true, address) => {
                self.write_access(self.selected(), self.bank() | address, value, chip);
            }
        }
    }

    fn state(&self) -> u32 {
        self.control | (self.control & POWER) << 1
    }

    fn selected(&self) -> u32 {
        self.select >> 24
    }

    fn bank(&self) -> u32 {
        self.select & 0xF0
    }

    /// A register of access port `port`; of those that are not there each reads 0.
    pub fn read_access(&mut self, port: u32, register: u32, chip: &mut Emulator) -> u32 {
        if port != 0 {
            return 0;
        }
        match register {
            CSW => self.csw | DEVICE_ENABLED,
            TAR => self.address,
            DRW => {
                let address = self.address;
                self.pass_address();
                self.word(address, chip)
            }
            BD0..=BD3 => self.word(self.address & !0xF | register & 0xC, chip),
            // Little-endian.
            CFG => 0,
            // The ROM table, which is there.
            BASE => 0xE00F_F003,
            // An AHB port of a Cortex-M4 (ARM DDI 0439, 8.3).
            IDR => 0x2477_0011,
            _ => 0,
        }
    }

    /// Writes a register of access port `port`.
    pub fn write_access(&mut self, port: u32, register: u32, value: u32, chip: &mut Emulator) {
        if port != 0 {
            return;
        }
        let word = value.to_le_bytes();
        match register {
            CSW => self.csw = value & CSW_BITS,
            TAR => self.address = value,
            DRW => {
                let (address, size) = (self.address, self.size());
                // Bytes and half words lie in their lane.
                let lane = (address & 3 & !(size as u32 - 1)) as usize;
                let written = chip.debugger_writes(address, &word[lane..lane + size]);
                self.note(written);
                self.pass_address();
            }
            BD0..=BD3 => {
                let written = chip.debugger_writes(self.address & !0xF | register & 0xC, &word);
                self.note(written);
            }
            _ => {}
        }
    }

    fn size(&self) -> usize {
        1 << (self.csw & 7).min(2)
    }

    fn word(&mut self, address: u32, chip: &mut Emulator) -> u32 {
        let mut word = [0; 4];
        let size = self.size();
        let lane = (address & 3 & !(size as u32 - 1)) as usize;
        let read = chip.debugger_reads(address, &mut word[lane..lane + size]);
        self.note(read);
        u32::from_le_bytes(word)
    }

    /// The address grows with each access where CSW reports it, within a kilobyte.
    fn pass_address(&mut self) {
        if self.csw >> 4 & 3 == 1 {
            let next = self.address.wrapping_add(self.size() as u32);
            self.address = self.address & !0x3FF | next & 0x3FF;
        }
    }

    /// An access to the bus that failed is an error that holds until it is cleared.
    pub fn note(&mut self, access: Result<(), String>) {
        if let Err(error) = access {
            self.control |= STICKY_ERROR;
            self.refused = Some(error);
        }
    }

    /// Clears errors, and says what the last was.
    pub fn take_error(&mut self) -> Option<String> {
        self.control &= !STICKY;
        self.refused.take()
    }

    /// The register that [`Port::read`] of the access port leaves its answer in.
    #[must_use]
    pub fn buffer() -> Register {
        Register {
            access: false,
            address: BUFFER,
        }
    }
}
