//! The whole way: a fit record and a check record under a declared model, and what they have beyond it.

use crate::balance::Balance;
use crate::conclusion::conclude;
use crate::design::Whitener;
use crate::hypothesis::{Family, Hypothesis};
use crate::noise::Noise;
use crate::progress::Progress;
use crate::record::{Base, Record};
use crate::roundings::Roundings;
use crate::select::Search;
use plant::model::Model;
use plant::recording::Recording;

pub use crate::outcome::*;
pub use crate::progress::MATERIAL;

/// A record under a model: what is looked through, or what must confirm.
pub(crate) struct Case<'a> {
    pub(crate) balance: &'a Balance<'a>,
    pub(crate) base: &'a Base,
    pub(crate) declared: Noise,
}

impl<'a> Case<'a> {
    fn new(balance: &'a Balance<'a>, base: &'a Base) -> Self {
        Case {
            balance,
            base,
            declared: Noise::declared(balance.model, balance.signals, balance.fourier),
        }
    }

    pub(crate) fn whitener(&self, noise: &Noise) -> Whitener<'a> {
        Whitener::new(self.balance.signals, self.balance.fourier, noise)
    }

    /// The regression of the declared parameters and given effects.
    pub(crate) fn search<'w>(&self, whitener: &'w Whitener<'w>, found: &[Hypothesis]) -> Search<'w>
    where
        'a: 'w,
    {
        let mut search = Search::new(self.balance, whitener, self.base.normal(whitener));
        found.iter().for_each(|hypothesis| search.add(hypothesis));
        search
    }

    /// What the sensors make of the channels of a machine with given effects.
    fn sensors(&self, found: &[Hypothesis]) -> Noise {
        let soft = found
            .iter()
            .find(|hypothesis| hypothesis.family == Family::AxialCompliance);
        match soft {
            Some(soft) => Noise::with_resonance(
                self.balance.model,
                self.balance.signals,
                self.balance.fourier,
                soft.shape,
            ),
            None => self.declared.clone(),
        }
    }

    /// The noise that fits what a regression with given effects leaves, starting from another estimate of it.
    pub(crate) fn noise(&self, from: Option<&Noise>, found: &[Hypothesis]) -> Noise {
        let sensors = self.sensors(found);
        // A softer screw amplifies the sensors' noise elsewhere: what was estimated without it does not hold.
        let from = from
            .filter(|_| found.iter().all(|h| h.family != Family::AxialCompliance))
            .unwrap_or(&sensors);
        let whitener = self.whitener(from);
        let normal = self.search(&whitener, found).normal;
        let left = normal.residual(&normal.solve(None).values);
        from.corrected(&sensors, &left.parts, self.balance.fourier)
    }
}

/// Traces what `fit` has beyond the declared `model`, confirmed on `check`.
pub fn analyse(model: &Model, fit: &Recording, check: &Recording) -> Outcome {
    let record = Record::new(fit, model);
    let check_record = Record::new(check, model);
    let mut progress = Progress::default();
    let roundings = Roundings::new(&record, model);
    let mut rounding = None;
    loop {
        // An effect that is in the way can hide how friction is rounded: it is chosen again when one was found.
        let best = roundings.best(&progress.found);
        let settled = rounding.replace(best) == Some(best);
        let balance = record.balance_with(model, best);
        let base = Base::new(&balance);
        let case = Case::new(&balance, &base);
        let check_balance = check_record.balance_with(model, best);
        let check_base = Base::new(&check_balance);
        let check_case = Case::new(&check_balance, &check_base);
        let again = !settled && !progress.found.is_empty();
        if again {
            progress = Progress::default();
        }
        let holds =
            |found: &[Hypothesis]| again || found.is_empty() || roundings.best(found) == best;
        if let Some(noise) = progress.search(&case, &check_case, &holds)
            && holds(&progress.found)
        {
            return conclude(case, check_case, noise, progress);
        }
    }
}
