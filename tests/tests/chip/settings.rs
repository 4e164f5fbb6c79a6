//! A drive that is set up over its link keeps its settings in the emulated chip's flash, and starts with them.

use crate::link::{LINES, Session};
use anyhow::{Context, Result, anyhow, ensure};
use hal_sim::flash::SimulatedFlash;
use link::codes::{EventKind, Origin, State};
use link::host::client::{Client, Line};
use link::message::{Command, Refusal};
use link::settings::store::{PAGES, Store};
use link::settings::{Setting, Settings, Value, WireValue};
use link::telemetry::Real;
use plant::machine::Coupling;
use plant::model::Model;
use std::time::Duration;
use tests::bench::{Bench, READY, firmware, plate_of};
use tests::chip::Reset;
use tests::chip::wiring::Wiring;
use tests::wire::Wires;

fn own() -> Settings {
    Wiring::Nucleo.kind().settings()
}

fn with(mut settings: Settings, values: &[(&str, f64)]) -> Result<Settings> {
    for (name, value) in values {
        let setting = Setting::named(name).ok_or_else(|| anyhow!("there is no {name}"))?;
        settings.set(setting.id, Value::Real(*value))?;
    }
    Ok(settings)
}

/// The chip's flash.
fn memory<T>(session: &Session, of: impl FnOnce(&mut SimulatedFlash) -> T) -> T {
    of(&mut session.bench.borrow_mut().emulator.chip().flash.memory)
}

/// The words of a journal's latest start and what it said of its settings.
fn started(session: &mut Session) -> Result<(u32, u32, i32)> {
    let journal = session.client.journal()?;
    let latest = |kind: EventKind| {
        let mut of_kind = journal.iter().filter(|event| event.kind == kind.word());
        of_kind.next().ok_or_else(|| anyhow!("no {}", kind.name()))
    };
    let (start, settings) = (latest(EventKind::Start)?, latest(EventKind::Settings)?);
    Ok((start.code, settings.code, settings.values[0]))
}

#[test]
fn a_setting_holds_after_the_restart_that_it_asks_for() -> Result<()> {
    for (line, make) in LINES {
        let mut session = Session::open(make)?;
        let status = session.client.status()?;
        ensure!(
            status.runs_on == Origin::Own.word(),
            "{line}: an erased flash gives {}",
            status.runs_on
        );
        let settings = with(
            own(),
            &[
                ("feed.velocity_max_mm_s", 4.0),
                ("screw.speed_max_rpm", 2400.0),
            ],
        )?;
        session.client.configure(&settings)?;
        ensure!(
            session.bench.borrow().emulator.resets == [Reset::Software],
            "{line}: resets {:?}",
            session.bench.borrow().emulator.resets
        );
        let status = session.until("ready", 0.5, |status| status.state == State::Ready.word())?;
        ensure!(status.runs_on == Origin::Stored.word(), "{line}");
        ensure!(session.client.settings()? == settings, "{line}");
        let (_, origin, _) = started(&mut session)?;
        ensure!(
            origin == Origin::Stored.word(),
            "{line}: the journal says {origin}"
        );

        session.client.tell(Command::Arm)?;
        ensure!(
            session.refused(crate::link::run(5.0, 300.0))? == Refusal::Velocity,
            "{line}"
        );
        session.client.tell(crate::link::run(3.0, 300.0))?;
        session.attend(0.1)?;
        session.client.tell(Command::Draft {
            id: Setting::named("feed.lead_mm").context("no lead")?.id,
            value: WireValue::Real(Real::new(4.0)),
        })?;
        ensure!(
            session.refused(Command::Commit)? == Refusal::Moving,
            "{line}"
        );
        let view = session.bench.borrow_mut().look().map_err(|e| anyhow!(e))?;
        let words = view.words();
        ensure!(
            words.motors.iter().all(|motor| motor.missed == 0) && words.speed_missed == 0,
            "{line}: deadlines missed"
        );
    }
    Ok(())
}

#[test]
fn what_does_not_fit_is_named_and_changes_nothing() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    for (name, value, said) in [
        (
            "nut.resistance_line_to_line_ohm",
            90.0,
            "current-loop gain Kpc",
        ),
        ("feed.scale_count_nm", 1e-3, "counts a turn"),
        ("screw.speed_max_rpm", 60_000.0, "largest speed"),
    ] {
        // Beside what fits.
        let wrong = with(own(), &[("tuning.damping", 0.8), (name, value)])?;
        let error = session.client.configure(&wrong).unwrap_err().to_string();
        ensure!(
            error.starts_with(&format!("{name} = {value} does not fit: ")) && error.contains(said),
            "{error:?}, expected {name} and {said:?}"
        );
    }
    let mut wrong = own();
    wrong.nut.encoder.interface = link::settings::EncoderInterface::Mt6835;
    wrong.nut.encoder.counts_per_turn = 1 << 21;
    let error = session.client.configure(&wrong).unwrap_err().to_string();
    ensure!(error == Refusal::Interface.sentence(), "{error}");
    ensure!(session.client.settings()? == own());
    let mut bench = session.bench.borrow_mut();
    ensure!(bench.emulator.resets.is_empty(), "it has started anew");
    ensure!(
        bench.emulator.chip().flash.memory.operations() == 0,
        "the flash was touched"
    );
    Ok(())
}

/// Without two banks an erase would hold the core up for longer than the watchdog waits.
#[test]
fn a_flash_that_does_not_take_them_is_said() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    let settings = with(own(), &[("tuning.damping", 0.8)])?;
    for spoil in [
        (|bench: &mut Bench| bench.emulator.chip().system.set_option_bytes(0xFAAF_FCAA))
            as fn(&mut Bench),
        |bench| {
            bench.emulator.chip().system.set_option_bytes(0xFAEF_FCAA);
            bench.emulator.chip().faults.worn.protected = true;
        },
    ] {
        spoil(&mut session.bench.borrow_mut());
        let error = session.client.configure(&settings).unwrap_err().to_string();
        ensure!(error == Refusal::NotStored.sentence(), "{error}");
    }
    ensure!(session.client.settings()? == own());
    ensure!(session.bench.borrow().emulator.resets.is_empty());
    Ok(())
}

/// Power is cut at each erase and each word of a save, and ECCR says another place of the word that lost power: each start comes to its
/// end, without a reset of its own.
#[test]
fn a_wrong_ecc_register_after_a_power_cut_is_no_reset_loop() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    session.bench.borrow_mut().emulator.chip().flash.wrong_ecc = true;
    let before = memory(&session, |memory| memory.operations());
    let mut held = with(own(), &[("feed.velocity_max_mm_s", 49.0)])?;
    session.client.configure(&held)?;
    let save = memory(&session, |memory| memory.operations()) - before;
    // One word in sixteen, and those at the ends. The long tier cuts at each.
    let all = std::env::var_os("EVERY_POWER_CUT").is_some();
    let chosen = |cut: &u32| all || cut.is_multiple_of(16) || *cut < 4 || *cut + 4 >= save;
    for cut in (0..save).filter(chosen) {
        let settings = with(held, &[("feed.velocity_max_mm_s", 50.0 + f64::from(cut))])?;
        memory(&session, |memory| memory.cut_after(cut));
        let resets = session.bench.borrow().emulator.resets.len();
        // The answer is lost with the power.
        let _ = session.client.configure(&settings);
        let line: Box<dyn Line> = Box::new(Wires::new(&session.bench));
        session.client = Client::open(line)?;
        held = session.client.settings()?;
        let resets = session.bench.borrow().emulator.resets[resets..].to_vec();
        let by_itself = resets.iter().filter(|reset| **reset != Reset::BrownOut);
        ensure!(by_itself.count() <= 1, "cut {cut}: {resets:?}");
        memory(&session, SimulatedFlash::power_up);
    }
    Ok(())
}

/// Power is cut at erases and words of a save, again and again; words with wrong bits raise the NMI when they are read.
#[test]
fn a_power_cut_while_they_are_stored_leaves_the_old_ones_or_the_new() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    let mut held = own();
    let (mut kept, mut taken) = (0, 0);
    let before = memory(&session, |memory| memory.operations());
    let changed = with(held, &[("feed.velocity_max_mm_s", 49.0)])?;
    session.client.configure(&changed)?;
    held = changed;
    let save = memory(&session, |memory| memory.operations()) - before;
    // Erases, the first words, some between, and the last ones.
    let cuts = [0, 1, 2, 3, 4, save / 4, save / 2, 3 * save / 4];
    let cuts = cuts.into_iter().chain((save - 4..save + 2).rev());
    for (k, cut) in (0..).zip(cuts) {
        let settings = with(held, &[("feed.velocity_max_mm_s", 50.0 + f64::from(k))])?;
        memory(&session, |memory| memory.cut_after(cut));
        // The answer is lost with the power.
        let _ = session.client.configure(&settings);
        let line: Box<dyn Line> = Box::new(Wires::new(&session.bench));
        session.client = Client::open(line)?;
        let found = session.client.settings()?;
        let status = session.client.status()?;
        if found == settings {
            taken += 1;
        } else {
            ensure!(
                found == held,
                "cut {cut}: other settings than were ever set"
            );
            kept += 1;
        }
        let origin = if found == own() {
            Origin::Own
        } else {
            Origin::Stored
        };
        ensure!(
            status.runs_on == origin.word(),
            "cut {cut}: {}",
            status.runs_on
        );
        held = found;
        memory(&session, SimulatedFlash::power_up);
    }
    let resets = session.bench.borrow().emulator.resets.clone();
    ensure!(
        !resets.contains(&Reset::Watchdog) && kept > 3 && taken > 0,
        "{kept} times the old ones, {taken} times the new; resets {resets:?}"
    );
    Ok(())
}

/// What a store holds that the board does not bear, from another board or firmware.
#[test]
fn stored_settings_that_do_not_fit_leave_the_drive_its_own_and_are_named() -> Result<()> {
    let wrong = with(own(), &[("nut.resistance_line_to_line_ohm", 90.0)])?;
    let mut model = Model::paper();
    model.feed.load_n = 0.0;
    let mut bench = Bench::new(&model, Coupling::Lumped).map_err(|e| anyhow!(e))?;
    bench.attended = false;
    bench.emulator.chip().flash.memory = stored(&wrong);
    bench.wait_for(READY, 0.2).map_err(|e| anyhow!(e))?;
    let log = bench.log().map_err(|e| anyhow!(e))?.join("\n");
    let mut session = Session::of(bench, LINES[0].1)?;
    let status = session.client.status()?;
    ensure!(status.runs_on == Origin::Unfit.word(), "{}", status.runs_on);
    let setting = Setting::numbered(status.unfit);
    let name = setting.map(|setting| setting.to_string());
    ensure!(
        name.as_deref() == Some("nut.resistance_line_to_line_ohm"),
        "{name:?}"
    );
    ensure!(session.client.settings()? == own());
    let (_, origin, unfit) = started(&mut session)?;
    ensure!((origin, unfit) == (Origin::Unfit.word(), status.unfit.into()));
    ensure!(
        log.contains("do not fit") && log.contains("0x0201"),
        "{log}"
    );
    Ok(())
}

/// A flash whose store holds these.
pub fn stored(settings: &Settings) -> SimulatedFlash {
    let mut store = Store::open(SimulatedFlash::new(PAGES, 0));
    store.save(settings).expect("an erased flash");
    // The bring-up's pages follow.
    let mut bytes = store.release().bytes().to_vec();
    bytes.resize(tests::chip::flash::SIZE, 0xFF);
    SimulatedFlash::of_bytes(&bytes)
}

/// How much later a drive that computes its configuration is there than one that has it from its build.
#[test]
fn a_start_with_stored_settings_takes_little_longer() -> Result<()> {
    let mut begins = Vec::new();
    let changed = with(
        own(),
        &[
            ("rejection.notch_hz", 400.0),
            ("compensation.learning_s", 1.0),
        ],
    )?;
    for settings in [None, Some(own()), Some(changed)] {
        let elf = firmware().map_err(|e| anyhow!(e))?;
        let mut bench = Bench::with(&elf, Wiring::Nucleo, &Model::paper(), Coupling::Lumped)
            .map_err(|e| anyhow!(e))?;
        if let Some(settings) = settings {
            bench.emulator.chip().flash.memory = stored(&settings);
        }
        let there = |bench: &mut Bench| {
            Ok(bench
                .look()
                .is_ok_and(|view| view.words().motors[0].steps > 0))
        };
        let begin = bench
            .until("the first period", 1.0, 20e-6, there)
            .map_err(|e| anyhow!(e))?;
        begins.push(begin * 1e3);
    }
    println!(
        "from reset to the first period, ms: own {:.2}, stored {:.2}, with compensation {:.2}",
        begins[0], begins[1], begins[2]
    );
    ensure!(begins[2] - begins[0] < 500.0, "{begins:?} ms");
    Ok(())
}

/// What a drive has learned is read over its link, order by order, and holds after the restart.
#[test]
fn what_is_learned_can_be_kept() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    let learning = with(own(), &[("compensation.learning_s", 0.1)])?;
    session.client.configure(&learning)?;
    session.until("ready", 0.5, |status| status.state == State::Ready.word())?;
    session.client.tell(Command::Arm)?;
    session.client.tell(crate::link::run(5.0, 300.0))?;
    // Until all lines are tuned, have learned and were shown.
    session.attend(1.5)?;
    session.client.tell(Command::Stop)?;
    session.until("ready", 1.0, |status| status.state == State::Ready.word())?;
    session.attend(0.4)?;
    let learned = session.client.learned()?;
    let of = |name: &str| {
        let setting = Setting::named(name).ok_or_else(|| anyhow!("there is no {name}"))?;
        learned.get(setting.id).ok_or_else(|| anyhow!("{name}"))
    };
    let Value::Real(part) = of("screw_torque.re_1_a")? else {
        return Err(anyhow!("no number"));
    };
    ensure!(
        part != 0.0 && part.abs() < 1.0,
        "screw_torque.re_1_a is {}",
        part
    );
    session.client.configure(&learned)?;
    ensure!(session.client.settings()? == learned);
    Ok(())
}

/// Longest from the command to its reply, after which each step of the speed task has the new gain.
const GAIN_HOLDS: Duration = Duration::from_millis(10);

/// The words that the speed task works on have the proportional gains of these settings.
fn runs_with(session: &Session, settings: &Settings) -> Result<bool> {
    /// From its begin to where the gains are, bytes.
    const SEARCHED: u32 = 7000;
    let plate = settings.plate(&plate_of(Wiring::Nucleo).board);
    let loops = plate
        .config()
        .map_err(|misfit| anyhow!(misfit))?
        .speed_loops;
    let bench = session.bench.borrow();
    let held = bench.image.demangled("firmware::config::HELD");
    let held = held.map_err(|e| anyhow!(e))?;
    let bytes = bench.emulator.bytes(held, SEARCHED as usize);
    let bytes = bytes.map_err(|e| anyhow!(e))?;
    let has = |gain: i32| bytes.chunks(4).any(|word| word == gain.to_le_bytes());
    Ok(loops.iter().all(|one| has(one.k_pw.to_bits())))
}

#[test]
fn a_gain_holds_within_10_ms_while_the_motors_turn() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    session.client.tell(Command::Arm)?;
    session.client.tell(crate::link::run(3.0, 300.0))?;
    session.attend(0.5)?;
    let gain = Setting::named("tuning.speed_rad_s").context("no gain")?;
    session.client.tell(Command::Draft {
        id: gain.id,
        value: WireValue::Real(Real::new(150.0)),
    })?;
    let (old, new) = (own(), with(own(), &[("tuning.speed_rad_s", 150.0)])?);
    ensure!(runs_with(&session, &old)? && !runs_with(&session, &new)?);
    let asked = session.client.now();
    session.client.tell(Command::Commit)?;
    let took = session.client.now() - asked;
    ensure!(runs_with(&session, &new)? && !runs_with(&session, &old)?);
    println!("the gain holds after {took:?}");
    ensure!(took < GAIN_HOLDS, "the gain holds after {took:?}");
    session.attend(0.5)?;
    let view = session.bench.borrow_mut().look().map_err(|e| anyhow!(e))?;
    let words = view.words();
    ensure!(
        words.motors.iter().all(|motor| motor.missed == 0) && words.speed_missed == 0,
        "deadlines missed"
    );
    ensure!(session.client.status()?.state == State::Running.word());
    Ok(())
}

/// How the table is homed and the table of base speeds hold at once: the chip is not reset, and the flash has them.
#[test]
fn a_setting_that_only_commands_read_holds_without_a_restart() -> Result<()> {
    let mut session = Session::open(LINES[0].1)?;
    let asked = [
        ("base.table_1_mm_s", 5.0),
        ("travel.home_velocity_mm_s", 20.0),
    ];
    let settings = with(own(), &asked)?;
    session.client.configure(&settings)?;
    ensure!(session.client.settings()? == settings);
    let mut bench = session.bench.borrow_mut();
    ensure!(bench.emulator.resets.is_empty(), "it has started anew");
    ensure!(
        bench.emulator.chip().flash.memory.operations() > 0,
        "the flash was not written"
    );
    Ok(())
}
