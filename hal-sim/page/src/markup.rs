//! HTML and SVG that a template made: it goes into another template as it is, while all other text is escaped there.

use askama::Template;
use std::fmt;
use std::ops::Deref;

/// A part of a page.
#[derive(Clone, Default)]
pub struct Markup(String);

impl Markup {
    /// What the template makes.
    pub fn of(template: &impl Template) -> Self {
        Self(template.render().expect("a string takes every template"))
    }
}

impl askama::filters::HtmlSafe for Markup {}

impl fmt::Display for Markup {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Deref for Markup {
    type Target = str;

    fn deref(&self) -> &str {
        &self.0
    }
}
