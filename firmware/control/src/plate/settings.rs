//! All settings of a drive: by field, by number, by name, and the plate that they make.

use super::groups::{
    AlignmentSettings, BaseSettings, BrakeSettings, BridgeSettings, CommandSettings,
    CompensationSettings, FeedSettings, FrictionSettings, MotorSettings, RejectionSettings,
    SpeedOrderSettings, TorqueOrderSettings, TravelSettings, TuningSettings, WatchSettings,
};
use super::parameter::{Effect, Entry, Kind, Row, Text, Value};
use core::fmt::{Display, Formatter, Result as Written};

/// Declares the groups, each with its number.
macro_rules! settings {
    ($($number:literal $name:ident: $group:ident,)*) => {
        /// All settings of a drive.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Settings {
            $(#[doc = concat!("Group `", stringify!($name), "`.")] pub $name: $group,)*
        }

        /// By their numbers, which are places from 1.
        static GROUPS: [Group; [$($number),*].len() + 1] = [Group::NONE, $(Group {
            number: $number,
            name: Text::new(stringify!($name)),
            rows: $group::ROWS,
        },)*];

        impl Settings {
            /// What holds until somebody sets it: the paper's motors (Wang et al. 2020, Table 1) on 310 V.
            pub const DEFAULT: Self = Self { $($name: $group::DEFAULT,)* };

            /// The value of a setting; `None` if there is none of that number.
            #[must_use]
            pub fn get(&self, id: u16) -> Option<Value> {
                let [group, number] = id.to_be_bytes();
                match group {
                    $($number => self.$name.get(number),)*
                    _ => None,
                }
            }

            pub(super) fn put(&mut self, id: u16, value: Value) -> Option<()> {
                let [group, number] = id.to_be_bytes();
                match group {
                    $($number => self.$name.put(number, value),)*
                    _ => None,
                }
            }
        }
    };
}

settings! {
    1 screw: MotorSettings,
    2 nut: MotorSettings,
    3 bridge: BridgeSettings,
    4 feed: FeedSettings,
    5 alignment: AlignmentSettings,
    6 tuning: TuningSettings,
    7 watch: WatchSettings,
    8 command: CommandSettings,
    9 compensation: CompensationSettings,
    10 screw_friction: FrictionSettings,
    11 nut_friction: FrictionSettings,
    12 feed_friction: FrictionSettings,
    13 screw_torque: TorqueOrderSettings,
    14 nut_torque: TorqueOrderSettings,
    15 screw_encoder: SpeedOrderSettings,
    16 nut_encoder: SpeedOrderSettings,
    17 lead: SpeedOrderSettings,
    18 rejection: RejectionSettings,
    19 base: BaseSettings,
    20 travel: TravelSettings,
    21 brake: BrakeSettings,
}

/// A group's table.
struct Group {
    number: u8,
    name: Text,
    rows: &'static [Row],
}

/// A setting.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Number of the group in the upper byte, of the parameter in the lower: it is stored and sent, without end.
    pub id: u16,
    group: Text,
    /// The declaration.
    entry: &'static Entry,
    /// What its name begins with.
    prefix: Text,
    /// Its place in an array, from 1.
    place: u8,
}

impl Group {
    const NONE: Self = Self {
        number: 0,
        name: Text::new(""),
        rows: &[],
    };

    /// The largest number in it.
    fn last(&self) -> u8 {
        match self.rows.last() {
            Some(Row::One(entry)) => entry.number,
            Some(Row::Part(first, part)) => {
                let length = part.count.saturating_mul(part.rows.len() as u8);
                first.saturating_add(length).saturating_sub(1)
            }
            None => 0,
        }
    }

    fn setting(&self, number: u8) -> Option<Setting> {
        let setting = |entry, prefix, place| Setting {
            id: u16::from_be_bytes([self.number, number]),
            group: self.name,
            entry,
            prefix,
            place,
        };
        self.rows.iter().find_map(|row| match row {
            Row::One(entry) => (entry.number == number).then(|| setting(entry, Text::new(""), 1)),
            Row::Part(first, part) => {
                let offset = number.checked_sub(*first)?;
                let length = part.rows.len() as u8;
                let (place, k) = (offset.checked_div(length)?, offset.checked_rem(length)?);
                let Row::One(entry) = part.rows.get(usize::from(k))? else {
                    return None;
                };
                let place = place.saturating_add(1);
                (place <= part.count).then(|| setting(entry, part.prefix, place))
            }
        })
    }
}

/// All settings, in the order of their numbers.
#[derive(Clone, Copy, Debug)]
pub struct All {
    /// Number of the last one.
    id: u16,
}

impl All {
    #[inline(never)]
    fn advance(&mut self) -> Option<Setting> {
        loop {
            self.id = self.id.checked_add(1)?;
            let [group, number] = self.id.to_be_bytes();
            let group = GROUPS.get(usize::from(group))?;
            match group.setting(number) {
                None if number >= group.last() => self.id |= 0xFF,
                None => {}
                setting => return setting,
            }
        }
    }
}

impl Iterator for All {
    type Item = Setting;

    fn next(&mut self) -> Option<Setting> {
        self.advance()
    }
}

impl Settings {
    /// All of them, in the order of their numbers.
    #[must_use]
    pub const fn all() -> All {
        All { id: 0 }
    }

    /// Sets one; what it means together with the others is checked when a drive is configured with them.
    ///
    /// # Errors
    /// [`SettingError`]; nothing is changed then.
    pub fn set(&mut self, id: u16, value: Value) -> Result<(), SettingError> {
        let setting = Setting::numbered(id).ok_or(SettingError::Unknown { id })?;
        setting.check(value)?;
        self.put(id, value).ok_or(SettingError::Kind { id })
    }

    /// The changes to `after` that take effect only when the drive has restarted.
    pub fn changes_that_restart(&self, after: &Self) -> impl Iterator<Item = Setting> {
        let changes = self.differences(after).map(|(setting, _, _)| setting);
        changes.filter(|setting| setting.effect() == Effect::Restart)
    }

    /// When the change to `after` takes effect.
    #[must_use]
    pub fn effect(&self, after: &Self) -> Effect {
        let mut effect = Effect::AtOnce;
        for (setting, _, _) in self.differences(after) {
            effect = effect.max(setting.effect());
        }
        effect
    }

    /// The settings in which `other` differs, in the order of their numbers.
    pub fn differences(&self, other: &Self) -> impl Iterator<Item = (Setting, Value, Value)> {
        Self::all().filter_map(|setting| {
            let (ours, theirs) = (self.get(setting.id)?, other.get(setting.id)?);
            (ours != theirs).then_some((setting, ours, theirs))
        })
    }
}

impl Setting {
    /// The setting of a number.
    #[must_use]
    #[inline(never)]
    pub fn numbered(id: u16) -> Option<Self> {
        let [group, number] = id.to_be_bytes();
        GROUPS.get(usize::from(group))?.setting(number)
    }

    /// What it may be.
    #[must_use]
    pub const fn kind(&self) -> Kind {
        self.entry.kind
    }

    /// When a change of it takes effect.
    #[must_use]
    pub const fn effect(&self) -> Effect {
        self.entry.effect
    }

    /// It says what is compensated of a known machine: friction, and what repeats with an angle.
    #[must_use]
    pub fn compensates(&self) -> bool {
        let [group, _] = self.id.to_be_bytes();
        matches!(group, 10..=12) || self.repeats()
    }

    /// It says what repeats with an angle.
    #[must_use]
    pub fn repeats(&self) -> bool {
        let [group, _] = self.id.to_be_bytes();
        matches!(group, 13..=17)
    }

    /// It says how what is compensated is learned.
    #[must_use]
    pub fn learns(&self) -> bool {
        let [group, _] = self.id.to_be_bytes();
        group == 9
    }

    /// Checks a value against the kind and range.
    ///
    /// # Errors
    /// [`SettingError`] with what is possible.
    pub fn check(&self, value: Value) -> Result<(), SettingError> {
        let (held, value) = match (self.kind(), value) {
            (Kind::Real([least, most]), Value::Real(x)) => (x >= least && x <= most, x),
            (Kind::Whole([least, most]), Value::Whole(x)) => {
                ((least..=most).contains(&x), f64::from(x))
            }
            (Kind::Choice(words), Value::Choice(x)) => (usize::from(x) < words.len(), f64::from(x)),
            _ => return Err(SettingError::Kind { id: self.id }),
        };
        if held {
            Ok(())
        } else {
            Err(SettingError::Range { id: self.id, value })
        }
    }

    /// What it may be, in words: `0.5 to 2 mm are`.
    pub fn possible(&self) -> impl Display {
        Possible(*self)
    }

    /// Unit for a person; empty where there is none, and on the chip.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.entry.unit.get()
    }

    /// Name of the group: a table of the TOML file.
    #[must_use]
    pub fn group(&self) -> &'static str {
        self.group.get()
    }

    /// The setting of a name: `feed.lead_mm`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (group, name) = name.split_once('.')?;
        Settings::all().find(|setting| setting.group() == group && setting.is_called(name))
    }

    /// Its name within the group.
    pub fn name(&self) -> impl Display {
        Name(self.prefix.get(), self.entry.name.get(), self.place)
    }

    /// What it means.
    pub fn doc(&self) -> impl Display {
        Name("", self.entry.doc.get(), self.place)
    }

    /// Stands for its parameter at all places of an array: name and documentation have `#` instead of the place.
    #[must_use]
    pub const fn at_all_places(self) -> Self {
        Self { place: 0, ..self }
    }

    /// Whether both are of the same parameter, at any place of an array and in any group.
    #[must_use]
    pub fn is_parameter_of(&self, other: &Self) -> bool {
        core::ptr::eq(self.entry, other.entry)
    }

    /// Whether that is its name within the group.
    #[must_use]
    pub fn is_called(&self, name: &str) -> bool {
        let Some(name) = name.strip_prefix(self.prefix.get()) else {
            return false;
        };
        let Some((begin, end)) = self.entry.name.get().split_once('#') else {
            return name == self.entry.name.get();
        };
        let place = name
            .strip_prefix(begin)
            .and_then(|rest| rest.strip_suffix(end));
        // As it is written, without a sign and zeros before it.
        place.is_some_and(|place| !place.starts_with(['+', '0']) && place.parse() == Ok(self.place))
    }
}

/// A text with its beginning and the place in an array, which `#` stands for.
struct Name(&'static str, &'static str, u8);

impl Display for Name {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        match self.1.split_once('#') {
            Some(_) if self.2 == 0 => write!(f, "{}{}", self.0, self.1),
            Some((begin, end)) => write!(f, "{}{begin}{}{end}", self.0, self.2),
            None => write!(f, "{}{}", self.0, self.1),
        }
    }
}

impl Display for Setting {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        if cfg!(target_os = "none") {
            return write!(f, "setting {:#06x}", self.id);
        }
        write!(f, "{}.{}", self.group(), self.name())
    }
}

/// What a setting may be, in words that end before "possible".
struct Possible(Setting);

impl Display for Possible {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        let unit = self.0.unit();
        let space = if unit.is_empty() { "" } else { " " };
        match self.0.kind() {
            Kind::Real([least, most]) => write!(f, "{least} to {most}{space}{unit} are"),
            Kind::Whole([least, most]) => {
                write!(f, "whole numbers from {least} to {most}{space}{unit} are")
            }
            Kind::Choice(words) => {
                for (k, word) in words.iter().enumerate() {
                    write!(f, "{}\"{word}\"", if k == 0 { "" } else { ", " })?;
                }
                write!(f, " are")
            }
        }
    }
}

/// A value as a person reads it.
struct Shown(Setting, Value);

impl Value {
    /// As a person reads it: a number or a word, without its unit.
    pub fn shown(self, setting: Setting) -> impl Display {
        Shown(setting, self)
    }
}

impl Display for Shown {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        match (self.1, self.0.kind()) {
            (Value::Real(x), _) => write!(f, "{x}"),
            (Value::Whole(x), _) => write!(f, "{x}"),
            (Value::Choice(x), Kind::Choice(words)) => {
                write!(f, "{}", words.get(usize::from(x)).copied().unwrap_or("?"))
            }
            (Value::Choice(x), _) => write!(f, "{x}"),
        }
    }
}

/// Why a value is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingError {
    /// There is no setting of that number.
    Unknown {
        /// The number.
        id: u16,
    },
    /// It is of another kind: a word where a number is wanted.
    Kind {
        /// The setting.
        id: u16,
    },
    /// It is beyond the setting's range.
    Range {
        /// The setting.
        id: u16,
        /// What was asked, in the setting's unit.
        value: f64,
    },
}

impl Display for SettingError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        let (Self::Unknown { id } | Self::Kind { id } | Self::Range { id, .. }) = *self;
        let Some(setting) = Setting::numbered(id) else {
            return write!(f, "there is no setting of number {id:#06x}");
        };
        if let Self::Range { value, .. } = self {
            write!(f, "{setting} is {value}, but ")?;
        } else {
            write!(f, "{setting} has a value of another kind: ")?;
        }
        write!(f, "{} possible", setting.possible())
    }
}

impl core::error::Error for SettingError {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn only_settings_of_the_compensation_learn() {
        let learns = |name: &str| Setting::named(name).unwrap().learns();
        assert!(learns("compensation.learning_s"));
        assert!(!learns("screw_torque.order_1") && !learns("feed.lead_mm"));
    }

    #[test]
    fn each_has_its_own_number_and_name_and_a_default_within_its_range() {
        let all: std::vec::Vec<_> = Settings::all().collect();
        for (k, setting) in all.iter().enumerate() {
            for other in &all[k + 1..] {
                assert_ne!(setting.id, other.id, "{setting} and {other}");
                assert_ne!(setting.to_string(), other.to_string());
            }
            let default = Settings::DEFAULT.get(setting.id).unwrap();
            assert_eq!(setting.check(default), Ok(()), "{setting}");
            let doc = setting.doc().to_string();
            assert!(doc.ends_with('.') && !doc.contains('#'), "{setting}: {doc}");
            assert_eq!(Setting::named(&setting.to_string()).unwrap().id, setting.id);
        }
    }

    /// What is stored and sent by number must not change its meaning: new settings get new numbers.
    #[test]
    fn numbers_stay() {
        for (name, id) in [
            ("screw.resistance_line_to_line_ohm", 0x0101),
            ("nut.encoder_zero_deg", 0x020e),
            ("bridge.over_current_a", 0x0301),
            ("feed.lead_mm", 0x0401),
            ("tuning.observer_damping", 0x0605),
            ("watch.stall_ms", 0x070c),
            ("command.heartbeat_ms", 0x0801),
            ("feed_friction.presliding_mrad", 0x0c04),
            ("nut_torque.im_8_a", 0x0e18),
            ("nut_torque.re_1_per_a", 0x0e19),
            ("nut_torque.im_8_per_a", 0x0e28),
            ("lead.re_2", 0x1105),
            ("rejection.notch_depth", 0x1204),
            ("base.nut_8_rpm", 0x1312),
        ] {
            assert_eq!(Setting::named(name).map(|setting| setting.id), Some(id));
        }
        let compensates = |name: &str| Setting::named(name).unwrap().compensates();
        assert!(compensates("screw_friction.coulomb_nm") && compensates("lead.order_1"));
        assert!(!compensates("rejection.notch_hz"));
        assert!(!compensates("compensation.learning_s") && !compensates("base.wander_rpm"));
        let repeats = |name: &str| Setting::named(name).unwrap().repeats();
        assert!(repeats("lead.order_1") && !repeats("screw_friction.coulomb_nm"));
    }

    #[test]
    fn what_is_refused_changes_nothing_and_is_named_with_what_is_possible() {
        let mut settings = Settings::DEFAULT;
        for (name, value, said) in [
            (
                "feed.lead_mm",
                Value::Real(0.0),
                "feed.lead_mm is 0, but 0.01 to 1000 mm are possible",
            ),
            (
                "feed.lead_mm",
                Value::Real(f64::NAN),
                "feed.lead_mm is NaN, but 0.01 to 1000 mm are possible",
            ),
            (
                "nut.pole_pairs",
                Value::Whole(129),
                "nut.pole_pairs is 129, but whole numbers from 1 to 128 are possible",
            ),
            (
                "bridge.measure_zeros",
                Value::Whole(1),
                "bridge.measure_zeros has a value of another kind: \"off\", \"on\" are possible",
            ),
        ] {
            let id = Setting::named(name).unwrap().id;
            assert_eq!(settings.set(id, value).unwrap_err().to_string(), said);
        }
        assert_eq!(
            settings.set(0x0999, Value::Whole(1)),
            Err(SettingError::Unknown { id: 0x0999 })
        );
        assert_eq!(settings, Settings::DEFAULT);
        let id = Setting::named("nut.pole_pairs").unwrap().id;
        settings.set(id, Value::Whole(7)).unwrap();
        assert_eq!(settings.nut.pole_pairs, 7);
        assert_eq!(settings.differences(&Settings::DEFAULT).count(), 1);
    }
}
