//! The tables: effects, residuals, hypotheses, what was refined, what became of the rows.

use super::words::{self, number};
use crate::records::DataQuality;
use crate::report::Report;
use page::document::escape;

/// A table that scrolls where it is too wide.
fn table(about: &str, head: &str, rows: &str) -> String {
    format!(
        "<div class=\"scroll\" role=\"region\" aria-label=\"{about}\" tabindex=\"0\">\n<table>\n<thead><tr>{head}</tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

pub(super) fn effects(report: &Report) -> String {
    if report.effects.is_empty() {
        return String::new();
    }
    let mut rows = String::new();
    for effect in &report.effects {
        for (k, (name, value)) in effect.parameters.iter().enumerate() {
            let first = |text: String| if k == 0 { text } else { String::new() };
            let ends = effect.interval.get(name).copied().unwrap_or([f64::NAN; 2]);
            rows += &format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td><td>{}</td><td>{}</td><td class=\"text\">{}</td>\
                 <td>{}</td></tr>\n",
                first(format!(
                    "{} ({})",
                    effect.kind.replace('_', " "),
                    effect.place
                )),
                escape(name),
                number(*value),
                words::interval(ends),
                effect.unit.get(name).map_or("", String::as_str),
                first(format!("{:.1} %", 100.0 * effect.explained)),
            );
        }
    }
    let notes: String = report
        .effects
        .iter()
        .flat_map(|effect| [words::held_back(effect), words::not_separable(effect)])
        .flatten()
        .map(|note| format!("<p class=\"note\">{}</p>\n", escape(&note)))
        .collect();
    format!(
        "<section>\n<h2>Effects</h2>\n{}{notes}</section>\n",
        table(
            "Effects",
            "<th scope=\"col\">Effect</th><th scope=\"col\" class=\"text\">Parameter</th><th scope=\"col\">Value</th>\
             <th scope=\"col\">95 % interval</th><th scope=\"col\" class=\"text\">Unit</th><th scope=\"col\">Explains</th>",
            &rows
        )
    )
}

/// What to do about each effect, and what of the ripple goes with it.
pub(super) fn remedies(report: &Report) -> String {
    if report.effects.is_empty() {
        return String::new();
    }
    let rows: String = report
        .effects
        .iter()
        .map(|effect| {
            let gain = match report.ripple_without(effect) {
                Some([with, without]) => {
                    format!("ripple {} \u{2192} {} %", number(with), number(without))
                }
                None => format!("{:.0} % of the residual", 100.0 * effect.explained),
            };
            let (what, how) = words::remedy(&effect.kind);
            format!(
                "<tr><th scope=\"row\">{} ({})</th><td class=\"text\">{what}</td><td class=\"long\">{how}</td><td>{gain}</td></tr>\n",
                effect.kind.replace('_', " "),
                effect.place,
            )
        })
        .collect();
    format!(
        "<section>\n<h2>What to do</h2>\n<p class=\"note\">The gain is by simulation of the check record\u{2019}s speeds, with \
         and without the effects, shared out by what each explains; without a simulation it is the share of the residual.</p>\n{}\
         </section>\n",
        table(
            "What to do about each effect",
            "<th scope=\"col\">Effect</th><th scope=\"col\" class=\"text\">Do</th><th scope=\"col\" class=\"text\">How</th>\
             <th scope=\"col\">Expected gain</th>",
            &rows
        )
    )
}

pub(super) fn residuals(report: &Report) -> String {
    let rows: String = report
        .residual
        .iter()
        .map(|f| {
            format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
                 <td>{:.0} %</td></tr>\n",
                f.channel,
                f.unit,
                number(f.fit_before),
                number(f.fit_after),
                number(f.check_before),
                number(f.check_after),
                number(f.noise_floor),
                100.0 * f.whiteness
            )
        })
        .collect();
    format!(
        "<section>\n<h2>Residual before and after</h2>\n<p class=\"note\">Rms in the band that is used, plate values refined \
         within their tolerance both times. The parameters are those of the fit record; the check record is another run. \
         White: share of lags at which what is left does not correlate with itself; noise has 95 %. {}</p>\n{}</section>\n",
        escape(&report.derivatives),
        table(
            "Residuals",
            "<th scope=\"col\">Channel</th><th scope=\"col\" class=\"text\">Unit</th><th scope=\"col\">Fit before</th>\
             <th scope=\"col\">Fit after</th><th scope=\"col\">Check before</th><th scope=\"col\">Check after</th>\
             <th scope=\"col\">Noise floor</th><th scope=\"col\">White</th>",
            &rows
        )
    )
}

/// What was refused, how often, and why.
pub(super) fn refused(report: &Report) -> String {
    if report.refused.is_empty() {
        return String::new();
    }
    let rows: String = report
        .refused
        .iter()
        .map(|refusal| {
            format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td><td>{}</td><td class=\"long\">{}</td></tr>\n",
                escape(&refusal.hypothesis.replace('_', " ")),
                escape(&refusal.place),
                refusal.trials,
                escape(refusal.reason),
            )
        })
        .collect();
    let trials: usize = report.refused.iter().map(|refusal| refusal.trials).sum();
    format!(
        "<section>\n<h2>What was refused</h2>\n<p class=\"note\">{trials} trials were refused: the record does not excite \
         them, or their size is beyond physics.</p>\n{}</section>\n",
        table(
            "What was refused",
            "<th scope=\"col\">Hypothesis</th><th scope=\"col\" class=\"text\">Where</th><th scope=\"col\">Trials</th>\
             <th scope=\"col\" class=\"text\">Why</th>",
            &rows
        )
    )
}

pub(super) fn hypotheses(report: &Report) -> String {
    let selection = &report.selection;
    let rows: String = selection
        .trials
        .iter()
        .map(|trial| {
            format!(
                "<tr><th scope=\"row\">{}</th><td class=\"text\">{}</td><td>{}</td><td>{}</td><td class=\"long\">{}</td></tr>\n",
                escape(&trial.hypothesis.replace('_', " ")),
                trial.place,
                trial.shape.map_or_else(String::new, number),
                number(trial.fall),
                escape(&trial.outcome),
            )
        })
        .collect();
    format!(
        "<section>\n<h2>What was tried, and why it lost</h2>\n<p class=\"note\">{} {} hypotheses were tried; the threshold is \
         {}. Figure: {}.</p>\n{}</section>\n",
        escape(&selection.rule),
        selection.tried,
        number(selection.threshold),
        selection.measure,
        table(
            "Hypotheses",
            "<th scope=\"col\">Hypothesis</th><th scope=\"col\" class=\"text\">Where</th>\
             <th scope=\"col\">Order, Hz or speed</th><th scope=\"col\">Figure</th><th scope=\"col\" class=\"text\">Outcome</th>",
            &rows
        )
    )
}

pub(super) fn foot(report: &Report) -> String {
    let rows: String = report
        .calibration
        .iter()
        .map(|c| {
            let [value, sigma] = match c.value {
                Some(value) => {
                    let unit = c.unit.unwrap_or_default();
                    [value, c.sigma].map(|x| format!("{} {unit}", number(x)))
                }
                None => [
                    format!("{:+.2} %", 100.0 * c.relative_change),
                    format!("{:.2} %", 100.0 * c.sigma),
                ],
            };
            format!(
                "<tr><th scope=\"row\">{}</th><td>{value}</td><td>{sigma}</td></tr>\n",
                escape(&c.parameter)
            )
            .replace("<td>-", "<td>\u{2212}")
        })
        .collect();
    let refined = match rows.is_empty() {
        true => String::new(),
        false => format!(
            "<h2>Refined plate values</h2>\n<p>Refining a declared value is calibration, not an effect.</p>\n{}",
            table(
                "Refined plate values",
                "<th scope=\"col\">Parameter</th><th scope=\"col\">Change</th><th scope=\"col\">Deviation</th>",
                &rows
            )
        ),
    };
    let records: String = report.records.iter().map(account).collect();
    format!("<footer>\n{refined}<h2>Records</h2>\n{records}</footer>\n")
}

fn account(account: &DataQuality) -> String {
    let mut faults: Vec<String> = account
        .skipped
        .iter()
        .map(|s| {
            format!(
                "{} rows left out ({}, column {}, first in row {})",
                s.rows, s.rule, s.column, s.first_row
            )
        })
        .collect();
    if account.bridged > 0 {
        faults.push(format!("{} rows bridged over short gaps", account.bridged));
    }
    if account.cut > 0 {
        faults.push(format!("{} rows beyond a long gap not used", account.cut));
    }
    let faults = match faults.is_empty() {
        true => "no faults".into(),
        false => faults.join("; "),
    };
    format!(
        "<p>{}: {} rows read, {} used; {}.</p>\n",
        escape(&account.file),
        account.rows,
        account.used,
        escape(&faults)
    )
}
