//! What moves a drive. It is commanded as long as the command runs, and comes to rest with it.

use super::connect::Drive;
use super::options::{HomeOptions, InjectOptions, JogOptions, LeadOptions, Motor, MoveOptions};
use super::status::look;
use crate::interrupt::ctrl_c;
use anyhow::{Context, Result, bail, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use link::codes::{Fault, Misalignment, State};
use link::host::command::{SpeedNames, speeds};
use link::host::refused::Refused;
use link::host::status::StatusReport;
use link::message::{Command, Injected, Injection, Travel};
use link::settings::Settings;
use link::telemetry::Real;
use serde_json::json;
use std::f64::consts::TAU;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Interval of the heartbeats to a drive that moves: often enough for the usual half second of a simulated one
/// that is ten times as fast as real time.
pub const BEAT: Duration = Duration::from_millis(20);
/// How often it is looked at.
const LOOK: Duration = Duration::from_millis(200);
/// How long it may take to come to rest.
const REST: Duration = Duration::from_secs(30);

/// A fault has stopped the drive; the reason of a misalignment, if it is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopped(pub Fault, pub Option<Misalignment>);

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(fault, misalignment) = self;
        let sentence = misalignment.map_or(fault.sentence(), Misalignment::sentence);
        write!(
            f,
            "the drive was stopped by a fault: {}. {sentence}",
            fault.name()
        )
    }
}

impl std::error::Error for Stopped {}

/// Arms the drive.
pub fn arm(drive: &mut Drive) -> Result<()> {
    let stop = caught()?;
    ready(drive, &stop)?;
    println!("armed");
    Ok(())
}

/// Arms a drive, and aligns it first where it does not know its rotor angles. What will move is printed before.
pub fn ready(drive: &mut Drive, stop: &AtomicBool) -> Result<()> {
    if look(drive)?.state == Some(State::Unaligned) {
        println!("{}", alignment_notice(&drive.settings()?));
    }
    match drive.arm(|_| !stop.load(Relaxed))? {
        State::Fault(fault) => {
            bail!(Stopped(fault, look(drive)?.misalignment()))
        }
        State::Unaligned => {
            bail!("the alignment was interrupted: the drive is unaligned, and its bridges are open")
        }
        _ => Ok(()),
    }
}

/// What an alignment will move: how fast, how far and for how long.
fn alignment_notice(settings: &Settings) -> String {
    let Settings {
        alignment,
        screw,
        nut,
        ..
    } = settings;
    format!(
        "The drive does not know its rotor angles and aligns its motors now:\n  \
         each motor moves by itself by up to {:.1} degrees; both swing together by 30 electrical degrees;\n  \
         then both turn together at up to {} rpm, once each way;\n  \
         torque at most {} N m (screw) and {} N m (nut); the table moves by at most {} um;\n  \
         it takes 3 to 8 s, at most {} s. Ctrl-C, the enable switch or `drive stop` interrupt it.",
        alignment.travel_um * 1e-3 / settings.feed.lead_mm * 360.0,
        alignment.speed_rpm,
        screw.alignment_torque_nm,
        nut.alignment_torque_nm,
        alignment.travel_um,
        control::alignment::LONGEST_S,
    )
}

/// Brings it to rest.
pub fn stop(drive: &mut Drive) -> Result<()> {
    rest(drive)?;
    println!("at rest");
    Ok(())
}

/// Leaves a fault.
pub fn reset(drive: &mut Drive) -> Result<()> {
    drive.tell(Command::Reset)?;
    let until = drive.now() + REST;
    // It measures its current zeros.
    let begun = drive.now();
    loop {
        match look(drive)?.state {
            Some(State::Ready) => {
                println!("ready");
                return Ok(());
            }
            Some(State::Unaligned) => {
                println!("unaligned: `arm` aligns the motors");
                return Ok(());
            }
            Some(State::Fault(fault)) if drive.now() - begun > LOOK => bail!(Stopped(fault, None)),
            _ if drive.now() > until => bail!("the drive does not become ready again"),
            _ => drive.listen(BEAT)?,
        }
    }
}

/// Sends a command to a drive that moved. Where it refuses because a fault has stopped it meanwhile, the fault is the error.
pub fn tell_on(drive: &mut Drive, command: Command) -> Result<()> {
    let told = drive.tell(command);
    if told.as_ref().is_err_and(|error| error.is::<Refused>()) {
        let seen = look(drive)?;
        if let Some(State::Fault(fault)) = seen.state {
            bail!(Stopped(fault, seen.misalignment()));
        }
    }
    told
}

/// The nut speed that a motion is asked with, rad/s.
pub fn base(lead: &LeadOptions) -> Option<f64> {
    lead.nut_rpm.map(|rpm| rpm * TAU / 60.0)
}

/// Runs until Ctrl-C or as long as asked.
pub fn jog(drive: &mut Drive, options: &JogOptions) -> Result<()> {
    let settings = drive.settings()?;
    let command = run_at(options.table_speed * 1e-3, base(&options.lead))?;
    let stop = caught()?;
    if options.lead.arm {
        ready(drive, &stop)?;
    }
    drive.tell(command)?;
    let longest = options.duration.map(Duration::from_secs_f64);
    led(drive, &settings, &stop, |_, elapsed| {
        Ok(longest.is_some_and(|longest| elapsed >= longest))
    })?;
    println!("at rest");
    Ok(())
}

/// Moves the table by a distance, or to a homed position.
pub fn travel(drive: &mut Drive, options: &MoveOptions) -> Result<()> {
    let settings = drive.settings()?;
    let (velocity, base) = speeds(options.table_speed * 1e-3, base(&options.lead), &NAMES)?;
    let stop = caught()?;
    let seen = look(drive)?;
    // Positions of a move by a distance count from where the table stands.
    let zero_mm = match options.to {
        Some(_) => 0.0,
        None => seen.position_mm(&settings),
    };
    let asked_mm = options.to.or(options.distance).unwrap_or_default();
    let left_mm = zero_mm + asked_mm - seen.position_mm(&settings);
    if seen.homed() && left_mm.abs() < settings.feed.scale_count_nm * 1e-6 {
        println!("the table stands at {asked_mm:.4} mm already");
        return Ok(());
    }
    if options.lead.arm {
        ready(drive, &stop)?;
    }
    #[allow(clippy::cast_possible_truncation)]
    let asked_nm = (asked_mm * 1e6).round() as i64;
    drive.tell(match options.to {
        Some(_) => Command::MoveTo {
            position_nm: asked_nm,
            velocity,
            base,
        },
        None => Command::Move {
            distance_nm: asked_nm,
            velocity,
            base,
        },
    })?;
    let mut ended = None;
    led(drive, &settings, &stop, |seen, _| {
        let travel = seen.travel();
        let over = matches!(
            travel,
            Some(Travel::Done | Travel::NotSettled | Travel::Ended)
        );
        if over {
            ended = travel.map(|travel| (travel, seen.position_mm(&settings) - zero_mm));
        }
        Ok(over)
    })?;
    let at_mm = look(drive)?.position_mm(&settings) - zero_mm;
    let [done, left] = match options.to {
        Some(_) => ["at", "the table is at"],
        None => ["moved", "the table moved by"],
    };
    match ended {
        Some((Travel::Done, in_place_mm)) => {
            if options.json {
                let name = match options.to {
                    Some(_) => "position_mm",
                    None => "moved_mm",
                };
                let result =
                    json!({ name: in_place_mm, "asked_mm": asked_mm, "at_rest_mm": at_mm });
                println!("{result:#}");
            } else {
                println!(
                    "{done} {in_place_mm:.4} mm, {:+.1} um from where it was asked; at rest",
                    (in_place_mm - asked_mm) * 1e3
                );
            }
            Ok(())
        }
        Some((travel, _)) => bail!(
            "{left} {at_mm:.4} mm of {asked_mm} mm: {}",
            travel.sentence()
        ),
        None => bail!("ended on its way: {left} {at_mm:.4} mm of {asked_mm} mm, and is at rest"),
    }
}

/// Finds the table's place.
pub fn home(drive: &mut Drive, options: &HomeOptions) -> Result<()> {
    let settings = drive.settings()?;
    let (_, base) = speeds(0.0, base(&options.lead), &NAMES)?;
    let stop = caught()?;
    if options.lead.arm {
        ready(drive, &stop)?;
    }
    drive.tell(Command::Home { base })?;
    let mut ended = None;
    led(drive, &settings, &stop, |seen, _| {
        ended = seen.travel().filter(|travel| *travel != Travel::Homing);
        Ok(ended.is_some())
    })?;
    match ended {
        Some(Travel::Homed) => {
            let position_mm = look(drive)?.position_mm(&settings);
            if options.json {
                println!("{:#}", json!({ "homed": true, "position_mm": position_mm }));
            } else {
                println!("homed; the table is at {position_mm:.4} mm, at rest");
            }
            Ok(())
        }
        Some(travel) => bail!("not homed: {}", travel.sentence()),
        None => bail!("not homed: ended on its way, and at rest"),
    }
}

/// Puts a fault into a simulated drive.
pub fn inject(drive: &mut Drive, options: &InjectOptions) -> Result<()> {
    let known = |fault: &&Injected| fault.name() == options.fault;
    let Some(fault) = Injected::ALL.iter().find(known) else {
        let list: Vec<String> = Injected::ALL
            .iter()
            .map(|fault| format!("  {}{}: {}", fault.name(), amount(*fault), fault.sentence()))
            .collect();
        if options.fault == "list" {
            println!("{}", list.join("\n"));
            return Ok(());
        }
        bail!(
            "there is no fault `{}`:\n{}",
            options.fault,
            list.join("\n")
        );
    };
    let asked = match (fault.unit(), options.amount) {
        (Some(_), None) => bail!("{} needs an --amount:{}", fault.name(), amount(*fault)),
        (None, Some(_)) => bail!("{} has no amount", fault.name()),
        (_, asked) => asked.unwrap_or(0.0),
    };
    if let Some([least, most]) = fault.range() {
        ensure!(
            (least..=most).contains(&asked),
            "--amount is {asked}, but {} has{}",
            fault.name(),
            amount(*fault)
        );
    }
    drive.tell(Command::Inject(Injection {
        fault: fault.word(),
        motor: u8::from(options.motor == Motor::Nut),
        amount: Real::new(asked),
    }))?;
    println!("{}", fault.sentence());
    Ok(())
}

/// The amounts that a fault may have, after a space; nothing where it has none.
fn amount(fault: Injected) -> String {
    match (fault.range(), fault.unit()) {
        (Some([least, most]), Some(unit)) => format!(" {least} to {most} {unit}"),
        _ => String::new(),
    }
}

/// Ctrl-C, which brings the drive to rest.
pub fn caught() -> Result<Arc<AtomicBool>> {
    ctrl_c().context("Ctrl-C cannot be caught, and is what stops the drive")
}

/// How the command line names the speeds.
const NAMES: SpeedNames = SpeedNames {
    velocity: "--table-speed",
    base: "--nut-rpm",
};

/// The command for a table velocity, m/s, and a base speed, rad/s; none: that of the drive's table.
pub fn run_at(velocity: f64, base: Option<f64>) -> Result<Command> {
    let (velocity, base) = speeds(velocity, base, &NAMES)?;
    Ok(Command::Run { velocity, base })
}

/// Goes on commanding a drive that runs until `over` reports it or Ctrl-C; then it comes to rest, whatever has happened.
pub fn led(
    drive: &mut Drive,
    settings: &Settings,
    stop: &AtomicBool,
    mut over: impl FnMut(&StatusReport, Duration) -> Result<bool>,
) -> Result<()> {
    let bar =
        ProgressBar::new_spinner().with_style(ProgressStyle::with_template("{spinner} {msg}")?);
    let begun = drive.now();
    let mut looked = None;
    let led = (|| {
        while !stop.load(Relaxed) {
            drive.beat()?;
            if looked.is_none_or(|at: Instant| drive.now() - at >= LOOK) {
                looked = Some(drive.now());
                let seen = look(drive)?;
                bar.set_message(seen.line(settings));
                bar.tick();
                if let Some(State::Fault(fault)) = seen.state {
                    bail!(Stopped(fault, None));
                }
                if over(&seen, drive.now() - begun)? {
                    break;
                }
            }
            drive.listen(BEAT)?;
        }
        Ok(())
    })();
    bar.set_message("coming to rest");
    let rested = rest(drive);
    bar.finish_and_clear();
    // The first that failed is the cause.
    led.and(rested)
}

/// Speed of a shaft above which it is not at rest, rpm.
const COASTS_RPM: f64 = 1.0;

/// Asks it to rest, and waits for that.
pub fn rest(drive: &mut Drive) -> Result<()> {
    drive.tell(Command::Stop)?;
    let until = drive.now() + REST;
    loop {
        let seen = look(drive)?;
        let is_on = seen.state.is_some_and(State::has_bridges_on);
        // Bridges open once both references are at rest. The shafts may coast on for a moment.
        let coasts = [0, 1].map(|motor| seen.rpm(motor).abs() > COASTS_RPM);
        match seen.state {
            Some(State::Fault(fault)) => bail!(Stopped(fault, None)),
            _ if (is_on || coasts.contains(&true)) && drive.now() < until => drive.listen(BEAT)?,
            _ if is_on => bail!("the drive does not come to rest: open its enable contact"),
            _ => return Ok(()),
        }
    }
}
