//! Which faults name the cause of a cell rightly: those whose sentence sends a person to this input.

use super::cell::Input;
use control::alignment::{Misalignment, Reason};
use control::fault::Fault;
use control::fault::Part;
use plant::Axis;

/// The one of screw and nut.
fn of<T>(axis: Axis, screw: T, nut: T) -> T {
    match axis {
        Axis::Screw => screw,
        Axis::Nut => nut,
    }
}

/// `fault` sends a person to `input`.
#[must_use]
pub fn names(input: Input, fault: Fault, misalignment: Option<Misalignment>) -> bool {
    use Fault as F;
    match input {
        Input::Current(axis, _) => names_current(axis, fault, misalignment),
        Input::Bus(axis) => {
            matches!(fault, F::OverVoltage | F::UnderVoltage)
                || fault == of(axis, F::ScrewVoltage, F::NutVoltage)
        }
        Input::Temperature(axis) => fault == of(axis, F::ScrewTemperature, F::NutTemperature),
        Input::Encoder(_) if fault == F::Scale => true,
        Input::Encoder(axis) => names_encoder(axis, fault, misalignment),
        Input::Index(axis) => {
            // Counts that an index has moved are a wrong angle, and are not where the scale says.
            fault == F::Scale
                || misaligned(axis, misalignment) == Some(Reason::Unsteady)
                || fault == of(axis, F::ScrewEncoder, F::NutEncoder)
                || fault == of(axis, F::ScrewAngle, F::NutAngle)
                || fault == of(axis, F::ScrewVoltage, F::NutVoltage)
                || fault == of(axis, F::ScrewOverSpeed, F::NutOverSpeed)
        }
        Input::Scale => fault == F::Scale,
        // A table that is past its soft limit or at its stop: what let it go there, and what blocks it, is looked for.
        Input::EndForward | Input::EndBackward | Input::Command
            if matches!(
                fault,
                F::ScrewStalled | F::NutStalled | F::TravelForward | F::TravelBackward
            ) =>
        {
            true
        }
        Input::EndForward => matches!(fault, F::EndForward | F::EndsExchanged),
        Input::EndBackward => matches!(fault, F::EndBackward | F::EndsExchanged),
        Input::Enable(_) => matches!(fault, F::Disabled | F::EnableApart),
        // Of a line that says nothing the open bridge shows, as phases that carry no current.
        // Which of two lines is whose nobody knows while both bridges are open: either sentence sends a person to both.
        Input::DriverFault(_) if matches!(fault, F::ScrewDriver | F::NutDriver) => true,
        Input::DriverFault(axis) => {
            let running = of(
                axis,
                [F::ScrewVoltage, F::ScrewCurrentError],
                [F::NutVoltage, F::NutCurrentError],
            );
            // Its sentence sends a person to the gate driver.
            running.contains(&fault)
                || misaligned(axis, misalignment) == Some(Reason::NoCurrent)
                    && fault == of(axis, F::ScrewAlignment, F::NutAlignment)
        }
        // A wrong command ends at the end of the way.
        Input::Command => matches!(fault, F::CommandLost | F::EndForward | F::EndBackward),
        Input::Heartbeat => fault == F::CommandLost,
        // Whether it stops or is off, the chip's reset says it, and no fault. A demand is not a fault either.
        Input::Clock | Input::Reset | Input::Demand => false,
        Input::Supply => fault == F::ControllerSupply,
    }
}

fn names_current(axis: Axis, fault: Fault, misalignment: Option<Misalignment>) -> bool {
    use Fault as F;
    let sensor = of(
        axis,
        [
            F::ScrewBreak,
            F::ScrewCurrentZero,
            F::ScrewOverCurrent,
            F::ScrewCurrentError,
            F::ScrewCurrentSum,
            F::ScrewVoltage,
        ],
        [
            F::NutBreak,
            F::NutCurrentZero,
            F::NutOverCurrent,
            F::NutCurrentError,
            F::NutCurrentSum,
            F::NutVoltage,
        ],
    );
    let reason =
        |reason: Reason| reason.word() <= Reason::Wiring.word() || reason == Reason::Unsteady;
    sensor.contains(&fault)
        || misaligned(axis, misalignment).is_some_and(reason)
            && fault == of(axis, F::ScrewAlignment, F::NutAlignment)
}

fn names_encoder(axis: Axis, fault: Fault, misalignment: Option<Misalignment>) -> bool {
    use Fault as F;
    let motion = of(
        axis,
        [
            F::ScrewEncoder,
            F::ScrewAngle,
            F::ScrewVoltage,
            F::ScrewFollowing,
            F::ScrewOverSpeed,
            F::ScrewStalled,
        ],
        [
            F::NutEncoder,
            F::NutAngle,
            F::NutVoltage,
            F::NutFollowing,
            F::NutOverSpeed,
            F::NutStalled,
        ],
    );
    // Encoders, pole pairs, load, mechanics: the sentences of all of them name the encoder or its coupling.
    let reason = |reason: Reason| {
        matches!(
            reason,
            Reason::Held
                | Reason::Unsteady
                | Reason::LoadMoves
                | Reason::Reversed
                | Reason::StoredAngle
                | Reason::Exchanged
                | Reason::Travel
        )
    };
    motion.contains(&fault)
        || misaligned(axis, misalignment).is_some_and(reason) && fault.is_misalignment()
}

/// `fault` sends a person to the current sensors of a motor of which two are wrong: two that stand hide their phases' currents, which turn
/// the voltage as a wrong angle does. One alone shows in the sum of three.
#[must_use]
pub fn names_two_channels(inputs: impl Iterator<Item = Input> + Clone, fault: Fault) -> bool {
    Axis::ALL.into_iter().any(|axis| {
        let of_axis = |input: &Input| matches!(input, Input::Current(at, _) if *at == axis);
        fault == of(axis, Fault::ScrewAngle, Fault::NutAngle)
            && inputs.clone().filter(of_axis).count() == 2
    })
}

/// Why this motor or the pair could not be aligned.
fn misaligned(axis: Axis, misalignment: Option<Misalignment>) -> Option<Reason> {
    let Misalignment { part, reason } = misalignment?;
    (part == of(axis, Part::Screw, Part::Nut) || part == Part::Pair).then_some(reason)
}
