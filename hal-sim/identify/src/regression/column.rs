//! A quantity in the channels of a machine, as a column of a regression.

use crate::signal::channel::Channel;

/// A whitened quantity: its samples in each channel that it reaches.
#[derive(Clone, Default)]
pub struct Column {
    /// By [`Channel::index`].
    pub parts: [Option<Vec<f64>>; Channel::COUNT],
}

impl Column {
    /// Of a machine with one channel.
    pub(crate) fn alone(values: Vec<f64>) -> Self {
        let mut alone = Column::default();
        alone.parts[0] = Some(values);
        alone
    }

    /// Of a machine with one channel, its samples.
    pub(crate) fn only(&self) -> &[f64] {
        self.parts[0].as_deref().unwrap_or_default()
    }

    /// With `values` times `columns` added.
    pub(crate) fn plus<'a>(
        mut self,
        columns: impl IntoIterator<Item = &'a Column>,
        values: &[f64],
    ) -> Column {
        for (column, value) in columns.into_iter().zip(values) {
            for (sum, part) in self.parts.iter_mut().zip(&column.parts) {
                match (sum, part) {
                    (Some(sum), Some(part)) => {
                        sum.iter_mut().zip(part).for_each(|(s, p)| *s += value * p);
                    }
                    (sum @ None, Some(part)) => {
                        *sum = Some(part.iter().map(|p| value * p).collect());
                    }
                    (_, None) => {}
                }
            }
        }
        self
    }

    /// Sum of squares over all channels.
    pub(crate) fn power(&self) -> f64 {
        let parts = self.parts.iter().flatten();
        parts.map(|part| dot(part, part)).sum()
    }

    /// What of it `values` times `columns` leave.
    pub(crate) fn less<'a>(
        &self,
        columns: impl IntoIterator<Item = &'a Column>,
        values: impl IntoIterator<Item = f64>,
    ) -> Column {
        let values: Vec<f64> = values.into_iter().map(|value| -value).collect();
        self.clone().plus(columns, &values)
    }
}

/// Sum of products, in eight strands that a compiler can put side by side.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            strands[k] += x[k] * y[k];
        }
    }
    strands.iter().sum::<f64>() + tail
}

/// How many rows of a mask count.
pub fn counted(mask: &[bool]) -> usize {
    mask.iter().filter(|open| **open).count()
}
