//! A raw word of the seam -> the count of a motor's encoder.

use crate::current::mt6835;

/// How a motor's encoder is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interface {
    /// Two channels counted by a timer modulo the turn: the word is the count.
    #[default]
    Incremental,
    /// The same with an index, which puts the count to zero in hardware: where counts were lost, it jumps there.
    IncrementalWithIndex,
    /// An MT6835 on SPI: the word is its frame.
    Mt6835,
}

impl Interface {
    /// The count that `word` stands for; `None` if it did not arrive whole or its sensor does not vouch for it.
    #[must_use]
    #[inline(always)]
    pub const fn counts(self, word: u32) -> Option<u32> {
        match self {
            Self::Incremental | Self::IncrementalWithIndex => Some(word),
            Self::Mt6835 => mt6835::counts(word),
        }
    }

    /// The count says where the rotor stands as soon as it is read, after any pause.
    #[must_use]
    pub const fn is_absolute(self) -> bool {
        matches!(self, Self::Mt6835)
    }

    /// A reading can be wrong without standing still.
    #[must_use]
    pub const fn is_checked(self) -> bool {
        !matches!(self, Self::Incremental)
    }
}
