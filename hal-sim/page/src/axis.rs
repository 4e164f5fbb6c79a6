//! Axes: what they span, where their ticks lie and what stands there.

use plotters::coord::ranged1d::{BoldPoints, DefaultFormatting, KeyPointHint, Ranged};
use plotters::coord::types::RangedCoordf64;
use std::ops::Range;

/// One axis.
#[derive(Clone)]
pub struct Axis<'a> {
    /// Quantity and unit.
    pub title: &'a str,
    /// Minimum and maximum value; the axis shows a little more.
    pub range: Option<Range<f64>>,
    /// Logarithmic.
    pub log: bool,
}

impl Axis<'_> {
    /// Where a value lies: itself, or its logarithm.
    pub fn map(&self, value: f64) -> f64 {
        if self.log { value.log10() } else { value }
    }

    /// What the axis spans in mapped values: the given range, else that of `values`.
    pub fn span(&self, values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
        let (low, high) = match &self.range {
            Some(range) => (self.map(range.start), self.map(range.end)),
            None => {
                let Range { start, end } = extent(values)?;
                let pad = 0.05 * (end - start);
                (start - pad, end + pad)
            }
        };
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let least = 1e-6_f64.max(1e-6 * low.abs());
        Some(if high - low > least {
            low..high
        } else {
            low - 0.5..low + 0.5
        })
    }

    /// Where the grid lines lie, in mapped values.
    fn ticks(&self, span: &Range<f64>) -> Vec<f64> {
        if !self.log {
            return RangedCoordf64::from(span.clone()).key_points(BoldPoints(7));
        }
        let narrow = span.end - span.start < 2.0;
        let steps: &[f64] = if narrow { &[1.0, 2.0, 5.0] } else { &[1.0] };
        ((span.start.floor() as i32)..=(span.end.ceil() as i32))
            .flat_map(|decade| {
                steps
                    .iter()
                    .map(move |step| f64::from(decade) + step.log10())
            })
            .filter(|tick| span.contains(tick) || *tick == span.end)
            .collect()
    }

    /// What stands at a tick.
    pub fn tick_text(&self, mapped: f64) -> String {
        let value = if self.log { 10f64.powf(mapped) } else { mapped };
        // So few decimals drop what a sum of steps left over, as in 0.30000000000000004.
        // As many as show the first digit of a small one.
        let least = if value == 0.0 {
            0
        } else {
            (1.0 - value.abs().log10().floor()) as usize
        };
        let text = format!("{:.*}", if self.log { least.max(6) } else { 9 }, value);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        if text == "-0" {
            "0".into()
        } else {
            text.replace('-', "\u{2212}")
        }
    }

    /// The axis over `span` of mapped values, for the chart.
    pub fn ticked(&self, span: Range<f64>) -> Ticked {
        Ticked {
            ticks: self.ticks(&span),
            span: span.into(),
        }
    }
}

/// A span with its ticks, both in mapped values.
pub struct Ticked {
    span: RangedCoordf64,
    ticks: Vec<f64>,
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.span.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match hint.weight().allow_light_points() {
            true => Vec::new(),
            false => self.ticks.clone(),
        }
    }

    fn range(&self) -> Range<f64> {
        self.span.range()
    }
}

/// Minimum and maximum of what is finite in `values`.
pub fn extent(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    values
        .filter(|v| v.is_finite())
        .fold(None, |range, v| match range {
            None => Some(v..v),
            Some(Range { start, end }) => Some(v.min(start)..v.max(end)),
        })
}

/// `range` with a `part` of it added at both ends.
pub fn widen(range: &Range<f64>, part: f64) -> Range<f64> {
    let pad = part * (range.end - range.start);
    range.start - pad..range.end + pad
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_ticks_are_decades() {
        let axis = Axis {
            title: "",
            range: None,
            log: true,
        };
        assert_eq!(axis.ticks(&(0.5..3.0)), [1.0, 2.0, 3.0]);
        assert_eq!(axis.tick_text(-2.0), "0.01");
        assert_eq!(axis.tick_text(3.0), "1000");
        assert_eq!(axis.tick_text(-8.0), "0.00000001");
    }
}
