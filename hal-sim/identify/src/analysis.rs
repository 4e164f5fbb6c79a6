//! The whole way: a fit record and a check record under a declared model, and what they have beyond it.

use crate::balance::{Assumed, Balance};
use crate::conclusion::conclude;
use crate::design::Whitener;
use crate::hypothesis::{Family, Hypothesis};
use crate::machines::{DoubleDrive, Machine};
use crate::noise::Noise;
use crate::progress::Progress;
use crate::record::{Base, Record};
use crate::roundings::Roundings;
use crate::select::Search;
use plant::model::Model;
use plant::recording::Recording;

pub use crate::outcome::*;
pub use crate::selection::MATERIAL;

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

/// How often a search begins anew because what it found shows that it rested on something wrong.
const MOST_STARTS: usize = 4;
/// Relative difference of two resonances that makes one.
const SAME_RESONANCE: f64 = 0.01;

/// Whether balances that assume one thing hold for a record that tells another. Before a soft screw is found among the
/// effects nothing is told of it.
fn holds(assumed: Assumed, told: Assumed) -> bool {
    let same = |a: f64, b: f64| (a / b - 1.0).abs() < SAME_RESONANCE;
    assumed.rounding == told.rounding
        && match (assumed.resonance_hz, told.resonance_hz) {
            (Some(a), Some(b)) => same(a, b),
            (None, Some(_)) => false,
            (_, None) => true,
        }
}

/// Both records under a model and what is assumed beside it.
struct Setting<'a> {
    fit: (Balance<'a>, Base),
    check: (Balance<'a>, Base),
}

impl<'a> Setting<'a> {
    fn new([fit, check]: [&'a Record; 2], model: &'a Model, assumed: Assumed) -> Self {
        let of = |record: &'a Record| {
            let balance = record.balance_with(model, assumed);
            let base = Base::new(&balance);
            (balance, base)
        };
        Setting {
            fit: of(fit),
            check: of(check),
        }
    }

    fn cases(&self) -> [Case<'_>; 2] {
        [&self.fit, &self.check].map(|(balance, base)| Case::new(balance, base))
    }
}

/// A search that came to its end.
struct Traced<'a> {
    assumed: Assumed,
    setting: Setting<'a>,
    noise: Noise,
    progress: Progress,
}

impl<'a> Traced<'a> {
    /// Searches, anew each time that what was found shows that it rested on something wrong; `told` says what a record
    /// with given effects must be held against.
    fn new(
        records: [&'a Record; 2],
        model: &'a Model,
        told: impl Fn(&[Hypothesis]) -> Assumed,
    ) -> Self {
        let mut assumed = told(&[]);
        let mut start = 1;
        loop {
            let mut progress = Progress::default();
            let setting = Setting::new(records, model, assumed);
            let [case, check] = setting.cases();
            let rests_on_it = |found: &[Hypothesis]| {
                start == MOST_STARTS || found.is_empty() || holds(assumed, told(found))
            };
            let noise = progress.search(&case, &check, &rests_on_it);
            let at_last = told(&progress.found);
            let soft = assumed.resonance_hz.is_some() == at_last.resonance_hz.is_some();
            match noise {
                Some(noise) if start == MOST_STARTS || soft && holds(assumed, at_last) => {
                    return Traced {
                        assumed,
                        setting,
                        noise,
                        progress,
                    };
                }
                _ => assumed = at_last,
            }
            start += 1;
        }
    }

    /// What is left under a noise, with what each effect must bring added for each: of two explanations the better one
    /// has less.
    fn length(&self, noise: &Noise) -> f64 {
        let [case, _] = self.setting.cases();
        let whitener = case.whitener(noise);
        let normal = case.search(&whitener, &self.progress.found).normal;
        let left = normal.cost(&normal.solve(None).values);
        left + MATERIAL * whitener.used_rows() as f64 * self.progress.found.len() as f64
    }
}

/// Traces what `fit` has beyond the declared `model` of a double drive, confirmed on `check`.
pub fn analyse(model: &Model, fit: &Recording, check: &Recording) -> Outcome {
    analyse_as(&DoubleDrive, model, fit, check)
}

/// Traces what `fit` has beyond the declared `model` of a machine of any kind, confirmed on `check`.
pub fn analyse_as(
    machine: &'static dyn Machine,
    model: &Model,
    fit: &Recording,
    check: &Recording,
) -> Outcome {
    let [fit, check] = [fit, check].map(|recording| Record::of(recording, model, machine));
    let roundings = Roundings::new(&fit, model);
    let records = [&fit, &check];
    let mut traced = Traced::new(records, model, |found| roundings.assumed(found));
    let rubs = |h: &Hypothesis| h.family == Family::StribeckFriction;
    if traced.progress.found.iter().any(rubs) {
        // Friction that is taken for rounded and is not looks like friction that is higher at rest.
        let other = Roundings::other(traced.assumed.rounding);
        let rival = Traced::new(records, model, |found| Assumed {
            rounding: other,
            ..roundings.assumed(found)
        });
        if rival.length(&traced.noise) < traced.length(&traced.noise) {
            traced = rival;
        }
    }
    let Traced {
        setting,
        noise,
        progress,
        ..
    } = traced;
    let [case, check] = setting.cases();
    conclude(case, check, noise, progress)
}
