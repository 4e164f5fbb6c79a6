//! What of a compensation is worth its settings.

use super::predict::{
    HOLD_S, INTERVAL_S, Place, Predicted, is_gain, part_left, predicted, simulated,
};
use anyhow::Result;
use control::plate::{CompensationPlate, DrivePlate, FrictionPlate, OrderPlate};
use hal_sim::experiment::Setup;
use hal_sim::hold_ripple::WINDOW_S;
use hal_sim::smooth::known::Known;
use plant::Axis;
use plant::model::EncoderKind;

/// Ripple that an order may cost and still be left out, of the ripple before.
const NOTHING: f64 = 1e-3;

/// The plate with what is known.
pub fn compensated(plain: &DrivePlate, known: &Known) -> DrivePlate {
    DrivePlate {
        compensation: known.compensation,
        friction: known.friction,
        ..*plain
    }
}

/// Leaves out what a restart loses and what brings no gain. Gives the rest, with its ripple.
pub fn worth(
    setup: &Setup,
    plain: &DrivePlate,
    places: &[Place],
    mut known: Known,
) -> Result<(Known, Vec<Predicted>)> {
    leave_out_lost(setup, &mut known);
    let runs = |plate: &DrivePlate| {
        let run = |place: &Place| {
            let recorded = place.recorded.as_ref();
            let times = recorded.map_or([INTERVAL_S, HOLD_S], |(velocities, interval_s)| {
                [
                    *interval_s,
                    (velocities.len() as f64 + 1.0) * interval_s + WINDOW_S,
                ]
            });
            simulated(setup, plate, place.point, times)
        };
        places.iter().map(run).collect::<Result<Vec<_>, _>>()
    };
    let without = runs(plain)?;
    let predict = |known: &Known| -> Result<Vec<Predicted>> {
        let with = runs(&compensated(plain, known))?;
        let pairs = places.iter().zip(without.iter().zip(&with));
        Ok(pairs
            .map(|(place, (without, with))| predicted(&setup.model, place, [without, with]))
            .collect())
    };
    let mut best = predict(&known)?;
    for slot in 0..slots(&mut known.compensation).len() {
        let mut fewer = known.clone();
        let order = &mut *slots(&mut fewer.compensation).swap_remove(slot);
        if *order == OrderPlate::NONE {
            continue;
        }
        let left = format!("order {}: it brings no gain", order.order);
        *order = OrderPlate::NONE;
        let tried = predict(&fewer)?;
        if part_left(&tried) <= part_left(&best) + NOTHING {
            fewer.left.push(left);
            (known, best) = (fewer, tried);
        }
    }
    if is_gain(part_left(&best)) {
        return Ok((known, best));
    }
    known.compensation = CompensationPlate::NONE;
    known.friction = FrictionPlate::NONE;
    best = predict(&known)?;
    Ok((known, best))
}

/// All orders that a drive has room for.
fn slots(plate: &mut CompensationPlate) -> Vec<&mut OrderPlate> {
    let CompensationPlate {
        torque,
        angle,
        travel,
        ..
    } = plate;
    let motors = torque.iter_mut().flatten();
    motors
        .chain(angle.iter_mut().flatten())
        .chain(travel)
        .collect()
}

/// What a motor repeats is of its whole turns. An order that was measured over some turns is off a whole one by less than this.
const WHOLE: f64 = 0.02;

/// Orders of a motor's turn that are measured as nearly whole are whole: over many turns the rest would turn their phase.
fn whole_orders(known: &mut Known) {
    let CompensationPlate { torque, angle, .. } = &mut known.compensation;
    for order in torque
        .iter_mut()
        .flatten()
        .chain(angle.iter_mut().flatten())
    {
        let whole = order.order.round();
        if (order.order - whole).abs() < WHOLE {
            order.order = whole;
        }
    }
}

/// After a restart an encoder with index and an absolute one tell where in its turn a rotor stands, and with it the phase of whole orders. An
/// incremental encoder without index counts from where its shaft stands: alignment then tells the electrical angle, and with it the phase of
/// whole orders of that alone.
pub fn leave_out_lost(setup: &Setup, known: &mut Known) {
    whole_orders(known);
    let incremental = setup.model.sensing.encoder == EncoderKind::Incremental;
    let Known {
        compensation, left, ..
    } = known;
    let mut leave_out = |order: &mut OrderPlate, what: &str, why: &str| {
        if *order != OrderPlate::NONE {
            left.push(format!("order {} of {what}: {why}", order.order));
            *order = OrderPlate::NONE;
        }
    };
    const COUNTS: &str = "an incremental encoder without index loses its phase at a restart";
    const TURNS: &str = "it is not a whole order of the turn, and loses its phase at a restart";
    for axis in Axis::ALL {
        let (k, name) = (axis.index(), axis.name());
        let pole_pairs = f64::from(setup.model.motor(axis).pole_pairs);
        let orders = [
            (&mut compensation.torque[k][..], "torque", pole_pairs),
            (&mut compensation.angle[k][..], "encoder", f64::INFINITY),
        ];
        for (orders, of, known_again) in orders {
            for order in orders {
                let what = format!("the {name}'s {of}");
                if order.order.fract() != 0.0 {
                    leave_out(order, &what, TURNS);
                } else if incremental && order.order % known_again != 0.0 {
                    leave_out(order, &what, COUNTS);
                }
            }
        }
    }
    if incremental {
        for order in &mut compensation.travel {
            leave_out(order, "the lead", COUNTS);
        }
    }
}
