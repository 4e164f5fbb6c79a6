//! What was found, printed: as text or as JSON.

use super::search::{Found, Orders, SAME_ORDER};
use super::{CompensateOptions, Compensation, Predicted};
use control::plate::{FrictionPlate, OrderPlate, TorqueOrderPlate};
use hal_sim::experiment::RPM;
use hal_sim::smooth::known::Known;
use serde_json::{Value, json};

pub(super) fn print(options: &CompensateOptions, found: &Compensation) {
    let known = &found.known;
    let lists = lists(known);
    if options.json {
        println!("{}", as_json(found, &lists));
        return;
    }
    print_orders(&lists);
    print_friction(&known.friction);
    if !known.left.is_empty() {
        println!("Not compensated: {}", known.left.join("; "));
    }
    match &found.shown {
        Some(shown) => print_shown(shown, &lists),
        None => print_predicted(options, &found.predicted),
    }
    print_settings(options);
}

fn as_json(found: &Compensation, lists: &[List]) -> Value {
    let Compensation {
        known,
        predicted,
        shown,
    } = found;
    json!({
        "orders": lists.iter().flat_map(|(what, unit, plates)| plates.iter().map(move |plate| json!({
            "of": what, "order": plate.order, "unit": unit, "re": plate.re, "im": plate.im,
            "re_per_a": plate.re_per_a, "im_per_a": plate.im_per_a,
        }))).collect::<Vec<_>>(),
        "friction_nm": {
            "bearings": known.friction.bearings.map(|bearing| bearing.coulomb_nm),
            "feed": known.friction.feed.coulomb_nm,
        },
        "left": known.left,
        "shown": shown.iter().flat_map(shown_lists).flat_map(|(what, found)| found.iter().map(move |one| json!({
            "of": what, "order": one.order, "re": one.coefficient.re, "im": one.coefficient.im, "scales_with_load": one.scales,
        }))).collect::<Vec<_>>(),
        "predicted": predicted.iter().map(|one| json!({
            "table_mm_s": 1e3 * one.point.velocity, "nut_rpm": one.point.base / RPM,
            "vrf_before": one.before.vrf_percent, "vrf_after": one.after.vrf_percent,
            "rms_before": one.before.rms_percent, "rms_after": one.after.rms_percent,
        })).collect::<Vec<_>>(),
    })
}

fn print_orders(lists: &[List]) {
    println!("What repeats with an angle, as Re((re + j im) e^(j order angle)):");
    for (what, unit, plates) in lists {
        for plate in plates {
            print!(
                "  {what:<18} order {:>6}   re {:>11.3e}   im {:>11.3e}   {unit}",
                plate.order, plate.re, plate.im
            );
            if plate.re_per_a == 0.0 && plate.im_per_a == 0.0 {
                println!();
            } else {
                println!(
                    ", and {:.3e} and {:.3e} an ampere of load",
                    plate.re_per_a, plate.im_per_a
                );
            }
        }
    }
}

fn print_friction(friction: &FrictionPlate) {
    let [screw, nut] = friction.bearings;
    println!("Friction, N m while it slides, and more to break away:");
    for (what, rubbing) in [
        ("screw, bearing", screw),
        ("nut, bearing", nut),
        ("pair and guideway", friction.feed),
    ] {
        println!(
            "  {what:<18} {:>8.4} {:>8.4}",
            rubbing.coulomb_nm, rubbing.sticks_nm
        );
    }
}

fn print_shown(shown: &Orders, taken: &[List]) {
    println!("What the recording shows, and the part of it that scales with the load:");
    let is_measured = |found: &Found| found.coefficient.norm() > 0.0;
    for (what, found) in shown_lists(shown) {
        for one in found.iter().filter(|found| is_measured(found)) {
            let scales = one
                .scales
                .map_or("unknown".into(), |part| format!("{:.0} %", 100.0 * part));
            println!(
                "  {what:<18} order {:>8.3}   size {:>10.3e}   scales {scales}",
                one.order,
                one.coefficient.norm()
            );
        }
    }
    let others = |has_room: bool| {
        for ((what, found), (_, _, plates)) in shown_lists(shown).into_iter().zip(taken) {
            let is_taken = |found: &&Found| plates.iter().any(|plate| is_same(plate, found));
            let found = found.iter().filter(|found| is_taken(found) == has_room);
            for one in found.filter(|found| !has_room || !is_measured(found)) {
                println!("  {what:<18} order {:>8.3}", one.order);
            }
        }
    };
    println!("What the drive learns beside it, without a size from the recording:");
    others(true);
    println!("For what the drive has no room:");
    others(false);
}

/// Nearly whole orders are taken as whole.
fn is_same(plate: &TorqueOrderPlate, found: &Found) -> bool {
    (plate.order - found.order).abs() < 0.5 * SAME_ORDER
}

fn print_predicted(options: &CompensateOptions, predicted: &[Predicted]) {
    println!(
        "\nRipple of the table as a recording shows it, {} and with this, % peak to peak (Eq 19) and rms:",
        if options.recording.is_some() {
            "recorded"
        } else {
            "simulated without"
        }
    );
    for Predicted {
        point,
        before,
        after,
    } in predicted
    {
        println!(
            "  {:7.3} mm/s, nut {:6.0} rpm: {:6.2} and {:6.3} before, {:6.2} and {:6.3} with this",
            1e3 * point.velocity,
            point.base / RPM,
            before.vrf_percent,
            before.rms_percent,
            after.vrf_percent,
            after.rms_percent
        );
    }
}

fn print_settings(options: &CompensateOptions) {
    match &options.settings {
        Some(file) => println!(
            "\n`ddfeed drive --sim ADDRESS settings import {}` sets them; `--serial PORT` instead for a board.",
            file.display()
        ),
        None => {
            println!(
                "\n`--settings FILE` writes them for `ddfeed drive --sim ADDRESS settings import FILE`."
            )
        }
    }
}

/// What a recording shows, by what it is of.
fn shown_lists(shown: &Orders) -> [(&'static str, &[Found]); 5] {
    let [screw, nut] = &shown.torque;
    let [screw_angle, nut_angle] = &shown.angle;
    [
        ("screw, torque", screw),
        ("nut, torque", nut),
        ("screw, encoder", screw_angle),
        ("nut, encoder", nut_angle),
        ("lead", &shown.travel),
    ]
}

/// Orders, by what they are of and their unit.
type List = (&'static str, &'static str, Vec<TorqueOrderPlate>);

/// The orders that there are.
fn lists(known: &Known) -> Vec<List> {
    let plate = &known.compensation;
    let torque = |plates: &[TorqueOrderPlate]| -> Vec<_> {
        let some = plates.iter().filter(|plate| plate.order != 0.0);
        some.copied().collect()
    };
    let some = |plates: &[OrderPlate]| -> Vec<_> {
        let some = plates.iter().filter(|plate| plate.order != 0.0);
        let fixed = |plate: &OrderPlate| TorqueOrderPlate {
            re: plate.re,
            im: plate.im,
            ..TorqueOrderPlate::unknown(plate.order)
        };
        some.map(fixed).collect()
    };
    let part = "of the speed";
    vec![
        ("screw, torque", "A", torque(&plate.torque[0])),
        ("nut, torque", "A", torque(&plate.torque[1])),
        ("screw, encoder", part, some(&plate.angle[0])),
        ("nut, encoder", part, some(&plate.angle[1])),
        ("lead", part, some(&plate.travel)),
    ]
}
