//! Exception entry and return, as ARMv7-M does them (B1.5.6 and B1.5.8), on the main stack without float state.

use super::Emulator;
use crate::chip::debug::Cause;
use crate::chip::nvic::HARD_FAULT;
use unicorn_engine::RegisterARM;

const FRAME: [RegisterARM; 6] = [
    RegisterARM::R0,
    RegisterARM::R1,
    RegisterARM::R2,
    RegisterARM::R3,
    RegisterARM::R12,
    RegisterARM::LR,
];
/// Return to an exception, or to the program, on the main stack, without float state.
const TO_HANDLER: u64 = 0xFFFF_FFF1;
const TO_THREAD: u64 = 0xFFFF_FFF9;
/// In the stacked program status: the stack was moved by a word to be a multiple of 8.
const MOVED: u32 = 1 << 9;

impl Emulator {
    /// The core takes `exception`.
    pub(super) fn enter(&mut self, exception: usize) -> Result<(), String> {
        let nested = !self.chip().nvic.active().is_empty();
        let saves_float = self.chip().nvic.saves_float_state();
        const FLOAT_ACTIVE: u32 = 1 << 2;
        if saves_float && self.get(RegisterARM::CONTROL)? & FLOAT_ACTIVE != 0 {
            return Err("an exception would save float state, which this model does not".into());
        }
        let status = self.get(RegisterARM::XPSR)?;
        let stack = self.get(RegisterARM::MSP)?;
        let moved = stack & 4 != 0;
        let frame = (stack & !7) - 32;
        // A frame in closed memory: the fault takes the exception's place, with the stack where it is (ARMv7-M B1.5.11).
        let closed = self.chip().nvic.closed_memory();
        let exception = match closed {
            Some((start, size)) if frame < start + size && frame + 32 > start => {
                self.chip().nvic.memory_fault(true);
                HARD_FAULT
            }
            _ => exception,
        };
        for (k, register) in FRAME.into_iter().enumerate() {
            let value = self.get(register)?;
            self.set_word(frame + 4 * k as u32, value)?;
        }
        let pc = self.get(RegisterARM::PC)?;
        self.set_word(frame + 24, pc & !1)?;
        self.set_word(
            frame + 28,
            if moved {
                status | MOVED
            } else {
                status & !MOVED
            },
        )?;
        self.set(RegisterARM::MSP, u64::from(frame))?;

        // Thumb state, no IT, the exception's number.
        const THUMB: u64 = 1 << 24;
        self.set(RegisterARM::XPSR, THUMB | exception as u64)?;
        self.set(RegisterARM::LR, if nested { TO_HANDLER } else { TO_THREAD })?;
        let table = self.chip().nvic.vector_table();
        let table = if table == 0 { 0x0800_0000 } else { table };
        let vector = self.word(table + 4 * exception as u32)?;
        self.set(RegisterARM::PC, u64::from(vector | 1))?;

        let inside = self.unicorn.get_data_mut();
        inside.chip.nvic.enter(exception);
        inside.profile.enter(exception);
        let now = inside.chip.now + crate::timing::ENTRY;
        inside.chip.advance(now);
        if exception == HARD_FAULT && self.chip().debug.catches_hard_fault() {
            self.halt(Cause::VectorCatch);
        }
        Ok(())
    }

    /// The core has met what is no instruction: a usage fault, which no handler is enabled for (ARMv7-M B1.5.14). In a hard fault's
    /// handler or the NMI's it locks up.
    pub(super) fn undefined(&mut self) -> Result<(), String> {
        if self
            .chip()
            .nvic
            .active()
            .iter()
            .any(|&active| active <= HARD_FAULT)
        {
            self.locked_up = true;
            return Ok(());
        }
        self.chip().nvic.usage_fault();
        self.enter(HARD_FAULT)
    }

    /// The core has written to closed memory.
    pub(super) fn fault(&mut self) -> Result<(), String> {
        self.chip().nvic.memory_fault(false);
        self.enter(HARD_FAULT)
    }

    /// The core returns from its innermost exception.
    pub(super) fn leave(&mut self) -> Result<(), String> {
        let frame = self.get(RegisterARM::MSP)?;
        for (k, register) in FRAME.into_iter().enumerate() {
            let value = self.word(frame + 4 * k as u32)?;
            self.set(register, u64::from(value))?;
        }
        let pc = self.word(frame + 24)?;
        let status = self.word(frame + 28)?;
        let stack = frame + 32 + if status & MOVED != 0 { 4 } else { 0 };
        self.set(RegisterARM::XPSR, u64::from(status & !MOVED))?;
        self.set(RegisterARM::MSP, u64::from(stack))?;
        self.set(RegisterARM::PC, u64::from(pc | 1))?;

        let inside = self.unicorn.get_data_mut();
        let Some(exception) = inside.chip.nvic.leave() else {
            return Err("the core returns from an exception that it did not enter".into());
        };
        inside.profile.leave(exception);
        let now = inside.chip.now + crate::timing::EXIT;
        inside.chip.advance(now);
        Ok(())
    }
}
