//! Friction with elastic displacement before it breaks away (LuGre).
//!
//! [`Bristles`] with a level that falls with the speed; `vs` of 1 mm/s is that paper's example, as motion of the table.

use hal_sim::seam::Seam;
use plant::Axis;
use plant::machine::{Bristles, Machine};

/// Speed at which what sticks has fallen to 1/e, m/s of the table.
pub(super) const STRIBECK_M_S: f64 = 1e-3;
/// Displacement at which it slides, m of the table. The paper's example has 10 um; a fifth of that is what makes the PI err at a
/// reversal by what such drives are known to, a fifth of the amplitude.
pub(super) const PRESLIDING_M: f64 = 2e-6;
/// Part of the feed's friction that is under the table. More of it, so stiff, rings the axial mode when it breaks away, whoever
/// controls the motors.
const GUIDEWAY: f64 = 0.25;

/// One place with friction, over an angle.
#[derive(Clone, Copy, Debug)]
struct Surface {
    coulomb_nm: f64,
    static_nm: f64,
    stribeck_rad_s: f64,
    bristles: Bristles,
}

impl Surface {
    /// Of levels [sliding, breaking away], N m, on `inertia`, kg m2, where the table moves by `travel`, m/rad.
    fn new([coulomb_nm, static_nm]: [f64; 2], inertia: f64, travel: f64) -> Self {
        Self {
            coulomb_nm,
            static_nm,
            stribeck_rad_s: STRIBECK_M_S / travel,
            bristles: Bristles::new(coulomb_nm, PRESLIDING_M / travel, inertia),
        }
    }

    /// The torque against `speed`, a time `dt` later.
    fn step(&mut self, speed: f64, dt: f64) -> f64 {
        let curve = (-(speed / self.stribeck_rad_s).powi(2)).exp();
        let level = self.coulomb_nm + (self.static_nm - self.coulomb_nm) * curve;
        self.bristles.step(speed, level, dt)
    }
}

/// Friction of both bearings, of ball pair and guideway, on a machine that has none.
#[derive(Clone, Debug)]
pub struct LuGre {
    bearings: [Surface; 2],
    pair: Surface,
    guideway: Surface,
    /// m/rad.
    travel: f64,
    load_n: f64,
    dt: f64,
}

impl LuGre {
    /// Levels of each bearing and of the feed, sliding and breaking away, N m. It acts for half a PWM period of `period_s` at a time.
    #[must_use]
    pub fn new(
        bearing: [f64; 2],
        feed: [f64; 2],
        model: &plant::model::Model,
        period_s: f64,
    ) -> Self {
        let travel = model.feed.travel_per_radian();
        let pair = feed.map(|level| (1.0 - GUIDEWAY) * level);
        let guideway = feed.map(|level| GUIDEWAY * level);
        let table = model.feed.table_mass_kg * travel * travel;
        let inertia = |axis| model.motor(axis).inertia_kg_m2;
        Self {
            bearings: Axis::ALL.map(|axis| Surface::new(bearing, inertia(axis), travel)),
            pair: Surface::new(pair, inertia(Axis::Screw), travel),
            guideway: Surface::new(guideway, table, travel),
            travel,
            load_n: model.feed.load_n,
            dt: 0.5 * period_s,
        }
    }
}

impl Seam for LuGre {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        let speeds = Axis::ALL.map(|axis| machine.motor(axis).omega);
        let pair = self.pair.step(speeds[0] - speeds[1], self.dt);
        for ((axis, bearing), (speed, sign)) in Axis::ALL
            .into_iter()
            .zip(&mut self.bearings)
            .zip(speeds.into_iter().zip([1.0, -1.0]))
        {
            let torque = bearing.step(speed, self.dt) + sign * pair;
            machine.set_disturbance_torque(axis, -torque);
        }
        let table = machine.table_velocity() / self.travel;
        let slide = self.guideway.step(table, self.dt) / self.travel;
        machine.set_load_force(self.load_n + slide);
    }
}
