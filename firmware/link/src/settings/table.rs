//! What a setting is, and how a group of them is declared.

use super::SettingError;
use crate::telemetry::Real;
use serde::{Deserialize, Serialize};

/// A setting's value, as it is sent and stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Value {
    /// A number in the setting's unit.
    Real(Real),
    /// A whole number.
    Whole(u32),
    /// One of the setting's words, by its place among them.
    Choice(u8),
}

/// What values a setting may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number: least, most.
    Real([f64; 2]),
    /// A whole number: least, most.
    Whole([u32; 2]),
    /// One of these words.
    Choice(&'static [&'static str]),
}

/// A setting as its group declares it, once.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Number within the group, for ever: it is stored and sent.
    pub number: u8,
    /// Name within the group. Its end is the unit.
    pub name: &'static str,
    /// Unit for a person; empty where there is none.
    pub unit: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// What it is until somebody sets it.
    pub default: Value,
    /// What it means.
    pub doc: &'static str,
}

/// A setting: an entry in one of the groups that are made of it.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Number of the group in the upper byte, of the entry in the lower.
    pub id: u16,
    /// Name of the group: a table of the TOML file.
    pub group: &'static str,
    /// The entry.
    pub entry: &'static Entry,
}

impl Setting {
    /// Checks a value against the setting's kind and range.
    ///
    /// # Errors
    /// [`SettingError`] with what is possible.
    pub fn check(&self, value: Value) -> Result<(), SettingError> {
        let (refused, value) = match (self.entry.kind, value) {
            (Kind::Real([least, most]), Value::Real(x)) => {
                (!(x.get() >= least && x.get() <= most), x.get())
            }
            (Kind::Whole([least, most]), Value::Whole(x)) => {
                (!(least..=most).contains(&x), f64::from(x))
            }
            (Kind::Choice(words), Value::Choice(x)) => {
                (usize::from(x) >= words.len(), f64::from(x))
            }
            _ => return Err(SettingError::Kind { id: self.id }),
        };
        if refused {
            return Err(SettingError::Range { id: self.id, value });
        }
        Ok(())
    }
}

/// A setting's type in its group's struct.
pub(super) trait Typed: Sized {
    fn value(self) -> Value;
    fn of(value: Value) -> Option<Self>;
}

impl Typed for f64 {
    fn value(self) -> Value {
        Value::Real(Real::new(self))
    }
    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Real(x) => Some(x.get()),
            _ => None,
        }
    }
}

impl Typed for u32 {
    fn value(self) -> Value {
        Value::Whole(self)
    }
    fn of(value: Value) -> Option<Self> {
        match value {
            Value::Whole(x) => Some(x),
            _ => None,
        }
    }
}

/// Declares an enum of words that a setting may have.
macro_rules! choice {
    ($(#[$about:meta])* $choice:ident { $($(#[$doc:meta])* $name:ident $word:literal,)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $choice {
            $($(#[$doc])* $name,)*
        }

        impl $choice {
            const ALL: &'static [Self] = &[$(Self::$name),*];
            pub(super) const WORDS: &'static [&'static str] = {
                static WORDS: [&str; $choice::ALL.len()] = [$(said($word)),*];
                &WORDS
            };
        }

        impl Typed for $choice {
            fn value(self) -> Value {
                Value::Choice(self as u8)
            }
            fn of(value: Value) -> Option<Self> {
                match value {
                    Value::Choice(x) => Self::ALL.get(usize::from(x)).copied(),
                    _ => None,
                }
            }
        }
    };
}
pub(super) use choice;

/// What only a person reads: not on the chip, which knows settings by their numbers.
pub(super) const fn said(words: &'static str) -> &'static str {
    if cfg!(target_os = "none") { "" } else { words }
}

/// A value as a constant.
macro_rules! constant {
    (Real, $value:expr) => {
        Value::Real(Real::new($value))
    };
    (Whole, $value:expr) => {
        Value::Whole($value)
    };
    (Choice, $value:expr) => {
        Value::Choice($value as u8)
    };
}
pub(super) use constant;

/// Declares a group: its struct with one typed field a setting, and the table of them.
///
/// `number Kind name: type = default, limits, unit, doc;`
macro_rules! group {
    ($(#[$about:meta])* $group:ident { $($number:literal $kind:ident $name:ident: $type:ty = $default:expr, $limits:expr, $unit:literal, $doc:literal;)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $group {
            $(#[doc = $doc] #[doc = concat!("Unit: ", $unit, ".")] pub $name: $type,)*
        }

        impl $group {
            /// What holds until somebody sets it.
            pub const DEFAULT: Self = Self { $($name: $default,)* };
            /// Its settings.
            pub const ENTRIES: &'static [Entry] = {
                // With a name, which places it: what has none lies with the control code's tables, in fast memory.
                static ENTRIES: [Entry; [$($number),*].len()] = [$(Entry {
                    number: $number,
                    name: said(stringify!($name)),
                    unit: said($unit),
                    kind: Kind::$kind($limits),
                    default: constant!($kind, $default),
                    doc: said($doc),
                },)*];
                &ENTRIES
            };

            fn get(&self, number: u8) -> Option<Value> {
                match number {
                    $($number => Some(self.$name.value()),)*
                    _ => None,
                }
            }

            fn put(&mut self, number: u8, value: Value) -> Option<()> {
                match number {
                    $($number => self.$name = Typed::of(value)?,)*
                    _ => return None,
                }
                Some(())
            }
        }
    };
}
pub(super) use group;

/// A value as a person reads it.
struct Shown(Setting, Value);

impl Value {
    /// As a person reads it: a number or a word, without its unit.
    pub fn shown(self, setting: Setting) -> impl core::fmt::Display {
        Shown(setting, self)
    }
}

impl core::fmt::Display for Shown {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match (self.1, self.0.entry.kind) {
            (Value::Real(x), _) => write!(f, "{}", x.get()),
            (Value::Whole(x), _) => write!(f, "{x}"),
            (Value::Choice(x), Kind::Choice(words)) => {
                write!(f, "{}", words.get(usize::from(x)).copied().unwrap_or("?"))
            }
            (Value::Choice(x), _) => write!(f, "{x}"),
        }
    }
}
