//! One file's record.

use super::{DataQuality, Machine};
use plant::recording::Recording;
use std::collections::BTreeMap;
use std::ops::Range;

/// Where a channel comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The file has it.
    Measured,
    /// It is made of others; [`DataQuality::notes`] says how.
    Derived,
}

/// Values of one name.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its name, SI unit last.
    pub name: &'static str,
    /// One a row.
    pub values: Vec<f64>,
    /// Where they come from.
    pub origin: Origin,
}

/// One file in SI units, even in time within a segment.
#[derive(Debug, Clone)]
pub struct Record {
    /// What was recorded.
    pub machine: Machine,
    /// Rows a second.
    pub rate: f64,
    /// Time of each row, s; it jumps between segments.
    pub time: Vec<f64>,
    /// Those that the file has, and what was derived.
    pub channels: Vec<Channel>,
    /// Stretches without a gap, in order; all rows are in one.
    pub segments: Vec<Range<usize>>,
    /// Of each row whether it was measured; where not, it bridges a short gap.
    pub measured: Vec<bool>,
    /// Numbers beside the channels.
    pub constants: BTreeMap<&'static str, f64>,
    /// What became of the file's rows.
    pub quality: DataQuality,
}

impl Record {
    /// Of a double drive's recording that is even in time.
    pub fn of_double_drive(recording: &Recording, rate: f64, file: &str) -> Self {
        let rows = recording.len();
        let motors = recording.axes.iter().flat_map(|axis| {
            [
                &axis.angle_rad,
                &axis.ia_a,
                &axis.ib_a,
                &axis.ud_v,
                &axis.uq_v,
                &axis.iq_ref_a,
                &axis.speed_ref_rad_s,
            ]
        });
        Record {
            machine: Machine::DoubleDrive,
            rate,
            time: recording.time_s.clone(),
            channels: plant::recording::COLUMNS[1..]
                .iter()
                .zip(motors.chain([&recording.table_position_m]))
                .map(|(name, values)| Channel {
                    name,
                    values: values.clone(),
                    origin: Origin::Measured,
                })
                .collect(),
            segments: std::iter::once(0..rows).collect(),
            measured: vec![true; rows],
            constants: BTreeMap::new(),
            quality: DataQuality {
                file: file.to_owned(),
                rows,
                used: rows,
                segments: 1,
                ..DataQuality::default()
            },
        }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// A channel, if it is there.
    pub fn get(&self, name: &str) -> Option<&[f64]> {
        self.channels
            .iter()
            .find(|channel| channel.name == name)
            .map(|channel| channel.values.as_slice())
    }

    /// A channel; no rows if it is not there.
    pub fn channel(&self, name: &str) -> &[f64] {
        self.get(name).unwrap_or_default()
    }

    /// Takes a channel out; no rows if it is not there.
    pub fn take(&mut self, name: &str) -> Vec<f64> {
        self.channels
            .iter_mut()
            .find(|channel| channel.name == name)
            .map(|channel| std::mem::take(&mut channel.values))
            .unwrap_or_default()
    }

    /// A number beside the channels.
    pub fn constant(&self, name: &str) -> Option<f64> {
        self.constants.get(name).copied()
    }

    /// The rows from `rows.start` up to `rows.end`.
    pub fn part(&self, rows: Range<usize>) -> Self {
        let rows = rows.start.min(self.len())..rows.end.min(self.len());
        let segments: Vec<_> = self
            .segments
            .iter()
            .map(|s| s.start.max(rows.start)..s.end.min(rows.end))
            .filter(|s| s.start < s.end)
            .map(|s| s.start - rows.start..s.end - rows.start)
            .collect();
        Record {
            machine: self.machine,
            rate: self.rate,
            time: self.time[rows.clone()].to_vec(),
            channels: self
                .channels
                .iter()
                .map(|channel| Channel {
                    values: channel.values[rows.clone()].to_vec(),
                    ..*channel
                })
                .collect(),
            measured: self.measured[rows.clone()].to_vec(),
            constants: self.constants.clone(),
            quality: DataQuality {
                used: rows.len(),
                segments: segments.len(),
                ..self.quality.clone()
            },
            segments,
        }
    }

    /// Its segments, each a record without a gap.
    pub fn pieces(self) -> Vec<Self> {
        if self.segments.len() < 2 {
            return vec![self];
        }
        self.segments
            .iter()
            .map(|rows| self.part(rows.clone()))
            .collect()
    }

    /// Its longest segment; what of it is not used is counted.
    pub fn longest(self) -> Self {
        if self.segments.len() < 2 {
            return self;
        }
        let longest = self.segments.iter().max_by_key(|rows| rows.len()).cloned();
        let mut part = self.part(longest.unwrap_or(0..0));
        part.quality.cut += self.len() - part.len();
        part
    }
}
