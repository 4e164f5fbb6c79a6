//! What a shape without a name adds to the residuals.

use crate::balance::{Balance, Contribution};
use crate::effects::family::Unnamed;
use crate::signal::along::Along;
use crate::signal::channel::Channel;
use crate::signal::signals::SMOOTH_HZ;
use plant::effects::Place;
use std::f64::consts::TAU;

/// Knots of a curve.
const KNOTS: usize = 13;

impl Unnamed {
    /// Linear parameters: cosine and sine of what repeats, the values at its knots of a curve.
    pub fn columns(self) -> usize {
        if self.along.repeats() { 2 } else { KNOTS }
    }

    /// What each parameter adds to the residual per unit; `order` is that of what repeats.
    pub fn contributions(self, balance: &Balance, order: f64) -> Vec<Contribution> {
        let at = |row: usize| balance.signals.along(self.along, row);
        let fastest = match self.along {
            Along::Angle(axis) => balance.signals.motors[axis.index()].top_speed,
            Along::RelativeAngle => balance.signals.motors.iter().map(|s| s.top_speed).sum(),
            _ => TAU,
        };
        let one = |value: &dyn Fn(f64) -> f64| {
            let mut sum = Contribution::default();
            let hz = SMOOTH_HZ.max(order * fastest / TAU);
            let factor = |row: usize| balance.signals.factor(self.along, row);
            let shape = |row: usize| factor(row) * value(at(row));
            if self.is_force {
                return balance.guideway(shape);
            }
            sum.add(self.channel, 1.0, &balance.spectrum_of(hz, shape));
            sum
        };
        if self.along.repeats() {
            return vec![
                one(&|angle| (order * angle).cos()),
                one(&|angle| (order * angle).sin()),
            ];
        }
        let [low, high] = self.extent.map(f64::from_bits);
        let spacing = (high - low) / (KNOTS - 1) as f64;
        (0..KNOTS)
            .map(|knot| {
                let middle = low + spacing * knot as f64;
                // Straight lines between knots; nothing beyond the range of the fit record.
                one(&|value| (1.0 - ((value - middle) / spacing).abs()).max(0.0))
            })
            .collect()
    }

    pub(crate) fn place(self) -> Place {
        match self.channel {
            Channel::Torque(axis) | Channel::VoltageD(axis) | Channel::VoltageQ(axis) => {
                axis.into()
            }
            Channel::Table => Place::Feed,
        }
    }
}
