//! The results as short tables on the terminal.

use super::drive_name::drive_name;
use super::papers::{CREEP, Paper, SWITCHING, TORSION, TRACKING, WARMTH};
use super::report::LiteratureReport;
use crate::simulate::proposal::RULE;
use page::document::short;

/// Prints all of them.
pub fn print(report: &LiteratureReport) {
    print_creep(report);
    print_tracking(report);
    print_warmth(report);
    print_switching(report);
    print_torsion(report);
}

fn print_paper(paper: &Paper) {
    println!("{}: {} {}", paper.reference, paper.reports, paper.missing);
}

fn print_creep(report: &LiteratureReport) {
    let creep = &report.creep;
    println!(
        "a. Lowest stable velocity: the table never stops, and its ripple is below {} %",
        creep.ripple_percent
    );
    print_paper(&CREEP);
    for case in &creep.cases {
        println!(
            "{:>16}, speed loops of {:>3} rad/s: {:>8} mm/s",
            drive_name(case.nut_rpm),
            case.speed_rad_s,
            micro(case.lowest_mm_s)
        );
    }
    println!(
        "The linearised single drive of the slow loop sticks and slips below {} mm/s.",
        micro(creep.critical_mm_s)
    );
}

/// A velocity in mm/s to the micrometre a second.
pub fn micro(mm_s: Option<f64>) -> String {
    mm_s.map_or("-".into(), |mm_s| format!("{mm_s:.3}"))
}

fn print_tracking(report: &LiteratureReport) {
    let tracking = &report.tracking;
    println!(
        "\n   A sine of {} um and {} Hz, at most {:.3} mm/s; error rms, largest, closed form",
        short(tracking.amplitude_um),
        short(tracking.hz),
        tracking.largest_mm_s
    );
    print_paper(&TRACKING);
    for case in &tracking.cases {
        println!(
            "{:>16}, friction {:>14}: {:>6.2} {:>6.2} {:>6} um",
            drive_name(case.nut_rpm),
            if case.fed_forward {
                "fed forward"
            } else {
                "unknown"
            },
            case.rms_um,
            case.peak_um,
            case.closed_form_um
                .map_or("-".into(), |um| format!("{um:.2}"))
        );
    }
    println!(
        "Known friction makes the fastest double drive {:.1} times as accurate.",
        tracking.times
    );
}

fn print_warmth(report: &LiteratureReport) {
    let warmth = &report.warmth;
    println!(
        "\nb. Losses at {} mm/s under {:.0} N",
        warmth.table_mm_s, warmth.load_n
    );
    WARMTH.iter().for_each(print_paper);
    println!(
        "{:>8} {:>9} {:>12} {:>9} {:>9} {:>9} {:>14} {:>9} {:>9}",
        "nut, rpm",
        "VRF, %",
        "compensated",
        "copper,",
        "W",
        "friction,",
        "torque x speed",
        "winding,",
        "%"
    );
    for point in &warmth.points {
        let ([screw, nut], [warm_screw, warm_nut]) = (point.copper_w, point.winding_percent);
        println!(
            "{:>8.0} {:>9.2} {:>12.2} {screw:>9.2} {nut:>9.2} {:>9.2} {:>14.2} {warm_screw:>9.0} {warm_nut:>9.0}",
            point.nut_rpm,
            point.vrf_percent,
            point.compensated_percent,
            point.friction_w,
            point.friction_closed_form_w
        );
    }
    for (name, choice) in [
        ("without compensation", &warmth.proposed),
        ("compensated", &warmth.compensated),
    ] {
        if let Some(choice) = choice {
            println!("Proposed {name}: {:.0} rpm.", choice.nut_rpm);
        }
    }
    println!("{RULE}");
}

fn print_switching(report: &LiteratureReport) {
    let switching = &report.switching;
    println!(
        "\nc. {} N m that switches at the nut each {} s; table displacement, closed form, rms",
        switching.load_nm, switching.switches_s
    );
    print_paper(&SWITCHING);
    for case in &switching.cases {
        println!(
            "{:>22}: {:>6.2} {:>6.2} {:>6.2} um, velocity {:>6.3} mm/s",
            case.name(),
            case.moved_um,
            case.closed_form_um,
            case.rms_um,
            case.peak_mm_s
        );
    }
    let [off, single] = switching.less_percent;
    println!(
        "The coupling lowers the error by {off:.0} %; it is {single:.0} % below the single drive's."
    );
}

fn print_torsion(report: &LiteratureReport) {
    let torsion = &report.torsion;
    let ([held, held_form], [free, free_form]) = (torsion.held_hz, torsion.free_hz);
    let [diameter, length] = torsion.shaft_mm;
    println!("\nd. Torsion of a screw of {diameter} mm, {length} mm beyond the nut");
    print_paper(&TORSION);
    println!("The screw resists most at {held:.0} Hz, closed form {held_form:.0} Hz.");
    println!("It resonates at {free:.0} Hz, closed form {free_form:.0} Hz.");
    println!(
        "{:>16} {:>14} {:>14}",
        "nut speed", "rigid, VRF %", "twists, VRF %"
    );
    for ripple in &torsion.ripples {
        let [rigid, twists] = ripple.vrf_percent;
        println!(
            "{:>16} {rigid:>14.2} {twists:>14.2}",
            drive_name(ripple.nut_rpm)
        );
    }
}
