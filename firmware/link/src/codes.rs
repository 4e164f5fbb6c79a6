//! Codes in the debug view, each with its name and a sentence for a person.

macro_rules! codes {
    ($(#[$about:meta])* $code:ident { $($(#[$doc:meta])* $name:ident = $number:literal, $short:literal, $sentence:literal;)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum $code {
            $($(#[$doc])* #[doc = $sentence] $name = $number,)*
        }

        impl $code {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The code that a word holds.
            #[must_use]
            pub const fn of_word(word: u32) -> Option<Self> {
                match word {
                    $($number => Some(Self::$name),)*
                    _ => None,
                }
            }

            /// The word.
            #[must_use]
            pub const fn word(self) -> u32 {
                self as u32
            }

            /// Its name in a few words.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $short,)*
                }
            }

            /// What it means, and what to do.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self {
                    $(Self::$name => $sentence,)*
                }
            }
        }
    };
}
pub(crate) use codes;

codes! {
    /// What the drive is doing.
    State {
        Off = 0, "off", "Just started; the bridges are off.";
        Calibrating = 1, "calibrating", "The bridges are off and the current zeros are being measured.";
        Ready = 2, "ready", "The bridges are off; the drive can run.";
        Running = 3, "running", "The bridges are on and the drive follows the command.";
        Stopping = 4, "stopping", "The bridges are on and the references go to rest.";
        Fault = 5, "fault", "The bridges are off until the fault's cause is gone and a reset is asked.";
    }
}

codes! {
    /// What stopped the drive.
    Fault {
        None = 0, "no fault", "Nothing has stopped the drive.";
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
    }
}

codes! {
    /// Why the chip was last reset.
    ResetReason {
        Power = 1, "power", "Power came up, or fell below the brown-out level.";
        Pin = 2, "reset pin", "The reset pin, by a button or a probe.";
        Software = 3, "software", "The firmware asked for it: after a panic, or a probe through the core.";
        IndependentWatchdog = 4, "watchdog", "The independent watchdog: a task hung.";
        WindowWatchdog = 5, "window watchdog", "The window watchdog, which this firmware does not use.";
        Other = 6, "other", "Something else.";
    }
}

codes! {
    /// What is asked of the drive, in the command's word `run`.
    Run {
        Rest = 0, "rest", "Come to rest and switch the bridges off.";
        Run = 1, "run", "Follow the commanded speeds.";
        Reset = 2, "reset", "Come to rest, and leave a fault whose cause is gone.";
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
        assert_eq!(Fault::of_word(u32::MAX), None);
    }
}
