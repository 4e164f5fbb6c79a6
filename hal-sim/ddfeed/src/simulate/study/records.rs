//! Time records and spectra of the table velocity, as in the paper's Figs 6 to 8.

use super::report::{Report, RunReport, SetupReport};
use askama::Template;
use page::axis::{Axis, extent, widen};
use page::chart::{COOL as DDFS, Chart, Label, Mark, REFERENCE, Series, WARM as CDFS, chart};
use page::document::{figure, legend, short, two};
use page::markup::Markup;
use plotters::style::RGBColor;
use std::ops::Range;

/// Weights of the lines, px: CDFS differs from DDFS without colour too.
const HEAVY: Mark = Mark::Line(2.5);
const FINE: Mark = Mark::Line(1.2);

/// Time records and spectra: each DDFS run against CDFS where there is one, else each run alone. All have the same
/// axes, so that they compare.
pub(super) fn records(report: &Report) -> Vec<Markup> {
    let cdfs = report.cdfs();
    let moving: Vec<_> = report
        .runs
        .iter()
        .filter(|run| run.nut_rpm != 0.0)
        .collect();
    let alone: Vec<&RunReport> = if moving.is_empty() {
        cdfs.into_iter().collect()
    } else {
        moving
    };
    let velocities = report
        .runs
        .iter()
        .flat_map(|run| run.velocity_mm_s.iter().copied());
    let velocity = extent(velocities.chain([report.setup.table_mm_s])).map(|r| widen(&r, 0.06));
    let lines = report.runs.iter().flat_map(|run| run.spectrum.iter());
    let amplitude = extent(lines.map(|line| line.1)).map(|r| 0.0..1.12 * r.end);
    alone
        .into_iter()
        .map(|run| {
            let mut shown = vec![run];
            shown.extend(cdfs.filter(|cdfs| cdfs.nut_rpm != run.nut_rpm));
            compared(&report.setup, &shown, velocity.clone(), amplitude.clone())
        })
        .collect()
}

/// Ink and weight of a run.
fn ink(run: &RunReport) -> (RGBColor, Mark) {
    match run.nut_rpm == 0.0 {
        true => (CDFS, HEAVY),
        false => (DDFS, FINE),
    }
}

fn series(run: &RunReport, points: Vec<(f64, f64)>) -> Series {
    let (color, mark) = ink(run);
    Series {
        points,
        color,
        mark,
    }
}

fn compared(
    setup: &SetupReport,
    runs: &[&RunReport],
    velocity: Option<Range<f64>>,
    amplitude: Option<Range<f64>>,
) -> Markup {
    let heading = runs
        .iter()
        .map(|run| run.name())
        .collect::<Vec<_>>()
        .join(" against ");
    let mut keys: Vec<_> = runs
        .iter()
        .map(|run| {
            let (color, mark) = ink(run);
            let name = format!("{}: VRF {} %", run.name(), two(Some(run.vrf_percent)));
            (color, mark, name)
        })
        .collect();
    keys.push((
        REFERENCE,
        FINE,
        format!("reference {} mm/s", short(setup.table_mm_s)),
    ));
    let counterpart = paper_figure(setup, runs)
        .map_or_else(String::new, |n| format!(" (the paper\u{2019}s Fig {n})"));
    let parts = Markup::of(&Pair {
        legend: legend(&keys),
        record: record_plot(setup, runs, velocity, &heading),
        spectrum: spectrum_plot(runs, amplitude, &heading),
    });
    figure(&format!("{heading}{counterpart}"), &[parts])
}

/// Table velocities over time, mm/s.
fn record_plot(
    setup: &SetupReport,
    runs: &[&RunReport],
    velocity: Option<Range<f64>>,
    heading: &str,
) -> Markup {
    let mut time: Vec<_> = runs
        .iter()
        .map(|run| {
            let instants = (0..).map(|k| f64::from(k) / setup.record_hz);
            series(
                run,
                instants.zip(run.velocity_mm_s.iter().copied()).collect(),
            )
        })
        .collect();
    let samples = runs
        .iter()
        .map(|run| run.velocity_mm_s.len())
        .max()
        .filter(|n| *n > 0);
    let end = samples.map(|n| n as f64 / setup.record_hz);
    if let Some(end) = end {
        let points = vec![(0.0, setup.table_mm_s), (end, setup.table_mm_s)];
        time.push(Series {
            points,
            color: REFERENCE,
            mark: FINE,
        });
    }
    chart(&Chart {
        about: &format!("Table velocity over time: {heading}"),
        x: Axis {
            title: "Time, s",
            range: end.map(|end| 0.0..end),
            log: false,
        },
        y: Axis {
            title: "Table velocity, mm/s",
            range: velocity,
            log: false,
        },
        series: time,
        labels: Vec::new(),
    })
}

/// Amplitude spectra of the table velocities, mm/s.
fn spectrum_plot(runs: &[&RunReport], amplitude: Option<Range<f64>>, heading: &str) -> Markup {
    // The fine line last: it would vanish beneath the heavy one's foot.
    let spectra: Vec<_> = runs
        .iter()
        .rev()
        .map(|run| series(run, run.spectrum.clone()))
        .collect();
    let last = extent(spectra.iter().flat_map(|s| s.points.iter().map(|p| p.0)));
    let last = last.map(|r| 0.0..100.0 * (r.end / 100.0).ceil());
    let labels = runs
        .iter()
        .filter_map(|run| peak(run, ink(run).0))
        .collect();
    chart(&Chart {
        about: &format!("Amplitude spectrum of the table velocity: {heading}"),
        x: Axis {
            title: "Frequency, Hz",
            range: last,
            log: false,
        },
        y: Axis {
            title: "Amplitude, mm/s",
            range: amplitude,
            log: false,
        },
        series: spectra,
        labels,
    })
}

#[derive(Template)]
#[template(path = "record.html")]
struct Pair {
    legend: Markup,
    record: Markup,
    spectrum: Markup,
}

/// The figure of the paper that shows the same comparison.
fn paper_figure(setup: &SetupReport, runs: &[&RunReport]) -> Option<u32> {
    let [ddfs, _cdfs] = runs else { return None };
    let figures = [(300.0, 6), (500.0, 7), (800.0, 8)];
    let found = figures.into_iter().find(|(rpm, _)| *rpm == ddfs.nut_rpm)?;
    setup.is_paper.then_some(found.1)
}

/// The highest line of a run's spectrum, named by its frequency.
fn peak(run: &RunReport, color: RGBColor) -> Option<Label> {
    let lines = run
        .spectrum
        .iter()
        .filter(|line| line.0.is_finite() && line.1.is_finite());
    let &at = lines.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Label {
        at,
        text: format!("{:.0} Hz", at.0),
        color,
    })
}
