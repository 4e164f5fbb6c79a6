//! Tables that scroll where they are too wide.

use crate::markup::Markup;
use askama::Template;

/// How a column's cells stand.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    /// On one line, to the right.
    Number,
    /// On one line, to the left.
    Text,
    /// On as many lines as it takes, to the left.
    Long,
}

/// A table of `columns`; the first cell of a row heads it. Nothing where there is no row.
pub fn table<const N: usize>(
    about: &str,
    columns: [(&str, Kind); N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> Markup {
    let rows: Vec<_> = rows.into_iter().collect();
    match rows.is_empty() {
        true => Markup::default(),
        false => Markup::of(&Table {
            about,
            columns,
            rows,
        }),
    }
}

#[derive(Template)]
#[template(path = "table.html")]
struct Table<'a, const N: usize> {
    about: &'a str,
    columns: [(&'a str, Kind); N],
    rows: Vec<[String; N]>,
}
