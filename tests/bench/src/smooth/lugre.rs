//! Friction with elastic displacement before it breaks away (LuGre).
//!
//! `z' = v - |v| z / g(v)`, force `s0 z + s1 z'` with `s0 g(v) = Fc + (Fs - Fc) e^-(v / vs)^2` (Canudas de Wit, Olsson, Astrom,
//! Lischinsky, "A new model for control of systems with friction", IEEE Trans. Automatic Control 40, 1995). `vs` of
//! 1 mm/s and `s1` of `sqrt(s0 m)` are that paper's example, as motion of the table.

use hal_sim::seam::Seam;
use plant::Axis;
use plant::machine::Machine;

/// Speed at which what sticks has fallen to 1/e, m/s of the table.
pub(super) const STRIBECK_M_S: f64 = 1e-3;
/// Displacement at which it slides, m of the table. The paper's example has 10 um; a fifth of that is what makes the PI err at a
/// reversal by what such drives are known to, a fifth of the amplitude.
pub(super) const PRESLIDING_M: f64 = 2e-6;
/// Part of the feed's friction that is under the table. More of it, so stiff, rings the axial mode when it breaks away, whoever
/// controls the motors.
const GUIDEWAY: f64 = 0.25;

/// One place that rubs, over an angle.
#[derive(Clone, Copy, Debug)]
struct Bristles {
    coulomb_nm: f64,
    static_nm: f64,
    stiffness: f64,
    damping: f64,
    stribeck_rad_s: f64,
    z: f64,
}

impl Bristles {
    /// Of levels [sliding, breaking away], N m, on `inertia`, kg m2, where the table moves by `travel`, m/rad.
    fn new([coulomb_nm, static_nm]: [f64; 2], inertia: f64, travel: f64) -> Self {
        let stiffness = coulomb_nm / (PRESLIDING_M / travel);
        Self {
            coulomb_nm,
            static_nm,
            stiffness,
            damping: (stiffness * inertia).sqrt(),
            stribeck_rad_s: STRIBECK_M_S / travel,
            z: 0.0,
        }
    }

    /// The torque against `speed`, a time `dt` later. The decay of `z` is implicit, so no speed is too high for `dt`.
    fn step(&mut self, speed: f64, dt: f64) -> f64 {
        let curve = (-(speed / self.stribeck_rad_s).powi(2)).exp();
        let level = self.coulomb_nm + (self.static_nm - self.coulomb_nm) * curve;
        let decay = self.stiffness * speed.abs() / level;
        let next = (self.z + dt * speed) / (1.0 + dt * decay);
        let rate = (next - self.z) / dt;
        self.z = next;
        self.stiffness * next + self.damping * rate
    }
}

/// Friction of both bearings, of ball pair and guideway, on a machine that has none.
#[derive(Clone, Debug)]
pub struct LuGre {
    bearings: [Bristles; 2],
    pair: Bristles,
    guideway: Bristles,
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
            bearings: Axis::ALL.map(|axis| Bristles::new(bearing, inertia(axis), travel)),
            pair: Bristles::new(pair, inertia(Axis::Screw), travel),
            guideway: Bristles::new(guideway, table, travel),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Pulled slowly it is a spring that gives way at the static level; fast it slides at Coulomb's.
    #[test]
    fn it_is_a_spring_before_it_breaks_away() {
        let (travel, dt) = (1e-3, 25e-6);
        let new = || Bristles::new([0.10, 0.16], 1e-3, travel);
        let mut slow = new();
        // A tenth of the presliding at a thousandth of the Stribeck speed.
        let speed = 1e-3 * STRIBECK_M_S / travel;
        let steps = (0.1 * PRESLIDING_M / travel / speed / dt) as u32;
        let torque = (0..steps).fold(0.0, |_, _| slow.step(speed, dt));
        let spring = slow.stiffness * speed * f64::from(steps) * dt;
        assert!(
            (torque / spring - 1.0).abs() < 0.1,
            "{torque} N m for {spring} N m"
        );
        let at_last = (0..100 * steps).fold(0.0, |_, _| slow.step(speed, dt));
        assert!(
            (at_last - 0.16).abs() < 1e-3,
            "breaks away at {at_last} N m"
        );
        let mut fast = new();
        let sliding = (0..100_000).fold(0.0, |_, _| fast.step(100.0, dt));
        assert!((sliding - 0.10).abs() < 1e-3, "slides at {sliding} N m");
    }
}
