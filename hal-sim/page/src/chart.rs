//! Line and point charts as inline SVG.
//!
//! The colours drawn here are the light theme's; `style.css` selects them by value and gives them another in the dark.

use crate::axis::Axis;
use crate::decimate::decimate;
use crate::labels::{Places, around};
use crate::markup::Markup;
pub use crate::scale::{SCALE, TEXT, units};
use askama::Template;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// A colour of this file.
pub type Ink = RGBColor;

/// Text and the frame of a chart.
pub const INK: RGBColor = RGBColor(0x1B, 0x1F, 0x24);
/// Axes and what only helps reading.
pub const MUTED: RGBColor = RGBColor(0x5A, 0x62, 0x6B);
/// Grid lines.
pub const GRID: RGBColor = RGBColor(0xDC, 0xDF, 0xE3);
/// What was asked for: dashed by the style sheet.
pub const REFERENCE: RGBColor = RGBColor(0x5B, 0x63, 0x6C);
/// One of two things compared: CDFS, a residual before.
pub const WARM: RGBColor = RGBColor(0xC2, 0x41, 0x0C);
/// The other: DDFS, a residual after, what was simulated.
pub const COOL: RGBColor = RGBColor(0x0B, 0x62, 0xA8);
/// A third: what was measured elsewhere, what was found.
pub const THIRD: RGBColor = RGBColor(0x9B, 0x1B, 0x6B);

/// Width of a chart, px. At a phone's 390 px the text of [`TEXT`] px is still about 10 px high.
pub const WIDTH: u32 = 480;
const HEIGHT: u32 = 300;
/// Pixel columns of a chart's line: one extreme pair each.
const COLUMNS: usize = 420;

/// How a series is drawn.
#[derive(Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line of so many px.
    Line(f64),
    /// Filled circles.
    Dot,
    /// Crosses.
    Cross,
    /// Circles not filled.
    Ring,
}

/// Points of one kind.
pub struct Series {
    /// (x, y) in the axes' units; what is not finite, or not positive on a logarithmic axis, is left out.
    pub points: Vec<(f64, f64)>,
    /// Colour, one of this file's.
    pub color: RGBColor,
    /// Shape.
    pub mark: Mark,
}

/// A name written at a point.
pub struct Label {
    /// (x, y) in the axes' units.
    pub at: (f64, f64),
    /// The name.
    pub text: String,
    /// Colour, one of this file's.
    pub color: RGBColor,
}

/// A chart.
pub struct Chart<'a> {
    /// Description for readers who cannot see it.
    pub about: &'a str,
    /// Horizontal axis.
    pub x: Axis<'a>,
    /// Vertical axis.
    pub y: Axis<'a>,
    /// Drawn in this order.
    pub series: Vec<Series>,
    /// Written over the series.
    pub labels: Vec<Label>,
}

/// The chart as an `svg` element; a sentence where there is nothing to draw.
pub fn chart(chart: &Chart) -> Markup {
    let series: Vec<(Vec<(f64, f64)>, &Series)> = chart
        .series
        .iter()
        .map(|series| {
            let points: Vec<_> = series
                .points
                .iter()
                .map(|p| (chart.x.map(p.0), chart.y.map(p.1)))
                .filter(|p| p.0.is_finite() && p.1.is_finite())
                .collect();
            let line = matches!(series.mark, Mark::Line(_));
            (
                if line {
                    decimate(&points, COLUMNS)
                } else {
                    points
                },
                series,
            )
        })
        .collect();
    let points = || series.iter().flat_map(|(points, _)| points.iter());
    let spans = points().next().and_then(|_| {
        Some((
            chart.x.span(points().map(|p| p.0))?,
            chart.y.span(points().map(|p| p.1))?,
        ))
    });
    let Some((x, y)) = spans else {
        return Markup::of(&Empty { about: chart.about });
    };
    svg(chart.about, (WIDTH, HEIGHT), |root| {
        draw(chart, root, &series, x, y)
    })
}

/// A picture of `size` px, drawn [`SCALE`] times as large, as an `svg` element that fills its place.
pub fn svg<F>(about: &str, size: (u32, u32), draw: F) -> Markup
where
    F: FnOnce(&Root) -> Result<(), DrawError>,
{
    let mut body = String::new();
    {
        let units = (size.0 * SCALE, size.1 * SCALE);
        let root = SVGBackend::with_string(&mut body, units).into_drawing_area();
        // The backend writes to memory: nothing that is drawn can fail.
        draw(&root)
            .and_then(|()| root.present())
            .expect("a string takes every drawing");
    }
    let inner = body.split_once('>').map_or("", |(_, inner)| inner);
    Markup::of(&Plot {
        about,
        width: size.0 * SCALE,
        height: size.1 * SCALE,
        inner,
    })
}

#[derive(Template)]
#[template(path = "plot.svg")]
struct Plot<'a> {
    about: &'a str,
    width: u32,
    height: u32,
    inner: &'a str,
}

#[derive(Template)]
#[template(path = "empty.html")]
struct Empty<'a> {
    about: &'a str,
}

/// Where a picture is drawn.
pub type Root<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
/// What drawing gives up with.
pub type DrawError = DrawingAreaErrorKind<std::io::Error>;

fn stroke(px: f64) -> u32 {
    units(px).unsigned_abs()
}

/// Text of `px` height, anchored as given.
pub fn text(px: f64, color: RGBColor, h: HPos, v: VPos) -> TextStyle<'static> {
    // The backend divides a font's size by 1.24.
    ("sans-serif", px * 1.24 * f64::from(SCALE))
        .into_font()
        .color(&color)
        .pos(Pos::new(h, v))
}

fn draw(
    chart: &Chart,
    root: &Root,
    series: &[(Vec<(f64, f64)>, &Series)],
    x: Range<f64>,
    y: Range<f64>,
) -> Result<(), DrawError> {
    let mut context = ChartBuilder::on(root)
        .margin_top(units(8.0))
        .margin_right(units(20.0))
        .margin_left(units(2.0))
        .x_label_area_size(units(44.0))
        .y_label_area_size(units(60.0))
        .build_cartesian_2d(chart.x.ticked(x), chart.y.ticked(y))?;
    let label = text(TEXT, MUTED, HPos::Center, VPos::Center);
    context
        .configure_mesh()
        .x_desc(chart.x.title)
        .y_desc(chart.y.title)
        .x_label_formatter(&|v| chart.x.tick_text(*v))
        .y_label_formatter(&|v| chart.y.tick_text(*v))
        .label_style(label)
        .axis_desc_style(text(TEXT, INK, HPos::Center, VPos::Center))
        .axis_style(MUTED.stroke_width(stroke(1.0)))
        .bold_line_style(GRID.stroke_width(stroke(1.0)))
        .light_line_style(TRANSPARENT)
        .set_all_tick_mark_size(units(4.0))
        .draw()?;
    for (points, Series { color, mark, .. }) in series {
        let points = points.iter().copied();
        match *mark {
            Mark::Line(px) => {
                context.draw_series(LineSeries::new(points, color.stroke_width(stroke(px))))?;
            }
            Mark::Dot => {
                context.draw_series(points.map(|p| Circle::new(p, units(4.0), color.filled())))?;
            }
            Mark::Cross => {
                let style = color.stroke_width(stroke(2.5));
                context.draw_series(points.map(|p| Cross::new(p, units(4.5), style)))?;
            }
            Mark::Ring => {
                let style = color.stroke_width(stroke(1.5));
                context.draw_series(points.map(|p| Circle::new(p, units(4.0), style)))?;
            }
        }
    }
    let drawn: Vec<_> = series
        .iter()
        .flat_map(|(points, series)| {
            let half = units(if matches!(series.mark, Mark::Line(_)) {
                1.0
            } else {
                5.0
            });
            points.iter().map(move |p| (*p, half))
        })
        .map(|(p, half)| around(context.backend_coord(&p), half, half))
        .collect();
    let (across, down) = context.plotting_area().get_pixel_range();
    let frame = [across.start, down.start, across.end, down.end];
    let places = Places {
        frame,
        drawn,
        names: Vec::new(),
    };
    draw_labels(chart, root, places, |at| context.backend_coord(at))
}

/// Draws the labels that find a place; `pixel` is where a point lies in the picture.
fn draw_labels(
    chart: &Chart,
    root: &Root,
    mut places: Places,
    pixel: impl Fn(&(f64, f64)) -> (i32, i32),
) -> Result<(), DrawError> {
    for Label {
        at,
        text: name,
        color,
    } in &chart.labels
    {
        let at = (chart.x.map(at.0), chart.y.map(at.1));
        if !(at.0.is_finite() && at.1.is_finite()) {
            continue;
        }
        if let Some(middle) = places.take(name, pixel(&at)) {
            let style = text(TEXT, *color, HPos::Center, VPos::Center);
            root.draw_text(name, &style, middle)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_cover_each_other() {
        let axis = |title| Axis {
            title,
            range: None,
            log: false,
        };
        let label = |x| Label {
            at: (x, 5.0),
            text: "B12".into(),
            color: INK,
        };
        let svg = chart(&Chart {
            about: "a <b>",
            x: axis("x, s"),
            y: axis("y, m"),
            series: vec![Series {
                points: vec![(0.0, 0.0), (10.0, 10.0)],
                color: INK,
                mark: Mark::Dot,
            }],
            labels: vec![label(5.0), label(5.05), label(5.1)],
        });
        let places: Vec<_> = svg
            .split("<text")
            .filter(|t| t.contains("\nB12\n"))
            .map(|t| &t[..24])
            .collect();
        assert_eq!(places.len(), 3);
        assert!(
            places[0] != places[1] && places[1] != places[2] && places[0] != places[2],
            "labels at {places:?}: two in one place"
        );
        assert!(
            svg.contains("a &#60;b&#62;"),
            "no {:?} in:\n{svg}",
            "a &#60;b&#62;"
        );
    }
}
