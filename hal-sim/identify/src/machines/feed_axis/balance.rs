//! What the balance of an axis says, as a model of the axis: a balance needs no control law.

use super::axis::{Axis, Term};
use crate::machines::motor::{Base, Study};
use crate::predict::curve::Over;
use std::f64::consts::TAU;

impl Study {
    /// The declared axis with what its balance told, force over the angle of the screw: base values, orders, measured curves.
    pub(crate) fn refined(&self, declared: &Axis) -> Axis {
        let mut axis = declared.clone();
        let per_m = TAU / axis.lead_m;
        for (base, value) in self.base.iter().zip(&self.after.values) {
            match base {
                Base::Inertia => axis.base[0] = value * per_m,
                Base::Viscous => axis.base[1] = value * per_m,
                Base::Coulomb => axis.base[2] = *value,
                Base::Offset => axis.base[3] = *value,
            }
        }
        let waves = self.after.values[self.base.len()..].chunks_exact(2);
        axis.terms.extend(
            (self.orders.iter().zip(waves))
                .map(|(order, wave)| (Term::Periodic(f64::from(order.order)), wave.to_vec())),
        );
        axis.terms.extend(self.curves.iter().map(|curve| {
            let ends = [curve.at[0], curve.at[curve.at.len() - 1]];
            let (per, size) = match curve.over {
                Over::Turn | Over::Period => (1.0, 1.0),
                // Newton for each m/s.
                Over::TurnBySpeed => (1.0, per_m / curve.top_speed),
                _ => (per_m, 1.0),
            };
            let values = curve
                .values
                .iter()
                .map(|value| value * size)
                .collect::<Vec<_>>();
            let term = Term::Measured {
                over: curve.over,
                range: ends.map(|end| end / per),
                points: values.len(),
            };
            (term, values)
        }));
        axis
    }
}
