//! A debugger at the core: halt, step, run on, and its way to registers and memory by the access port.

use super::hooks::Step;
use super::{CCM, Emulator, FLASH, RAM, SYSTEM_MEMORY, engine};
use crate::chip::debug::{Cause, Core, DCRSR};
use crate::chip::flash;
use unicorn_engine::RegisterARM;

/// What time does while a debugger halts the core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HaltedTime {
    /// It goes on, as on a board: the machine moves, and what does not stop with the core runs.
    #[default]
    Running,
    /// It waits for the core: a halt changes nothing.
    Frozen,
}

/// Where CCM SRAM is beside its own place (RM0440 2.2.2).
const CCM_BESIDE: (u64, u64) = (0x2001_8000, 0x8000);
const PERIPHERALS: u32 = 0x4000_0000;
const CORE: u32 = 0xE000_0000;

/// DCRSR: the register is written.
const WRITES: u32 = 1 << 16;

fn has((start, size): (u64, u64), address: u32) -> bool {
    (start..start + size).contains(&u64::from(address))
}

impl Emulator {
    /// The core is halted after what a debugger asks for was done: halting, running on, a step.
    pub(super) fn is_halted(&mut self, limit: u64) -> Result<bool, String> {
        if self.chip().debug.asks_to_halt() {
            self.halt(Cause::Request);
        }
        if self.chip().debug.asks_to_go_on() {
            let steps = self.chip().debug.steps();
            self.chip().debug.go_on();
            if self.halted_time == HaltedTime::Running {
                self.chip().core_goes_on();
            }
            self.locked_up = !self.can_fetch()?;
            if steps && !self.locked_up {
                self.step()?;
                self.unicorn.get_data_mut().limit = limit;
            }
        }
        Ok(self.chip().debug.halted())
    }

    /// There is memory where the core goes on. Without any, the fetch is a fault and its handler's too: it locks up.
    fn can_fetch(&self) -> Result<bool, String> {
        let pc = self.get(RegisterARM::PC)?;
        Ok(self.unicorn.mem_read_as_vec(u64::from(pc & !1), 2).is_ok())
    }

    /// The core enters debug state.
    pub(super) fn halt(&mut self, cause: Cause) {
        // What halts a core wakes it, and a debugger can free it where it was locked up.
        (self.sleeping, self.locked_up) = (false, false);
        let running = self.halted_time == HaltedTime::Running;
        let chip = self.chip();
        chip.debug.halt(cause);
        if running {
            chip.core_halts();
        }
    }

    /// Time passes to `time` while the core is halted.
    pub(super) fn pass_halted(&mut self, time: u64) -> Result<(), String> {
        let chip = self.chip();
        let next = chip.next_event().min(time);
        chip.advance_halted(next);
        self.flush_memory()
    }

    /// One instruction runs, or one exception is entered.
    fn step(&mut self) -> Result<(), String> {
        if let Some(exception) = self.next_exception()? {
            self.enter(exception)?;
        } else {
            let inside = self.unicorn.get_data_mut();
            (inside.step, inside.limit) = (Step::Asked, u64::MAX);
            self.run()?;
            self.sleeping = false;
            self.unicorn.get_data_mut().step = Step::None;
        }
        if !self.chip().debug.halted() {
            self.halt(Cause::Request);
        }
        Ok(())
    }

    /// The core has stopped before an instruction. The time of the block under way passes when it has run to its end, as it does
    /// without a stop.
    pub(super) fn stop_within(&mut self) -> Result<(), String> {
        let pc = self.get(RegisterARM::PC)?;
        let inside = self.unicorn.get_data_mut();
        match inside.current {
            Some((start, _)) if pc == start => inside.current = None,
            Some((start, block)) if (start..block.end).contains(&pc) => inside.within = Some(pc),
            _ => inside.settle(Some(pc)),
        }
        Ok(())
    }

    /// Reads memory or registers as a debugger does by the access port.
    ///
    /// # Errors
    /// There is nothing at the address, or it is closed to a debugger.
    pub fn debugger_reads(&mut self, address: u32, bytes: &mut [u8]) -> Result<(), String> {
        self.flush_memory()?;
        if address < PERIPHERALS && !has(flash_pages(), address) {
            let place = self.memory_place(address)?;
            return self
                .unicorn
                .mem_read(place, bytes)
                .map_err(|_| nothing(address, bytes.len()));
        }
        let core = Core {
            sleeps: self.sleeping,
            locked_up: self.locked_up,
        };
        let mut at = address & !3;
        let mut left = bytes;
        let mut skip = (address & 3) as usize;
        while !left.is_empty() {
            self.open_to_debugger(at)?;
            let word = self
                .chip()
                .debugger_reads(at, core)
                .map_err(|error| format!("the debugger reads {at:#010x}: {error}"))?;
            let count = (4 - skip).min(left.len());
            let (now, later) = left.split_at_mut(count);
            now.copy_from_slice(&word.to_le_bytes()[skip..skip + count]);
            (left, skip) = (later, 0);
            at = at.wrapping_add(4);
        }
        Ok(())
    }

    /// Writes memory or registers as a debugger does by the access port.
    ///
    /// # Errors
    /// There is nothing at the address, it is closed to a debugger, or it cannot be written.
    pub fn debugger_writes(&mut self, address: u32, bytes: &[u8]) -> Result<(), String> {
        let said = |error: String| format!("the debugger writes {address:#010x}: {error}");
        if address < PERIPHERALS && !has(flash_pages(), address) && !has(FLASH, address) {
            let place = self.memory_place(address)?;
            if has(SYSTEM_MEMORY, address) {
                return Err(said("the maker's memory can only be read".into()));
            }
            self.unicorn.get_data_mut().write(place, bytes.len());
            self.unicorn
                .mem_write(place, bytes)
                .map_err(|_| nothing(address, bytes.len()))?;
            self.forget_code(place, bytes.len());
            return Ok(());
        }
        if !address.is_multiple_of(4) || !bytes.len().is_multiple_of(4) {
            return Err(said(format!(
                "{} bytes, and whole words are possible",
                bytes.len()
            )));
        }
        for (at, word) in (address..).step_by(4).zip(bytes.chunks_exact(4)) {
            self.open_to_debugger(at)?;
            let word = u32::from_le_bytes([word[0], word[1], word[2], word[3]]);
            if at == DCRSR {
                self.transfer(word)?;
            } else {
                self.chip().debugger_writes(at, word).map_err(said)?;
            }
        }
        if address >= CORE {
            // A request to halt, to step or to reset is followed at once.
            let now = self.time();
            self.run_until(now)?;
        }
        Ok(())
    }

    /// Where the engine has the memory at `address`.
    fn memory_place(&mut self, address: u32) -> Result<u64, String> {
        self.open_to_debugger(address)?;
        let place = u64::from(address);
        Ok(match has(CCM_BESIDE, address) {
            true => place - CCM_BESIDE.0 + CCM.0,
            false => place,
        })
    }

    /// Flash and CCM SRAM of a locked chip are closed to a debugger (RM0440 3.5.1, level 1).
    fn open_to_debugger(&mut self, address: u32) -> Result<(), String> {
        let closed = [FLASH, flash_pages(), CCM, CCM_BESIDE];
        let locked = self.chip().system.readout_protection() > 0;
        match locked && closed.into_iter().any(|range| has(range, address)) {
            true => Err(format!(
                "the chip is locked, so {address:#010x} is closed to a debugger"
            )),
            false => Ok(()),
        }
    }

    /// The decoded blocks that a write to memory has changed are decoded again. The engine sees to its own.
    fn forget_code(&mut self, place: u64, size: usize) {
        // The firmware has no code in its RAM, and RTT writes there all the time.
        let last = place + size as u64;
        let overlaps = |start: u32, end: u32| u64::from(start) < last && place < u64::from(end);
        let blocks = &mut self.unicorn.get_data_mut().blocks;
        if has(CCM, place as u32) || blocks.keys().any(|start| has(RAM, *start)) {
            blocks.retain(|start, block| !overlaps(*start, block.end));
        }
    }

    /// The engine's copy of the flash follows what was erased and written.
    pub(super) fn copy_flash(&mut self) -> Result<(), String> {
        let changes = std::mem::take(&mut self.unicorn.get_data_mut().chip.flash.changes);
        if changes.is_empty() {
            return Ok(());
        }
        for change in changes {
            match change {
                flash::Change::Erased(start, bytes) => self
                    .unicorn
                    .mem_write(start.into(), &vec![0xFF; bytes as usize]),
                flash::Change::Written(at, word) => {
                    self.unicorn.mem_write(at.into(), &word.to_le_bytes())
                }
            }
            .map_err(engine)?;
        }
        self.unicorn.get_data_mut().blocks.clear();
        self.unicorn.ctl_flush_tb().map_err(engine)
    }

    /// Moves a core register to DCRDR, or DCRDR to it.
    fn transfer(&mut self, selector: u32) -> Result<(), String> {
        if !self.chip().debug.halted() {
            return Err("a core register can be reached while the core is halted only".into());
        }
        if selector & WRITES == 0 {
            let value = self.core_register(selector)?;
            *self.chip().debug.data() = value;
            return Ok(());
        }
        let value = *self.chip().debug.data();
        self.set_core_register(selector & !WRITES, value)
    }

    /// A core register by its number in DCRSR (ARMv7-M C1.6.3).
    ///
    /// # Errors
    /// There is none of that number.
    pub fn core_register(&self, number: u32) -> Result<u32, String> {
        match special(number) {
            Some(parts) => {
                let mut word = 0;
                for (register, shift) in parts {
                    word |= (self.get(register)? & 0xFF) << shift;
                }
                Ok(word)
            }
            None => {
                let value = self.unicorn.reg_read(plain(number)?).map_err(engine)?;
                #[allow(clippy::cast_possible_truncation)]
                Ok(value as u32)
            }
        }
    }

    fn set_core_register(&mut self, number: u32, value: u32) -> Result<(), String> {
        const PC: u32 = 15;
        if let Some(parts) = special(number) {
            for (register, shift) in parts {
                self.set(register, u64::from(value >> shift & 0xFF))?;
            }
            return Ok(());
        }
        if number == PC {
            // The block under way does not go on.
            let inside = self.unicorn.get_data_mut();
            if inside.within.take().is_some() {
                inside.settle(None);
            }
        }
        let register = plain(number)?;
        self.unicorn
            .reg_write(register, value.into())
            .map_err(engine)
    }
}

/// The pages of flash that the chip alone holds.
fn flash_pages() -> (u64, u64) {
    (flash::START.into(), flash::SIZE as u64)
}

fn nothing(address: u32, size: usize) -> String {
    format!("the debugger accesses {size} bytes at {address:#010x}: no memory there")
}

/// The registers that number 20 has a byte of each.
fn special(number: u32) -> Option<[(RegisterARM, u32); 4]> {
    const SPECIAL: u32 = 20;
    (number == SPECIAL).then_some([
        (RegisterARM::PRIMASK, 0),
        (RegisterARM::BASEPRI, 8),
        (RegisterARM::FAULTMASK, 16),
        (RegisterARM::CONTROL, 24),
    ])
}

fn plain(number: u32) -> Result<i32, String> {
    use RegisterARM as R;
    const CORE: [RegisterARM; 19] = [
        R::R0,
        R::R1,
        R::R2,
        R::R3,
        R::R4,
        R::R5,
        R::R6,
        R::R7,
        R::R8,
        R::R9,
        R::R10,
        R::R11,
        R::R12,
        R::SP,
        R::LR,
        R::PC,
        R::XPSR,
        R::MSP,
        R::PSP,
    ];
    const FPSCR: u32 = 33;
    const FLOAT: u32 = 64;
    if let Some(register) = CORE.get(number as usize) {
        return Ok(*register as i32);
    }
    let float = number.checked_sub(FLOAT).filter(|float| *float < 32);
    match float {
        Some(float) => Ok(R::S0 as i32 + float as i32),
        None if number == FPSCR => Ok(R::FPSCR as i32),
        None => Err(format!("the core has no register {number} (DCRSR)")),
    }
}
