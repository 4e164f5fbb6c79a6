//! What repeats with a coordinate, or differs along it, in one channel and is of no kind that has a name.
//!
//! A record may hold what no hypothesis describes. Left in the residual it would lend a part of itself to hypotheses that
//! resemble it here and there, and each of them would be named. So it is put into the regression as what it looks like.

use crate::effects::family::{Family, Unnamed};
use crate::effects::hypothesis::Hypothesis;
use crate::machines::Machine;
use crate::regression::normal::Solution;
use crate::search::select::{Search, Trial};
use crate::signal::along::Along;
use crate::signal::channel::Channel;
use crate::signal::leftover::{Over, Residual};
use plant::effects::Place;

/// Coordinates of which the check record decides: where a record goes from speed to speed, every law of the speed is a curve
/// over time.
const MOST_COORDINATES: usize = 3;

/// Whether a kind of effect is just that shape: torque over the motor's angle or over time, an error of the lead.
fn has_kind(channel: Channel, along: Along) -> bool {
    match (channel, along) {
        (Channel::Torque(axis), Along::Angle(of)) => axis == of,
        (Channel::Torque(_), Along::Clock) | (Channel::Table, Along::RelativeAngle) => true,
        _ => false,
    }
}

/// The shapes that explain most of a regression's residual in one channel, one for each coordinate; of channels in which less than `enough` is left
/// beyond noise none is looked for.
pub(crate) fn strongest(
    search: &mut Search,
    solution: &Solution,
    enough: impl Fn(Channel) -> f64,
) -> Vec<Trial> {
    let balance = search.balance;
    let (signals, fourier) = (balance.signals, balance.fourier);
    let rate = signals.rate / fourier.step() as f64;
    let left = search.normal.residual(&solution.values);
    let mut best: Vec<(f64, Hypothesis, Along)> = Vec::new();
    for channel in Channel::ALL {
        let Some(values) = left.parts[channel.index()].as_deref() else {
            continue;
        };
        let open = search.whitener.mask(channel);
        let counted = search.whitener.rows(channel) as f64;
        let enough = enough(channel);
        if values.iter().map(|x| x * x).sum::<f64>() - counted < enough {
            continue;
        }
        for along in Along::ALL
            .into_iter()
            .filter(|along| signals.machine.has(*along) && along.is_in(channel))
            .filter(|along| !has_kind(channel, *along))
        {
            let rows = || (0..values.len()).map(|row| row * fourier.step());
            let coordinate: Vec<f64> = rows().map(|row| signals.along(along, row)).collect();
            let factors = (along.factor()).map(|_| {
                rows()
                    .map(|row| signals.factor(along, row))
                    .collect::<Vec<f64>>()
            });
            let over = Over {
                values: &coordinate,
                form: along.form(0.5 * rate),
                factors: factors.as_deref(),
            };
            let residual = Residual { values, open, rate };
            let Some(shape) = residual.shape(&over) else {
                continue;
            };
            let known = best.iter().position(|(_, _, other)| *other == along);
            if shape.fall > enough && known.is_none_or(|at| shape.fall > best[at].0) {
                let (low, high) = coordinate
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
                let unnamed = Unnamed {
                    channel,
                    along,
                    is_force: false,
                    extent: [low, high].map(f64::to_bits),
                };
                let order = shape.order.unwrap_or(0.0);
                let hypothesis = Hypothesis::new(Family::Unnamed(unnamed), unnamed.place(), order);
                if let Some(at) = known {
                    best.swap_remove(at);
                }
                best.push((shape.fall, hypothesis, along));
            }
        }
    }
    best.sort_by(|a, b| b.0.total_cmp(&a.0));
    best.truncate(MOST_COORDINATES);
    let trials = best.into_iter().map(|(_, hypothesis, _)| {
        let trial = search.try_one(hypothesis, solution);
        search.at_best(&trial)
    });
    trials.collect()
}

/// The force on the table that shows as what a hypothesis shows at one place of the machine, with the same shape: what
/// reaches both motors and the screw's length at once has one cause.
pub(crate) fn as_force(hypothesis: &Hypothesis, machine: &dyn Machine) -> Option<Hypothesis> {
    let along = match hypothesis.family {
        Family::TimePeriodic => Along::Clock,
        Family::BallPassage | Family::LeadError => Along::RelativeAngle,
        Family::Unnamed(own) if !own.is_force => own.along,
        _ => return None,
    };
    let on_the_feed =
        along.is_in(Channel::Table) && !matches!(along, Along::Angle(_) | Along::Speed(_));
    let extent = match hypothesis.family {
        Family::Unnamed(own) => own.extent,
        _ => [0; 2],
    };
    let force = Unnamed {
        channel: Channel::Table,
        along,
        is_force: true,
        extent,
    };
    (machine.has_feed() && on_the_feed).then_some(Hypothesis::new(
        Family::Unnamed(force),
        Place::Feed,
        hypothesis.shape,
    ))
}
