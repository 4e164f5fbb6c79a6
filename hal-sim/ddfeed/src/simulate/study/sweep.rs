//! Ripple over a grid of table and nut speeds.

use super::learned::learned;
use super::options::{Preset, SweepOptions};
use super::progress::progress_bar;
use super::run::sensor_name;
use super::sweep_html;
use super::sweep_report::{Proposed, SweepReport};
use crate::output::Folder;
use crate::simulate::losses::LossMeter;
use crate::simulate::proposal::{Choice, RULE};
use crate::simulate::setup::{duration, knowing_plate, nut_speed, table_speed};
use anyhow::{Result, ensure};
use control::plate::DrivePlate;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, Setup, driven, record_periods, settle_quietly,
    table_velocities,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::vrf::vrf_percent;
use link::host::settings::some_to_toml;
use link::settings::{Setting, Settings};

/// Runs the sweep and writes its report.
pub fn run(options: &SweepOptions) -> Result<()> {
    let (setup, machine) = options.machine.setup(Preset::Coupled)?;
    let seconds = duration(options.duration)?;
    ensure!(
        !options.table_speed.is_empty(),
        "--table-speed is empty: give at least one table velocity, such as 2.5"
    );
    let mut nut_rpm = vec![0.0];
    nut_rpm.extend(options.nut_rpm.iter().copied().filter(|rpm| *rpm != 0.0));
    let mut grid = Vec::new();
    for &speed in &options.table_speed {
        let velocity = table_speed(speed, &setup)?;
        for &rpm in &nut_rpm {
            grid.push(OperatingPoint {
                velocity,
                base: nut_speed(rpm, velocity, &setup)?,
            });
        }
    }
    let folder = Folder::open(&options.out)?;

    let is_known = options.compensated && setup.shipped.is_none();
    let progress = progress_bar(grid.len() * if is_known { 2 } else { 1 });
    let measure = |plate: &DrivePlate| -> Result<Vec<Option<Reached>>> {
        let reached = on_all_cores(&grid, |&point| {
            let reached = reached(&setup, plate, point, seconds);
            progress.inc(1);
            reached
        });
        Ok(reached.into_iter().collect::<Result<_, _>>()?)
    };
    let rows = |values: Vec<Option<f64>>| values.chunks(nut_rpm.len()).map(<[_]>::to_vec).collect();
    let ripples = |of: &[Option<Reached>]| {
        let each = of.iter().map(|one| one.map(|one| one.vrf_percent));
        rows(each.collect())
    };
    let plate = setup.plate();
    let plain = measure(&plate)?;
    let compensated_percent = if !options.compensated {
        None
    } else if let Some(board) = setup.shipped {
        Some(rows(learned(&setup, board, &grid, seconds)?))
    } else {
        Some(ripples(&measure(&knowing_plate(&setup))?))
    };
    progress.finish_and_clear();

    let report = SweepReport {
        machine,
        sensors: sensor_name(&options.machine).to_owned(),
        table_mm_s: options.table_speed.clone(),
        vrf_percent: ripples(&plain),
        loss_w: rows(plain.iter().map(|one| one.map(|one| one.loss_w)).collect()),
        compensated_percent,
        learned: setup.shipped.is_some(),
        nut_rpm,
        proposed: Vec::new(),
    }
    .with_proposals();
    folder.put_text("sweep.json", &serde_json::to_string_pretty(&report)?)?;
    folder.put_text("sweep.html", &sweep_html::page(&report))?;
    print(&report);
    if let Some(compensated) = report.compensated() {
        println!("\n{}:\n", report.compensated_title());
        print(&compensated);
    }
    print_proposed(&report);
    write_base(&report, &plate, &folder)?;
    println!("\nThe picture is {}.", folder.path("sweep.html").display());
    Ok(())
}

/// Writes what is proposed as settings of the drive.
fn write_base(report: &SweepReport, plate: &DrivePlate, folder: &Folder) -> Result<()> {
    let (base, left_out) = report.base_table();
    let of_base = |setting: &Setting| setting.group() == "base";
    let settings = Settings::of_plate(&DrivePlate { base, ..*plate });
    folder.put_text("base.toml", &some_to_toml(&settings, of_base))?;
    println!(
        "\n`ddfeed drive settings import {}` makes them the drive's own, for commands that give none.",
        folder.path("base.toml").display()
    );
    if left_out > 0 {
        println!("The fastest {left_out} found no room in the drive's table.");
    }
    Ok(())
}

/// What a drive does at a point that it reaches.
#[derive(Clone, Copy)]
struct Reached {
    vrf_percent: f64,
    loss_w: f64,
}

/// A drive with this plate at a point; none if it does not reach it, or does not stay there.
fn reached(
    setup: &Setup,
    plate: &DrivePlate,
    point: OperatingPoint,
    seconds: f64,
) -> Result<Option<Reached>, ExperimentError> {
    let mut drive = setup.drive_with(plate)?;
    match settle_quietly(&mut drive, point) {
        Ok(()) => {}
        Err(ExperimentError::NotSteady { .. }) => return Ok(None),
        Err(error) => return Err(error),
    }
    let mut meter = LossMeter::new(setup);
    let periods = record_periods(&setup.board);
    let velocities = table_velocities(&mut drive, seconds, periods, |drive| {
        meter.take(drive);
        driven(drive, point)
    });
    match velocities {
        Ok(velocities) => Ok(meter.losses().map(|losses| Reached {
            vrf_percent: vrf_percent(&velocities, point.velocity),
            loss_w: losses.total_w(),
        })),
        Err(ExperimentError::Faulted { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

fn print(report: &SweepReport) {
    println!(
        "Velocity ripple factor (Eq 19), %, on the {} machine with {} sensors; * marks where DDFS beats CDFS\n",
        report.machine, report.sensors
    );
    print!("{:>12}", "mm/s \\ rpm");
    report.nut_rpm.iter().for_each(|rpm| print!("{rpm:>9.0}"));
    println!();
    for (speed, row) in report.table_mm_s.iter().zip(&report.vrf_percent) {
        print!("{speed:>12}");
        let single = row.first().copied().flatten();
        for (k, vrf) in row.iter().enumerate() {
            let mark = if k > 0
                && vrf
                    .zip(single)
                    .is_some_and(|(double, single)| double < single)
            {
                "*"
            } else {
                " "
            };
            match vrf {
                Some(vrf) => print!("{vrf:>8.2}{mark}"),
                None => print!("{:>9}", "-"),
            }
        }
        println!();
    }
}

/// The base speeds that are proposed.
fn print_proposed(report: &SweepReport) {
    let how = if report.compensated_percent.is_some() {
        "compensated"
    } else {
        "without compensation"
    };
    println!("\nProposed nut speed for each table velocity, {how}; 0 is the single drive (CDFS).");
    println!("{RULE}");
    for Proposed { table_mm_s, choice } in &report.proposed {
        let Choice {
            nut_rpm,
            vrf_percent,
            loss_w,
        } = choice;
        let loss = loss_w.map_or("-".to_owned(), |loss_w| format!("{loss_w:.1}"));
        println!("{table_mm_s:>12} mm/s {nut_rpm:>9.0} rpm {vrf_percent:>8.2} % {loss:>8} W");
    }
}
