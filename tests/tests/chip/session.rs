//! One session with every command, over the link: to the ELF on the emulated chip, and to the simulated drive. Both host the same
//! application, and answer the same.

use crate::link::{LINES, Session, run};
use anyhow::{Result, ensure};
use hal_sim::experiment::Setup;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use link::burst::{BurstRequest, Signal, Trigger};
use link::codes::{EventKind, State};
use link::host::client::{Client, Line};
use link::message::{Aligned, Command, Reply, Travel};
use link::scale;
use link::settings::{Setting, WireValue};
use link::telemetry::{Real, Request};
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;
use tests::bench::{board_config, machine_of, plate};
use tests::chip::wiring::Wiring;

/// A heartbeat each so many milliseconds.
const BEAT_MS: u32 = 100;

/// A command has so many milliseconds for its reply. The next one follows then: what replies take differs, and does not add up.
const TURN_MS: u32 = 20;

/// A command, and after how many milliseconds with a heartbeat it is asked.
type Asked = (u32, Command);

/// What is asked.
fn script() -> Vec<Asked> {
    [
        bursts_at_rest(),
        refused_motion(),
        while_it_runs(),
        settings_while_it_moves(),
        moves(),
        what_it_keeps(),
        torques(),
        set_points(),
    ]
    .concat()
}

fn number(name: &str) -> u16 {
    Setting::named(name).expect("a setting of that name").id
}

fn draft(name: &str, value: f64) -> Command {
    Command::Draft {
        id: number(name),
        value: WireValue::Real(Real::new(value)),
    }
}

fn way(distance_nm: i64, mm_s: f64, base: Option<i32>) -> Command {
    Command::Move {
        distance_nm,
        velocity: scale::word(mm_s * 1e-3, scale::TABLE_VELOCITY).unwrap(),
        base,
    }
}

fn to(position_nm: i64) -> Command {
    Command::MoveTo {
        position_nm,
        velocity: scale::word(5e-3, scale::TABLE_VELOCITY).unwrap(),
        base: Some(0),
    }
}

fn torque(motor: u8, amps: f64, rpm: f64) -> Command {
    let rad_s = rpm * std::f64::consts::TAU / 60.0;
    Command::Torque {
        motor,
        current: scale::word(amps, scale::CURRENT).unwrap(),
        speed: scale::word(rad_s, scale::BASE_SPEED).unwrap(),
        base: 0,
    }
}

fn stream(delay_ms: u16, homed: bool) -> Command {
    Command::Stream {
        delay_ms,
        homed,
        base: 0,
    }
}

fn point(ms: u32, position_nm: i64) -> Command {
    Command::SetPoint {
        at_us: ms * 1000,
        position_nm,
        velocity: None,
    }
}

fn burst(motor: u8, trigger: Trigger) -> Command {
    Command::Burst(BurstRequest {
        motor,
        trigger: trigger.word(),
        signal: Signal::PhaseA.word(),
        level: 0,
        before: 100,
        divider: 1,
    })
}

/// Bursts take no armed drive: one that waits and is ended, and one that is complete and read.
fn bursts_at_rest() -> Vec<Asked> {
    vec![
        (0, Command::Status),
        (0, Command::BurstSamples { from: 0 }),
        (0, burst(2, Trigger::Now)),
        (0, burst(1, Trigger::Fault)),
        (0, burst(0, Trigger::Now)),
        (0, Command::BurstStatus),
        (0, Command::BurstSamples { from: 0 }),
        (0, Command::EndBurst),
        (0, Command::BurstStatus),
        (0, burst(1, Trigger::Now)),
        (50, Command::BurstStatus),
        (0, Command::BurstSamples { from: 0 }),
        (0, Command::BurstSamples { from: 510 }),
        (0, Command::BurstSamples { from: 600 }),
    ]
}

/// The drive is armed, and refuses what it cannot do.
fn refused_motion() -> Vec<Asked> {
    // Faster than the screw, with the table's share, may turn.
    let too_fast = scale::word(310.0, scale::BASE_SPEED);
    vec![
        (0, run(2.5, 300.0)),
        (0, Command::Arm),
        (0, Command::Status),
        (0, run(1000.0, 300.0)),
        (0, run(0.0, 30_000.0)),
        (0, way(0, 5.0, Some(0))),
        (0, way(1_000_000, 5.0, Some(i32::MAX))),
        (0, way(-1_000_000, 100.0, too_fast)),
        (
            0,
            Command::DirectCurrent {
                motor: 0,
                current: 1 << 20,
            },
        ),
    ]
}

/// It runs: bursts, currents along d, and an angle meanwhile.
fn while_it_runs() -> Vec<Asked> {
    vec![
        (0, run(2.5, 300.0)),
        (0, burst(0, Trigger::State)),
        (700, Command::Status),
        (0, Command::BurstStatus),
        (0, burst(1, Trigger::Rises)),
        (100, Command::BurstStatus),
        (0, Command::BurstSamples { from: 300 }),
        (
            0,
            Command::DirectCurrent {
                motor: 0,
                current: 1 << 20,
            },
        ),
        (
            0,
            Command::DirectCurrent {
                motor: 2,
                current: 0,
            },
        ),
        (
            0,
            Command::DirectCurrent {
                motor: 1,
                current: i32::MAX,
            },
        ),
        (
            0,
            Command::Angle {
                motor: 0,
                behind: 1 << 20,
            },
        ),
    ]
}

fn settings_while_it_moves() -> Vec<Asked> {
    vec![
        // A gain changes while the table moves; another setting does not, and the flash is not written.
        (0, draft("tuning.speed_rad_s", 150.0)),
        (0, Command::Commit),
        (0, Command::Store),
        (200, Command::Status),
        (0, draft("rejection.disturbance_rad_s", 40.0)),
        (0, Command::Commit),
        (0, Command::Discard),
        // The old gain again: how exactly a motor comes to rest decides how it coasts.
        (0, draft("tuning.speed_rad_s", plate().tuning.speed_rad_s)),
        (0, Command::Commit),
        (
            0,
            Command::Record(
                Request {
                    divider: 50,
                    stream: 3,
                }
                .word(),
            ),
        ),
        (0, Command::Record(0)),
    ]
}

/// It stops, moves by a distance and to a place, and homes.
fn moves() -> Vec<Asked> {
    vec![
        (200, Command::Stop),
        (800, Command::Status),
        (0, run(2.5, 0.0)),
        (
            0,
            Command::Angle {
                motor: 0,
                behind: 1 << 20,
            },
        ),
        (
            0,
            Command::Angle {
                motor: 1,
                behind: i32::MIN,
            },
        ),
        (0, Command::Arm),
        (0, to(1_000_000)),
        (0, way(-500_000, 5.0, Some(0))),
        (100, Command::Status),
        (1400, Command::Status),
        (0, Command::Home { base: Some(0) }),
        (400, Command::Status),
        (0, Command::Stop),
        (800, Command::Status),
    ]
}

/// Faults, settings, what it has learned, and its journal.
fn what_it_keeps() -> Vec<Asked> {
    vec![
        (0, Command::Reset),
        (0, Command::Faults),
        (0, Command::Settings { from: 0 }),
        (0, Command::Learned { from: 0x0100 }),
        (0, draft("feed.lead_mm", 4.5)),
        (0, draft("feed.lead_mm", -1.0)),
        (
            0,
            Command::Draft {
                id: 0xFFFF,
                value: WireValue::Whole(0),
            },
        ),
        (0, Command::Discard),
        (0, draft("command.heartbeat_ms", 1e9)),
        (0, Command::Journal { after: 0 }),
    ]
}

fn torques() -> Vec<Asked> {
    vec![
        (0, torque(0, 0.2, 60.0)),
        (0, Command::Arm),
        (0, run(1.0, 200.0)),
        (100, Command::Status),
        (300, Command::Status),
        (0, torque(0, 500.0, 60.0)),
        (0, torque(2, 0.2, 60.0)),
        (0, torque(0, 0.2, 0.0)),
        (0, torque(0, 0.2, 2999.0)),
        (0, torque(0, 0.2, 60.0)),
        (100, Command::Status),
        (200, Command::Status),
        (0, torque(1, 0.2, 60.0)),
        (200, Command::Status),
        (0, Command::Stop),
        (800, Command::Status),
    ]
}

fn set_points() -> Vec<Asked> {
    vec![
        (0, point(0, 0)),
        (0, stream(200, false)),
        (0, Command::Arm),
        (0, stream(200, true)),
        (0, stream(4, false)),
        (0, stream(200, false)),
        (100, Command::Status),
        (0, point(0, 1_000_000)),
        (0, point(0, 0)),
        (0, point(25, 0)),
        (0, point(50, 10_000)),
        (0, point(50, 10_000)),
        (0, point(75, 9_000_000)),
        (0, point(75, 40_000)),
        (0, point(100, 90_000)),
        (0, point(125, 120_000)),
        (0, point(150, 120_000)),
        // The stream moves then. Where it rests, one count of the scale decides between holding and running.
        (70, Command::Status),
        (500, Command::Status),
        (0, point(175, 120_000)),
    ]
}

/// The reply without what a measurement or the time decides.
fn told(reply: &Reply) -> String {
    match reply {
        Reply::Status(status) => format!(
            "state {} fault {} armed {} travel {} homed {} settings {} {} aligned {:?}",
            status.state,
            status.fault,
            status.armed,
            status.travel,
            status.origin.is_some(),
            status.runs_on,
            status.unfit,
            status
                .motors
                .map(|motor| matches!(motor.alignment, Aligned::Forwards { .. })),
        ),
        Reply::Faults(events) => {
            let faults = events.iter().map(|event| (event.state, event.fault));
            format!("{:?}", faults.collect::<Vec<_>>())
        }
        Reply::Events(events) => {
            // What a start says is the reason of a reset, which differs.
            let start = EventKind::Start.word();
            let events = events.iter().filter(|event| event.kind != start);
            let events = events.map(|event| (event.kind, event.code));
            format!("{:?}", events.collect::<Vec<_>>())
        }
        Reply::Settings(values) => {
            let values = values.iter().map(|(id, value)| match value {
                // A model states SI units, which a conversion rounds.
                WireValue::Real(real) => format!("{id}: {:.12e}", real.get()),
                other => format!("{id}: {other:?}"),
            });
            values.collect::<Vec<_>>().join(" ")
        }
        Reply::Burst(status) => format!("burst {} of {:?}", status.state, status.request),
        Reply::BurstSamples(samples) => format!("{} samples", samples.len()),
        // How early it came and how far the table was behind are measured.
        Reply::Followed { .. } => "followed".to_owned(),
        other => format!("{other:?}"),
    }
}

/// A reply's text; of a status the table's scale, and whether the motors are driven.
type Told = (String, Option<(i32, bool)>);

/// The script's replies.
fn replies<L: Line>(client: &mut Client<L>) -> Result<Vec<Told>> {
    let mut replies = Vec::new();
    let (mut until, mut beat) = (client.now(), client.now());
    for (ms, command) in script() {
        until += Duration::from_millis((TURN_MS + ms).into());
        while client.now() < until {
            if client.now() >= beat {
                client.beat()?;
                beat += Duration::from_millis(BEAT_MS.into());
            }
            client.listen(Duration::from_millis(1))?;
        }
        let reply = client.ask(command)?;
        let scale = match &reply {
            Reply::Status(status) => {
                let driven =
                    State::of_words(status.state, status.fault).is_some_and(State::is_driven);
                Some((status.scale, driven))
            }
            _ => None,
        };
        replies.push((told(&reply), scale));
    }
    Ok(replies)
}

#[test]
fn the_elf_and_the_simulated_drive_answer_the_same() -> Result<()> {
    let mut model = Model::paper();
    model.feed.load_n = 0.0;
    let setup = Setup {
        model: machine_of(Wiring::Nucleo, &model, Coupling::Lumped),
        coupling: Coupling::Lumped,
        board: board_config(Wiring::Nucleo),
        tuning: plate().tuning,
        shipped: None,
        electronics: None,
    };
    let drive = SimulatedDrive::with_plate(&setup, &plate())?;
    let serving = Rc::new(RefCell::new(Serving::new(drive)));
    let mut simulated = Client::open(Within::open(&serving))?;
    while simulated.status()?.state != State::Ready.word() {
        ensure!(
            serving.borrow().ms() < 1000,
            "the simulated drive is not ready"
        );
    }
    let simulated = replies(&mut simulated)?;
    let mut session = Session::open(LINES[0].1)?;
    let emulated = replies(&mut session.client)?;
    let scale_count_m = tests::bench::scale_count_m(Wiring::Nucleo);
    let (mut differ, mut before, mut released, mut compared) = (Vec::new(), 0, false, 0);
    for (k, ((_, command), (chip, host))) in script()
        .iter()
        .zip(emulated.iter().zip(&simulated))
        .enumerate()
    {
        println!("{command:?}: {}", chip.0);
        if chip.0 != host.0 {
            differ.push(format!(
                "{k}, {command:?}:\n  chip {}\n  host {}",
                chip.0, host.0
            ));
        }
        // While it is driven the table goes as far, to what 3 ms make at 10 mm/s: a command's way to the drive, the drive's next
        // millisecond, and the reply's way. Released motors coast. This machine has no
        // friction, so the drive does not decide where they stop.
        // The end of a stream releases them too.
        let ended = format!("travel {} ", Travel::StreamEnded.word());
        released |= matches!(command, Command::Stop) || chip.0.contains(&ended);
        if let (Some((chip, driven)), Some((host, _))) = (chip.1, host.1) {
            let now = chip.wrapping_sub(host);
            let apart = f64::from(now.wrapping_sub(before)) * scale_count_m;
            if !released && apart.abs() > 30e-6 {
                differ.push(format!(
                    "{k}, {command:?}: the tables went {:.1} um apart",
                    apart * 1e6
                ));
            }
            compared += usize::from(!released);
            released &= !driven;
            before = now;
        }
    }
    ensure!(differ.is_empty(), "{}", differ.join("\n"));
    ensure!(compared > 5, "{compared} places of the table compared");
    for travel in [Travel::Done, Travel::Following, Travel::StreamEnded] {
        let word = format!("travel {} ", travel.word());
        ensure!(
            simulated.iter().any(|(reply, _)| reply.contains(&word)),
            "no status with {travel:?}: {simulated:?}"
        );
    }
    Ok(())
}
