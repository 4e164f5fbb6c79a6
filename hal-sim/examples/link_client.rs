//! A client of the drive's link, against a simulated drive: arm, jog, read the status, stop.
//!
//! `cargo run -p hal-sim --example link_client` prints what the drive reports. Another transport (TCP, a serial port) implements
//! [`Line`](link::host::client::Line); the rest stays.

use anyhow::{Result, bail};
use control::supervisor::State;
use hal_sim::experiment::{RPM, Setup};
use hal_sim::served::{Serving, SimulatedDrive, Within};
use link::host::client::Client;
use link::message::{Command, Status};
use link::scale;
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// A drive with its machine, and a client on a line to it. A millisecond passes each time the client listens.
struct Session {
    serving: Rc<RefCell<Serving>>,
    client: Client<Within>,
}

impl Session {
    fn open() -> Result<Self> {
        let setup = Setup::real(Model::coupled(), Coupling::Coupled);
        let serving = Rc::new(RefCell::new(Serving::new(SimulatedDrive::new(&setup)?)));
        let client = Client::open(Within::open(&serving))?;
        let mut session = Self { serving, client };
        session.wait_for(State::Ready)?;
        Ok(session)
    }

    /// Waits at most 5 s. A drive that hears no heartbeat comes to rest by itself.
    fn wait_for(&mut self, expected: State) -> Result<Status> {
        for _ in 0..50 {
            let status = self.pass(100)?;
            if State::of_words(status.state, status.fault) == Some(expected) {
                return Ok(status);
            }
        }
        bail!("the drive is not {expected:?} after 5 s")
    }

    /// So many milliseconds, with a heartbeat in each 100 ms.
    fn pass(&mut self, ms: u32) -> Result<Status> {
        for k in 0..ms {
            if k % 100 == 0 {
                self.client.beat()?;
            }
            self.client.listen(Duration::from_millis(1))?;
        }
        self.client.status()
    }

    /// Jogs the table at a velocity, m/s, with the nut at a speed, rad/s.
    fn jog(&mut self, velocity_m_s: f64, nut_rad_s: f64) -> Result<()> {
        let Some(velocity) = scale::word(velocity_m_s, scale::TABLE_VELOCITY) else {
            bail!("{velocity_m_s} m/s exceeds the link's range");
        };
        let base = scale::word(nut_rad_s, scale::BASE_SPEED);
        self.client.tell(Command::Run { velocity, base })
    }

    /// Where the machine's table really is, m.
    fn table_m(&self) -> f64 {
        let serving = self.serving.borrow();
        serving.drive().drive().board.machine.table_position()
    }
}

/// Travel, m, in a second of 2.5 mm/s with the nut at 300 rpm, and the nut's speed as the drive reports it, rpm.
fn jog_for_a_second(session: &mut Session) -> Result<(f64, f64)> {
    session.client.arm(|_| true)?;
    session.jog(2.5e-3, 300.0 * RPM)?;
    session.pass(1000)?;
    let from = session.table_m();
    let began = session.client.status()?.uptime_ms;
    let status = session.pass(1000)?;
    let seconds = f64::from(status.uptime_ms - began) * 1e-3;
    let travel = (session.table_m() - from) / seconds;
    let rpm = scale::value(status.motors[1].speed, scale::BASE_SPEED) / RPM;
    session.client.tell(Command::Stop)?;
    session.wait_for(State::Ready)?;
    Ok((travel, rpm))
}

fn main() -> Result<()> {
    let mut session = Session::open()?;
    let (travel, rpm) = jog_for_a_second(&mut session)?;
    println!("table {:.3} mm in a second, nut {rpm:.1} rpm", 1e3 * travel);
    Ok(())
}

#[test]
fn the_table_moves_as_the_client_asks_and_then_stands() {
    let mut session = Session::open().unwrap();
    let (travel, rpm) = jog_for_a_second(&mut session).unwrap();
    assert!(
        (travel / 2.5e-3 - 1.0).abs() < 0.01,
        "{travel} m in a second, expected 0.0025"
    );
    assert!(
        (rpm - 300.0).abs() < 10.0,
        "{rpm} rpm, expected 300 within 10"
    );
    let rest = session.table_m();
    session.pass(500).unwrap();
    let moved = session.table_m() - rest;
    assert!(moved.abs() < 5e-6, "at rest the table moved by {moved} m");
}

#[test]
fn a_drive_that_is_not_armed_refuses_and_stands() {
    let mut session = Session::open().unwrap();
    let from = session.table_m();
    assert!(session.jog(2.5e-3, 300.0 * RPM).is_err());
    session.pass(500).unwrap();
    let moved = session.table_m() - from;
    assert!(moved.abs() < 5e-6, "the table moved by {moved} m");
}
