//! The settled parts of a recording's holds, and the signals in which orders are looked for.

use super::coordinate::{Coordinate, Shows, mean_speeds};
use super::lines::Search;
use super::mean;
use anyhow::{Result, ensure};
use control::compensation::{ANGLES, TORQUES, TRAVELS};
use hal_sim::hold_ripple::{Hold, SETTLE_S, SHORTEST_S, holds, ripple_interval_s};
use plant::Axis;
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;

/// The highest orders that are looked for.
const TORQUE_ORDER_MAX: f64 = 150.0;
/// Discs and magnets err a few times a turn. Faster, an elastic screw shows the motors' torque.
const ENCODER_ORDER_MAX: f64 = 12.0;
const LEAD_ORDER_MAX: f64 = 30.0;
/// Coordinate of the ball pair in a torque's search.
pub(super) const PAIR: usize = 1;
/// Holds that can be searched, as `record` takes them. The table comes back.
const HOLDS: &str = "--hold 5,150,4 --hold=-5,300,4 --hold 5,700,4";
/// Steps of time that are no loss of rows, of the mean step.
const STEPS: std::ops::RangeInclusive<f64> = 0.5..=1.5;
/// Smallest part of the largest load by which loads must differ.
const LOADS_DIFFER: f64 = 0.3;

/// The holds of a recording without their beginnings.
pub(super) struct Settled<'a> {
    recording: &'a Recording,
    model: &'a Model,
    interval_s: f64,
    holds: Vec<Hold>,
    /// Over each hold, rad: of the screw, of the nut, and of the screw less the nut.
    angles: [Vec<Vec<f64>>; 3],
}

impl<'a> Settled<'a> {
    pub(super) fn of(recording: &'a Recording, model: &'a Model) -> Result<Self> {
        let interval_s = ripple_interval_s(recording)?;
        whole(&recording.time_s, interval_s)?;
        let skip = (SETTLE_S / interval_s) as usize;
        let holds: Vec<Hold> = holds(recording, model.feed.travel_per_radian())
            .into_iter()
            .filter(|hold| hold.rows > 2 * skip)
            .map(|hold| Hold {
                first: hold.first + skip,
                rows: hold.rows - skip,
                ..hold
            })
            .collect();
        let [screw, nut] = Axis::ALL.map(|axis| &recording.axis(axis).angle_rad);
        let angles = [
            over(&holds, |k| screw[k]),
            over(&holds, |k| nut[k]),
            over(&holds, |k| screw[k] - nut[k]),
        ];
        Ok(Self {
            recording,
            model,
            interval_s,
            holds,
            angles,
        })
    }

    /// Refuses holds that cannot distinguish screw, nut and lead: angles of two holds must differ in their proportion by a turn.
    pub(super) fn distinguish(&self) -> Result<()> {
        ensure!(
            self.holds.len() > 1,
            "Holds of a table speed in the recording that last for {SHORTEST_S} s: {}. A search compares at least two: `{HOLDS}` records three",
            self.holds.len()
        );
        let [screw, nut] = [0, 1].map(|k| turns(&self.angles[k]));
        let most = screw.iter().chain(&nut).map(|turns| turns.abs());
        let most = most.fold(f64::MIN_POSITIVE, f64::max);
        let apart = (0..screw.len())
            .any(|i| (0..i).any(|j| (screw[i] * nut[j] - screw[j] * nut[i]).abs() > most));
        ensure!(
            apart,
            "The turns of screw and nut are in one proportion in all holds of the recording, within a turn, so that their orders cannot be told \
             apart: hold several nut speeds, and a table speed at which screw and nut part by more than a turn, for example `{HOLDS}`"
        );
        Ok(())
    }

    fn coordinate(&self, k: usize, shows: Shows, room: (usize, f64)) -> Coordinate {
        // A speed lies between two rows, and so does a current that was summed up to a row.
        let sensing = &self.model.sensing;
        let [screw, nut] = Axis::ALL.map(|axis| sensing.counts_per_turn(axis));
        let counts = [screw, nut, screw.min(nut)][k];
        let angles = between_rows(&self.angles[k]);
        Coordinate::new(angles, self.interval_s, shows, room, counts)
    }

    /// For what repeats with a motor's turn, in its momentum.
    pub(super) fn torque_search(&self, axis: Axis) -> Search {
        let own = axis.index();
        let currents = over(&self.holds, |k| {
            q_current(self.recording, self.model, axis, k)
        });
        let motor = self.model.motor(axis);
        let per_speed = motor.inertia_kg_m2 / (f64::from(motor.pole_pairs) * motor.flux_wb);
        let interval_s = self.interval_s;
        let momentum = |(angle, current): (&Vec<f64>, &Vec<f64>)| {
            let mut sum = 0.0;
            let steps = angle.windows(2).zip(current.windows(2));
            let values = steps.map(|(angle, current)| {
                let half = 0.5 * interval_s * current[0];
                sum += half;
                let value = per_speed * (angle[1] - angle[0]) / interval_s - sum;
                sum += interval_s * current[0] - half;
                value
            });
            straightened(values.collect())
        };
        Search {
            signals: self.angles[own]
                .iter()
                .zip(&currents)
                .map(momentum)
                .collect(),
            // What comes from the other motor and from the ball pair must not be taken for its own.
            coordinates: vec![
                self.coordinate(own, Shows::Momentum, (TORQUES, TORQUE_ORDER_MAX)),
                self.coordinate(2, Shows::Momentum, (TRAVELS, LEAD_ORDER_MAX)),
                self.coordinate(1 - own, Shows::Momentum, (TORQUES, TORQUE_ORDER_MAX)),
            ],
            interval_s,
            loads: self.loads(&currents),
            per_speed,
            table: mean_speeds(&self.angles[2], interval_s),
        }
    }

    /// The loads, if they differ enough to tell what scales with them. Friction and what dead time loses change with the direction too: loads
    /// are compared between holds of one direction.
    fn loads(&self, currents: &[Vec<f64>]) -> Option<Vec<f64>> {
        let differ = [1.0, -1.0].into_iter().any(|way| {
            let holds = self.holds.iter().zip(currents);
            let same = holds.filter(|(hold, _)| hold.point.velocity * way > 0.0);
            let same: Vec<&[f64]> = same.map(|(_, current)| current.as_slice()).collect();
            differing(&same)
        });
        differ.then(|| currents.iter().map(|current| mean(current)).collect())
    }

    /// For errors of both encoders and of the lead, in the encoders' speed less the scale's.
    pub(super) fn scale_search(&self) -> Search {
        let travel = self.model.feed.travel_per_radian();
        let table = over(&self.holds, |k| self.recording.table_position_m[k] / travel);
        let interval_s = self.interval_s;
        let against_scale = |(turned, table): (&Vec<f64>, &Vec<f64>)| {
            let steps = turned.windows(2).zip(table.windows(2));
            let speed = |(turned, table): (&[f64], &[f64])| {
                (turned[1] - turned[0] - table[1] + table[0]) / interval_s
            };
            straightened(steps.map(speed).collect())
        };
        Search {
            signals: self.angles[2]
                .iter()
                .zip(&table)
                .map(against_scale)
                .collect(),
            coordinates: vec![
                self.coordinate(0, Shows::Speed(1.0), (ANGLES, ENCODER_ORDER_MAX)),
                self.coordinate(1, Shows::Speed(-1.0), (ANGLES, ENCODER_ORDER_MAX)),
                self.coordinate(2, Shows::Speed(1.0), (TRAVELS, LEAD_ORDER_MAX)),
            ],
            interval_s,
            loads: None,
            per_speed: 1.0,
            table: mean_speeds(&self.angles[2], interval_s),
        }
    }
}

/// Refuses a recording that has lost or repeated rows: angles and currents are summed over them.
fn whole(time_s: &[f64], interval_s: f64) -> Result<()> {
    for (row, pair) in time_s.windows(2).enumerate() {
        let step = pair[1] - pair[0];
        ensure!(
            STEPS.contains(&(step / interval_s)),
            "After row {} the time steps by {step:.6} s, expected {interval_s:.6} s: rows are lost or repeated. Record again, or search the \
             part before or after it",
            row + 1
        );
    }
    Ok(())
}

/// Turns over each hold.
fn turns(angles: &[Vec<f64>]) -> Vec<f64> {
    let of = |angle: &Vec<f64>| (angle[angle.len() - 1] - angle[0]) / TAU;
    angles.iter().map(of).collect()
}

/// A quantity of each row, over each hold.
fn over(holds: &[Hold], of: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
    let of_hold = |hold: &Hold| (hold.first..hold.first + hold.rows).map(&of).collect();
    holds.iter().map(of_hold).collect()
}

/// That loads differ by more than their currents ripple.
fn differing(currents: &[&[f64]]) -> bool {
    let loads: Vec<f64> = currents.iter().map(|current| mean(current)).collect();
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::MIN, f64::max);
    let most = largest(&mut loads.iter().map(|load| load.abs()));
    let difference =
        largest(&mut loads.iter().copied()) + largest(&mut loads.iter().map(|load| -load));
    let variance = |(current, load): (&&[f64], &f64)| {
        let squares = current.iter().map(|value| (value - load).powi(2));
        squares.sum::<f64>() / current.len() as f64
    };
    let ripple = largest(&mut currents.iter().zip(&loads).map(variance)).sqrt();
    difference > (LOADS_DIFFER * most).max(ripple)
}

/// The measured q current of a row, A: power-invariant, of two phases whose third is minus their sum.
fn q_current(recording: &Recording, model: &Model, axis: Axis, row: usize) -> f64 {
    let record = recording.axis(axis);
    let theta_e = f64::from(model.motor(axis).pole_pairs) * record.angle_rad[row];
    let (a, b) = (record.ia_a[row], record.ib_a[row]);
    let (alpha, beta) = (1.5_f64.sqrt() * a, (a + 2.0 * b) * 0.5_f64.sqrt());
    beta * theta_e.cos() - alpha * theta_e.sin()
}

/// Angles between two rows each.
fn between_rows(angles: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let middle = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
    let of = |angle: &Vec<f64>| angle.windows(2).map(middle).collect();
    angles.iter().map(of).collect()
}

/// Without its best-fit line.
fn straightened(values: Vec<f64>) -> Vec<f64> {
    let middle = (values.len() as f64 - 1.0) / 2.0;
    let mean = mean(&values);
    let (mut moment, mut squares) = (0.0, 0.0);
    for (k, value) in values.iter().enumerate() {
        let at = k as f64 - middle;
        moment += at * value;
        squares += at * at;
    }
    let slope = moment / squares.max(1.0);
    let of = |(k, value): (usize, f64)| value - mean - slope * (k as f64 - middle);
    values.into_iter().enumerate().map(of).collect()
}
