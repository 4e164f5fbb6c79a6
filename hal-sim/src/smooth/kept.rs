//! Compensation of a known machine, and the part of it that outlives a restart.

use crate::smooth::known::Known;
use control::plate::{CompensationPlate, DrivePlate, OrderPlate, TorqueOrderPlate};
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

/// One order that a drive has room for.
pub enum OrderSlot<'a> {
    /// Of a torque.
    Torque(&'a mut TorqueOrderPlate),
    /// Of a speed.
    Speed(&'a mut OrderPlate),
}

impl OrderSlot<'_> {
    /// Repetitions in a turn; 0: none.
    pub fn order(&mut self) -> &mut f64 {
        match self {
            Self::Torque(order) => &mut order.order,
            Self::Speed(order) => &mut order.order,
        }
    }

    /// Forgets its coefficient.
    fn forget(&mut self) {
        match self {
            Self::Torque(order) => **order = TorqueOrderPlate::unknown(order.order),
            Self::Speed(order) => **order = OrderPlate::unknown(order.order),
        }
    }

    /// Takes the order away.
    pub fn clear(&mut self) {
        match self {
            Self::Torque(order) => **order = TorqueOrderPlate::NONE,
            Self::Speed(order) => **order = OrderPlate::NONE,
        }
    }
}

/// All orders that a drive has room for: torque of screw and nut, encoders, lead.
pub fn slots(plate: &mut CompensationPlate) -> Vec<OrderSlot<'_>> {
    let CompensationPlate {
        torque,
        angle,
        travel,
        ..
    } = plate;
    let speeds = angle.iter_mut().flatten().chain(travel);
    let torques = torque.iter_mut().flatten().map(OrderSlot::Torque);
    torques.chain(speeds.map(OrderSlot::Speed)).collect()
}

/// What a motor repeats is of its whole turns. An order that was measured over some turns is off a whole one by less than this.
const WHOLE: f64 = 0.02;

/// Orders of a motor's turn that are measured as nearly whole are whole: over many turns the rest would turn their phase.
fn whole_orders(known: &mut Known) {
    for mut slot in slots(&mut known.compensation) {
        let order = slot.order();
        let whole = order.round();
        if (*order - whole).abs() < WHOLE {
            *order = whole;
        }
    }
}

/// After a restart an encoder with index and an absolute one tell where in its turn a rotor stands, and with it the phase of whole orders. An
/// incremental encoder without index counts from where its shaft stands: alignment then tells the electrical angle, and with it the phase of
/// whole orders of that alone. A drive that learns has the others without their coefficients.
pub fn leave_out_lost(model: &Model, known: &mut Known) {
    whole_orders(known);
    let incremental = |axis| model.sensing.encoder_kind(axis) == EncoderKind::Incremental;
    let Known {
        compensation, left, ..
    } = known;
    let learns = compensation.learning_s != 0.0;
    let mut leave_out = |mut slot: OrderSlot<'_>, what: &str, why: &str| {
        let order = *slot.order();
        if learns {
            slot.forget();
        } else if order != 0.0 {
            left.push(format!("order {order} of {what}: {why}"));
            slot.clear();
        }
    };
    const COUNTS: &str = "an incremental encoder without index loses its phase at a restart";
    const TURNS: &str = "it is not a whole order of the turn, and loses its phase at a restart";
    for axis in Axis::ALL {
        let (k, name) = (axis.index(), axis.name());
        let pole_pairs = f64::from(model.motor(axis).pole_pairs);
        let torques = compensation.torque[k].iter_mut().map(OrderSlot::Torque);
        let angles = compensation.angle[k].iter_mut().map(OrderSlot::Speed);
        let torques = torques.map(|slot| (slot, "torque", pole_pairs));
        let angles = angles.map(|slot| (slot, "encoder", f64::INFINITY));
        for (mut slot, of, known_again) in torques.chain(angles) {
            let what = format!("the {name}'s {of}");
            let order = *slot.order();
            if order.fract() != 0.0 {
                leave_out(slot, &what, TURNS);
            } else if incremental(axis) && order % known_again != 0.0 {
                leave_out(slot, &what, COUNTS);
            }
        }
    }
    // The lead's angle is between both shafts.
    for order in &mut compensation.travel {
        let lost = |axis| {
            incremental(axis) && order.order % f64::from(model.motor(axis).pole_pairs) != 0.0
        };
        let why = if order.order.fract() != 0.0 {
            Some(TURNS)
        } else {
            Axis::ALL.into_iter().any(lost).then_some(COUNTS)
        };
        if let Some(why) = why {
            leave_out(OrderSlot::Speed(order), "the lead", why);
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
            let mut known = Known::of(&model);
            for (line, order) in known.compensation.travel.iter_mut().zip([2.0, 20.0, 2.5]) {
                *line = OrderPlate {
                    order,
                    re: 1e-3,
                    im: 0.0,
                };
            }
            let mut learning = known.clone();
            learning.compensation.learning_s = 0.5;
            leave_out_lost(&model, &mut learning);
            let left = learning
                .compensation
                .travel
                .map(|line| (line.order, line.re));
            let of_two = if expected[0] == 2.0 { 1e-3 } else { 0.0 };
            assert_eq!(
                left[..3],
                [(2.0, of_two), (20.0, 1e-3), (2.5, 0.0)],
                "{encoder:?}, learning"
            );
            leave_out_lost(&model, &mut known);
            let kept = known.compensation.travel.map(|line| line.order);
            assert_eq!(kept[..3], [expected[0], expected[1], 0.0], "{encoder:?}");
        }
    }
}
