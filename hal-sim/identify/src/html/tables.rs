//! The tables: effects, residuals, hypotheses, what was refined.

use super::remedies;
use super::words::{self, number};
use crate::report::Report;
use page::markup::Markup;
use page::table::{Kind, table};

pub(super) fn effects(report: &Report) -> Markup {
    let rows = report.effects.iter().flat_map(|effect| {
        effect
            .parameters
            .iter()
            .enumerate()
            .map(move |(k, (name, value))| {
                let first = |text: String| if k == 0 { text } else { String::new() };
                let ends = effect.interval.get(name).copied().unwrap_or([f64::NAN; 2]);
                [
                    first(words::title(&effect.kind, &effect.place)),
                    name.clone(),
                    number(*value),
                    words::interval(ends),
                    effect.unit.get(name).cloned().unwrap_or_default(),
                    first(format!("{:.1} %", 100.0 * effect.explained)),
                ]
            })
    });
    let columns = [
        ("Effect", Kind::Number),
        ("Parameter", Kind::Text),
        ("Value", Kind::Number),
        ("95 % interval", Kind::Number),
        ("Unit", Kind::Text),
        ("Explains", Kind::Number),
    ];
    table("Effects", columns, rows)
}

/// What to do about each effect, and what of the ripple goes with it.
pub(super) fn remedies(report: &Report) -> Markup {
    let is_further_off = report.is_further_off();
    let rows = report.effects.iter().map(|effect| {
        let gain = match (is_further_off, report.ripple_without(effect)) {
            (Some(_), _) => "none".into(),
            (None, Some([with, without])) => {
                format!("ripple {} \u{2192} {} %", number(with), number(without))
            }
            (None, None) => format!("{:.0} % of the residual", 100.0 * effect.explained),
        };
        let (what, how) = match (is_further_off, remedies::remedy(&effect.kind)) {
            (Some(_), ("compensate", _)) => remedies::FURTHER_OFF,
            (_, remedy) => remedy,
        };
        [
            words::title(&effect.kind, &effect.place),
            what.into(),
            how.into(),
            gain,
        ]
    });
    let columns = [
        ("Effect", Kind::Number),
        ("Do", Kind::Text),
        ("How", Kind::Long),
        ("Expected gain", Kind::Number),
    ];
    table("What to do about each effect", columns, rows)
}

pub(super) fn residuals(report: &Report) -> Markup {
    let rows = report.residual.iter().map(|f| {
        [
            f.channel.clone(),
            f.unit.clone(),
            number(f.fit_before),
            number(f.fit_after),
            number(f.check_before),
            number(f.check_after),
            number(f.noise_floor),
            format!("{:.0} %", 100.0 * f.whiteness),
        ]
    });
    let columns = [
        ("Channel", Kind::Number),
        ("Unit", Kind::Text),
        ("Fit before", Kind::Number),
        ("Fit after", Kind::Number),
        ("Check before", Kind::Number),
        ("Check after", Kind::Number),
        ("Noise floor", Kind::Number),
        ("White", Kind::Number),
    ];
    table("Residuals", columns, rows)
}

/// What was refused, how often, and why.
pub(super) fn refused(report: &Report) -> Markup {
    let rows = report.refused.iter().map(|refusal| {
        [
            refusal.hypothesis.replace('_', " "),
            refusal.place.clone(),
            refusal.trials.to_string(),
            refusal.reason.into(),
        ]
    });
    let columns = [
        ("Hypothesis", Kind::Number),
        ("Where", Kind::Text),
        ("Trials", Kind::Number),
        ("Why", Kind::Long),
    ];
    table("What was refused", columns, rows)
}

pub(super) fn hypotheses(report: &Report) -> Markup {
    let rows = report.selection.trials.iter().map(|trial| {
        [
            trial.hypothesis.replace('_', " "),
            trial.place.clone(),
            trial.shape.map_or_else(String::new, number),
            number(trial.fall),
            trial.outcome.clone(),
        ]
    });
    let columns = [
        ("Hypothesis", Kind::Number),
        ("Where", Kind::Text),
        ("Order, Hz or speed", Kind::Number),
        ("Figure", Kind::Number),
        ("Outcome", Kind::Long),
    ];
    table("Hypotheses", columns, rows)
}

pub(super) fn calibration(report: &Report) -> Markup {
    let rows = report.calibration.iter().map(|c| {
        let [value, sigma] = match c.value {
            Some(value) => {
                let unit = c.unit.unwrap_or_default();
                [value, c.sigma].map(|x| format!("{} {unit}", number(x)))
            }
            None => [
                format!("{:+.2} %", 100.0 * c.relative_change).replace('-', "\u{2212}"),
                format!("{:.2} %", 100.0 * c.sigma),
            ],
        };
        [c.parameter.clone(), value, sigma]
    });
    let columns = [
        ("Parameter", Kind::Number),
        ("Change", Kind::Number),
        ("Deviation", Kind::Number),
    ];
    table("Refined plate values", columns, rows)
}
