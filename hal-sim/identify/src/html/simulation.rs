//! The record's profile, measured and simulated.

use crate::report::{Hold, Simulation, Stage};
use page::axis::{Axis, extent};
use page::chart::{COOL, Chart, INK, MUTED, Mark, Series, WARM, chart};
use page::document::{figure, legend, short, two};
use page::markup::Markup;
use page::table::{Kind, table};

/// Holds whose spectra are drawn.
const DRAWN: usize = 4;
/// Lines of a spectrum that are marked.
const MARKED: usize = 8;
/// Lines nearer than this are one, Hz.
const APART_HZ: f64 = 5.0;
/// Measured, declared, new: rings, crosses and dots, distinguished without colour too.
const INKS: [(page::chart::Ink, Mark); 3] =
    [(INK, Mark::Ring), (WARM, Mark::Cross), (COOL, Mark::Dot)];

/// Ripple of each hold.
pub(super) fn holds(simulation: &Simulation) -> Markup {
    let rows = simulation.holds.iter().map(|hold| {
        [
            format!("{} s", two(Some(hold.start_s))),
            two(Some(hold.table_mm_s)),
            short(hold.nut_rpm.round()),
            two(Some(hold.measured_vrf_percent)),
            two(Some(hold.declared_vrf_percent)),
            two(Some(hold.new_vrf_percent)),
        ]
    });
    let columns = [
        "From",
        "Table, mm/s",
        "Nut, rpm",
        "Measured, %",
        "Declared model, %",
        "New model, %",
    ];
    table(
        "Ripple by hold",
        columns.map(|head| (head, Kind::Number)),
        rows,
    )
}

/// The key of the figures.
pub(super) fn key() -> Markup {
    let keys = [
        "measured",
        "simulated, declared model",
        "simulated, new model",
    ];
    let keys: Vec<_> = INKS
        .iter()
        .zip(keys)
        .map(|((color, mark), name)| (*color, *mark, name.to_owned()))
        .collect();
    legend(&keys)
}

/// Spectra of the holds at which the two models differ most: there is most to see.
pub(super) fn figures(simulation: &Simulation) -> Vec<Markup> {
    let mut holds: Vec<&Hold> = simulation.holds.iter().collect();
    let gap = |hold: &Hold| (hold.declared_vrf_percent - hold.new_vrf_percent).abs();
    holds.sort_by(|a, b| gap(b).total_cmp(&gap(a)));
    holds.into_iter().take(DRAWN).map(spectra).collect()
}

fn spectra(hold: &Hold) -> Markup {
    let caption = format!(
        "Velocity spectrum, table {} mm/s, nut {} rpm",
        short(hold.table_mm_s),
        short(hold.nut_rpm.round())
    );
    let most = extent(hold.spectra.iter().flatten().map(|p| p.1)).map_or(1.0, |r| r.end);
    let last = extent(hold.spectra.iter().flatten().map(|p| p.0)).map_or(1.0, |r| r.end);
    let lines = highest(&hold.spectra[0]);
    let near = |points: &[(f64, f64)], hz: f64| {
        let near = points.iter().filter(|p| (p.0 - hz).abs() < APART_HZ);
        near.map(|p| p.1).fold(0.0, f64::max)
    };
    let measured = Series {
        points: hold.spectra[0].clone(),
        color: MUTED,
        mark: Mark::Line(1.5),
    };
    // Dots first: a ring and a cross still show on them.
    let marked = hold
        .spectra
        .iter()
        .zip(INKS)
        .rev()
        .map(|(points, (color, mark))| Series {
            points: lines.iter().map(|hz| (*hz, near(points, *hz))).collect(),
            color,
            mark,
        });
    let series = std::iter::once(measured).chain(marked).collect();
    let svg = chart(&Chart {
        about: &caption,
        x: Axis {
            title: "Frequency, Hz",
            range: Some(0.0..last),
            log: false,
        },
        y: Axis {
            title: "Amplitude, mm/s",
            range: Some(0.0..1.1 * most),
            log: false,
        },
        series,
        labels: Vec::new(),
    });
    figure(&caption, &[svg])
}

/// Frequencies of a spectrum's highest lines.
fn highest(spectrum: &[(f64, f64)]) -> Vec<f64> {
    let mut points: Vec<_> = spectrum.iter().filter(|p| p.1.is_finite()).collect();
    points.sort_by(|a, b| b.1.total_cmp(&a.1));
    let most = points.first().map_or(0.0, |p| p.1);
    let mut lines: Vec<f64> = Vec::new();
    for (hz, amplitude) in points {
        let new = lines.iter().all(|line| (line - hz).abs() > 2.0 * APART_HZ);
        if new && lines.len() < MARKED && *amplitude > 0.05 * most {
            lines.push(*hz);
        }
    }
    lines
}

/// Closed-loop errors, effect by effect.
pub(super) fn stages(stages: &[Stage]) -> Markup {
    let rows = stages.iter().map(|stage| {
        [
            stage.added.clone(),
            two(Some(stage.fit.force_percent)),
            two(Some(stage.check.force_percent)),
            two(Some(stage.check_homed.force_percent)),
            format!("{:.3}", stage.check_homed.velocity_percent),
            two(Some(stage.check_homed.position_um)),
        ]
    });
    let columns = [
        "Added",
        "Fit, %",
        "Check, %",
        "Check, homed, %",
        "Velocity, %",
        "Position, \u{B5}m",
    ];
    table(
        "Errors by stage",
        columns.map(|head| (head, Kind::Number)),
        rows,
    )
}
