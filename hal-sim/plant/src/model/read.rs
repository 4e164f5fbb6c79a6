//! `model.toml` to [`Model`].

use super::{
    FeedModel, InstallationModel, MeasuredModel, Model, ModelError, MotorModel, SensingModel,
};
use crate::document::{Fault, section};
use crate::effects::EffectModel;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The fixed sections of a model, without its effects.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Declared {
    screw: MotorModel,
    nut: MotorModel,
    feed: FeedModel,
    sensing: SensingModel,
    #[serde(default)]
    installation: InstallationModel,
    measured: Option<MeasuredModel>,
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// A file that cannot be read, is no UTF-8 or TOML, or has an unknown key, a missing key or a value out of its
    /// range.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        let text = std::fs::read_to_string(path).map_err(|source| ModelError::File {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Reads a model from its text; `origin` names the text in errors.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, ModelError> {
        // Some editors put a byte-order mark in front; the parser would take it as a part of the first key.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let document =
            DeTable::parse(text).map_err(|error| Fault::from(error).at(text, origin, None))?;
        read(document.clone()).map_err(|fault| fault.at(text, origin, Some(document.get_ref())))
    }
}

fn read(document: Spanned<DeTable<'_>>) -> Result<Model, Fault> {
    let span = document.span();
    let mut root = document.into_inner();
    let effects = match root
        .remove("effects")
        .map(|list| (list.span(), list.into_inner()))
    {
        None => Vec::new(),
        Some((_, DeValue::Array(list))) => list
            .into_iter()
            .map(EffectModel::read)
            .collect::<Result<_, _>>()?,
        Some((span, other)) => {
            let message = format!(
                "read a {}, expected tables of effects: [[effects]]",
                other.type_str()
            );
            return Err(Fault { span, message });
        }
    };
    let Declared {
        screw,
        nut,
        feed,
        sensing,
        installation,
        measured,
    } = section(Spanned::new(span, DeValue::Table(root)))?;
    Ok(Model {
        screw,
        nut,
        feed,
        sensing,
        installation,
        measured,
        effects,
    })
}

impl Fault {
    fn at(self, text: &str, origin: &str, document: Option<&DeTable<'_>>) -> ModelError {
        let start = self.span.start.min(text.len());
        let line = 1 + text.as_bytes()[..start]
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count();
        let mut nearest = Nearest {
            span: &self.span,
            best: None,
        };
        if let Some(document) = document {
            nearest.search_table(document, "");
        }
        let key = nearest.best.map_or_else(String::new, |(_, key)| key);
        let mut reason = self.message;
        if key.is_empty() && reason.starts_with("missing field") {
            reason.push_str("; `ddfeed serve --example` prints a whole model");
        }
        ModelError::Content {
            origin: origin.to_owned(),
            line,
            key,
            reason,
        }
    }
}

/// Finds the innermost key or value that holds a place of the text.
struct Nearest<'a> {
    span: &'a Range<usize>,
    best: Option<(usize, String)>,
}

impl Nearest<'_> {
    fn search_table(&mut self, table: &DeTable<'_>, path: &str) {
        for (key, value) in table {
            let name = if path.is_empty() {
                key.get_ref().to_string()
            } else {
                format!("{path}.{}", key.get_ref())
            };
            self.offer(&key.span(), &name);
            self.search_value(value, &name);
        }
    }

    fn search_value(&mut self, value: &Spanned<DeValue<'_>>, name: &str) {
        self.offer(&value.span(), name);
        match value.get_ref() {
            DeValue::Table(table) => self.search_table(table, name),
            DeValue::Array(list) => {
                for (index, item) in list.iter().enumerate() {
                    self.search_value(item, &format!("{name}[{index}]"));
                }
            }
            _ => {}
        }
    }

    fn offer(&mut self, span: &Range<usize>, name: &str) {
        let holds =
            span.start <= self.span.start && self.span.end <= span.end && !self.span.is_empty();
        if holds
            && self
                .best
                .as_ref()
                .is_none_or(|(length, _)| span.len() <= *length)
        {
            self.best = Some((span.len(), name.to_owned()));
        }
    }
}
