//! The whole way: a fit record and a check record under a declared model, and what they have beyond it.

use crate::balance::{Assumed, Balance, Rounding};
use crate::conclusion::remains::{judged_hz, level};
use crate::conclusion::{conclude, concluded};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::machines::{DoubleDrive, Machine};
use crate::record::{Base, Record};
use crate::regression::design::Whitener;
use crate::search::case::Case;
use crate::search::linearised::{retold, settle};
use crate::search::progress::Progress;
use crate::search::roundings::{self, Roundings};
use crate::search::select::Search;
use crate::search::selection::AUDIBLE;
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use plant::Axis;
use plant::model::Model;
use plant::recording::Recording;

pub use crate::conclusion::channels::*;
pub use crate::conclusion::outcome::*;
pub use crate::search::selection::MATERIAL;

/// How often a search begins again because what it found shows that it rested on something wrong.
const MOST_STARTS: usize = 4;
/// Relative difference of two resonances that makes one.
const SAME_RESONANCE: f64 = 0.01;

/// How often the damping of a softer screw and the times of reading are taken again, in which nothing is linear.
const MOST_RETOLD: usize = 4;
/// Difference of two times of reading that makes one, s: at 500 Hz 0.3 % of a wave.
const SAME_LAG_S: f64 = 1e-6;

/// Whether balances that assume one thing hold for a record that tells another. Before a soft screw is found among the
/// effects nothing is known of it.
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
    /// Searches, again each time that what was found shows that it rested on something wrong; `told` says what a record
    /// with given effects must be compared with.
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

    /// Whether the fit record's torques are louder than their sensors.
    fn is_loud(&self) -> bool {
        let (balance, base) = &self.setting.fit;
        let case = Case::new(balance, base);
        let whitener = case.whitener(&self.noise);
        let normal = case.search(&whitener, &self.progress.found).normal;
        let white = normal.residual(&normal.solve(None).values);
        let alone = self.progress.found.is_empty();
        Axis::ALL.into_iter().map(Channel::Torque).any(|channel| {
            let band = judged_hz(channel, &self.noise);
            !level(&case, &whitener, &white, (channel, alone), band).quiet()
        })
    }

    /// The residual under a noise, with what each effect must bring added for each: of two explanations the better one
    /// has less.
    fn length(&self, noise: &Noise) -> f64 {
        let (balance, base) = &self.setting.fit;
        let whitener = Whitener::new(balance.signals, balance.fourier, noise);
        length((balance, base), &whitener, &self.progress.found)
    }
}

/// See [`Traced::length`]: of given balances of a record with given effects.
fn length((balance, base): (&Balance, &Base), whitener: &Whitener, found: &[Hypothesis]) -> f64 {
    let mut search = Search::new(balance, whitener, base.normal(whitener));
    found.iter().for_each(|hypothesis| search.add(hypothesis));
    let normal = search.normal;
    let left = normal.cost(&normal.solve(None).values);
    let least = |hypothesis: &Hypothesis| match hypothesis.family {
        Family::Unnamed(unnamed) => AUDIBLE * whitener.rows(unnamed.channel) as f64,
        _ => MATERIAL * whitener.used_rows() as f64,
    };
    left + found.iter().map(least).sum::<f64>()
}

impl Traced<'_> {
    /// Another rounding of friction that is worth a search of its own. Friction that is taken for rounded and is not looks like
    /// friction that is higher at rest, or like a curve without a name. What was found may also show that the first choice was wrong.
    fn rival(&self, fit: &Record, model: &Model) -> Option<Rounding> {
        let like_friction =
            |h: &Hypothesis| matches!(h.family, Family::StribeckFriction | Family::Unnamed(_));
        let found = &self.progress.found;
        let others = found.iter().filter(|h| !like_friction(h)).copied();
        let others: Vec<Hypothesis> = others.collect();
        let doubtful = others.len() < found.len();
        let whitener = Whitener::new(&fit.signals, &fit.fourier, &self.noise);
        let with = |rounding: Rounding| {
            let assumed = Assumed {
                rounding,
                ..self.assumed
            };
            let balance = fit.balance_with(model, assumed);
            let base = Base::new(&balance);
            length((&balance, &base), &whitener, &others)
        };
        let own = self.assumed.rounding;
        let other = roundings::other(own);
        let has_feed = fit.signals.machine.has_feed();
        let (better, least) = match has_feed && (doubtful || self.is_loud()) {
            true => roundings::refined([own, other], with),
            false => (other, with(other)),
        };
        let now = self.length(&self.noise);
        match least < now && better != own {
            true => Some(better),
            false => doubtful.then_some(other),
        }
    }
}

/// Traces what `fit` has beyond the declared `model` of a double drive, confirmed on `check`.
pub fn analyse(model: &Model, fit: &Recording, check: &Recording) -> Outcome {
    analyse_as(&DoubleDrive, model, fit, check)
}

/// What is said of records with one effect that was found another way than by their balances; `found` makes of what the
/// balances say of it what was found.
pub(crate) fn given(
    model: &Model,
    fit: &Recording,
    check: &Recording,
    hypothesis: Hypothesis,
    found: impl Fn(Found) -> Found,
) -> Outcome {
    let [fit, check] = [fit, check].map(|recording| Record::new(recording, model));
    let assumed = Roundings::new(&fit, model).assumed(&[]);
    let setting = Setting::new([&fit, &check], model, assumed);
    let [case, check] = setting.cases();
    let noise = case.noise(None, &[hypothesis]);
    let progress = Progress::given(hypothesis);
    let mut outcome = concluded(&case, &check, &noise, &progress);
    outcome.effects = outcome.effects.into_iter().map(found).collect();
    // Balances that do not hold refine nothing.
    outcome.model = model.clone();
    outcome.calibration.clear();
    let effects = outcome.effects.iter().map(|found| found.effect.clone());
    outcome.model.effects.extend(effects);
    outcome
}

/// Traces what `fit` has beyond the declared `model` of a machine of any kind, confirmed on `check`.
pub fn analyse_as(
    machine: &'static dyn Machine,
    model: &Model,
    fit: &Recording,
    check: &Recording,
) -> Outcome {
    let under = |model: &Model| as_declared(machine, model, fit, check);
    under(model).or_corrected(model, under)
}

/// The same, with plate values within their tolerance.
fn as_declared(
    machine: &'static dyn Machine,
    model: &Model,
    fit: &Recording,
    check: &Recording,
) -> Outcome {
    let [fit, check] = [fit, check].map(|recording| Record::of(recording, model, machine));
    let roundings = Roundings::new(&fit, model);
    let records = [&fit, &check];
    let mut traced = Traced::new(records, model, |found| roundings.assumed(found));
    if let Some(rounding) = traced.rival(records[0], model) {
        let rival = Traced::new(records, model, |found| Assumed {
            rounding,
            ..roundings.assumed(found)
        });
        if rival.length(&traced.noise) < traced.length(&traced.noise) {
            traced = rival;
        }
    }
    let Traced {
        mut assumed,
        mut setting,
        noise,
        mut progress,
    } = traced;
    for _ in 0..MOST_RETOLD {
        let [case, _] = setting.cases();
        settle(&case, &noise, &mut progress.found);
        let soft = roundings.assumed(&progress.found).resonance_hz;
        let told = retold(&case, &noise, &progress.found, assumed);
        let same = |a: f64, b: f64| (a / b - 1.0).abs() < SAME_RESONANCE;
        let settled =
            |axis: Axis| (told.lags[axis.index()] - assumed.lags[axis.index()]).abs() < SAME_LAG_S;
        if same(told.damping, assumed.damping) && Axis::ALL.into_iter().all(settled) {
            break;
        }
        assumed = Assumed {
            resonance_hz: soft,
            ..told
        };
        setting = Setting::new(records, model, assumed);
    }
    let [case, check] = setting.cases();
    conclude(case, check, noise, progress)
}
