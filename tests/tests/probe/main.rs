//! The debugger's own library, probe-rs, at the emulated chip.

mod commands;
mod core;
mod emulated;
mod failures;
mod figures;
mod flash;
mod half_written;
mod halted;
mod program;
mod record;
mod source;
