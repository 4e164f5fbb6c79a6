//! The residuals in time to zoom into, with values under the pointer, and to download: by uPlot 1.6.32 (MIT, beside this
//! file with its licence), in the page itself. Where no script runs the section stays hidden; paper has it never.

use crate::report::{Channel, Report};
use askama::Template;
use page::markup::Markup;
use serde_json::json;

/// Channels whose rows go into the page: each has some hundred kilobytes.
const MOST: usize = 3;

/// Numbers with four significant digits, and null for what is none.
fn rounded(values: &[f64]) -> Vec<Option<f64>> {
    let round = |x: &f64| {
        format!("{x:.3e}")
            .parse()
            .ok()
            .filter(|x: &f64| x.is_finite())
    };
    values.iter().map(round).collect()
}

/// The section, its data and its scripts.
pub(super) fn section(channels: &[&Channel], report: &Report) -> Option<Markup> {
    let shown: Vec<_> = channels.iter().take(MOST).collect();
    if shown.is_empty() || report.time.is_empty() {
        return None;
    }
    let of = |channel: &&&Channel| {
        json!({
            "name": channel.name,
            "unit": channel.unit,
            "before": rounded(&channel.residual[0]),
            "after": rounded(&channel.residual[1]),
        })
    };
    let time: Vec<f64> = report
        .time
        .iter()
        .map(|t| (t * 1e5).round() / 1e5)
        .collect();
    let data = json!({ "time": time, "channels": shown.iter().map(of).collect::<Vec<_>>() });
    // Nothing in the data may end the element that it stands in.
    let data = data.to_string().replace('<', "\\u003c");
    Some(Markup::of(&Live { data }))
}

const STYLE: &str = include_str!("uplot/uPlot.min.css");
const PLOT: &str = include_str!("uplot/uPlot.iife.min.js");
const SCRIPT: &str = include_str!("live.js");

#[derive(Template)]
#[template(path = "live.html")]
struct Live {
    data: String,
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn what_is_no_number_is_null_and_the_rest_keeps_four_digits() {
        let text = serde_json::to_string(&rounded(&[f64::NAN, 0.0, -1.23456e-3])).unwrap();
        assert_eq!(text, "[null,0.0,-0.001235]");
    }
}
