//! An effect at its place: one `[[effects]]` table of a model file.

use super::{AnyEffect, Measured};
use crate::Axis;
use crate::document::Fault;
use toml::de::DeValue;
use toml::{Spanned, Table, Value};

/// A table of the document without `kind` and `where`.
pub(crate) type Parameters<'i> = Spanned<DeValue<'i>>;

/// Which part of the machine has the effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Place {
    /// The screw's motor.
    Screw,
    /// The nut's motor.
    Nut,
    /// Each of the two motors, with the same parameters.
    Both,
    /// Screw-nut pair, table and guideway.
    Feed,
}

impl Place {
    /// All places.
    pub const ALL: [Place; 4] = [Place::Screw, Place::Nut, Place::Both, Place::Feed];

    /// The `where` in a model file.
    pub fn name(self) -> &'static str {
        match self {
            Place::Screw => "screw",
            Place::Nut => "nut",
            Place::Both => "both",
            Place::Feed => "feed",
        }
    }

    /// Whether the motor of `axis` has it.
    pub fn has(self, axis: Axis) -> bool {
        matches!(
            (self, axis),
            (Place::Both, _) | (Place::Screw, Axis::Screw) | (Place::Nut, Axis::Nut)
        )
    }
}

impl From<Axis> for Place {
    fn from(axis: Axis) -> Self {
        match axis {
            Axis::Screw => Place::Screw,
            Axis::Nut => Place::Nut,
        }
    }
}

/// The places at which a kind of effect makes sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Places {
    /// `screw`, `nut` or `both`.
    Motor,
    /// `feed`.
    Feed,
    /// All four.
    MotorOrFeed,
}

impl Places {
    /// Whether `place` is one of them.
    pub fn contains(self, place: Place) -> bool {
        match self {
            Places::Motor => place != Place::Feed,
            Places::Feed => place == Place::Feed,
            Places::MotorOrFeed => true,
        }
    }

    fn list(self) -> String {
        let names: Vec<_> = Place::ALL
            .into_iter()
            .filter(|&place| self.contains(place))
            .map(|place| format!("`{}`", place.name()))
            .collect();
        names.join(", ")
    }
}

/// An effect at its place.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectModel {
    place: Place,
    effect: AnyEffect,
}

impl EffectModel {
    /// An effect at a place; `None` where the kind makes no sense.
    pub fn new(place: Place, effect: impl Into<AnyEffect>) -> Option<Self> {
        let effect = effect.into();
        effect
            .places()
            .contains(place)
            .then_some(EffectModel { place, effect })
    }

    /// Where it is.
    pub fn place(&self) -> Place {
        self.place
    }

    /// What it is.
    pub fn effect(&self) -> &AnyEffect {
        &self.effect
    }

    pub(crate) fn read(table: Spanned<DeValue<'_>>) -> Result<Self, Fault> {
        let span = table.span();
        let mut parameters = match table.into_inner() {
            DeValue::Table(parameters) => parameters,
            other => {
                let message = format!(
                    "read a {}, expected a table with `kind`, `where` and parameters",
                    other.type_str()
                );
                return Err(Fault { span, message });
            }
        };
        let mut take = |key: &str, allowed: &str| match parameters.remove(key) {
            None => Err(Fault {
                span: span.clone(),
                message: format!("missing key `{key}`, expected one of {allowed}"),
            }),
            Some(value) => match value.get_ref() {
                DeValue::String(name) => Ok((value.span(), name.to_string())),
                other => {
                    let message = format!("read a {}, expected one of {allowed}", other.type_str());
                    Err(Fault {
                        span: value.span(),
                        message,
                    })
                }
            },
        };
        let kinds = AnyEffect::KINDS
            .iter()
            .chain([&Measured::KIND])
            .map(|kind| format!("`{kind}`"))
            .collect::<Vec<_>>()
            .join(", ");
        let (kind_span, kind) = take("kind", &kinds)?;
        let (place_span, place) = take("where", "`screw`, `nut`, `both`, `feed`")?;
        let parameters = Spanned::new(span, DeValue::Table(parameters));
        let effect = AnyEffect::read(&kind, parameters).unwrap_or_else(|| {
            Err(Fault {
                span: kind_span,
                message: format!("read `{kind}`, expected one of {kinds}"),
            })
        })?;
        let places = effect.places();
        match Place::ALL.into_iter().find(|known| known.name() == place) {
            Some(place) if places.contains(place) => Ok(EffectModel { place, effect }),
            _ => {
                let message = format!(
                    "read `{place}`, expected for `{kind}` one of {}",
                    places.list()
                );
                Err(Fault {
                    span: place_span,
                    message,
                })
            }
        }
    }

    pub(crate) fn to_table(&self) -> Table {
        let mut table = Table::new();
        table.insert("kind".to_owned(), Value::from(self.effect.kind()));
        table.insert("where".to_owned(), Value::from(self.place.name()));
        table.extend(self.effect.table());
        table
    }
}
