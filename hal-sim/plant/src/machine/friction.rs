//! One step of the three velocities under given impulses, the axial coupling and Coulomb friction.
//!
//! Friction is an impulse of the step, at most `level * dt`, that can stop the relative velocity but not reverse it. In
//! sliding that is the exact impulse; at rest it is whatever holds. The axial coupling is linear in the new velocities
//! and solved with them.

use super::pair::{Pair, each};
use std::ops::{Add, Mul};

/// Velocities of screw (rad/s), nut (rad/s) and table (m/s).
pub(super) type Velocities = [f64; 3];

/// The four places with friction, as weights of the velocities.
const SURFACES: [Velocities; 4] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, -1.0, 0.0],
];

/// The velocities at which they slide: `SURFACES` times `velocities`, without its zeros.
#[inline]
pub(super) fn rubbing(velocities: &Velocities) -> [f64; 4] {
    let [screw, nut, table] = *velocities;
    [screw, nut, table, screw - nut]
}

#[inline]
fn dot(a: &Velocities, b: &Velocities) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Response of an inertia with viscous friction, which takes the mean of the velocities before and after, to a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Kick<T> {
    /// The residual of the velocity.
    keep: T,
    /// Change of the velocity per impulse.
    pub(super) mobility: T,
}

impl Kick<f64> {
    pub(super) fn new(inertia: f64, viscous: f64, dt: f64) -> Self {
        let loss = 0.5 * dt * viscous;
        Kick {
            keep: (inertia - loss) / (inertia + loss),
            mobility: 1.0 / (inertia + loss),
        }
    }
}

impl Kick<Pair> {
    pub(super) fn side_by_side(of: [Kick<f64>; 2]) -> Self {
        Kick {
            keep: each(|k| of[k].keep),
            mobility: each(|k| of[k].mobility),
        }
    }
}

impl<T: Copy + Add<Output = T> + Mul<Output = T>> Kick<T> {
    /// Velocity after the step.
    #[inline]
    pub(super) fn apply(&self, velocity: T, impulse: T) -> T {
        self.keep * velocity + self.mobility * impulse
    }
}

/// Impulse of the axial spring and damper, `offset + slope * speed after the step`, which acts against the `speed`, that
/// of the stretch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axial {
    /// Travel per relative angle, m/rad.
    pub(super) ratio: f64,
    pub(super) offset: f64,
    pub(super) slope: f64,
}

impl Axial {
    /// Speed at which the spring is stretched, m/s.
    #[inline]
    pub(super) fn speed(ratio: f64, [screw, nut, table]: Velocities) -> f64 {
        ratio * (screw - nut) - table
    }

    /// The speed as weights of the velocities.
    #[inline]
    fn weights(&self) -> Velocities {
        [self.ratio, -self.ratio, -1.0]
    }
}

/// One step: velocities before it, velocities after it without friction and axial coupling, response to an impulse.
pub(super) struct Step {
    pub(super) before: Velocities,
    pub(super) free: Velocities,
    /// Change of each velocity per impulse on it.
    pub(super) mobility: Velocities,
    /// Largest friction impulse of screw bearing, nut bearing, guideway, pair; 0 or above.
    pub(super) limit: [f64; 4],
    /// None if there is no coupling, or a gap in it.
    pub(super) axial: Option<Axial>,
}

impl Step {
    /// The velocities after the step. `impulses` holds the friction of the last step as a first guess, and is updated.
    #[inline]
    pub(super) fn solve(&self, impulses: &mut [f64; 4]) -> Velocities {
        if self.limit.into_iter().sum::<f64>() == 0.0 {
            return self.with_axial(self.free);
        }
        // Everything slides on in its direction: one pass, no search.
        let before = rubbing(&self.before);
        let sliding = [0, 1, 2, 3].map(|k: usize| {
            if before[k] == 0.0 {
                0.0
            } else {
                self.limit[k].copysign(-before[k])
            }
        });
        let after = self.with_axial(self.moved(&sliding));
        let speeds = rubbing(&after);
        let slides = |k: usize| self.limit[k] == 0.0 || speeds[k] * sliding[k] < 0.0;
        if slides(0) && slides(1) && slides(2) && slides(3) {
            *impulses = sliding;
            return after;
        }
        self.search(impulses)
    }

    fn moved(&self, impulses: &[f64; 4]) -> Velocities {
        let [screw, nut, table, pair] = *impulses;
        [
            self.free[0] + self.mobility[0] * (screw + pair),
            self.free[1] + self.mobility[1] * (nut - pair),
            self.free[2] + self.mobility[2] * table,
        ]
    }

    /// How much of the impulse's change with the speed is left, since the impulse changes the speed.
    #[inline]
    fn share(&self, Axial { ratio, slope, .. }: &Axial) -> f64 {
        let [screw, nut, table] = self.mobility;
        (1.0 + slope * (ratio * ratio * (screw + nut) + table)).recip()
    }

    #[inline]
    fn with_axial(&self, without: Velocities) -> Velocities {
        let Some(axial) = self.axial else {
            return without;
        };
        let speed = Axial::speed(axial.ratio, without);
        // The reciprocal does not wait for the velocities.
        let impulse = self.share(&axial) * (axial.offset + axial.slope * speed);
        let weights = axial.weights();
        [0, 1, 2].map(|k: usize| without[k] - self.mobility[k] * weights[k] * impulse)
    }

    /// Projected Gauss-Seidel: each surface in turn takes the impulse that stops it, within its limit.
    #[inline(never)]
    fn search(&self, impulses: &mut [f64; 4]) -> Velocities {
        const SWEEPS: usize = 60;
        let surfaces = self.surfaces();
        for (impulse, limit) in impulses.iter_mut().zip(self.limit) {
            *impulse = impulse.clamp(-limit, limit);
        }
        let mut after = self.with_axial(self.moved(impulses));
        for _ in 0..SWEEPS {
            let mut settled = true;
            for ((surface, impulse), limit) in surfaces.iter().zip(&mut *impulses).zip(self.limit) {
                let stop = *impulse - dot(&surface.of, &after) * surface.mass;
                let next = stop.clamp(-limit, limit);
                let change = next - *impulse;
                settled &= change.abs() <= 1e-9 * limit;
                *impulse = next;
                for (velocity, response) in after.iter_mut().zip(surface.response) {
                    *velocity += change * response;
                }
            }
            if settled {
                break;
            }
        }
        // What sticks is at rest, not at the rounding error of rest.
        for k in 0..3 {
            if impulses[k].abs() < self.limit[k] {
                after[k] = 0.0;
            }
        }
        after
    }

    /// How the velocities respond to an impulse at each surface, the axial coupling included.
    fn surfaces(&self) -> [Surface; 4] {
        let (weights, coupling) = self.axial.map_or(([0.0; 3], 0.0), |axial| {
            (axial.weights(), axial.slope * self.share(&axial))
        });
        let [screw, nut, table] = [0, 1, 2].map(|k: usize| self.mobility[k] * weights[k]);
        SURFACES.map(|of| {
            let spread = coupling * (of[0] * screw + of[1] * nut + of[2] * table);
            let response = [
                of[0] * self.mobility[0] - spread * screw,
                of[1] * self.mobility[1] - spread * nut,
                of[2] * self.mobility[2] - spread * table,
            ];
            let weight = dot(&of, &response);
            Surface {
                of,
                response,
                mass: if weight > 0.0 { 1.0 / weight } else { 0.0 },
            }
        })
    }
}

/// One place with friction.
struct Surface {
    /// Its velocity as weights of the velocities.
    of: Velocities,
    /// Change of the velocities per impulse.
    response: Velocities,
    /// Impulse per change of its own velocity.
    mass: f64,
}
