//! A power stage that sleeps or has no supply.
//!
//! The amplifiers of a gate driver such as the DRV8323 give 0 V while it sleeps (measured: wiring page of the default board, source 6).
//! A current limit takes that for an over-current. But three phase currents add up to nothing, so three amplifiers at the same end
//! measure no current. The bus then tells a stage that is held asleep from one without supply.

use crate::base::fault::Fault;

/// An amplifier that gives less gives 0 V, ADC counts: far below the zero of 2048, and above the ADC's own offset error.
pub const NOTHING: u16 = 64;

/// What the ADCs read of a power stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageLook {
    /// Codes of the phase currents; of a phase without sensor 0.
    pub current: [u16; 3],
    /// Counts of the bus voltage.
    pub bus: u16,
}

impl StageLook {
    /// All its amplifiers give 0 V.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.current.iter().all(|code| *code < NOTHING)
    }
}

/// Why a stage of the two, screw's and nut's, is silent; `None`: neither is. `bus_least` is the smallest bus of a stage that works, counts.
#[must_use]
pub fn unpowered(stages: &[StageLook; 2], bus_least: u16) -> Option<Fault> {
    let off = |stage: &StageLook| stage.is_silent() && stage.bus < bus_least;
    match stages.each_ref().map(StageLook::is_silent) {
        [false, false] => None,
        _ if stages.iter().any(off) => Some(Fault::StageSupply),
        [true, true] => Some(Fault::EmergencyStop),
        [true, false] => Some(Fault::ScrewAsleep),
        [false, true] => Some(Fault::NutAsleep),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AWAKE: StageLook = StageLook {
        current: [2048, 2040, 2056],
        bus: 1700,
    };
    const ASLEEP: StageLook = StageLook {
        current: [0, 3, 1],
        ..AWAKE
    };
    const OFF: StageLook = StageLook { bus: 2, ..ASLEEP };

    #[test]
    fn silence_is_told_from_current() {
        // The largest negative current in one phase, and its return in the others.
        let current = StageLook {
            current: [0, 3072, 3072],
            ..AWAKE
        };
        for (stages, found) in [
            ([AWAKE, AWAKE], None),
            ([current, AWAKE], None),
            ([ASLEEP, ASLEEP], Some(Fault::EmergencyStop)),
            ([ASLEEP, AWAKE], Some(Fault::ScrewAsleep)),
            ([AWAKE, ASLEEP], Some(Fault::NutAsleep)),
            ([OFF, OFF], Some(Fault::StageSupply)),
            ([ASLEEP, OFF], Some(Fault::StageSupply)),
        ] {
            assert_eq!(unpowered(&stages, 570), found, "{stages:?}");
        }
    }

    #[test]
    fn a_stage_explains_its_own_faults_only() {
        for (stage, first, explains) in [
            (Fault::NutAsleep, Fault::NutDriver, true),
            (Fault::NutAsleep, Fault::ScrewDriver, false),
            (Fault::EmergencyStop, Fault::ScrewDriver, true),
            (Fault::StageSupply, Fault::NutCurrentZero, true),
            (Fault::EmergencyStop, Fault::OverVoltage, false),
        ] {
            assert_eq!(stage.corrects(first), explains, "{stage:?} after {first:?}");
        }
    }
}
