//! What the project knows of a kind of effect: all of it stands in the kind's own file.

use super::{Place, Places};

/// How a record shows an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recognition {
    /// The identification has code for it: a family.
    Family,
    /// The terms are linear in one number. The identification derives columns, excitation and limits from them.
    Linear(Linear),
    /// No record shows it, with the reason.
    Never(&'static str),
}

/// An effect whose terms are linear in one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Linear {
    /// The number's name in a model file.
    pub number: &'static str,
    /// The number's unit; empty for a share.
    pub unit: &'static str,
    /// A report's words behind "The nut's motor"; `{}` stands for the number.
    pub says: &'static str,
    /// What a user does about it, in a word and in a sentence.
    pub remedy: (&'static str, &'static str),
}

/// A place, and parameters of a usual size by their names in a model file.
pub type Example = (Place, &'static [(&'static str, f64)]);

/// A kind of effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// The `kind` in a model file.
    pub name: &'static str,
    /// Name of its struct, whose fields are its parameters.
    pub structure: &'static str,
    /// The values of `where` that make sense.
    pub places: Places,
    /// How a record shows it.
    pub recognition: Recognition,
    /// A usual one.
    pub example: Example,
    /// Text of its file.
    pub source: &'static str,
}

impl Kind {
    /// What makes it a linear one.
    pub fn linear(&self) -> Option<Linear> {
        match self.recognition {
            Recognition::Linear(linear) => Some(linear),
            _ => None,
        }
    }
}
