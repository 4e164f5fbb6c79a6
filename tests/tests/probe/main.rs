//! The debugger's own library, probe-rs, at the emulated chip.

mod core;
mod emulated;
mod flash;
mod source;
