//! `drive status` and `drive faults`.

use super::connect::Drive;
use anyhow::{Context, Result};
use link::codes::{Fault, Misalignment, State, TableFit, TableFits};
use link::message::{Event, Status, Travel};
use link::scale;
use link::settings::Settings;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// What a fault is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Drive,
    Screw,
    Nut,
    Table,
}

impl Part {
    fn of(fault: Fault) -> Self {
        match fault {
            Fault::EndForward | Fault::EndBackward => Self::Table,
            fault if fault.name().ends_with("screw and nut") => Self::Drive,
            fault if fault.name().ends_with(", screw") => Self::Screw,
            fault if fault.name().ends_with(", nut") => Self::Nut,
            _ => Self::Drive,
        }
    }
}

/// A status with what its words mean.
pub struct Seen {
    status: Status,
    /// `None`: a state that this program does not know.
    pub state: Option<State>,
}

impl Seen {
    pub fn of(status: Status) -> Self {
        Self {
            state: State::of_words(status.state, status.fault),
            status,
        }
    }

    /// The fault that has stopped it.
    pub fn fault(&self) -> Option<Fault> {
        Fault::of_word(self.status.fault)
    }

    /// How a move is going.
    pub fn travel(&self) -> Option<Travel> {
        Travel::of_word(self.status.travel)
    }

    fn state_name(&self) -> &'static str {
        self.state.map_or("unknown", State::name)
    }

    fn misalignment(&self) -> Option<Misalignment> {
        Misalignment::of_word(self.status.misalignment)
    }

    /// The tables of compensation that were saved, and what was found of them.
    fn tables(&self) -> impl Iterator<Item = (&'static str, TableFit)> {
        let fits = TableFits(self.status.tables);
        let each = TableFits::NAMES.into_iter().enumerate();
        each.filter_map(move |(table, name)| {
            let fit = fits.of(table)?;
            (fit != TableFit::None).then_some((name, fit))
        })
    }

    /// Speed of motor 0 (screw) or 1 (nut), rpm.
    fn rpm(&self, motor: usize) -> f64 {
        scale::value(self.status.motors[motor].speed, scale::BASE_SPEED) * 60.0 / TAU
    }

    fn currents(&self, motor: usize) -> [f64; 2] {
        let current = self.status.motors[motor].current;
        current.map(|word| scale::value(word, scale::CURRENT))
    }

    /// The table's place, mm.
    pub fn position_mm(&self, settings: &Settings) -> f64 {
        f64::from(self.status.scale) * settings.feed.scale_count_nm * 1e-6
    }

    fn velocity_mm_s(&self, settings: &Settings) -> f64 {
        (self.rpm(0) - self.rpm(1)) / 60.0 * settings.feed.lead_mm
    }

    /// In a line.
    pub fn line(&self, settings: &Settings) -> String {
        let mut line = format!("{:9.3} s  {}", self.seconds(), self.state_name());
        if self.status.armed {
            line += ", armed";
        }
        if let Some(fault) = self.fault() {
            line += &format!(" ({})", fault.name());
        }
        for (motor, name) in ["screw", "nut"].into_iter().enumerate() {
            let (rpm, [_, i_q]) = (self.rpm(motor), self.currents(motor));
            line += &format!("  {name} {rpm:+.1} rpm, i_q {i_q:+.3} A");
        }
        line + &format!(
            "  table {:+.4} mm, {:+.3} mm/s",
            self.position_mm(settings),
            self.velocity_mm_s(settings)
        )
    }

    fn seconds(&self) -> f64 {
        f64::from(self.status.uptime_ms) / 1e3
    }

    /// As JSON, each key with its unit.
    pub fn json(&self, settings: &Settings, simulated: bool) -> Value {
        let fault = self.fault();
        let fault_of = |part: Part| fault.filter(|fault| Part::of(*fault) == part).map(told);
        let motor = |k: usize, part: Part| {
            let (words, [i_d, i_q]) = (&self.status.motors[k], self.currents(k));
            let plate = [&settings.screw, &settings.nut][k];
            json!({
                "fault": fault_of(part),
                "speed_rpm": self.rpm(k),
                "current_d_a": i_d,
                "current_q_a": i_q,
                "encoder_counts": words.encoder,
                "bus_v": f64::from(words.bus_mv) / 1e3,
                "limits": {
                    "speed_rpm": plate.speed_max_rpm,
                    "torque_nm": plate.torque_max_nm,
                    "rated_current_a_rms": plate.rated_current_a_rms,
                    "over_current_a": settings.bridge.over_current_a,
                },
            })
        };
        let frames = &self.status.frames;
        json!({
            "state": self.state_name(),
            "fault": fault.map(told),
            "misalignment": self.misalignment().map(|reason| json!({
                "name": reason.name(),
                "sentence": reason.sentence(),
            })),
            "tables": self.tables().map(|(name, fit)| json!({
                "table": name,
                "name": fit.name(),
                "sentence": fit.sentence(),
            })).collect::<Vec<Value>>(),
            "armed": self.status.armed,
            "simulated": simulated,
            "uptime_s": self.seconds(),
            "travel": self.travel().map_or("unknown", Travel::name),
            "screw": motor(0, Part::Screw),
            "nut": motor(1, Part::Nut),
            "table": {
                "fault": fault_of(Part::Table),
                "position_mm": self.position_mm(settings),
                "velocity_mm_s": self.velocity_mm_s(settings),
                "limits": {
                    "velocity_mm_s": settings.feed.velocity_max_mm_s,
                    "acceleration_mm_s2": settings.feed.acceleration_max_mm_s2,
                    "jerk_mm_s3": settings.feed.jerk_max_mm_s3,
                },
            },
            "link": {
                "frames": frames.frames,
                "damaged": frames.damaged,
                "too_long": frames.too_long,
                "other_version": frames.versions,
                "repeated": self.status.repeated,
                "refused": self.status.refused,
                "telemetry_dropped": self.status.dropped,
            },
        })
    }
}

fn told(fault: Fault) -> Value {
    json!({ "name": fault.name(), "sentence": fault.sentence() })
}

/// Prints what the drive is doing.
pub fn status(drive: &mut Drive, as_json: bool) -> Result<()> {
    let settings = drive.settings()?;
    let seen = Seen::of(drive.status()?);
    if as_json {
        println!("{:#}", seen.json(&settings, drive.simulated()));
        return Ok(());
    }
    println!("{}", seen.line(&settings));
    if let Some(fault) = seen.fault() {
        println!("Fault: {}", fault.sentence());
    }
    if let Some(reason) = seen.misalignment() {
        println!("Alignment: {}", reason.sentence());
    }
    for (name, fit) in seen.tables() {
        println!("Table of the {name}: {}. {}", fit.name(), fit.sentence());
    }
    let (screw, nut, feed) = (&settings.screw, &settings.nut, &settings.feed);
    println!(
        "Limits: screw {} rpm and {} N m, nut {} rpm and {} N m, table {} mm/s, {} mm/s^2 and {} mm/s^3",
        screw.speed_max_rpm,
        screw.torque_max_nm,
        nut.speed_max_rpm,
        nut.torque_max_nm,
        feed.velocity_max_mm_s,
        feed.acceleration_max_mm_s2,
        feed.jerk_max_mm_s3
    );
    Ok(())
}

/// Prints the fault that has stopped the drive, and the last ones.
pub fn faults(drive: &mut Drive, as_json: bool) -> Result<()> {
    let now = Seen::of(drive.status()?).fault();
    let last = drive.faults()?;
    if as_json {
        let last: Vec<Value> = last.iter().map(entry).collect();
        println!("{:#}", json!({ "fault": now.map(told), "last": last }));
        return Ok(());
    }
    match now {
        Some(fault) => println!("{}: {}", fault.name(), fault.sentence()),
        None => println!("no fault"),
    }
    for event in &last {
        let name = Fault::of_word(event.fault).map_or("unknown", Fault::name);
        println!("{:9.3} s  {name}", f64::from(event.uptime_ms) / 1e3);
    }
    Ok(())
}

fn entry(event: &Event) -> Value {
    json!({
        "uptime_s": f64::from(event.uptime_ms) / 1e3,
        "fault": Fault::of_word(event.fault).map(told),
    })
}

/// The drive's state and settings, for what goes on over a while.
pub fn look(drive: &mut Drive) -> Result<Seen> {
    Ok(Seen::of(drive.status().context("while it was looked at")?))
}
