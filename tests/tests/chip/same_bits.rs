//! The emulated firmware and the control code on the host are the same drive, bit for bit.

use control::compensation::line::Phasor;
use control::compensation::{ANGLES, LINES, TORQUES};
use control::plate::DrivePlate;
use hal_sim::drive::Drive;
use link::codes::{Demand, State};
use link::settings::Settings;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use std::path::Path;
use tests::bench::{Bench, board_config, firmware_of, machine_of, plate_of, smooth_firmware};
use tests::chip::wiring::Wiring;
use tests::chip::{CORE_HZ, Top};
use tests::same::{assert_period, by_motor};

/// Commands, and when they are sent, s after the first period.
const SCRIPT: [(f64, Demand, f64, f64); 4] = [
    (0.055, Demand::Run, 2.5e-3, 300.0),
    (0.7, Demand::Run, -2.5e-3, 500.0),
    (1.2, Demand::Run, 2.5e-3, 0.0),
    (1.5, Demand::Rest, 2.5e-3, 0.0),
];

/// What a step of the speed task took: a command, or a demand.
#[derive(Clone, Copy, Debug)]
enum Taken {
    Speeds(f64, f64),
    Demand(Demand),
}
const END: f64 = 1.7;

/// Tops of both timers, and before which period of the screw the speed task took what.
type Traced = (Vec<Top>, Vec<(u64, Taken)>);

/// Runs the script in the emulator: every top of both timers, and before which period of the screw the speed task took what.
fn emulated(
    elf: &Path,
    board: Wiring,
    model: &Model,
    coupling: Coupling,
    stored: Option<&Settings>,
) -> Result<Traced, String> {
    let mut bench = Bench::with(elf, board, model, coupling)?;
    if let Some(settings) = stored {
        bench.emulator.chip().flash.memory = crate::settings::stored(settings);
    }
    bench.emulator.chip().tops = Some(Vec::new());
    bench.until("the first period", 0.5, 100e-6, |bench| {
        Ok(bench.emulator.chip().pwm[0].next_top().is_some())
    })?;
    let mut taken = Vec::new();
    let first = bench.emulator.time();
    let until = |bench: &mut Bench, at: f64| {
        let passed = (bench.emulator.time() - first) as f64 / CORE_HZ as f64;
        bench.pass(at - passed)
    };
    for (at, demand, velocity, base_rpm) in SCRIPT {
        until(&mut bench, at)?;
        let before = bench.look()?;
        let base = base_rpm * TAU / 60.0;
        match demand {
            Demand::Run => bench.start(velocity, base)?,
            other => bench.demand(other)?,
        }
        if demand == Demand::Run {
            let step = bench.wait_for_step(|view| view.words().taken != before.words().taken)?;
            taken.push((step, Taken::Speeds(velocity, base)));
        }
        if before.state() == Some(State::Ready) || demand == Demand::Rest {
            let step = bench.wait_for_step(|view| view.state() != before.state())?;
            taken.push((step, Taken::Demand(demand)));
        }
    }
    until(&mut bench, END)?;
    for motor in bench.look()?.words().motors {
        assert_eq!(motor.missed, 0, "{board:?}: deadlines missed");
    }
    assert_eq!(bench.look()?.words().speed_missed, 0, "{board:?}");
    Ok((bench.emulator.chip().tops.take().unwrap_or_default(), taken))
}

/// Runs the script on chip and host, and compares them.
fn same(
    what: &str,
    elf: &Path,
    plate: &DrivePlate,
    (board, model, coupling): (Wiring, &Model, Coupling),
    stored: Option<&Settings>,
) -> Result<Drive, String> {
    let (tops, taken) = emulated(elf, board, model, coupling, stored)?;
    let streams = by_motor(&tops);
    let periods = streams[1].len() - 1;
    assert!(
        periods > 30_000,
        "more than a second with both motors turning"
    );

    let mut config = board_config(board);
    // The emulated scale has none, and what is drawn for it would be missing elsewhere.
    config.sensors.scale_noise_m = 0.0;
    let mut drive = Drive::aligned(&machine_of(board, model, coupling), coupling, config, plate)
        .map_err(|misfit| misfit.to_string())?;
    drive.request.demand = Demand::Rest;
    let mut script = taken.into_iter().peekable();
    let (mut driven, mut turned) = (0, [0.0; 2]);
    for period in 0..periods {
        while let Some((_, taken)) = script.next_if(|(at, _)| *at == period as u64) {
            match taken {
                Taken::Speeds(velocity, base) => drive
                    .command(velocity, base)
                    .map_err(|error| error.to_string())?,
                Taken::Demand(demand) => drive.request.demand = demand,
            }
        }
        drive.period();
        assert_period(what, period, &streams, &drive);
        driven += usize::from(drive.compare(Axis::Screw).enable && drive.compare(Axis::Nut).enable);
        for (most, axis) in turned.iter_mut().zip([Axis::Screw, Axis::Nut]) {
            *most = f64::max(*most, drive.board.machine.motor(axis).omega.abs());
        }
    }
    assert!(script.next().is_none(), "the whole script was run");
    assert!(
        driven > 20_000,
        "both bridges were on for a second: {driven} periods"
    );
    assert!(
        turned.iter().all(|&speed| speed > 30.0),
        "both motors turned: {turned:?} rad/s"
    );
    Ok(drive)
}

#[test]
fn compare_values_and_samples_are_those_of_the_host() -> Result<(), String> {
    for (board, model, coupling) in [
        (Wiring::Nucleo, Model::paper(), Coupling::Lumped),
        (Wiring::Nucleo, Model::coupled(), Coupling::Coupled),
        (Wiring::Nucleo40kHz, Model::paper(), Coupling::Lumped),
        // The screw's encoder on SPI, the nut's with index, the shunts' other sign.
        (Wiring::Mains, Model::coupled(), Coupling::Coupled),
    ] {
        let what = format!("{board:?}, {coupling:?}");
        let on = (board, &model, coupling);
        same(&what, &firmware_of(board)?, &plate_of(board), on, None)?;
    }
    Ok(())
}

/// What the chip computes of stored settings, without a float unit for these, is what the host does.
#[test]
fn a_drive_with_stored_settings_is_the_hosts() -> Result<(), String> {
    let (board, model) = (Wiring::Nucleo, Model::paper());
    let mut settings = board.kind().settings();
    settings.screw.resistance_line_to_line_ohm *= 1.07;
    settings.nut.inertia_kg_cm2 *= 0.93;
    settings.nut.current_gain_b = 1.01;
    settings.tuning.speed_rad_s = 170.0;
    settings.bridge.dead_time_ns = 430.0;
    settings.feed.acceleration_max_mm_s2 = 200.0;
    settings.compensation.learning_s = 1.0;
    settings.rejection.notch.hz = 503.0;
    settings.rejection.disturbance_rad_s = 40.0;
    settings.feed_friction.coulomb_nm = 0.01;
    let plate = settings.plate(&plate_of(board).board);
    let on = (board, &model, Coupling::Lumped);
    same("stored", &firmware_of(board)?, &plate, on, Some(&settings))?;
    Ok(())
}

/// The firmware that learns, with the table's scale: what it has learned is what the host has, or the next compare values would
/// not be.
#[test]
fn what_compensates_ripple_is_the_hosts() -> Result<(), String> {
    let (board, model) = (Wiring::Nucleo, Model::paper());
    let plate = board
        .kind()
        .settings()
        .smooth()
        .plate(&plate_of(board).board);
    let on = (board, &model, Coupling::Lumped);
    let drive = same("smooth", &smooth_firmware()?, &plate, on, None)?;
    let compensation = drive.compensation();
    let all: Vec<Phasor> = (0..LINES)
        .map(|line| compensation.coefficient(line))
        .collect();
    let (torque, speeds) = all.split_at(2 * TORQUES);
    let (of_angle, travel) = speeds.split_at(2 * ANGLES);
    let learned = |phasors: &[Phasor]| phasors.iter().filter(|&&x| x != Phasor::ZERO).count();
    assert!(
        torque
            .chunks(TORQUES)
            .all(|lines| learned(lines) >= TORQUES - 1)
            && of_angle.chunks(ANGLES).all(|lines| learned(lines) == 3)
            && learned(travel) == 2,
        "learned of torques {torque:?}, of encoders {of_angle:?}, of the lead {travel:?}: expected {TORQUES} orders of each motor, of which one may just be at zero, three of \
         each encoder and two of the lead"
    );
    Ok(())
}
