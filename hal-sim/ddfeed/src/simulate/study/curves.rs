//! The curves that explain the figures: `S` over frequency, and ripple over the nut's speed.

use super::report::Report;
use askama::Template;
use page::axis::{Axis, extent, widen};
use page::chart::{
    COOL as DDFS, Chart, INK, Label, MUTED, Mark, Series, THIRD as PAPER, WARM as CDFS, chart,
};
use page::document::{figure, legend, short, standalone};
use page::markup::Markup;

const CURVE: Mark = Mark::Line(1.5);

pub(super) fn sensitivity(report: &Report) -> Markup {
    let found = &report.sensitivity;
    let marks: Vec<_> = found
        .marks
        .iter()
        .map(|mark| (mark.omega, mark.gain))
        .collect();
    let labels = found.marks.iter().map(|mark| Label {
        at: (mark.omega, mark.gain),
        text: mark.name.clone(),
        color: INK,
    });
    let axis = |title| Axis {
        title,
        range: None,
        log: true,
    };
    let plot = chart(&Chart {
        about: "Bode magnitude of S(s), electrical speed per torque, with the torque harmonics of the runs",
        x: axis("Angular frequency, rad/s"),
        y: axis("|S|, rad/s (el.) per N m"),
        series: vec![
            Series {
                points: found.analytic.clone(),
                color: MUTED,
                mark: CURVE,
            },
            Series {
                points: found.ideal.clone(),
                color: DDFS,
                mark: Mark::Cross,
            },
            Series {
                points: found.measured.clone(),
                color: CDFS,
                mark: Mark::Dot,
            },
            Series {
                points: marks,
                color: INK,
                mark: Mark::Ring,
            },
        ],
        labels: labels.collect(),
    });
    Markup::of(&Sensitivity {
        legend: sensitivity_legend(report),
        plot,
    })
}

fn sensitivity_legend(report: &Report) -> Markup {
    let found = &report.sensitivity;
    let mut keys = vec![(MUTED, CURVE, "analytic, Appendix A".into())];
    if !found.ideal.is_empty() {
        keys.push((
            DDFS,
            Mark::Cross,
            "simulated drive, sine torque injected, ideal sensors".into(),
        ));
    }
    if !found.measured.is_empty() {
        let name = format!("the same, {} sensors", report.setup.sensors);
        keys.push((CDFS, Mark::Dot, name));
    }
    if !found.marks.is_empty() {
        let runs: Vec<_> = report
            .runs
            .iter()
            .zip('A'..='Z')
            .map(|(run, letter)| match run.nut_rpm == 0.0 {
                true => format!("{letter} CDFS"),
                false => format!("{letter} nut {} rpm", short(run.nut_rpm)),
            })
            .collect();
        keys.push((
            INK,
            Mark::Ring,
            format!(
                "torque harmonics of the screw\u{2019}s motor: {}",
                runs.join(", ")
            ),
        ));
    }
    legend(&keys)
}

#[derive(Template)]
#[template(path = "sensitivity.html")]
struct Sensitivity {
    legend: Markup,
    plot: Markup,
}

pub(super) fn curve(report: &Report) -> Markup {
    let mut keys = vec![
        (MUTED, CURVE, "analytic, S(s)".into()),
        (DDFS, Mark::Dot, "simulated drive".into()),
    ];
    if !learned_points(report).is_empty() {
        keys.push((CDFS, Mark::Ring, "after learning".into()));
    }
    if !report.curve.measured.is_empty() {
        keys.push((PAPER, Mark::Cross, "measured in the paper".into()));
    }
    figure(
        "VRF against nut speed (the paper\u{2019}s Fig 9)",
        &[legend(&keys), curve_plot(report)],
    )
}

/// The plot of VRF against nut speed, as a file of its own.
pub(crate) fn picture(report: &Report) -> String {
    standalone(&curve_plot(report))
}

fn curve_plot(report: &Report) -> Markup {
    let simulated: Vec<_> = report
        .runs
        .iter()
        .map(|run| (run.nut_rpm, run.vrf_percent))
        .collect();
    let found = &report.curve;
    let learned = learned_points(report);
    let points = || {
        simulated
            .iter()
            .chain(&learned)
            .chain(&found.analytic)
            .chain(&found.measured)
    };
    let speeds = extent(points().map(|p| p.0)).map(|r| widen(&r, 0.04));
    let ripples = extent(points().map(|p| p.1)).map(|r| 0.0..1.08 * r.end);
    chart(&Chart {
        about: "Velocity ripple factor against the nut's speed",
        x: Axis {
            title: "Nut speed, rpm",
            range: speeds,
            log: false,
        },
        y: Axis {
            title: "VRF, %",
            range: ripples,
            log: false,
        },
        series: vec![
            Series {
                points: found.analytic.clone(),
                color: MUTED,
                mark: CURVE,
            },
            Series {
                points: found.measured.clone(),
                color: PAPER,
                mark: Mark::Cross,
            },
            Series {
                points: simulated,
                color: DDFS,
                mark: Mark::Dot,
            },
            Series {
                points: learned.clone(),
                color: CDFS,
                mark: Mark::Ring,
            },
        ],
        labels: Vec::new(),
    })
}

/// Ripple of the drive that has learned, where it was measured: (nut rpm, %).
fn learned_points(report: &Report) -> Vec<(f64, f64)> {
    let runs = report.runs.iter();
    runs.filter_map(|run| Some((run.nut_rpm, run.learned_percent?)))
        .collect()
}
