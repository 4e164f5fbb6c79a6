//! From a drive's telemetry to the effect that its model lacks: what `record` writes of two runs of a simulated machine
//! goes through `identify`.

use anyhow::Context;
use control::encoder::Interface;
use control::plate::DrivePlate;
use control::sense::Shunts;
use ddfeed::output::Folder;
use ddfeed::record::save;
use hal_sim::drive::Drive;
use hal_sim::experiment::{OperatingPoint, RPM, settle_quietly};
use identify::records::{Mapping, OnFault};
use identify::run::Task;
use link::scale::{SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use link::telemetry::{
    EncoderKind, FRAME_MAX, Frame, Header, MotorPlate, MotorSample, Real, Request, Sample, rounded,
};
use plant::Axis;
use plant::effects::{AnyEffect, Cogging, EffectModel, Place};
use plant::machine::Coupling;
use plant::model::Model;
use std::path::Path;
use tests::bench::{board_config, plate_of, scale_count_m};
use tests::chip::wiring::Wiring;

/// What is asked of the stream.
const REQUEST: Request = Request {
    divider: 1,
    stream: 1,
};
/// Order and amplitude, N m, of the nut's cogging.
const COGGING: (f64, f64) = (24.0, 0.03);

/// The drive of the paper's motors with fine encoders, and with bridges that need no dead time: the residual of its
/// compensation is no effect that is looked for here. It measures two phases, which are what telemetry has: of three, the drive takes out
/// noise that the record keeps.
fn plate() -> DrivePlate {
    let mut plate = plate_of(Wiring::Mains);
    plate.bridge.dead_time_s = 0.0;
    plate.board.shunts = Shunts::Two;
    for motor in &mut plate.motors {
        motor.encoder.interface = Interface::Incremental;
        motor.encoder.counts_per_turn = 1 << 20;
        motor.encoder.age_s = 0.0;
    }
    plate
}

/// What the drive says of itself.
fn header() -> Header {
    let plate = plate();
    Header {
        layout: link::LAYOUT,
        request: REQUEST.word(),
        speed_divider: plate.board.speed_divider,
        period_s: Real::new(plate.board.sample_time()),
        current_lsb_a: Real::new(plate.board.amps_per_count.abs()),
        scale_count_m: Real::new(scale_count_m(Wiring::Mains)),
        lead_m: Real::new(plate.feed.lead_m),
        motors: plate.motors.map(|motor| MotorPlate {
            resistance_ohm: Real::new(motor.resistance_ohm),
            inductance_h: Real::new(motor.inductance_h),
            pole_pairs: motor.pole_pairs,
            flux_wb: Real::new(motor.flux_wb),
            inertia_kg_m2: Real::new(motor.inertia_kg_m2),
            encoder_counts: motor.encoder.counts_per_turn,
            encoder: EncoderKind::of(motor.encoder.interface),
        }),
    }
}

/// A motor's part of a sample, after a step of its current loop; references come from the speed task.
fn known(drive: &Drive, axis: Axis) -> MotorSample {
    let (estimate, voltage) = (drive.estimate(axis), drive.ended_voltage(axis));
    let [a, b, _] = estimate.phases;
    MotorSample {
        encoder: drive.sample(axis).encoder,
        phases: [a, b].map(|i| rounded(i.to_bits(), SAMPLE_CURRENT_DROPS)),
        voltage: [voltage.d, voltage.q].map(|u| rounded(u.to_bits(), SAMPLE_VOLTAGE_DROPS)),
        ..MotorSample::default()
    }
}

/// One period; a sample if the speed task had its step. It runs after the screw's loop and before the nut's.
fn period(drive: &mut Drive) -> Option<Sample> {
    let divider = u64::from(plate().board.speed_divider);
    let due = drive.periods().is_multiple_of(divider);
    let (period, scale) = (drive.periods(), drive.board.scale_counts());
    let nut = known(drive, Axis::Nut);
    drive.period();
    let mut motors = [known(drive, Axis::Screw), nut];
    let speed = drive.speed();
    for (k, motor) in motors.iter_mut().enumerate() {
        motor.i_q_ref = rounded(speed.current[k].i_q.to_bits(), SAMPLE_CURRENT_DROPS);
        motor.speed_ref = speed.speed[k].omega_e.to_bits();
    }
    due.then_some(Sample {
        period: period as u32,
        motors,
        scale: scale as i32,
    })
}

/// Telemetry of `machine` over holds (table mm/s, nut rpm), each with the way there, as `record` writes it.
fn record(machine: &Model, holds: &[(f64, f64)], folder: &Path, name: &str) -> anyhow::Result<()> {
    const SECONDS: f64 = 1.6;
    let mut board = board_config(Wiring::Mains);
    board.dead_time_s = plate().bridge.dead_time_s;
    board.shunts = plate().board.shunts;
    board.sensors.encoders = plate().motors.map(|motor| motor.encoder);
    let mut drive = Drive::aligned(machine, Coupling::Coupled, board, &plate())
        .map_err(|misfit| anyhow::anyhow!("{misfit}"))?;
    let start = OperatingPoint {
        velocity: holds[0].0 * 1e-3,
        base: holds[0].1 * RPM,
    };
    settle_quietly(&mut drive, start)?;
    let (summary, outcome) = save(&Folder::open(folder)?, name, 5000.0, |recorder| {
        recorder.start(REQUEST);
        let mut buffer = [0; FRAME_MAX];
        let mut bytes = |frame: Frame| {
            frame
                .encode(&mut buffer)
                .map(<[u8]>::to_vec)
                .unwrap_or_default()
        };
        recorder.take(&bytes(Frame::Header(header())))?;
        for (velocity, rpm) in holds {
            drive
                .command(velocity * 1e-3, rpm * RPM)
                .map_err(|error| anyhow::anyhow!("{error}"))?;
            for _ in 0..(SECONDS * board.pwm_hz) as u64 {
                if let Some(sample) = period(&mut drive) {
                    recorder.take(&bytes(Frame::Sample(sample)))?;
                }
            }
        }
        Ok(())
    })?;
    outcome?;
    anyhow::ensure!(
        summary.count.lost == 0 && summary.count.damaged == 0,
        "{summary}"
    );
    Ok(())
}

#[test]
fn an_undeclared_effect_is_found_in_a_drive_s_telemetry() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let mut machine = ddfeed::record::model(&header(), 1.0 / 5000.0, 310.0);
    let cogging: AnyEffect = Cogging {
        order: COGGING.0,
        amplitude: COGGING.1,
        phase: 0.4,
    }
    .into();
    machine
        .effects
        .extend(EffectModel::new(Place::Nut, cogging));
    let fit = [
        (2.5, 0.0),
        (2.5, 300.0),
        (-2.5, 500.0),
        (5.0, 400.0),
        (-4.0, -300.0),
    ];
    record(&machine, &fit, folder.path(), "fit")?;
    record(
        &machine,
        &[(3.0, 200.0), (-3.0, 450.0), (2.5, -350.0)],
        folder.path(),
        "check",
    )?;

    let task = Task {
        model: at("model.toml"),
        fit: vec![at("fit.csv.gz")],
        check: vec![at("check.csv.gz")],
        mapping: Mapping::default(),
        on_fault: OnFault::Refuse,
    };
    let report = task.run(&mut |_, _| ())?.report;
    let [effect] = &report.effects[..] else {
        anyhow::bail!("not one effect but {:?}", report.effects)
    };
    assert_eq!(
        (effect.kind.as_str(), effect.place.as_str()),
        ("cogging", "nut")
    );
    assert_eq!(effect.order, Some(COGGING.0));
    assert!((effect.parameters["amplitude"] / COGGING.1 - 1.0).abs() < 0.05);
    assert_eq!(report.verdict, "explained", "{:?}", report.unexplained);
    let torque = report.figures("nut torque").context("a channel")?;
    assert!(
        torque.check_before > 5.0 * torque.noise_floor
            && torque.check_after < 1.1 * torque.noise_floor,
        "{torque:?}"
    );
    Ok(())
}
