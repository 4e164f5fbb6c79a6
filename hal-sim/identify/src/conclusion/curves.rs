//! What predicts the torques that names leave, as measured effects: the judge of all machines, on the balances of motors
//! and of the force between them.

use crate::balance::Balance;
use crate::conclusion::channels::ChannelRest;
use crate::effects::family::{Family, Unnamed};
use crate::effects::hypothesis::Hypothesis;
use crate::predict::basis::{Along, At, Group};
use crate::predict::judge::{Judged, judge};
use crate::predict::orders::loudest_orders;
use crate::predict::side::{Known, Side};
use crate::regression::column::Column;
use crate::regression::design::Whitener;
use crate::regression::normal::Solution;
use crate::search::case::Case;
use crate::signal::along::Along as ShapeAlong;
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use crate::signal::signals::rounded_sign;
use plant::Axis;
use plant::effects::{AnyEffect, EffectModel, Measured, MeasuredOver, Place, Quantity};
use std::f64::consts::TAU;

/// Points of a curve over a speed or position, of one over a turn for each period, and at least.
const POINTS: usize = 161;
const POINTS_OF_PERIOD: f64 = 16.0;
const LEAST_POINTS: usize = 64;

/// Share of what a named order of the turn explains from which on further orders of no name are more than its trace.
const PART_OF_SHAPE: f64 = 0.01;

/// A measured effect.
#[derive(Debug, Clone)]
pub struct Learned {
    /// As a model file has it.
    pub effect: EffectModel,
    /// What it is over, for a reader.
    pub along: String,
    /// The order of the turn, where it has one only.
    pub order: Option<f64>,
    /// Coordinates and standard deviations of its points.
    pub at: Vec<f64>,
    /// See `at`.
    pub sigmas: Vec<f64>,
    /// Whole orders that it has, where it repeats with the turn.
    orders: usize,
    /// Fall of the check record's sum of squares: its share, by size, of that of all curves together.
    pub fall: f64,
}

impl Learned {
    /// An effect whose record nobody asks about.
    #[cfg(test)]
    pub(crate) fn of(effect: EffectModel) -> Self {
        Learned {
            effect,
            along: String::new(),
            order: None,
            at: Vec::new(),
            sigmas: Vec::new(),
            orders: 0,
            fall: 0.0,
        }
    }

    /// So much of it.
    pub(crate) fn scale(&mut self, share: f64) {
        if let AnyEffect::Measured(curve) = self.effect.effect() {
            let mut scaled = curve.clone();
            scaled.value.iter_mut().for_each(|value| *value *= share);
            let place = self.effect.place();
            self.effect = EffectModel::new(place, scaled).expect("the place that it was at");
        }
    }

    /// Mean square of its points, as a torque.
    fn power(&self, lead: f64) -> f64 {
        let unit = match self.effect.place() {
            Place::Feed => lead,
            _ => 1.0,
        };
        let values = self.values();
        let squares = values.iter().map(|value| (unit * value).powi(2));
        squares.sum::<f64>() / values.len().max(1) as f64
    }

    /// Whether an effect of one order of the same turn is a part of it: its other orders explain more than a trace beside it.
    pub(crate) fn has_part(&self, named: &EffectModel, explains: f64) -> bool {
        self.orders > 1
            && self.effect.place() == named.place()
            && self.fall > PART_OF_SHAPE * explains
    }

    /// The channel in which it shows: of a force on the table the screw's torque.
    pub(crate) fn shows(&self) -> Channel {
        match self.effect.place() == Place::Nut {
            true => Channel::Torque(Axis::Nut),
            false => Channel::Torque(Axis::Screw),
        }
    }

    /// Its points' values.
    pub fn values(&self) -> &[f64] {
        match self.effect.effect() {
            AnyEffect::Measured(curve) => &curve.value,
            _ => &[],
        }
    }
}

/// Divides a fall among curves by their size.
pub(crate) fn divide(curves: &mut [Learned], fall: f64, lead: f64) {
    let all: f64 = curves.iter().map(|curve| curve.power(lead)).sum();
    for curve in curves {
        curve.fall = fall * curve.power(lead) / all.max(1e-300);
    }
}

/// What a curve acts on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Subject {
    Motor(Axis),
    Feed,
}

impl Subject {
    fn place(self) -> Place {
        match self {
            Subject::Motor(axis) => axis.into(),
            Subject::Feed => Place::Feed,
        }
    }

    /// The balances that show it, and what one unit adds to each.
    fn channels(self, lead: f64) -> Vec<(Channel, f64)> {
        match self {
            Subject::Motor(axis) => vec![(Channel::Torque(axis), -1.0)],
            Subject::Feed => vec![
                (Channel::Torque(Axis::Screw), lead),
                (Channel::Torque(Axis::Nut), -lead),
            ],
        }
    }

    /// Whether a measured effect of the plant can be over it.
    fn offers(self, along: Along) -> bool {
        match along {
            Along::Speed | Along::Order(_) => true,
            Along::Position | Along::PositionByDirection => self == Subject::Feed,
            Along::SinceReversal | Along::OrderBySpeed(_) => false,
        }
    }

    /// Where it is in each row that is compared.
    fn at(self, balance: &Balance) -> Vec<At> {
        let signals = balance.signals;
        let rows = (0..signals.len()).step_by(balance.fourier.step());
        let at = |row: usize| match self {
            Subject::Motor(axis) => {
                let own = &signals.motors[axis.index()];
                At {
                    angle: own.theta[row],
                    position: own.theta[row],
                    speed: own.omega[row],
                    way: rounded_sign(own.omega[row], balance.rounding.bearing),
                    since: 0.0,
                }
            }
            Subject::Feed => At {
                angle: signals.motors[0].theta[row] - signals.motors[1].theta[row],
                position: signals.table[row] / balance.lead,
                speed: signals.relative_speed[row],
                way: rounded_sign(signals.relative_speed[row], balance.rounding.guideway),
                since: 0.0,
            },
        };
        rows.map(at).collect()
    }

    /// Top speed of its shaft, rad/s.
    fn top_speed(self, balance: &Balance) -> f64 {
        let motors = &balance.signals.motors;
        match self {
            Subject::Motor(axis) => motors[axis.index()].top_speed,
            Subject::Feed => {
                let speeds = balance.signals.relative_speed.iter();
                speeds.fold(0.0, |top, w| top.max(w.abs()))
            }
        }
    }
}

/// A record as the judge looks at it.
struct Heard<'c, 'a> {
    case: &'c Case<'a>,
    whitener: &'c Whitener<'a>,
    /// What plate values and names leave of it, white.
    left: Column,
    /// What plate values and names add, white, and how well each is known beforehand. A plate value at its bound is none of them: it goes
    /// no further, and what would draw it there is the curve's. First the parameter's number in the fit record.
    known: Vec<(Option<usize>, Column, f64)>,
}

impl<'c, 'a> Heard<'c, 'a> {
    fn new(
        case: &'c Case<'a>,
        whitener: &'c Whitener<'a>,
        names: &[Hypothesis],
        (fit, fitted): (&Case, &Solution),
    ) -> Self {
        let normal = case.search(whitener, names).normal;
        // Where the fit record has a parameter; what belongs to a record stays as it is.
        let of_fit = |k: usize| match case.base.parameters.get(k) {
            Some((own, _)) if own.is_of_the_machine() => {
                let mut all = fit.base.parameters.iter();
                all.position(|(parameter, _)| parameter == own)
            }
            Some(_) => None,
            None => Some(k - case.base.parameters.len() + fit.base.parameters.len()),
        };
        let value = |k: usize| of_fit(k).map_or(0.0, |k| fitted.values[k]);
        let is_held =
            |k: usize| of_fit(k).is_some_and(|k| fitted.held.iter().any(|(held, _)| *held == k));
        let columns = normal.columns.iter().map(AsRef::as_ref);
        let open = columns.clone().zip(normal.known()).enumerate();
        let open = open.filter(|(k, _)| !is_held(*k));
        Heard {
            known: open
                .map(|(k, (column, precision))| (of_fit(k), column.clone(), precision))
                .collect(),
            left: (normal.target).less(columns, (0..normal.len()).map(value)),
            case,
            whitener,
        }
    }

    /// A column of the channels of a subject, one behind the other; what a column has nothing of is 0.
    fn rows(&self, column: &Column, subject: Subject) -> Vec<f64> {
        let none = vec![0.0; self.case.balance.fourier.decimated_rows()];
        let channels = subject.channels(self.case.balance.lead).into_iter();
        channels
            .flat_map(|(channel, _)| {
                let part = &column.parts[channel.index()];
                part.as_ref().unwrap_or(&none).clone()
            })
            .collect()
    }

    fn side(&self, subject: Subject) -> Side {
        let balance = self.case.balance;
        let channels = subject.channels(balance.lead);
        let at = subject.at(balance);
        let rows = at.len();
        let left = self.rows(&self.left, subject);
        let known = self
            .known
            .iter()
            .filter_map(|(parameter, column, precision)| {
                let column = self.rows(column, subject);
                let shows = column.iter().any(|x| *x != 0.0);
                shows.then_some(Known {
                    parameter: *parameter,
                    column,
                    precision: *precision,
                })
            });
        Side {
            known: known.collect(),
            at: channels.iter().flat_map(|_| at.iter().copied()).collect(),
            open: channels
                .iter()
                .flat_map(|(channel, _)| self.whitener.mask(*channel).to_vec())
                .collect(),
            stretches: (0..channels.len())
                .map(|k| k * rows..(k + 1) * rows)
                .collect(),
            rate: balance.signals.rate / balance.fourier.step() as f64,
            // What is at its floor is not asked about: what counts is a share of the residual.
            drive_rms: (left.iter().map(|x| x * x).sum::<f64>() / left.len().max(1) as f64).sqrt(),
            left,
        }
    }

    /// A function of a subject's coordinates as its balances show it.
    fn shown(&self, subject: Subject, at: &[At], group: &Group, function: usize) -> Vec<f64> {
        let balance = self.case.balance;
        let channels = subject.channels(balance.lead);
        let rows = at.len() / channels.len();
        let values: Vec<f64> = (at[..rows].iter())
            .map(|at| group.value(function, at))
            .collect();
        let of = |(channel, unit): &(Channel, f64)| {
            let gain: Vec<f64> = self
                .whitener
                .gain(*channel)
                .iter()
                .map(|g| unit * g)
                .collect();
            let mut shown = balance.fourier.again(&values, &gain);
            let open = self.whitener.mask(*channel);
            shown
                .iter_mut()
                .zip(open)
                .for_each(|(x, open)| *x *= f64::from(*open));
            shown
        };
        channels.iter().flat_map(of).collect()
    }
}

/// What predicts the torque balances that are not at their floor beside `names`, trained on `case` and confirmed by `check`.
pub(crate) fn learned(
    [case, check]: [&Case; 2],
    noise: &Noise,
    names: &[Hypothesis],
    channels: &[ChannelRest],
) -> Vec<Learned> {
    let whitener = &case.whitener(noise);
    let of_check = &check.whitener(&check.noise(None, names));
    let fitted = case.search(whitener, names).normal.solve(None);
    let machine = case.balance.signals.machine;
    let lead = case.balance.lead;
    let is_loud = |channel: Channel| {
        let mut own = channels.iter().filter(|rest| rest.channel == channel);
        own.any(|rest| !rest.levels[1].quiet())
    };
    let feed = machine.has_feed().then_some(Subject::Feed);
    let motors = machine.axes().iter().map(|axis| Subject::Motor(*axis));
    let mut open: Vec<Subject> = motors.chain(feed).collect();
    open.retain(|subject| subject.channels(lead).iter().any(|(c, _)| is_loud(*c)));
    let mut sides = [
        Heard::new(case, whitener, names, (case, &fitted)),
        Heard::new(check, of_check, names, (case, &fitted)),
    ];
    let mut learned = Vec::new();
    while !open.is_empty() {
        let asked = open.iter().map(|subject| {
            let judged = asked(&sides, *subject, noise);
            (judged.fall, *subject, judged)
        });
        let carries = asked.filter(|(_, _, judged)| judged.carries);
        let Some((fall, subject, judged)) = carries.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        open.retain(|other| *other != subject);
        for (k, side) in sides.iter_mut().enumerate() {
            side.take(subject, &judged.alone[k]);
        }
        learned.extend(measured(subject, &judged, lead, fall));
    }
    learned
}

impl Heard<'_, '_> {
    /// Takes a prediction away.
    fn take(&mut self, subject: Subject, predicted: &[f64]) {
        let channels = subject.channels(self.case.balance.lead);
        let rows = predicted.len() / channels.len();
        for ((channel, _), own) in channels.iter().zip(predicted.chunks_exact(rows.max(1))) {
            if let Some(left) = &mut self.left.parts[channel.index()] {
                left.iter_mut().zip(own).for_each(|(x, p)| *x -= p);
            }
        }
    }
}

fn asked(sides: &[Heard<'_, '_>; 2], subject: Subject, noise: &Noise) -> Judged {
    let both = [sides[0].side(subject), sides[1].side(subject)];
    let shows = subject.channels(1.0);
    let tops = shows.iter().map(|(channel, _)| noise.top(*channel));
    let balances = [sides[0].case.balance, sides[1].case.balance];
    let fastest = balances.map(|balance| subject.top_speed(balance));
    let top = TAU * tops.fold(f64::INFINITY, f64::min);
    let highest = (top / fastest[0].max(fastest[1]).max(1e-9)).min(1e6) as u32;
    let further = loudest_orders(&both[0], highest);
    judge(
        [&both[0], &both[1]],
        highest,
        &further,
        |along| subject.offers(along),
        |k, group, function| sides[k].shown(subject, &both[k].at, group, function),
    )
}

/// The measured effects of a judgement: one for all whole orders, one for each other group.
fn measured(subject: Subject, judged: &Judged, lead: f64, fall: f64) -> Vec<Learned> {
    let whole = |k: &usize| matches!(judged.groups[*k].0.along, Along::Order(order) if order.fract() == 0.0);
    let (turn, others): (Vec<usize>, Vec<usize>) = (0..judged.groups.len()).partition(whole);
    let turn = (!turn.is_empty()).then_some(turn);
    let parts = turn.into_iter().chain(others.into_iter().map(|k| vec![k]));
    let of = |part: Vec<usize>| {
        let groups: Vec<&Group> = part.iter().map(|k| &judged.groups[*k].0).collect();
        let orders: Vec<f64> = groups.iter().filter_map(|g| g.along.order()).collect();
        let (over, range, points) = match groups[0].along {
            Along::Order(order) => {
                let turn = if order.fract() == 0.0 {
                    TAU
                } else {
                    TAU / order
                };
                let highest = orders.iter().copied().fold(0.0, f64::max) * turn / TAU;
                let points = (POINTS_OF_PERIOD * highest) as usize;
                (
                    MeasuredOver::Angle,
                    [0.0, turn],
                    points.max(LEAST_POINTS) + 1,
                )
            }
            Along::Position => (MeasuredOver::Position, groups[0].range, POINTS),
            Along::PositionByDirection => {
                (MeasuredOver::PositionByDirection, groups[0].range, POINTS)
            }
            _ => (MeasuredOver::Speed, groups[0].range, POINTS),
        };
        let x = |k: usize| range[0] + (range[1] - range[0]) * k as f64 / (points - 1) as f64;
        let places: Vec<At> = (0..points)
            .map(|k| At {
                angle: x(k),
                position: x(k),
                speed: x(k),
                way: 1.0,
                since: 0.0,
            })
            .collect();
        let curve = judged.at(&part, &places);
        let unit = match (subject, over) {
            (Subject::Feed, MeasuredOver::Angle) | (Subject::Motor(_), _) => 1.0,
            (Subject::Feed, _) => lead,
        };
        let effect = Measured {
            quantity: match subject {
                Subject::Motor(_) => Quantity::Torque,
                Subject::Feed => Quantity::Force,
            },
            over,
            range: range.map(|x| x * unit),
            value: curve.iter().map(|[value, _]| *value).collect(),
        };
        Some(Learned {
            effect: EffectModel::new(subject.place(), effect)?,
            along: match &orders[..] {
                [] | [_] => groups[0].along.name(),
                _ => "angle".into(),
            },
            order: (orders.len() == 1).then(|| orders[0]),
            orders: orders.len(),
            at: (0..points).map(|k| x(k) * unit).collect(),
            sigmas: curve.iter().map(|[_, sigma]| *sigma).collect(),
            fall,
        })
    };
    parts.filter_map(of).collect()
}

/// The shapes without a name of a search that a measured effect of the plant can have, as it has them.
pub(crate) fn described(case: &Case, noise: &Noise, found: &[Hypothesis]) -> Vec<Learned> {
    let whitener = case.whitener(noise);
    let fitted = case.search(&whitener, found).normal.solve(None);
    let mut at = case.base.parameters.len();
    let mut curves = Vec::new();
    for hypothesis in found {
        let own = at..at + hypothesis.columns();
        let values = own
            .clone()
            .map(|k| [fitted.values[k], fitted.covariance[(k, k)]]);
        if let Family::Unnamed(shape) = hypothesis.family {
            let values: Vec<[f64; 2]> = values.collect();
            let lead = case.balance.lead;
            curves.extend(as_measured(shape, hypothesis.shape, &values, lead));
        }
        at = own.end + hypothesis.nuisances();
    }
    curves
}

/// A shape with the values and variances of its parameters as a measured effect.
fn as_measured(shape: Unnamed, order: f64, values: &[[f64; 2]], lead: f64) -> Option<Learned> {
    let (place, quantity, unit) = match shape.channel {
        _ if shape.is_force => (Place::Feed, Quantity::Force, 1.0),
        Channel::Torque(axis) => (axis.into(), Quantity::Torque, -1.0),
        _ => return None,
    };
    let extent = shape.extent.map(f64::from_bits);
    let is_own = |axis: Axis| Place::from(axis) == place;
    let (over, range) = match shape.along {
        ShapeAlong::Angle(axis) if is_own(axis) => (MeasuredOver::Angle, [0.0, TAU / order]),
        ShapeAlong::RelativeAngle if shape.is_force => (MeasuredOver::Angle, [0.0, TAU / order]),
        ShapeAlong::Speed(axis) if is_own(axis) => (MeasuredOver::Speed, extent),
        ShapeAlong::RelativeSpeed if shape.is_force => {
            (MeasuredOver::Speed, extent.map(|speed| speed * lead))
        }
        ShapeAlong::TablePosition if shape.is_force => (MeasuredOver::Position, extent),
        ShapeAlong::TightPlace if shape.is_force => (MeasuredOver::PositionByDirection, extent),
        _ => return None,
    };
    let points: Vec<[f64; 2]> = match over {
        MeasuredOver::Angle => (0..=LEAST_POINTS)
            .map(|k| {
                let (sin, cos) = (TAU * k as f64 / LEAST_POINTS as f64).sin_cos();
                let [c, s] = [values[0], values[1]];
                [cos * c[0] + sin * s[0], cos * cos * c[1] + sin * sin * s[1]]
            })
            .collect(),
        _ => values.to_vec(),
    };
    let last = (points.len() - 1) as f64;
    let effect = Measured {
        quantity,
        over,
        range,
        value: points.iter().map(|[value, _]| unit * value).collect(),
    };
    Some(Learned {
        effect: EffectModel::new(place, effect)?,
        along: shape.along.name().into(),
        order: shape.along.repeats().then_some(order),
        orders: 1,
        at: (0..points.len())
            .map(|k| range[0] + (range[1] - range[0]) * k as f64 / last)
            .collect(),
        sigmas: points.iter().map(|[_, v]| v.max(0.0).sqrt()).collect(),
        fall: 0.0,
    })
}
