//! What a hypothesis brings to the regression of a record.

use crate::balance::Balance;
use crate::balance::Key;
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::limits::plausible;
use crate::regression::column::Column;
use crate::regression::design::Whitener;
use crate::regression::gain::Gain;
use crate::regression::normal::{Normal, Prior, Solution, With};
use crate::search::selection::Evidence;
use crate::signal::channel::Channel;
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// A hypothesis and what it would bring.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What was tried.
    pub hypothesis: Hypothesis,
    /// What it brings.
    pub gain: Gain,
}

/// Whitened columns of hypotheses that are asked for again and again.
pub(crate) type Columns = Rc<RefCell<HashMap<Key, Rc<Vec<Column>>>>>;

/// The search over one record.
pub struct Search<'a> {
    pub(crate) balance: &'a Balance<'a>,
    /// Whitening of the record.
    pub whitener: &'a Whitener<'a>,
    /// The regression, its declared parameters first.
    pub normal: Normal,
    /// All searches under one whitening share it.
    cache: Columns,
    run_s: f64,
}

impl<'a> Search<'a> {
    /// A search that starts from a regression of the declared parameters.
    pub fn new(balance: &'a Balance<'a>, whitener: &'a Whitener<'a>, normal: Normal) -> Self {
        Search {
            balance,
            whitener,
            normal,
            cache: Rc::default(),
            run_s: balance.signals.run_s(),
        }
    }

    /// The same, with what others under the same whitening know.
    pub(crate) fn knowing(self, cache: &Columns) -> Self {
        Search {
            cache: cache.clone(),
            ..self
        }
    }

    /// Another search under the same whitening from the same regression.
    pub(crate) fn fork(&self) -> Self {
        Search {
            balance: self.balance,
            whitener: self.whitener,
            normal: self.normal.clone(),
            cache: self.cache.clone(),
            run_s: self.run_s,
        }
    }

    /// Length of the run, s.
    pub fn run_s(&self) -> f64 {
        self.run_s
    }

    /// The columns of a hypothesis.
    pub fn columns(&mut self, hypothesis: &Hypothesis) -> Rc<Vec<Column>> {
        let key = (
            hypothesis.family,
            hypothesis.place,
            hypothesis.shape.to_bits(),
        );
        if let Some(columns) = self.cache.borrow().get(&key) {
            return columns.clone();
        }
        let columns: Rc<Vec<Column>> = Rc::new(
            hypothesis
                .contributions(self.balance, self.run_s)
                .iter()
                .map(|contribution| self.whitener.column(contribution))
                .collect(),
        );
        if !hypothesis.has_scanned_shape() {
            self.cache.borrow_mut().insert(key, columns.clone());
        }
        columns
    }

    /// What a hypothesis would bring.
    pub fn try_one(&mut self, hypothesis: Hypothesis, solution: &Solution) -> Trial {
        let columns = self.columns(&hypothesis);
        let mut gain = self.normal.gain(&columns, solution);
        if hypothesis.family == Family::AxialCompliance {
            // Its column is the whole difference to the softer screw: the parameter is 1 or the shape is wrong.
            let value = gain.values[0];
            let weight = if value == 0.0 {
                0.0
            } else {
                gain.fall / (value * value)
            };
            gain.fall = weight * (2.0 * value - 1.0);
        }
        self.refuse(&hypothesis, &mut gain);
        Trial { hypothesis, gain }
    }

    /// Parameters beyond physics bring nothing.
    pub(crate) fn refuse(&self, hypothesis: &Hypothesis, gain: &mut Gain) {
        if gain.fall > 0.0
            && let Err(reason) = plausible(hypothesis, &gain.values, self.balance)
        {
            let refusals = &self.balance.refusals;
            refusals.count(hypothesis.name(), hypothesis.place, reason);
            gain.fall = 0.0;
        }
    }

    /// Fall of the sum of squares that a hypothesis with given parameters brings.
    pub fn fall_at(&mut self, hypothesis: &Hypothesis, values: &[f64]) -> f64 {
        let columns = self.columns(hypothesis);
        self.normal.gain_at(&columns, values)
    }

    /// What this record says of a trial that another one was fitted to.
    pub(crate) fn evidence(&mut self, trial: &Trial) -> Evidence {
        let columns = self.columns(&trial.hypothesis);
        let effect = Column::default().plus(columns.iter(), &trial.gain.values);
        Evidence::new(&self.normal, effect)
    }

    /// All trials under the present regression, the best first.
    pub fn trials(&mut self, solution: &Solution) -> Vec<Trial> {
        let mut trials: Vec<Trial> = self
            .hypotheses(solution)
            .into_iter()
            .map(|h| self.try_one(h, solution))
            .collect();
        trials.sort_by(|a, b| b.gain.fall.total_cmp(&a.gain.fall));
        trials
    }

    /// What a hypothesis puts into a regression: its columns, and behind them those of what may come with it.
    pub(crate) fn entries(&mut self, hypothesis: &Hypothesis) -> Vec<(Column, Prior)> {
        let own = self.columns(hypothesis);
        own.iter()
            .map(|column| (column.clone(), hypothesis.prior()))
            .chain(
                hypothesis
                    .nuisance_contributions(self.balance, self.run_s)
                    .iter()
                    .map(|(contribution, prior)| (self.whitener.column(contribution), *prior)),
            )
            .collect()
    }

    /// Adds a hypothesis to the regression.
    pub fn add(&mut self, hypothesis: &Hypothesis) {
        for (column, prior) in self.entries(hypothesis) {
            self.normal.push(column, prior);
        }
    }

    /// The regression with a hypothesis, all parameters solved again within their bounds.
    pub(crate) fn with(&mut self, hypothesis: &Hypothesis) -> With {
        let entries = self.entries(hypothesis);
        self.normal.with(&entries)
    }

    /// Fall of the sum of squares in each channel that a hypothesis brings, all parameters solved again.
    pub(crate) fn fall_by_channel(&mut self, hypothesis: &Hypothesis) -> [f64; Channel::COUNT] {
        let before = self.normal.left_by_channel(&self.normal.solve(None).values);
        let after = self.with(hypothesis).channels;
        std::array::from_fn(|k| before[k] - after[k])
    }

    /// The same in the rough, from what its columns weigh in each channel.
    pub(crate) fn share_by_channel(&mut self, trial: &Trial) -> [f64; Channel::COUNT] {
        let columns = self.columns(&trial.hypothesis);
        let mut shares = [0.0; Channel::COUNT];
        for (column, value) in columns.iter().zip(&trial.gain.values) {
            for (share, part) in shares.iter_mut().zip(&column.parts) {
                if let Some(part) = part {
                    *share += value * value * crate::regression::column::dot(part, part);
                }
            }
        }
        let all: f64 = shares.iter().sum();
        shares.map(|share| {
            if all > 0.0 {
                share / all * trial.gain.fall
            } else {
                0.0
            }
        })
    }
}
