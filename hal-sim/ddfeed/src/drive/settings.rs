//! `drive settings`.

use super::connect::Drive;
use super::options::{ReferenceOptions, Restart, SettingsTask};
use crate::output::put_new;
use crate::record::model_file;
use anyhow::{Context, Result, bail, ensure};
use link::codes::State;
use link::host::refused::Lost;
use link::host::settings::{of_toml, of_words, to_toml};
use link::host::status::StatusReport;
use link::message::Command;
use link::settings::datasheet::spellings;
use link::settings::{Effect, EncoderInterface, MotorSettings, Setting, Settings, Value};
use link::telemetry::{Frame, Header, Request};
use serde_json::{Map, json};
use std::collections::HashMap;
use std::fs;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;

/// Does it.
pub fn run(drive: &mut Drive, what: &SettingsTask) -> Result<()> {
    let settings = drive.settings()?;
    match what {
        SettingsTask::Get { names, json } => get(&settings, names, *json),
        SettingsTask::Set {
            settings: words,
            restart,
        } => {
            let (mut new, mut said) = (settings, HashMap::new());
            for word in words {
                let (name, value) = word
                    .split_once('=')
                    .with_context(|| format!("`{word}` is no NAME=VALUE, as in feed.lead_mm=10"))?;
                let (setting, value) = of_words(name.trim(), value.trim())?;
                if let Some(before) = said.insert(setting.id, name) {
                    bail!("{before} and {name} set the same: leave one out");
                }
                new.set(setting.id, value)?;
            }
            announce_restart(drive, &settings, &new, *restart)?;
            let effect = drive.change(&new)?;
            tell(&settings, &new);
            if effect != Effect::Restart && new != settings {
                println!("not stored: `settings store` keeps it over a restart");
            }
            Ok(())
        }
        SettingsTask::Store => {
            drive.store()?;
            println!("stored");
            Ok(())
        }
        SettingsTask::Export { file } => {
            put_new(file, &to_toml(&settings))?;
            println!("{}", file.display());
            Ok(())
        }
        SettingsTask::Import { file, restart } => {
            let new = read(&settings, file)?;
            configure(drive, &settings, &new, *restart)
        }
        SettingsTask::Learned { save, restart } => {
            let learned = drive.learned()?;
            if *save {
                configure(drive, &settings, &learned, *restart)
            } else {
                tell(&settings, &learned);
                Ok(())
            }
        }
        SettingsTask::Diff { file } => {
            tell(&settings, &read(&settings, file)?);
            Ok(())
        }
        SettingsTask::Model { file } => {
            let header = header(drive)?;
            let interval_s = 1.0 / drive.speed_hz();
            let bus_v = StatusReport::of(drive.status()?).bus_v();
            put_new(file, &model_file(&header, interval_s, bus_v))?;
            println!("{}", file.display());
            Ok(())
        }
    }
}

/// Prints all settings that there are, without a drive.
pub fn reference(options: &ReferenceOptions) {
    if options.template {
        print!("{}", to_toml(&Settings::DEFAULT));
    } else {
        print!("{}", link::host::reference::page());
    }
}

fn get(settings: &Settings, names: &[String], as_json: bool) -> Result<()> {
    let begins = |full: &str, name: &String| full.starts_with(name.as_str());
    let some: Vec<Setting> = Settings::all()
        .filter(|setting| {
            let full = setting.to_string();
            names.is_empty() || names.iter().any(|name| begins(&full, name))
        })
        .collect();
    // A datasheet's other names only where no setting has that name.
    let others = names
        .iter()
        .filter(|name| !some.iter().any(|it| begins(&it.to_string(), name)));
    let spelled: Vec<_> = others
        .flat_map(|name| spellings().filter(move |(full, ..)| begins(full, name)))
        .filter_map(|(name, setting, factor)| match settings.get(setting.id)? {
            Value::Real(value) => Some((name, setting, value / factor)),
            Value::Whole(_) | Value::Choice(_) => None,
        })
        .collect();
    ensure!(
        !some.is_empty() || !spelled.is_empty(),
        "there is no setting whose name begins with {}: `settings get` prints all",
        names.join(" or ")
    );
    let mut object = Map::new();
    for setting in some {
        let Some(value) = settings.get(setting.id) else {
            continue;
        };
        let shown = value.shown(setting);
        if as_json {
            object.insert(
                setting.to_string(),
                match value {
                    Value::Real(x) => json!(x),
                    Value::Whole(x) => json!(x),
                    Value::Choice(_) => json!(shown.to_string()),
                },
            );
        } else {
            let unit = setting.unit();
            let space = if unit.is_empty() { "" } else { " " };
            println!("{setting} = {shown}{space}{unit}");
            println!("    {} ({} possible)", setting.doc(), setting.possible());
        }
    }
    for (name, setting, value) in spelled {
        if as_json {
            object.insert(name, json!(value));
        } else {
            println!("{name} = {value}");
            println!("    A datasheet's other name for {setting}.");
        }
    }
    if as_json {
        println!("{:#}", serde_json::Value::Object(object));
    }
    Ok(())
}

/// Sets and stores what differs, and reports it.
fn configure(
    drive: &mut Drive,
    before: &Settings,
    after: &Settings,
    restart: Restart,
) -> Result<()> {
    announce_restart(drive, before, after, restart)?;
    drive.configure(after)?;
    tell(before, after);
    Ok(())
}

/// Says which of the changes restart the drive and what is lost then, and asks whether it may.
pub fn announce_restart(
    drive: &mut Drive,
    before: &Settings,
    after: &Settings,
    restart: Restart,
) -> Result<()> {
    let names: Vec<String> = before
        .changes_that_restart(after)
        .map(|setting| setting.to_string())
        .collect();
    let Some((first, more)) = names.split_first() else {
        return Ok(());
    };
    let more = match more {
        [] => String::new(),
        more => format!(" and {} more", more.len()),
    };
    let lost = lost_by_restart(drive, before)?;
    eprintln!(
        "{first}{more}: takes effect when the drive restarts. Lost with the restart: {}.",
        if lost.is_empty() {
            "nothing".to_owned()
        } else {
            lost.join(", ")
        }
    );
    if lost.is_empty() || restart.yes {
        return Ok(());
    }
    ensure!(
        std::io::stdin().is_terminal(),
        "nothing was set: give --yes, and the drive restarts without a question"
    );
    eprint!("Restart the drive? [y/N] ");
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    ensure!(
        answer.trim().eq_ignore_ascii_case("y"),
        "nothing was set: the drive may not restart"
    );
    Ok(())
}

/// What a restart takes from a drive that runs on these settings.
fn lost_by_restart(drive: &mut Drive, settings: &Settings) -> Result<Vec<String>> {
    let status = drive.status()?;
    let mut lost = Vec::new();
    if status.origin.is_some() {
        lost.push("the homed position".to_owned());
        if settings.soft_limits_mm().is_some() {
            lost.push("the soft limits until the table is homed again".to_owned());
        }
    }
    let motors = [&settings.screw, &settings.nut];
    let counted = |motor: &&MotorSettings| motor.encoder.interface != EncoderInterface::Mt6835;
    if status.state != State::Unaligned.word() && motors.iter().any(counted) {
        lost.push("the alignment of rotors with incremental encoders".to_owned());
    }
    if has_learned(settings, &drive.learned()?) {
        lost.push("the orders that were learned and not saved".to_owned());
    }
    Ok(lost)
}

/// Whether a drive has learned sizes that are not set. An order that it begins with has none.
fn has_learned(settings: &Settings, learned: &Settings) -> bool {
    let order = |setting: Setting| setting.to_string().contains(".order_");
    settings
        .differences(learned)
        .any(|(setting, ..)| !order(setting))
}

fn tell(before: &Settings, after: &Settings) {
    let mut none = true;
    for (setting, ours, theirs) in before.differences(after) {
        none = false;
        println!(
            "{setting}: {} -> {}",
            ours.shown(setting),
            theirs.shown(setting)
        );
    }
    if none {
        println!("nothing differs");
    }
}

fn read(settings: &Settings, file: &Path) -> Result<Settings> {
    let text =
        fs::read_to_string(file).with_context(|| format!("{} cannot be read", file.display()))?;
    of_toml(settings, &text).with_context(|| format!("{} is not taken", file.display()))
}

/// What the drive says of itself before a stream, of none.
pub fn header(drive: &mut Drive) -> Result<Header> {
    let request = Request {
        divider: 0,
        stream: 1,
    };
    drive.tell(Command::Record(request.word()))?;
    let until = drive.now() + Duration::from_secs(2);
    while drive.now() < until {
        // Samples of an earlier stream may stand before it.
        while let Some(frame) = drive.take_telemetry() {
            if let Frame::Header(header) = frame
                && header.request == request.word()
            {
                return Ok(header);
            }
        }
        drive.listen(Duration::from_millis(50))?;
    }
    bail!(Lost("the drive does not say what it is set to".to_owned()))
}
