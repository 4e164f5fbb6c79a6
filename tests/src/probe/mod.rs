//! A debug probe at the emulated chip: [`swd`] is the wire, [`port`] the chip's debug port behind it, [`remote`] the probe's own
//! protocol, [`server`] a network address where a debugger finds it, [`served`] a bench behind it.

pub mod port;
pub mod remote;
pub mod served;
pub mod server;
pub mod swd;
