//! Small line charts as inline SVG. Drawn in the light theme's colours; `style.css` gives them others by value.

use plotters::prelude::*;

const INK: RGBColor = RGBColor(0x1B, 0x1F, 0x24);
const MUTED: RGBColor = RGBColor(0x5A, 0x62, 0x6B);
const GRID: RGBColor = RGBColor(0xDC, 0xDF, 0xE3);
/// The residual before.
pub(crate) const BEFORE: RGBColor = RGBColor(0xC2, 0x41, 0x0C);
/// The residual after.
pub(crate) const AFTER: RGBColor = RGBColor(0x0B, 0x62, 0xA8);
/// A line that was found.
const LINE: RGBColor = RGBColor(0x9B, 0x1B, 0x6B);

/// The SVG backend rounds to whole units: drawn larger, lines do not step.
const SCALE: u32 = 4;

/// A chart of one quantity before and after.
pub(crate) struct Chart<'a> {
    /// For who cannot see it.
    pub(crate) about: String,
    /// Name and unit of the horizontal axis.
    pub(crate) x: &'a str,
    /// Unit of the vertical axis.
    pub(crate) y: &'a str,
    /// Points before and after.
    pub(crate) series: [Vec<(f64, f64)>; 2],
    /// Where lines were found, with their names.
    pub(crate) marks: Vec<(f64, String)>,
    /// Width and height, px.
    pub(crate) size: (u32, u32),
    /// Whether the vertical axis is logarithmic.
    pub(crate) logarithmic: bool,
}

fn extent(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    (low < high).then_some((low, high))
}

/// A number short enough for an axis.
fn tick(value: f64, span: f64) -> String {
    // What rounding leaves of zero is zero.
    let value = if value.abs() < 1e-9 * span {
        0.0
    } else {
        value
    };
    let text = match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.0e}"),
        size if size < 0.1 => format!("{value:.3}"),
        size if size < 10.0 => format!("{value:.2}"),
        _ => format!("{value:.0}"),
    };
    let trimmed = if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    trimmed.replace('-', "\u{2212}")
}

impl Chart<'_> {
    /// The chart as an `svg` element; nothing if there is nothing to draw.
    pub(crate) fn svg(&self) -> String {
        let points = || {
            self.series
                .iter()
                .flatten()
                .filter(|p| p.0.is_finite() && p.1.is_finite())
        };
        let (Some(x), Some(y)) = (
            extent(points().map(|p| p.0)),
            extent(
                points()
                    .map(|p| p.1)
                    .filter(|y| !self.logarithmic || *y > 0.0),
            ),
        ) else {
            return String::new();
        };
        let mut svg = String::new();
        let drawn = if self.logarithmic {
            // Four decades below the highest hold all that matters.
            self.draw(
                &mut svg,
                x,
                (y.0.max(1e-4 * y.1).log10(), (1.6 * y.1).log10()),
            )
        } else {
            let margin = 0.06 * (y.1 - y.0);
            self.draw(&mut svg, x, (y.0 - margin, y.1 + margin))
        };
        if drawn.is_err() {
            return String::new();
        }
        let (width, height) = (self.size.0 * SCALE, self.size.1 * SCALE);
        let own = format!(
            "<svg class=\"plot\" role=\"img\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n<title>{}</title>",
            self.about
        );
        match svg.find('>') {
            Some(end) => own + &svg[end + 1..],
            None => String::new(),
        }
    }

    fn draw(
        &self,
        svg: &mut String,
        x: (f64, f64),
        y: (f64, f64),
    ) -> Result<(), Box<dyn std::error::Error>> {
        let size = (self.size.0 * SCALE, self.size.1 * SCALE);
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        let font = |color: &RGBColor| ("sans-serif", 13 * SCALE).into_font().color(color);
        let mut chart = ChartBuilder::on(&root)
            .margin(6 * SCALE)
            .x_label_area_size(34 * SCALE)
            .y_label_area_size(64 * SCALE)
            .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        let logarithmic = self.logarithmic;
        chart
            .configure_mesh()
            .x_labels(6)
            .y_labels(5)
            .x_desc(self.x)
            .y_desc(self.y)
            .x_label_formatter(&|v| tick(*v, x.1 - x.0))
            .y_label_formatter(&|v| {
                if logarithmic {
                    tick(10f64.powf(*v), 0.0)
                } else {
                    tick(*v, y.1 - y.0)
                }
            })
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(SCALE))
            .axis_style(MUTED.stroke_width(SCALE))
            .label_style(font(&MUTED))
            .axis_desc_style(font(&INK))
            .draw()?;
        let place = |v: f64| {
            if logarithmic {
                v.max(1e-300).log10().max(y.0)
            } else {
                v
            }
        };
        for (at, _) in &self.marks {
            if (x.0..=x.1).contains(at) {
                chart.draw_series(std::iter::once(PathElement::new(
                    vec![(*at, y.0), (*at, y.1)],
                    LINE.stroke_width(2 * SCALE),
                )))?;
            }
        }
        for (points, color) in self.series.iter().zip([BEFORE, AFTER]) {
            let points = points
                .iter()
                .filter(|p| p.0.is_finite() && p.1.is_finite())
                .map(|p| (p.0, place(p.1)));
            chart.draw_series(LineSeries::new(points, color.stroke_width(SCALE * 3 / 2)))?;
        }
        root.present()?;
        Ok(())
    }
}
