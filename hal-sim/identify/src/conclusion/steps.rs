//! Whether a plate value that is said to drift steps at one time.

use crate::effects::hypothesis::Hypothesis;
use crate::regression::normal::Prior;
use crate::search::select::Search;
use plant::effects::{Coordinate, Law, Term};

/// Parts of a run: a step is tried at each end of one, and a ramp from the start to the ends of the later three quarters.
const PARTS: usize = 16;
const SHORTEST_RAMP: usize = 4;

/// By how much more a step at some time lowers a record's sum of squares than a ramp does, each in its best size. `None` for an effect
/// that is no drift. Of 47 drawn drifts it is -0.21 to -0.06 of what the best ramp lowers, of four steps 0.13 to 0.22.
pub(super) fn step_beyond_ramp(search: &mut Search, hypothesis: &Hypothesis) -> Option<f64> {
    let run_s = search.run_s();
    let unit = hypothesis.units(search.balance.model, run_s).pop()?;
    let is_drift =
        |term: &Term| term.coordinate == Coordinate::Time && matches!(term.law, Law::Ramp { .. });
    let drift = unit.effect().terms().into_iter().find(is_drift)?;
    // Without the drift its plate value may be at a bound, which it leaves with it: all are fitted again.
    let before = search.normal.cost(&search.normal.solve(None).values);
    let mut fall = |law: Law| {
        let term = Term {
            law,
            ..drift.clone()
        };
        let change = search.balance.terms(unit.place(), &[term]);
        let column = search.whitener.column(&change);
        before - search.normal.with(&[(column, Prior::FREE)]).cost
    };
    let ramp = |parts: usize| Law::Ramp {
        value: 1.0,
        duration: run_s * parts as f64 / PARTS as f64,
    };
    let step = |first: usize| {
        let values = (0..=PARTS).map(|k| f64::from(u8::from(k >= first)));
        Law::Table {
            range: [0.0, run_s],
            repeats: false,
            values: values.collect(),
        }
    };
    let best = |falls: &mut dyn Iterator<Item = f64>| falls.fold(0.0, f64::max);
    let ramp = best(&mut (SHORTEST_RAMP..=PARTS).map(|parts| fall(ramp(parts))));
    let step = best(&mut (1..PARTS).map(|first| fall(step(first))));
    Some(step - ramp)
}
