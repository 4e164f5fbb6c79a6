//! The experiment of the paper, or the same at other speeds, loads, machines and sensors.

use super::learned::learned;
use super::options::{MachineOptions, Options, Preset, Sensing};
use super::progress::progress_bar;
use super::report::{CurveReport, Mark, Report, RunReport, SensitivityReport, SetupReport};
use super::{curves, html, table};
use crate::output::Folder;
use crate::simulate::setup::{duration, nut_speed, table_speed};
use anyhow::{Context, Result, ensure};
use hal_sim::analytic::{Sensitivity, ripple_percent};
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{
    OperatingPoint, RECORD_HZ, RPM, Recorder, Setup, driven, record_periods, settle,
    table_velocities,
};
use hal_sim::response;
use hal_sim::vrf::{spectrum, vrf_percent};
use indicatif::ProgressBar;
use plant::recording::RecordingWriter;

/// The paper's measurements at 2.5 mm/s and 1 N m (Section 6): nut rpm, VRF in %.
pub const PAPER_MEASURED: [(f64, f64); 4] =
    [(0.0, 20.1), (300.0, 13.4), (500.0, 10.6), (800.0, 8.2)];

/// The paper's table velocity, mm/s.
const PAPER_MM_S: f64 = 2.5;

/// How much of a velocity record goes into the report, s: a few beats of the motors' harmonics.
const SHOWN_S: f64 = 0.5;

/// Highest frequency of the spectra in the report, Hz.
const SHOWN_HZ: f64 = 1000.0;

/// Angular frequencies at which `S` is measured: 5 to 5000 rad/s, eight to a decade.
const MEASURED_OMEGAS: usize = 25;

/// Runs the experiment and writes its report.
pub fn run(options: &Options) -> Result<()> {
    let (setup, machine) = options.machine.setup(Preset::Paper)?;
    let velocity = table_speed(options.table_speed, &setup)?;
    let seconds = duration(options.duration)?;
    ensure!(
        !options.nut_rpm.is_empty(),
        "--nut-rpm is empty: give at least one nut speed, such as 0,300"
    );
    let points = options
        .nut_rpm
        .iter()
        .map(|&rpm| {
            Ok(OperatingPoint {
                velocity,
                base: nut_speed(rpm, velocity, &setup)?,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let folder = Folder::open(&options.out)?;
    let is_paper =
        machine == "paper" && options.table_speed == PAPER_MM_S && options.machine.load.is_none();

    let progress = progress_bar(points.len() + 2 * MEASURED_OMEGAS);
    let mut runs = Vec::new();
    folder.put("recording.csv.gz", |path| {
        let mut drive = setup.drive()?;
        let mut rows = Rows::new(&setup, RecordingWriter::create(path)?);
        for point in &points {
            progress.set_message(format!("nut at {:.0} rpm", point.base / RPM));
            settle(&mut drive, *point, |drive| rows.take(drive)).context("settling failed")?;
            let periods = record_periods(&setup.board);
            let velocities = table_velocities(&mut drive, seconds, periods, |drive| {
                driven(drive, *point)?;
                rows.take(drive)
            })?;
            runs.push(run_report(&setup, *point, is_paper, &velocities));
            progress.inc(1);
        }
        Ok(rows.writer.finish()?)
    })?;

    let sensitivity = sensitivity(&setup, &points, &progress)?;
    progress.finish_and_clear();
    if let Some(board) = setup.shipped {
        let ripples = learned(&setup, board, &points, seconds)?;
        for (run, ripple) in runs.iter_mut().zip(ripples) {
            run.learned_percent = ripple;
        }
    }
    let report = Report {
        setup: SetupReport {
            machine,
            sensors: sensor_name(&options.machine).to_owned(),
            table_mm_s: options.table_speed,
            load: load_name(&setup),
            record_s: seconds,
            record_hz: RECORD_HZ,
            seed: options.machine.seed,
            is_paper,
        },
        runs,
        sensitivity,
        curve: curve(&setup, velocity, &points, is_paper),
    };
    folder.put_text("model.toml", &setup.model.to_toml())?;
    folder.put_text("report.json", &serde_json::to_string_pretty(&report)?)?;
    folder.put_text("report.html", &html::page(&report))?;
    folder.put_text("ripple.svg", &curves::picture(&report))?;
    table::print(&report);
    println!("\nThe report is {}.", folder.path("report.html").display());
    Ok(())
}

/// Writes a row of the recording at the model's sampling rate.
struct Rows {
    recorder: Recorder,
    writer: RecordingWriter,
    every: u64,
}

impl Rows {
    fn new(setup: &Setup, writer: RecordingWriter) -> Self {
        let every = (1.0 / (setup.model.sensing.sample_hz * setup.board.pwm_period_s()))
            .round()
            .max(1.0) as u64;
        Self {
            recorder: Recorder::default(),
            writer,
            every,
        }
    }

    fn take(&mut self, drive: &mut Drive) -> Result<()> {
        if drive.periods().is_multiple_of(self.every) {
            let row = self.recorder.row(drive);
            self.writer.write(&row)?;
        }
        Ok(())
    }
}

fn run_report(
    setup: &Setup,
    point: OperatingPoint,
    is_paper: bool,
    velocities: &[f64],
) -> RunReport {
    let nut_rpm = point.base / RPM;
    let mm_s: Vec<f64> = velocities.iter().map(|v| v * 1e3).collect();
    let measured = PAPER_MEASURED
        .iter()
        .find(|(rpm, _)| is_paper && (rpm - nut_rpm).abs() < 1e-6);
    RunReport {
        nut_rpm,
        vrf_percent: vrf_percent(velocities, point.velocity),
        learned_percent: None,
        analytic_percent: analytic_percent(setup, point),
        measured_percent: measured.map(|(_, percent)| *percent),
        mean_mm_s: mm_s.iter().sum::<f64>() / mm_s.len() as f64,
        spectrum: spectrum(&mm_s, RECORD_HZ)
            .into_iter()
            .take_while(|(hz, _)| *hz <= SHOWN_HZ)
            .collect(),
        velocity_mm_s: mm_s
            .into_iter()
            .take((SHOWN_S * RECORD_HZ) as usize)
            .collect(),
    }
}

/// VRF by Appendix A, %.
pub fn analytic_percent(setup: &Setup, point: OperatingPoint) -> f64 {
    let gains = setup.plate().motors.map(|motor| motor.gains(&setup.tuning));
    ripple_percent(&setup.model, &gains, point.velocity, point.base)
}

fn sensitivity(
    setup: &Setup,
    points: &[OperatingPoint],
    progress: &ProgressBar,
) -> Result<SensitivityReport> {
    let ideal = Setup::ideal(setup.model.clone(), setup.coupling);
    let plate = setup.plate();
    let s = Sensitivity::new(&setup.model.screw, &plate.motors[0].gains(&setup.tuning));
    let omega = |k: usize, of: usize| 5.0 * 1000f64.powf(k as f64 / (of - 1) as f64);
    let analytic = (0..200)
        .map(|k| omega(k, 200))
        .map(|w| (w, s.at(w).norm()))
        .collect();
    let omegas: Vec<f64> = (0..MEASURED_OMEGAS)
        .map(|k| omega(k, MEASURED_OMEGAS))
        .collect();
    let measure = |setup: &Setup| -> Result<Vec<(f64, f64)>> {
        let gain = |&w: &f64| {
            progress.set_message(format!("S at {w:.0} rad/s"));
            progress.inc(1);
            // Turning, so that no friction holds the shaft.
            Ok((w, response::measure(setup, 100.0 * RPM, w)?.norm()))
        };
        omegas.iter().map(gain).collect()
    };
    let own = if *setup == ideal {
        Vec::new()
    } else {
        measure(setup)?
    };
    let r = setup.model.feed.travel_per_radian();
    let p = f64::from(setup.model.screw.pole_pairs);
    let marks = points
        .iter()
        .zip('A'..='Z')
        .flat_map(|(point, letter)| {
            let speed = (point.base + point.velocity / r).abs();
            setup
                .model
                .screw
                .torque_harmonics
                .iter()
                .map(move |harmonic| (letter, harmonic.order, speed))
        })
        .map(|(letter, order, speed)| {
            let omega = order * p * speed;
            Mark {
                name: format!("{letter}{order}"),
                omega,
                gain: s.at(omega).norm(),
            }
        })
        .collect();
    Ok(SensitivityReport {
        analytic,
        ideal: measure(&ideal)?,
        measured: own,
        marks,
    })
}

fn curve(setup: &Setup, velocity: f64, points: &[OperatingPoint], is_paper: bool) -> CurveReport {
    let highest = points
        .iter()
        .map(|p| (p.base / RPM).abs())
        .fold(0.0, f64::max)
        .max(100.0);
    let analytic = (0..=100)
        .map(|k| highest * 1.1 * f64::from(k) / 100.0)
        .map(|rpm| {
            (
                rpm,
                analytic_percent(
                    setup,
                    OperatingPoint {
                        velocity,
                        base: rpm * RPM,
                    },
                ),
            )
        })
        .collect();
    CurveReport {
        analytic,
        measured: if is_paper {
            PAPER_MEASURED.to_vec()
        } else {
            Vec::new()
        },
    }
}

fn load_name(setup: &Setup) -> String {
    let newtons = setup.model.feed.load_n;
    format!(
        "{newtons:.0} N ({:.2} N m at each motor)",
        newtons * setup.model.feed.travel_per_radian()
    )
}

/// How a person calls the sensors.
pub fn sensor_name(machine: &MachineOptions) -> &'static str {
    match (machine.board(), machine.sensing()) {
        (Some(BoardKind::Mains), _) => "the mains board's",
        (Some(BoardKind::Nucleo), _) => "the NUCLEO board's",
        (Some(BoardKind::Nucleo40kHz), _) => "the NUCLEO board's at 40 kHz",
        (None, Sensing::Ideal) => "ideal",
        (None, Sensing::Real) => "real",
        (None, Sensing::Declared) => "declared",
    }
}
