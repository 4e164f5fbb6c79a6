//! Curves without a name that the motors can make. As of named effects, more torque than the greatest current makes is refused.

use crate::balance::Balance;
use crate::conclusion::concluded;
use crate::conclusion::curves::Learned;
use crate::conclusion::outcome::Outcome;
use crate::effects::limits::{TORQUE, greatest_torque};
use crate::search::case::Case;
use crate::search::progress::Progress;
use crate::signal::noise::Noise;
use plant::Axis;
use plant::effects::Place;

/// An outcome with curves that the motors can make; the others are refused. None where no curve is left.
pub(crate) fn curved(
    [case, check]: [&Case; 2],
    noise: &Noise,
    progress: &Progress,
    mut curves: Vec<Learned>,
) -> Option<(Outcome, Vec<Learned>)> {
    refuse_impossible(case.balance, &mut curves, &[]);
    while !curves.is_empty() {
        let effects: Vec<_> = curves.iter().map(|curve| curve.effect.clone()).collect();
        let [own, other] = [case, check].map(|case| case.base.with_curves(case.balance, &effects));
        let own = Case::new(case.balance, &own);
        let other = Case::new(check.balance, &other);
        let outcome = concluded(&own, &other, noise, progress);
        if !refuse_impossible(case.balance, &mut curves, &outcome.curve_shares) {
            return Some((outcome, curves));
        }
    }
    None
}

/// Refuses the curves that take more torque than a motor's greatest current makes; whether there were any. `shares` is how much the
/// record has of each, all of it where that is not known.
fn refuse_impossible(balance: &Balance, curves: &mut Vec<Learned>, shares: &[f64]) -> bool {
    let count = curves.len();
    let mut shares = shares.iter().copied();
    curves.retain(|curve| {
        let share: f64 = shares.next().unwrap_or(1.0);
        let is_possible = share.abs() * share_of_greatest(curve, balance) <= 1.0;
        if !is_possible {
            let refusals = &balance.refusals;
            refusals.count("measured", curve.effect.place(), TORQUE);
        }
        is_possible
    });
    curves.len() < count
}

/// A curve's greatest torque or force in what the motor's greatest current makes; of a force on the table the screw's motor's.
fn share_of_greatest(curve: &Learned, balance: &Balance) -> f64 {
    let most = match curve.effect.place() {
        Place::Feed => greatest_torque(balance, Axis::Screw) / balance.lead.abs(),
        Place::Nut => greatest_torque(balance, Axis::Nut),
        _ => greatest_torque(balance, Axis::Screw),
    };
    let sizes = curve.values().iter().map(|value| value.abs());
    sizes.fold(0.0, f64::max) / most.max(1e-300)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::balance::Assumed;
    use crate::record::Record;
    use plant::effects::{EffectModel, Measured, MeasuredOver, Quantity};
    use plant::model::Model;
    use plant::recording::{Recording, Sample};

    /// Both motors at rest with 1 A of q current: the rotor's angle is 0, so that phase a has none of it.
    fn at_rest(model: &Model) -> Recording {
        let mut recording = Recording::default();
        for row in 0..2000 {
            let mut sample = Sample {
                time_s: f64::from(row) / model.sensing.sample_hz,
                ..Sample::default()
            };
            for axis in &mut sample.axes {
                axis.ib_a = 0.75_f64.sqrt();
            }
            recording.push(&sample);
        }
        recording
    }

    fn curve(place: Place, greatest: f64) -> Learned {
        let quantity = match place {
            Place::Feed => Quantity::Force,
            _ => Quantity::Torque,
        };
        let effect = Measured {
            quantity,
            over: MeasuredOver::Speed,
            range: [-1.0, 1.0],
            value: vec![0.0, -greatest],
        };
        Learned::of(EffectModel::new(place, effect).expect("a place for a curve"))
    }

    #[test]
    fn a_curve_is_refused_that_no_motor_can_make() {
        let model = Model::coupled();
        let record = Record::new(&at_rest(&model), &model);
        let balance = record.balance_with(&model, Assumed::PLAIN);
        for (place, axis, unit) in [
            (Place::Screw, Axis::Screw, 1.0),
            (Place::Nut, Axis::Nut, 1.0),
            (Place::Feed, Axis::Screw, balance.lead.abs()),
        ] {
            let motor = model.motor(axis);
            // Of 1 A, which the filter lets overshoot.
            let most = f64::from(motor.pole_pairs) * motor.flux_wb / unit;
            let mut curves = vec![curve(place, 0.7 * most), curve(place, 1.5 * most)];
            assert!(refuse_impossible(&balance, &mut curves, &[]));
            assert_eq!(curves.len(), 1, "{place:?}");
            // The fit takes more of it than was learnt.
            assert!(!refuse_impossible(&balance, &mut curves, &[1.1]));
            assert!(refuse_impossible(&balance, &mut curves, &[2.2]));
            assert!(curves.is_empty(), "{place:?}");
        }
        let refused = balance.refusals.list();
        assert!(
            refused
                .iter()
                .all(|one| (one.hypothesis.as_str(), one.reason, one.trials)
                    == ("measured", TORQUE, 2)),
            "{refused:?}"
        );
        assert_eq!(refused.len(), 3);
    }
}
