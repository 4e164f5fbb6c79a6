//! Two motors on one screw.

use super::Machine;
use crate::effects::family::Family;
use crate::effects::parameter::Parameter;
use crate::signal::channel::Channel;
use plant::Axis;

/// See the module.
#[derive(Debug)]
pub struct DoubleDrive;

impl Machine for DoubleDrive {
    fn channels(&self) -> &'static [Channel] {
        &Channel::ALL
    }

    fn axes(&self) -> &'static [Axis] {
        &Axis::ALL
    }

    fn parameters(&self) -> Vec<Parameter> {
        let motors = Axis::ALL.into_iter().flat_map(Parameter::of_a_drive);
        motors.chain(Parameter::of_the_feed()).collect()
    }

    fn can_have(&self, _: Family) -> bool {
        true
    }

    fn has_feed(&self) -> bool {
        true
    }
}
