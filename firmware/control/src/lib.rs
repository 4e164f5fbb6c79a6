//! The control law of a double-drive differential feed, in fixed point.
//!
//! Each folder uses only those before it:
//!
//! | folder | what it has |
//! | --- | --- |
//! | [`base`] | formats, codes of faults, rates |
//! | [`current`] | the current loop of one motor |
//! | [`speed`] | the parts of the speed task |
//! | [`watch`] | what finds that something is wrong |
//! | [`plate`] | plate data into gains |
//! | [`drive`] | the drive as a whole: states, the speed task, moves |
//!
//! The way of the data is the order of the modules:
//!
//! | step | module | rate |
//! | --- | --- | --- |
//! | ADC counts -> codes, current vector, bus voltage | [`sense`] | each PWM period |
//! | encoder counts -> `theta_e`, `omega_e` | [`observer`] | each PWM period |
//! | is the encoder alive? | [`encoder_watch`] | each PWM period |
//! | `theta_e` -> cosine and sine | `sine` | each PWM period |
//! | stator's frame -> d, q and back | [`transform`] | each PWM period |
//! | PI in d and q, voltage limit, anti-windup | [`regulator`] | each PWM period |
//! | voltage -> timer compare values | [`modulation`] | each PWM period |
//! | the registers of all that | [`motor_io`] | each PWM period |
//! | the seven above in one step | [`current_loop`] | each PWM period |
//! | speed error -> `i_q` reference | [`speed_loop`] | speed task |
//! | jerk-limited reference | [`profile`] | speed task |
//! | table velocity, base speed -> two references | [`coordinator`] | speed task |
//! | torque set-point of a motor, within a speed | [`torque`] | speed task |
//! | where both rotors stand | [`alignment`] | speed task, before the drive is ready |
//! | ripple that repeats with an angle | [`compensation`] | speed task |
//! | friction where a reference reverses | [`friction`] | speed task |
//! | torque that nobody knows | [`disturbance`] | speed task |
//! | the axial mode's frequency, left out | [`notch`] | speed task |
//! | heat of windings and bridges, a bus that fills -> current limits | [`thermal`], [`current_limit`] | speed task |
//! | is the motion in hand? | [`runaway`] | speed task |
//! | may the machine go on moving? | [`interlock`] | speed task |
//! | does the brake hold the table? | [`brake`] | speed task |
//! | what the drive is doing and may do next | [`supervisor`] | speed task |
//! | what can stop it | [`fault`] | |
//! | the last five in one step | [`speed_task`] | speed task |
//! | late tasks, bus, temperatures, index -> fault | [`guard`] | supervision |
//! | a distance -> table velocities | [`table_move`] | below the speed task |
//! | positions that a host streams -> table velocities | [`stream`] | below the speed task |
//! | where the table stands: an end switch -> the scale's zero | [`homing`] | below the speed task |
//! | position, reference -> may the table go on to its soft limit? | [`travel`] | supervision |
//! | words between the interrupts | [`exchange`] | |
//!
//! [`plate`] turns plate data into gains (Eqs 9 to 12 of Wang et al. 2020) once, [`format`](mod@format) says
//! in which fixed-point format each quantity lives and why. Everything else is integer.
//!
//! Equations named `Eq n` are those of Wang et al., Mech. Sci. 11, 163-172, 2020.
#![no_std]
#![deny(unsafe_code)]
#![deny(
    clippy::arithmetic_side_effects,
    clippy::float_arithmetic,
    clippy::indexing_slicing,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic
)]
#![cfg_attr(
    test,
    allow(
        clippy::arithmetic_side_effects,
        clippy::float_arithmetic,
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::panic
    )
)]

#[cfg(test)]
extern crate std;

pub mod base;
pub mod current;
pub mod drive;
#[allow(clippy::float_arithmetic)]
pub mod plate;
pub mod speed;
pub mod watch;

pub use base::{codes, fault, format, rates, tolerance};
pub use current::{
    current_loop, encoder, encoder_watch, exchange, modulation, motor_io, mt6835, observer,
    regulator, sense, transform,
};
pub use drive::{homing, journal, speed_task, stream, supervisor, table_move};
pub use speed::{
    alignment, brake, compensation, coordinator, current_limit, disturbance, friction, notch,
    profile, speed_loop, thermal, torque,
};
pub use watch::{
    active_limit, controller_supply, enable_watch, ends_watch, guard, interlock, power_stage,
    runaway, scale_watch, seizure_watch, standing_watch, thermometer, travel,
};
