//! The page.

use super::{Item, Report, Verdict};
use page::axis::Axis;
use page::chart::{COOL, Chart, INK, MUTED, Mark, Series, THIRD, WARM, chart};
use page::document::{document, escape, legend};

/// `bringup.html`.
#[must_use]
pub fn page(report: &Report) -> String {
    let body = format!(
        "<p class=\"result\">{}</p>\n{}{}{}{}{}",
        escape(&report.result),
        told(report, Verdict::Finding, "Findings"),
        told(report, Verdict::Open, "Could not be told"),
        settling(report),
        all(report),
        FOOT,
    );
    document("Bring-up of the board", &body)
}

const FOOT: &str = "<footer>\n<h2>What this cannot see</h2>\n<p>Pull resistors cannot tell a pin that the power stage holds low from \
     one that is shorted to ground, nor see a short between two pins that are both held low: measure those with an \
     ohmmeter, board off. No transistor was switched, so gate drivers, bootstrap supplies, transistors and motors are not \
     tested, nor is the sign of a current channel. Sources marked as memory are from knowledge of the document, which \
     could not be read again.</p>\n</footer>\n";

/// The items of one verdict, with what they mean.
fn told(report: &Report, verdict: Verdict, title: &str) -> String {
    let rows: String = report
        .of(verdict)
        .map(|item| {
            format!(
                "<tr><th scope=\"row\" class=\"text\">{}<br/><small>{}</small></th><td class=\"long\">expected: {}<br/>read: {}</td>\
                 <td class=\"means\">{} {}</td></tr>\n",
                escape(&item.what),
                escape(item.group),
                escape(&item.expected),
                escape(&item.read),
                escape(&item.means),
                escape(&item.todo),
            )
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    format!(
        "<h2>{title}</h2>\n<div class=\"scroll\" role=\"region\" aria-label=\"{title}\" tabindex=\"0\">\n<table>\n\
         <thead><tr><th scope=\"col\">What</th><th scope=\"col\" class=\"text\">Expected, and read</th>\
         <th scope=\"col\" class=\"text\">What it means, and what to do</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

/// Error over sampling time.
fn settling(report: &Report) -> String {
    // Half a count is what rounding leaves; a board on which all settle shows a line at the bottom.
    const LEAST: f64 = 0.5;
    const MOST: f64 = 10.0;
    let inks = [WARM, COOL, THIRD, INK, MUTED];
    let worst = |points: &[(f64, f64)]| points.iter().map(|p| p.1).fold(0.0, f64::max);
    let mut sorted: Vec<_> = report.settling.iter().collect();
    sorted.sort_by(|a, b| worst(&b.1).total_cmp(&worst(&a.1)));
    let shown = &sorted[..sorted.len().min(inks.len())];
    if shown.is_empty() {
        return String::new();
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
    format!(
        "<figure>\n<figcaption>How the sampled channels settle</figcaption>\n<p class=\"note\">Mean of {} conversions less \
         that at the longest sampling time, each after a conversion of the ADC's channel that stands farthest away; the {} \
         that are farthest off. Errors below half a count are drawn at half a count.</p>\n<div class=\"pair\">\n{drawn}</div>\n{}</figure>\n",
        link::bringup::CONVERSIONS,
        shown.len(),
        legend(&names)
    )
}

/// All items, by their groups.
fn all(report: &Report) -> String {
    let mut body = String::from("<h2>All readings</h2>\n");
    let mut rest = &report.items[..];
    while let [first, ..] = rest {
        let length = rest
            .iter()
            .take_while(|item| item.group == first.group)
            .count();
        let (group, after) = rest.split_at(length);
        body.push_str(&table(first.group, group));
        rest = after;
    }
    body
}

fn table(title: &str, items: &[Item]) -> String {
    let rows: String = items
        .iter()
        .map(|item| {
            let verdict = match item.verdict {
                Verdict::Good => "as expected",
                Verdict::Finding => "<b>finding</b>",
                Verdict::Open => "open",
            };
            format!(
                "<tr><th scope=\"row\" class=\"text\">{}</th><td class=\"long\">{}</td><td class=\"long\">{}</td>\
                 <td class=\"text\">{verdict}</td></tr>\n",
                escape(&item.what),
                escape(&item.expected),
                escape(&item.read),
            )
        })
        .collect();
    let mut sources: Vec<&str> = items.iter().map(|item| item.source).collect();
    sources.dedup();
    format!(
        "<h3>{title}</h3>\n<div class=\"scroll\" role=\"region\" aria-label=\"{title}\" tabindex=\"0\">\n<table>\n\
         <thead><tr><th scope=\"col\">What</th><th scope=\"col\" class=\"text\">Expected</th>\
         <th scope=\"col\" class=\"text\">Read</th><th scope=\"col\" class=\"text\">Verdict</th></tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n</div>\n<p class=\"note\">Expected by: {}.</p>\n",
        escape(&sources.join("; ")),
        title = escape(title),
    )
}
