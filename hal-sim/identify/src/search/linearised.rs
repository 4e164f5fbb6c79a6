//! A regression about the shapes of its effects: orders, frequencies and speeds as parameters like all others.
//!
//! In a shape a record is not linear. About the value that a search came to it is, within what the record resolves: each
//! shape has a column, the derivative of what its effect adds, and Gauss-Newton steps take all parameters together to where
//! the sum of squares is smallest (Seber and Wild, *Nonlinear Regression*, 1989, sections 2.1 and 14.1). There the columns
//! give the covariance too: that of a phase holds what is unknown of its order.

use crate::balance::Assumed;
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::parameter::{MotorParameter, Parameter};
use crate::regression::column::Column;
use crate::regression::normal::{Normal, Prior, Solution};
use crate::regression::sandwich::robust;
use crate::search::case::Case;
use crate::search::select::Search;
use crate::signal::noise::Noise;

/// Gauss-Newton steps at most.
const MOST_STEPS: usize = 8;
/// A step that is shorter than this share of its own standard deviation is the last.
const SHORT: f64 = 0.02;
/// Half the distance of two shapes by which a derivative is taken, in turns of phase over the record: its error is the
/// square of it.
const TURNS: f64 = 5e-3;
/// The same of what does not repeat, as a share of the shape.
const SHARE: f64 = 1e-3;

/// A regression with effects, and its columns for their shapes.
pub(crate) struct Linearised<'w> {
    /// Without the shapes' columns.
    pub(crate) search: Search<'w>,
    pub(crate) solution: Solution,
    /// With them.
    pub(crate) normal: Normal,
    pub(crate) joint: Solution,
    /// Of each effect: the first of its parameters, and its shape's.
    pub(crate) places: Vec<(usize, Option<usize>)>,
}

impl<'w> Linearised<'w> {
    /// Of a regression without effects about given ones.
    pub(crate) fn new(bare: &Search<'w>, found: &[Hypothesis]) -> Self {
        let mut search = bare.fork();
        let mut places = Vec::new();
        for hypothesis in found {
            places.push((search.normal.len(), None));
            search.add(hypothesis);
        }
        let solution = search.normal.solve(None);
        let mut normal = search.normal.clone();
        for (hypothesis, (first, shape)) in found.iter().zip(&mut places) {
            if hypothesis.has_open_shape() {
                *shape = Some(normal.len());
                let values = &solution.values.as_slice()[*first..][..hypothesis.columns()];
                let slope = search.slope(hypothesis, values);
                normal.push(slope, Prior::FREE);
            }
        }
        Linearised {
            joint: normal.solve(None),
            search,
            solution,
            normal,
            places,
        }
    }

    /// Covariance of an effect's linear parameters, and the standard deviation of its shape; of a whole order that of the
    /// order that it would have otherwise.
    pub(crate) fn uncertainty(&mut self, hypothesis: &Hypothesis, k: usize) -> (Vec<f64>, f64) {
        let (first, shape) = self.places[k];
        let columns = hypothesis.columns();
        let parameters: Vec<usize> = (first..first + columns).collect();
        let sigma = |normal: &Normal, joint: &Solution, at: usize| {
            robust(normal, joint, &[at])[(0, 0)].max(0.0).sqrt()
        };
        let shape_sigma = match shape {
            Some(at) => sigma(&self.normal, &self.joint, at),
            None if hypothesis.has_free_shape() => {
                let values = &self.solution.values.as_slice()[first..][..columns];
                let slope = self.search.slope(hypothesis, values);
                let mut normal = self.normal.clone();
                normal.push(slope, Prior::FREE);
                let joint = normal.solve(None);
                sigma(&normal, &joint, normal.len() - 1)
            }
            None => 0.0,
        };
        let covariance = robust(&self.normal, &self.joint, &parameters);
        (covariance.iter().copied().collect(), shape_sigma)
    }

    fn cost(&self) -> f64 {
        self.search.normal.cost(&self.solution.values)
    }

    /// The effects a share of a Gauss-Newton step further, and the length of the whole step in standard deviations.
    fn step(&self, found: &[Hypothesis], share: f64) -> (Vec<Hypothesis>, f64) {
        let mut longest: f64 = 0.0;
        let next = found.iter().zip(&self.places).map(|(hypothesis, (_, at))| {
            let mut next = *hypothesis;
            if let Some(at) = *at {
                let step = self.joint.values[at];
                let sigma = self.joint.covariance[(at, at)].max(1e-300).sqrt();
                longest = longest.max(step.abs() / sigma);
                let reach = self.search.reach(hypothesis);
                next.shape += share * step.clamp(-reach, reach);
                next.shape = next.shape.max(hypothesis.least_shape());
            }
            next
        });
        (next.collect(), longest)
    }
}

/// Takes the shapes of effects to where the sum of squares is smallest, all parameters free.
pub(crate) fn settle(case: &Case, noise: &Noise, found: &mut Vec<Hypothesis>) {
    if !found.iter().any(Hypothesis::has_open_shape) {
        return;
    }
    let whitener = case.whitener(noise);
    let bare = case.search(&whitener, &[]);
    let mut here = Linearised::new(&bare, found);
    for _ in 0..MOST_STEPS {
        let mut share = 1.0;
        let next = loop {
            let (next, longest) = here.step(found, share);
            if longest < SHORT || share < 0.1 {
                return;
            }
            let there = Linearised::new(&bare, &next);
            if there.cost() < here.cost() {
                *found = next;
                break there;
            }
            share *= 0.4;
        };
        here = next;
    }
}

/// Smallest part of a damping that one step leaves.
const LEAST_DAMPING: f64 = 0.2;

/// What the balances assume, as a regression with given effects has it. Of a machine whose effects do not show it
/// nothing is retold.
pub(crate) fn retold(
    case: &Case,
    noise: &Noise,
    found: &[Hypothesis],
    mut assumed: Assumed,
) -> Assumed {
    let needs = |h: &Hypothesis| {
        use Family::{AxialCompliance, BallPassage, LeadError};
        matches!(h.family, AxialCompliance | BallPassage | LeadError)
    };
    if !found.iter().any(needs) {
        return assumed;
    }
    let whitener = case.whitener(noise);
    let values = case.search(&whitener, found).normal.solve(None).values;
    for (k, (parameter, _)) in case.base.parameters.iter().enumerate() {
        if let Parameter::Motor(axis, MotorParameter::ReadingLag) = parameter {
            assumed.lags[axis.index()] += values[k];
        }
    }
    let mut at = case.base.parameters.len();
    for hypothesis in found {
        at += hypothesis.columns();
        if hypothesis.family == Family::AxialCompliance {
            // Linear about the present one, the change may be more than all of it.
            let changed = (1.0 + values[at]).max(LEAST_DAMPING);
            assumed.damping = (assumed.damping * changed).min(1.0);
        }
        at += hypothesis.nuisances();
    }
    assumed
}

impl Search<'_> {
    /// How far from its value a shape may be looked for in one step.
    fn reach(&self, hypothesis: &Hypothesis) -> f64 {
        match hypothesis.has_scanned_shape() {
            true => 0.25 / self.turns(hypothesis),
            false => 0.2 * hypothesis.shape,
        }
    }

    /// Derivative by its shape of what an effect with given parameters adds.
    fn slope(&mut self, hypothesis: &Hypothesis, values: &[f64]) -> Column {
        let half = match hypothesis.has_scanned_shape() {
            true => TURNS / self.turns(hypothesis),
            false => SHARE * hypothesis.shape,
        };
        let mut at = |shape: f64| {
            let shifted = Hypothesis {
                shape,
                ..*hypothesis
            };
            self.columns(&shifted)
        };
        let (above, below) = (at(hypothesis.shape + half), at(hypothesis.shape - half));
        let weights: Vec<f64> = values.iter().map(|value| value / (2.0 * half)).collect();
        Column::default()
            .plus(above.iter(), &weights)
            .less(below.iter(), weights.iter().copied())
    }
}
