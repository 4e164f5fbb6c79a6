//! A second look at the effects that were found, each with the others in place.

use super::worth::{inseparable, same};
use super::{Doubt, Progress, Witness};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::regression::gain::Gain;
use crate::search::case::Whitened;
use crate::search::forward::chosen;
use crate::search::select::Trial;
use crate::search::selection::{MODEST, TOO_MODEST};
use crate::signal::along::Along;
use crate::signal::channel::Channel;

impl Progress {
    /// Looks at each effect again with the others in place: another may explain its part better, or its shape move, or
    /// nothing be left for it to explain. `true` if an effect was replaced or dropped.
    pub(super) fn reconsider(&mut self, fit: &Whitened, witness: &Witness) -> bool {
        let case = fit.case;
        let bare = fit.search(&[]);
        let mut changed = false;
        let mut k = 0;
        while k < self.found.len() {
            let mut others = self.found.clone();
            let own = others.remove(k);
            let mut known = self.known();
            known.remove(k);
            let mut search = bare.fork();
            others.iter().for_each(|h| search.add(h));
            let solution = search.normal.solve(None);
            let own = search.try_one(own, &solution);
            let own = search.at_best(&own);
            let (both, borne_out) = witness.weighed(&own, &others);
            let mut trials = search.trials(&solution);
            trials.retain(|trial| {
                !others
                    .iter()
                    .any(|known| same(known, &trial.hypothesis, case.balance))
            });
            let close = (0.9 * own.gain.fall).max(self.threshold);
            let contenders = self.contenders(&trials, &mut search, &known, close);
            let better = chosen(&contenders, |other| witness.weighed(&other.trial, &others))
                .best
                .filter(|(other, _)| *other > both + self.threshold)
                .map(|(_, trial)| trial);
            self.inseparable[k] = inseparable(
                better.as_ref().unwrap_or(&own),
                &contenders,
                self.threshold,
                case.balance,
            );
            let worth =
                self.threshold
                    .max(self.least_beside(&own.hypothesis, &known, case.balance));
            match better {
                Some(trial) => {
                    changed |= !same(&trial.hypothesis, &self.found[k], case.balance);
                    self.found[k] = trial.hypothesis;
                    self.falls[k] = trial.gain.fall;
                }
                None if own.gain.fall < worth || borne_out.is_err() => {
                    self.forget(k);
                    changed = true;
                    continue;
                }
                None => {
                    self.found[k] = own.hypothesis;
                    self.falls[k] = own.gain.fall;
                }
            }
            k += 1;
        }
        changed
    }

    /// Drops named effects that explain little beside the residual in the channel where they show: where most is of no
    /// kind, a part of it resembles some kind.
    pub(super) fn drop_modest(&mut self, fit: &Whitened) {
        let whitener = &fit.whitener;
        let bare = fit.search(&[]);
        let mut k = 0;
        while k < self.found.len() {
            let mut others = self.found.clone();
            let own = others.remove(k);
            let mut search = bare.fork();
            others.iter().for_each(|h| search.add(h));
            let solution = search.normal.solve(None);
            let left = search.normal.left_by_channel(&solution.values);
            let falls = search.fall_by_channel(&own);
            let channel = Channel::ALL
                .into_iter()
                .max_by(|a, b| falls[a.index()].total_cmp(&falls[b.index()]))
                .unwrap_or(Channel::Table);
            let fall = falls[channel.index()];
            let remains = left[channel.index()] - fall - whitener.rows(channel) as f64;
            if matches!(own.family, Family::Unnamed(_)) || fall > MODEST * remains {
                k += 1;
                continue;
            }
            let trial = search.try_one(own, &solution);
            self.doubtful.push(Doubt {
                trial,
                reason: TOO_MODEST,
                likeness: false,
            });
            self.forget(k);
        }
    }

    /// Drops the shapes of torques and forces without a name that a measured effect can have.
    pub(crate) fn drop_measurable(&mut self) {
        let is_measurable = |own: &Hypothesis| match own.family {
            Family::Unnamed(own) => {
                (own.is_force || matches!(own.channel, Channel::Torque(_)))
                    && !matches!(
                        own.along,
                        Along::Clock | Along::Time | Along::SinceReversal(_)
                    )
            }
            _ => false,
        };
        while let Some(k) = self.found.iter().position(is_measurable) {
            self.forget(k);
        }
    }

    /// Takes an effect back that the fit gave these linear parameters.
    pub(crate) fn take_back(
        &mut self,
        hypothesis: &Hypothesis,
        values: Vec<f64>,
        reason: &'static str,
    ) {
        let Some(k) = self.found.iter().position(|known| known == hypothesis) else {
            return;
        };
        let gain = Gain {
            fall: self.falls[k],
            values,
        };
        let trial = Trial {
            hypothesis: *hypothesis,
            gain,
        };
        self.doubtful.push(Doubt {
            trial,
            reason,
            likeness: true,
        });
        self.forget(k);
    }

    /// Takes an effect back with all that was noted of it.
    fn forget(&mut self, k: usize) {
        self.found.remove(k);
        self.falls.remove(k);
        self.rivals.remove(k);
        self.inseparable.remove(k);
    }
}
