//! What a host says to a served drive.

use hal_sim::served::{Serving, Within};
use link::host::client::Client;
use link::message::{Command, Injected, Injection};
use link::scale;
use link::telemetry::Real;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;

pub fn open(serving: &Rc<RefCell<Serving>>) -> Client<Within> {
    Client::open(Within::open(serving)).unwrap()
}

/// A table velocity of so many mm/s.
pub fn velocity(mm_s: f64) -> i32 {
    scale::word(mm_s * 1e-3, scale::TABLE_VELOCITY).unwrap()
}

/// A motor's speed of so many rpm.
pub fn base(rpm: f64) -> i32 {
    scale::word(rpm * TAU / 60.0, scale::BASE_SPEED).unwrap()
}

pub fn speeds(mm_s: f64, rpm: f64) -> Command {
    Command::Run {
        velocity: velocity(mm_s),
        base: Some(base(rpm)),
    }
}

pub fn inject(fault: Injected, motor: u8, amount: f64) -> Command {
    Command::Inject(Injection {
        fault: fault.word(),
        motor,
        amount: Real::new(amount),
    })
}
