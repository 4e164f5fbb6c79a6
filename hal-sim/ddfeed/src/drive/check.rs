//! What can be said against a wish before the drive is looked for.

use super::options::{
    CommissionOptions, FollowOptions, JogOptions, Motor, MoveOptions, RecordOptions, Task,
    TorqueOptions, TurnOptions,
};
use crate::session::divider;
use anyhow::{Result, ensure};
use control::stream::DELAY_MS;
use std::time::Duration;

/// Largest distance of a move, mm.
const MOST_MOVE_MM: f64 = 1e4;
/// Most that is kept of what came before a trigger, s: 300,000 rows.
const MOST_PAST_S: f64 = 60.0;

impl Task {
    /// What can be said against it before the drive is looked for.
    pub fn check(&self) -> Result<()> {
        match self {
            Task::Jog(jog) => jog.check(),
            Task::Turn(turn) => turn.check(),
            Task::Follow(follow) => follow.check(),
            Task::Torque(torque) => torque.check(),
            Task::Move(travel) => travel.check(),
            Task::Home(home) => finite("--nut-rpm", home.lead.nut_rpm.unwrap_or_default()),
            Task::Record(record) => record.check(),
            Task::Commission(commission) => commission.check(),
            Task::Burst(burst) => burst.check(),
            Task::Tune(tune) => tune.loops.check(),
            _ => Ok(()),
        }
    }
}

fn finite(name: &str, value: f64) -> Result<()> {
    ensure!(
        value.is_finite(),
        "{name} is {value}, but a number is needed"
    );
    Ok(())
}

/// A duration, where there is one, is a time.
fn lasting(duration: Option<f64>) -> Result<()> {
    let seconds = duration.unwrap_or(1.0);
    ensure!(
        seconds > 0.0 && Duration::try_from_secs_f64(seconds).is_ok(),
        "--duration is {seconds} s, but a time above 0 is needed"
    );
    Ok(())
}

impl JogOptions {
    fn check(&self) -> Result<()> {
        finite("--table-speed", self.table_speed)?;
        finite("--nut-rpm", self.lead.nut_rpm.unwrap_or_default())?;
        lasting(self.duration)
    }
}

impl TurnOptions {
    fn check(&self) -> Result<()> {
        finite("--rpm", self.rpm)?;
        lasting(self.duration)?;
        let Some(degrees) = self.angle else {
            return Ok(());
        };
        finite("--angle", degrees)?;
        ensure!(
            self.motor == Motor::Screw,
            "--angle is for the screw: a move's base speed is one of both motors, so the nut cannot turn by an angle alone"
        );
        ensure!(
            degrees != 0.0 && self.rpm > 0.0,
            "--angle is {degrees} degrees and --rpm {} rpm, but an angle other than 0 and a speed above 0 are needed",
            self.rpm
        );
        Ok(())
    }
}

impl FollowOptions {
    fn check(&self) -> Result<()> {
        finite("--nut-rpm", self.lead.nut_rpm.unwrap_or_default())?;
        let [least, most] = DELAY_MS;
        ensure!(
            (least..=most).contains(&self.delay_ms),
            "--delay-ms is {} ms, but {least} to {most} ms are possible",
            self.delay_ms
        );
        Ok(())
    }
}

impl TorqueOptions {
    fn check(&self) -> Result<()> {
        finite("--nm", self.nm.unwrap_or_default())?;
        finite("--table-force", self.table_force.unwrap_or_default())?;
        finite("--rpm-max", self.rpm_max.unwrap_or_default())?;
        finite("--other-rpm", self.other_rpm)?;
        lasting(self.duration)
    }
}

impl MoveOptions {
    fn check(&self) -> Result<()> {
        let distance = self.distance.unwrap_or(1.0);
        ensure!(
            distance.abs() > 0.0 && distance.abs() <= MOST_MOVE_MM,
            "the distance is {distance} mm, but up to {MOST_MOVE_MM} mm either way are possible, and 0 is no move"
        );
        let to = self.to.unwrap_or_default();
        ensure!(
            to.abs() <= MOST_MOVE_MM,
            "--to is {to} mm, but -{MOST_MOVE_MM} to {MOST_MOVE_MM} mm are possible"
        );
        finite("--nut-rpm", self.lead.nut_rpm.unwrap_or_default())?;
        ensure!(
            self.table_speed > 0.0 && self.table_speed.is_finite(),
            "--table-speed is {} mm/s, but one above 0 is needed: the distance says which way",
            self.table_speed
        );
        Ok(())
    }
}

impl RecordOptions {
    fn check(&self) -> Result<()> {
        divider(self.rate)?;
        self.mcap_writer()?;
        ensure!(
            self.duration.is_some() || self.trigger.is_some() || !self.hold.is_empty(),
            "how long to record is not said: give --duration S, or --hold MM_S,RPM,S for each operating point"
        );
        let seconds = self.seconds();
        ensure!(
            seconds.is_finite() && seconds > 0.0,
            "--duration is {seconds} s, but a time above 0 is needed"
        );
        ensure!(
            (0.0..=MOST_PAST_S).contains(&self.past),
            "--past is {} s, but 0 to {MOST_PAST_S} s are possible",
            self.past
        );
        ensure!(
            !self.name.is_empty() && !self.name.contains(['/', '\\']),
            "--name is `{}`, but a name within the folder is needed",
            self.name
        );
        Ok(())
    }
}

impl CommissionOptions {
    fn check(&self) -> Result<()> {
        ensure!(
            self.arm,
            "both motors will turn, and the table will move by up to {} mm to each side: see that it can, and give --arm",
            self.travel
        );
        ensure!(
            (0.1..=1000.0).contains(&self.travel),
            "--travel is {} mm, but 0.1 to 1000 mm are possible",
            self.travel
        );
        self.loops.check()
    }
}
