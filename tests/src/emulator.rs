//! The core: runs the ELF's instructions in Unicorn, and adds what Unicorn leaves out: exceptions with their
//! priorities, sleep, bit-band, and time in cycles.

mod debug;
mod exception;
mod hooks;
mod profile;

pub use debug::HaltedTime;
pub use profile::{Cost, Profile};

use crate::chip::debug::Cause;
use crate::chip::system::Checked;
use crate::chip::wiring::Wiring;
use crate::chip::{Chip, Reset, adc, flash};
use crate::image::Image;
use crate::pins::Machine;
use crate::timing::{Decoder, REFILL};
use hooks::Hooks;
use rustc_hash::FxHashMap;
use std::cell::RefCell;
use std::rc::Rc;
use unicorn_engine::{Arch, HookType, MemType, Mode, Prot, RegisterARM, Unicorn, uc_error};

/// What programs reach of the flash; the rest is the chip's: [`crate::chip::flash`].
const FLASH: (u64, u64) = (flash::BEGIN as u64, (flash::START - flash::BEGIN) as u64);
const RAM: (u64, u64) = (0x2000_0000, 0x1_8000);
const CCM: (u64, u64) = (0x1000_0000, 0x8000);
/// What the maker wrote of the chip, and where in it what ADC4 read of its internal reference at 3.0 V is (`stm32g4xx-hal`, `signature.rs`).
const SYSTEM_MEMORY: (u64, u64) = (0x1FFF_7000, 0x1000);
const VREFINT_CAL: u64 = 0x1FFF_75AA;
/// And how many KB of flash it has (RM0440 48.2, flash size data register).
const FLASH_SIZE: u64 = 0x1FFF_75E0;
const BIT_BAND: u64 = 0x4200_0000;
/// Peripheral regions: start and size.
const PERIPHERALS: [(u64, u64); 5] = [
    (flash::START as u64, flash::SIZE as u64),
    (0x4000_0000, 0x10_0000),
    (0x4800_0000, 0x2000),
    (0x5000_0000, 0x2000),
    (0xE000_0000, 0x10_0000),
];
/// What parity guards (RM0440 2.4.1; ST's HAL, `OB_SRAM_PARITY_ENABLE`): the first 32 KB of SRAM1, and CCM SRAM.
const PARITY: [(u64, u64); 2] = [(RAM.0, 0x8000), CCM];
/// What unused RAM holds at the start, to see how deep the stack went.
const PAINT: u8 = 0xCD;

/// Why the core stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    /// Something outside has to look: an interrupt to take, the time limit, an error, a reset.
    Look,
    /// An exception returns.
    ExceptionReturn,
    /// The core has written to memory that the protection unit closes.
    Fault,
    /// A debugger halts it.
    Debug(Cause),
}

/// What of the memory that parity guards was written.
struct Written([Vec<bool>; 2]);

impl Default for Written {
    fn default() -> Self {
        Self(PARITY.map(|(_, size)| vec![false; size as usize]))
    }
}

impl Written {
    /// Places of bytes in their memory; others are not guarded.
    fn places(address: u64, size: usize) -> impl Iterator<Item = (usize, usize)> {
        (address..address + size as u64).filter_map(|at| {
            PARITY.iter().enumerate().find_map(|(k, (start, bytes))| {
                let place = at.checked_sub(*start).filter(|place| place < bytes)?;
                Some((k, place as usize))
            })
        })
    }

    fn write(&mut self, address: u64, size: usize) {
        for (memory, place) in Self::places(address, size) {
            self.0[memory][place] = true;
        }
    }

    fn has(&self, address: u64, size: usize) -> bool {
        Self::places(address, size).all(|(memory, place)| self.0[memory][place])
    }
}

/// A run of instructions that is entered at its top only.
#[derive(Clone, Copy)]
struct Block {
    end: u32,
    instructions: u64,
    cycles: u64,
}

/// What the hooks share.
struct Inside {
    chip: Chip,
    decoder: Decoder,
    blocks: FxHashMap<u32, Block>,
    /// The block that runs: its time is taken when it has run.
    current: Option<(u32, Block)>,
    limit: u64,
    stop: Option<Stop>,
    profile: Profile,
    /// A debugger has stopped the core here, within the block under way.
    within: Option<u32>,
    /// How far the step is that a debugger asked for.
    step: hooks::Step,
    /// A watchpoint has matched; the core halts before its next instruction.
    watched: bool,
    /// Addresses of the instructions that have run, if they are kept.
    trace: Vec<u32>,
    /// What was written since the power came, of the memory that parity guards; `None`: nobody looks.
    written: Option<Written>,
}

impl Inside {
    /// `size` bytes at `address` are written.
    fn write(&mut self, address: u64, size: usize) {
        if let Some(written) = &mut self.written {
            written.write(address, size);
        }
    }

    /// The block under way has run and went on to `next`, if that is known: its time passes.
    fn settle(&mut self, next: Option<u32>) {
        let Some((address, block)) = self.current.take() else {
            return;
        };
        let refill = if next.is_some_and(|next| next != block.end) {
            REFILL
        } else {
            0
        };
        let wait = std::mem::take(&mut self.chip.bus_wait);
        let cycles = block.cycles + refill;
        self.profile.run(address, block.instructions, cycles, wait);
        let now = self.chip.now + cycles + wait;
        self.chip.advance(now);
    }
}

/// Where the DMA's channels are set up.
const DMA1: u32 = 0x4002_0000;

/// Writes what the DMA has moved.
fn write_memory(unicorn: &mut Unicorn<'_, Inside>) -> Result<(), String> {
    for (address, value, bytes) in std::mem::take(&mut unicorn.get_data_mut().chip.memory_writes) {
        unicorn
            .mem_write(u64::from(address), &value.to_le_bytes()[..bytes])
            .map_err(engine)?;
        unicorn.get_data_mut().write(address.into(), bytes);
    }
    Ok(())
}

/// Reads what the DMA was told to send.
fn give_piece(unicorn: &mut Unicorn<'_, Inside>) {
    let Some((address, bytes)) = unicorn.get_data_mut().chip.take_piece() else {
        return;
    };
    let piece = unicorn.mem_read_as_vec(u64::from(address), bytes);
    let chip = &mut unicorn.get_data_mut().chip;
    match piece {
        Ok(piece) => chip.give_piece(piece),
        Err(_) => {
            let text = format!("the DMA reads {bytes} bytes at {address:#010x}: no memory there");
            chip.error.get_or_insert(text);
        }
    }
}

/// The chip with its core.
pub struct Emulator {
    unicorn: Unicorn<'static, Inside>,
    image: Rc<Image>,
    sleeping: bool,
    /// The core has met a fault that it cannot handle.
    locked_up: bool,
    hooks: Hooks,
    /// What time does while a debugger halts the core.
    pub halted_time: HaltedTime,
    /// Resets so far.
    pub resets: Vec<Reset>,
}

/// An emulator's own failure, as opposed to the firmware's.
fn engine(error: uc_error) -> String {
    format!("the Unicorn engine failed: {error:?}")
}

impl Emulator {
    /// A chip on the board of `wiring` with `image` in its flash, after a power-on reset.
    ///
    /// # Errors
    /// The image does not fit the chip, or the engine fails.
    pub fn new(
        image: &Rc<Image>,
        wiring: Wiring,
        machine: Rc<RefCell<dyn Machine>>,
    ) -> Result<Self, String> {
        let inside = Inside {
            chip: Chip::new(machine, wiring),
            decoder: Decoder::new(),
            blocks: FxHashMap::default(),
            current: None,
            limit: 0,
            stop: None,
            profile: Profile::default(),
            within: None,
            step: hooks::Step::None,
            watched: false,
            trace: Vec::new(),
            written: None,
        };
        let mut unicorn =
            Unicorn::new_with_data(Arch::ARM, Mode::MCLASS, inside).map_err(engine)?;
        unicorn
            .ctl_set_cpu_model(unicorn_engine::ArmCpuModel::CORTEX_M4 as i32)
            .map_err(engine)?;
        unicorn
            .mem_map(FLASH.0, FLASH.1, Prot::READ | Prot::EXEC)
            .map_err(engine)?;
        unicorn.mem_map(RAM.0, RAM.1, Prot::ALL).map_err(engine)?;
        unicorn.mem_map(CCM.0, CCM.1, Prot::ALL).map_err(engine)?;
        unicorn
            .mem_map(SYSTEM_MEMORY.0, SYSTEM_MEMORY.1, Prot::READ)
            .map_err(engine)?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let calibrated = adc::reference(3.0).counts.round() as u16;
        unicorn
            .mem_write(VREFINT_CAL, &calibrated.to_le_bytes())
            .map_err(engine)?;
        unicorn
            .mem_write(FLASH_SIZE, &512_u16.to_le_bytes())
            .map_err(engine)?;
        for (start, data) in &image.segments {
            unicorn
                .get_data_mut()
                .chip
                .flash
                .hold(*start, data)
                .and_then(|()| unicorn.mem_write(u64::from(*start), data).ok())
                .ok_or_else(|| {
                    format!(
                        "the firmware loads {} bytes at {start:#010x}, where the chip has no flash",
                        data.len()
                    )
                })?;
        }
        #[allow(clippy::cast_possible_truncation)]
        unicorn
            .mem_write(RAM.0, &vec![PAINT; RAM.1 as usize])
            .map_err(engine)?;
        let mut emulator = Self {
            unicorn,
            image: Rc::clone(image),
            sleeping: false,
            locked_up: false,
            hooks: Hooks::default(),
            halted_time: HaltedTime::default(),
            resets: Vec::new(),
        };
        emulator.map_peripherals()?;
        emulator.add_hooks()?;
        emulator.start_core()?;
        Ok(emulator)
    }

    fn map_peripherals(&mut self) -> Result<(), String> {
        for (start, size) in PERIPHERALS {
            #[allow(clippy::cast_possible_truncation)]
            self.unicorn
                .mmio_map(
                    start,
                    size,
                    Some(
                        move |uc: &mut Unicorn<'_, Inside>, offset: u64, size: usize| {
                            // What the DMA has moved is there before its count is read.
                            if !uc.get_data().chip.memory_writes.is_empty() {
                                let _ = write_memory(uc);
                            }
                            u64::from(uc.get_data_mut().chip.read((start + offset) as u32, size))
                        },
                    ),
                    Some(
                        move |uc: &mut Unicorn<'_, Inside>,
                              offset: u64,
                              size: usize,
                              value: u64| {
                            let address = (start + offset) as u32;
                            uc.get_data_mut().chip.write(address, size, value as u32);
                            if address & !0x3FF == DMA1 {
                                give_piece(uc);
                            }
                        },
                    ),
                )
                .map_err(engine)?;
        }
        // Each word of the alias is one bit of the peripherals' first megabyte (PM0214 2.2.5).
        #[allow(clippy::cast_possible_truncation)]
        self.unicorn
            .mmio_map(
                BIT_BAND,
                0x200_0000,
                Some(|uc: &mut Unicorn<'_, Inside>, offset: u64, _: usize| {
                    let (word, bit) = bit_banded(offset);
                    u64::from(uc.get_data_mut().chip.read(word, 4) >> bit & 1)
                }),
                Some(
                    |uc: &mut Unicorn<'_, Inside>, offset: u64, _: usize, value: u64| {
                        let (word, bit) = bit_banded(offset);
                        let chip = &mut uc.get_data_mut().chip;
                        let old = chip.read(word, 4);
                        chip.write(word, 4, old & !(1 << bit) | (value as u32 & 1) << bit);
                    },
                ),
            )
            .map_err(engine)
    }

    fn add_hooks(&mut self) -> Result<(), String> {
        self.unicorn
            .add_block_hook(1, 0, on_block)
            .map_err(engine)?;
        self.unicorn
            .add_intr_hook(|uc, number| {
                const BREAKPOINT: u32 = 7;
                const EXCEPTION_EXIT: u32 = 8;
                let inside = uc.get_data_mut();
                inside.stop = Some(match number {
                    EXCEPTION_EXIT => Stop::ExceptionReturn,
                    // Without a debugger the firmware has gone wrong, and that is said.
                    BREAKPOINT if inside.chip.debug.enabled() => Stop::Debug(Cause::Breakpoint),
                    _ => {
                        let text = format!("the core raises exception {number} by itself");
                        inside.chip.error.get_or_insert(text);
                        Stop::Look
                    }
                });
                let _ = uc.emu_stop();
            })
            .map_err(engine)?;
        self.unicorn
            .add_mem_hook(HookType::MEM_INVALID, 1, 0, |uc, kind, address, size, value| {
                if kind == MemType::WRITE_PROT && (FLASH.0..FLASH.0 + FLASH.1).contains(&address) {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                    let (address, value) = (address as u32, value as u32);
                    uc.get_data_mut().chip.write(address, size, value);
                    return true;
                }
                let pc = uc.reg_read(RegisterARM::PC).unwrap_or(0);
                let text = format!(
                    "{kind:?} of {size} bytes at {address:#010x} from {pc:#010x}: no memory there"
                );
                uc.get_data_mut().chip.error.get_or_insert(text);
                false
            })
            .map_err(engine)?;
        Ok(())
    }

    /// As after a reset: stack pointer and first instruction from the vector table.
    fn start_core(&mut self) -> Result<(), String> {
        for register in [
            RegisterARM::R0,
            RegisterARM::R1,
            RegisterARM::R2,
            RegisterARM::R3,
            RegisterARM::R4,
            RegisterARM::R5,
            RegisterARM::R6,
            RegisterARM::R7,
            RegisterARM::R8,
            RegisterARM::R9,
            RegisterARM::R10,
            RegisterARM::R11,
            RegisterARM::R12,
            RegisterARM::PRIMASK,
            RegisterARM::BASEPRI,
        ] {
            self.unicorn.reg_write(register, 0).map_err(engine)?;
        }
        const THUMB: u64 = 1 << 24;
        self.set(RegisterARM::XPSR, THUMB)?;
        self.set(RegisterARM::LR, 0xFFFF_FFFF)?;
        let (stack, entry) = (self.word(0x0800_0000)?, self.word(0x0800_0004)?);
        self.set(RegisterARM::MSP, u64::from(stack))?;
        self.set(RegisterARM::PC, u64::from(entry))?;
        let inside = self.unicorn.get_data_mut();
        (inside.current, inside.within) = (None, None);
        self.sleeping = false;
        // Without a program the first fetch is a fault, and so is its handler's.
        self.locked_up = entry & 1 == 0
            || self
                .unicorn
                .mem_read_as_vec(u64::from(entry & !1), 2)
                .is_err();
        Ok(())
    }

    /// The chip as ST ships it: nothing is in its flash, and the power has just come.
    ///
    /// # Errors
    /// The engine fails.
    pub fn deliver(&mut self) -> Result<(), String> {
        self.chip().flash.deliver();
        self.copy_flash()?;
        self.cycle_power()
    }

    /// Switches the chip's supply off and on.
    ///
    /// # Errors
    /// As [`Emulator::new`].
    pub fn cycle_power(&mut self) -> Result<(), String> {
        self.chip().restart(Reset::BrownOut);
        self.start_core()
    }

    /// The chip around the core.
    pub fn chip(&mut self) -> &mut Chip {
        &mut self.unicorn.get_data_mut().chip
    }

    /// Core cycles since the first reset.
    #[must_use]
    pub fn time(&self) -> u64 {
        self.unicorn.get_data().chip.now
    }

    /// What the interrupts cost so far.
    pub fn profile(&mut self) -> &mut Profile {
        &mut self.unicorn.get_data_mut().profile
    }

    fn get(&self, register: RegisterARM) -> Result<u32, String> {
        #[allow(clippy::cast_possible_truncation)]
        self.unicorn
            .reg_read(register)
            .map(|value| value as u32)
            .map_err(engine)
    }

    fn set(&mut self, register: RegisterARM, value: u64) -> Result<(), String> {
        self.unicorn.reg_write(register, value).map_err(engine)
    }

    /// A word of memory.
    ///
    /// # Errors
    /// There is no memory.
    pub fn word(&self, address: u32) -> Result<u32, String> {
        let mut bytes = [0; 4];
        self.unicorn
            .mem_read(u64::from(address), &mut bytes)
            .map_err(|_| format!("no memory at {address:#010x}"))?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Writes a word of memory, as a debugger does.
    ///
    /// # Errors
    /// There is no memory.
    pub fn set_word(&mut self, address: u32, value: u32) -> Result<(), String> {
        self.unicorn.get_data_mut().write(address.into(), 4);
        self.unicorn
            .mem_write(u64::from(address), &value.to_le_bytes())
            .map_err(|_| format!("no memory at {address:#010x}"))
    }

    /// The chip has so many KB of flash, before it starts.
    ///
    /// # Errors
    /// Never, while the chip has a system memory.
    pub fn set_flash_size(&mut self, kilobytes: u16) -> Result<(), String> {
        self.unicorn
            .mem_write(FLASH_SIZE, &kilobytes.to_le_bytes())
            .map_err(engine)
    }

    /// Changes an instruction in memory.
    ///
    /// # Errors
    /// There is no memory.
    pub fn patch(&mut self, address: u32, instruction: u16) -> Result<(), String> {
        let at = u64::from(address);
        self.unicorn
            .mem_write(at, &instruction.to_le_bytes())
            .map_err(|_| format!("no memory at {address:#010x}"))?;
        self.unicorn.get_data_mut().blocks.clear();
        self.unicorn.ctl_flush_tb().map_err(engine)
    }

    /// Bytes of memory.
    ///
    /// # Errors
    /// There is no memory.
    pub fn bytes(&self, address: u32, size: usize) -> Result<Vec<u8>, String> {
        self.unicorn
            .mem_read_as_vec(u64::from(address), size)
            .map_err(|_| format!("no memory at {address:#010x}"))
    }

    /// The deepest that the stack has been, bytes.
    ///
    /// # Errors
    /// The engine fails.
    pub fn stack_used(&self) -> Result<u32, String> {
        #[allow(clippy::cast_possible_truncation)]
        let (start, size) = (RAM.0 as u32, RAM.1 as usize);
        let bottom = self.image.symbol("__eguard")?;
        let stack = self.bytes(bottom, size - (bottom - start) as usize)?;
        let untouched = stack.iter().take_while(|&&byte| byte == PAINT).count();
        #[allow(clippy::cast_possible_truncation)]
        Ok((stack.len() - untouched) as u32)
    }

    /// Runs until the chip's time is `time`, in core cycles since the first reset.
    ///
    /// # Errors
    /// A sentence about what the firmware did that the chip does not have, or about the engine.
    pub fn run_until(&mut self, time: u64) -> Result<(), String> {
        self.unicorn.get_data_mut().limit = time;
        loop {
            let chip = &mut self.unicorn.get_data_mut().chip;
            if let Some(error) = chip.error.clone() {
                return Err(format!("{error} (at {})", self.place()));
            }
            if let Some(reason) = chip.reset {
                chip.restart(reason);
                self.resets.push(reason);
                self.start_core()?;
                if self.chip().debug.reset() {
                    self.halt(Cause::VectorCatch);
                }
                continue;
            }
            if chip.debug.enabled() && self.is_halted(time)? {
                if self.halted_time == HaltedTime::Frozen || self.time() >= time {
                    return Ok(());
                }
                self.pass_halted(time)?;
                continue;
            }
            let chip = &mut self.unicorn.get_data_mut().chip;
            if chip.now >= time {
                return Ok(());
            }
            if chip.frozen || self.locked_up {
                let next = chip.next_event().min(time);
                chip.advance(next);
                continue;
            }
            if let Some(exception) = self.next_exception()? {
                self.sleeping = false;
                self.enter(exception)?;
                continue;
            } else if self.sleeping {
                #[allow(clippy::cast_possible_truncation)]
                let basepri = self.get(RegisterARM::BASEPRI)? as u8;
                let chip = &mut self.unicorn.get_data_mut().chip;
                if chip.nvic.wakes(basepri) {
                    self.sleeping = false;
                } else {
                    let next = chip.next_event().min(time);
                    chip.advance(next);
                    self.flush_memory()?;
                    continue;
                }
            }
            self.run()?;
        }
    }

    /// The exception that the core takes next, if any. None comes within a block.
    fn next_exception(&self) -> Result<Option<usize>, String> {
        let (basepri, primask) = (
            self.get(RegisterARM::BASEPRI)?,
            self.get(RegisterARM::PRIMASK)?,
        );
        #[allow(clippy::cast_possible_truncation)]
        let basepri = basepri as u8;
        let inside = self.unicorn.get_data();
        if inside.within.is_some() {
            return Ok(None);
        }
        let masked = primask & 1 == 1 || inside.chip.debug.masks_interrupts();
        Ok(inside.chip.nvic.takeable(basepri, masked))
    }

    /// From here on a write to memory that the protection unit closes is a fault. It costs a look at each write, so it is for
    /// tests of just that.
    ///
    /// # Errors
    /// The firmware closes nothing yet, or the engine fails.
    pub fn enforce_protection(&mut self) -> Result<(), String> {
        let (start, size) = self
            .chip()
            .nvic
            .closed_memory()
            .ok_or("the firmware closes no memory")?;
        let (start, end) = (u64::from(start), u64::from(start + size) - 1);
        self.unicorn
            .add_mem_hook(HookType::MEM_WRITE, start, end, |uc, _, _, _, _| {
                let inside = uc.get_data_mut();
                if inside.chip.nvic.closed_memory().is_some() {
                    inside.stop = Some(Stop::Fault);
                    let _ = uc.emu_stop();
                }
                true
            })
            .map_err(engine)?;
        // What was translated before does not look.
        self.unicorn.ctl_flush_tb().map_err(engine)
    }

    /// From here on a byte that parity guards and that was not written since is a wrong bit when it is read. It costs a look at each
    /// access, so it is for tests of just that; called before the chip runs, as a power-on leaves its memory.
    ///
    /// # Errors
    /// The engine fails.
    pub fn enforce_parity(&mut self) -> Result<(), String> {
        self.unicorn.get_data_mut().written = Some(Written::default());
        for (start, size) in PARITY {
            let end = start + size - 1;
            self.unicorn
                .add_mem_hook(HookType::MEM_WRITE, start, end, |uc, _, at, size, _| {
                    uc.get_data_mut().write(at, size);
                    true
                })
                .map_err(engine)?;
            self.unicorn
                .add_mem_hook(HookType::MEM_READ, start, end, |uc, _, at, size, _| {
                    let inside = uc.get_data_mut();
                    if inside.written.as_ref().is_some_and(|it| !it.has(at, size)) {
                        inside.chip.read_wrong_bits(Checked::Ram);
                    }
                    true
                })
                .map_err(engine)?;
        }
        Ok(())
    }

    /// From here on the address of each instruction that runs is kept. It costs a look at each, so it is for tests of just that.
    ///
    /// # Errors
    /// The engine fails.
    pub fn trace(&mut self) -> Result<(), String> {
        self.unicorn
            .add_code_hook(1, 0, |uc, address, _| {
                #[allow(clippy::cast_possible_truncation)]
                uc.get_data_mut().trace.push(address as u32);
            })
            .map_err(engine)?;
        self.unicorn.ctl_flush_tb().map_err(engine)
    }

    /// The addresses that were kept.
    #[must_use]
    pub fn traced(&self) -> &[u32] {
        &self.unicorn.get_data().trace
    }

    /// Moves the stack of the code that runs, as one that has used it up.
    ///
    /// # Errors
    /// The engine fails.
    pub fn set_stack(&mut self, address: u32) -> Result<(), String> {
        self.set(RegisterARM::MSP, address.into())
    }

    fn flush_memory(&mut self) -> Result<(), String> {
        write_memory(&mut self.unicorn)
    }

    /// Runs the core until a hook stops it.
    fn run(&mut self) -> Result<(), String> {
        const NOWHERE: u64 = 0xFFFF_FFFE;
        self.copy_flash()?;
        self.place_hooks()?;
        let pc = self.get(RegisterARM::PC)?;
        self.unicorn.get_data_mut().stop = None;
        let result = self.unicorn.emu_start(u64::from(pc | 1), NOWHERE, 0, 0);
        if let Some(Stop::Debug(cause)) = self.unicorn.get_data().stop {
            self.stop_within()?;
            self.flush_memory()?;
            self.halt(cause);
            return Ok(());
        }
        let inside = self.unicorn.get_data_mut();
        inside.settle(None);
        self.flush_memory()?;
        let inside = self.unicorn.get_data_mut();
        match (inside.stop.take(), result) {
            (Some(Stop::ExceptionReturn), _) => self.leave(),
            (Some(Stop::Fault), _) => self.fault(),
            (Some(Stop::Look | Stop::Debug(_)), Ok(())) => Ok(()),
            // The core stopped by itself: it sleeps.
            (None, Ok(())) => {
                self.sleeping = true;
                Ok(())
            }
            (None, Err(uc_error::INSN_INVALID)) if inside.chip.debug.enabled() => self.undefined(),
            (_, Err(error)) => {
                let known = inside.chip.error.clone();
                Err(format!(
                    "{} (at {})",
                    known.unwrap_or_else(|| engine(error)),
                    self.place()
                ))
            }
        }
    }

    /// Where the core is, in words.
    fn place(&self) -> String {
        let pc = self.get(RegisterARM::PC).unwrap_or(0);
        let lr = self.get(RegisterARM::LR).unwrap_or(0) & !1;
        let name = |address| {
            self.image
                .function_at(address)
                .map_or("nowhere", |f| f.name.as_str())
        };
        format!("{pc:#010x} in {}, called from {}", name(pc), name(lr))
    }
}

fn bit_banded(offset: u64) -> (u32, u32) {
    #[allow(clippy::cast_possible_truncation)]
    let (byte, bit) = ((offset / 32) as u32, (offset / 4 % 8) as u32);
    (0x4000_0000 + (byte & !3), bit + 8 * (byte & 3))
}

/// The core is about to run a block: time passes, and what falls due happens.
fn on_block(uc: &mut Unicorn<'_, Inside>, address: u64, size: u32) {
    #[allow(clippy::cast_possible_truncation)]
    let address = address as u32;
    if !uc.get_data().blocks.contains_key(&address) {
        let code = uc
            .mem_read_as_vec(u64::from(address), size as usize)
            .unwrap_or_default();
        let inside = uc.get_data_mut();
        match inside.decoder.decode(&code, address) {
            Ok(list) => {
                let block = Block {
                    end: address + size,
                    instructions: list.len() as u64,
                    cycles: list.iter().map(|instruction| instruction.cycles).sum(),
                };
                inside.blocks.insert(address, block);
            }
            Err(error) => {
                inside
                    .chip
                    .error
                    .get_or_insert(format!("no instructions at {address:#010x}: {error}"));
            }
        }
    }
    let inside = uc.get_data_mut();
    if inside.within.take() == Some(address) {
        // The rest of the block that a debugger stopped in.
        return;
    }
    inside.settle(Some(address));
    let Some(&block) = inside.blocks.get(&address) else {
        inside.stop = Some(Stop::Look);
        let _ = uc.emu_stop();
        return;
    };
    let now = inside.chip.now;
    let chip = &inside.chip;
    // A debugger's stop may have come in an IT block, which goes on.
    let mut stop = inside.stop.is_some()
        || chip.error.is_some()
        || chip.reset.is_some()
        || now >= inside.limit;
    let pending = chip.nvic.any_pending();
    let writes = !chip.memory_writes.is_empty();
    if pending && !stop {
        #[allow(clippy::cast_possible_truncation)]
        let basepri = uc.reg_read(RegisterARM::BASEPRI).unwrap_or(0) as u8;
        let primask = uc.reg_read(RegisterARM::PRIMASK).unwrap_or(0) & 1 == 1;
        let chip = &uc.get_data().chip;
        let masked = primask || chip.debug.masks_interrupts();
        stop = chip.nvic.takeable(basepri, masked).is_some();
    }
    if writes {
        let _ = write_memory(uc);
    }
    if stop {
        // The block has not run and is met again.
        uc.get_data_mut().stop.get_or_insert(Stop::Look);
        let _ = uc.emu_stop();
    } else {
        uc.get_data_mut().current = Some((address, block));
    }
}
