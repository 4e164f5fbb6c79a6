//! What touches registers. One file a function of the board; nothing above this module names a register,
//! but the bring-up, which asks them.

pub(crate) mod analog;
pub(crate) mod clock;
pub(crate) mod cycles;
pub(crate) mod deadman;
pub(crate) mod encoder;
pub(crate) mod flash;
pub(crate) mod gate_drivers;
pub(crate) mod inputs;
pub(crate) mod motor_io;
pub(crate) mod outputs;
pub(crate) mod protection;
pub(crate) mod pwm;
pub(crate) mod serial;
pub(crate) mod stack_guard;
pub(crate) mod watchdog;
