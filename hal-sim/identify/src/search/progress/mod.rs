//! Which effects a record has: the best hypothesis is added, each is looked at again with the others in place, and so on
//! until nothing changes.

mod second_look;
mod worth;

pub(crate) use worth::same;

use crate::balance::Balance;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::lookalike;
use crate::regression::normal::{Normal, Solution};
use crate::search::case::{Case, Whitened};
use crate::search::forward::{self, Choice, Contender, Forward};
use crate::search::select::{Search, Trial};
use crate::search::selection::{
    AUDIBLE, CONFIRMED, MOST_CONTENDERS, MOST_EFFECTS, NOT_BORNE_OUT, PLAINER, SIMPLIFIED,
    threshold,
};
use crate::search::shapes;
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use plant::effects::Place;
use std::cell::RefCell;
use worth::{counts, inseparable, resolved};

/// Sums over the channels.
type ByChannel = [f64; Channel::COUNT];

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

/// Something significant that is not named, and why.
#[derive(Clone)]
pub(crate) struct Doubt {
    pub(crate) trial: Trial,
    pub(crate) reason: &'static str,
    /// It was taken back for the residual beside it: where its channel is at its noise floor without it, nothing is.
    pub(crate) likeness: bool,
}

impl Doubt {
    fn new(trial: Trial, reason: &'static str) -> Self {
        Doubt {
            trial,
            reason,
            likeness: false,
        }
    }
}

/// How far a search has come.
#[derive(Default)]
pub(crate) struct Progress {
    pub(crate) found: Vec<Hypothesis>,
    pub(crate) rivals: Vec<Vec<Trial>>,
    /// Of each effect: what the record does not tell from it.
    pub(crate) inseparable: Vec<Vec<Trial>>,
    pub(crate) last: Vec<Trial>,
    /// What is significant and is not named.
    pub(crate) doubtful: Vec<Doubt>,
    pub(crate) tried: usize,
    pub(crate) threshold: f64,
    /// What each effect explained when it was found.
    falls: Vec<f64>,
    /// What the simplifications of the effects that were found may leave in each channel.
    remainder: ByChannel,
    /// What was explained in each channel.
    explained: ByChannel,
}

/// The check record beside the search, and what it must confirm.
struct Witness<'c, 'a> {
    heard: Whitened<'c, 'a>,
    /// Rows of all channels that count, whatever the noise.
    rows: f64,
    /// The regression with the effects that were asked for last.
    last: RefCell<Option<(Vec<Hypothesis>, Normal)>>,
}

impl<'c, 'a> Witness<'c, 'a> {
    fn new(heard: Whitened<'c, 'a>) -> Self {
        let case = heard.case;
        Witness {
            rows: case.whitener(&case.declared).used_rows() as f64,
            last: RefCell::default(),
            heard,
        }
    }

    /// Under the noise that fits given effects.
    fn again(&mut self, found: &[Hypothesis]) {
        self.heard.again(found);
        self.last = RefCell::default();
    }

    fn search(&self, others: &[Hypothesis]) -> Search<'_> {
        let mut last = self.last.borrow_mut();
        let known = last.take().filter(|(known, _)| known == others);
        let normal = known.map_or_else(|| self.heard.search(others).normal, |(_, normal)| normal);
        *last = Some((others.to_vec(), normal.clone()));
        self.heard.of(normal)
    }

    /// Fall of both records' sums of squares with the fit's parameters, and whether the check record bears the trial out: it
    /// must fall there by a share of what its rows make one expect, and the record have the trial in its size.
    fn weighed(&self, trial: &Trial, others: &[Hypothesis]) -> (f64, Result<(), &'static str>) {
        let mut search = self.search(others);
        let fall = search.fall_at(&trial.hypothesis, &trial.gain.values);
        let borne_out = match fall > CONFIRMED * threshold(self.rows as usize) {
            true => search.evidence(trial).borne_out(),
            false => Err(NOT_BORNE_OUT),
        };
        (fall + trial.gain.fall, borne_out)
    }
}

/// A double drive, or a motor alone, under a search. A contender's credit is what it explains beyond what effects that were
/// found before may have left.
struct Tracing<'p, 'c, 'a> {
    progress: &'p mut Progress,
    fit: Whitened<'c, 'a>,
    witness: Witness<'c, 'a>,
    /// Whether what the search rests on holds beside given effects.
    holds: &'p dyn Fn(&[Hypothesis]) -> bool,
    held: bool,
}

impl Tracing<'_, '_, '_> {
    /// Both records under the noise that fits the residual of them.
    fn whiten(&mut self) {
        self.fit.again(&self.progress.found);
        self.witness.again(&self.progress.found);
    }
}

impl Forward for Tracing<'_, '_, '_> {
    type Trial = Trial;

    fn contenders(&mut self) -> Vec<Contender<Trial>> {
        let Tracing { progress, fit, .. } = self;
        let mut search = fit.search(&progress.found);
        let solution = search.normal.solve(None);
        let mut trials = search.trials(&solution);
        progress.tried += trials.len();
        trials.retain(|trial| {
            let known = |known| same(known, &trial.hypothesis, fit.case.balance);
            !progress.found.iter().any(known)
        });
        progress.threshold = threshold(fit.whitener.used_rows());
        let known = progress.known();
        let contenders = progress.contenders(&trials, &mut search, &known, progress.threshold);
        progress.last = trials;
        contenders
    }

    fn weighed(&self, contender: &Contender<Trial>) -> (f64, Result<(), &'static str>) {
        (self.witness).weighed(&contender.trial, &self.progress.found)
    }

    /// A shape without a name where that explains more.
    fn take(&mut self, choice: Choice<Trial>, contenders: &[Contender<Trial>]) -> bool {
        self.progress.doubtful = (choice.doubtful.into_iter())
            .map(|(lost, reason)| Doubt::new(lost.trial, reason))
            .collect();
        let named = choice.best.map(|(_, trial)| trial);
        let added = (self.progress).add(&self.fit, &self.witness, named, contenders);
        self.held &= !added || (self.holds)(&self.progress.found);
        if added && self.held {
            self.whiten();
        }
        added && self.held
    }

    fn reconsider(&mut self) -> bool {
        let changed = self.held
            && self.progress.found.len() > 1
            && self.progress.reconsider(&self.fit, &self.witness);
        if changed {
            self.whiten();
        }
        changed
    }
}

impl Progress {
    /// One effect that no search has found.
    pub(crate) fn given(hypothesis: Hypothesis) -> Self {
        Progress {
            found: vec![hypothesis],
            rivals: vec![Vec::new()],
            inseparable: vec![Vec::new()],
            falls: vec![0.0],
            ..Progress::default()
        }
    }

    /// Adds effects until none is worth it, looks at each again with the others in place, drops those that are then
    /// worth nothing, and goes on until nothing changes. Returns the noise that is left, or `None` as soon as an effect
    /// shows that what the search rests on does not hold (`holds`).
    pub(crate) fn search(
        &mut self,
        case: &Case,
        check: &Case,
        holds: &dyn Fn(&[Hypothesis]) -> bool,
    ) -> Option<Noise> {
        let heard = |case| Whitened::new(case, Case::noise(case, None, &self.found));
        let (fit, witness) = (heard(case), Witness::new(heard(check)));
        let mut tracing = Tracing {
            progress: self,
            fit,
            witness,
            holds,
            held: true,
        };
        forward::search(&mut tracing);
        let Tracing { fit, held, .. } = tracing;
        self.drop_modest(&fit);
        held.then_some(fit.noise)
    }

    /// What of a fall is more than what the effects that were found may have left.
    fn credit(&self, falls: &ByChannel) -> f64 {
        falls
            .iter()
            .zip(&self.remainder)
            .map(|(fall, left)| {
                if *fall > 0.0 {
                    (fall - left).max(0.0)
                } else {
                    *fall
                }
            })
            .sum()
    }

    /// The trials that bring at least `enough` beyond what was left, each at its best, the best first. Of trials that say
    /// the same only the best is looked at.
    fn contenders(
        &self,
        trials: &[Trial],
        search: &mut Search,
        others: &[(Hypothesis, f64)],
        enough: f64,
    ) -> Vec<Contender<Trial>> {
        let balance = search.balance;
        // Parameters at their bounds hide a part of what a trial brings: a rough one is enough to be looked at.
        let mut rough: Vec<(f64, &Trial)> = trials
            .iter()
            .filter(|trial| trial.gain.fall > 0.5 * enough)
            .map(|trial| (self.credit(&search.share_by_channel(trial)), trial))
            .collect();
        rough.sort_by(|a, b| b.0.total_cmp(&a.0));
        let top = rough.first().map_or(0.0, |(credit, _)| *credit);
        let mut list: Vec<&Trial> = Vec::new();
        for (_, trial) in rough
            .into_iter()
            .filter(|(credit, _)| *credit > (0.2 * top).max(0.5 * enough))
        {
            if list.len() < MOST_CONTENDERS
                && !list
                    .iter()
                    .any(|known| same(&known.hypothesis, &trial.hypothesis, balance))
            {
                list.push(trial);
            }
        }
        let mut list: Vec<Contender<Trial>> = list
            .into_iter()
            .map(|trial| {
                let trial = search.at_best(trial);
                let credit = match self.remainder.iter().any(|left| *left > 0.0) {
                    true => self.credit(&search.fall_by_channel(&trial.hypothesis)),
                    false => trial.gain.fall,
                };
                let credit = credit.min(trial.gain.fall);
                Contender { trial, credit }
            })
            .collect();
        list.retain(|c| {
            c.credit > enough.max(self.least_beside(&c.trial.hypothesis, others, balance))
                && c.trial.gain.fall > 0.0
                && resolved(&c.trial, balance)
                && counts(&c.trial, balance, search.whitener)
        });
        list.sort_by(|a, b| b.credit.total_cmp(&a.credit));
        list
    }

    /// What a hypothesis must explain beside given effects, of which each explains so much.
    fn least_beside(
        &self,
        hypothesis: &Hypothesis,
        others: &[(Hypothesis, f64)],
        balance: &Balance,
    ) -> f64 {
        others
            .iter()
            .map(|(found, fall)| lookalike::least(found, *fall, hypothesis, balance.model))
            .fold(0.0, f64::max)
    }

    /// The effects that were found, with what each explained.
    fn known(&self) -> Vec<(Hypothesis, f64)> {
        self.found
            .iter()
            .copied()
            .zip(self.falls.iter().copied())
            .collect()
    }

    /// The shapes without a name that explain more than `beside`.
    fn unnamed(&self, search: &mut Search, solution: &Solution, beside: f64) -> Vec<Trial> {
        let least = self.threshold.max(beside);
        let whitener = search.whitener;
        let enough = |channel: Channel| {
            least
                .max(SIMPLIFIED * self.explained[channel.index()])
                .max(AUDIBLE * whitener.rows(channel) as f64)
        };
        let mut shapes = shapes::strongest(search, solution, enough);
        shapes.retain(|trial| trial.gain.fall > beside);
        shapes
    }

    /// Adds what has a name, or a shape without one that explains more; `false` when nothing is worth it.
    fn add(
        &mut self,
        fit: &Whitened,
        witness: &Witness,
        mut accepted: Option<Trial>,
        contenders: &[Contender<Trial>],
    ) -> bool {
        let balance = fit.case.balance;
        let mut search = fit.search(&self.found);
        let solution = search.normal.solve(None);
        let others = self.found.clone();
        let named = accepted.as_ref().map_or(0.0, |trial| trial.gain.fall);
        let shapes = self.unnamed(&mut search, &solution, PLAINER * named);
        let weighed = shapes.iter().map(|trial| {
            let (both, borne_out) = witness.weighed(trial, &others);
            borne_out.map(|()| (both, trial))
        });
        let weighed: Vec<_> = weighed.collect();
        let best = weighed.iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
        match (best, weighed.first()) {
            (Some((_, trial)), _) => accepted = Some((*trial).clone()),
            (None, Some(Err(reason))) => self.doubtful.push(Doubt::new(shapes[0].clone(), reason)),
            _ => {}
        }
        let Some(mut trial) = accepted else {
            return false;
        };
        if let Some(force) = shapes::as_force(&trial.hypothesis, search.whitener.machine) {
            let force = search.try_one(force, &solution);
            let force = search.at_best(&force);
            let better = force.gain.fall > trial.gain.fall + self.threshold;
            if better && witness.weighed(&force, &others).1.is_ok() {
                trial = force;
            }
        }
        if self.found.len() >= MOST_EFFECTS {
            let reason = "more was found than one machine has";
            self.doubtful.push(Doubt::new(trial, reason));
            return false;
        }
        let falls = search.fall_by_channel(&trial.hypothesis);
        for (left, fall) in self.remainder.iter_mut().zip(falls) {
            *left = left.max(trial.hypothesis.remainder() * fall);
        }
        for (sum, fall) in self.explained.iter_mut().zip(falls) {
            *sum += fall.max(0.0);
        }
        for hypothesis in split(&trial, &mut search, &solution) {
            let lost = self
                .last
                .iter()
                .filter(|t| !same(&t.hypothesis, &hypothesis, balance));
            self.rivals.push(lost.take(8).cloned().collect());
            self.inseparable
                .push(inseparable(&trial, contenders, self.threshold, balance));
            self.found.push(hypothesis);
            self.falls.push(trial.gain.fall);
        }
        true
    }
}
