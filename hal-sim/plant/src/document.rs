//! Parts of a TOML document, read and written.

use serde::de::IntoDeserializer;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use toml::de::DeValue;
use toml::{Spanned, Table};

/// Deserialises a part of the document; errors keep their place in the text.
pub(crate) fn section<'de, T: Deserialize<'de>>(value: Spanned<DeValue<'de>>) -> Result<T, Fault> {
    T::deserialize(value.into_deserializer()).map_err(Fault::from)
}

/// What is wrong, and where in the text.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) span: Range<usize>,
    pub(crate) message: String,
}

impl From<toml::de::Error> for Fault {
    fn from(error: toml::de::Error) -> Self {
        Fault {
            span: error.span().unwrap_or(0..0),
            message: error.message().to_owned(),
        }
    }
}

/// A struct as a TOML table. All that a model holds are numbers, strings and lists of structs, which all fit; a value
/// that did not would be left out here and be missed when the text is read.
pub(crate) fn table<T: Serialize>(value: &T) -> Table {
    Table::try_from(value).unwrap_or_default()
}
