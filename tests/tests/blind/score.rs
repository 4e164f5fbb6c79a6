//! What counts as right.

use identify::analysis::Outcome;
use identify::conclusion::interval::estimates;
use identify::record::Record;
use identify::search::roundings::balance;
use identify::signal::channel::Channel;
use identify::signal::noise::Noise;
use plant::effects::EffectModel;
use plant::model::Model;

/// Values may be off by this share.
const TOLERANCE: f64 = 0.15;

/// How well one machine's effects were told.
pub struct Score {
    /// Kind and place of what was found, in the order of the file.
    pub found: Vec<String>,
    /// Kind, place and order of every effect right and none too many.
    pub named: bool,
    /// Values within the tolerance, too.
    pub right: bool,
    /// Something is named, by kind, place or order, that is not there.
    pub wrong: bool,
}

fn label(effect: &EffectModel) -> String {
    format!("{} {}", effect.effect().kind(), effect.place().name())
}

fn parameter(effect: &EffectModel, name: &str) -> Option<f64> {
    effect
        .effect()
        .parameters()
        .into_iter()
        .find(|(known, _)| known == name)
        .map(|(_, value)| value)
}

fn same_name(truth: &EffectModel, found: &EffectModel) -> bool {
    // A resonance is a value; what repeats has an order or a frequency that must be met.
    let order = |effect: &EffectModel| {
        let hz = parameter(effect, "hz").filter(|_| effect.effect().kind() == "time_periodic");
        parameter(effect, "order").or(hz)
    };
    label(truth) == label(found)
        && match (order(truth), order(found)) {
            (Some(a), Some(b)) => (a - b).abs() <= 0.02 * a,
            _ => true,
        }
}

fn same_values(truth: &EffectModel, found: &EffectModel) -> bool {
    truth
        .effect()
        .parameters()
        .iter()
        .filter(|(name, _)| !matches!(name.as_str(), "phase" | "duration_s"))
        .all(|(name, value)| {
            parameter(found, name).is_some_and(|f| (f - value).abs() <= TOLERANCE * value.abs())
        })
}

/// Compares what was drawn with what was found.
pub fn score(truth: &[EffectModel], outcome: &Outcome) -> Score {
    let found: Vec<&EffectModel> = outcome.effects.iter().map(|f| &f.effect).collect();
    let matched = |pair: &dyn Fn(&EffectModel, &EffectModel) -> bool| {
        truth.len() == found.len() && truth.iter().all(|t| found.iter().any(|f| pair(t, f)))
    };
    Score {
        named: matched(&same_name),
        right: matched(&|t, f| same_name(t, f) && same_values(t, f)),
        wrong: found.iter().any(|f| !truth.iter().any(|t| same_name(t, f))),
        found: found.iter().map(|f| label(f)).collect(),
    }
}

/// A value that is named right, beside its 95 % interval.
pub struct Told {
    /// Kind and parameter.
    pub name: String,
    pub truth: f64,
    pub value: f64,
    pub interval: [f64; 2],
}

impl Told {
    /// The interval holds the truth.
    pub fn holds(&self) -> bool {
        let [low, high] = self.interval;
        (low..=high).contains(&self.truth)
    }

    /// How far the value is off, as a share of the interval's half width: above 1 the interval misses the truth.
    pub fn off(&self) -> f64 {
        (self.value - self.truth) / (0.5 * (self.interval[1] - self.interval[0]))
    }
}

/// The values that are named right. Phases and what is not estimated have no interval.
pub fn told(truth: &[EffectModel], outcome: &Outcome) -> Vec<Told> {
    let mut told = Vec::new();
    for effect in truth {
        let named = outcome
            .effects
            .iter()
            .filter(|f| same_name(effect, &f.effect));
        for estimate in named.flat_map(estimates) {
            let [low, high] = estimate.interval;
            let known = parameter(effect, &estimate.name);
            if let Some(truth) = known.filter(|_| estimate.name != "phase" && high > low) {
                told.push(Told {
                    name: format!("{} {}", effect.effect().kind(), estimate.name),
                    truth,
                    value: estimate.value,
                    interval: estimate.interval,
                });
            }
        }
    }
    told
}

/// The greatest share of a channel's noise floor that an effect makes up, both as rms in the band that is used.
pub fn above_floor(declared: &Model, record: &Record, effect: &EffectModel) -> f64 {
    let balance = balance(record, declared, &[]);
    let noise = Noise::declared(declared, &record.signals, &record.fourier);
    let part = balance.effect(effect);
    Channel::ALL
        .into_iter()
        .filter_map(|channel| {
            let (_, spectrum) = part.0.iter().find(|(known, _)| *known == channel)?;
            let signal = record
                .fourier
                .filtered(spectrum, &noise.band(channel, &record.fourier));
            let mean = signal.iter().sum::<f64>() / signal.len() as f64;
            let rms = (signal.iter().map(|x| (x - mean).powi(2)).sum::<f64>()
                / signal.len() as f64)
                .sqrt();
            Some(rms / noise.floor(channel, &record.fourier))
        })
        .fold(0.0, f64::max)
}
