//! The shell that all reports share: escaping, numbers, legends, the self-contained page.

use super::chart::Mark;
use plotters::style::RGBColor;

/// `text` for use in HTML text and attributes.
pub fn escape(text: &str) -> String {
    text.chars()
        .fold(String::with_capacity(text.len()), |mut out, c| {
            match c {
                '&' => out.push_str("&amp;"),
                '<' => out.push_str("&lt;"),
                '>' => out.push_str("&gt;"),
                '"' => out.push_str("&quot;"),
                '\'' => out.push_str("&#39;"),
                c => out.push(c),
            }
            out
        })
}

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

/// A sentence for use in HTML, its units kept on the line of their numbers.
pub fn sentence(text: &str) -> String {
    ["%", "rpm", "mm/s"]
        .iter()
        .fold(escape(text), |text, unit| {
            text.replace(&format!(" {unit}"), &format!("\u{A0}{unit}"))
        })
}

/// The key of a chart: sample and name of each series. Names are escaped here.
pub fn legend(entries: &[(RGBColor, Mark, String)]) -> String {
    let entries: String = entries
        .iter()
        .map(|(RGBColor(r, g, b), mark, name)| {
            let color = format!("#{r:02X}{g:02X}{b:02X}");
            let sample = match mark {
                Mark::Line(px) => format!("<path d=\"M0 7H28\" stroke=\"{color}\" stroke-width=\"{px}\"/>"),
                Mark::Dot => format!("<circle cx=\"14\" cy=\"7\" r=\"4\" fill=\"{color}\"/>"),
                Mark::Cross => format!("<path d=\"M9.5 2.5l9 9m0-9l-9 9\" stroke=\"{color}\" stroke-width=\"2.5\"/>"),
                Mark::Ring => format!(
                    "<circle cx=\"14\" cy=\"7\" r=\"4\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"/>"
                ),
            };
            format!(
                "<li><svg class=\"key\" viewBox=\"0 0 28 14\" aria-hidden=\"true\">{sample}</svg>{}</li>\n",
                escape(name)
            )
        })
        .collect();
    format!("<ul class=\"legend\">\n{entries}</ul>\n")
}

/// A whole page. `title` is escaped here, `body` is HTML.
pub fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n{body}</main>\n\
         </body>\n</html>\n",
        title = escape(title),
        style = include_str!("style.css"),
    )
}

/// A plot as an SVG file of its own, with the style that themes it.
pub fn standalone(plot: &str) -> String {
    let style = format!(
        "</title>\n<style>\nsvg {{ font-family: system-ui, sans-serif; }}\n{}</style>",
        include_str!("style.css")
    );
    plot.replacen("</title>", &style, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_text_is_escaped() {
        assert_eq!(
            escape("<b a='1'>\"&\""),
            "&lt;b a=&#39;1&#39;&gt;&quot;&amp;&quot;"
        );
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
