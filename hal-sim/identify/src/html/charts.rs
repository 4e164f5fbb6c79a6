//! Residuals over their coordinates, and their order spectra.

use super::words::prefix;
use crate::regression::column::counted;
use crate::report::{Channel, Coordinate};
use crate::signal::leftover::{Over, Residual};
use page::axis::{Axis, extent, widen};
use page::chart::{COOL, Chart, Label, Mark, Series, THIRD, WARM, chart};
use page::document::{figure, legend};
use page::markup::Markup;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins over a turn: several for each period of a high order.
const TURN_BINS: usize = 360;
/// Bins over another range.
const BINS: usize = 90;
/// Highest order of a spectrum's chart, or a little above the highest that was found.
const ORDERS: f64 = 66.0;
/// Lines of before and after: distinguished without colour too.
const BEFORE: Mark = Mark::Line(2.5);
const AFTER: Mark = Mark::Line(1.2);

/// The key of all charts here.
pub(super) fn key(found: bool) -> Markup {
    let mut entries = vec![
        (WARM, BEFORE, "declared model".to_owned()),
        (COOL, AFTER, "new model".to_owned()),
    ];
    if found {
        entries.push((
            THIRD,
            Mark::Ring,
            "order of an effect that was found".to_owned(),
        ));
    }
    legend(&entries)
}

/// Both residuals as series, the heavy one first.
fn series(points: [Vec<(f64, f64)>; 2]) -> Vec<Series> {
    let [before, after] = points;
    vec![
        Series {
            points: before,
            color: WARM,
            mark: BEFORE,
        },
        Series {
            points: after,
            color: COOL,
            mark: AFTER,
        },
    ]
}

fn scaled(points: Vec<(f64, f64)>, factor: f64) -> Vec<(f64, f64)> {
    points.into_iter().map(|(x, y)| (x, factor * y)).collect()
}

/// The order spectrum, found lines marked by their names.
pub(super) fn orders(channel: &Channel) -> Markup {
    figure(
        "Which orders of the turn it has",
        &[spectrum_chart(channel)],
    )
}

/// Its picture.
pub(super) fn spectrum_chart(channel: &Channel) -> Markup {
    let highest = channel.marks.iter().map(|mark| mark.0).fold(0.0, f64::max);
    let top = ORDERS.max(1.15 * highest);
    let lines = [0, 1].map(|k| {
        spectrum(
            &channel.turn.values,
            &channel.residual[k],
            &channel.open,
            top,
        )
    });
    let most = lines.iter().flatten().map(|p| p.1).fold(0.0, f64::max);
    let (factor, unit) = prefix(most, &channel.unit);
    let [before, after] = lines.map(|points| scaled(points, factor));
    let at = |order: f64| {
        let near = |p: &&(f64, f64)| (p.0 - order).abs() < 0.35;
        let line = before
            .iter()
            .filter(near)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        line.map_or((order, factor * most), |line| *line)
    };
    let mut marks: Vec<(f64, String)> = Vec::new();
    for (order, name) in &channel.marks {
        if marks.iter().all(|(known, _)| known != order) {
            marks.push((*order, format!("{} \u{D7} {name}", short(*order))));
        }
    }
    let ringed = marks.iter().map(|(order, _)| at(*order)).collect();
    let labels = marks
        .iter()
        .map(|(order, text)| Label {
            at: at(*order),
            text: text.clone(),
            color: THIRD,
        })
        .collect();
    let mut series = series([before.clone(), after]);
    series.push(rings(ringed));
    let title = format!("Amplitude, {unit}");
    let about = format!(
        "Amplitude of the {} residual over orders per turn",
        channel.name
    );
    chart(&Chart {
        about: &about,
        x: over_orders(top),
        y: Axis {
            title: &title,
            range: Some(0.0..1.18 * factor * most.max(1e-300)),
            log: false,
        },
        series,
        labels,
    })
}

/// Rings around found orders.
fn rings(points: Vec<(f64, f64)>) -> Series {
    Series {
        points,
        color: THIRD,
        mark: Mark::Ring,
    }
}

/// The axis of orders up to `top`.
fn over_orders(top: f64) -> Axis<'static> {
    Axis {
        title: "Order, per turn",
        range: Some(0.0..top),
        log: false,
    }
}

fn short(order: f64) -> String {
    let text = format!("{order:.2}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

/// Mean residual over a coordinate.
pub(super) fn over(channel: &Channel, coordinate: &Coordinate) -> Markup {
    let values: Vec<f64> = match coordinate.folded {
        true => coordinate
            .values
            .iter()
            .map(|a| (a / TAU).rem_euclid(1.0))
            .collect(),
        false => coordinate.values.clone(),
    };
    let open = || {
        values
            .iter()
            .zip(&channel.open)
            .filter(|(_, open)| **open)
            .map(|(x, _)| *x)
    };
    let range = match coordinate.folded {
        true => 0.0..1.0,
        false => extent(open()).unwrap_or(0.0..1.0),
    };
    let bins = if coordinate.folded { TURN_BINS } else { BINS };
    let points = [0, 1].map(|k| binned(&values, &channel.residual[k], &channel.open, &range, bins));
    let most = points
        .iter()
        .flatten()
        .map(|p| p.1.abs())
        .fold(0.0, f64::max);
    let (factor, unit) = prefix(most, &channel.unit);
    let points = points.map(|points| scaled(points, factor));
    let heights = extent(points.iter().flatten().map(|p| p.1)).map(|range| widen(&range, 0.08));
    let y = format!("Mean residual, {unit}");
    let about = format!("Mean {} residual over {}", channel.name, coordinate.title);
    let svg = chart(&Chart {
        about: &about,
        x: Axis {
            title: &coordinate.title,
            range: Some(widen(&range, 0.02)),
            log: false,
        },
        y: Axis {
            title: &y,
            range: heights,
            log: false,
        },
        series: series(points),
        labels: Vec::new(),
    });
    let name = coordinate.title.split(',').next().unwrap_or_default();
    let caption = match coordinate.folded {
        true => format!("Over a turn: {}", name.to_lowercase()),
        false => format!("Over {}", name.to_lowercase()),
    };
    figure(&caption, &[svg])
}

/// Speeds of a waterfall at most, and the share of the rows that one needs.
const SPEEDS: usize = 10;
const LEAST_OF_ROWS: f64 = 0.02;
/// Rows on either side by which a speed is taken.
const BESIDE: usize = 16;
/// Ratio of two speeds that are distinguished: four steps an octave.
const STEPS_OF_OCTAVE: f64 = 4.0;
/// Orders whose frequencies are written beside their rings.
const WRITTEN: usize = 2;

/// The speeds that a record dwells at, rad/s, and which rows are at each, slow to fast.
fn speeds(channel: &Channel, time: &[f64]) -> Vec<(f64, Vec<bool>)> {
    let angle = &channel.turn.values;
    let rows = angle.len().min(time.len());
    let speed = |row: usize| {
        let (from, to) = (row.saturating_sub(BESIDE), (row + BESIDE).min(rows - 1));
        (angle[to] - angle[from]).abs() / (time[to] - time[from]).max(1e-9)
    };
    let mut steps: std::collections::BTreeMap<i32, (f64, Vec<usize>)> = Default::default();
    for row in (0..rows).filter(|row| channel.open[*row]) {
        let speed = speed(row);
        // What all but rests has no orders.
        if speed > 0.1 {
            let step = (STEPS_OF_OCTAVE * speed.log2()).round() as i32;
            let entry = steps.entry(step).or_default();
            entry.0 += speed;
            entry.1.push(row);
        }
    }
    let least = LEAST_OF_ROWS * rows as f64;
    let mut dwelt: Vec<(f64, Vec<usize>)> = steps
        .into_values()
        .filter(|(_, at)| at.len() as f64 > least)
        .map(|(sum, at)| (sum / at.len() as f64, at))
        .collect();
    dwelt.sort_by_key(|(_, at)| std::cmp::Reverse(at.len()));
    dwelt.truncate(SPEEDS);
    dwelt.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mask = |at: Vec<usize>| {
        let mut mask = vec![false; angle.len()];
        at.into_iter().for_each(|row| mask[row] = true);
        mask
    };
    dwelt
        .into_iter()
        .map(|(speed, at)| (speed, mask(at)))
        .collect()
}

/// Orders over speed: a spectrum for each speed that the record dwells at, found orders ringed, with their frequency.
pub(super) fn waterfall(channel: &Channel, time: &[f64]) -> Markup {
    const RPM: f64 = 60.0 / TAU;
    let speeds = speeds(channel, time);
    let highest = channel.marks.iter().map(|mark| mark.0).fold(0.0, f64::max);
    let top = ORDERS.max(1.15 * highest);
    let lines: Vec<(f64, Vec<(f64, f64)>)> = speeds
        .into_iter()
        .map(|(speed, open)| {
            let line = spectrum(&channel.turn.values, &channel.residual[0], &open, top);
            (speed, line)
        })
        .collect();
    let most = lines
        .iter()
        .flat_map(|(_, line)| line)
        .map(|p| p.1)
        .fold(0.0, f64::max);
    let (Some((slowest, _)), Some((fastest, _))) = (lines.first(), lines.last()) else {
        return Markup::default();
    };
    // The tallest line reaches over three others.
    let tall = 3.0 * RPM * (fastest - slowest).max(0.2 * fastest) / lines.len() as f64;
    let raised = |speed: f64, amplitude: f64| RPM * speed + tall * amplitude / most.max(1e-300);
    let mut orders: Vec<f64> = channel.marks.iter().map(|(order, _)| *order).collect();
    orders.sort_by(f64::total_cmp);
    orders.dedup();
    let (mut ringed, mut labels, mut series) = (Vec::new(), Vec::new(), Vec::new());
    for (speed, line) in &lines {
        for (k, order) in orders.iter().enumerate() {
            let near = line.iter().filter(|p| (p.0 - order).abs() < 0.35);
            let Some(peak) = near.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                continue;
            };
            let at = (peak.0, raised(*speed, peak.1));
            ringed.push(at);
            if k < WRITTEN {
                labels.push(Label {
                    at,
                    text: format!("{:.0} Hz", order * speed / TAU),
                    color: THIRD,
                });
            }
        }
        series.push(Series {
            points: line.iter().map(|p| (p.0, raised(*speed, p.1))).collect(),
            color: WARM,
            mark: AFTER,
        });
    }
    series.push(rings(ringed));
    let (factor, unit) = prefix(most, &channel.unit);
    let title = format!("Speed, rpm; tallest line {:.3} {unit}", factor * most);
    let about = format!("Orders of the {} residual at each speed", channel.name);
    let svg = chart(&Chart {
        about: &about,
        x: over_orders(top),
        y: Axis {
            title: &title,
            range: None,
            log: false,
        },
        series,
        labels,
    });
    figure(
        "Orders at each speed (waterfall), before; found orders with the frequency that is heard",
        &[svg],
    )
}

/// All charts of a channel.
pub(super) fn section(channel: &Channel, time: &[f64]) -> Vec<Markup> {
    let over = std::iter::once(&channel.turn)
        .chain(&channel.over)
        .map(|coordinate| over(channel, coordinate));
    [orders(channel), waterfall(channel, time)]
        .into_iter()
        .chain(over)
        .collect()
}

/// Mean of a residual over bins of a coordinate.
fn binned(
    coordinate: &[f64],
    residual: &[f64],
    open: &[bool],
    range: &Range<f64>,
    bins: usize,
) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); bins];
    let width = (range.end - range.start) / bins as f64;
    for ((x, r), _) in coordinate
        .iter()
        .zip(residual)
        .zip(open)
        .filter(|(_, open)| **open)
    {
        let bin = ((x - range.start) / width) as usize;
        if let Some(sum) = sums.get_mut(bin) {
            sum.0 += r;
            sum.1 += 1.0;
        }
    }
    sums.iter()
        .enumerate()
        .filter(|(_, sum)| sum.1 > 3.0)
        .map(|(k, sum)| (range.start + (k as f64 + 0.5) * width, sum.0 / sum.1))
        .collect()
}

/// Amplitude of a residual over the orders of an angle; of neighbouring orders the greatest.
fn spectrum(angle: &[f64], residual: &[f64], open: &[bool], top: f64) -> Vec<(f64, f64)> {
    const POINTS: usize = 420;
    let values: Vec<f64> = residual
        .iter()
        .zip(open)
        .map(|(x, open)| if *open { *x } else { 0.0 })
        .collect();
    let residual = Residual {
        values: &values,
        open,
        // Only what passes from row to row counts here.
        rate: 1.0,
    };
    let spectrum = residual.orders(&Over::angle(angle, 0.0..top), 0.0..top);
    // What the order has of the whole record's power, as an amplitude: where only a few slow rows can show an order, it is
    // not to stand above one that all rows have.
    let rows = counted(open).max(1) as f64;
    let amplitudes: Vec<f64> = (spectrum.fall.iter())
        .map(|fall| (2.0 * fall / rows).sqrt())
        .collect();
    let group = (amplitudes.len() / POINTS).max(1);
    amplitudes
        .chunks(group)
        .enumerate()
        .map(|(k, chunk)| {
            let (at, most) =
                chunk.iter().enumerate().fold(
                    (0, 0.0),
                    |a, (j, &size)| if size > a.1 { (j, size) } else { a },
                );
            ((k * group + at) as f64 * spectrum.spacing, most)
        })
        .collect()
}
