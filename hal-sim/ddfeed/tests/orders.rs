//! Orders that nobody listed are found in a recording, and removed.

use control::plate::{CompensationPlate, OrderPlate};
use ddfeed::compensate::{Found, orders};
use fft::Complex64;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Recorder, Setup, settle};
use hal_sim::smooth::known::Known;
use hal_sim::smooth::{drive, smoothness};
use link::host::settings::of_toml;
use link::settings::Settings;
use plant::Axis;
use plant::effects::{
    AnglePeriodic, AnyEffect, EffectModel, EncoderEccentricity, FluxHarmonic, LeadError, Place,
};
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Rows a second, and the length of a hold.
const ROWS_HZ: f64 = 5e3;
const HOLD_S: f64 = 2.0;
/// The load at each motor of each half of a recording, N m.
const LOADS_NM: [f64; 2] = [0.2, 1.0];

/// The coupled machine with orders of its own, of which no plate knows.
fn machine() -> Model {
    let mut model = Model::coupled();
    let mut add = |place, effect: AnyEffect| {
        model.effects.extend(EffectModel::new(place, effect));
    };
    add(
        Place::Screw,
        AnglePeriodic {
            order: 17.4,
            amplitude: 0.03,
            phase: 0.4,
        }
        .into(),
    );
    add(
        Place::Nut,
        FluxHarmonic {
            order: 3.0,
            amplitude: 0.04,
            phase: 1.1,
        }
        .into(),
    );
    add(
        Place::Nut,
        EncoderEccentricity {
            order: 2.0,
            amplitude: 2e-4,
            phase: 0.7,
        }
        .into(),
    );
    add(
        Place::Feed,
        LeadError {
            order: 2.0,
            amplitude: 2e-6,
            phase: 0.2,
        }
        .into(),
    );
    model
}

fn setup(load_nm: f64) -> Setup {
    let mut setup = Setup::real(machine(), Coupling::Coupled);
    setup.model.feed.load_n = load_nm / setup.model.feed.travel_per_radian();
    setup
}

/// Holds at each table velocity in m/s and nut speed in rpm, under one load and another.
fn recording(loads_nm: &[f64], holds: &[(f64, f64)]) -> Result<Recording, ExperimentError> {
    let mut recording = Recording::default();
    let mut setup = setup(LOADS_NM[0]);
    let mut drive = setup.drive()?;
    let mut recorder = Recorder::default();
    let periods = (1.0 / (ROWS_HZ * setup.board.pwm_period_s())).round() as u64;
    for &load_nm in loads_nm {
        setup.model.feed.load_n = load_nm / setup.model.feed.travel_per_radian();
        drive.board.machine.set_load_force(setup.model.feed.load_n);
        for &(velocity, rpm) in holds {
            let point = OperatingPoint {
                velocity,
                base: rpm * RPM,
            };
            let mut row = |drive: &mut hal_sim::drive::Drive| {
                if drive.periods().is_multiple_of(periods) {
                    recording.push(&recorder.row(drive));
                }
            };
            settle(&mut drive, point, |drive| {
                row(drive);
                Ok::<(), ExperimentError>(())
            })?;
            for _ in 0..(HOLD_S / setup.board.pwm_period_s()) as u64 {
                drive.period();
                row(&mut drive);
            }
        }
    }
    Ok(recording)
}

fn found(list: &[Found], order: f64) -> Found {
    let near = list.iter().find(|found| (found.order - order).abs() < 0.02);
    *near.unwrap_or_else(|| panic!("order {order} is not among {list:?}"))
}

fn known(plates: &[OrderPlate], order: f64) -> Complex64 {
    let plate = plates.iter().find(|plate| plate.order == order).unwrap();
    Complex64::new(plate.re, plate.im)
}

/// `compensate --search` in a folder: what it printed, and the settings' file.
fn searched(
    folder: &Path,
    model: &Model,
    recording: &Recording,
) -> Result<(Output, PathBuf), Box<dyn Error>> {
    let [recorded, declared, found] =
        ["record.csv", "model.toml", "found.toml"].map(|name| folder.join(name));
    recording.save(&recorded)?;
    std::fs::write(&declared, model.to_toml())?;
    let output = Command::new(env!("CARGO_BIN_EXE_ddfeed"))
        .args(["compensate", "--search", "--model"])
        .arg(declared)
        .arg("--recording")
        .arg(recorded)
        .arg("--settings")
        .arg(&found)
        .output()?;
    Ok((output, found))
}

/// What it writes, as a drive takes it.
fn imported(model: &Model, recording: &Recording) -> Result<CompensationPlate, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (output, found) = searched(folder.path(), model, recording)?;
    assert!(output.status.success(), "compensate ended with {output:?}");
    let plate = setup(LOADS_NM[0]).plate();
    let settings = of_toml(
        &Settings::of_plate(&plate),
        &std::fs::read_to_string(found)?,
    )?;
    Ok(settings.plate(&plate.board).compensation)
}

#[test]
fn orders_that_nobody_listed_are_found_and_taken_away() -> Result<(), Box<dyn Error>> {
    let model = machine();
    let recording = recording(&LOADS_NM, &[150.0, 300.0, 700.0].map(|rpm| (5e-3, rpm)))?;
    let shown = orders(&recording, &model)?;
    println!("{shown:#?}");
    let mean_nm = 0.5 * (LOADS_NM[0] + LOADS_NM[1]);
    let truth = Known::of(&model).compensation;
    // At the mean load of the holds, which the nut holds the other way. Flux harmonics scale with the whole current.
    let [screw, nut] = [(Axis::Screw, 1.0), (Axis::Nut, -1.0)].map(|(axis, sign)| {
        let motor = model.motor(axis);
        let amps = sign * mean_nm / (f64::from(motor.pole_pairs) * motor.flux_wb);
        truth.torque[axis.index()].map(|plate| OrderPlate {
            order: plate.order,
            re: plate.re + amps * plate.re_per_a,
            im: plate.im + amps * plate.im_per_a,
        })
    });
    for (list, plates, order, within) in [
        (&shown.torque[0], &screw[..], 17.4, 0.1),
        (&shown.torque[0], &screw[..], 30.0, 0.1),
        (&shown.torque[1], &nut[..], 15.0, 0.1),
        (&shown.torque[1], &nut[..], 60.0, 0.1),
        (&shown.angle[1], &truth.angle[1][..], 2.0, 0.05),
        (&shown.travel, &truth.travel[..], 2.0, 0.1),
    ] {
        let (got, real) = (found(list, order).coefficient, known(plates, order));
        let off = (got - real).norm() / real.norm();
        assert!(
            off < within,
            "order {order}: {got:?} was found, {real:?} is there: {off:.2} of it off, expected less than {within}"
        );
    }
    // The nut's flux harmonic is as large as its current, the screw's torque as large without one.
    let [fixed, scaled] = [found(&shown.torque[0], 17.4), found(&shown.torque[1], 15.0)];
    let [fixed, scaled] = [fixed, scaled].map(|found| found.scales.unwrap());
    assert!(
        fixed < 0.2,
        "{fixed:.2} of order 17.4 scales with the load, expected none"
    );
    assert!(
        scaled > 0.8,
        "{scaled:.2} of order 15 scales with the load, expected all"
    );

    // On the way of a user, at a speed that was not recorded. The order that is not whole is learned.
    let written = imported(&model, &recording)?;
    // At a speed that was not recorded. The order that is not whole is learned.
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 500.0 * RPM,
    };
    let left = |plate: CompensationPlate| {
        let setup = setup(mean_nm);
        let plate = CompensationPlate {
            scale_count_m: setup.board.sensors.scale_count_m,
            ..plate
        };
        smoothness(&mut drive(&setup, plate)?, point, 12.0).map(|smoothness| smoothness.vrf)
    };
    let (before, after) = (left(CompensationPlate::NONE)?, left(written)?);
    println!("{before:.2} % before, {after:.2} % after");
    assert!(
        after < 0.15 * before,
        "{after:.2} % is left of {before:.2} %, expected less than a seventh"
    );
    Ok(())
}

#[test]
fn a_recording_that_cannot_distinguish_orders_is_refused() -> Result<(), Box<dyn Error>> {
    for (holds, sentence) in [
        (&[(5e-3, 300.0)][..], "last for 0.4 s: 1."),
        // The nut stands: what repeats with the screw repeats with the table too.
        (&[(5e-3, 0.0), (10e-3, 0.0)], "in one proportion"),
    ] {
        let told = match orders(&recording(&LOADS_NM[..1], holds)?, &machine()) {
            Ok(found) => format!("{found:?}"),
            Err(error) => error.to_string(),
        };
        assert!(
            told.contains(sentence) && told.contains("--hold"),
            "{holds:?} (m/s, rpm): {told}"
        );
    }
    Ok(())
}

#[test]
fn a_recording_of_another_machine_or_with_lost_rows_is_refused() -> Result<(), Box<dyn Error>> {
    let whole = recording(&LOADS_NM[..1], &[(5e-3, 150.0), (-5e-3, 300.0)])?;
    let mut lost = whole.clone();
    lost.time_s[5000..].iter_mut().for_each(|time| *time += 0.1);
    let mut other = machine();
    other.feed.lead_m *= 2.0;
    for (model, recording, sentence) in [
        (machine(), &lost, "rows are lost or repeated"),
        (other, &whole, "contradict each other"),
    ] {
        let folder = tempfile::tempdir()?;
        let (output, found) = searched(folder.path(), &model, recording)?;
        let told = String::from_utf8(output.stderr)?;
        assert!(
            !output.status.success() && !found.exists() && told.contains(sentence),
            "{told}"
        );
    }
    Ok(())
}
