//! What is left when no hypothesis is worth adding: what it looks like, without a cause.

use crate::along::Along;
use crate::analysis::Case;
use crate::balance::Contribution;
use crate::channel::Channel;
use crate::design::Whitener;
use crate::hypothesis::{Family, Hypothesis};
use crate::outcome::{ChannelRest, Unexplained};
use crate::progress::Doubt;
use crate::select::Trial;
use plant::effects::Place;

/// A channel is too loud if what is left is beyond noise by this share of the noise's power, and more than this share of
/// what was there: an effect found leaves a part of itself.
const TOO_LOUD: f64 = 0.5;
const MOST_LEFT: f64 = 0.25;
/// Doubtful hypotheses listed.
const LISTED: usize = 3;

/// What nothing explains: shapes without a name that the regression has (`found`), hypotheses and shapes that are
/// doubtful, and channels that are too loud for their sensors.
pub(crate) fn unexplained(
    case: &Case,
    whitener: &Whitener,
    found: &[(Hypothesis, Vec<f64>)],
    doubtful: &[Doubt],
    channels: &[ChannelRest],
) -> Vec<Unexplained> {
    let describe = |hypothesis: &Hypothesis, values: &[f64], reason| {
        described(case, whitener, hypothesis, values, reason)
    };
    let unnamed = found
        .iter()
        .filter(|(hypothesis, _)| matches!(hypothesis.family, Family::Unnamed(_)))
        .map(|(hypothesis, values)| {
            describe(
                hypothesis,
                values,
                "both records have it, and no hypothesis explains as much",
            )
        });
    let at_floor = |channel: Channel| {
        let mut levels = channels.iter().filter(|rest| rest.channel == channel);
        levels.any(|rest| rest.levels[1].quiet())
    };
    let doubtful = doubtful
        .iter()
        .map(|doubt| {
            let Trial { hypothesis, gain } = &doubt.trial;
            let left = describe(hypothesis, &gain.values, doubt.reason);
            (doubt.likeness, left)
        })
        .filter(|(likeness, left)| !(*likeness && at_floor(left.channel)))
        .map(|(_, left)| left)
        .take(LISTED);
    let loud = channels.iter().filter_map(|rest| {
        let beyond = rest.figures.whitened.powi(2) - 1.0;
        let left = (rest.figures.fit_after / rest.figures.fit_before).powi(2);
        (beyond > TOO_LOUD && left > MOST_LEFT).then(|| Unexplained {
            channel: rest.channel,
            coordinate: "none",
            order: None,
            hz: None,
            size: rest.figures.fit_after * (beyond / (1.0 + beyond)).sqrt(),
            reason: "louder than its sensors, with no shape over any coordinate",
        })
    });
    let mut list: Vec<Unexplained> = unnamed.chain(doubtful).collect();
    // Where a shape is listed already, the channel is said to be loud.
    let silent: Vec<Unexplained> = loud
        .filter(|loud| list.iter().all(|known| known.channel != loud.channel))
        .collect();
    list.extend(silent);
    list
}

/// What a hypothesis looks like in the channel that shows it most.
fn described(
    case: &Case,
    whitener: &Whitener,
    hypothesis: &Hypothesis,
    values: &[f64],
    reason: &'static str,
) -> Unexplained {
    let balance = case.balance;
    let mut whole = Contribution::default();
    let parts = hypothesis.contributions(balance, balance.signals.run_s());
    for (part, value) in parts.iter().zip(values) {
        whole.add_all(*value, part);
    }
    let white = whitener.column(&whole);
    let power = |channel: Channel| -> f64 {
        let part = white.parts[channel.index()].as_deref().unwrap_or_default();
        part.iter().map(|x| x * x).sum()
    };
    let channel = Channel::ALL
        .into_iter()
        .max_by(|a, b| power(*a).total_cmp(&power(*b)))
        .unwrap_or(Channel::Table);
    let shown = whole.0.iter().find(|(known, _)| *known == channel);
    let size = shown.map_or(0.0, |(_, spectrum)| {
        let signal = balance
            .fourier
            .filtered(spectrum, &vec![1.0; spectrum.len()]);
        crate::remains::rms(&signal, whitener.mask(channel))
    });
    let along = along(hypothesis);
    let order = order(case, hypothesis);
    let in_time = along == Some(Along::Clock);
    Unexplained {
        channel,
        coordinate: along.map_or("none", Along::name),
        order: order.filter(|_| !in_time),
        hz: order.filter(|_| in_time),
        size,
        reason,
    }
}

/// What a hypothesis is a shape over.
fn along(hypothesis: &Hypothesis) -> Option<Along> {
    let axis = hypothesis
        .axis()
        .filter(|_| hypothesis.place != Place::Both);
    match hypothesis.family {
        Family::Unnamed(unnamed) => Some(unnamed.along),
        Family::AngleTorque
        | Family::EncoderEccentricity
        | Family::FluxHarmonic
        | Family::CurrentOffset
        | Family::CurrentGain => axis.map(Along::Angle),
        Family::TimePeriodic => Some(Along::Clock),
        Family::ResistanceDrift | Family::FluxDrift => Some(Along::Time),
        Family::LeadError | Family::BallPassage => Some(Along::RelativeAngle),
        Family::StribeckFriction => Some(axis.map_or(Along::RelativeSpeed, Along::Speed)),
        Family::Backlash => Some(Along::RelativeSpeed),
        Family::PositionLoad | Family::LeadScale => Some(Along::TablePosition),
        Family::DeadTime | Family::AxialCompliance => None,
    }
}

/// The order per turn, or the frequency, of what repeats.
fn order(case: &Case, hypothesis: &Hypothesis) -> Option<f64> {
    let pole_pairs = hypothesis.axis().map_or(1.0, |axis| {
        f64::from(case.balance.model.motor(axis).pole_pairs)
    });
    match hypothesis.family {
        Family::Unnamed(unnamed) => unnamed.along.repeats().then_some(hypothesis.shape),
        Family::AngleTorque
        | Family::EncoderEccentricity
        | Family::TimePeriodic
        | Family::LeadError
        | Family::BallPassage => Some(hypothesis.shape),
        Family::FluxHarmonic => Some(hypothesis.shape * pole_pairs),
        Family::CurrentOffset => Some(pole_pairs),
        Family::CurrentGain => Some(2.0 * pole_pairs),
        _ => None,
    }
}
