//! What a machine may have beyond its declared parameters: one file of `kinds` for each kind.
//!
//! In `model.toml` an effect is a table: `kind`, `where` (`screw`, `nut`, `both`, `feed`) and the parameters of its
//! kind. To add a kind, write its file: a struct with the file's name in Pascal case that implements [`Effect`]. The build
//! finds it.

mod entry;
mod kind;
mod measured;
mod term;

pub use entry::{EffectModel, Place, Places};
pub use kind::{Example, Kind, Linear, Recognition};
pub use measured::{Measured, MeasuredOver, Quantity};
pub use term::{Coordinate, Law, Site, Term};

use crate::limits;
use serde::{Deserialize, Serialize};

/// What all effects have in common. The parameters' names, limits and defaults are those of the implementing struct.
pub trait Effect {
    /// The `kind` in a model file.
    const KIND: &'static str;
    /// The values of `where` that make sense.
    const PLACES: Places;
    /// How a record shows it.
    const RECOGNITION: Recognition;
    /// A usual one.
    const EXAMPLE: Example;

    /// What it adds to the machine at each place it is at.
    fn terms(&self) -> Vec<Term>;
}

macro_rules! registry {
    ($($module:ident::$name:ident in $path:literal,)*) => {
        $(pub use $module::$name;)*

        /// An effect of any kind.
        #[derive(Debug, Clone, PartialEq)]
        #[non_exhaustive]
        pub enum AnyEffect {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
            /// A curve without a cause.
            Measured(Measured),
        }

        impl From<Measured> for AnyEffect {
            fn from(effect: Measured) -> Self { AnyEffect::Measured(effect) }
        }

        $(impl From<$name> for AnyEffect {
            fn from(effect: $name) -> Self { AnyEffect::$name(effect) }
        })*

        impl AnyEffect {
            /// All kinds that have a cause, by their name in a model file.
            pub const KINDS: &'static [&'static str] = &[$($name::KIND,)*];

            /// The same with what is known of each.
            pub const CATALOGUE: &'static [Kind] = &[$(Kind {
                name: $name::KIND,
                structure: stringify!($name),
                places: $name::PLACES,
                recognition: $name::RECOGNITION,
                example: $name::EXAMPLE,
                source: include_str!($path),
            },)*];

            /// The `kind` in a model file.
            pub fn kind(&self) -> &'static str {
                match self {
                    $(AnyEffect::$name(_) => $name::KIND,)*
                    AnyEffect::Measured(_) => Measured::KIND,
                }
            }

            /// The values of `where` that make sense.
            pub fn places(&self) -> Places {
                match self {
                    $(AnyEffect::$name(_) => $name::PLACES,)*
                    AnyEffect::Measured(effect) => effect.places(),
                }
            }

            /// What it adds to the machine at each place it is at.
            pub fn terms(&self) -> Vec<Term> {
                match self {
                    $(AnyEffect::$name(effect) => effect.terms(),)*
                    AnyEffect::Measured(effect) => effect.terms(),
                }
            }

            /// An effect by its kind and its parameters' names; parameters with a default may be left out.
            ///
            /// # Errors
            /// A sentence for an unknown kind, an unknown or missing parameter or a value out of its range.
            pub fn from_parameters<'a>(
                kind: &str,
                parameters: impl IntoIterator<Item = (&'a str, f64)>,
            ) -> Result<Self, String> {
                let table: toml::Table = parameters
                    .into_iter()
                    .map(|(name, value)| (name.to_owned(), toml::Value::Float(value)))
                    .collect();
                let fault = |error: toml::de::Error| format!("{kind}: {}", error.message());
                match kind {
                    $($name::KIND => $name::deserialize(table).map(AnyEffect::$name).map_err(fault),)*
                    _ => Err(format!("read the kind `{kind}`, expected one of {}", AnyEffect::KINDS.join(", "))),
                }
            }

            fn table(&self) -> toml::Table {
                match self {
                    $(AnyEffect::$name(effect) => crate::document::table(effect),)*
                    AnyEffect::Measured(effect) => crate::document::table(effect),
                }
            }

            fn read(kind: &str, parameters: entry::Parameters<'_>) -> Option<Result<Self, crate::document::Fault>> {
                match kind {
                    $($name::KIND => Some(crate::document::section(parameters).map(AnyEffect::$name)),)*
                    Measured::KIND => Some(crate::document::section(parameters).map(AnyEffect::Measured)),
                    _ => None,
                }
            }
        }
    };
}

include!(concat!(env!("OUT_DIR"), "/kinds.rs"));

/// Length of a run where a model does not give it, s.
fn default_run_s() -> f64 {
    10.0
}

impl AnyEffect {
    /// What is known of a kind.
    pub fn kind_named(name: &str) -> Option<&'static Kind> {
        Self::CATALOGUE.iter().find(|kind| kind.name == name)
    }

    /// Its parameters by their names in a model file, in their order there.
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let numbers = self.table().into_iter();
        numbers
            .filter_map(|(name, value)| Some((name, value.as_float()?)))
            .collect()
    }
}
