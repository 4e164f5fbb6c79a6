//! `report.html`: the later papers' results as a page that stands alone.

use super::charts;
use super::drive_name::drive_name;
use super::papers::{CREEP, SWITCHING, TORSION, TRACKING, WARMTH};
use super::report::LiteratureReport;
use super::table::micro;
use crate::simulate::proposal::RULE;
use askama::Template;
use page::document::{document, sentence, short, two};
use page::markup::Markup;
use page::table::{Kind, table};

/// The page.
pub fn page(report: &LiteratureReport) -> String {
    document(
        "What later papers report of the double drive",
        &Body { report },
    )
}

#[derive(Template)]
#[template(path = "literature.html")]
struct Body<'a> {
    report: &'a LiteratureReport,
}

fn velocities(report: &LiteratureReport) -> Markup {
    let columns = [
        ("Drive", Kind::Text),
        ("Speed loops, rad/s", Kind::Number),
        ("Lowest stable velocity, mm/s", Kind::Number),
    ];
    let rows = report.creep.cases.iter().map(|case| {
        [
            drive_name(case.nut_rpm),
            short(case.speed_rad_s),
            micro(case.lowest_mm_s),
        ]
    });
    table("Lowest stable velocities", columns, rows)
}

fn errors(report: &LiteratureReport) -> Markup {
    let columns = [
        ("Drive", Kind::Text),
        ("Friction", Kind::Text),
        ("Error, rms, um", Kind::Number),
        ("Largest, um", Kind::Number),
        ("Closed form, um", Kind::Number),
    ];
    let rows = report.tracking.cases.iter().map(|case| {
        [
            drive_name(case.nut_rpm),
            (if case.fed_forward {
                "fed forward"
            } else {
                "unknown"
            })
            .into(),
            two(Some(case.rms_um)),
            two(Some(case.peak_um)),
            two(case.closed_form_um),
        ]
    });
    table("Error of the sine", columns, rows)
}

fn losses(report: &LiteratureReport) -> Markup {
    let columns = [
        ("Nut speed, rpm", Kind::Number),
        ("VRF, %", Kind::Number),
        ("Compensated, %", Kind::Number),
        ("Copper, screw, W", Kind::Number),
        ("Copper, nut, W", Kind::Number),
        ("Friction, W", Kind::Number),
        ("Heat of the screw\u{2019}s winding, %", Kind::Number),
        ("Of the nut\u{2019}s, %", Kind::Number),
    ];
    let rows = report.warmth.points.iter().map(|point| {
        let [screw, nut] = point.copper_w;
        let [warm_screw, warm_nut] = point.winding_percent;
        [
            short(point.nut_rpm),
            two(Some(point.vrf_percent)),
            two(Some(point.compensated_percent)),
            two(Some(screw)),
            two(Some(nut)),
            two(Some(point.friction_w)),
            short(warm_screw.round()),
            short(warm_nut.round()),
        ]
    });
    table("Losses", columns, rows)
}

fn displacements(report: &LiteratureReport) -> Markup {
    let columns = [
        ("Drive", Kind::Text),
        ("Moved, um", Kind::Number),
        ("Closed form, um", Kind::Number),
        ("Rms, um", Kind::Number),
        ("mm/s", Kind::Number),
    ];
    let rows = report.switching.cases.iter().map(|case| {
        [
            case.name(),
            two(Some(case.moved_um)),
            two(Some(case.closed_form_um)),
            two(Some(case.rms_um)),
            two(Some(case.peak_mm_s)),
        ]
    });
    table("The table under the load", columns, rows)
}

fn ripples(report: &LiteratureReport) -> Markup {
    let columns = [
        ("Drive", Kind::Text),
        ("VRF, rigid screw, %", Kind::Number),
        ("VRF, screw that twists, %", Kind::Number),
    ];
    let rows = report.torsion.ripples.iter().map(|ripple| {
        let [rigid, twists] = ripple.vrf_percent;
        [
            drive_name(ripple.nut_rpm),
            two(Some(rigid)),
            two(Some(twists)),
        ]
    });
    table("Ripple with torsion", columns, rows)
}

/// What the simulations say, in a few sentences.
fn result(report: &LiteratureReport) -> String {
    let cases = &report.creep.cases;
    let slow = cases.first().map(|case| case.speed_rad_s);
    let lowest = |double: bool| {
        let of = cases
            .iter()
            .filter(|case| Some(case.speed_rad_s) == slow && (case.nut_rpm != 0.0) == double);
        of.filter_map(|case| case.lowest_mm_s).reduce(f64::min)
    };
    let warmth = &report.warmth;
    let proposed = [&warmth.proposed, &warmth.compensated].map(|one| {
        one.as_ref()
            .map_or_else(|| two(None), |choice| short(choice.nut_rpm))
    });
    format!(
        "Where friction upsets the speed loop, the single drive is stable down to {} mm/s and the double drive down to {} mm/s. At {} mm/s \
         {} rpm are proposed without compensation, and {} rpm with it.",
        micro(lowest(false)),
        micro(lowest(true)),
        short(warmth.table_mm_s),
        proposed[0],
        proposed[1]
    )
}

/// A part as a percentage.
fn percent(part: &f64) -> String {
    short(100.0 * part)
}

/// A value without decimals.
fn whole(value: &f64) -> String {
    short(value.round())
}

#[cfg(test)]
mod tests {
    use super::super::{creep, switching, torsion, tracking, warmth};
    use super::*;

    #[test]
    fn a_report_without_a_value_is_a_sound_page() {
        let friction = creep::FrictionReport {
            bearing_nm: 0.04,
            pair_nm: 0.03,
            guideway_n: 20.0,
            sticks: [1.0, 0.5],
            stribeck_mm_s: 0.2,
            presliding_um: 2.0,
        };
        let hollow = LiteratureReport {
            seed: 4711,
            creep: creep::CreepReport {
                friction,
                ripple_percent: 25.0,
                critical_mm_s: None,
                cases: vec![creep::CreepCase {
                    nut_rpm: 0.0,
                    speed_rad_s: 50.0,
                    lowest_mm_s: None,
                    points: Vec::new(),
                }],
            },
            tracking: tracking::TrackingReport {
                amplitude_um: 50.0,
                hz: 0.2,
                largest_mm_s: 0.06,
                speed_rad_s: 200.0,
                times: f64::NAN,
                cases: Vec::new(),
            },
            warmth: warmth::WarmthReport {
                table_mm_s: 2.5,
                load_n: 400.0,
                points: Vec::new(),
                proposed: None,
                compensated: None,
            },
            switching: switching::SwitchingReport {
                table_mm_s: 2.5,
                share: 0.5,
                load_nm: 0.3,
                switches_s: 0.25,
                less_percent: [f64::NAN; 2],
                cases: Vec::new(),
            },
            torsion: torsion::TorsionReport {
                shaft_mm: [20.0, 1000.0],
                damping_ratio: 0.01,
                held_hz: [f64::NAN, 795.0],
                free_hz: [f64::NAN, 858.0],
                rigid: Vec::new(),
                twisting: Vec::new(),
                ripples: Vec::new(),
            },
        };
        let page = page(&hollow);
        page::check::sound(&page).unwrap();
        assert!(page.contains("seed 4711"), "no seed in:\n{page}");
        assert!(
            page.contains("stable down to -\u{A0}mm/s"),
            "no dash for a velocity in:\n{page}"
        );
    }
}
