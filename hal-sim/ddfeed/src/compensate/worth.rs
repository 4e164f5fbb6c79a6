//! What of a compensation is worth its settings.

use super::predict::{
    HOLD_S, INTERVAL_S, Place, Predicted, is_gain, part_left, predicted, simulated,
};
use anyhow::Result;
use control::plate::{CompensationPlate, DrivePlate, FrictionPlate};
use hal_sim::experiment::Setup;
use hal_sim::hold_ripple::WINDOW_S;
use hal_sim::smooth::kept::{compensated, leave_out_lost, slots};
use hal_sim::smooth::known::Known;

/// Ripple that an order may cost and still be left out, of the ripple before.
const NOTHING: f64 = 1e-3;

/// Leaves out what a restart loses and what brings no gain. Gives the rest, with its ripple.
pub fn worth(
    setup: &Setup,
    plain: &DrivePlate,
    places: &[Place],
    mut known: Known,
) -> Result<(Known, Vec<Predicted>)> {
    leave_out_lost(&setup.model, &mut known);
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
        let mut slot = slots(&mut fewer.compensation).swap_remove(slot);
        let order = *slot.order();
        if order == 0.0 {
            continue;
        }
        let left = format!("order {order}: it brings no gain");
        slot.clear();
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
    if known.friction != FrictionPlate::NONE {
        known.friction = FrictionPlate::NONE;
        known.left.push("friction: it brings no gain".to_owned());
    }
    best = predict(&known)?;
    Ok((known, best))
}
