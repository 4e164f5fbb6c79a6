//! The heat map of ripple over table speed and nut speed.

use super::sweep_report::SweepReport;
use askama::Template;
use page::axis::extent;
use page::chart::{DrawError, INK, MUTED, Root, SCALE, TEXT, WIDTH, svg, text, units};
use page::document::short;
use page::markup::Markup;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};
use std::ops::Range;

/// A DDFS point against the same row's CDFS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// DDFS has less ripple.
    Better,
    /// DDFS has as much or more.
    Worse,
    /// CDFS itself, or one of both is missing.
    Open,
}

/// The VRF at a row and a column, %, if the drive reached the point.
pub(super) fn vrf(report: &SweepReport, row: usize, column: usize) -> Option<f64> {
    let value = *report.vrf_percent.get(row)?.get(column)?;
    value.filter(|v| v.is_finite())
}

/// The VRF of the row's CDFS, %.
pub(super) fn cdfs(report: &SweepReport, row: usize) -> Option<f64> {
    vrf(
        report,
        row,
        report.nut_rpm.iter().position(|rpm| *rpm == 0.0)?,
    )
}

/// Which of both feeds is the smoother.
pub(super) fn verdict(report: &SweepReport, row: usize, column: usize) -> Verdict {
    let is_cdfs = report.nut_rpm.get(column).is_none_or(|rpm| *rpm == 0.0);
    match (vrf(report, row, column), cdfs(report, row)) {
        (Some(ddfs), Some(cdfs)) if !is_cdfs => match ddfs < cdfs {
            true => Verdict::Better,
            false => Verdict::Worse,
        },
        _ => Verdict::Open,
    }
}

/// From little to much ripple: dark blue over grey to light yellow, in equal steps of lightness, so that it reads
/// without colour. Each fill carries its own text colour: the same in the light and in the dark.
const RAMP: [RGBColor; 6] = [
    RGBColor(0x00, 0x2A, 0x5C),
    RGBColor(0x2F, 0x4B, 0x6E),
    RGBColor(0x66, 0x6E, 0x76),
    RGBColor(0x97, 0x92, 0x77),
    RGBColor(0xCC, 0xBB, 0x68),
    RGBColor(0xFE, 0xE8, 0x5A),
];
const ON_LIGHT: RGBColor = RGBColor(0x00, 0x00, 0x01);
const ON_DARK: RGBColor = RGBColor(0xFF, 0xFF, 0xFE);
/// A point that the drive did not reach.
const EMPTY: RGBColor = RGBColor(0xF3, 0xF5, 0xF7);

/// Colour of a place between 0 and 1 of the scale.
fn color(place: f64) -> RGBColor {
    let last = RAMP.len() - 1;
    let at = place.clamp(0.0, 1.0) * last as f64;
    let low = (at as usize).min(last - 1);
    let (a, b, part) = (RAMP[low], RAMP[low + 1], at - low as f64);
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    RGBColor(mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}

/// Text that reads on `fill`.
fn on(RGBColor(r, g, b): RGBColor) -> RGBColor {
    let light = 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
    if light > 117.0 { ON_LIGHT } else { ON_DARK }
}

/// Colour scale, logarithmic.
struct Scale(Range<f64>);

impl Scale {
    fn of(report: &SweepReport) -> Option<Self> {
        let values = report.vrf_percent.iter().flatten().copied().flatten();
        let Range { start, end } = extent(values.filter(|v| *v > 0.0).map(f64::log10))?;
        Some(Self(if end - start > 1e-9 {
            start..end
        } else {
            start - 0.1..end + 0.1
        }))
    }

    fn place(&self, vrf: f64) -> f64 {
        (vrf.log10() - self.0.start) / (self.0.end - self.0.start)
    }

    /// 1, 2, 5, 10 ... within the scale, or its ends where fewer than two of those are.
    fn ticks(&self) -> Vec<f64> {
        let ticks: Vec<f64> = (-3..6)
            .flat_map(|decade| [1.0, 2.0, 5.0].map(|step| step * 10f64.powi(decade)))
            .filter(|tick| (0.0..=1.0).contains(&self.place(*tick)))
            .collect();
        match ticks.len() {
            0 | 1 => vec![10f64.powf(self.0.start), 10f64.powf(self.0.end)],
            _ => ticks,
        }
    }
}

/// Smallest width of a cell that holds its value, px.
const CELL: u32 = 42;
/// Left of the cells: ticks and the axis' title.
const LEFT: u32 = 62;
const RIGHT: u32 = 10;
const TOP: u32 = 62;
const BOTTOM: u32 = 44;
/// Beyond this the picture does not grow: narrower cells without values instead.
const WIDEST: u32 = 1000;

/// Where the cells lie, px.
struct Grid {
    width: u32,
    height: u32,
    rows: usize,
    columns: usize,
}

impl Grid {
    fn of(report: &SweepReport) -> Self {
        let (rows, columns) = (report.table_mm_s.len(), report.nut_rpm.len());
        let wanted = LEFT + RIGHT + CELL * u32::try_from(columns).unwrap_or(u32::MAX / CELL / 2);
        let tall =
            u32::try_from(rows).unwrap_or(u32::MAX).min(100) * if rows > 16 { 20 } else { 38 };
        Self {
            width: wanted.clamp(WIDTH, WIDEST),
            height: TOP + BOTTOM + tall,
            rows,
            columns,
        }
    }

    fn cell(&self) -> (f64, f64) {
        (
            f64::from(self.width - LEFT - RIGHT) / self.columns as f64,
            f64::from(self.height - TOP - BOTTOM) / self.rows as f64,
        )
    }

    /// Upper left corner of a cell, px; the first row is the lowest.
    fn corner(&self, row: usize, column: usize) -> (f64, f64) {
        let (width, height) = self.cell();
        let top = f64::from(TOP) + (self.rows as f64 - 1.0 - row as f64) * height;
        (f64::from(LEFT) + column as f64 * width, top)
    }
}

fn at((x, y): (f64, f64)) -> (i32, i32) {
    (units(x), units(y))
}

/// The map as an `svg` element that scrolls in its own box where a phone is too narrow for its text; a sentence where
/// there is nothing to draw.
pub(super) fn map(report: &SweepReport) -> Markup {
    let grid = Grid::of(report);
    let about = "Velocity ripple factor over table velocity and nut speed; triangles say where DDFS has less ripple \
                 than CDFS and where not";
    let picture = Scale::of(report).map(|scale| {
        svg(about, (grid.width, grid.height), |root| {
            cells(root, report, &grid, &scale)?;
            boundary(root, report, &grid)?;
            axes(root, report, &grid)?;
            bar(root, &grid, &scale)
        })
    });
    Markup::of(&Heat {
        picture,
        // Three quarters keep the text at about 10 px.
        least: if grid.width > WIDTH {
            grid.width * 3 / 4
        } else {
            0
        },
        most: grid.width * 3 / 2,
    })
}

#[derive(Template)]
#[template(path = "heat.html")]
struct Heat {
    picture: Option<Markup>,
    least: u32,
    most: u32,
}

fn cells(root: &Root, report: &SweepReport, grid: &Grid, scale: &Scale) -> Result<(), DrawError> {
    let (width, height) = grid.cell();
    let (roomy, tall) = (width >= f64::from(CELL) - 2.0, height >= 34.0);
    for row in 0..grid.rows {
        for column in 0..grid.columns {
            let (x, y) = grid.corner(row, column);
            let value = vrf(report, row, column);
            let fill = value.map_or(EMPTY, |v| color(scale.place(v)));
            let box_ = [
                at((x + 0.75, y + 0.75)),
                at((x + width - 0.75, y + height - 0.75)),
            ];
            root.draw(&Rectangle::new(box_, fill.filled()))?;
            let ink = if value.is_some() { on(fill) } else { MUTED };
            let middle = (x + 0.5 * width, y + 0.5 * height);
            let verdict = verdict(report, row, column);
            let two_lines = roomy && tall && verdict != Verdict::Open;
            let value_y = middle.1 - if two_lines { 7.0 } else { 0.0 };
            if roomy {
                let style = text(TEXT - 0.5, ink, HPos::Center, VPos::Center);
                let name = value.map_or_else(|| "\u{2013}".into(), figures);
                root.draw_text(&name, &style, at((middle.0, value_y)))?;
            }
            if two_lines || !roomy {
                triangle(
                    root,
                    verdict,
                    (middle.0, middle.1 + if two_lines { 9.0 } else { 0.0 }),
                    ink,
                )?;
            }
        }
    }
    Ok(())
}

/// Three figures at most: what a cell has room for.
fn figures(value: f64) -> String {
    match value {
        v if v < 9.995 => format!("{v:.2}"),
        v if v < 99.95 => format!("{v:.1}"),
        v => format!("{v:.0}"),
    }
}

/// Down: less ripple than CDFS, filled. Up: as much or more, hollow.
fn triangle(
    root: &Root,
    verdict: Verdict,
    (x, y): (f64, f64),
    ink: RGBColor,
) -> Result<(), DrawError> {
    match verdict {
        Verdict::Better => {
            let corners = [(x - 5.0, y - 4.0), (x + 5.0, y - 4.0), (x, y + 4.5)];
            root.draw(&Polygon::new(corners.map(at), ink.filled()))
        }
        Verdict::Worse => {
            let corners = [
                (x - 5.0, y + 4.0),
                (x, y - 4.5),
                (x + 5.0, y + 4.0),
                (x - 5.0, y + 4.0),
                (x, y - 4.5),
            ];
            root.draw(&PathElement::new(
                corners.map(at),
                ink.stroke_width(units(1.5).unsigned_abs()),
            ))
        }
        Verdict::Open => Ok(()),
    }
}

/// A line between the cells where DDFS is better and those where it is not.
fn boundary(root: &Root, report: &SweepReport, grid: &Grid) -> Result<(), DrawError> {
    let (width, height) = grid.cell();
    let differ = |a: Verdict, b: Verdict| a != b && a != Verdict::Open && b != Verdict::Open;
    let mut lines = Vec::new();
    for row in 0..grid.rows {
        for column in 0..grid.columns {
            let (x, y) = grid.corner(row, column);
            let here = verdict(report, row, column);
            if differ(here, verdict(report, row, column + 1)) {
                lines.push([(x + width, y), (x + width, y + height)]);
            }
            if row + 1 < grid.rows && differ(here, verdict(report, row + 1, column)) {
                lines.push([(x, y), (x + width, y)]);
            }
        }
    }
    for (color, px) in [(ON_DARK, 5.0), (ON_LIGHT, 2.5)] {
        for line in &lines {
            root.draw(&PathElement::new(
                line.map(at),
                color.stroke_width(units(px).unsigned_abs()),
            ))?;
        }
    }
    Ok(())
}

fn axes(root: &Root, report: &SweepReport, grid: &Grid) -> Result<(), DrawError> {
    let (width, height) = grid.cell();
    let (left, foot) = (f64::from(LEFT), f64::from(grid.height - BOTTOM));
    let label = |h, v| text(TEXT, MUTED, h, v);
    // Labels of four digits need 36 px; leave out what would overlap.
    let every = (36.0 / width).ceil().max(1.0) as usize;
    for (column, rpm) in report.nut_rpm.iter().enumerate().step_by(every) {
        let place = (grid.corner(0, column).0 + 0.5 * width, foot + 12.0);
        root.draw_text(&short(*rpm), &label(HPos::Center, VPos::Center), at(place))?;
    }
    let every = (16.0 / height).ceil().max(1.0) as usize;
    for (row, speed) in report.table_mm_s.iter().enumerate().step_by(every) {
        let place = (left - 6.0, grid.corner(row, 0).1 + 0.5 * height);
        root.draw_text(&short(*speed), &label(HPos::Right, VPos::Center), at(place))?;
    }
    let title = text(TEXT, INK, HPos::Center, VPos::Center);
    let middle = 0.5 * (left + f64::from(grid.width - RIGHT));
    root.draw_text(
        "Nut speed, rpm (0: CDFS)",
        &title,
        at((middle, foot + 32.0)),
    )?;
    let turned = title.transform(FontTransform::Rotate270);
    root.draw_text(
        "Table velocity, mm/s",
        &turned,
        at((9.0, 0.5 * (f64::from(TOP) + foot))),
    )
}

/// The colour scale, above the cells.
fn bar(root: &Root, grid: &Grid, scale: &Scale) -> Result<(), DrawError> {
    let (left, width) = (
        f64::from(LEFT) + 54.0,
        f64::from(grid.width - LEFT - RIGHT) - 70.0,
    );
    const STEPS: i32 = 60;
    for step in 0..STEPS {
        let part = |k: i32| left + width * f64::from(k) / f64::from(STEPS);
        let box_ = [
            at((part(step), 10.0)),
            at((part((step + 2).min(STEPS)), 24.0)),
        ];
        let fill = color((f64::from(step) + 0.5) / f64::from(STEPS));
        root.draw(&Rectangle::new(box_, fill.filled()))?;
    }
    let title = text(TEXT, INK, HPos::Left, VPos::Center);
    root.draw_text("VRF, %", &title, at((f64::from(LEFT), 17.0)))?;
    for tick in scale.ticks() {
        let x = left + width * scale.place(tick);
        let mark = [at((x, 24.0)), at((x, 28.0))];
        root.draw(&PathElement::new(mark, MUTED.stroke_width(SCALE)))?;
        let name = match tick < 9.995 {
            true => short(tick),
            false => figures(tick).trim_end_matches(".0").into(),
        };
        root.draw_text(
            &name,
            &text(TEXT, MUTED, HPos::Center, VPos::Center),
            at((x, 37.0)),
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_gets_lighter_all_the_way() {
        let light = |k: i32| {
            let RGBColor(r, g, b) = color(f64::from(k) / 40.0);
            0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
        };
        assert!(
            (0..40).all(|k| light(k + 1) > light(k)),
            "lightness must rise: {:?}",
            (0..=40).map(light).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_cell_takes_three_figures() {
        assert_eq!([9.994, 9.996, 99.96].map(figures), ["9.99", "10.0", "100"]);
    }
}
