//! What can stop the drive.

use crate::codes;

/// Whose alignment failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The screw's motor, bridge or encoder.
    Screw,
    /// The nut's.
    Nut,
    /// Both together.
    Pair,
}

impl Part {
    /// Of a motor: 0 is the screw, 1 the nut.
    #[must_use]
    pub const fn motor(index: usize) -> Self {
        if index == 0 { Self::Screw } else { Self::Nut }
    }
}

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
            "The screw's rotor could not be found: `drive status` gives the reason.";
        NutAlignment = 19, "alignment, nut",
            "The nut's rotor could not be found: `drive status` gives the reason.";
        PairAlignment = 20, "alignment, screw and nut",
            "Screw and nut do not go together: `drive status` gives the reason.";
        ScrewAngle = 21, "angle, screw",
            "The screw's voltage is not the one of its encoder's angle: check the encoder's coupling and alignment, the motor's \
             phases and its plate data, and whether two of its current sensors have failed.";
        ScrewCurrentError = 22, "current error, screw",
            "The screw's currents stay away from their references: look for an open phase, a current sensor that is wrong, or \
             wrong plate data.";
        ScrewOverSpeed = 23, "over-speed, screw",
            "The screw's motor turned faster than it may: check its encoder and the command.";
        ScrewFollowing = 24, "following error, screw",
            "The screw's speed stays away from its reference: check its encoder and its load.";
        NutAngle = 25, "angle, nut",
            "The nut's voltage is not the one of its encoder's angle: check the encoder's coupling and alignment, the motor's \
             phases and its plate data, and whether two of its current sensors have failed.";
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
        Scale = 41, "scale and motors apart",
            "The table's scale does not go with the screw's and the nut's encoders: check all three and their cables, the couplings, \
             and whether the nut is held.";
        EndsExchanged = 42, "end switches exchanged",
            "The end switch behind the table opened while the table moved away from it: look whether the two are exchanged.";
        TravelForward = 43, "soft limit, forwards",
            "The table is past its soft limit ahead of positive velocity: command it the other way, and look for a load or a torque \
             limit with which it could not be stopped before.";
        TravelBackward = 44, "soft limit, backwards",
            "The table is past its soft limit ahead of negative velocity: command it the other way, and look for a load or a torque \
             limit with which it could not be stopped before.";
        ScrewDriver = 45, "driver, screw",
            "The fault line at the screw's break input is pulled: a gate driver found a short circuit, heat or a supply that is missing \
             in its stage. If the screw's stage is well, look whether the lines of both drivers are exchanged.";
        NutDriver = 46, "driver, nut",
            "The fault line at the nut's break input is pulled: a gate driver found a short circuit, heat or a supply that is missing \
             in its stage. If the nut's stage is well, look whether the lines of both drivers are exchanged.";
        EnableApart = 47, "enable contacts apart",
            "One contact of the enable switch is open and the other is not, or only one has opened: look for a contact that is welded or \
             a broken wire, then open the switch, so that both open.";
        ControllerSupply = 48, "controller's supply",
            "The controller's own supply is outside 3.1 to 3.5 V, or fell below 2.9 V, which opens both bridges: check its 3.3 V and what \
             feeds and loads it.";
        EmergencyStop = 49, "emergency stop",
            "Both power stages sleep while their bus is on: an emergency stop holds their ENABLE low. Release it, then reset.";
        ScrewAsleep = 50, "stage asleep, screw",
            "The screw's power stage sleeps while its bus is on: look for a torn ENABLE wire, or a gate driver without supply, then reset.";
        NutAsleep = 51, "stage asleep, nut",
            "The nut's power stage sleeps while its bus is on: look for a torn ENABLE wire, or a gate driver without supply, then reset.";
        StageSupply = 52, "stage without supply",
            "A power stage has no supply: its amplifiers give 0 V, and its bus reads nothing. Switch the supply on, then reset.";
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

    /// The rotors could not be found.
    #[must_use]
    pub const fn is_misalignment(self) -> bool {
        matches!(
            self,
            Self::ScrewAlignment | Self::NutAlignment | Self::PairAlignment
        )
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

/// What the pair does when a fault stops it. The reasons are energies. A bridge that opens leaves its motor to friction. Two motors that
/// coast from speed `omega` come to rest `J omega^2 / 2` over their friction torques later, each by itself. So the table moves by the lead
/// times the difference: 8 mm from 800 rpm on the mains board's machine.
///
/// So whatever leaves both motors in hand ends in a stop of both, whose references keep the difference. What is wrong with one motor opens
/// its bridge at once, and the other brings the table to rest. Both bridges open at once only where going on would break a part or turn
/// a motor the wrong way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Both motors come to rest within their limits, the table too; then both bridges open. Stop category 1 of IEC 60204-1.
    Rest,
    /// The same where a motor turns so fast that its voltage would show a wrong angle: it is found in the stop then. Slower, both
    /// bridges open at once.
    RestAtSpeed,
    /// The bridge of its motor opens at once, and the other motor brings the table to rest by its scale: see `follow.rs`. Where
    /// there is no scale, both open.
    Follow,
    /// Both bridges open at once, and the motors coast. Stop category 0.
    Open,
}

impl Reaction {
    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rest => "both come to rest",
            Self::RestAtSpeed => "both come to rest; where they turn slowly, both bridges open",
            Self::Follow => "its bridge opens, the other motor brings the table to rest",
            Self::Open => "both bridges open",
        }
    }
}

impl Fault {
    /// It was found later than `first`, and says better what that was.
    #[must_use]
    #[cold]
    #[inline(never)]
    pub const fn corrects(self, first: Self) -> bool {
        matches!(
            (self, first),
            (Self::ScrewStalled, Self::ScrewEncoder)
                | (Self::NutStalled, Self::NutEncoder)
                | (Self::EnableApart, Self::Disabled)
                // It explains the break and the zero that were found before it.
                | (
                    Self::EmergencyStop | Self::StageSupply,
                    Self::ScrewBreak
                        | Self::NutBreak
                        | Self::ScrewDriver
                        | Self::NutDriver
                        | Self::ScrewCurrentZero
                        | Self::NutCurrentZero
                )
                | (
                    Self::ScrewAsleep,
                    Self::ScrewBreak | Self::ScrewDriver | Self::ScrewCurrentZero
                )
                | (
                    Self::NutAsleep,
                    Self::NutBreak | Self::NutDriver | Self::NutCurrentZero
                )
        )
    }

    /// The same of a break input on which a gate driver's fault line is pulled, or of a break that was the `controller`'s own; all other
    /// faults as they are. A break by comparators is over with its current, a driver holds its line for milliseconds. Of the controller's
    /// own breaks one by its supply is reported here: those by clock, memory and a core that locked up end in a reset.
    #[must_use]
    pub const fn by_line(self, [screw, nut]: [bool; 2], controller: bool) -> Self {
        match self {
            Self::ScrewBreak | Self::NutBreak if controller => Self::ControllerSupply,
            Self::ScrewBreak if screw => Self::ScrewDriver,
            Self::NutBreak if nut => Self::NutDriver,
            other => other,
        }
    }

    /// Unit of its value and its limit, where it has them.
    #[must_use]
    pub const fn unit(self) -> Option<&'static str> {
        match self {
            Self::OverVoltage
            | Self::UnderVoltage
            | Self::ScrewTemperature
            | Self::NutTemperature => Some("ADC counts"),
            Self::ControllerSupply => Some("mV"),
            Self::ScrewLoopLate
            | Self::NutLoopLate
            | Self::SpeedTaskLate
            | Self::SupervisionLate => Some("deadlines missed since the start"),
            Self::ScrewEncoder | Self::NutEncoder => Some("errors since the start"),
            _ => None,
        }
    }

    /// Whose it is: 0 is the screw's motor, 1 the nut's; `None`: the pair's.
    #[must_use]
    pub fn motor(self) -> Option<usize> {
        FaultSet::OF_MOTOR.iter().position(|own| own.has(self))
    }

    /// What the pair does. A stop that is on its way is not waited for by a fault that opens the bridges.
    #[must_use]
    pub const fn reaction(self) -> Reaction {
        match self {
            // Nobody commands, or may: currents, angles and voltages are in hand.
            Self::CommandLost
            | Self::Disabled
            | Self::EnableApart
            | Self::EndForward
            | Self::EndBackward
            | Self::EndsExchanged
            | Self::TravelForward
            | Self::TravelBackward
            // Heat takes seconds where a stop takes tenths of one.
            | Self::ScrewTemperature
            | Self::NutTemperature
            | Self::ScrewHeat
            | Self::NutHeat
            // Found while it is 0.2 V above what opens both bridges by itself.
            | Self::ControllerSupply
            // The control interrupts above it go on.
            | Self::SupervisionLate => Reaction::Rest,
            // Which of the three is wrong is not known.
            Self::Scale => Reaction::RestAtSpeed,
            // A short circuit, or a current that is not in hand, in one motor.
            Self::ScrewBreak
            | Self::NutBreak
            | Self::ScrewDriver
            | Self::NutDriver
            | Self::ScrewAsleep
            | Self::NutAsleep
            | Self::ScrewOverCurrent
            | Self::NutOverCurrent
            | Self::ScrewCurrentError
            | Self::NutCurrentError
            | Self::ScrewCurrentSum
            | Self::NutCurrentSum
            // A torque at an angle that is not there turns the motor any way: that motor has none then.
            | Self::ScrewEncoder
            | Self::NutEncoder
            | Self::ScrewAngle
            | Self::NutAngle
            | Self::ScrewVoltage
            | Self::NutVoltage
            | Self::ScrewOverSpeed
            | Self::NutOverSpeed
            | Self::ScrewFollowing
            | Self::NutFollowing
            | Self::ScrewStalled
            | Self::NutStalled => Reaction::Follow,
            // Nothing moves yet when a zero is measured.
            Self::ScrewCurrentZero
            | Self::NutCurrentZero
            // A bus that is too high takes no braking; one that is too low makes no torque.
            | Self::OverVoltage
            | Self::UnderVoltage
            // The gate drivers have opened both bridges already.
            | Self::EmergencyStop
            | Self::StageSupply
            // Who would control the stop is late itself.
            | Self::SpeedTaskLate
            | Self::ScrewLoopLate
            | Self::NutLoopLate
            | Self::LoopHung
            // The rotors were to be found by small currents.
            | Self::ScrewAlignment
            | Self::NutAlignment
            | Self::PairAlignment => Reaction::Open,
        }
    }
}

/// The set of all faults for which it holds.
macro_rules! all_that {
    (|$fault:ident| $holds:expr) => {{
        let (mut set, mut left): (FaultSet, &[Fault]) = (FaultSet::EMPTY, Fault::ALL);
        while let [$fault, others @ ..] = left {
            if $holds {
                set = set.with(*$fault);
            }
            left = others;
        }
        set
    }};
}

/// `text` ends with `end`.
const fn ends_with(text: &str, end: &str) -> bool {
    let (mut text, mut end) = (text.as_bytes(), end.as_bytes());
    while let ([texts @ .., a], [ends @ .., b]) = (text, end)
        && *a == *b
    {
        (text, end) = (texts, ends);
    }
    end.is_empty()
}

/// Faults that were found since the drive last left one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultSet(u64);

impl FaultSet {
    /// None.
    pub const EMPTY: Self = Self(0);

    /// Those that doubt an angle: [`Fault::doubts_angle`].
    pub const DOUBTS_ANGLE: Self = all_that!(|fault| fault.doubts_angle());

    /// Those for which the pair comes to rest: [`Reaction::Rest`].
    pub const RESTS: Self = all_that!(|fault| matches!(fault.reaction(), Reaction::Rest));

    /// Those for which it does at speed: [`Reaction::RestAtSpeed`].
    pub const RESTS_AT_SPEED: Self =
        all_that!(|fault| matches!(fault.reaction(), Reaction::RestAtSpeed));

    /// Those of one motor: the screw's, the nut's.
    pub const OF_MOTOR: [Self; 2] = [
        all_that!(|fault| ends_with(fault.name(), ", screw")),
        all_that!(|fault| ends_with(fault.name(), ", nut")),
    ];

    /// Those that doubt the table's homed position: of an encoder, or of the scale.
    pub const DOUBTS_POSITION: Self = Self::DOUBTS_ANGLE.with(Fault::Scale);

    /// The set of two words, the lower first: bit `n` is the fault of word `n`.
    #[must_use]
    pub const fn of_words([low, high]: [u32; 2]) -> Self {
        Self((high as u64) << 32 | low as u64)
    }

    /// As two words, the lower first.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn words(self) -> [u32; 2] {
        [self.0 as u32, (self.0 >> 32) as u32]
    }

    /// With one more.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1u64.wrapping_shl(fault.word()))
    }

    /// Of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What is not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// It is one of them.
    #[must_use]
    pub const fn has(self, fault: Fault) -> bool {
        self.0 & 1u64.wrapping_shl(fault.word()) != 0
    }

    /// One of `other` is among them.
    #[must_use]
    pub const fn has_any(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// There is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// In the order of their words.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL
            .iter()
            .copied()
            .filter(move |fault| self.has(*fault))
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
        assert!(
            Fault::ALL.iter().all(|fault| fault.word() < 64),
            "a set of them is 64 bits"
        );
        for fault in Fault::ALL {
            let set = FaultSet::of_words(FaultSet::EMPTY.with(*fault).words());
            assert!(set.iter().eq([*fault]) && set.without(set).is_empty());
        }
        assert_eq!(Fault::of_word(u32::MAX), None);
    }
}
