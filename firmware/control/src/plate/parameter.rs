//! How a parameter is declared, once: number, name, unit, range, default, documentation and SI value.
//!
//! [`group!`] makes of a declaration the settings in the units of datasheets, the same in SI, the conversion both ways, access
//! by number, and the table of what each parameter may be. Name, unit text and documentation are on the host only: the chip
//! knows a parameter by its number.

use core::f64::consts::TAU;

/// A parameter's value, in the unit of its setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Real(f64),
    /// A whole number.
    Whole(u32),
    /// One of the parameter's words, by its place among them.
    Choice(u8),
}

/// What values a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number: minimum, maximum.
    Real([f64; 2]),
    /// A whole number: minimum, maximum.
    Whole([u32; 2]),
    /// One of these words.
    Choice(&'static [&'static str]),
}

/// When a change takes effect; of several changes, the last counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effect {
    /// At once, while the drive moves too.
    AtOnce,
    /// At once, but only a drive with open bridges takes it: a moving one has state that belongs to the old value.
    AtRest,
    /// When the drive has restarted, as the current loops and the compensation start with it.
    Restart,
}

/// What only a person reads: empty on the chip, where it takes no room.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text(#[cfg(not(target_os = "none"))] &'static str);

impl Text {
    #[cfg(not(target_os = "none"))]
    pub(super) const fn new(text: &'static str) -> Self {
        Self(text)
    }

    #[cfg(target_os = "none")]
    pub(super) const fn new(_: &'static str) -> Self {
        Self()
    }

    #[cfg(not(target_os = "none"))]
    pub(super) const fn get(self) -> &'static str {
        self.0
    }

    #[cfg(target_os = "none")]
    pub(super) const fn get(self) -> &'static str {
        ""
    }
}

/// A parameter as its group declares it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Number within the group or part.
    pub(super) number: u8,
    /// What it may be.
    pub(super) kind: Kind,
    /// When a change of it takes effect.
    pub(super) effect: Effect,
    /// Name within the group; its end is the unit. `#` stands for the place in an array, from 1.
    pub(super) name: Text,
    pub(super) unit: Text,
    /// What it means.
    pub(super) doc: Text,
}

/// A struct within a group, or an array of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) rows: &'static [Row],
    pub(super) count: u8,
    /// What the names of its parameters begin with.
    pub(super) prefix: Text,
}

/// A line of a group's table.
#[derive(Clone, Copy, Debug)]
pub(super) enum Row {
    One(Entry),
    /// Number of the first, and the part.
    Part(u8, &'static Part),
}

/// Declares the units: the text, the SI value of a value, and back.
macro_rules! units {
    ($($(#[doc = $doc:literal])* $unit:ident $text:literal $x:ident => $si:expr, $own:expr;)*) => {
        /// Unit of a parameter, and what makes SI of it.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Unit {
            $($(#[doc = $doc])* $unit,)*
        }

        impl Unit {
            /// As a person writes it.
            pub(super) const fn text(self) -> &'static str {
                match self {
                    $(Self::$unit => $text,)*
                }
            }

            /// The SI value of a value in this unit.
            #[inline(always)]
            pub(super) const fn si(self, value: f64) -> f64 {
                match self {
                    $(Self::$unit => { let $x = value; $si })*
                }
            }

            /// The value in this unit of an SI value.
            pub(super) const fn own(self, si: f64) -> f64 {
                match self {
                    $(Self::$unit => { let $x = si; $own })*
                }
            }
        }
    };
}

/// V per 1000 rpm of 1 V s/rad.
pub const PER_KRPM: f64 = 1000.0 * TAU / 60.0;
/// Rad/s of one rpm.
const RPM: f64 = TAU / 60.0;

units! {
    One "" x => x, x;
    Counts "counts" x => x, x;
    Percent "%" x => x / 100.0, x * 100.0;
    /// Between two leads: two phases in series, or what is equivalent to that in a delta.
    LineOhm "ohm" x => x / 2.0, x * 2.0;
    LineMillihenry "mH" x => x * 1e-3 / 2.0, x * 2.0 * 1e3;
    /// Of the rms voltage between two leads: see `datasheet`.
    VoltPerKrpm "V/krpm" x => x / PER_KRPM, x * PER_KRPM;
    KilogramSquareCentimetre "kg cm^2" x => x * 1e-4, x * 1e4;
    Rpm "rpm" x => x, x;
    RpmAsRadPerS "rpm" x => x * RPM, x / RPM;
    RpmPerS "rpm/s" x => x * RPM, x / RPM;
    RpmPerS2 "rpm/s^2" x => x * RPM, x / RPM;
    RadPerS "rad/s" x => x, x;
    Milliradian "mrad" x => x * 1e-3, x * 1e3;
    ElectricalDegree "electrical degrees" x => x, x;
    ElectricalDegreeAsTurn "electrical degrees" x => x / 360.0, x * 360.0;
    NewtonMetre "N m" x => x, x;
    Ampere "A" x => x, x;
    AmpereRms "A rms" x => x, x;
    Volt "V" x => x, x;
    Hertz "Hz" x => x, x;
    Second "s" x => x, x;
    Millisecond "ms" x => x * 1e-3, x * 1e3;
    Microsecond "us" x => x * 1e-6, x * 1e6;
    Nanosecond "ns" x => x * 1e-9, x * 1e9;
    Millimetre "mm" x => x * 1e-3, x * 1e3;
    Micrometre "um" x => x * 1e-6, x * 1e6;
    Nanometre "nm" x => x * 1e-9, x * 1e9;
    MillimetrePerS "mm/s" x => x * 1e-3, x * 1e3;
    MillimetrePerS2 "mm/s^2" x => x * 1e-3, x * 1e3;
    MillimetrePerS3 "mm/s^3" x => x * 1e-3, x * 1e3;
}

/// Declares an enum of words that a parameter may have, and what each is in SI structs.
macro_rules! choice {
    ($(#[$about:meta])* $choice:ident: $si:ty { $($(#[$doc:meta])* $name:ident $word:literal => [$($value:tt)*],)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $choice {
            $($(#[$doc])* $name,)*
        }

        impl $choice {
            const ALL: &'static [Self] = &[$(Self::$name),*];
            const WORDS: &'static [&'static str] = {
                static WORDS: [&str; $choice::ALL.len()] = [$(Text::new($word).get()),*];
                &WORDS
            };

            const fn si(self) -> $si {
                match self {
                    $(Self::$name => $($value)*,)*
                }
            }

            const fn of_si(si: $si) -> Self {
                match si {
                    $($($value)* => Self::$name,)*
                }
            }
        }
    };
}

/// Declares a group of parameters, or a part of a group: its settings, and the struct of their SI values.
///
/// `number Kind name => SI name = default, (details), doc;`, with a text after the name that is its name for a person.
///
/// | kind | details |
/// | --- | --- |
/// | `Real` | `Unit [least, most]`; with `/ name` after the unit, the SI value is for one of that setting |
/// | `Whole` | `Unit [least, most]` |
/// | `Choice` | its [`choice!`], and the type in SI |
/// | `Part` | settings, SI struct, beginning of the names; numbers of the part are from 0 |
/// | `Parts` | the same as an array, one after the other: numbers of each, then the places |
///
/// With `in`, the SI struct is one that there is. A change takes effect when the drive has restarted, or as `at_once` or `at_rest` at
/// the end says: see [`Effect`].
macro_rules! group {
    ($(#[$about:meta])* $group:ident => $plate:ident { $($rows:tt)* }) => {
        group! { @plate $(#[$about])* $plate { $($rows)* } }
        group! { $(#[$about])* $group in $plate { $($rows)* } }
    };
    (@plate $(#[$about:meta])* $plate:ident { $($number:literal $kind:ident $name:ident $($text:literal)? => $si:ident = $default:expr, ($($detail:tt)*), $doc:literal $($effect:ident)?;)* }) => {
        $(#[$about])*
        ///
        /// In SI units.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $plate {
            $(#[doc = $doc] pub $si: field!(@si $kind $($detail)*),)*
        }
    };
    ($(#[$about:meta])* $group:ident in $plate:ident { $($number:literal $kind:ident $name:ident $($text:literal)? => $si:ident = $default:expr, ($($detail:tt)*), $doc:literal $($effect:ident)?;)* }) => {
        $(#[$about])*
        ///
        /// In the units of datasheets, as a person sets them.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $group {
            $(#[doc = $doc] pub $name: field!(@own $kind $($detail)*),)*
        }

        impl $group {
            /// What holds until somebody sets it.
            pub const DEFAULT: Self = Self { $($name: $default,)* };
            pub(super) const ROWS: &'static [Row] = {
                // With a name, which places it: what has none lies with the control code's tables, in fast memory.
                static ROWS: [Row; [$($number),*].len()] =
                    [$(row!($kind $number [text!($name $($text)?), effect!($($effect)?)] $doc, $($detail)*),)*];
                &ROWS
            };

            /// The same in SI.
            #[must_use]
            pub const fn plate(&self) -> $plate {
                $plate { $($si: si!($kind self $name, $($detail)*),)* }
            }

            /// The settings of SI values.
            #[must_use]
            pub const fn of_plate(plate: &$plate) -> Self {
                Self { $($name: of_si!($kind plate $si, $($detail)*),)* }
            }

            pub(super) fn get(&self, number: u8) -> Option<Value> {
                $(get!($kind number $number self $name, $($detail)*);)*
                None
            }

            pub(super) fn put(&mut self, number: u8, value: Value) -> Option<()> {
                $(put!($kind number $number value self $name, $($detail)*);)*
                None
            }
        }
    };
}

/// Type of a field.
macro_rules! field {
    (@$_:ident Real $($detail:tt)*) => { f64 };
    (@$_:ident Whole $($detail:tt)*) => { u32 };
    (@own Choice $choice:ident: $si:ty) => { $choice };
    (@si Choice $choice:ident: $si:ty) => { $si };
    (@own Part $part:ident: $si:ident $prefix:literal) => { $part };
    (@si Part $part:ident: $si:ident $prefix:literal) => { $si };
    (@own Parts $part:ident: $si:ident $step:literal; $($k:literal)*) => { [$part; [$($k),*].len()] };
    (@si Parts $part:ident: $si:ident $step:literal; $($k:literal)*) => { [$si; [$($k),*].len()] };
}

/// Name of a parameter: that of its field, if it is not another.
macro_rules! text {
    ($name:ident) => {
        stringify!($name)
    };
    ($name:ident $text:literal) => {
        $text
    };
}

/// When a change takes effect.
macro_rules! effect {
    () => {
        Effect::Restart
    };
    (at_once) => {
        Effect::AtOnce
    };
    (at_rest) => {
        Effect::AtRest
    };
}

/// Row of a table.
macro_rules! row {
    (Real $number:literal [$name:expr, $effect:expr] $doc:literal, $unit:ident $(/ $per:ident)? [$least:expr, $most:expr]) => {
        row!(@one $number [$name, $effect] $doc, $unit, Kind::Real([$least, $most]))
    };
    (Whole $number:literal [$name:expr, $effect:expr] $doc:literal, $unit:ident [$least:expr, $most:expr]) => {
        row!(@one $number [$name, $effect] $doc, $unit, Kind::Whole([$least, $most]))
    };
    (Choice $number:literal [$name:expr, $effect:expr] $doc:literal, $choice:ident: $si:ty) => {
        row!(@one $number [$name, $effect] $doc, One, Kind::Choice($choice::WORDS))
    };
    (@one $number:literal [$name:expr, $effect:expr] $doc:literal, $unit:ident, $kind:expr) => {
        Row::One(Entry {
            number: $number,
            kind: $kind,
            effect: $effect,
            name: Text::new($name),
            unit: Text::new(Unit::$unit.text()),
            doc: Text::new($doc),
        })
    };
    (Part $number:literal [$name:expr, $effect:expr] $doc:literal, $part:ident: $si:ident $prefix:literal) => {
        row!(@part $number $part $prefix, 1)
    };
    (Parts $number:literal [$name:expr, $effect:expr] $doc:literal, $part:ident: $si:ident $step:literal; $($k:literal)*) => {
        row!(@part $number $part "", [$($k),*].len() as u8)
    };
    (@part $number:literal $part:ident $prefix:literal, $count:expr) => {
        Row::Part($number, {
            static PART: Part = Part {
                rows: $part::ROWS,
                count: $count,
                prefix: Text::new($prefix),
            };
            &PART
        })
    };
}

/// SI value of a field.
macro_rules! si {
    (Real $of:ident $name:ident, $unit:ident [$($range:tt)*]) => { Unit::$unit.si($of.$name) };
    (Real $of:ident $name:ident, $unit:ident / $per:ident [$($range:tt)*]) => {
        Unit::$unit.si($of.$name) / $of.$per as f64
    };
    (Whole $of:ident $name:ident, $($detail:tt)*) => { $of.$name };
    (Choice $of:ident $name:ident, $($detail:tt)*) => { $of.$name.si() };
    (Part $of:ident $name:ident, $($detail:tt)*) => { $of.$name.plate() };
    (Parts $of:ident $name:ident, $part:ident: $si:ident $step:literal; $($k:literal)*) => {
        [$($of.$name[$k].plate()),*]
    };
}

/// Setting of a field of SI values.
macro_rules! of_si {
    (Real $of:ident $si:ident, $unit:ident [$($range:tt)*]) => { Unit::$unit.own($of.$si) };
    (Real $of:ident $si:ident, $unit:ident / $per:ident [$($range:tt)*]) => {
        Unit::$unit.own($of.$si * $of.$per as f64)
    };
    (Whole $of:ident $si:ident, $($detail:tt)*) => { $of.$si };
    (Choice $of:ident $si:ident, $choice:ident: $type:ty) => { $choice::of_si($of.$si) };
    (Part $of:ident $si:ident, $part:ident: $($detail:tt)*) => { $part::of_plate(&$of.$si) };
    (Parts $of:ident $si:ident, $part:ident: $type:ident $step:literal; $($k:literal)*) => {
        [$($part::of_plate(&$of.$si[$k])),*]
    };
}

/// Returns a field's value if the number is its.
macro_rules! get {
    (Part $asked:ident $number:literal $of:ident $name:ident, $($detail:tt)*) => {
        if let Some(number) = $asked.checked_sub($number)
            && let Some(value) = $of.$name.get(number)
        {
            return Some(value);
        }
    };
    (Parts $asked:ident $number:literal $of:ident $name:ident, $part:ident: $si:ident $step:literal; $($k:literal)*) => {
        if let Some(number) = $asked.checked_sub($number)
            && let Some(part) = $of.$name.get(usize::from(number / $step))
        {
            return part.get(number % $step);
        }
    };
    ($kind:ident $asked:ident $number:literal $of:ident $name:ident, $($detail:tt)*) => {
        if $asked == $number {
            return Some(get!(@value $kind $of.$name));
        }
    };
    (@value Choice $value:expr) => { Value::Choice($value as u8) };
    (@value $kind:ident $value:expr) => { Value::$kind($value) };
}

/// Puts a value in the field if the number is its.
macro_rules! put {
    (Part $asked:ident $number:literal $value:ident $of:ident $name:ident, $($detail:tt)*) => {
        if let Some(number) = $asked.checked_sub($number)
            && $of.$name.put(number, $value).is_some()
        {
            return Some(());
        }
    };
    (Parts $asked:ident $number:literal $value:ident $of:ident $name:ident, $part:ident: $si:ident $step:literal; $($k:literal)*) => {
        if let Some(number) = $asked.checked_sub($number)
            && let Some(part) = $of.$name.get_mut(usize::from(number / $step))
        {
            return part.put(number % $step, $value);
        }
    };
    (Choice $asked:ident $number:literal $value:ident $of:ident $name:ident, $choice:ident: $si:ty) => {
        if let (true, Value::Choice(place)) = ($asked == $number, $value) {
            $of.$name = *$choice::ALL.get(usize::from(place))?;
            return Some(());
        }
    };
    ($kind:ident $asked:ident $number:literal $value:ident $of:ident $name:ident, $($detail:tt)*) => {
        if let (true, Value::$kind(value)) = ($asked == $number, $value) {
            $of.$name = value;
            return Some(());
        }
    };
}

pub(super) use {choice, effect, field, get, group, of_si, put, row, si, text};
