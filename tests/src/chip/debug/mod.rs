//! The core's debug registers (ARMv7-M, C1.6; PM0214): halt, step, vector catch, access to core registers. Beside them the six
//! [breakpoints], the four [watchpoints] and what the parts [say they are](identity).
//!
//! A system reset leaves all of it but the request to halt; a loss of power clears it.

pub mod breakpoints;
mod identity;
pub mod watchpoints;

use breakpoints::Breakpoints;
use watchpoints::Watchpoints;

const DFSR: u32 = 0xE000_ED30;
const DHCSR: u32 = 0xE000_EDF0;
/// Selects a core register and the direction; the emulator moves it to or from [`DCRDR`].
pub const DCRSR: u32 = 0xE000_EDF4;
/// The core register's value.
pub const DCRDR: u32 = 0xE000_EDF8;
const DEMCR: u32 = 0xE000_EDFC;
const MVFR0: u32 = 0xE000_EF40;
const MVFR1: u32 = 0xE000_EF44;

/// DHCSR: what must be written to its upper half.
const KEY: u32 = 0xA05F;
const C_DEBUGEN: u32 = 1;
const C_HALT: u32 = 1 << 1;
const C_STEP: u32 = 1 << 2;
const C_MASKINTS: u32 = 1 << 3;
const CONTROL: u32 = C_DEBUGEN | C_HALT | C_STEP | C_MASKINTS;
const S_REGRDY: u32 = 1 << 16;
const S_HALT: u32 = 1 << 17;
const S_SLEEP: u32 = 1 << 18;
const S_LOCKUP: u32 = 1 << 19;
const S_RESET_ST: u32 = 1 << 25;

const VC_CORERESET: u32 = 1;
const VC_HARDERR: u32 = 1 << 10;
const TRCENA: u32 = 1 << 24;

/// Why the core halted: a bit of DFSR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The debugger asked, or a step has ended.
    Request = 1,
    /// A breakpoint, of the unit or in the code.
    Breakpoint = 1 << 1,
    /// A watchpoint.
    Watchpoint = 1 << 2,
    /// An exception or a reset that is caught.
    VectorCatch = 1 << 3,
}

/// Who writes a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Master {
    /// The program.
    Core,
    /// The debugger, by the access port.
    Debugger,
}

/// What the core does, as DHCSR says it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Core {
    /// It waits for an interrupt.
    pub sleeps: bool,
    /// It has met a fault that it cannot handle.
    pub locked_up: bool,
}

/// The debug registers.
#[derive(Clone, Debug, Default)]
pub struct Debug {
    control: u32,
    /// The core is in debug state.
    halted: bool,
    /// It has been reset since DHCSR was last read by the debugger.
    was_reset: bool,
    causes: u32,
    catches: u32,
    data: u32,
    /// The flash patch unit.
    pub breakpoints: Breakpoints,
    /// The watchpoint unit's comparators.
    pub watchpoints: Watchpoints,
}

impl Debug {
    /// `address` is one of these registers.
    #[must_use]
    pub fn has(address: u32) -> bool {
        matches!(
            address,
            DFSR | DHCSR | DCRSR | DCRDR | DEMCR | MVFR0 | MVFR1
        ) || breakpoints::has(address)
            || watchpoints::has(address)
            || identity::read(address).is_some()
    }

    /// A debugger has switched halting on.
    #[must_use]
    pub fn enabled(&self) -> bool {
        self.control & C_DEBUGEN != 0
    }

    /// The core is in debug state.
    #[must_use]
    pub fn halted(&self) -> bool {
        self.halted
    }

    /// The debugger asks a core that runs to halt.
    #[must_use]
    pub fn asks_to_halt(&self) -> bool {
        !self.halted && self.control & (C_DEBUGEN | C_HALT) == C_DEBUGEN | C_HALT
    }

    /// The debugger asks a halted core to run on, or for one instruction.
    #[must_use]
    pub fn asks_to_go_on(&self) -> bool {
        self.halted && self.control & (C_DEBUGEN | C_HALT) != C_DEBUGEN | C_HALT
    }

    /// What runs next is one instruction.
    #[must_use]
    pub fn steps(&self) -> bool {
        self.control & (C_DEBUGEN | C_STEP) == C_DEBUGEN | C_STEP
    }

    /// Interrupts wait; hard fault and NMI do not.
    #[must_use]
    pub fn masks_interrupts(&self) -> bool {
        self.control & (C_DEBUGEN | C_MASKINTS) == C_DEBUGEN | C_MASKINTS
    }

    /// The core enters debug state.
    pub fn halt(&mut self, cause: Cause) {
        self.halted = true;
        self.control |= C_HALT;
        self.causes |= cause as u32;
    }

    /// The core leaves debug state.
    pub fn go_on(&mut self) {
        self.halted = false;
    }

    /// The chip was reset. `true`: the core halts before its first instruction.
    pub fn reset(&mut self) -> bool {
        self.was_reset = true;
        self.halted = false;
        self.control &= !C_HALT;
        self.enabled() && self.catches & VC_CORERESET != 0
    }

    /// The core halts as it enters a hard fault's handler.
    #[must_use]
    pub fn catches_hard_fault(&self) -> bool {
        self.enabled() && self.catches & VC_HARDERR != 0
    }

    /// Watchpoints and the cycle counter have their clock.
    #[must_use]
    pub fn traces(&self) -> bool {
        self.catches & TRCENA != 0
    }

    /// What a debugger reads of a core register, or has it written.
    pub fn data(&mut self) -> &mut u32 {
        &mut self.data
    }

    /// Reads a register, while the core is as `core` says. What a read clears, only the debugger's clears.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&mut self, address: u32, master: Master, core: Core) -> Result<u32, String> {
        Ok(match address {
            DHCSR => {
                let was_reset = self.was_reset;
                if master == Master::Debugger {
                    self.was_reset = false;
                }
                let flag = |on: bool, bit: u32| if on { bit } else { 0 };
                self.control
                    | flag(self.halted, S_HALT | S_REGRDY)
                    | flag(core.sleeps && !self.halted, S_SLEEP)
                    | flag(core.locked_up && !self.halted, S_LOCKUP)
                    | flag(was_reset, S_RESET_ST)
            }
            DFSR => self.causes,
            DEMCR => self.catches,
            DCRDR => self.data,
            DCRSR => return Err("DCRSR can only be written".into()),
            // As TI gives them of the same core (SWCU192, 3.7.3.1), and OpenOCD expects them (`MVFR0_DEFAULT_M4`).
            MVFR0 => 0x1011_0021,
            MVFR1 => 0x1100_0011,
            _ if breakpoints::has(address) => self.breakpoints.read(address)?,
            _ if watchpoints::has(address) => {
                self.watchpoints.read(address, master == Master::Debugger)?
            }
            _ => identity::read(address).ok_or("the model has no register here")?,
        })
    }

    /// Writes a register. [`DCRSR`] is the emulator's.
    ///
    /// # Errors
    /// The model does not have it, or not what is written.
    pub fn write(&mut self, address: u32, value: u32, master: Master) -> Result<(), String> {
        match address {
            // The program cannot change it.
            DHCSR if master == Master::Core => {}
            DHCSR if value >> 16 != KEY => {}
            DHCSR if value & C_DEBUGEN == 0 => self.control = 0,
            DHCSR => self.control = value & CONTROL,
            DFSR => self.causes &= !value,
            DEMCR => {
                const KNOWN: u32 = VC_CORERESET | VC_HARDERR | TRCENA;
                if value & !KNOWN != 0 {
                    return Err(format!(
                        "this model catches a reset and a hard fault only, and DEMCR asks for {:#x}",
                        value & !KNOWN
                    ));
                }
                self.catches = value;
            }
            DCRDR => self.data = value,
            _ if breakpoints::has(address) => self.breakpoints.write(address, value)?,
            _ if watchpoints::has(address) => self.watchpoints.write(address, value)?,
            _ => return Err("the register can only be read".into()),
        }
        Ok(())
    }
}
