//! The drive's application: one body for the firmware and the simulated drive.
//!
//! It has no hardware and no input or output of its own. A host calls four parts, each at its rate:
//!
//! | part | rate | what it does |
//! | --- | --- | --- |
//! | [`speed::SpeedStep`] | each step of the speed task | takes commands, steps the control, shows the state, samples telemetry |
//! | [`supervise::Supervise`], [`orders::Orders`] | each millisecond | moves, homing, soft limits; the guard; the journal |
//! | [`burst::Burst`] | after each PWM period of a current loop | keeps it, while a burst is armed |
//! | [`lines::Lines`] | as often as there is time | answers what hosts ask: arming, settings, telemetry |
//!
//! The parts share [`exchange::DriveExchange`] and the debug view, words of one writer each. The current loops stay outside:
//! [`control::exchange::MotorExchange`] lies between them and the speed task.
#![no_std]
#![deny(unsafe_code)]

pub mod burst;
pub mod configured;
pub mod drive;
pub mod exchange;
pub mod keep;
pub mod lines;
pub mod motors;
pub mod orders;
pub mod rows;
pub mod server;
pub mod speed;
pub mod start;
pub mod supervise;
pub mod telemetry;
