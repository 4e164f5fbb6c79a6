//! Names, order and precision of the columns.

use super::{AxisSample, Sample};

/// Names of the columns, in their order in a file.
pub const COLUMNS: [&str; 16] = [
    "t_s",
    "screw_angle_rad",
    "screw_ia_a",
    "screw_ib_a",
    "screw_ud_v",
    "screw_uq_v",
    "screw_iq_ref_a",
    "screw_speed_ref_rad_s",
    "nut_angle_rad",
    "nut_ia_a",
    "nut_ib_a",
    "nut_ud_v",
    "nut_uq_v",
    "nut_iq_ref_a",
    "nut_speed_ref_rad_s",
    "table_position_m",
];

/// Digits behind the point: 0.1 ms, 1 urad, 0.1 mA, 1 mV, 1 nm.
pub(super) const DECIMALS: [usize; 16] = [4, 6, 4, 4, 3, 3, 4, 4, 6, 4, 4, 3, 3, 4, 4, 9];

/// A row in the order of [`COLUMNS`].
pub(super) fn to_row(sample: &Sample) -> [f64; 16] {
    let mut row = [0.0; 16];
    row[0] = sample.time_s;
    for (k, axis) in sample.axes.iter().enumerate() {
        row[1 + 7 * k..8 + 7 * k].copy_from_slice(&[
            axis.angle_rad,
            axis.ia_a,
            axis.ib_a,
            axis.ud_v,
            axis.uq_v,
            axis.iq_ref_a,
            axis.speed_ref_rad_s,
        ]);
    }
    row[15] = sample.table_position_m;
    row
}

impl Sample {
    /// The value of a column, by its place among [`COLUMNS`].
    pub fn column(&self, column: usize) -> f64 {
        to_row(self)[column]
    }
}

/// The inverse of [`to_row`].
pub(super) fn from_row(row: &[f64; 16]) -> Sample {
    let axis = |first: usize| AxisSample {
        angle_rad: row[first],
        ia_a: row[first + 1],
        ib_a: row[first + 2],
        ud_v: row[first + 3],
        uq_v: row[first + 4],
        iq_ref_a: row[first + 5],
        speed_ref_rad_s: row[first + 6],
    };
    Sample {
        time_s: row[0],
        axes: [axis(1), axis(8)],
        table_position_m: row[15],
    }
}
