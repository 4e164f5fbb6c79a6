//! The report of what the engine traced, whatever the machine.

use super::{
    Alias, Calibrated, Channel, Coordinate, Effect, Left, Measured, Report, Residual, Selection,
    Tried,
};
use crate::analysis::{Bandwidth, ChannelRest, Figures, Found, Outcome, Rival, TableForce};
use crate::conclusion::curves::Learned;
use crate::conclusion::interval::estimates;
use crate::conclusion::verdict::Judged;
use crate::effects::family::Family;
use crate::machines::Machine;
use crate::records::DataQuality;
use crate::regression::sandwich::interval;
use crate::search::select::Trial;
use crate::signal::channel::Channel as Balance;
use plant::Axis;
use plant::effects::{AnyEffect, Kind, Place};
use plant::model::{FeedModel, Model};

/// Name of the channel that follows from the torques.
const TABLE_FORCE: &str = "table force";
const RELATIVE: &str = "Angle of screw against nut, turns";
const RELATIVE_SPEED: &str = "Speed of screw against nut, rad/s";
/// Trials that lost, listed for each step.
const LISTED: usize = 8;

/// Of what was traced, from the records `accounts`.
pub fn traced(outcome: &Outcome, accounts: [DataQuality; 2]) -> Report {
    let machine = outcome.machine;
    let judged = outcome.judged();
    Report {
        verdict: judged.verdict.name(),
        summary: judged.said.sentence(),
        said: judged.said.clone(),
        demo_seed: None,
        effects: outcome
            .effects
            .iter()
            .map(|found| effect(found, outcome, &judged))
            .chain(
                outcome
                    .curves
                    .iter()
                    .map(|curve| learned(curve, machine, &judged)),
            )
            .collect(),
        residual: outcome
            .channels
            .iter()
            .map(|rest| {
                let (name, unit) = (machine.name(rest.channel), machine.unit(rest.channel));
                residual(name, unit, &rest.figures)
            })
            .chain(
                outcome
                    .table_force
                    .iter()
                    .map(|force| residual(TABLE_FORCE, "N", &force.figures)),
            )
            .collect(),
        refused: outcome.refused.clone(),
        unexplained: outcome
            .unexplained
            .iter()
            .map(|left| Left {
                channel: machine.name(left.channel).into(),
                coordinate: alone(machine, left.coordinate),
                order: left.order,
                hz: left.hz,
                size: left.size,
                unit: machine.unit(left.channel).into(),
                reason: left.reason.clone(),
            })
            .collect(),
        calibration: outcome
            .calibration
            .iter()
            .map(|(parameter, relative_change, sigma)| Calibrated {
                parameter: parameter.clone(),
                relative_change: *relative_change,
                sigma: *sigma,
                value: None,
                unit: None,
            })
            .collect(),
        correction: outcome.correction.clone(),
        derivatives: derivatives(outcome),
        selection: selection(outcome),
        simulation: None,
        stages: Vec::new(),
        records: accounts.into(),
        channels: outcome
            .channels
            .iter()
            .map(|rest| channel(rest, outcome))
            .chain(
                outcome
                    .table_force
                    .iter()
                    .map(|force| table_force(force, outcome)),
            )
            .collect(),
        time: outcome.coordinates.time.clone(),
        model: model_toml(outcome),
    }
}

fn residual(name: &str, unit: &str, figures: &Figures) -> Residual {
    Residual {
        channel: name.into(),
        unit: unit.into(),
        fit_before: figures.fit_before,
        fit_after: figures.fit_after,
        check_before: figures.check_before,
        check_after: figures.check_after,
        check_signal: None,
        noise_floor: figures.noise_floor,
        whiteness: figures.whiteness,
    }
}

/// A coordinate's name: of a motor alone, the motor's.
fn alone(machine: &dyn Machine, coordinate: &str) -> String {
    match machine.has_feed() {
        true => coordinate.into(),
        false => coordinate.replace("the screw", "the motor"),
    }
}

/// The model file: of a motor alone its table and its effects.
fn model_toml(outcome: &Outcome) -> String {
    let whole = outcome.model.to_toml();
    if outcome.machine.has_feed() {
        return whole;
    }
    // Everything but nut and feed, which a motor alone does not have.
    let mut text = String::new();
    let mut kept = true;
    for line in whole.lines() {
        if line.starts_with('[') {
            kept = !(line.contains("nut") || line.contains("feed"));
        }
        if kept {
            text += &line
                .replace("[screw]", "[motor]")
                .replace("[[screw.", "[[motor.");
            text.push('\n');
        }
    }
    text.replace("where = \"screw\"", "where = \"motor\"")
}

fn effect(found: &Found, outcome: &Outcome, judged: &Judged) -> Effect {
    let machine = outcome.machine;
    let estimates = estimates(found);
    let value = |name: &str| estimates.iter().find(|e| e.name == name).map(|e| e.value);
    let (kind, place) = (found.effect.effect().kind(), found.effect.place());
    let (order, hz) = (value("order"), value("hz"));
    let with_units = estimates.into_iter().map(|estimate| {
        let unit = match unit(kind, place, &estimate.name) {
            "N m" => machine.unit(Balance::Torque(Axis::Screw)),
            other => other,
        };
        (estimate, unit)
    });
    let softer = softer_screw(found, &outcome.model);
    let candidates = match softer {
        Some(_) => LOST_MOTION,
        None => candidates_of_order(kind),
    };
    let by_order = || {
        let all = candidates.join(", ");
        format!("the record shows the order, not the cause; candidates: {all}")
    };
    Effect {
        order,
        hz,
        held_back: held_back(found),
        shows: Some(machine.name(shown_by(found)).into()),
        suggests: softer.or_else(|| (!candidates.is_empty()).then(by_order)),
        candidates,
        not_separable: found
            .inseparable
            .iter()
            .filter_map(|rival| alias(rival, machine))
            .collect(),
        ..Effect::new(
            kind,
            machine.place(place),
            judged.share(found.check_fall),
            with_units,
        )
    }
}

/// The channel that an effect's sentence names: a torque, or where it shows most.
fn shown_by(found: &Found) -> Balance {
    let is_torque = matches!(
        found.hypothesis.family,
        Family::AngleTorque | Family::TimePeriodic | Family::CurrentOffset | Family::CurrentGain
    );
    match Axis::ALL.map(|axis| (axis, found.effect.place() == axis.into())) {
        [(axis, true), _] | [_, (axis, true)] if is_torque => Balance::Torque(axis),
        _ => found.shows,
    }
}

/// Candidates for the cause of a torque over a motor's angle. The record shows its order; the kind follows from the order by a rule
/// (`Hypothesis::effect`).
fn candidates_of_order(kind: &str) -> &'static [&'static str] {
    match kind {
        "coupling_misalignment" => &["misaligned coupling", "eccentric rotor", "eccentric load"],
        "cogging" => &["cogging of poles or slots", "a part that passes as often"],
        "torque_harmonic" => &[
            "harmonics of current or flux",
            "cogging that repeats as often",
        ],
        _ => &[],
    }
}

/// Causes of a motion that is lost at a reversal.
const LOST_MOTION: &[&str] = &["backlash", "axial_compliance"];

/// The other candidate of a backlash.
fn softer_screw(found: &Found, model: &Model) -> Option<String> {
    let AnyEffect::Backlash(backlash) = found.effect.effect() else {
        return None;
    };
    let softest = stiffness_of_lost_motion(backlash.value, &model.feed)?;
    let is_guess = model
        .measured
        .is_some_and(|measured| measured.feed.is_none());
    let guess = match is_guess {
        true => ", which its commissioning did not measure",
        false => "",
    };
    Some(format!(
        "or a screw of at most {:.3} N/um, which friction winds up at a reversal; the model has {:.3} N/um{guess}",
        1e-6 * softest,
        1e-6 * model.feed.axial_stiffness_n_per_m
    ))
}

/// Stiffness of a screw, N/m, that loses so many metres more at a reversal than the model's. Friction `F` of the table winds a screw of
/// stiffness `k` up by `F / k` in either direction. No more than the friction that the motors feel is the table's. None without friction.
fn stiffness_of_lost_motion(lost_m: f64, feed: &FeedModel) -> Option<f64> {
    let pair_n = feed.pair_coulomb_nm / feed.travel_per_radian().abs();
    let friction_n = feed.guideway_coulomb_n + pair_n;
    let per_newton = 1.0 / feed.axial_stiffness_n_per_m + lost_m / (2.0 * friction_n);
    (friction_n > 0.0).then(|| 1.0 / per_newton)
}

/// A curve without a name.
fn learned(curve: &Learned, machine: &dyn Machine, judged: &Judged) -> Effect {
    let place = curve.effect.place();
    let (values, at) = (curve.values(), &curve.at);
    let count = values.len().max(1) as f64;
    let mean = |of: &dyn Fn(usize) -> f64| (0..values.len()).map(of).sum::<f64>() / count;
    let size = mean(&|k| values[k].powi(2)).sqrt();
    let variance = mean(&|k| curve.sigmas[k].powi(2));
    let unit = match place {
        Place::Feed => "N",
        _ => machine.unit(Balance::Torque(Axis::Screw)),
    };
    let points = values.iter().zip(&curve.sigmas);
    Effect {
        order: curve.order,
        shows: Some(machine.name(curve.shows()).into()),
        curve: Some(Measured {
            coordinate: curve.along.clone(),
            range: [0, at.len().saturating_sub(1)].map(|k| at.get(k).copied().unwrap_or(0.0)),
            at: at.clone(),
            value: values.to_vec(),
            interval: points.map(|(v, s)| interval(*v, s * s)).collect(),
        }),
        suggests: Some(format!("no cause is named; a curve over {}", curve.along)),
        ..Effect::fitted(
            "measured",
            machine.place(place),
            judged.share(curve.fall),
            [("rms", [size, variance], unit)],
        )
    }
}

/// Shares of what each operating point has of an effect; of those that have nothing of it, nothing is said.
fn held_back(found: &Found) -> Vec<f64> {
    let shares = found.held_back.iter().zip(&found.fall_at);
    shares
        .filter(|(_, fall)| **fall > found.fall / 1000.0)
        .map(|(held_back, fall)| held_back / fall)
        .collect()
}

fn alias(rival: &Rival, machine: &dyn Machine) -> Option<Alias> {
    let effect = rival.effect.as_ref()?;
    let parameters = effect.effect().parameters();
    Some(Alias {
        kind: effect.effect().kind().into(),
        place: machine.place(effect.place()).into(),
        parameters: parameters
            .into_iter()
            .filter(|(name, _)| name != "duration_s")
            .collect(),
        // Half of a sum of squares in units of the noise.
        behind: 0.5 * rival.behind,
        check_behind: 0.5 * rival.check_behind,
    })
}

fn derivatives(outcome: &Outcome) -> String {
    let Bandwidth {
        balance_hz,
        table_hz,
        speed_hz,
        even_hz,
    } = &outcome.bandwidth;
    if !outcome.machine.has_feed() {
        return format!(
            "Derivatives are taken in the frequency domain over the whole record, without phase, and compared up to \
             {balance_hz:.0} Hz. From {:.0} Hz on the encoder's noise, differentiated twice, outweighs the current \
             sensor's: weights fall there with the fourth power.",
            even_hz[0]
        );
    }
    format!(
        "Derivatives are taken in the frequency domain over the whole record, without phase. Torque and voltage balances are \
         compared up to {balance_hz:.0} Hz, the table up to {table_hz:.0} Hz. From {:.0} Hz (screw) and {:.0} Hz (nut) on the \
         encoder's quantisation, differentiated twice, outweighs the current sensors' noise: weights fall there with the \
         fourth power. Speeds in friction and back-EMF have {speed_hz:.0} Hz.",
        even_hz[0], even_hz[1]
    )
}

fn unit(kind: &str, place: Place, name: &str) -> &'static str {
    match (kind, name) {
        ("torque_harmonic" | "flux_harmonic", "order") => "per electrical turn",
        ("lead_error" | "ball_passage", "order") => "per turn of screw against nut",
        ("current_offset", _) => "A",
        ("dead_time", _) => "V",
        ("encoder_eccentricity", "amplitude") => "rad",
        ("lead_error" | "backlash", "amplitude" | "value") => "m",
        ("flux_harmonic", "amplitude") => "of the flux",
        ("stribeck_friction", "amplitude") if place == Place::Feed => "N",
        ("stribeck_friction", "speed") if place == Place::Feed => "m/s",
        ("stribeck_friction", "speed") => "rad/s",
        (_, "hz") => "Hz",
        (_, "phase") => "rad",
        (_, "order") => "per turn",
        (_, "amplitude") => "N m",
        _ => AnyEffect::kind_named(kind)
            .and_then(Kind::linear)
            .filter(|linear| linear.number == name)
            .map_or("", |linear| linear.unit),
    }
}

fn selection(outcome: &Outcome) -> Selection {
    let machine = outcome.machine;
    let tried = |trial: &Trial, outcome: String| Tried {
        hypothesis: trial.hypothesis.name().into(),
        place: machine.place(trial.hypothesis.place).into(),
        shape: (trial.hypothesis.shape != 0.0).then_some(trial.hypothesis.shape),
        fall: trial.gain.fall.max(0.0),
        outcome,
    };
    let mut trials = Vec::new();
    for found in &outcome.effects {
        let name = found.effect.effect().kind();
        trials.push(Tried {
            hypothesis: name.into(),
            place: outcome.machine.place(found.effect.place()).into(),
            shape: (found.hypothesis.shape != 0.0).then_some(found.hypothesis.shape),
            fall: found.fall,
            outcome: format!("found; {:.0} on the check record", found.check_fall),
        });
        let lost = format!("explained less than {name}, and nothing beside it");
        trials.extend(
            found
                .rivals
                .iter()
                .take(LISTED)
                .map(|rival| tried(rival, lost.clone())),
        );
    }
    trials.extend(
        outcome
            .last
            .iter()
            .take(LISTED)
            .map(|trial| tried(trial, lost(trial, outcome))),
    );
    Selection {
        rule: format!(
            "Besides the list, all orders from 0.3 to 126 per turn and all frequencies are scanned. Each effect costs the \
             threshold: by that it must lower the sum of squares over all channels of the fit record, in units of the noise, where \
             the best of a million orders and hypotheses reaches about {:.0} in noise; and with the same parameters by a quarter \
             of it, row for row, on the check record, at other operating points. Where a shape of no kind explains twice as much \
             as any hypothesis, none is named.",
            2.0 * 1e6_f64.ln()
        ),
        tried: outcome.tried,
        threshold: outcome.threshold,
        measure: "fall of the sum of squares, in units of the noise",
        trials,
    }
}

/// Why a hypothesis of the last step was not taken.
fn lost(trial: &Trial, outcome: &Outcome) -> String {
    let doubt = outcome
        .doubts
        .iter()
        .find(|(hypothesis, _)| *hypothesis == trial.hypothesis);
    match doubt {
        Some((_, reason)) => (*reason).into(),
        None if trial.gain.fall > outcome.threshold => {
            "what it explains is what a better hypothesis explains, or what the simplifications of a named effect leave".into()
        }
        None => "below the threshold".into(),
    }
}

fn coordinate(title: &str, folded: bool, values: &[f64]) -> Coordinate {
    Coordinate {
        title: title.into(),
        folded,
        values: values.to_vec(),
    }
}

fn channel(rest: &ChannelRest, outcome: &Outcome) -> Channel {
    let at = &outcome.coordinates;
    let relative = coordinate(RELATIVE, true, &at.relative);
    let time = coordinate("Time, s", false, &at.time);
    let (turn, mut over) = match rest.channel {
        Balance::Table => {
            let speed = coordinate(RELATIVE_SPEED, false, &at.relative_speed);
            let position = coordinate("Position of the table, m", false, &at.table);
            (relative, vec![position, speed])
        }
        Balance::Torque(axis) | Balance::VoltageD(axis) | Balance::VoltageQ(axis) => {
            let name = match axis {
                _ if !outcome.machine.has_feed() => "motor",
                Axis::Screw => "screw",
                Axis::Nut => "nut",
            };
            let k = axis.index();
            let speed = coordinate(&format!("Speed of the {name}, rad/s"), false, &at.speed[k]);
            (
                coordinate(&format!("Angle of the {name}, turns"), true, &at.angle[k]),
                match outcome.machine.has_feed() {
                    true => vec![relative, speed],
                    false => vec![speed],
                },
            )
        }
    };
    over.push(time);
    Channel {
        name: outcome.machine.name(rest.channel).into(),
        unit: outcome.machine.unit(rest.channel).into(),
        residual: rest.residual.clone(),
        open: rest.open.clone(),
        turn,
        marks: marks(rest.channel, outcome),
        over,
    }
}

fn table_force(force: &TableForce, outcome: &Outcome) -> Channel {
    let at = &outcome.coordinates;
    Channel {
        name: TABLE_FORCE.into(),
        unit: "N".into(),
        residual: force.residual.clone(),
        open: force.open.clone(),
        turn: coordinate(RELATIVE, true, &at.relative),
        marks: Vec::new(),
        over: vec![
            coordinate("Position of the table, m", false, &at.table),
            coordinate(RELATIVE_SPEED, false, &at.relative_speed),
            coordinate("Time, s", false, &at.time),
        ],
    }
}

/// The orders per turn of a channel's own angle at which effects were found.
fn marks(channel: Balance, outcome: &Outcome) -> Vec<(f64, String)> {
    let pole_pairs = |axis: Axis| f64::from(outcome.model.motor(axis).pole_pairs);
    outcome
        .effects
        .iter()
        .filter_map(|found| {
            let hypothesis = &found.hypothesis;
            let at_own = |axis: Axis| match hypothesis.place {
                Place::Both => true,
                _ => hypothesis.axis() == Some(axis),
            };
            let order = match channel {
                Balance::Table => match hypothesis.family {
                    Family::LeadError => hypothesis.shape,
                    _ => return None,
                },
                Balance::Torque(axis) | Balance::VoltageD(axis) | Balance::VoltageQ(axis)
                    if at_own(axis) =>
                {
                    match hypothesis.family {
                        Family::AngleTorque | Family::EncoderEccentricity => hypothesis.shape,
                        Family::FluxHarmonic => hypothesis.shape * pole_pairs(axis),
                        Family::CurrentOffset => pole_pairs(axis),
                        Family::CurrentGain => 2.0 * pole_pairs(axis),
                        Family::DeadTime => 6.0 * pole_pairs(axis),
                        _ => return None,
                    }
                }
                _ => return None,
            };
            Some((order, found.effect.effect().kind().replace('_', " ")))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_has_more_than_one_candidate() {
        for (kind, likely) in [
            ("coupling_misalignment", "misaligned coupling"),
            ("cogging", "cogging"),
        ] {
            let candidates = candidates_of_order(kind);
            assert!(
                candidates.len() > 1 && candidates.iter().any(|one| one.contains(likely)),
                "{candidates:?}"
            );
        }
        // An offset of a current sensor has one cause.
        assert!(candidates_of_order("current_offset").is_empty());
    }

    #[test]
    fn a_soft_screw_is_the_other_candidate_of_a_backlash() {
        let mut feed = Model::coupled().feed;
        (feed.guideway_coulomb_n, feed.pair_coulomb_nm) = (20.0, 0.0);
        feed.axial_stiffness_n_per_m = 2e8;
        // The same friction winds up a screw of 40 N/um by 1 um at a reversal, and the model's by 0.2 um.
        let softest = stiffness_of_lost_motion(0.8e-6, &feed).unwrap();
        assert!((softest / 4e7 - 1.0).abs() < 1e-9, "{softest} N/m");
        feed.guideway_coulomb_n = 0.0;
        assert_eq!(stiffness_of_lost_motion(0.8e-6, &feed), None);
    }
}
