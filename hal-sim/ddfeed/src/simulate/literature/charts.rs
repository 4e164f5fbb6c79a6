//! The charts of the later papers' results.

use super::creep::CreepReport;
use super::drive_name::drive_name;
use super::switching::SwitchingReport;
use super::torsion::TorsionReport;
use super::tracking::TrackingReport;
use super::warmth::{WarmthPoint, WarmthReport};
use page::axis::Axis;
use page::chart::{COOL, Chart, INK, Ink, MUTED, Mark, REFERENCE, Series, THIRD, WARM, chart};
use page::document::{figure, legend, short};
use page::markup::Markup;

const HEAVY: Mark = Mark::Line(2.5);
const FINE: Mark = Mark::Line(1.5);

/// A series with its name.
struct Named {
    points: Vec<(f64, f64)>,
    color: Ink,
    mark: Mark,
    name: String,
}

/// A figure of series that share axes.
fn drawn(caption: &str, axes: [Axis; 2], named: Vec<Named>) -> Markup {
    let [x, y] = axes;
    let keys: Vec<_> = named
        .iter()
        .map(|one| (one.color, one.mark, one.name.clone()))
        .collect();
    let series = named.into_iter().map(|one| Series {
        points: one.points,
        color: one.color,
        mark: one.mark,
    });
    let plot = chart(&Chart {
        about: caption,
        x,
        y,
        series: series.collect(),
        labels: Vec::new(),
    });
    figure(caption, &[legend(&keys), plot])
}

fn axis(title: &str, log: bool) -> Axis<'_> {
    Axis {
        title,
        range: None,
        log,
    }
}

/// CDFS and DDFS: how the lines of nut speeds differ.
fn ink(nut_rpm: f64, k: usize) -> (Ink, Mark) {
    match (nut_rpm == 0.0, k) {
        (true, _) => (WARM, HEAVY),
        (false, 1) => (COOL, FINE),
        (false, 2) => (THIRD, FINE),
        (false, _) => (INK, FINE),
    }
}

/// Ripple against the velocity.
pub fn creep(report: &CreepReport) -> Markup {
    let slow = report.cases.first().map(|case| case.speed_rad_s);
    let shown = || {
        let cases = report.cases.iter();
        cases.filter(|case| Some(case.speed_rad_s) == slow)
    };
    let mut named: Vec<_> = shown()
        .enumerate()
        .map(|(k, case)| {
            let (color, mark) = ink(case.nut_rpm, k);
            let points = case.points.iter();
            Named {
                points: points
                    .filter_map(|point| Some((point.mm_s, point.vrf_percent?)))
                    .collect(),
                color,
                mark,
                name: drive_name(case.nut_rpm),
            }
        })
        .collect();
    let span = || {
        let points = shown().flat_map(|case| &case.points);
        points.map(|point| point.mm_s)
    };
    let bound = report.ripple_percent;
    let ends = [
        span().fold(f64::INFINITY, f64::min),
        span().fold(0.0, f64::max),
    ];
    named.push(Named {
        points: ends.map(|mm_s| (mm_s, bound)).to_vec(),
        color: REFERENCE,
        mark: FINE,
        name: format!("bound, {bound} %"),
    });
    if let Some(critical) = report.critical_mm_s {
        named.push(Named {
            points: vec![(critical, bound)],
            color: INK,
            mark: Mark::Cross,
            name: "closed form: CDFS sticks and slips below".into(),
        });
    }
    let axes = [
        axis("Table velocity, mm/s", true),
        axis("Ripple, peak to peak, %", true),
    ];
    drawn("Ripple by friction alone", axes, named)
}

/// Error of a sine over time.
pub fn tracking(report: &TrackingReport) -> Markup {
    let shown = report
        .cases
        .iter()
        .filter(|case| (case.nut_rpm == 0.0 && !case.fed_forward) || case.nut_rpm >= 300.0);
    let named = shown
        .map(|case| {
            let (color, mark) = match (case.nut_rpm == 0.0, case.fed_forward) {
                (true, _) => (WARM, HEAVY),
                (false, false) => (COOL, FINE),
                (false, true) => (THIRD, FINE),
            };
            let forward = if case.fed_forward {
                ", friction fed forward"
            } else {
                ""
            };
            Named {
                points: case.error_um.clone(),
                color,
                mark,
                name: format!("{}{forward}", drive_name(case.nut_rpm)),
            }
        })
        .collect();
    let axes = [axis("Time, s", false), axis("Position error, um", false)];
    drawn("Error of a sine at creep speed", axes, named)
}

/// Losses against the common speed.
pub fn warmth(report: &WarmthReport) -> Markup {
    let line = |name: &str, color, mark, of: &dyn Fn(&WarmthPoint) -> f64| Named {
        points: report.points.iter().map(|p| (p.nut_rpm, of(p))).collect(),
        color,
        mark,
        name: name.into(),
    };
    let mut named = vec![
        line("all losses", INK, HEAVY, &WarmthPoint::total_w),
        line("friction", WARM, FINE, &|p| p.friction_w),
        line("friction, torque times speed", WARM, Mark::Cross, &|p| {
            p.friction_closed_form_w
        }),
        line("copper, screw", COOL, FINE, &|p| p.copper_w[0]),
        line("copper, nut", THIRD, FINE, &|p| p.copper_w[1]),
    ];
    for (how, choice, mark) in [
        ("without compensation", &report.proposed, Mark::Ring),
        ("compensated", &report.compensated, Mark::Dot),
    ] {
        if let Some((nut_rpm, loss_w)) = choice.and_then(|one| Some((one.nut_rpm, one.loss_w?))) {
            named.push(Named {
                points: vec![(nut_rpm, loss_w)],
                color: INK,
                mark,
                name: format!("proposed {how}: {} rpm", short(nut_rpm)),
            });
        }
    }
    let axes = [axis("Nut speed, rpm", false), axis("Loss, W", false)];
    drawn("Losses against the common speed", axes, named)
}

/// Ripple against the common speed.
pub fn ripple(report: &WarmthReport) -> Markup {
    let line = |name: &str, color, of: fn(&WarmthPoint) -> f64| Named {
        points: report.points.iter().map(|p| (p.nut_rpm, of(p))).collect(),
        color,
        mark: FINE,
        name: name.into(),
    };
    let named = vec![
        line("without compensation", WARM, |p| p.vrf_percent),
        line("compensated", COOL, |p| p.compensated_percent),
    ];
    let axes = [axis("Nut speed, rpm", false), axis("Ripple, %", true)];
    drawn("Ripple against the common speed", axes, named)
}

/// Error of the table while the load switches.
pub fn switching(report: &SwitchingReport) -> Markup {
    let named = report
        .cases
        .iter()
        .map(|case| {
            let (color, mark) = match (case.nut_rpm == 0.0, case.share == 0.0) {
                (true, _) => (WARM, HEAVY),
                (false, true) => (COOL, FINE),
                (false, false) => (THIRD, FINE),
            };
            Named {
                points: case.error_um.clone(),
                color,
                mark,
                name: case.name(),
            }
        })
        .collect();
    let axes = [axis("Time, s", false), axis("Position error, um", false)];
    drawn("Error while the load switches", axes, named)
}

/// Response of the screw.
pub fn torsion(report: &TorsionReport) -> Markup {
    let gain_at = |hz: f64| {
        let points = report.twisting.iter();
        let near = points.min_by(|a, b| (a.0 - hz).abs().total_cmp(&(b.0 - hz).abs()));
        near.map_or(f64::NAN, |point| point.1)
    };
    let closed = [report.held_hz[1], report.free_hz[1]];
    let named = vec![
        Named {
            points: report.rigid.clone(),
            color: MUTED,
            mark: FINE,
            name: "rigid screw".into(),
        },
        Named {
            points: report.twisting.clone(),
            color: COOL,
            mark: HEAVY,
            name: "screw that twists".into(),
        },
        Named {
            points: closed.map(|hz| (hz, gain_at(hz))).to_vec(),
            color: INK,
            mark: Mark::Ring,
            name: "closed form".into(),
        },
    ];
    let axes = [
        axis("Frequency, Hz", false),
        axis("Speed for torque, rad/s (el.) per N m", true),
    ];
    drawn("Torque to speed of the screw", axes, named)
}
