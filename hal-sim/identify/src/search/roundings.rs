//! How the sign of friction turns round: chosen by the record's torque balances, again when effects were found.

use crate::balance::{Assumed, Balance, Contribution, Rounding};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::machines::Machine;
use crate::record::Record;
use crate::regression::design::Whitener;
use crate::regression::normal::Normal;
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use plant::Axis;
use plant::effects::Place;
use plant::model::Model;

/// Roundings of friction that are tried: none, and what simulations that cannot stick use.
const ROUNDINGS: [Rounding; 2] = [
    Rounding {
        bearing: 2.0,
        pair: 0.5,
        guideway: 0.2,
    },
    Rounding {
        bearing: 0.0,
        pair: 0.0,
        guideway: 0.0,
    },
];

/// By what each width is changed in turn, to look for a better one.
const FACTORS: [f64; 6] = [4.0, 2.0, 1.4, 1.4, 1.2, 1.1];
/// Roundings that are tried at most.
const MOST_TRIED: usize = 60;
/// Width with which a sharp sign is looked for rounded, as a share of that of the first rounding.
const SHARPEST: f64 = 0.05;

/// The three widths of a rounding.
fn widths(rounding: Rounding) -> [f64; 3] {
    [rounding.bearing, rounding.pair, rounding.guideway]
}

fn of_widths([bearing, pair, guideway]: [f64; 3]) -> Rounding {
    Rounding {
        bearing,
        pair,
        guideway,
    }
}

/// The rounding with the smallest `length` that is found from the given ones by changing one width after the other.
pub(crate) fn refined(from: [Rounding; 2], length: impl Fn(Rounding) -> f64) -> (Rounding, f64) {
    let measured = from.map(|rounding| (widths(rounding), length(rounding)));
    let [first, second] = measured;
    let mut best = if second.1 < first.1 { second } else { first };
    let mut left = MOST_TRIED;
    let of_each = |factor| (0..3).flat_map(move |k| [(k, factor), (k, 1.0 / factor)]);
    for (k, factor) in FACTORS.into_iter().flat_map(of_each) {
        let sharpest = SHARPEST * widths(ROUNDINGS[0])[k];
        // A step that helps is made again. A sharp sign gets no sharper.
        while left > 0 && (best.0[k] > 0.0 || factor > 1.0) {
            left -= 1;
            let mut tried = best.0;
            tried[k] = match tried[k] * factor {
                0.0 => sharpest,
                width if width > sharpest => width,
                _ => 0.0,
            };
            let now = length(of_widths(tried));
            if now >= best.1 {
                break;
            }
            best = (tried, now);
        }
    }
    (of_widths(best.0), best.1)
}

/// The one of the two that are tried first that is not given.
pub(crate) fn other(given: Rounding) -> Rounding {
    let [first, second] = ROUNDINGS;
    if given == first { second } else { first }
}

/// The torque balances of a record under each rounding, to choose by.
pub(crate) struct Roundings<'a> {
    candidates: Vec<(Balance<'a>, Normal)>,
    whitener: Whitener<'a>,
}

/// The balances under a model of a record with given effects.
pub fn balance<'a>(record: &'a Record, model: &'a Model, found: &[Hypothesis]) -> Balance<'a> {
    record.balance_with(model, Roundings::new(record, model).assumed(found))
}

/// The torques of a contribution.
fn torque(contribution: &Contribution) -> Contribution {
    let torques = contribution
        .0
        .iter()
        .filter(|(channel, _)| matches!(channel, Channel::Torque(_)));
    Contribution(torques.cloned().collect())
}

impl<'a> Roundings<'a> {
    /// Of a record under a model.
    pub(crate) fn new(record: &'a Record, model: &'a Model) -> Self {
        let noise = Noise::declared(model, &record.signals, &record.fourier);
        let whitener = Whitener::new(&record.signals, &record.fourier, &noise);
        let candidates = ROUNDINGS
            .into_iter()
            .map(|rounding| {
                let balance = record.balance_with(
                    model,
                    Assumed {
                        rounding,
                        resonance_hz: None,
                        damping: model.feed.axial_damping_ratio,
                        lags: [0.0; 2],
                    },
                );
                let target = whitener.column(&torque(&balance.torque_residual()));
                let mut normal = Normal::new(target, &whitener.folds);
                let machine = record.signals.machine;
                let all = machine.parameters();
                for parameter in all.into_iter().filter(|p| p.is_torque()) {
                    let column = whitener.column(&torque(&balance.parameter(parameter)));
                    normal.push(column, parameter.prior());
                }
                push_torques(
                    &mut normal,
                    &in_the_way(model, machine),
                    &balance,
                    &whitener,
                );
                (balance, normal)
            })
            .collect();
        Roundings {
            candidates,
            whitener,
        }
    }

    /// What balances must assume of a record with given effects.
    pub(crate) fn assumed(&self, found: &[Hypothesis]) -> Assumed {
        let soft = found
            .iter()
            .find(|hypothesis| hypothesis.family == Family::AxialCompliance);
        Assumed {
            rounding: self.best(found),
            resonance_hz: soft.map(|soft| soft.shape),
            ..self.candidates[0].0.assumed()
        }
    }

    /// The one that explains the record best when it has given effects.
    fn best(&self, found: &[Hypothesis]) -> Rounding {
        let cost = |(balance, normal): &(Balance, Normal)| {
            let mut normal = normal.clone();
            push_torques(&mut normal, found, balance, &self.whitener);
            normal.cost(&normal.solve(None).values)
        };
        self.candidates
            .iter()
            .map(|candidate| (candidate.0.rounding, cost(candidate)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there is at least one rounding")
            .0
    }
}

fn push_torques(
    normal: &mut Normal,
    hypotheses: &[Hypothesis],
    balance: &Balance,
    whitener: &Whitener,
) {
    let run_s = balance.signals.run_s();
    for hypothesis in hypotheses {
        for part in hypothesis.contributions(balance, run_s).iter() {
            normal.push(whitener.column(&torque(part)), hypothesis.prior());
        }
    }
}

/// What must not be taken for another rounding, in the rough: a friction level that changes with speed, and slow torque
/// over an angle.
fn in_the_way(model: &Model, machine: &dyn Machine) -> Vec<Hypothesis> {
    let lead = model.feed.travel_per_radian();
    let places = [(Place::Screw, 1.0), (Place::Nut, 1.0), (Place::Feed, lead)];
    let levels = [2.5, 8.0].into_iter().flat_map(|speed| {
        places.map(|(place, unit)| Hypothesis::new(Family::StribeckFriction, place, speed * unit))
    });
    let waves = Axis::ALL.into_iter().flat_map(|axis| {
        let electrical = f64::from(model.motor(axis).pole_pairs);
        [1.0, 2.0, electrical].map(|order| Hypothesis::new(Family::AngleTorque, axis.into(), order))
    });
    let all = levels.chain(waves);
    all.filter(|hypothesis| hypothesis.is_on(machine)).collect()
}
