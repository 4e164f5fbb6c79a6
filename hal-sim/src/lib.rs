//! The board's peripherals on the simulated machine, and the drive on that board.
//!
//! - [`sensors`]: what measures the machine: resolution, range, noise.
//! - [`board`]: timers, bridges, ADCs, encoders, break inputs: the raw seam, stepped from one counter turn to the next.
//! - [`boards`]: the boards that the firmware is built for, from its own plates.
//! - `encoder_errors`: what their encoders read wrong.
//! - [`seam`]: what may stand between board and control, and act on the machine: the place of a sensor's fault.
//! - [`supervision`]: what the firmware's supervision and analog watchdogs look at.
//! - [`wiring`]: how motors, current channels and encoders are connected.
//! - [`mt6835`]: an absolute encoder's frames.
//! - [`plates`]: the plate data that the control code gets for a model of a machine.
//! - [`flash`]: the chip's flash as a store of settings sees it, with power that may be cut.
//! - [`served`]: the drive behind the link, for hosts that command it.
//! - [`start`]: a drive that does not know where its rotors stand.
//! - [`smooth`]: how smooth the table moves, with what the drive compensates and without.
//! - [`drive`]: the control code on the board, with the interrupts' order and rates.
//! - [`parallel`]: independent runs on all cores.
//! - [`experiment`]: profiles, records, and what is measured on them.
//! - [`replay`]: a recording driven again, beside what was recorded.
//! - [`vrf`], [`response`], [`analytic`]: velocity ripple, measured sensitivity, and the paper's own formulas.
//!
//! A run has one thread and one seed: the same call gives the same bits.
#![forbid(unsafe_code)]

pub mod analog;
pub mod analytic;
pub mod board;
pub mod boards;
pub mod drive;
mod encoder_errors;
pub mod experiment;
pub mod flash;
pub mod hold_ripple;
pub mod mt6835;
pub mod parallel;
pub mod plates;
pub mod replay;
pub mod response;
pub mod seam;
pub mod sensors;
pub mod served;
pub mod smooth;
pub mod start;
pub mod supervision;
pub mod switching;
pub mod vrf;
pub mod wiring;
