//! The columns of a telemetry row as the page plots them.

use link::host::{MotorRow, Row};
use link::telemetry::Header;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Columns of a row.
pub const COLUMNS: usize = 21;
/// Time that the table's velocity is a mean over, s: the scale's noise hides what is faster.
const WINDOW_S: f64 = 1e-3;
const RPM: f64 = 60.0 / TAU;

/// Name, label and unit of each motor's columns.
const MOTOR: [(&str, &str, &str); 8] = [
    ("speed", "speed", "rpm"),
    ("speed_reference", "speed reference", "rpm"),
    ("torque_current", "torque current reference", "A"),
    ("phase_a", "phase a current", "A"),
    ("phase_b", "phase b current", "A"),
    ("voltage_d", "d voltage", "V"),
    ("voltage_q", "q voltage", "V"),
    ("angle", "encoder angle", "turns"),
];
/// The same of the table.
const TABLE: [(&str, &str, &str); 4] = [
    ("table_position", "position", "mm"),
    ("table_velocity", "velocity", "mm/s"),
    ("table_velocity_reference", "velocity reference", "mm/s"),
    ("table_velocity_error", "velocity error", "mm/s"),
];

/// The list of columns as JSON: name, label, unit, group.
#[must_use]
pub fn list() -> Value {
    let time = ("time".to_owned(), "time", "s", "time");
    let motors = ["screw", "nut"].into_iter().flat_map(|motor| {
        MOTOR.map(|(name, label, unit)| (format!("{motor}_{name}"), label, unit, motor))
    });
    let table = TABLE.map(|(name, label, unit)| (name.to_owned(), label, unit, "table"));
    std::iter::once(time)
        .chain(motors)
        .chain(table)
        .map(|(name, label, unit, group)| {
            json!({ "name": name, "label": label, "unit": unit, "group": group })
        })
        .collect()
}

/// Makes columns of rows; velocities need the rows before.
#[derive(Debug, Default)]
pub struct Columns {
    /// Time and table position of the rows within [`WINDOW_S`], and of one before.
    table: VecDeque<(f64, f64)>,
    /// Time and encoder angles, rad, of the last row.
    angles: Option<(f64, [f64; 2])>,
}

impl Columns {
    /// Appends a row's columns to `rows`. A row after a gap follows a row of NaN, so that a plot shows the gap.
    pub fn append(&mut self, header: &Header, interval_s: f64, row: &Row, rows: &mut Vec<f64>) {
        if row.lost > 0 {
            rows.push(row.time_s - interval_s);
            rows.extend([f64::NAN; COLUMNS - 1]);
            *self = Self::default();
        }
        let angles = [0, 1].map(|k| row.motors[k].angle_rad);
        let speeds = self.angles.map_or([f64::NAN; 2], |(time_s, before)| {
            [0, 1].map(|k| (angles[k] - before[k]) / (row.time_s - time_s))
        });
        self.angles = Some((row.time_s, angles));
        rows.push(row.time_s);
        for (motor, speed) in row.motors.iter().zip(speeds) {
            rows.extend(motor_columns(motor, speed));
        }
        let lead_m = header.lead_m.get();
        let [screw, nut] = &row.motors;
        let asked = lead_m * (screw.speed_ref_rad_s - nut.speed_ref_rad_s) / TAU;
        let velocity = self.velocity(row, interval_s);
        rows.extend([row.table_m, velocity, asked, asked - velocity].map(|metres| 1e3 * metres));
    }

    /// Velocity of the table, m/s, over [`WINDOW_S`] or the last interval.
    fn velocity(&mut self, row: &Row, interval_s: f64) -> f64 {
        self.table.push_back((row.time_s, row.table_m));
        let span = WINDOW_S.max(interval_s) - 0.5 * interval_s;
        while self
            .table
            .get(1)
            .is_some_and(|(time_s, _)| row.time_s - time_s > span)
        {
            self.table.pop_front();
        }
        match self.table.front() {
            Some((time_s, table_m)) if *time_s < row.time_s => {
                (row.table_m - table_m) / (row.time_s - time_s)
            }
            _ => f64::NAN,
        }
    }
}

fn motor_columns(motor: &MotorRow, speed_rad_s: f64) -> [f64; 8] {
    [
        speed_rad_s * RPM,
        motor.speed_ref_rad_s * RPM,
        motor.i_q_ref_a,
        motor.phases_a[0],
        motor.phases_a[1],
        motor.voltage_v[0],
        motor.voltage_v[1],
        motor.angle_rad / TAU,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_names_each_column_once() {
        let list = list();
        let names: Vec<&str> = list
            .as_array()
            .unwrap()
            .iter()
            .map(|one| one["name"].as_str().unwrap())
            .collect();
        assert_eq!(names.len(), COLUMNS);
        let mut unique = names.clone();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!(unique.len(), COLUMNS);
    }
}
