//! The residual when no hypothesis is worth adding: what it looks like, without a cause.

use crate::balance::Balance;
use crate::conclusion::channels::ChannelRest;
use crate::conclusion::outcome::Unexplained;
use crate::conclusion::remains::level;
use crate::conclusion::rest::{self, NO_SHAPE, Remnant, Rest};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::regression::column::Column;
use crate::regression::design::Whitener;
use crate::regression::gain::Gain;
use crate::search::case::Case;
use crate::search::progress::Doubt;
use crate::search::select::Trial;
use crate::search::selection::NOT_BORNE_OUT;
use crate::signal::along::Along;
use crate::signal::channel::Channel;
use crate::signal::noise::{drive_rms, small_rms};
use plant::effects::Place;

/// A channel is too loud if the residual is beyond noise by this share of the noise's power, and more than this share of
/// what was there: an effect found leaves a part of itself.
const TOO_LOUD: f64 = 0.5;
const MOST_LEFT: f64 = 0.25;
/// Share of a motor's torque or voltage, rms, below which a shape without an order is slight: where the fit record alone has it, and the
/// check record is at its floor, friction has changed by so much.
const SLIGHT: f64 = 0.01;
/// Doubtful hypotheses listed.
const LISTED: usize = 3;

/// Fit and check record with the residual of them, whitened.
pub(crate) struct Left<'a> {
    pub(crate) cases: [&'a Case<'a>; 2],
    pub(crate) whiteners: [&'a Whitener<'a>; 2],
    pub(crate) white: [&'a Column; 2],
    /// No effects were found.
    pub(crate) alone: bool,
}

impl Left<'_> {
    /// The coordinates of both records.
    fn places(&self) -> Vec<(Along, rest::Place)> {
        let [fit, check] = self.cases.map(|case| case.balance);
        let both = |of: &dyn Fn(&Balance, usize) -> f64| {
            [fit, check].map(|balance| {
                let step = balance.fourier.step();
                let rows = 0..balance.fourier.decimated_rows();
                rows.map(|row| of(balance, row * step)).collect::<Vec<_>>()
            })
        };
        let nyquist = 0.5 * fit.signals.rate / fit.fourier.step() as f64;
        let on = |along: &Along| fit.signals.machine.has(*along);
        let place = |along: Along| {
            let factor = |balance: &Balance, row| balance.signals.factor(along, row);
            let place = rest::Place {
                name: along.name(),
                values: both(&|balance, row| balance.signals.along(along, row)),
                form: along.form(nyquist),
                is_product: Along::PRODUCTS.contains(&along),
                factors: along.factor().map(|_| both(&factor)),
            };
            (along, place)
        };
        let all = Along::ALL.into_iter().chain(Along::PRODUCTS);
        all.filter(on).map(place).collect()
    }

    /// The residual of a channel, the greatest first, each with its sum of squares.
    fn of(&self, loud: &ChannelRest, places: &[(Along, rest::Place)]) -> Vec<(f64, Unexplained)> {
        let index = loud.channel.index();
        let values = self
            .white
            .map(|white| white.parts[index].clone().unwrap_or_default());
        let open = self
            .whiteners
            .map(|whitener| whitener.mask(loud.channel).to_vec());
        let balance = self.cases[0].balance;
        let rate = balance.signals.rate / balance.fourier.step() as f64;
        let rows = self
            .whiteners
            .map(|whitener| whitener.rows(loud.channel).max(1) as f64);
        let power = |k: usize| values[k].iter().map(|x| x * x).sum::<f64>() / rows[k];
        let ([case, _], [whitener, _], [white, _]) = (self.cases, self.whiteners, self.white);
        let of_fit = level(
            case,
            whitener,
            white,
            (loud.channel, self.alone),
            loud.band_hz,
        );
        let excess = [of_fit.excess, loud.levels[1].excess];
        // What is no excess in any band is the floor.
        let floor = [0, 1].map(|k| (power(k) - excess[k] / rows[k]).max(0.0).sqrt());
        let size = loud.figures.fit_after / power(0).sqrt().max(1e-300);
        let rest = Rest {
            values: values.clone(),
            open,
            rate,
            floor: Some(floor),
            above: 1.0,
            during: Vec::new(),
        };
        let places = places.iter().filter(|(along, _)| along.is_in(loud.channel));
        let places: Vec<&rest::Place> = places.map(|(_, place)| place).collect();
        let left = rest.remnants(&places);
        let any = !left.is_empty();
        let counts = |remnant: &Remnant| {
            let size = size * remnant.size;
            remnant.coordinate == NO_SHAPE
                || size > small_rms(balance.model, balance.signals, loud.channel)
        };
        let told = left.into_iter().filter(counts).map(|remnant| {
            let fall = remnant.size.powi(2) * rows[0];
            let told = Unexplained {
                channel: loud.channel,
                coordinate: remnant.coordinate,
                order: remnant.order,
                hz: remnant.hz,
                size: size * remnant.size,
                fall,
                reason: remnant.reason,
            };
            (fall, told)
        });
        let told: Vec<_> = told.collect();
        match told.is_empty() {
            true if any && loud.levels[1].quiet() => Vec::new(),
            true => vec![(
                excess[1],
                Unexplained {
                    channel: loud.channel,
                    coordinate: NO_SHAPE,
                    order: None,
                    hz: None,
                    size: size * (excess[1] / rows[1]).sqrt(),
                    fall: excess[1],
                    reason: "the check record is louder than its sensors, the fit record is not"
                        .into(),
                },
            )],
            false => told,
        }
    }
}

/// What nothing explains: shapes without a name that the regression has (`found`), the residual in channels that are too
/// loud for their sensors, the greatest first, and in other channels hypotheses and shapes that are doubtful.
pub(crate) fn unexplained(
    left: &Left,
    found: &[(Hypothesis, Vec<f64>)],
    doubtful: &[Doubt],
    channels: &[ChannelRest],
) -> Vec<Unexplained> {
    let ([case, _], [whitener, _]) = (left.cases, left.whiteners);
    let describe = |hypothesis: &Hypothesis, values: &[f64], gain, reason| {
        described(case, whitener, (hypothesis, values), gain, reason)
    };
    let unnamed = found
        .iter()
        .filter(|(hypothesis, _)| matches!(hypothesis.family, Family::Unnamed(_)))
        .map(|(hypothesis, values)| {
            let told = describe(
                hypothesis,
                values,
                None,
                "both records have it, and no hypothesis explains as much",
            );
            (told.fall, told)
        });
    let at_floor = |channel: Channel| {
        let mut levels = channels.iter().filter(|rest| rest.channel == channel);
        levels.any(|rest| rest.levels[1].quiet())
    };
    let doubtful = doubtful
        .iter()
        .map(|doubt| {
            let Trial { hypothesis, gain } = &doubt.trial;
            let left = describe(hypothesis, &gain.values, Some(gain), doubt.reason);
            (doubt.likeness, left)
        })
        .filter(|(likeness, left)| {
            let alone = left.reason == NOT_BORNE_OUT && left.order.is_none();
            let (model, signals) = (case.balance.model, case.balance.signals);
            let slight = alone && left.size < SLIGHT * drive_rms(model, signals, left.channel);
            left.size > small_rms(model, signals, left.channel)
                && !((*likeness || slight) && at_floor(left.channel))
        })
        .map(|(_, left)| left)
        .take(LISTED);
    let is_loud = |rest: &&ChannelRest| {
        let of_fit = level(
            case,
            whitener,
            left.white[0],
            (rest.channel, left.alone),
            rest.band_hz,
        );
        let beyond = of_fit.power - 1.0;
        let share = (rest.figures.fit_after / rest.figures.fit_before).powi(2);
        !rest.levels[1].quiet() || beyond > TOO_LOUD && share > MOST_LEFT
    };
    let loud: Vec<&ChannelRest> = channels.iter().filter(is_loud).collect();
    let places = match loud.is_empty() {
        true => Vec::new(),
        false => left.places(),
    };
    let of_loud = loud.into_iter().flat_map(|rest| left.of(rest, &places));
    let mut list: Vec<(f64, Unexplained)> = unnamed.chain(of_loud).collect();
    list.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut list: Vec<Unexplained> = list.into_iter().map(|(_, told)| told).collect();
    // Where the residual is described already, a doubt adds nothing.
    let doubts: Vec<Unexplained> = doubtful
        .filter(|doubt| list.iter().all(|known| known.channel != doubt.channel))
        .collect();
    list.extend(doubts);
    list
}

/// What a hypothesis with its values looks like in the channel that shows it most. With its gain, its size is that of the part which plate
/// values within their tolerance cannot take over.
fn described(
    case: &Case,
    whitener: &Whitener,
    (hypothesis, values): (&Hypothesis, &[f64]),
    gain: Option<&Gain>,
    reason: &'static str,
) -> Unexplained {
    let balance = case.balance;
    let whole = hypothesis.whole(balance, values);
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
    let own = gain.map_or(1.0, |gain| gain.own_part(&white));
    let size = shown.map_or(0.0, |(_, spectrum)| {
        let signal = balance
            .fourier
            .filtered(spectrum, &vec![1.0; spectrum.len()]);
        own * crate::conclusion::remains::rms(&signal, whitener.mask(channel))
    });
    let along = along(hypothesis);
    let order = order(case, hypothesis);
    let in_time = along == Some(Along::Clock);
    Unexplained {
        channel,
        coordinate: along.map_or(NO_SHAPE, Along::name),
        order: order.filter(|_| !in_time),
        hz: order.filter(|_| in_time),
        size,
        fall: power(channel),
        reason: reason.into(),
    }
}

/// What a hypothesis is a shape over.
pub(crate) fn along(hypothesis: &Hypothesis) -> Option<Along> {
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
        Family::Linear(_) => hypothesis.along(),
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
