//! What can stop the drive.

use crate::alignment::Part;
use crate::codes;

codes! {
    /// What stopped the drive. In the debug view 0 is none.
    Fault {
        ScrewBreak = 1, "over-current, screw",
            "The comparators stopped the screw's bridge: look for a short circuit, or a current loop that is too fast.";
        NutBreak = 2, "over-current, nut",
            "The comparators stopped the nut's bridge: look for a short circuit, or a current loop that is too fast.";
        ScrewCurrentZero = 3, "current zero, screw",
            "A current zero of the screw is far from its nominal place: check the amplifier and its supply.";
        NutCurrentZero = 4, "current zero, nut",
            "A current zero of the nut is far from its nominal place: check the amplifier and its supply.";
        ScrewEncoder = 5, "encoder, screw",
            "The screw's encoder stands while its shaft turns, is read wrong too often, or misses its index: check its \
             cable, shield and supply.";
        NutEncoder = 6, "encoder, nut",
            "The nut's encoder stands while its shaft turns, is read wrong too often, or misses its index: check its \
             cable, shield and supply.";
        SpeedTaskLate = 7, "speed task late",
            "The speed task did not renew the references in time, or was late too often: see `speed_cycles_max`.";
        OverVoltage = 8, "over-voltage",
            "The bus voltage is above its limit: check the supply and the brake resistor.";
        UnderVoltage = 9, "under-voltage",
            "The bus voltage is below its limit while the bridges are on: check the supply.";
        ScrewTemperature = 10, "temperature, screw",
            "The heat sink of the screw's bridge is too hot, or its sensor is torn or shorted.";
        NutTemperature = 11, "temperature, nut",
            "The heat sink of the nut's bridge is too hot, or its sensor is torn or shorted.";
        ScrewOverCurrent = 12, "over-current measured, screw",
            "A measured current of the screw's motor is beyond its limit: look for a short circuit, or lower the torque limit.";
        NutOverCurrent = 13, "over-current measured, nut",
            "A measured current of the nut's motor is beyond its limit: look for a short circuit, or lower the torque limit.";
        ScrewLoopLate = 14, "current loop late, screw",
            "The screw's current loop ended after its period too often: see `cycles_max`, and lower the PWM frequency.";
        NutLoopLate = 15, "current loop late, nut",
            "The nut's current loop ended after its period too often: see `cycles_max`, and lower the PWM frequency.";
        SupervisionLate = 16, "supervision late",
            "The supervision was late too often: something below the control interrupts takes too long.";
        LoopHung = 17, "current loop hung",
            "A current loop hung for two and a half periods, and a timer above it opened the bridges.";
        ScrewAlignment = 18, "alignment, screw",
            "The screw's rotor could not be found: `misalignment` says why.";
        NutAlignment = 19, "alignment, nut",
            "The nut's rotor could not be found: `misalignment` says why.";
        PairAlignment = 20, "alignment, screw and nut",
            "Screw and nut do not go together: `misalignment` says why.";
        ScrewAngle = 21, "angle, screw",
            "The screw's voltage is not the one of its encoder's angle: check the encoder's coupling and alignment, the motor's \
             phases and its plate data.";
        ScrewCurrentError = 22, "current error, screw",
            "The screw's currents stay away from their references: look for an open phase, a current sensor that is wrong, or \
             wrong plate data.";
        ScrewOverSpeed = 23, "over-speed, screw",
            "The screw's motor turned faster than it may: check its encoder and the command.";
        ScrewFollowing = 24, "following error, screw",
            "The screw's speed stays away from its reference: check its encoder and its load.";
        NutAngle = 25, "angle, nut",
            "The nut's voltage is not the one of its encoder's angle: check the encoder's coupling and alignment, the motor's \
             phases and its plate data.";
        NutCurrentError = 26, "current error, nut",
            "The nut's currents stay away from their references: look for an open phase, a current sensor that is wrong, or \
             wrong plate data.";
        NutOverSpeed = 27, "over-speed, nut",
            "The nut's motor turned faster than it may: check its encoder and the command.";
        NutFollowing = 28, "following error, nut",
            "The nut's speed stays away from its reference: check its encoder and its load.";
        ScrewStalled = 29, "stalled, screw",
            "The screw's motor stands at its torque limit: look for what blocks it, a brake that is on, or an encoder \
             that stands or is turned.";
        NutStalled = 30, "stalled, nut",
            "The nut's motor stands at its torque limit: look for what blocks it, a brake that is on, or an encoder \
             that stands or is turned.";
        ScrewHeat = 31, "I2t, screw",
            "The screw's motor or bridge is too warm by its current, although that was folded back: look for currents that are \
             not what is asked.";
        NutHeat = 32, "I2t, nut",
            "The nut's motor or bridge is too warm by its current, although that was folded back: look for currents that are \
             not what is asked.";
        CommandLost = 33, "nobody commands",
            "The command was not renewed in time, and the drive came to rest: look for a host that hangs or a probe that was pulled.";
        Disabled = 34, "not enabled",
            "The enable contact is open: close it, or look for a broken wire.";
        EndForward = 35, "end switch, forwards",
            "The end switch ahead of positive velocity is open: command the table the other way, or look for a broken wire.";
        EndBackward = 36, "end switch, backwards",
            "The end switch ahead of negative velocity is open: command the table the other way, or look for a broken wire.";
        ScrewCurrentSum = 37, "current sum, screw",
            "The three measured currents of the screw do not make zero: check its current sensors one by one, and for a fault to \
             earth.";
        NutCurrentSum = 38, "current sum, nut",
            "The three measured currents of the nut do not make zero: check its current sensors one by one, and for a fault to \
             earth.";
        ScrewVoltage = 39, "voltage, screw",
            "The screw's voltage is not the one that its currents and its encoder's angle take, and no constant error of the angle \
             explains it: check its current sensors, its encoder's signals, its phases, the bus voltage's measurement, and its \
             plate data.";
        NutVoltage = 40, "voltage, nut",
            "The nut's voltage is not the one that its currents and its encoder's angle take, and no constant error of the angle \
             explains it: check its current sensors, its encoder's signals, its phases, the bus voltage's measurement, and its \
             plate data.";
    }
}

impl Fault {
    /// The fault of a part that could not be aligned.
    #[must_use]
    pub const fn misaligned(part: Part) -> Self {
        match part {
            Part::Screw => Self::ScrewAlignment,
            Part::Nut => Self::NutAlignment,
            Part::Pair => Self::PairAlignment,
        }
    }

    /// After it nobody knows where the rotors stand, as far as their encoders do not say so themselves: counts may be lost.
    #[must_use]
    pub const fn doubts_angle(self) -> bool {
        matches!(
            self,
            Self::ScrewEncoder
                | Self::NutEncoder
                | Self::ScrewAngle
                | Self::NutAngle
                | Self::ScrewVoltage
                | Self::NutVoltage
                | Self::ScrewStalled
                | Self::NutStalled
        )
    }
}

/// The word of a fault, or of none.
#[must_use]
pub const fn word(fault: Option<Fault>) -> u32 {
    match fault {
        Some(fault) => fault.word(),
        None => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_code_has_its_own_word_and_name() {
        for (k, code) in Fault::ALL.iter().enumerate() {
            assert_eq!(Fault::of_word(code.word()), Some(*code));
            let others = &Fault::ALL[k + 1..];
            assert!(others.iter().all(|other| other.name() != code.name()));
            assert!(code.sentence().ends_with('.'));
        }
        assert_eq!(Fault::of_word(word(None)), None);
        assert_eq!(Fault::of_word(u32::MAX), None);
    }
}
