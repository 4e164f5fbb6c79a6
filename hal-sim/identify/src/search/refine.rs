//! A hypothesis at its best: the shape that explains most.

use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::regression::normal::{Prior, Solution};
use crate::search::select::{Search, Trial};
use crate::signal::along::Along;
use crate::signal::noise::declared_resonance_hz;
use std::f64::consts::TAU;

/// Steps of a search over the logarithm of a shape: the first, and where it ends.
const FIRST_STEP: f64 = 0.35;
const LAST_STEP: f64 = 2e-3;
/// Share of what a record resolves of an order or a frequency at which a search for it ends: a thirtieth of a turn of
/// phase over the whole record.
const RESOLVED: f64 = 0.03;

impl Search<'_> {
    /// A trial at its best: its shape refined, all declared parameters free to give way to it within their bounds.
    pub fn at_best(&mut self, trial: &Trial) -> Trial {
        let cost = self.normal.cost(&self.normal.solve(None).values);
        let mut best = trial.clone();
        match best.hypothesis.family {
            Family::StribeckFriction | Family::DeadTime => self.follow(&mut best, cost),
            Family::AxialCompliance => {
                let held = self.with(&best.hypothesis).held;
                let beside = self.normal.solve_beside(&held);
                best = self.softer(best, &beside);
                self.follow(&mut best, cost);
            }
            _ if best.hypothesis.has_free_shape() => {
                let mut as_scanned = trial.clone();
                self.settle(&mut as_scanned, cost);
                for _ in 0..2 {
                    let held = self.with(&best.hypothesis).held;
                    let beside = self.normal.solve_beside(&held);
                    best = self.try_one(best.hypothesis, &beside);
                    best = self.refined(best, &beside);
                }
                self.settle(&mut best, cost);
                // Where another effect is in the way a refined shape can be the worse one.
                if as_scanned.gain.fall > best.gain.fall {
                    best = as_scanned;
                }
            }
            _ => self.settle(&mut best, cost),
        }
        best
    }

    /// What a trial's hypothesis brings when all is solved again; `cost` is that of the regression without it.
    fn settle(&mut self, trial: &mut Trial, cost: f64) {
        let with = self.with(&trial.hypothesis);
        trial.gain.values = with.values[..trial.hypothesis.columns()].to_vec();
        trial.gain.fall = cost - with.cost;
        if trial.hypothesis.family == Family::LeadError {
            // What comes with it may not explain more than it does.
            let own: Vec<_> = self.columns(&trial.hypothesis).iter().cloned().collect();
            let own: Vec<_> = own
                .into_iter()
                .map(|column| (column, Prior::FREE))
                .collect();
            let alone = cost - self.normal.with(&own).cost;
            trial.gain.fall = trial.gain.fall.min(2.0 * alone);
        }
        self.refuse(&trial.hypothesis, &mut trial.gain);
    }

    /// Follows a shape to where it explains most. What other parameters within their bounds can take over changes with
    /// the shape, so all is solved again at each.
    fn follow(&mut self, trial: &mut Trial, cost: f64) {
        self.settle(trial, cost);
        let (mut step, mut side) = (FIRST_STEP, 1.0);
        while step > LAST_STEP {
            let mut moved = false;
            for turn in [side, -side] {
                let mut next = trial.clone();
                next.hypothesis.shape *= f64::exp(turn * step);
                if next.hypothesis.shape < next.hypothesis.least_shape() {
                    continue;
                }
                self.settle(&mut next, cost);
                if next.gain.fall > trial.gain.fall {
                    *trial = next;
                    side = turn;
                    moved = true;
                    break;
                }
            }
            if !moved {
                step *= 0.35;
            }
        }
    }

    /// The screw's resonance, from how much too soft or stiff a hypothesis is: its parameter tells what share of its
    /// compliance is there.
    fn softer(&mut self, mut best: Trial, solution: &Solution) -> Trial {
        let declared = declared_resonance_hz(self.balance.model);
        best = self.try_one(best.hypothesis, solution);
        for _ in 0..5 {
            // Compliance goes as 1 / hz^2.
            let (own, given) = (best.hypothesis.shape.powi(-2), declared.powi(-2));
            let compliance = given + best.gain.values[0] * (own - given);
            if compliance <= given {
                break;
            }
            best = self.try_one(
                Hypothesis {
                    shape: compliance.powf(-0.5),
                    ..best.hypothesis
                },
                solution,
            );
        }
        best
    }

    /// Turns that the coordinate of a hypothesis covers, or the seconds of what repeats in time.
    pub(crate) fn turns(&self, hypothesis: &Hypothesis) -> f64 {
        let along = match hypothesis.family {
            Family::TimePeriodic => Along::Clock,
            Family::Unnamed(unnamed) => unnamed.along,
            _ => hypothesis.axis().map_or(Along::RelativeAngle, Along::Angle),
        };
        let signals = self.balance.signals;
        let (low, high) = (0..signals.len())
            .map(|row| signals.along(along, row))
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        ((high - low) / TAU).max(0.1)
    }

    /// Finds the order or frequency near the hypothesis' own that explains most.
    fn refined(&mut self, trial: Trial, solution: &Solution) -> Trial {
        let first = 0.5 / self.turns(&trial.hypothesis);
        let (mut step, mut best) = (first, trial);
        while step > RESOLVED * first {
            let mut moved = false;
            for side in [-1.0, 1.0] {
                let shape = best.hypothesis.shape + side * step;
                if shape < best.hypothesis.least_shape() {
                    continue;
                }
                let next = self.try_one(
                    Hypothesis {
                        shape,
                        ..best.hypothesis
                    },
                    solution,
                );
                if next.gain.fall > best.gain.fall {
                    best = next;
                    moved = true;
                    break;
                }
            }
            if !moved {
                step *= 0.4;
            }
        }
        self.whole(best, solution)
    }

    /// A whole order that explains as much is the simpler one.
    fn whole(&mut self, best: Trial, solution: &Solution) -> Trial {
        let shape = best.hypothesis.shape.round();
        let in_time = match best.hypothesis.family {
            Family::TimePeriodic => true,
            Family::Unnamed(unnamed) => unnamed.along == Along::Clock,
            _ => false,
        };
        if in_time || shape < 1.0 {
            return best;
        }
        let near = self.try_one(
            Hypothesis {
                shape,
                ..best.hypothesis
            },
            solution,
        );
        if near.gain.fall > best.gain.fall - 15.0 - 0.002 * best.gain.fall {
            near
        } else {
            best
        }
    }
}
