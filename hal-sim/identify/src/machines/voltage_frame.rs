//! The angle at which voltages were applied, where a log gives them in the frame of another moment.
//!
//! A log of phase voltages has no frame. Turned by the angle of its row, voltages of the control period that ends there are off by what
//! the rotor turns in half of that period: `u_d` has a part `omega_e age u_q`. The d equation of the plate shows the age.

use crate::signal::frames::{clarke, park};
use nalgebra::{Matrix2, Vector2};
use plant::model::MotorModel;
use plant::recording::AxisRecord;

/// Length of the means that are compared, s: noise of single rows is gone, and speeds change little.
const BLOCK_S: f64 = 5e-3;
/// Greatest age that is looked for, control periods: a period of computing, one of output, and half of one in the mean.
const MOST_PERIODS: f64 = 2.5;
/// Minimum age that is worth a turn, control periods: the regression allows for [less](crate::effects::parameter).
const LEAST_PERIODS: f64 = 0.25;
/// Standard deviations that an age must be away from none.
const SIGMAS: f64 = 5.0;
/// Turns of the voltages, each of which leaves the square of the angle that it had wrong.
const STEPS: usize = 3;

/// Means over a block of rows: electrical speed, voltages and currents.
struct Block {
    speed: f64,
    d: f64,
    q: f64,
    /// What the plate says that `u_d` is, V.
    plate_d: f64,
}

/// Age of a record's voltages against the angles of its rows, s. `None` if it is none, or the record does not tell.
pub(crate) fn age_s(
    motor: &MotorModel,
    [rate, control_hz]: [f64; 2],
    record: &AxisRecord,
) -> Option<f64> {
    let blocks = blocks(motor, rate, record);
    let mut age = 0.0;
    let mut sigma = f64::INFINITY;
    for _ in 0..STEPS {
        let (step, error) = step(&blocks, age)?;
        (age, sigma) = (age + step, error);
    }
    let periods = age * control_hz;
    let told = age.abs() > SIGMAS * sigma;
    (told && (LEAST_PERIODS..=MOST_PERIODS).contains(&periods.abs())).then_some(age)
}

/// Turns a record's voltages to the frame of `age` seconds before.
pub(crate) fn turn(pole_pairs: f64, rate: f64, age: f64, record: &mut AxisRecord) {
    let angle = &record.angle_rad;
    let last = angle.len().saturating_sub(1);
    let turned = |row: usize| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(last));
        let rows = (after - before).max(1) as f64;
        let speed = pole_pairs * (angle[after] - angle[before]) * rate / rows;
        rotated(speed * age, record.ud_v[row], record.uq_v[row])
    };
    (record.ud_v, record.uq_v) = (0..angle.len()).map(turned).unzip();
}

fn rotated(angle: f64, d: f64, q: f64) -> (f64, f64) {
    let (sin, cos) = (-angle).sin_cos();
    park((d, q), (cos, sin))
}

fn blocks(motor: &MotorModel, rate: f64, record: &AxisRecord) -> Vec<Block> {
    let pole_pairs = f64::from(motor.pole_pairs);
    let rows = ((BLOCK_S * rate).round() as usize).max(4);
    let angle = &record.angle_rad;
    let starts = (0..angle.len().saturating_sub(rows)).step_by(rows);
    let block = |from: usize| {
        let within = from..from + rows;
        let mean = |values: &[f64]| values[within.clone()].iter().sum::<f64>() / rows as f64;
        let speed = pole_pairs * (angle[from + rows] - angle[from]) * rate / rows as f64;
        let currents = within.clone().map(|row| {
            let (sin, cos) = (pole_pairs * angle[row]).sin_cos();
            park(clarke(record.ia_a[row], record.ib_a[row]), (cos, sin))
        });
        let (d, q) = currents.fold((0.0, 0.0), |sum, i| (sum.0 + i.0, sum.1 + i.1));
        let (d, q) = (d / rows as f64, q / rows as f64);
        Block {
            speed,
            d: mean(&record.ud_v),
            q: mean(&record.uq_v),
            plate_d: motor.resistance_ohm * d - motor.inductance_h * speed * q,
        }
    };
    starts.map(block).collect()
}

/// What is to be added to an age, and its standard deviation, s. An angle by which all voltages are turned, as a wrong zero of the
/// encoder turns them, is beside it.
fn step(blocks: &[Block], age: f64) -> Option<(f64, f64)> {
    let (mut gram, mut right, mut squares) = (Matrix2::zeros(), Vector2::zeros(), 0.0);
    for block in blocks {
        let (d, q) = rotated(block.speed * age, block.d, block.q);
        let row = Vector2::new(block.speed * q, q);
        let left = d - block.plate_d;
        gram += row * row.transpose();
        right += row * left;
        squares += left * left;
    }
    let inverse = gram.try_inverse()?;
    let values = inverse * right;
    let freedom = blocks.len().checked_sub(2).filter(|n| *n > 0)? as f64;
    let variance = (squares - right.dot(&values)).max(0.0) / freedom;
    let sigma = (variance * inverse[(0, 0)]).sqrt();
    (values[0].is_finite() && sigma.is_finite()).then_some((values[0], sigma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machines::pmsm::phases;
    use plant::model::Model;

    /// A motor on currents of 0.1 and 2 A at several speeds, by its equation; its voltages are read `age` late, and its encoder is off by
    /// `offset` electrical radians.
    fn record(motor: &MotorModel, rate: f64, age: f64, offset: f64) -> AxisRecord {
        let mut record = AxisRecord::default();
        let p = f64::from(motor.pole_pairs);
        let mut angle = 0.0;
        for row in 0..40_000_u32 {
            let speed = [30.0, -80.0, 120.0, -20.0][row as usize / 10_000];
            angle += speed / rate;
            let (d, q) = (0.1, 2.0_f64.copysign(speed));
            let electrical = p * speed;
            let u_d = motor.resistance_ohm * d - electrical * motor.inductance_h * q;
            let u_q =
                motor.resistance_ohm * q + electrical * (motor.inductance_h * d + motor.flux_wb);
            let (u_d, u_q) = rotated(-electrical * age - offset, u_d, u_q);
            let [a, b] = phases(&[d], &[q], |_| p * angle);
            record.ia_a.extend(a);
            record.ib_a.extend(b);
            record.angle_rad.push(angle);
            record.ud_v.push(u_d);
            record.uq_v.push(u_q);
        }
        record
    }

    #[test]
    fn an_age_is_found_and_taken_away_and_a_wrong_zero_of_the_encoder_is_none() {
        let (motor, rate, control) = (Model::paper().screw, 5000.0, 10_000.0);
        for age in [-5e-5, 5e-5, 1.5e-4] {
            let mut record = record(&motor, rate, age, 0.01);
            let found = age_s(&motor, [rate, control], &record).expect("an age");
            assert!((found - age).abs() < 2e-6, "{found}, expected {age}");
            turn(f64::from(motor.pole_pairs), rate, found, &mut record);
            assert_eq!(age_s(&motor, [rate, control], &record), None);
        }
        let record = record(&motor, rate, 0.0, 0.017);
        assert_eq!(age_s(&motor, [rate, control], &record), None);
        let (a, b) = (record.ia_a[100], record.ib_a[100]);
        let (sin, cos) = (f64::from(motor.pole_pairs) * record.angle_rad[100]).sin_cos();
        let (d, q) = park(clarke(a, b), (cos, sin));
        assert!((d - 0.1).abs() < 1e-9 && (q - 2.0).abs() < 1e-9, "{d}, {q}");
    }
}
