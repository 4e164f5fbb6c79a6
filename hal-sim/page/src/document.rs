//! The shell that all reports share: numbers, legends, figures, the self-contained page.

use crate::chart::Mark;
use crate::markup::Markup;
use askama::Template;
use plotters::style::RGBColor;

/// A value with two decimals, a dash where there is none.
pub fn two(value: Option<f64>) -> String {
    match value.filter(|v| v.is_finite()) {
        Some(v) => format!("{v:.2}").replace('-', "\u{2212}"),
        None => "\u{2013}".into(),
    }
}

/// A value as it was given, with at most two decimals; a dash where there is none.
pub fn short(value: f64) -> String {
    let text = two(Some(value));
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// A sentence with its units kept on the line of their numbers.
pub fn sentence(text: &str) -> String {
    ["%", "rpm", "mm/s"]
        .iter()
        .fold(text.to_owned(), |text, unit| {
            text.replace(&format!(" {unit}"), &format!("\u{A0}{unit}"))
        })
}

/// The key of a chart: sample and name of each series.
pub fn legend(entries: &[(RGBColor, Mark, String)]) -> Markup {
    Markup::of(&Legend { entries })
}

#[derive(Template)]
#[template(path = "legend.html")]
struct Legend<'a> {
    entries: &'a [(RGBColor, Mark, String)],
}

fn hex(RGBColor(r, g, b): &RGBColor) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

/// Parts of a page under one caption.
pub fn figure(caption: &str, parts: &[Markup]) -> Markup {
    Markup::of(&Figure { caption, parts })
}

#[derive(Template)]
#[template(path = "figure.html")]
struct Figure<'a> {
    caption: &'a str,
    parts: &'a [Markup],
}

/// A whole page, of the template of its body.
pub fn document(title: &str, body: &impl Template) -> String {
    let body = Markup::of(body);
    Markup::of(&Document { title, body }).to_string()
}

#[derive(Template)]
#[template(path = "document.html")]
struct Document<'a> {
    title: &'a str,
    body: Markup,
}

/// A picture as an SVG file of its own, with the style that themes it.
pub fn standalone(picture: &Markup) -> String {
    let (before, after) = picture.split_once("</title>").unwrap_or((picture, ""));
    Markup::of(&Standalone { before, after }).to_string()
}

#[derive(Template)]
#[template(path = "standalone.svg")]
struct Standalone<'a> {
    before: &'a str,
    after: &'a str,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_text_is_escaped_and_that_of_templates_is_not() {
        let inner = figure("<b a='1'>\"&\"", &[]);
        assert!(
            inner.contains("<figcaption>&#60;b a=&#39;1&#39;&#62;&#34;&#38;&#34;</figcaption>"),
            "{}",
            &*inner
        );
        let outer = figure("outer", std::slice::from_ref(&inner));
        assert!(outer.contains(&*inner), "{}", &*outer);
    }

    #[test]
    fn numbers_have_at_most_two_decimals_and_missing_ones_a_dash() {
        assert_eq!(two(Some(-1.005_1)), "\u{2212}1.01");
        assert_eq!(two(Some(f64::NAN)), "\u{2013}");
        assert_eq!(two(None), "\u{2013}");
        assert_eq!(
            (short(20.1), short(300.0), short(2.5)),
            ("20.1".into(), "300".into(), "2.5".into())
        );
    }
}
