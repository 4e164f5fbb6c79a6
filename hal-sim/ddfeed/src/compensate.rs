//! `ddfeed compensate`: from the model that identification left to what the drive compensates.

use anyhow::{Context, Result};
use clap::Args;
use control::plate::RejectionPlate;
use hal_sim::experiment::{OperatingPoint, RPM, Setup};
use hal_sim::smooth::known::Known;
use hal_sim::smooth::{drive, smoothness};
use link::host::settings::some_to_toml;
use link::settings::{Setting, Settings};
use plant::machine::Coupling;
use plant::model::Model;
use serde_json::json;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// A model, and where its ripple is predicted.
#[derive(Args)]
pub struct CompensateOptions {
    /// The model, as `identify` leaves it.
    #[arg(long)]
    model: PathBuf,
    /// Table velocity, mm/s.
    #[arg(long, default_value_t = 2.5, allow_negative_numbers = true)]
    table_speed: f64,
    /// Nut speeds, rpm; 0 is the single drive (CDFS).
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,300,800",
        allow_negative_numbers = true
    )]
    nut_rpm: Vec<f64>,
    /// The paper's own simplification: no friction, no elastic screw.
    #[arg(long)]
    lumped: bool,
    /// Writes them as settings, for `drive settings import`.
    #[arg(long)]
    settings: Option<PathBuf>,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

/// Reads, turns, predicts and prints.
pub fn run(options: &CompensateOptions) -> Result<()> {
    let model = Model::load(&options.model)
        .with_context(|| format!("the model {}", options.model.display()))?;
    let load_nm = model.feed.load_n * model.feed.travel_per_radian();
    let known = Known::of(&model, load_nm);
    let coupling = if options.lumped {
        Coupling::Lumped
    } else {
        Coupling::Coupled
    };
    let setup = Setup::declared(model, coupling);
    let mut predicted = Vec::new();
    for &rpm in &options.nut_rpm {
        let point = OperatingPoint {
            velocity: options.table_speed * 1e-3,
            base: rpm * RPM,
        };
        let run = |compensation| {
            let mut drive = drive(&setup, compensation)?;
            smoothness(&mut drive, point, 0.0)
        };
        let before = run(control::plate::CompensationPlate::NONE)?;
        let after = run(known.compensation)?;
        predicted.push((rpm, before.vrf, after.vrf));
    }
    let lists = lists(&known);
    let rejection = |setup: &Setup| match setup.coupling {
        Coupling::Lumped => RejectionPlate::NONE,
        Coupling::Coupled => {
            let feed = &setup.model.feed;
            let hz = (feed.axial_stiffness_n_per_m / feed.table_mass_kg).sqrt() / TAU;
            RejectionPlate::of_mode(hz, setup.tuning.speed_rad_s)
        }
    };
    if let Some(file) = &options.settings {
        let plate = control::plate::DrivePlate {
            compensation: known.compensation,
            friction: known.friction,
            rejection: rejection(&setup),
            ..setup.plate()
        };
        let settings = Settings::of_plate(&plate);
        crate::output::put_new(file, &some_to_toml(&settings, Setting::compensates))?;
    }
    if options.json {
        let report = json!({
            "orders": lists.iter().flat_map(|(what, unit, plates)| plates.iter().map(move |plate| json!({
                "of": what, "order": plate.order, "unit": unit, "re": plate.re, "im": plate.im,
            }))).collect::<Vec<_>>(),
            "friction_nm": {
                "bearings": known.friction.bearings.map(|bearing| bearing.coulomb_nm),
                "feed": known.friction.feed.coulomb_nm,
            },
            "left": known.left,
            "predicted": predicted.iter().map(|(rpm, before, after)| json!({
                "nut_rpm": rpm, "vrf_before": before, "vrf_after": after,
            })).collect::<Vec<_>>(),
        });
        println!("{report}");
        return Ok(());
    }
    println!("What repeats with an angle, as Re((re + j im) e^(j order angle)):");
    for (what, unit, plates) in &lists {
        for plate in plates {
            println!(
                "  {what:<18} order {:>6}   re {:>11.3e}   im {:>11.3e}   {unit}",
                plate.order, plate.re, plate.im
            );
        }
    }
    let [screw, nut] = known.friction.bearings;
    println!("Friction, N m while it slides, and more to break away:");
    for (what, rubbing) in [
        ("screw, bearing", screw),
        ("nut, bearing", nut),
        ("pair and guideway", known.friction.feed),
    ] {
        println!(
            "  {what:<18} {:>8.4} {:>8.4}",
            rubbing.coulomb_nm, rubbing.sticks_nm
        );
    }
    if !known.left.is_empty() {
        println!("No order compensates: {}", known.left.join(", "));
    }
    println!(
        "\nRipple of the table at {} mm/s, simulated on this model:",
        options.table_speed
    );
    for (rpm, before, after) in predicted {
        println!("  nut {rpm:>6} rpm   {before:>8.2} % without   {after:>8.2} % with these orders");
    }
    match &options.settings {
        Some(file) => println!(
            "\n`ddfeed drive settings import {}` sets them.",
            file.display()
        ),
        None => {
            println!("\n`--settings FILE` writes them for `ddfeed drive settings import FILE`.")
        }
    }
    Ok(())
}

/// The orders that there are, by what they are of and their unit.
fn lists(
    known: &hal_sim::smooth::known::Known,
) -> Vec<(&'static str, &'static str, Vec<control::plate::OrderPlate>)> {
    let plate = &known.compensation;
    let some = |plates: &[control::plate::OrderPlate]| {
        plates
            .iter()
            .filter(|plate| plate.order != 0.0)
            .copied()
            .collect()
    };
    let part = "of the speed";
    vec![
        ("screw, torque", "A", some(&plate.torque[0])),
        ("nut, torque", "A", some(&plate.torque[1])),
        ("screw, encoder", part, some(&plate.angle[0])),
        ("nut, encoder", part, some(&plate.angle[1])),
        ("lead", part, some(&plate.travel)),
    ]
}
