//! The control law of a double-drive differential feed, in fixed point.
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

pub mod active_limit;
pub mod alignment;
pub mod brake;
pub mod codes;
pub mod compensation;
pub mod controller_supply;
pub mod coordinator;
pub mod current_limit;
pub mod current_loop;
pub mod disturbance;
pub mod enable_watch;
pub mod encoder;
pub mod encoder_watch;
pub mod ends_watch;
pub mod exchange;
pub mod fault;
mod follow;
pub mod format;
pub mod friction;
#[allow(clippy::float_arithmetic)]
pub mod guard;
pub mod homing;
pub mod interlock;
pub mod journal;
pub mod modulation;
pub mod motor_io;
pub mod mt6835;
pub mod notch;
pub mod observer;
#[allow(clippy::float_arithmetic)]
pub mod plate;
pub mod power_stage;
pub mod profile;
pub mod regulator;
pub mod runaway;
#[allow(clippy::float_arithmetic)]
pub mod scale_watch;
pub mod seizure_watch;
pub mod sense;
mod sine;
pub mod speed_loop;
pub mod speed_task;
pub mod supervisor;
pub mod table_move;
mod table_speed;
pub mod thermal;
#[allow(clippy::float_arithmetic)]
pub mod thermometer;
pub mod tolerance;
pub mod transform;
pub mod travel;
