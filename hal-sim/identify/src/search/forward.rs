//! Forward selection with second looks (stepwise regression; Efroymson 1960): the way of every machine from candidates to
//! effects. What a machine's candidates are, and which records speak for them, is its own.

use crate::search::selection::{CLOSE, MOST_CONTENDERS};

/// How often a search goes on after a second look that changed something.
const MOST_ROUNDS: usize = 3;

/// A candidate at its best, and what it explains of the fit record beyond what is explained.
#[derive(Debug, Clone)]
pub(crate) struct Contender<T> {
    pub(crate) trial: T,
    pub(crate) credit: f64,
}

/// What came of a step.
pub(crate) struct Choice<T> {
    /// The best of those that are confirmed, with what it explains of both records.
    pub(crate) best: Option<(f64, T)>,
    /// Those ahead of it that are not, and why.
    pub(crate) doubtful: Vec<(Contender<T>, &'static str)>,
}

/// A machine's records under a search.
pub(crate) trait Forward {
    /// What a candidate is.
    type Trial: Clone;

    /// How many of its candidates are looked at closely in each step.
    fn most_contenders(&self) -> usize {
        MOST_CONTENDERS
    }

    /// The candidates, in any order.
    fn contenders(&mut self) -> Vec<Contender<Self::Trial>>;

    /// What a candidate explains of both records, and whether the one that it was not fitted to bears it out.
    fn weighed(&self, contender: &Contender<Self::Trial>) -> (f64, Result<(), &'static str>);

    /// Takes the best; `false` if there is none, or the search rests on something that does not hold.
    fn take(&mut self, choice: Choice<Self::Trial>, contenders: &[Contender<Self::Trial>]) -> bool;

    /// Looks at each effect again with the others in place; whether one was replaced or dropped.
    fn reconsider(&mut self) -> bool;
}

/// Adds effects until none is worth it, looks at each again, and goes on until nothing changes.
pub(crate) fn search(machine: &mut impl Forward) {
    for _ in 0..MOST_ROUNDS {
        loop {
            let mut contenders = machine.contenders();
            contenders.sort_by(|a, b| b.credit.total_cmp(&a.credit));
            contenders.truncate(machine.most_contenders());
            let choice = chosen(&contenders, |contender| machine.weighed(contender));
            if !machine.take(choice, &contenders) {
                break;
            }
        }
        if !machine.reconsider() {
            break;
        }
    }
}

/// Of contenders the one that explains most and is confirmed; among those that explain nearly as much, the one that
/// explains most of both records.
pub(crate) fn chosen<T: Clone>(
    contenders: &[Contender<T>],
    weighed: impl Fn(&Contender<T>) -> (f64, Result<(), &'static str>),
) -> Choice<T> {
    let mut best: Option<(f64, &Contender<T>)> = None;
    let mut doubtful = Vec::new();
    for contender in contenders {
        let enough = best.map_or(0.0, |(_, leader)| (1.0 - CLOSE) * leader.credit);
        if contender.credit < enough {
            break;
        }
        match (weighed(contender), best) {
            ((_, Err(reason)), None) => doubtful.push((contender.clone(), reason)),
            ((both, Ok(())), known) if known.is_none_or(|(most, _)| both > most) => {
                best = Some((both, contender));
            }
            _ => {}
        }
    }
    Choice {
        best: best.map(|(both, leader)| (both, leader.trial.clone())),
        doubtful,
    }
}
