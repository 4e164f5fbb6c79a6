//! Where the engine looks for a debugger's breakpoints, watchpoints and steps. It looks only where it must: without a debugger
//! nowhere, and at breakpoints alone where nothing is watched or stepped.
//!
//! The engine cannot stop within an IT block: a stop there comes after its last instruction. So what follows a breakpoint is looked
//! at too, as far as such a block reaches.

use super::{Emulator, Inside, Stop, engine};
use crate::chip::debug::Cause;
use crate::chip::debug::watchpoints::Access;
use unicorn_engine::{HookType, MemType, UcHookId, Unicorn};

/// A debugger's step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Step {
    /// None is asked for.
    #[default]
    None,
    /// The instruction is yet to run.
    Asked,
    /// It has run; the next one does not.
    Taken,
}

/// What is looked at.
#[derive(Debug, Default, PartialEq, Eq)]
struct Places {
    /// Each instruction.
    all: bool,
    /// Else these.
    instructions: Vec<u32>,
    /// First and last byte of data.
    data: Vec<(u32, u32)>,
}

/// Bytes of the longest IT block.
const IT_BLOCK: u32 = 16;

/// The hooks in place.
#[derive(Debug, Default)]
pub(super) struct Hooks {
    places: Places,
    placed: Vec<UcHookId>,
}

impl Emulator {
    /// What the debug registers ask for.
    fn wanted(&self) -> Places {
        let inside = self.unicorn.get_data();
        let debug = &inside.chip.debug;
        if !debug.enabled() {
            return Places::default();
        }
        let (mut data, mut instructions) = (Vec::new(), Vec::new());
        if debug.traces() {
            data.extend(debug.watchpoints.data());
            instructions.extend(debug.watchpoints.instructions());
        }
        let all = inside.step != Step::None || inside.watched || !data.is_empty();
        instructions.extend(debug.breakpoints.addresses());
        Places {
            all,
            instructions: if all { Vec::new() } else { instructions },
            data,
        }
    }

    /// Brings the hooks to where the debug registers ask for them. What was translated before does not look, so it is forgotten.
    pub(super) fn place_hooks(&mut self) -> Result<(), String> {
        let inside = self.unicorn.get_data();
        if !inside.chip.debug.enabled() && self.hooks.placed.is_empty() {
            return Ok(());
        }
        let places = self.wanted();
        if places == self.hooks.places {
            return Ok(());
        }
        for hook in std::mem::take(&mut self.hooks.placed) {
            self.unicorn.remove_hook(hook).map_err(engine)?;
        }
        let mut placed = Vec::new();
        let ranges = match places.all {
            // The engine's word for everywhere.
            true => vec![(1, 0)],
            false => places
                .instructions
                .iter()
                .map(|&at| (at, at + IT_BLOCK))
                .collect(),
        };
        for (first, last) in ranges {
            let hook = self
                .unicorn
                .add_code_hook(first.into(), last.into(), on_code);
            placed.push(hook.map_err(engine)?);
        }
        for &(first, last) in &places.data {
            /// Bytes that an access which begins before the range reaches into it.
            const REACH: u32 = 7;
            let kinds = HookType::MEM_READ | HookType::MEM_WRITE;
            let first = first.saturating_sub(REACH).into();
            let hook = self
                .unicorn
                .add_mem_hook(kinds, first, last.into(), on_access);
            placed.push(hook.map_err(engine)?);
        }
        self.unicorn.ctl_flush_tb().map_err(engine)?;
        self.hooks = Hooks { places, placed };
        Ok(())
    }
}

/// The core is about to execute an instruction that is looked at.
fn on_code(uc: &mut Unicorn<'_, Inside>, address: u64, _size: u32) {
    #[allow(clippy::cast_possible_truncation)]
    let address = address as u32;
    let inside = uc.get_data_mut();
    if inside.stop.is_some() {
        // An IT block has gone on.
        let _ = uc.emu_stop();
        return;
    }
    let debug = &mut inside.chip.debug;
    let cause = if std::mem::take(&mut inside.watched) {
        Some(Cause::Watchpoint)
    } else if inside.step == Step::Taken {
        Some(Cause::Request)
    } else if debug.breakpoints.breaks_at(address) {
        Some(Cause::Breakpoint)
    } else if debug.traces() && debug.watchpoints.executes(address) {
        Some(Cause::Watchpoint)
    } else {
        None
    };
    if inside.step == Step::Asked {
        inside.step = Step::Taken;
    }
    if let Some(cause) = cause {
        inside.stop = Some(Stop::Debug(cause));
        let _ = uc.emu_stop();
    }
}

/// The core accesses data that is watched.
#[allow(clippy::cast_possible_truncation)]
fn on_access(
    uc: &mut Unicorn<'_, Inside>,
    kind: MemType,
    address: u64,
    size: usize,
    _value: i64,
) -> bool {
    let access = match kind {
        MemType::WRITE => Access::Write,
        _ => Access::Read,
    };
    let inside = uc.get_data_mut();
    let units = &mut inside.chip.debug.watchpoints;
    inside.watched |= units.accesses(address as u32, size as u32, access);
    true
}
