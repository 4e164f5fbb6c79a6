//! The whole way: a fit record and a check record under a declared model, and what they have beyond it.

use crate::balance::{Balance, Rounding};
use crate::channel::Channel;
use crate::conclusion::conclude;
use crate::design::{Solution, Whitener};
use crate::hypothesis::{Family, Hypothesis};
use crate::noise::Noise;
use crate::record::{Base, Record};
use crate::select::{Search, Trial};
use plant::Axis;
use plant::effects::{EffectModel, Place};
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;

/// What an effect must explain at least, as a share of what noise leaves: smaller than a sixteenth of the noise's rms,
/// simplifications of the balances explain as much.
pub const MATERIAL: f64 = 0.004;
/// Share of that which the check record must confirm, with the parameters of the fit.
const CONFIRMED: f64 = 0.25;
/// Effects of one machine at most.
const MOST_EFFECTS: usize = 4;

/// An effect that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it was traced to.
    pub hypothesis: Hypothesis,
    /// Linear parameters.
    pub values: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<f64>,
    /// Standard deviation of the shape.
    pub shape_sigma: f64,
    /// The effect as a model file has it.
    pub effect: EffectModel,
    /// Share of what the fit record has beyond noise.
    pub explained: f64,
    /// Fall of the sum of squares on the fit record.
    pub fall: f64,
    /// The same on the check record with the fit's parameters.
    pub check_fall: f64,
    /// Fall on each operating point of the fit record when fitted on the others.
    pub held_back: Vec<f64>,
    /// The hypotheses that lost against it, the best first.
    pub rivals: Vec<Trial>,
}

/// Rms of one channel, in its unit.
#[derive(Debug, Clone, Copy)]
pub struct ChannelFigures {
    /// Which.
    pub channel: Channel,
    /// Fit record, declared parameters recalibrated.
    pub fit_before: f64,
    /// Fit record with the effects.
    pub fit_after: f64,
    /// Check record, parameters of the fit record.
    pub check_before: f64,
    /// Check record with the effects.
    pub check_after: f64,
    /// What sensors alone leave.
    pub noise_floor: f64,
    /// Whitened rms with the effects on the fit record; 1 is noise.
    pub whitened: f64,
    /// Share of the residual's lags of up to 0.1 s whose correlation is within the 95 % band of white noise.
    pub whiteness: f64,
}

/// Something that no hypothesis explains.
#[derive(Debug, Clone)]
pub struct Unexplained {
    /// Where it shows.
    pub channel: String,
    /// What it repeats with.
    pub coordinate: String,
    /// Order or frequency there.
    pub order: f64,
    /// Size.
    pub size: f64,
    /// Why it was not named.
    pub reason: String,
}

/// All that was found.
pub struct Outcome {
    /// Effects, the greatest first.
    pub effects: Vec<Found>,
    /// Channels.
    pub channels: Vec<ChannelFigures>,
    /// What is left.
    pub unexplained: Vec<Unexplained>,
    /// Trials of the last step, in which nothing more was found.
    pub last: Vec<Trial>,
    /// Hypotheses tried.
    pub tried: usize,
    /// Fall that an effect had to bring.
    pub threshold: f64,
    /// Recalibrated model with the effects.
    pub model: Model,
    /// Recalibrated parameters: name, relative change, standard deviation.
    pub calibration: Vec<(String, f64, f64)>,
    /// Residuals of the fit record before and after, by channel, at the decimated rate.
    pub residuals: Vec<(Channel, Vec<f64>, Vec<f64>)>,
    /// Rows of each channel that count, in the order of [`Channel::ALL`].
    pub open: Vec<Vec<bool>>,
    /// Coordinates of the residuals' rows.
    pub coordinates: Coordinates,
}

/// What residuals are looked at over, at the decimated rate.
pub struct Coordinates {
    /// Time, s.
    pub time: Vec<f64>,
    /// Mechanical angles of screw and nut, rad.
    pub angle: [Vec<f64>; 2],
    /// Angle of screw against nut, rad.
    pub relative: Vec<f64>,
    /// Speeds of screw and nut, rad/s.
    pub speed: [Vec<f64>; 2],
    /// Speed of screw against nut, rad/s.
    pub relative_speed: Vec<f64>,
}

impl Outcome {
    /// `nothing missing`, `explained` or `unexplained`.
    pub fn verdict(&self) -> &'static str {
        if !self.unexplained.is_empty() {
            "unexplained"
        } else if self.effects.is_empty() {
            "nothing missing"
        } else {
            "explained"
        }
    }
}

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

    /// The noise that fits what a regression with given effects leaves, starting from another estimate of it.
    pub(crate) fn noise(&self, from: &Noise, found: &[Hypothesis]) -> Noise {
        let whitener = self.whitener(from);
        let normal = self.search(&whitener, found).normal;
        let left = normal.residual(&normal.solve(None).values);
        from.corrected(&self.declared, &left.parts, self.balance.fourier)
    }
}

/// Number of columns that a hypothesis puts into a regression.
pub(crate) fn width(hypothesis: &Hypothesis) -> usize {
    hypothesis.columns()
        + hypothesis
            .companion()
            .map_or(0, |companion| companion.columns())
}

/// Turns that an angle covers.
pub(crate) fn turns(angle: &[f64]) -> f64 {
    let (low, high) = angle
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    ((high - low) / TAU).max(0.05)
}

/// Whether two hypotheses say the same within what the record resolves.
fn same(a: &Hypothesis, b: &Hypothesis, balance: &Balance) -> bool {
    let near = a.place == b.place || a.place == Place::Both || b.place == Place::Both;
    if a.family != b.family || !near {
        return false;
    }
    let signals = balance.signals;
    let resolution = match a.family {
        Family::AngleTorque => 3.0 / turns(&signals.motors[a.axis().map_or(0, Axis::index)].travel),
        Family::LeadError | Family::BallPassage => 1.5 / turns(&signals.relative),
        Family::TimePeriodic => 3.0 / signals.time.last().copied().unwrap_or(1.0),
        Family::FluxHarmonic | Family::EncoderEccentricity => 1e-9,
        _ => f64::INFINITY,
    };
    (a.shape - b.shape).abs() < resolution
}

/// The trials that bring at least `enough`, each at its best, the best first. Of trials that say the same only the best
/// is looked at.
fn contenders(trials: &[Trial], search: &mut Search, enough: f64, balance: &Balance) -> Vec<Trial> {
    const MOST: usize = 5;
    let top = trials.first().map_or(0.0, |trial| trial.gain.fall);
    let mut list: Vec<&Trial> = Vec::new();
    // Parameters at their bounds hide a part of what a trial brings: a rough one is enough to be looked at.
    for trial in trials
        .iter()
        .filter(|trial| trial.gain.fall > (0.2 * top).max(0.5 * enough))
    {
        if list.len() < MOST
            && !list
                .iter()
                .any(|known| same(&known.hypothesis, &trial.hypothesis, balance))
        {
            list.push(trial);
        }
    }
    let mut list: Vec<Trial> = list
        .into_iter()
        .map(|trial| search.at_best(trial))
        .collect();
    list.retain(|trial| trial.gain.fall > enough);
    list.sort_by(|a, b| b.gain.fall.total_cmp(&a.gain.fall));
    list
}

/// Whether the check record bears a trial out: with the fit's parameters it must explain a share of what its rows make
/// one expect.
fn confirmed(trial: &Trial, check: &Case, noise: &Noise, found: &[Hypothesis], least: f64) -> bool {
    let whitener = check.whitener(noise);
    let mut search = check.search(&whitener, found);
    let fall = search.fall_at(&trial.hypothesis, &trial.gain.values);
    fall > CONFIRMED * least * whitener.used_rows() as f64
}

/// An effect of both motors alike is two effects where their sizes differ.
fn split(trial: &Trial, search: &mut Search, solution: &Solution) -> Vec<Hypothesis> {
    if trial.hypothesis.place == Place::Both {
        let each = [Place::Screw, Place::Nut].map(|place| Hypothesis {
            place,
            ..trial.hypothesis
        });
        let apart: f64 = each
            .iter()
            .map(|h| search.try_one(*h, solution).gain.fall)
            .sum();
        if apart > 1.02 * trial.gain.fall + 50.0 {
            return each.to_vec();
        }
    }
    vec![trial.hypothesis]
}

/// Traces what `fit` has beyond the declared `model`, confirmed on `check`.
pub fn analyse(model: &Model, fit: &Recording, check: &Recording) -> Outcome {
    let record = Record::new(fit, model);
    let check_record = Record::new(check, model);
    let mut progress = Progress::default();
    let mut rounding = None;
    loop {
        // An effect that is in the way can hide how friction is rounded: it is chosen again when one was found.
        let balance = record.balance(model, &progress.found);
        let settled = rounding.replace(balance.rounding) == Some(balance.rounding);
        let base = Base::new(&balance);
        let case = Case::new(&balance, &base);
        let check_balance = Balance::new(
            model,
            &check_record.signals,
            &check_record.fourier,
            balance.rounding,
        );
        let check_base = Base::new(&check_balance);
        let check_case = Case::new(&check_balance, &check_base);
        let again = !settled && !progress.found.is_empty();
        if again {
            progress = Progress::default();
        }
        let mut noise = case.noise(&case.declared, &progress.found);
        progress.search(&case, &check_case, &mut noise);
        if rounding_holds(&record, model, &progress, balance.rounding) || again {
            return conclude(case, check_case, noise, progress);
        }
    }
}

/// Whether the friction's rounding that a search began with is still the best with what it found.
fn rounding_holds(record: &Record, model: &Model, progress: &Progress, rounding: Rounding) -> bool {
    progress.found.is_empty() || record.balance(model, &progress.found).rounding == rounding
}

/// How far a search has come.
#[derive(Default)]
pub(crate) struct Progress {
    pub(crate) found: Vec<Hypothesis>,
    pub(crate) rivals: Vec<Vec<Trial>>,
    pub(crate) last: Vec<Trial>,
    pub(crate) unconfirmed: Vec<Trial>,
    pub(crate) tried: usize,
    pub(crate) threshold: f64,
    /// What the simplifications of the effects that were found may leave.
    remainder: f64,
}

impl Progress {
    /// Adds effects until none is worth it, looks at each again with the others in place, drops those that are then
    /// worth nothing, and goes on until nothing changes.
    fn search(&mut self, case: &Case, check: &Case, noise: &mut Noise) {
        let check_noise = check.noise(&check.declared, &[]);
        for _ in 0..3 {
            while self.step(case, check, noise, &check_noise) {
                *noise = case.noise(noise, &self.found);
            }
            if self.found.len() < 2 || !self.reconsider(case, check, noise, &check_noise) {
                return;
            }
            *noise = case.noise(noise, &self.found);
        }
    }

    /// Tries everything and adds what explains most; `false` when nothing is worth it.
    fn step(&mut self, case: &Case, check: &Case, noise: &Noise, check_noise: &Noise) -> bool {
        let whitener = case.whitener(noise);
        let mut search = case.search(&whitener, &self.found);
        let solution = search.normal.solve(None);
        let rows = whitener.used_rows() as f64;
        let mut trials = search.trials(&solution);
        self.tried += trials.len();
        trials.retain(|trial| {
            !self
                .found
                .iter()
                .any(|known| same(known, &trial.hypothesis, case.balance))
        });
        self.threshold = (MATERIAL * rows).max(self.remainder);
        self.unconfirmed.clear();
        let mut accepted = None;
        for trial in contenders(&trials, &mut search, self.threshold, case.balance) {
            if confirmed(
                &trial,
                check,
                check_noise,
                &self.found,
                self.threshold / rows,
            ) {
                accepted = Some(trial);
                break;
            }
            self.unconfirmed.push(trial);
        }
        self.last = trials;
        let Some(trial) = accepted else { return false };
        if self.found.len() >= MOST_EFFECTS {
            self.unconfirmed.push(trial);
            return false;
        }
        self.remainder = self
            .remainder
            .max(trial.hypothesis.remainder() * trial.gain.fall);
        for hypothesis in split(&trial, &mut search, &solution) {
            let lost = self
                .last
                .iter()
                .filter(|t| !same(&t.hypothesis, &hypothesis, case.balance));
            self.rivals.push(lost.take(8).cloned().collect());
            self.found.push(hypothesis);
        }
        true
    }

    /// Looks at each effect again with the others in place: another may explain its part better, or its shape move, or
    /// nothing be left for it to explain. `true` if an effect was replaced or dropped.
    fn reconsider(
        &mut self,
        case: &Case,
        check: &Case,
        noise: &Noise,
        check_noise: &Noise,
    ) -> bool {
        let whitener = case.whitener(noise);
        let mut changed = false;
        let mut k = 0;
        while k < self.found.len() {
            let others: Vec<Hypothesis> = self
                .found
                .iter()
                .enumerate()
                .filter(|(j, _)| *j != k)
                .map(|(_, h)| *h)
                .collect();
            let mut search = case.search(&whitener, &others);
            let solution = search.normal.solve(None);
            let own = search.try_one(self.found[k], &solution);
            let own = search.at_best(&own);
            let mut trials = search.trials(&solution);
            trials.retain(|trial| {
                !others
                    .iter()
                    .any(|known| same(known, &trial.hypothesis, case.balance))
            });
            let least = (1.05 * own.gain.fall).max(self.threshold);
            let better = contenders(&trials, &mut search, least, case.balance)
                .into_iter()
                .next();
            match better {
                Some(trial) => {
                    changed |= !same(&trial.hypothesis, &self.found[k], case.balance);
                    self.found[k] = trial.hypothesis;
                }
                None if own.gain.fall < self.threshold
                    || !confirmed(
                        &own,
                        check,
                        check_noise,
                        &others,
                        self.threshold / whitener.used_rows() as f64,
                    ) =>
                {
                    self.found.remove(k);
                    self.rivals.remove(k);
                    changed = true;
                    continue;
                }
                None => self.found[k] = own.hypothesis,
            }
            k += 1;
        }
        changed
    }
}
