//! What is compared, made white: rows that count, operating points, columns of a regression.

use crate::balance::Contribution;
use crate::machines::Machine;
use crate::regression::column::{Column, counted};
use crate::signal::channel::Channel;
use crate::signal::fourier::Fourier;
use crate::signal::noise::Noise;
use crate::signal::signals::{STICKING_RAD_S, Signals};
use std::ops::Range;
use std::rc::Rc;

/// Time around sticking, and at the ends of a record, over which filters carry what is not modelled, s.
const MARGIN_S: f64 = 0.03;
/// Shortest constant reference that counts as an operating point, s.
const PLATEAU_S: f64 = 0.3;

/// Turns contributions into columns: whitening, masking, operating points.
pub struct Whitener<'a> {
    /// What kind of machine the record is of.
    pub machine: &'static dyn Machine,
    fourier: &'a Fourier,
    gains: [Vec<f64>; Channel::COUNT],
    masks: [Vec<bool>; Channel::COUNT],
    /// Decimated rows of each operating point.
    pub folds: Rc<[Range<usize>]>,
}

/// Rows of each operating point: a stretch of constant references and the ramp that follows it.
pub fn operating_points(signals: &Signals) -> Vec<Range<usize>> {
    let rows = signals.len();
    let same = |k: usize| {
        signals
            .references
            .iter()
            .all(|r| (r[k] - r[k - 1]).abs() <= 1e-6 * (1.0 + r[k].abs()))
    };
    let least = (PLATEAU_S * signals.rate) as usize;
    let mut starts = Vec::new();
    let mut start = 0;
    for k in 1..=rows {
        if k == rows || !same(k) {
            if k - start >= least {
                starts.push(start);
            }
            start = k;
        }
    }
    if starts.len() < 2 {
        // No plateaus: eight equal stretches.
        starts = (0..8).map(|k| k * rows / 8).collect();
    }
    starts[0] = 0;
    let ends = starts[1..].iter().copied().chain([rows]);
    starts
        .iter()
        .copied()
        .zip(ends)
        .map(|(a, b)| a..b)
        .collect()
}

impl<'a> Whitener<'a> {
    /// For one record.
    pub fn new(signals: &Signals, fourier: &'a Fourier, noise: &Noise) -> Self {
        let step = fourier.step();
        let rows = fourier.decimated_rows();
        let margin = (MARGIN_S * signals.rate / step as f64).ceil() as usize;
        let mask = |speeds: &[&[f64]]| -> Vec<bool> {
            let mut open = vec![true; rows];
            let mut close = |at: usize| {
                open[at.saturating_sub(margin)..(at + margin).min(rows)]
                    .iter_mut()
                    .for_each(|x| *x = false);
            };
            close(0);
            close(rows - 1);
            for speed in speeds {
                // A fast reversal has no row that rests.
                let is_passed =
                    |k: usize| speed[k * step] * speed[k.saturating_sub(1) * step] < 0.0;
                (0..rows)
                    .filter(|&k| speed[k * step].abs() < STICKING_RAD_S || is_passed(k))
                    .for_each(&mut close);
            }
            open
        };
        let machine = signals.machine;
        let relative = &signals.relative_speed[..];
        let masks = Channel::ALL.map(|channel| match channel {
            _ if !machine.channels().contains(&channel) => vec![false; rows],
            Channel::Torque(axis) => mask(&[&signals.motors[axis.index()].omega, relative]),
            Channel::VoltageD(_) | Channel::VoltageQ(_) => mask(&[]),
            Channel::Table => mask(&[relative]),
        });
        let folds = operating_points(signals)
            .into_iter()
            .map(|r| r.start.div_ceil(step)..r.end.div_ceil(step))
            .collect();
        Whitener {
            machine,
            fourier,
            gains: Channel::ALL.map(|c| noise.whitening(c, fourier)),
            masks,
            folds,
        }
    }

    /// Whether a decimated row of a channel counts.
    pub fn mask(&self, channel: Channel) -> &[bool] {
        &self.masks[channel.index()]
    }

    /// Decimated rows of a channel that count.
    pub fn rows(&self, channel: Channel) -> usize {
        counted(self.mask(channel))
    }

    /// The whitening gain of a channel over the bins of a spectrum.
    pub fn gain(&self, channel: Channel) -> &[f64] {
        &self.gains[channel.index()]
    }

    /// A contribution as a column.
    pub fn column(&self, contribution: &Contribution) -> Column {
        let mut parts: [Option<Vec<f64>>; Channel::COUNT] = Default::default();
        for (channel, spectrum) in &contribution.0 {
            let index = channel.index();
            if !self.machine.channels().contains(channel) {
                continue;
            }
            let mut signal = self.fourier.filtered(spectrum, &self.gains[index]);
            signal
                .iter_mut()
                .zip(&self.masks[index])
                .filter(|(_, open)| !**open)
                .for_each(|(x, _)| *x = 0.0);
            parts[index] = Some(signal);
        }
        Column { parts }
    }

    /// Rows of all channels that count.
    pub fn used_rows(&self) -> usize {
        self.masks.iter().map(|mask| counted(mask)).sum()
    }
}
