//! When friction that falls with the speed makes a shaft under a PI speed loop stick and slip: a closed form.
//!
//! A shaft of inertia `J` under `D = Kp + B` and `Ki` slides at `w`. LuGre's bristles, of stiffness `s0` and damping `s1`, slide at the
//! level `g(w)`. About that point their friction answers a speed with `(s0 + s1 s) q / (s + a)`, where `a = s0 w / g` and `q = w g' / g`.
//! So the loop's polynomial is `(J s^2 + D s + Ki) (s + a) + s (s0 + s1 s) q`, and Routh and Hurwitz say whether it is stable.

use hal_sim::experiment::Setup;
use plant::Axis;
use plant::effects::{AnyEffect, Place};

/// Friction of a shaft, seen from it.
struct Sliding {
    inertia: f64,
    /// `D`, N m s.
    damping: f64,
    /// `Ki`, N m/rad.
    integral: f64,
    /// Of what has a Stribeck curve, N m, and what it has more at rest.
    coulomb_nm: f64,
    sticks_nm: f64,
    stribeck_rad_s: f64,
    /// `s0`, N m/rad, and `s1`, N m s/rad.
    bristles: [f64; 2],
}

impl Sliding {
    /// The screw of a single drive, whose table moves with it.
    fn of(setup: &Setup) -> Self {
        let (model, plate) = (&setup.model, setup.plate());
        let (motor, declared) = (&model.screw, &plate.motors[Axis::Screw.index()]);
        let r = model.feed.travel_per_radian();
        let pole_pairs = f64::from(motor.pole_pairs);
        let gains = declared.gains(&setup.tuning);
        // Current for an electrical speed: torque for a mechanical one.
        let per_gain = pole_pairs * pole_pairs * motor.flux_wb;
        let at = |feed: bool| {
            let effects = model.effects.iter();
            let here = effects.filter(move |effect| (effect.place() == Place::Feed) == feed);
            here.filter_map(|effect| match effect.effect() {
                AnyEffect::StribeckFriction(one) => Some(*one),
                _ => None,
            })
        };
        let sticks_nm = at(false).map(|one| one.amplitude).sum::<f64>()
            + at(true).map(|one| one.amplitude * r).sum::<f64>();
        let speeds = at(false).map(|one| one.speed).reduce(f64::max);
        let coulomb_nm = motor.coulomb_nm + model.feed.guideway_coulomb_n * r;
        let inertia = declared.inertia_kg_m2;
        let stiffness = coulomb_nm * r / model.feed.presliding_m;
        Self {
            inertia,
            damping: gains.k_pw * per_gain
                + motor.viscous_nm_s
                + model.feed.guideway_viscous_n_s_per_m * r * r,
            integral: gains.k_iw * per_gain,
            coulomb_nm,
            sticks_nm,
            stribeck_rad_s: speeds.unwrap_or(f64::INFINITY),
            bristles: [stiffness, (stiffness * inertia).sqrt()],
        }
    }

    fn is_stable(&self, speed: f64) -> bool {
        let x = speed / self.stribeck_rad_s;
        let curve = self.sticks_nm * (-x * x).exp();
        let level = self.coulomb_nm + curve;
        let slope = -2.0 * x / self.stribeck_rad_s * curve;
        let [s0, s1] = self.bristles;
        let (a, q) = (s0 * speed / level, speed * slope / level);
        let c3 = self.inertia;
        let c2 = self.inertia * a + self.damping + s1 * q;
        let c1 = self.damping * a + self.integral + s0 * q;
        let c0 = self.integral * a;
        c2 > 0.0 && c1 > 0.0 && c2 * c1 > c3 * c0
    }
}

/// Fastest velocity at which the loop is looked at, m/s, and how many are looked at to a decade, down to a thousandth.
const FASTEST_M_S: f64 = 0.1;
const A_DECADE: i32 = 200;

/// The table velocity, m/s, below which the single drive of `setup` sticks and slips; none if it does not.
pub fn critical_velocity(setup: &Setup) -> Option<f64> {
    let sliding = Sliding::of(setup);
    let r = setup.model.feed.travel_per_radian();
    (0..=3 * A_DECADE)
        .map(|k| FASTEST_M_S * 10f64.powf(-f64::from(k) / f64::from(A_DECADE)))
        .find(|velocity| !sliding.is_stable(velocity / r))
}
