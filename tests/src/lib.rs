//! The firmware's release ELF, unmodified, on an emulated STM32G474 whose pins are joined to a simulated machine.
//!
//! [`image`] reads the ELF, [`chip`] is the chip around the core, [`emulator`] the core itself and its exceptions,
//! [`timing`] what each instruction costs on a Cortex-M4, [`pins`] what the chip's pins are joined to, [`joint`] the
//! machine of `hal-sim` at the pins, [`probe`] a debug probe at its debug port, [`mod@bench`] a drive on that bench as a person with a probe would use it.
//!
//! A register that the firmware touches and the chip model lacks is an error that names it, not a silent zero.

pub mod bench;
pub mod chip;
pub mod commander;
pub mod cost;
pub mod emulator;
pub mod graph;
pub mod image;
pub mod joint;
pub mod known;
pub mod log;
mod memory;
pub mod pins;
pub mod probe;
pub mod same;
pub mod sizes;
pub mod timing;
pub mod wire;
