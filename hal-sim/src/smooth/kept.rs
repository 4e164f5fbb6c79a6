//! Compensation of a known machine, and the part of it that outlives a restart.

use crate::smooth::known::Known;
use control::plate::{CompensationPlate, DrivePlate, OrderPlate};
use plant::Axis;
use plant::model::{EncoderKind, Model};

/// The plate with what is known.
#[must_use]
pub fn compensated(plain: &DrivePlate, known: &Known) -> DrivePlate {
    DrivePlate {
        compensation: known.compensation,
        friction: known.friction,
        ..*plain
    }
}

/// What a motor repeats is of its whole turns. An order that was measured over some turns is off a whole one by less than this.
const WHOLE: f64 = 0.02;

/// Orders of a motor's turn that are measured as nearly whole are whole: over many turns the rest would turn their phase.
fn whole_orders(known: &mut Known) {
    let CompensationPlate {
        torque,
        angle,
        travel,
        ..
    } = &mut known.compensation;
    let motors = torque
        .iter_mut()
        .flatten()
        .chain(angle.iter_mut().flatten());
    for order in motors.chain(travel) {
        let whole = order.order.round();
        if (order.order - whole).abs() < WHOLE {
            order.order = whole;
        }
    }
}

/// After a restart an encoder with index and an absolute one tell where in its turn a rotor stands, and with it the phase of whole orders. An
/// incremental encoder without index counts from where its shaft stands: alignment then tells the electrical angle, and with it the phase of
/// whole orders of that alone.
pub fn leave_out_lost(model: &Model, known: &mut Known) {
    whole_orders(known);
    let incremental = |axis| model.sensing.encoder_kind(axis) == EncoderKind::Incremental;
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
        let pole_pairs = f64::from(model.motor(axis).pole_pairs);
        let orders = [
            (&mut compensation.torque[k][..], "torque", pole_pairs),
            (&mut compensation.angle[k][..], "encoder", f64::INFINITY),
        ];
        for (orders, of, known_again) in orders {
            for order in orders {
                let what = format!("the {name}'s {of}");
                if order.order.fract() != 0.0 {
                    leave_out(order, &what, TURNS);
                } else if incremental(axis) && order.order % known_again != 0.0 {
                    leave_out(order, &what, COUNTS);
                }
            }
        }
    }
    // The lead's angle is between both shafts.
    for order in &mut compensation.travel {
        let lost = |axis| {
            incremental(axis) && order.order % f64::from(model.motor(axis).pole_pairs) != 0.0
        };
        if order.order.fract() != 0.0 {
            leave_out(order, "the lead", TURNS);
        } else if Axis::ALL.into_iter().any(lost) {
            leave_out(order, "the lead", COUNTS);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Orders 2, 20 and 2.5 of the lead. Both motors have pole pairs that divide 20, not 2.
    #[test]
    fn the_lead_keeps_orders_that_both_shafts_repeat() {
        for (encoder, expected) in [
            (EncoderKind::Index, [2.0, 20.0]),
            (EncoderKind::Incremental, [0.0, 20.0]),
        ] {
            let mut model = Model::coupled();
            (model.sensing.encoder, model.sensing.nut_encoder) = (encoder, None);
            (model.screw.pole_pairs, model.nut.pole_pairs) = (5, 4);
            let mut known = Known::of(&model, 0.0);
            for (line, order) in known.compensation.travel.iter_mut().zip([2.0, 20.0, 2.5]) {
                *line = OrderPlate {
                    order,
                    re: 1e-3,
                    im: 0.0,
                };
            }
            leave_out_lost(&model, &mut known);
            let kept = known.compensation.travel.map(|line| line.order);
            assert_eq!(kept[..3], [expected[0], expected[1], 0.0], "{encoder:?}");
        }
    }
}
