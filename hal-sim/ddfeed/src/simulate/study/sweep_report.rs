//! What a sweep found, as `sweep.json` holds it.

use super::learned::LEARNING_S;
use crate::simulate::proposal::{Choice, proposed};
use control::plate::{BASES, BasePlate, BasePoint};
use hal_sim::experiment::RPM;
use serde::Serialize;

/// Ripple over a grid of table and nut speeds.
#[derive(Debug, Serialize)]
pub struct SweepReport {
    /// `paper` (lumped), `coupled`, or the model file's path.
    pub machine: String,
    /// `ideal`, `real` or `declared`.
    pub sensors: String,
    /// Rows of the grid: table velocities, mm/s.
    pub table_mm_s: Vec<f64>,
    /// Columns of the grid: nut speeds, rpm; the first is 0, CDFS.
    pub nut_rpm: Vec<f64>,
    /// Velocity ripple factor, %: a row for each table velocity, a value for each nut speed; none where the drive did
    /// not reach the point.
    pub vrf_percent: Vec<Vec<Option<f64>>>,
    /// Copper and friction loss of the same runs, W.
    pub loss_w: Vec<Vec<Option<f64>>>,
    /// The compensating drive learned at each point. Otherwise it compensates what the model says.
    pub learned: bool,
    /// The same of a drive that compensates, if that was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compensated_percent: Option<Vec<Vec<Option<f64>>>>,
    /// The nut speed that [`RULE`](crate::simulate::proposal::RULE) proposes for each table velocity, compensated if that was asked. The
    /// loss is always that without compensation.
    pub proposed: Vec<Proposed>,
}

/// A base speed that is proposed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proposed {
    /// Table velocity, mm/s.
    pub table_mm_s: f64,
    /// What is proposed for it.
    #[serde(flatten)]
    pub choice: Choice,
}

impl SweepReport {
    /// The grid of the compensated drive as a report of its own, if there is one.
    #[must_use]
    pub fn compensated(&self) -> Option<Self> {
        Some(Self {
            machine: self.machine.clone(),
            sensors: self.sensors.clone(),
            table_mm_s: self.table_mm_s.clone(),
            nut_rpm: self.nut_rpm.clone(),
            vrf_percent: self.compensated_percent.clone()?,
            loss_w: self.loss_w.clone(),
            learned: self.learned,
            compensated_percent: None,
            proposed: Vec::new(),
        })
    }

    /// Title of the compensated grid.
    #[must_use]
    pub fn compensated_title(&self) -> String {
        if self.learned {
            format!("The same after {LEARNING_S} s of learning at each point")
        } else {
            "The same where the drive compensates the orders of the model".to_owned()
        }
    }

    /// What is proposed as the drive's table of base speeds, and how many of the proposals found no room in it: neighbours of one
    /// nut speed share a point.
    #[must_use]
    pub fn base_table(&self) -> (BasePlate, usize) {
        let mut proposed = self.proposed.clone();
        proposed.sort_by(|a, b| a.table_mm_s.total_cmp(&b.table_mm_s));
        let mut points: Vec<BasePoint> = Vec::new();
        for Proposed { table_mm_s, choice } in proposed {
            let point = BasePoint {
                velocity: table_mm_s * 1e-3,
                base: choice.nut_rpm * RPM,
            };
            match points.last_mut() {
                Some(last) if last.base == point.base => *last = point,
                _ => points.push(point),
            }
        }
        let mut plate = BasePlate::NONE;
        for (room, point) in plate.table.iter_mut().zip(&points) {
            *room = *point;
        }
        (plate, points.len().saturating_sub(BASES))
    }

    /// Fills in what is proposed.
    #[must_use]
    pub fn with_proposals(mut self) -> Self {
        let grid = self
            .compensated_percent
            .as_ref()
            .unwrap_or(&self.vrf_percent);
        let rows = self.table_mm_s.iter().zip(grid).enumerate();
        self.proposed = rows
            .filter_map(|(row, (&table_mm_s, ripples))| {
                let losses = self.loss_w.get(row);
                let choices = self.nut_rpm.iter().zip(ripples).enumerate();
                let choices = choices.filter_map(|(column, (&nut_rpm, vrf_percent))| {
                    Some(Choice {
                        nut_rpm,
                        vrf_percent: (*vrf_percent)?,
                        loss_w: losses.and_then(|losses| *losses.get(column)?),
                    })
                });
                let choice = proposed(choices)?;
                Some(Proposed { table_mm_s, choice })
            })
            .collect();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_choice_of_each_row_is_proposed() {
        let report = SweepReport {
            machine: String::new(),
            sensors: String::new(),
            table_mm_s: vec![1.0, 2.5, 5.0],
            nut_rpm: vec![0.0, 300.0, 800.0],
            learned: false,
            vrf_percent: vec![vec![Some(1.0); 3]; 3],
            loss_w: vec![vec![Some(3.0), Some(5.0), None]; 3],
            compensated_percent: Some(vec![
                vec![Some(0.5), Some(0.4), None],
                vec![Some(0.105), Some(0.1), Some(0.3)],
                vec![None; 3],
            ]),
            proposed: Vec::new(),
        };
        let at = |table_mm_s, nut_rpm, vrf_percent, loss_w| Proposed {
            table_mm_s,
            choice: Choice {
                nut_rpm,
                vrf_percent,
                loss_w: Some(loss_w),
            },
        };
        let report = report.with_proposals();
        // At 2.5 mm/s the single drive is as smooth within 10 %, and cooler.
        let expected = [at(1.0, 300.0, 0.4, 5.0), at(2.5, 0.0, 0.105, 3.0)];
        assert_eq!(report.proposed, expected);
        let (plate, left_out) = report.base_table();
        assert_eq!(left_out, 0);
        assert_eq!(plate.base_for(0.9e-3), 300.0 * RPM);
        assert_eq!(plate.base_for(2.5e-3), 0.0);
        let many = SweepReport {
            proposed: (1..=10u8)
                .map(|k| at(f64::from(k), 100.0 * f64::from(k / 2), 1.0, 1.0))
                .collect(),
            ..report
        };
        // 1, 2 and 3, ... 10: six nut speeds.
        let (plate, left_out) = many.base_table();
        assert_eq!(left_out, 0);
        assert_eq!(
            plate.table.map(|point| (point.velocity * 1e6).round())[..7],
            [1e3, 3e3, 5e3, 7e3, 9e3, 10e3, 0.0]
        );
    }
}
