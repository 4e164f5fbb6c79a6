//! Records of a run: `.csv` or `.csv.gz`, one row for each sample.
//!
//! Columns, in this order: `t_s`, for screw and then nut `_angle_rad`, `_ia_a`, `_ib_a`, `_ud_v`, `_uq_v`, `_iq_ref_a`,
//! `_speed_ref_rad_s`, and `table_position_m`. [`Sample`] says what they mean.

mod columns;
mod digits;
mod error;
mod reader;
mod writer;

pub use columns::COLUMNS;
pub use error::RecordingError;
pub use reader::RecordingReader;
pub use writer::RecordingWriter;

use crate::Axis;
use std::path::Path;

/// What is recorded of one motor at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisSample {
    /// Mechanical angle as the encoder reads it, rad, many turns.
    pub angle_rad: f64,
    /// Measured current of phase a, A.
    pub ia_a: f64,
    /// Measured current of phase b, A.
    pub ib_a: f64,
    /// d voltage commanded for the control period that ends now, V.
    pub ud_v: f64,
    /// q voltage commanded for the control period that ends now, V.
    pub uq_v: f64,
    /// Output of the speed loop, A.
    pub iq_ref_a: f64,
    /// Speed reference, mechanical, rad/s.
    pub speed_ref_rad_s: f64,
}

/// One row.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time_s: f64,
    /// Screw and nut, by [`Axis::index`].
    pub axes: [AxisSample; 2],
    /// Position of the table's linear scale, m.
    pub table_position_m: f64,
}

/// The columns of one motor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AxisRecord {
    /// See [`AxisSample::angle_rad`].
    pub angle_rad: Vec<f64>,
    /// See [`AxisSample::ia_a`].
    pub ia_a: Vec<f64>,
    /// See [`AxisSample::ib_a`].
    pub ib_a: Vec<f64>,
    /// See [`AxisSample::ud_v`].
    pub ud_v: Vec<f64>,
    /// See [`AxisSample::uq_v`].
    pub uq_v: Vec<f64>,
    /// See [`AxisSample::iq_ref_a`].
    pub iq_ref_a: Vec<f64>,
    /// See [`AxisSample::speed_ref_rad_s`].
    pub speed_ref_rad_s: Vec<f64>,
}

/// A whole record, by columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recording {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Screw and nut, by [`Axis::index`].
    pub axes: [AxisRecord; 2],
    /// Position of the table's linear scale, m.
    pub table_position_m: Vec<f64>,
}

impl Recording {
    /// Reads a whole `.csv` or `.csv.gz`.
    ///
    /// # Errors
    /// As [`RecordingReader`], and a file without rows.
    pub fn load(path: &Path) -> Result<Self, RecordingError> {
        let mut recording = Recording::default();
        for sample in RecordingReader::open(path)? {
            recording.push(&sample?);
        }
        if recording.is_empty() {
            return Err(RecordingError::Empty {
                origin: path.display().to_string(),
            });
        }
        Ok(recording)
    }

    /// Writes all of it as `.csv`, compressed if the name ends in `.gz`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), RecordingError> {
        let mut writer = RecordingWriter::create(path)?;
        self.samples()
            .try_for_each(|sample| writer.write(&sample))?;
        writer.finish()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether it has no rows.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The columns of one motor.
    pub fn axis(&self, axis: Axis) -> &AxisRecord {
        &self.axes[axis.index()]
    }

    /// Appends a row.
    pub fn push(&mut self, sample: &Sample) {
        self.time_s.push(sample.time_s);
        for (record, sample) in self.axes.iter_mut().zip(&sample.axes) {
            record.angle_rad.push(sample.angle_rad);
            record.ia_a.push(sample.ia_a);
            record.ib_a.push(sample.ib_a);
            record.ud_v.push(sample.ud_v);
            record.uq_v.push(sample.uq_v);
            record.iq_ref_a.push(sample.iq_ref_a);
            record.speed_ref_rad_s.push(sample.speed_ref_rad_s);
        }
        self.table_position_m.push(sample.table_position_m);
    }

    /// The rows.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        (0..self.len()).map(|row| Sample {
            time_s: self.time_s[row],
            axes: [0, 1].map(|k: usize| {
                let record = &self.axes[k];
                AxisSample {
                    angle_rad: record.angle_rad[row],
                    ia_a: record.ia_a[row],
                    ib_a: record.ib_a[row],
                    ud_v: record.ud_v[row],
                    uq_v: record.uq_v[row],
                    iq_ref_a: record.iq_ref_a[row],
                    speed_ref_rad_s: record.speed_ref_rad_s[row],
                }
            }),
            table_position_m: self.table_position_m[row],
        })
    }
}
