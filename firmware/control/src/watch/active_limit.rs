//! What limits a drive that does what it is asked: no fault, but a reason why it does less.

use crate::codes;

codes! {
    /// A limit that acts.
    Limit {
        Current = 1, "current", "A motor is asked for all of its torque limit's current.";
        Voltage = 2, "voltage", "The bus gives no more voltage to a motor.";
        Speed = 3, "speed", "The pair goes slower than asked, for a motor that cannot follow; the table keeps its way.";
        Acceleration = 4, "acceleration", "The references are on their way to the command, by the limits of acceleration and jerk.";
        Travel = 5, "travel", "An end switch is open, or a soft limit is near: the table goes away from it only.";
        Temperature = 6, "temperature", "The torque current is folded back, for a motor or a bridge is warm by its current (I2t).";
        Regeneration = 7, "regeneration", "Braking is folded back, for the bus is nearly full.";
    }
}

/// Those that act: of the pair, of the screw's motor, of the nut's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ActiveLimits(u32);

impl ActiveLimits {
    /// Bits of a part: a limit's word is below it.
    const PART: u32 = 8;

    /// None.
    pub const NONE: Self = Self(0);

    /// As a word holds them.
    #[must_use]
    pub const fn of_word(word: u32) -> Self {
        Self(word)
    }

    /// The word.
    #[must_use]
    pub const fn word(self) -> u32 {
        self.0
    }

    const fn bit(motor: Option<usize>, limit: Limit) -> u32 {
        let part = match motor {
            None => 0,
            Some(0) => Self::PART,
            Some(_) => 2 * Self::PART,
        };
        1u32.wrapping_shl(part | limit.word())
    }

    /// With one more where `acts`: of a motor (0 the screw's, 1 the nut's), or of the pair.
    #[must_use]
    pub const fn with(self, motor: Option<usize>, limit: Limit, acts: bool) -> Self {
        if acts {
            Self(self.0 | Self::bit(motor, limit))
        } else {
            self
        }
    }

    /// Those of a motor, or of the pair.
    pub fn iter(self, motor: Option<usize>) -> impl Iterator<Item = Limit> {
        let all = Limit::ALL.iter().copied();
        all.filter(move |limit| self.0 & Self::bit(motor, *limit) != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_has_a_bit_of_its_own() {
        let mut all = ActiveLimits::NONE;
        for motor in [None, Some(0), Some(1)] {
            for limit in Limit::ALL {
                let one = ActiveLimits::NONE.with(motor, *limit, true);
                assert_eq!(one.word() & all.word(), 0, "{motor:?} {limit:?}");
                assert!(one.iter(motor).eq([*limit]));
                assert_eq!(
                    ActiveLimits::NONE.with(motor, *limit, false),
                    ActiveLimits::NONE
                );
                all = ActiveLimits::of_word(all.word() | one.word());
            }
        }
    }
}
