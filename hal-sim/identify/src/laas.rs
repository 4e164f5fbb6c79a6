//! A bare motor that cogs: a slow map of it, and a speed loop whose current the map should explain.

use crate::emps::butterworth_100;
use crate::fourier::slope;
use nalgebra::{DMatrix, DVector};
use std::path::{Path, PathBuf};

/// Rate of the speed test, Hz.
const RATE: f64 = 1000.0;
/// Pole pairs of the motor.
const POLE_PAIRS: u32 = 12;
/// Rows at the start in which the speed is not yet reached, and at the end of the stretch.
const MARGIN: usize = 300;
/// Highest order of the map.
const HIGHEST: u32 = 220;

/// Why the measured data could not be used.
#[derive(Debug, thiserror::Error)]
pub enum LaasError {
    /// The file could not be read.
    #[error("{}: cannot read: {source}; put the measured data there", path.display())]
    Read {
        /// The path that was tried.
        path: PathBuf,
        /// The reader's reason.
        source: csv::Error,
    },
    /// A column is missing or no number.
    #[error("{}, row {row}: column `{column}`: read `{text}`, expected a number", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Row below the header, from 1.
        row: usize,
        /// The column.
        column: String,
        /// What was there.
        text: String,
    },
    /// The speed test has no stretch without compensation.
    #[error("{}: no stretch without compensation of at least 2 s; expected one half of the test", path.display())]
    Stretch {
        /// The file.
        path: PathBuf,
    },
}

/// An order of the map.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// Periods per mechanical turn.
    pub order: u32,
    /// Amplitude in the slow map, A.
    pub amplitude_a: f64,
}

impl Order {
    /// What an order of this motor suggests.
    pub fn suggests(&self) -> &'static str {
        match (
            self.order.is_multiple_of(POLE_PAIRS),
            self.order / POLE_PAIRS,
        ) {
            (true, 1) => "1 per electrical turn: offset of a current sensor",
            (true, 2) => {
                "2 per electrical turn: gain mismatch of the current sensors, or cogging of the 24 poles"
            }
            (true, 6 | 12 | 18) => {
                "a multiple of 6 per electrical turn: flux harmonics and cogging of the winding"
            }
            (true, _) => "whole per electrical turn: flux or saturation",
            _ if self.order.is_multiple_of(18) => "no whole multiple of the pole pairs: the slots",
            _ => "no whole multiple of the pole pairs: slots or mechanics",
        }
    }
}

/// What the map explains of the speed test.
#[derive(Debug)]
pub struct Study {
    /// Orders above the map's noise, the greatest first.
    pub orders: Vec<Order>,
    /// Current error on the half that was not fitted, of its rms, %: inertia and friction only.
    pub before_percent: f64,
    /// The same with the map's orders.
    pub after_percent: f64,
}

fn table(path: &Path, columns: &[&str]) -> Result<Vec<Vec<f64>>, LaasError> {
    let read = |source| LaasError::Read {
        path: path.to_owned(),
        source,
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(read)?;
    let header = reader.headers().map_err(read)?.clone();
    let mut values = vec![Vec::new(); columns.len()];
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(read)?;
        for (column, values) in columns.iter().zip(&mut values) {
            let text = header
                .iter()
                .position(|name| name == *column)
                .and_then(|at| record.get(at))
                .unwrap_or("");
            values.push(text.parse().map_err(|_| LaasError::Value {
                path: path.to_owned(),
                row: row + 1,
                column: (*column).to_owned(),
                text: text.to_owned(),
            })?);
        }
    }
    Ok(values)
}

/// Orders of the slow map whose amplitude stands out of its spectrum; friction, which changes sign with the direction,
/// drops out of the mean of both ways.
fn map_orders(position: &[f64], current: &[f64]) -> Vec<Order> {
    let turn = position
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .map_or(0, |(k, _)| k);
    let ways = [0..turn, turn..position.len()];
    let line = |order: u32| {
        let (c, s) = ways.iter().fold((0.0, 0.0), |(c, s), way| {
            let n = way.len().max(1) as f64;
            let mean = current[way.clone()].iter().sum::<f64>() / n;
            way.clone().fold((c, s), |(c, s), k| {
                let (sin, cos) = (f64::from(order) * position[k]).sin_cos();
                (
                    c + (current[k] - mean) * cos / n,
                    s + (current[k] - mean) * sin / n,
                )
            })
        });
        Order {
            order,
            amplitude_a: f64::hypot(c, s),
        }
    };
    let mut lines: Vec<Order> = (1..=HIGHEST).map(line).collect();
    lines.sort_by(|a, b| b.amplitude_a.total_cmp(&a.amplitude_a));
    let median = lines[lines.len() / 2].amplitude_a;
    lines.retain(|line| line.amplitude_a > 6.0 * median);
    lines
}

/// Rows without compensation: the rough half.
fn uncompensated(flag: &[f64], velocity: &[f64]) -> Option<std::ops::Range<usize>> {
    let change = (1..flag.len()).find(|&k| flag[k] != flag[k - 1])?;
    let roughness = |rows: std::ops::Range<usize>| {
        let n = rows.len().max(1) as f64;
        let mean = velocity[rows.clone()].iter().sum::<f64>() / n;
        velocity[rows]
            .iter()
            .map(|v| (v - mean).powi(2))
            .sum::<f64>()
            / n
    };
    let halves = [0..change, change..flag.len()];
    halves
        .into_iter()
        .max_by(|a, b| roughness(a.clone()).total_cmp(&roughness(b.clone())))
        .filter(|rows| rows.len() > 2000)
}

/// On an even grid of the test's rate: its clock jitters.
fn even(time: &[f64], values: &[f64]) -> Vec<f64> {
    let rows = ((time[time.len() - 1] - time[0]) * RATE) as usize;
    let mut at = 0;
    (0..rows)
        .map(|k| {
            let t = time[0] + k as f64 / RATE;
            while at + 2 < time.len() && time[at + 1] < t {
                at += 1;
            }
            let span = (time[at + 1] - time[at]).max(1e-9);
            let share = ((t - time[at]) / span).clamp(0.0, 1.0);
            values[at] + share * (values[at + 1] - values[at])
        })
        .collect()
}

impl Study {
    /// Of the two files in `folder`.
    ///
    /// # Errors
    /// A file that cannot be read, or holds no stretch without compensation.
    pub fn new(folder: &Path) -> Result<Self, LaasError> {
        let map = table(&folder.join("stopped_data.txt"), &["Position", "Iq"])?;
        let path = folder.join("speed_test.txt");
        let test = table(
            &path,
            &["Time", "Position", "Velocity", "Iq", "Function Activated"],
        )?;
        let rows = uncompensated(&test[4], &test[2]).ok_or(LaasError::Stretch { path })?;
        let time = &test[0][rows.clone()];
        let position = butterworth_100(&even(time, &test[1][rows.clone()]));
        let current = butterworth_100(&even(time, &test[3][rows]));
        let orders = map_orders(&map[0], &map[1]);
        let numbers: Vec<u32> = orders.iter().map(|order| order.order).collect();
        Ok(Study {
            before_percent: held_out(&position, &current, &[]),
            after_percent: held_out(&position, &current, &numbers),
            orders,
        })
    }
}

/// Fits the current on the first half of a stretch and gives its error on the second, of its rms, %.
fn held_out(position: &[f64], current: &[f64], orders: &[u32]) -> f64 {
    let velocity = slope(position, RATE);
    let acceleration = slope(&velocity, RATE);
    let jerk = slope(&acceleration, RATE);
    let mut columns: Vec<Vec<f64>> = vec![
        acceleration,
        velocity.clone(),
        velocity.iter().map(|v| v * v.abs()).collect(),
        butterworth_100(
            &velocity
                .iter()
                .map(|v| (v / 0.3).tanh())
                .collect::<Vec<_>>(),
        ),
        vec![1.0; position.len()],
    ];
    if !orders.is_empty() {
        columns.push(jerk);
    }
    for &order in orders {
        for quarter in [0.0, std::f64::consts::FRAC_PI_2] {
            let wave: Vec<f64> = position
                .iter()
                .map(|p| (f64::from(order) * p - quarter).cos())
                .collect();
            columns.push(butterworth_100(&wave));
        }
    }
    let middle = position.len() / 2;
    let matrix = |rows: std::ops::Range<usize>| {
        DMatrix::from_fn(rows.len(), columns.len(), |r, c| columns[c][rows.start + r])
    };
    let vector = |rows: std::ops::Range<usize>| DVector::from_column_slice(&current[rows]);
    let (fit, test) = (MARGIN..middle, middle..position.len() - 100);
    // Columns of very different size: their own norms make the normal equations even.
    let design = matrix(fit.clone());
    let norms: Vec<f64> = design.column_iter().map(|c| c.norm().max(1e-12)).collect();
    let scaled = DMatrix::from_fn(design.nrows(), design.ncols(), |r, c| {
        design[(r, c)] / norms[c]
    });
    let solution = scaled.svd(true, true).solve(&vector(fit), 1e-10);
    let Ok(mut values) = solution else {
        return f64::NAN;
    };
    values
        .iter_mut()
        .zip(&norms)
        .for_each(|(value, norm)| *value /= norm);
    let measured = vector(test.clone());
    100.0 * (&measured - matrix(test) * values).norm() / measured.norm()
}
