//! Faults that are put into a simulated machine.

use super::world::World;
use crate::drive::Drive;
use crate::experiment::Setup;
use control::interlock::Inputs;
use link::message::{Injected, Injection, Refusal};
use plant::Axis;

/// A fault that is possible.
#[derive(Clone, Copy, Debug)]
pub(super) struct Possible {
    fault: Injected,
    axis: Axis,
    amount: f64,
}

impl Possible {
    /// # Errors
    /// [`Refusal::Injection`] if there is no such motor, or no such amount.
    pub(super) fn new(fault: Injected, injection: &Injection) -> Result<Self, Refusal> {
        let motor = usize::from(injection.motor);
        let axis = *Axis::ALL.get(motor).ok_or(Refusal::Injection)?;
        let amount = injection.amount.get();
        let possible = fault
            .range()
            .is_none_or(|[least, most]| (least..=most).contains(&amount));
        possible
            .then_some(Self {
                fault,
                axis,
                amount,
            })
            .ok_or(Refusal::Injection)
    }

    pub(super) fn put(&self, drive: &mut Drive, world: &mut World, setup: &Setup) {
        let (k, amount, axis) = (self.axis.index(), self.amount, self.axis);
        match self.fault {
            Injected::Clear => {
                world.inputs = Inputs::CLEAR;
                (world.frozen, world.offset_a) = ([None; 2], [0.0; 2]);
                world.load_n = setup.model.feed.load_n;
                drive.board.set_bus_voltage(setup.board.bus_v);
                for axis in Axis::ALL {
                    drive.board.machine.set_open_phase(axis, None);
                }
            }
            Injected::EncoderFrozen => world.frozen[k] = Some(drive.sample(axis).encoder),
            Injected::EncoderSlip => drive.misalign(axis, amount / 360.0),
            Injected::DriverFault => drive.board.trip_break(axis),
            Injected::OpenPhase => {
                let phase = amount as usize - 1;
                drive.board.machine.set_open_phase(axis, Some(phase));
            }
            Injected::Bus => drive.board.set_bus_voltage(amount),
            Injected::Load => world.load_n = amount,
            Injected::EnableOpen => world.inputs.enabled = [false; 2],
            Injected::EndForward => world.inputs.end_forward = true,
            Injected::EndBackward => world.inputs.end_backward = true,
            Injected::CurrentOffset => world.offset_a[k] = amount,
        }
    }
}
