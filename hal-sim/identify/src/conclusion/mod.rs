//! From a finished search to figures: parameters with intervals, residuals before and after, the new model.

pub mod channels;
pub mod correction;
pub mod curves;
pub(crate) mod figures;
pub mod interval;
pub mod outcome;
pub(crate) mod possible;
pub(crate) mod recalibrated;
pub(crate) mod remains;
pub mod rest;
pub mod said;
mod steps;
pub(crate) mod unexplained;
pub mod verdict;

use crate::conclusion::channels::ChannelRest;
use crate::conclusion::curves::{Learned, described, divide, learned};
use crate::conclusion::figures::{figures, table_force};
use crate::conclusion::interval::may_be_nothing;
use crate::conclusion::outcome::{Bandwidth, Coordinates, Found, Outcome, Rival, Unexplained};
use crate::conclusion::possible::curved;
use crate::conclusion::recalibrated::{
    Released, angle_zeros, at_ends, calibration, curve_shares, load_nm, names_at_ends, new_model,
    released,
};
use crate::conclusion::remains::{Fixed, Side, judged_hz};
use crate::conclusion::rest::NO_SHAPE;
use crate::conclusion::steps::step_beyond_ramp;
use crate::conclusion::unexplained::{Left, along, unexplained};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::parameter::{MotorParameter, Parameter};
use crate::regression::column::Column;
use crate::regression::design::Whitener;
use crate::regression::normal::Solution;
use crate::search::case::Case;
use crate::search::linearised::Linearised;
use crate::search::progress::Progress;
use crate::search::select::Search;
use crate::search::selection::{
    ANOTHER_LAW, CONFIRMED, DOMINANT, LACK_OF_FIT, MAY_BE_NOTHING, MORE_IS_LEFT, NOT_BORNE_OUT,
    OF_PLATE_VALUES, PART_OF_A_SHAPE, PLATE_IS_OFF, threshold,
};
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use crate::signal::signals::{SPEED_BANDWIDTH_HZ, angle_noise, current_noise};
use plant::Axis;
use plant::effects::EffectModel;

/// Draws the conclusion of a search.
pub(crate) fn conclude(case: Case, check: Case, noise: Noise, mut progress: Progress) -> Outcome {
    let rows = check.whitener(&check.declared).used_rows();
    // A name that leaves more than it explains only resembles the cause. Without it the residual is described again.
    loop {
        let outcome = concluded(&case, &check, &noise, &progress);
        let unsound = faint(&outcome, CONFIRMED * threshold(rows))
            .map(|found| (found, NOT_BORNE_OUT))
            .or_else(|| Some((likeness(&outcome)?, MORE_IS_LEFT)))
            .or_else(|| Some((shadow(&outcome)?, OF_PLATE_VALUES)))
            .or_else(|| Some((misfit(&outcome)?, ANOTHER_LAW)))
            .or_else(|| Some((stepping(&outcome)?, ANOTHER_LAW)))
            .or_else(|| Some((of_the_plate(&outcome)?, PLATE_IS_OFF)))
            .or_else(|| {
                let mut effects = outcome.effects.iter();
                Some((effects.find(|own| may_be_nothing(own))?, MAY_BE_NOTHING))
            });
        match unsound {
            Some((found, reason)) => {
                progress.take_back(&found.hypothesis, found.values.clone(), reason);
            }
            None => {
                let outcome = with_curves(&case, &check, &noise, &mut progress, outcome);
                let released = match outcome.may_have_a_wrong_plate() {
                    true => released_in(&case, &noise, &progress.found),
                    false => Vec::new(),
                };
                return Outcome {
                    refused: case.balance.refusals.list(),
                    released,
                    ..outcome
                };
            }
        }
    }
}

/// See [`released`], of what was found.
fn released_in(case: &Case, noise: &Noise, found: &[Hypothesis]) -> Vec<Vec<Released>> {
    let whitener = case.whitener(noise);
    let normal = case.search(&whitener, found).normal;
    released(case, &normal, whitener.used_rows() as f64)
}

/// An outcome with what predicts the rest as measured effects, where the check record bears them out in a model with plate values
/// of their own.
fn with_curves(
    case: &Case,
    check: &Case,
    noise: &Noise,
    progress: &mut Progress,
    outcome: Outcome,
) -> Outcome {
    let quiet = outcome.channels.iter().all(|rest| rest.levels[1].quiet());
    if quiet && outcome.unexplained.is_empty() {
        return outcome;
    }
    let described = described(case, noise, &progress.found);
    progress.drop_measurable();
    let (names, learned) = loop {
        let names = concluded(case, check, noise, progress);
        let learned = learned([case, check], noise, &progress.found, &names.channels);
        let part = names.effects.iter().find(|found| {
            let is_part = |curve: &Learned| curve.has_part(&found.effect, found.check_fall);
            found.hypothesis.family == Family::AngleTorque && learned.iter().any(is_part)
        });
        match part {
            Some(found) => {
                progress.take_back(&found.hypothesis, found.values.clone(), PART_OF_A_SHAPE);
            }
            None => break (names, learned),
        }
    };
    let excess = |outcome: &Outcome| -> f64 {
        let levels = outcome.channels.iter().map(|rest| rest.levels[1].excess);
        levels.sum()
    };
    let curved = [learned, described].into_iter().filter_map(|curves| {
        let (curved, curves) = curved([case, check], noise, progress, curves)?;
        Some((excess(&curved), curved, curves))
    });
    let best = curved.min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((left, curved, mut curves)) = best else {
        return outcome.or_names(names, excess);
    };
    let rows = check.whitener(&check.declared).used_rows();
    let fall = excess(&names) - left;
    divide(&mut curves, fall, case.balance.lead);
    let mut channels = names.channels.iter().zip(&curved.channels);
    let worse = channels
        .any(|(before, after)| after.figures.check_after > MOST_WORSE * before.figures.check_after);
    // A shape over another coordinate that explains far more, and that no measured effect can have, tells better what is there.
    let is_there = fall > OF_THE_SHAPE * (excess(&names) - excess(&outcome));
    let least = (CONFIRMED * threshold(rows)).max(LEAST_OF_EXCESS * excess(&names));
    match fall > least && is_there && !worse {
        true => curved.of_curves(names, outcome, curves),
        false => outcome.or_names(names, excess),
    }
}

/// Error of a channel's check record by which curves may raise it.
const MOST_WORSE: f64 = 1.02;
/// Share of what is beyond the noise floor of the check record that curves must take: less tells no coordinate.
const LEAST_OF_EXCESS: f64 = 0.1;
/// Share of what the best shapes without a name explain that measured effects must. Of 34 drawn cases none lies between 0.67 and 0.98.
const OF_THE_SHAPE: f64 = 0.75;

/// The weakest effect that with all others in place explains less of either record than it must.
fn faint(outcome: &Outcome, on_check: f64) -> Option<&Found> {
    let weak = outcome
        .effects
        .iter()
        .filter(|found| found.check_fall < on_check || found.fall < outcome.threshold);
    weak.min_by(|a, b| a.check_fall.total_cmp(&b.check_fall))
}

/// An effect that differs along a coordinate, beside which a curve is left where it shows: a lack of fit, its law is another.
/// The coordinate of the curve does not matter: in a record that goes from speed to speed all of them are curves over
/// time.
fn misfit(outcome: &Outcome) -> Option<&Found> {
    let is_left = |left: &Unexplained| {
        left.coordinate != NO_SHAPE && left.order.is_none() && left.hz.is_none()
    };
    outcome.effects.iter().find(|found| {
        outcome.unexplained.iter().any(|left| {
            // As much as a record must confirm of an effect: less is chance's.
            let least = (CONFIRMED * outcome.threshold).max(LACK_OF_FIT * found.fall);
            is_curve(found) && is_left(left) && left.channel == found.shows && left.fall > least
        })
    })
}

/// A drift of which the records rather have a step.
fn stepping(outcome: &Outcome) -> Option<&Found> {
    let mut effects = outcome.effects.iter();
    effects.find(|found| {
        let beyond = found.step_beyond_ramp;
        beyond.is_some_and(|beyond| beyond > outcome.threshold)
    })
}

/// Share of what an effect explains by which a plate value may explain less, and the record does not tell one from the other.
const A_TRACE: f64 = 0.02;

/// The weakest effect of those that a plate value beyond its tolerance explains as well, on both records.
fn of_the_plate(outcome: &Outcome) -> Option<&Found> {
    let effects = outcome.effects.iter();
    let worse = effects.filter(|found| {
        let beyond = found.plate_beyond;
        let falls = [found.fall, found.check_fall];
        let least = |fall: f64| -(A_TRACE * fall).max(outcome.threshold);
        beyond.is_some_and(|beyond| {
            beyond
                .iter()
                .zip(falls)
                .all(|(more, fall)| *more > least(fall))
        })
    });
    worse.min_by(|a, b| a.check_fall.total_cmp(&b.check_fall))
}

/// Whether an effect differs along a coordinate and does not repeat.
fn is_curve(found: &Found) -> bool {
    along(&found.hypothesis).is_some_and(|along| !along.repeats())
}

/// An effect that differs along a coordinate and explains less of its channel than a curve without a name that shows in another one does
/// there: plate values that both channels share were wrong without the curve, and still are by what it lacks.
fn shadow(outcome: &Outcome) -> Option<&Found> {
    let mut curves = outcome.effects.iter().filter(|found| is_curve(found));
    curves.find(|found| found.fall < outcome.by_plate[found.shows.index()])
}

/// The weakest effect that does not explain enough beside the residual where it shows most: of what may resemble any slow shape all but a
/// third of the amplitude.
fn likeness(outcome: &Outcome) -> Option<&Found> {
    let left = |found: &Found| {
        let excess = |rest: &ChannelRest| rest.levels[1].excess;
        let own = outcome
            .channels
            .iter()
            .find(|rest| rest.channel == found.shows);
        own.map_or(0.0, excess)
    };
    let weak = outcome.effects.iter().filter(|found| {
        // Less than an effect must explain tells no law.
        let is_law = is_curve(found) && left(found) > outcome.threshold;
        let least = if is_law {
            LACK_OF_FIT.recip()
        } else {
            DOMINANT
        };
        found.check_fall < least * left(found)
    });
    weak.min_by(|a, b| a.check_fall.total_cmp(&b.check_fall))
}

/// The regressions that weigh the effects.
struct Weighing<'s> {
    case: &'s Case<'s>,
    progress: &'s Progress,
    /// Fit and check record without effects.
    bare: [&'s Search<'s>; 2],
    /// The fit record with all effects.
    search: &'s Search<'s>,
    solution: &'s Solution,
    /// What all effects take of the fit record's sum of squares.
    excess: f64,
}

impl Weighing<'_> {
    /// Weighs an effect that has the parameters `values`, and beside them their covariance and the shape's standard deviation.
    /// The second result is how far the effect lowers each channel's sum of squares.
    fn effect(
        &self,
        k: usize,
        values: Vec<f64>,
        (covariance, shape_sigma): (Vec<f64>, f64),
    ) -> (Option<Found>, [f64; Channel::COUNT]) {
        let hypothesis = &self.progress.found[k];
        let [fit, check] = self.bare;
        let mut without = self.beside_others(fit, k);
        let without_solution = without.normal.solve(None);
        let falls = without.fall_by_channel(hypothesis);
        let step_of_fit = step_beyond_ramp(&mut without, hypothesis);
        let fall = without.normal.cost(&without_solution.values)
            - self.search.normal.cost(&self.solution.values);
        let ends = self.at_their_ends(&without_solution);
        let plate_of_fit = without.normal.fall_without_priors(&ends) - fall;
        let first = without.normal.len();
        without.add(hypothesis);
        let refined = refined(self.case, self.solution, hypothesis, &values);
        let effect = self.in_model(hypothesis, &refined);
        let mut beside = self.beside_others(check, k);
        let check_fall = beside.fall_at(hypothesis, &values);
        let step_of_check = step_beyond_ramp(&mut beside, hypothesis);
        let plate_of_check = beside.normal.fall_without_priors(&ends) - check_fall;
        let found = effect.map(|effect| Found {
            hypothesis: *hypothesis,
            shows: most_shown(&falls),
            check_fall,
            step_beyond_ramp: step_of_fit
                .zip(step_of_check)
                .map(|(fit, check)| fit + check),
            plate_beyond: (!ends.is_empty()).then_some([plate_of_fit, plate_of_check]),
            values,
            covariance,
            shape_sigma,
            effect,
            explained: (fall / self.excess).clamp(0.0, 1.0),
            fall,
            fall_at: without.normal.falls(first, false),
            held_back: without.normal.falls(first, true),
            rivals: self.progress.rivals.get(k).cloned().unwrap_or_default(),
            inseparable: self.progress.inseparable[k]
                .iter()
                .map(|trial| {
                    let rival = &trial.gain.values;
                    Rival {
                        hypothesis: trial.hypothesis,
                        effect: self.in_model(&trial.hypothesis, rival),
                        behind: fall - trial.gain.fall,
                        check_behind: check_fall - beside.fall_at(&trial.hypothesis, rival),
                    }
                })
                .collect(),
        });
        (found, falls)
    }

    /// Plate values that are at an end of their tolerance with all effects in place or `without` one; none if none is with all in place.
    fn at_their_ends(&self, without: &Solution) -> Vec<usize> {
        let with = at_ends(self.case, self.solution);
        match with.is_empty() {
            true => with,
            false => [with, at_ends(self.case, without)].concat(),
        }
    }

    /// A record with all effects but one.
    fn beside_others<'w>(&self, bare: &Search<'w>, own: usize) -> Search<'w> {
        let mut beside = bare.fork();
        for (k, other) in self.progress.found.iter().enumerate() {
            if k != own {
                beside.add(other);
            }
        }
        beside
    }

    /// An effect in the words of a model file.
    fn in_model(&self, hypothesis: &Hypothesis, values: &[f64]) -> Option<EffectModel> {
        hypothesis.effect(self.case.balance.model, self.search.run_s(), values)
    }
}

/// The channel in which an effect shows most.
fn most_shown(falls: &[f64; Channel::COUNT]) -> Channel {
    Channel::ALL
        .into_iter()
        .max_by(|a, b| falls[a.index()].total_cmp(&falls[b.index()]))
        .unwrap_or(Channel::Table)
}

/// Adds to `by_plate` what a curve without a name explains of channels that it does not act on.
/// It does so by way of plate values.
fn add_by_plate(
    by_plate: &mut [f64; Channel::COUNT],
    hypothesis: &Hypothesis,
    falls: &[f64; Channel::COUNT],
) {
    if let Family::Unnamed(unnamed) = hypothesis.family
        && !unnamed.along.repeats()
        && !unnamed.is_force
    {
        let others = Channel::ALL.into_iter().filter(|c| *c != unnamed.channel);
        others.for_each(|c| by_plate[c.index()] += falls[c.index()].max(0.0));
    }
}

/// The residual of each of the machine's channels. `white` is the fit record's whitened residual.
fn rests(
    case: &Case,
    noise: &Noise,
    whitener: &Whitener,
    fit: &Side,
    check: &Fixed,
    white: &Column,
) -> Vec<ChannelRest> {
    let channels = case.balance.signals.machine.channels().iter();
    channels
        .map(|&channel| {
            let index = channel.index();
            let open = whitener.mask(channel).to_vec();
            ChannelRest {
                channel,
                figures: figures(
                    [&fit.before[index], &fit.after[index]],
                    &open,
                    [&check.before[index], &check.after[index]],
                    &check.masks[index],
                    noise.floor(channel, case.balance.fourier),
                    white.parts[index].as_deref().unwrap_or_default(),
                ),
                residual: [fit.before[index].clone(), fit.after[index].clone()],
                levels: check.levels[index],
                band_hz: judged_hz(channel, noise),
                open,
            }
        })
        .collect()
}

/// The figures of effects as they are, whether they stand or not.
pub(crate) fn concluded(case: &Case, check: &Case, noise: &Noise, progress: &Progress) -> Outcome {
    let whitener = case.whitener(noise);
    let found = &progress.found;
    let plain = case.search(&whitener, &[]);
    let plain_solution = plain.normal.solve(None);
    let mut linearised = Linearised::new(&plain, found);
    let (search, solution) = (linearised.search.fork(), linearised.solution.clone());
    let check_noise = check.noise(None, found);
    let of_check = check.whitener(&check_noise);
    let heard = check.search(&of_check, &[]);
    let weighing = Weighing {
        case,
        progress,
        bare: [&plain, &heard],
        search: &search,
        solution: &solution,
        excess: plain.normal.cost(&plain_solution.values) - search.normal.cost(&solution.values),
    };
    let (mut effects, mut parts) = (Vec::new(), Vec::new());
    let mut by_plate = [0.0; Channel::COUNT];
    let mut at = case.base.parameters.len();
    for (k, hypothesis) in found.iter().enumerate() {
        let columns = hypothesis.columns();
        let values: Vec<f64> = solution.values.rows(at, columns).iter().copied().collect();
        parts.push((*hypothesis, values.clone()));
        let uncertainty = linearised.uncertainty(hypothesis, k);
        let (effect, falls) = weighing.effect(k, values, uncertainty);
        add_by_plate(&mut by_plate, hypothesis, &falls);
        effects.extend(effect);
        at += columns + hypothesis.nuisances();
    }
    effects.sort_by(|a, b| b.fall.total_cmp(&a.fall));

    let fit = Side::new(
        case,
        noise,
        &whitener,
        &plain.normal,
        &plain_solution,
        &search,
        &solution,
    );
    let fixed = Fixed::new(case, check, &check_noise, found, &plain_solution, &solution);
    let white = search.normal.residual(&solution.values);
    let channels = rests(case, noise, &whitener, &fit, &fixed, &white);
    let left = Left {
        cases: [case, check],
        whiteners: [&whitener, &of_check],
        white: [&white, &fixed.white],
        alone: found.is_empty(),
    };
    let machine = case.balance.signals.machine;
    let doubts = progress.doubtful.iter();
    Outcome {
        curve_shares: curve_shares(case, &solution),
        model: new_model(
            case,
            &solution,
            effects.iter().map(|found| found.effect.clone()),
        ),
        calibration: calibration(case, &solution),
        unexplained: unexplained(&left, &parts, &progress.doubtful, &channels),
        bandwidth: bandwidth(case, noise),
        effects,
        last: progress.last.clone(),
        tried: progress.tried,
        threshold: progress.threshold,
        coordinates: Coordinates::new(case.balance.signals, case.balance.fourier.step()),
        table_force: machine
            .has_feed()
            .then(|| table_force(case.balance, &channels, &fixed, &white)),
        channels,
        by_plate,
        at_ends: names_at_ends(case, &solution),
        released: Vec::new(),
        correction: None,
        load_nm: load_nm(case, &solution),
        angle_zeros: angle_zeros(case, &solution),
        curves: Vec::new(),
        doubts: doubts
            .map(|doubt| (doubt.trial.hypothesis, doubt.reason))
            .collect(),
        refused: case.balance.refusals.list(),
        machine,
    }
}

/// The bandwidths that the noise left.
fn bandwidth(case: &Case, noise: &Noise) -> Bandwidth {
    let sensing = &case.balance.model.sensing;
    let current = current_noise(sensing);
    Bandwidth {
        balance_hz: noise.top(Channel::Torque(Axis::Screw)),
        table_hz: noise.top(Channel::Table),
        speed_hz: SPEED_BANDWIDTH_HZ,
        even_hz: Axis::ALL.map(|axis| {
            let motor = case.balance.model.motor(axis);
            let constant = f64::from(motor.pole_pairs) * motor.flux_wb;
            let torque = (2.0 * current).sqrt() * constant;
            let angle = angle_noise(sensing, axis);
            let acceleration = torque / (motor.inertia_kg_m2 * angle.sqrt());
            acceleration.sqrt() / std::f64::consts::TAU
        }),
    }
}

/// Parameters of an effect that is a share of a plate's value, or shows by the torque that the plate's flux makes of it, by that value
/// as the record has it: the regression counts them of the declared one.
fn refined(case: &Case, solution: &Solution, hypothesis: &Hypothesis, values: &[f64]) -> Vec<f64> {
    let of = match hypothesis.family {
        Family::ResistanceDrift => MotorParameter::Resistance,
        Family::CurrentOffset | Family::CurrentGain | Family::FluxDrift | Family::FluxHarmonic => {
            MotorParameter::Flux
        }
        _ => return values.to_vec(),
    };
    let own = |(parameter, _): &(Parameter, _)| {
        hypothesis
            .axis()
            .is_some_and(|axis| *parameter == Parameter::Motor(axis, of))
    };
    let place = case.base.parameters.iter().position(own);
    let change = place.map_or(0.0, |at| solution.values[at]);
    values.iter().map(|value| value / (1.0 + change)).collect()
}
