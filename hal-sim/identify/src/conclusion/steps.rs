//! Whether a plate value that is said to drift steps at one time.

use crate::effects::hypothesis::Hypothesis;
use crate::search::select::Search;
use plant::effects::{Coordinate, Law, Term};

/// Parts of a run at whose ends a step is tried.
const PARTS: usize = 16;

/// By how much more a step at some time lowers a record's sum of squares than a drift does, each in its best size. `None` for an
/// effect that is no drift.
///
/// A ramp explains three quarters of a step in a run's middle. A step explains three quarters of a ramp, and less of a value that
/// rises as `1 - exp(-t)`.
pub(super) fn step_beyond(search: &mut Search, hypothesis: &Hypothesis) -> Option<f64> {
    let run_s = search.run_s();
    let unit = hypothesis.units(search.balance.model, run_s).pop()?;
    let is_drift =
        |term: &Term| term.coordinate == Coordinate::Time && matches!(term.law, Law::Ramp { .. });
    let drift = unit.effect().terms().into_iter().find(is_drift)?;
    let solution = search.normal.solve(None);
    let columns = search.columns(hypothesis);
    let of_drift = search.normal.gain(&columns, &solution).fall;
    let at = |first: usize| {
        let values = (0..=PARTS).map(|k| f64::from(u8::from(k >= first)));
        let law = Law::Table {
            range: [0.0, run_s],
            repeats: false,
            values: values.collect(),
        };
        let term = Term {
            law,
            ..drift.clone()
        };
        let step = search.balance.terms(unit.place(), &[term]);
        let column = search.whitener.column(&step);
        search.normal.gain(&[column], &solution).fall
    };
    Some((1..PARTS).map(at).fold(0.0, f64::max) - of_drift)
}
