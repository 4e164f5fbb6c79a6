//! Speed over which dry friction turns round: a nuisance. It differs from axis to axis by a hundred times.

use super::axis::Axis;
use super::fit::{Free, fitted};
use super::record::Record;
use crate::signal::fourier::slope;
use crate::signal::signals::mean_square;

/// The narrowest width, m/s: that of an axis of which nobody knows more. It is within a step of the integration at usual accelerations.
pub(super) const NARROW_M_S: f64 = 5e-4;
/// From one width that is tried to the next.
const WIDER: f64 = 2.0;
/// How often the step between widths is halved around the best one: to 3 %.
const STEPS: usize = 4;
/// Largest width, of the greatest speed: a wider one is viscous friction.
const WIDEST: f64 = 0.1;
/// Share of the error, rms, that a wider one must take.
const MATERIAL: f64 = 0.03;

/// The model with the width with which it follows the record best, refitted; the narrowest where another is no better.
pub(super) fn of_best_width(axis: &Axis, record: &Record, rows: &[usize]) -> Axis {
    let error = |axis: &Axis| mean_square(&axis.left(record)).sqrt();
    let speeds = slope(&record.reference, record.rate);
    let top = speeds.iter().fold(0.0_f64, |top, v| top.max(v.abs()));
    let widths = std::iter::successors(Some(WIDER * NARROW_M_S), |width| Some(WIDER * width));
    let mut best = (error(axis) * (1.0 - MATERIAL), axis.clone());
    let mut compare = |width_m_s: f64| {
        let start = Axis {
            width_m_s,
            ..axis.clone()
        };
        let other = fitted(&start, record, Free::Model, rows);
        let left = error(&other);
        if left < best.0 {
            best = (left, other);
        }
        best.1.width_m_s
    };
    let mut width = NARROW_M_S;
    for wider in widths.take_while(|width| *width < WIDEST * top) {
        width = compare(wider);
    }
    if width > NARROW_M_S {
        let steps = std::iter::successors(Some(WIDER.sqrt()), |step| Some(step.sqrt()));
        for step in steps.take(STEPS) {
            let at = width;
            compare(at / step);
            width = compare(at * step);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::super::axis::Term;
    use super::super::fit::MARGIN;
    use super::super::fit::tests::followed;
    use super::super::record::Law;
    use super::super::select::tried;
    use super::*;
    use crate::regression::sandwich::tests::coloured;

    /// Strokes of 1.5 s with 0.4 m/s^2, between 100 mm/s and creeping, of an axis with a term and a width.
    fn strokes(real: &Axis) -> Record {
        let (mut at, mut v) = (0.0, 0.0_f64);
        let rows = (0..12_000).map(|row| {
            let aim = [0.02, -0.02, 0.05, -0.05, 0.1, -0.1, 0.004, -0.004][row / 1500];
            v += (aim - v).clamp(-4e-4, 4e-4);
            at += 1e-3 * v;
            at
        });
        let record = followed(real, rows.collect(), 1000.0);
        let noise = coloured(7, record.len(), 0.0);
        record.with_force(|row| 0.2 * noise[row])
    }

    #[test]
    fn a_wide_friction_has_its_width_and_no_further_term() {
        let narrow = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        let found = |real: &Axis| {
            let record = strokes(real);
            let rows: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
            let fitted = fitted(&narrow, &record, Free::Model, &rows);
            let found = of_best_width(&fitted, &record, &rows);
            let terms = |axis: &Axis| {
                let trials = tried(axis, &record, false).into_iter();
                let taken = trials.filter(|trial| trial.lost.is_none());
                taken.map(|trial| trial.term).collect::<Vec<_>>()
            };
            (found.width_m_s, terms(&found), terms(&fitted))
        };
        let wide = Axis {
            width_m_s: 6e-3,
            ..narrow.clone()
        };
        let (width, terms, without) = found(&wide);
        assert!(
            (4e-3..9e-3).contains(&width) && terms.is_empty() && !without.is_empty(),
            "{width} m/s, {terms:?}; without a width {without:?}"
        );
        let mut presliding = narrow.clone();
        presliding.terms.push((Term::Presliding, vec![2e6]));
        assert_eq!(found(&presliding).1, [Term::Presliding]);
    }
}
