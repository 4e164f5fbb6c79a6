//! `ripple.html`: time, spectrum and orders of each hold.

use super::HoldRipple;
use askama::Template;
use hal_sim::experiment::RPM;
use hal_sim::hold_ripple::bandwidth_hz;
use page::axis::{Axis, extent};
use page::chart::{COOL, Chart, Label, Mark, REFERENCE, Series, chart};
use page::document::{document, figure, short, two};
use page::markup::Markup;
use page::table::{Kind, table};
use std::path::Path;

/// Lines that the picture names: more would print over each other.
const NAMED: usize = 4;
const FINE: Mark = Mark::Line(1.2);

/// The page.
pub fn page(file: &Path, all: &[HoldRipple]) -> String {
    let file = file.display().to_string();
    let bandwidth = all
        .first()
        .map_or(0.0, |hold| bandwidth_hz(hold.interval_s));
    document(
        "Ripple of the table velocity",
        &Body {
            file: &file,
            bandwidth: short(bandwidth.round()),
            summary: summary(all),
            figures: all.iter().map(one).collect(),
        },
    )
}

#[derive(Template)]
#[template(path = "ripple.html")]
struct Body<'a> {
    file: &'a str,
    bandwidth: String,
    summary: Markup,
    figures: Vec<Markup>,
}

fn name(hold: &HoldRipple) -> String {
    format!(
        "{} mm/s, nut {} rpm",
        short(1e3 * hold.point.velocity),
        short((hold.point.base / RPM).round())
    )
}

fn summary(all: &[HoldRipple]) -> Markup {
    table(
        "Ripple of each hold",
        [
            ("Hold", Kind::Text),
            ("Peak to peak (Eq 19), %", Kind::Number),
            ("rms, %", Kind::Number),
        ],
        all.iter().map(|hold| {
            let ripple = [hold.ripple.vrf_percent, hold.ripple.rms_percent];
            let [vrf, rms] = ripple.map(|percent| two(Some(percent)));
            [name(hold), vrf, rms]
        }),
    )
}

fn one(hold: &HoldRipple) -> Markup {
    let asked = 1e3 * hold.point.velocity;
    let instants = (0..).map(|k| f64::from(k) * hold.interval_s);
    let points: Vec<(f64, f64)> = instants.zip(hold.mm_s.iter().copied()).collect();
    let end = points.last().map_or(0.0, |last| last.0);
    let series = |points, color| Series {
        points,
        color,
        mark: FINE,
    };
    let title = name(hold);
    let time = chart(&Chart {
        about: &format!("Table velocity over time: {title}"),
        x: axis("Time, s"),
        y: axis("Table velocity, mm/s"),
        series: vec![
            series(points, COOL),
            series(vec![(0.0, asked), (end, asked)], REFERENCE),
        ],
        labels: Vec::new(),
    });
    let highest =
        extent(hold.spectrum.iter().map(|line| line.1)).map(|range| 0.0..1.12 * range.end);
    let labels = hold.lines.iter().take(NAMED).map(|line| Label {
        at: (line.hz, line.mm_s),
        text: line
            .orders
            .first()
            .cloned()
            .unwrap_or_else(|| format!("{:.1} Hz", line.hz)),
        color: COOL,
    });
    let spectrum = chart(&Chart {
        about: &format!("Amplitude spectrum of the table velocity: {title}"),
        x: axis("Frequency, Hz"),
        y: Axis {
            range: highest,
            ..axis("Amplitude, mm/s")
        },
        series: vec![series(hold.spectrum.clone(), COOL)],
        labels: labels.collect(),
    });
    let lines = table(
        &format!("Strongest lines: {title}"),
        [
            ("Frequency, Hz", Kind::Number),
            ("Amplitude, mm/s", Kind::Number),
            ("Whole order of a turn", Kind::Long),
        ],
        hold.lines.iter().map(|line| {
            [
                format!("{:.1}", line.hz),
                format!("{:.5}", line.mm_s),
                line.orders.join(", or "),
            ]
        }),
    );
    let pair = Markup::of(&Pair { time, spectrum });
    figure(&title, &[pair, lines])
}

fn axis(title: &str) -> Axis<'_> {
    Axis {
        title,
        range: None,
        log: false,
    }
}

#[derive(Template)]
#[template(path = "ripple_pair.html")]
struct Pair {
    time: Markup,
    spectrum: Markup,
}
