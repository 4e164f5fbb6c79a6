//! Ripple over a grid of table and nut speeds.

use super::options::{Preset, SweepOptions};
use super::run::{progress_bar, sensor_name};
use super::sweep_html;
use super::sweep_report::SweepReport;
use crate::output::Folder;
use crate::simulate::setup::{duration, nut_speed, table_speed};
use anyhow::{Result, ensure};
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, record_periods, settle_quietly, table_velocities,
};
use hal_sim::vrf::vrf_percent;

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

    let progress = progress_bar(grid.len());
    let mut vrf = Vec::new();
    for point in grid {
        let mut drive = setup.drive()?;
        vrf.push(match settle_quietly(&mut drive, point) {
            Ok(()) => {
                let periods = record_periods(&setup.board);
                let velocities = table_velocities(&mut drive, seconds, periods, |_| {
                    Ok::<(), ExperimentError>(())
                })?;
                Some(vrf_percent(&velocities, point.velocity))
            }
            Err(ExperimentError::NotSteady { .. }) => None,
            Err(error) => return Err(error.into()),
        });
        progress.inc(1);
    }
    progress.finish_and_clear();

    let report = SweepReport {
        machine,
        sensors: sensor_name(options.machine.sensors).to_owned(),
        table_mm_s: options.table_speed.clone(),
        vrf_percent: vrf
            .chunks(nut_rpm.len())
            .map(<[Option<f64>]>::to_vec)
            .collect(),
        nut_rpm,
    };
    folder.put_text("sweep.json", &serde_json::to_string_pretty(&report)?)?;
    folder.put_text("sweep.html", &sweep_html::page(&report))?;
    print(&report);
    println!("\nThe picture is {}.", folder.path("sweep.html").display());
    Ok(())
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
