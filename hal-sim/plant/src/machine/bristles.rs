//! Friction that is elastic before it slides (LuGre).
//!
//! `z' = v - s0 |v| z / g(v)`, friction `s0 z + s1 z'`, with the level `g` of the surface (Canudas de Wit, Olsson, Astrom, Lischinsky,
//! "A new model for control of systems with friction", IEEE Trans. Automatic Control 40, 1995). `s1 = sqrt(s0 J)` is that paper's example.

use crate::Axis;
use crate::model::Model;

/// The bristles of one surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bristles {
    stiffness: f64,
    damping: f64,
    z: f64,
}

impl Bristles {
    /// A surface that slides at `level` once it is displaced by `presliding`, on `inertia`.
    #[must_use]
    pub fn new(level: f64, presliding: f64, inertia: f64) -> Self {
        let stiffness = level / presliding;
        Self {
            stiffness,
            damping: (stiffness * inertia).sqrt(),
            z: 0.0,
        }
    }

    /// Friction against displacement at rest.
    #[must_use]
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// Friction against `speed` at its `level` there, a time `dt` later. The decay of `z` is implicit: no speed is too high for `dt`.
    pub fn step(&mut self, speed: f64, level: f64, dt: f64) -> f64 {
        if self.stiffness == 0.0 || level <= 0.0 {
            self.z = 0.0;
            return 0.0;
        }
        let decay = self.stiffness * speed.abs() / level;
        let next = (self.z + dt * speed) / (1.0 + dt * decay);
        let rate = (next - self.z) / dt;
        self.z = next;
        self.stiffness * next + self.damping * rate
    }
}

/// The bristles of screw bearing, nut bearing, guideway and pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surfaces([Bristles; 4]);

impl Surfaces {
    /// Of a model's Coulomb levels, each displaced by its presliding before it slides.
    pub(super) fn new(model: &Model) -> Self {
        let feed = &model.feed;
        let travel_m = feed.presliding_m;
        let turned = travel_m / feed.travel_per_radian().abs();
        let [screw, nut] = Axis::ALL.map(|axis| model.motor(axis));
        let reduced =
            screw.inertia_kg_m2 * nut.inertia_kg_m2 / (screw.inertia_kg_m2 + nut.inertia_kg_m2);
        Self([
            Bristles::new(screw.coulomb_nm, turned, screw.inertia_kg_m2),
            Bristles::new(nut.coulomb_nm, turned, nut.inertia_kg_m2),
            Bristles::new(feed.guideway_coulomb_n, travel_m, feed.table_mass_kg),
            Bristles::new(feed.pair_coulomb_nm, turned, reduced),
        ])
    }

    /// Friction at each surface's speed and level.
    pub(super) fn step(&mut self, speeds: [f64; 4], levels: [f64; 4], dt: f64) -> [f64; 4] {
        [0, 1, 2, 3].map(|k: usize| self.0[k].step(speeds[k], levels[k], dt))
    }
}
