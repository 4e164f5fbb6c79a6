//! The firmware on the emulated chip, one file a subject. One program: the emulator is linked once, and what a firmware is built
//! for is built once.

mod alignment;
mod boards;
mod bringup;
mod cost;
mod drive;
mod encoders;
mod faults;
mod first_power_up;
mod guards;
mod handlers;
mod identified;
mod interlock;
mod link;
mod log;
mod pins;
mod power_stage;
mod same_bits;
mod session;
mod settings;
mod settling;
mod sizes;
mod soft_float;
mod stack;
mod stages;
mod supply;
mod telemetry;
mod wiring;
