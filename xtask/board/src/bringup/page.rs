//! The page.

use super::{Item, Report, Verdict};
use askama::Template;
use page::axis::Axis;
use page::chart::{COOL, Chart, INK, MUTED, Mark, Series, THIRD, WARM, chart};
use page::document::{document, legend};
use page::markup::Markup;

/// `bringup.html`.
#[must_use]
pub fn page(report: &Report) -> String {
    let of = |verdict| report.of(verdict).collect();
    let body = Body {
        report,
        told: [
            ("Findings", of(Verdict::Finding)),
            ("Could not be told", of(Verdict::Open)),
        ],
        settling: settling(report),
    };
    document("Bring-up of the board", &body)
}

#[derive(Template)]
#[template(path = "bringup.html")]
struct Body<'a> {
    report: &'a Report,
    /// Items of one verdict, with what they mean.
    told: [(&'a str, Vec<&'a Item>); 2],
    settling: Option<Settling>,
}

struct Settling {
    shown: usize,
    drawn: Markup,
    legend: Markup,
}

/// Error over sampling time.
fn settling(report: &Report) -> Option<Settling> {
    // Half a count is what rounding leaves; a board on which all settle shows a line at the bottom.
    const LEAST: f64 = 0.5;
    const MOST: f64 = 10.0;
    let inks = [WARM, COOL, THIRD, INK, MUTED];
    let worst = |points: &[(f64, f64)]| points.iter().map(|p| p.1).fold(0.0, f64::max);
    let mut sorted: Vec<_> = report.settling.iter().collect();
    sorted.sort_by(|a, b| worst(&b.1).total_cmp(&worst(&a.1)));
    let shown = &sorted[..sorted.len().min(inks.len())];
    if shown.is_empty() {
        return None;
    }
    let series = shown.iter().zip(inks).map(|((_, points), color)| Series {
        points: points.iter().map(|p| (p.0, p.1.max(LEAST))).collect(),
        color,
        mark: Mark::Line(2.0),
    });
    let drawn = chart(&Chart {
        about: "How far each channel is from where it settles, over the sampling time",
        x: Axis {
            title: "sampling time, ns",
            range: None,
            log: true,
        },
        y: Axis {
            title: "error, counts",
            range: Some(
                LEAST
                    ..sorted
                        .first()
                        .map_or(MOST, |(_, points)| worst(points).max(MOST)),
            ),
            log: true,
        },
        series: series.collect(),
        labels: Vec::new(),
    });
    let names: Vec<_> = shown
        .iter()
        .zip(inks)
        .map(|((name, _), color)| (color, Mark::Line(2.0), name.clone()))
        .collect();
    Some(Settling {
        shown: shown.len(),
        drawn,
        legend: legend(&names),
    })
}

fn same_group(a: &Item, b: &Item) -> bool {
    a.group == b.group
}

fn sources(items: &[Item]) -> String {
    let mut sources: Vec<&str> = items.iter().map(|item| item.source).collect();
    sources.dedup();
    sources.join("; ")
}
