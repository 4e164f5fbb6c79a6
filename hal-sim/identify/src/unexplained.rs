//! What is left when no hypothesis is worth adding: what it looks like, without a cause.

use crate::analysis::Case;
use crate::channel::Channel;
use crate::design::{Column, Whitener};
use crate::hypothesis::{Family, LEAST_ORDER, LEAST_RELATIVE_ORDER};
use crate::leftover::{Form, Over, Residual};
use crate::outcome::{Coordinates, Unexplained};
use crate::progress::{CONFIRMED, MATERIAL};
use crate::select::Trial;
use std::f64::consts::TAU;

/// Whitened power beyond noise at which a channel without a shape is still too loud.
const TOO_LOUD: f64 = 0.5;
/// Hypotheses listed that one record has and the other has not.
const LISTED: usize = 3;

/// What is left of a record, made white.
pub(crate) struct Rest<'a> {
    pub(crate) case: &'a Case<'a>,
    pub(crate) whitener: &'a Whitener<'a>,
    pub(crate) whitened: &'a Column,
    pub(crate) coordinates: &'a Coordinates,
}

impl Rest<'_> {
    fn rate(&self) -> f64 {
        self.case.balance.signals.rate / self.case.balance.fourier.step() as f64
    }

    fn residual(&self, channel: Channel) -> Option<Residual<'_>> {
        Some(Residual {
            values: self.whitened.parts[channel.index()].as_deref()?,
            open: self.whitener.mask(channel),
            rate: self.rate(),
        })
    }
}

/// A coordinate that something may be a shape over.
struct Place<'a> {
    over: Over<'a>,
    /// Whether what repeats there is counted by frequency.
    in_time: bool,
}

/// Where to look for shapes of a channel; `clock` is time as an angle of one turn a second.
fn places<'a>(channel: Channel, at: &'a Coordinates, clock: &'a [f64], top: f64) -> Vec<Place<'a>> {
    let place = |name: &str, values: &'a [f64], form: Form| Place {
        in_time: false,
        over: Over {
            name: name.to_owned(),
            values,
            form,
        },
    };
    let mut list = vec![
        place(
            "angle of screw against nut",
            &at.relative,
            Form::Repeats(LEAST_RELATIVE_ORDER..60.0),
        ),
        place(
            "speed of screw against nut",
            &at.relative_speed,
            Form::Curve,
        ),
        place("position of the table", &at.table, Form::Curve),
        place("time", &at.time, Form::Curve),
        Place {
            in_time: true,
            ..place("time", clock, Form::Repeats(0.5..top))
        },
    ];
    for (k, motor) in ["screw", "nut"].into_iter().enumerate() {
        let own = match channel {
            Channel::Torque(axis) | Channel::VoltageD(axis) | Channel::VoltageQ(axis) => {
                axis.index() == k
            }
            Channel::Table => true,
        };
        if own {
            list.push(place(
                &format!("angle of the {motor}"),
                &at.angle[k],
                Form::Repeats(LEAST_ORDER..126.0),
            ));
            list.push(place(
                &format!("speed of the {motor}"),
                &at.speed[k],
                Form::Curve,
            ));
        }
    }
    list
}

fn clock(at: &Coordinates) -> Vec<f64> {
    at.time.iter().map(|t| TAU * t).collect()
}

/// What the records have that nothing explains, the loudest first: on either record shapes that explain as much as an
/// effect must, channels that are too loud for their sensors without one, and hypotheses that only the fit record has.
/// `left` is the fit record's residual in the channels' units.
pub(crate) fn unexplained(
    fit: &Rest,
    check: &Rest,
    left: &[Vec<f64>],
    unconfirmed: &[Trial],
) -> Vec<Unexplained> {
    let (rows, check_rows) = (fit.whitener.used_rows(), check.whitener.used_rows());
    let (least, least_on_check) = (
        MATERIAL * rows as f64,
        CONFIRMED * MATERIAL * check_rows as f64,
    );
    let (clock, check_clock) = (clock(fit.coordinates), clock(check.coordinates));
    let mut list: Vec<(f64, Unexplained)> = Vec::new();
    for channel in Channel::ALL {
        let (Some(residual), Some(on_check)) = (fit.residual(channel), check.residual(channel))
        else {
            continue;
        };
        let open = residual.open.iter().filter(|open| **open).count() as f64;
        let loud = residual.values.iter().map(|x| x * x).sum::<f64>() - open;
        // A shape explains no more than what is there beyond noise.
        if loud < 0.5 * least {
            continue;
        }
        let in_units = Residual {
            values: &left[channel.index()],
            ..residual
        };
        let top = 0.45 * fit.rate();
        let best = places(channel, fit.coordinates, &clock, top)
            .into_iter()
            .zip(places(channel, check.coordinates, &check_clock, top))
            .filter_map(|(place, same)| {
                let shape = residual.shape(&place.over)?;
                let borne_out = on_check.bears_out(&same.over, &shape);
                (shape.fall > least && borne_out > least_on_check).then_some((
                    shape.fall + borne_out,
                    place,
                    shape,
                ))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((fall, place, shape)) = best {
            let size = in_units.size(&place.over, &shape);
            let (order, hz) = match place.in_time {
                true => (None, shape.order),
                false => (shape.order, None),
            };
            list.push((
                fall,
                Unexplained {
                    channel,
                    coordinate: place.over.name,
                    order,
                    hz,
                    size,
                    reason: "both records have it, and no hypothesis does",
                },
            ));
        } else if loud > TOO_LOUD * open {
            let power: f64 = in_units.values.iter().map(|x| x * x).sum::<f64>() / open;
            let size = (power * loud / (loud + open)).sqrt();
            list.push((
                loud,
                Unexplained {
                    channel,
                    coordinate: "none".into(),
                    order: None,
                    hz: None,
                    size,
                    reason: "louder than its sensors, with no shape over any coordinate",
                },
            ));
        }
    }
    list.extend(
        unconfirmed
            .iter()
            .take(LISTED)
            .map(|trial| (trial.gain.fall, not_borne_out(fit, trial))),
    );
    list.sort_by(|a, b| b.0.total_cmp(&a.0));
    list.into_iter().map(|(_, left)| left).collect()
}

/// A hypothesis that is significant on the fit record, as a shape in the channel that shows it most.
fn not_borne_out(fit: &Rest, trial: &Trial) -> Unexplained {
    let hypothesis = &trial.hypothesis;
    let balance = fit.case.balance;
    let mut parts = hypothesis
        .contributions(balance, balance.signals.run_s())
        .iter()
        .zip(&trial.gain.values)
        .fold(
            crate::balance::Contribution(Vec::new()),
            |mut sum, (part, value)| {
                sum.add_all(*value, part);
                sum
            },
        );
    let white = fit.whitener.column(&parts);
    let power = |channel: Channel| {
        white.parts[channel.index()]
            .as_deref()
            .map_or(0.0, |part| part.iter().map(|x| x * x).sum())
    };
    let channel = Channel::ALL
        .into_iter()
        .max_by(|a, b| power(*a).total_cmp(&power(*b)))
        .unwrap_or(Channel::Table);
    parts.0.retain(|(known, _)| *known == channel);
    let size = parts.0.first().map_or(0.0, |(_, spectrum)| {
        let everything = vec![1.0; spectrum.len()];
        let signal = balance.fourier.filtered(spectrum, &everything);
        crate::remains::rms(&signal, fit.whitener.mask(channel))
    });
    let motor = hypothesis.place.name();
    let coordinate = match hypothesis.family {
        Family::AngleTorque | Family::EncoderEccentricity | Family::FluxHarmonic => {
            format!("angle of the {motor}")
        }
        Family::CurrentOffset | Family::CurrentGain => format!("angle of the {motor}"),
        Family::TimePeriodic | Family::ResistanceDrift | Family::FluxDrift => "time".into(),
        Family::LeadError | Family::BallPassage => "angle of screw against nut".into(),
        Family::StribeckFriction if hypothesis.axis().is_some() => format!("speed of the {motor}"),
        Family::StribeckFriction | Family::Backlash => "speed of screw against nut".into(),
        Family::PositionLoad | Family::LeadScale => "position of the table".into(),
        Family::DeadTime | Family::AxialCompliance => "none".into(),
    };
    let pole_pairs = hypothesis
        .axis()
        .map_or(1.0, |axis| f64::from(balance.model.motor(axis).pole_pairs));
    let order = match hypothesis.family {
        Family::AngleTorque
        | Family::EncoderEccentricity
        | Family::LeadError
        | Family::BallPassage => Some(hypothesis.shape),
        Family::FluxHarmonic => Some(hypothesis.shape * pole_pairs),
        Family::CurrentOffset => Some(pole_pairs),
        Family::CurrentGain => Some(2.0 * pole_pairs),
        _ => None,
    };
    Unexplained {
        channel,
        coordinate,
        order,
        hz: (hypothesis.family == Family::TimePeriodic).then_some(hypothesis.shape),
        size,
        reason: "the fit record has it, the check record does not bear it out",
    }
}
