//! The loops' bandwidth and margin, and the tuning that holds them.
//!
//! The open loops, with `s = j w`, PWM period `T` and speed step `T_w`:
//!
//! ```text
//! current: (k_pc + k_ic / s) / (L s + R) * exp(-1.5 T s)
//! speed:   (k_pw + k_iw / s) * C(s) * p^2 flux / (J s) * O(s) * exp(-(T + T_w / 2) s)
//! ```
//!
//! `C` is the closed current loop, `O = w_o^2 / (s^2 + 2 xi_o w_o s + w_o^2)` the observer. A value acts for a period from the
//! next turn of the counter on, which is one and a half periods; the speed task's for `T_w` from the next period on. Gains
//! are those of Eqs 9 to 12 of Wang et al. 2020. Friction is left out: it adds to the margin.

use link::settings::{MotorSettings, PER_KRPM, Settings};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// A loop that is closed by crossing a gain of 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Crossing {
    /// Where its gain is 1: its bandwidth, rad/s.
    pub bandwidth_rad_s: f64,
    /// Phase margin there, degrees.
    pub margin_deg: f64,
}

/// The open loops of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loops {
    resistance: f64,
    inductance: f64,
    /// Electrical rad/s^2 of an ampere.
    acceleration: f64,
    /// What is fed forward of a reference's electrical acceleration, A s^2/rad.
    fed_forward: f64,
    pole_pairs: f64,
    /// Eqs 9 to 12.
    k_pc: f64,
    k_ic: f64,
    k_pw: f64,
    k_iw: f64,
    observer: [f64; 2],
    period_s: f64,
    step_s: f64,
}

/// Frequencies between which a crossing is looked for, rad/s.
const FROM: f64 = 1.0;
const TO: f64 = 1e5;

impl Loops {
    /// Of a motor as its settings describe it, with a step of the current loop of `period_s` and one of the speed task of `step_s`.
    #[must_use]
    pub fn of(motor: &MotorSettings, settings: &Settings, period_s: f64, step_s: f64) -> Self {
        let tuning = &settings.tuning;
        let p = f64::from(motor.pole_pairs);
        let resistance = motor.resistance_line_to_line_ohm / 2.0;
        let inductance = motor.inductance_line_to_line_mh * 1e-3 / 2.0;
        let (w_c, w_w) = (tuning.current_rad_s, tuning.speed_rad_s);
        let acceleration =
            p * motor.voltage_constant_v_rms_per_krpm / PER_KRPM / (motor.inertia_kg_cm2 * 1e-4);
        Self {
            resistance,
            inductance,
            acceleration,
            fed_forward: acceleration.recip(),
            pole_pairs: p,
            k_pc: 2.0 * tuning.damping * inductance * w_c - resistance,
            k_ic: inductance * w_c * w_c,
            k_pw: 2.0 * tuning.damping * w_w / acceleration,
            k_iw: w_w * w_w / acceleration,
            observer: [tuning.observer_rad_s, tuning.observer_damping],
            period_s,
            step_s,
        }
    }

    /// The same gains on a motor that moves `part` of the inertia that its settings have.
    #[must_use]
    pub fn moving(self, part: f64) -> Self {
        Self {
            acceleration: self.acceleration / part,
            ..self
        }
    }

    /// Kpc, V/A, Kic, V/(A s), Kpw, A s/rad, and Kiw, A/rad, electrical and power invariant.
    #[must_use]
    pub fn gains(&self) -> [f64; 4] {
        [self.k_pc, self.k_ic, self.k_pw, self.k_iw]
    }

    /// The open current loop at `w` rad/s.
    #[must_use]
    pub fn current(&self, w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        (s.inv() * self.k_ic + self.k_pc) / (s * self.inductance + self.resistance)
            * Complex::cis(-1.5 * self.period_s * w)
    }

    /// The closed current loop's response to a step of 1 at its sample 0, for so many samples.
    ///
    /// The motor is exact between two samples. A voltage acts in the period after the one that follows its sample.
    #[must_use]
    pub fn current_step(&self, samples: usize) -> Vec<f64> {
        let decay = (-self.resistance * self.period_s / self.inductance).exp();
        let (mut current, mut integral, mut acting) = (0.0, 0.0, 0.0);
        (0..samples)
            .map(|_| {
                let (now, error) = (current, 1.0 - current);
                let voltage = self.k_pc * error + integral;
                integral += self.k_ic * self.period_s * error;
                current = decay * current + (1.0 - decay) / self.resistance * acting;
                acting = voltage;
                now
            })
            .collect()
    }

    /// The open speed loop at `w` rad/s.
    #[must_use]
    pub fn speed(&self, w: f64) -> Complex<f64> {
        self.speed_controller(w) * self.observer(w) * self.speed_plant(w)
    }

    /// The same with a measured plant, mechanical rad/s an ampere.
    #[must_use]
    pub fn speed_with(&self, w: f64, plant: Complex<f64>) -> Complex<f64> {
        self.speed_controller(w) * self.observer(w) * plant * self.pole_pairs
    }

    /// The speed loop's plant at `w` rad/s: from the reference of the current along q to the speed that the next steps see, electrical
    /// rad/s an ampere.
    fn speed_plant(&self, w: f64) -> Complex<f64> {
        let (s, current) = (Complex::new(0.0, w), self.current(w));
        (current / (current + 1.0))
            * (s.inv() * self.acceleration)
            * Complex::cis(-(self.period_s + 0.5 * self.step_s) * w)
    }

    /// Speed of a speed reference at `w` rad/s, with the inertia fed forward.
    #[must_use]
    pub fn speed_closed(&self, w: f64) -> Complex<f64> {
        let (s, plant) = (Complex::new(0.0, w), self.speed_plant(w));
        let controller = self.speed_controller(w);
        plant * (controller + s * self.fed_forward) / (plant * controller * self.observer(w) + 1.0)
    }

    fn speed_controller(&self, w: f64) -> Complex<f64> {
        Complex::new(0.0, w).inv() * self.k_iw + self.k_pw
    }

    fn observer(&self, w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        let [w_o, damping] = self.observer;
        (s * s + s * (2.0 * damping * w_o) + w_o * w_o).inv() * (w_o * w_o)
    }

    /// Where the current loop crosses.
    #[must_use]
    pub fn current_crossing(&self) -> Crossing {
        crossing(|w| self.current(w))
    }

    /// Where the speed loop crosses.
    #[must_use]
    pub fn speed_crossing(&self) -> Crossing {
        crossing(|w| self.speed(w))
    }
}

/// The last crossing of a gain of 1, by halving. The phase is followed from the lowest frequency on, so that it is not taken for
/// one that is a turn away.
fn crossing(open: impl Fn(f64) -> Complex<f64>) -> Crossing {
    const STEPS: u32 = 400;
    let at = |k: u32| FROM * (TO / FROM).powf(f64::from(k) / f64::from(STEPS));
    // An open loop falls from -180 degrees at rest on: its angle is the margin above that.
    let first = open(at(0));
    let (mut value, mut margin) = (first, (-first).arg());
    let mut last = None;
    for k in 0..STEPS {
        if value.norm() > 1.0 {
            last = Some((k, value, margin));
        }
        let next = open(at(k + 1));
        margin += (next / value).arg();
        value = next;
    }
    let Some((k, before, margin)) = last else {
        return Crossing::default();
    };
    let (mut low, mut high) = (at(k), at(k + 1));
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        if open(middle).norm() > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Crossing {
        bandwidth_rad_s: low,
        margin_deg: (margin + (open(low) / before).arg()).to_degrees(),
    }
}

/// What is wanted of the loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Cutoff of the speed loops, rad/s, at most.
    pub speed_rad_s: f64,
    /// Smallest phase margin of all loops, degrees.
    pub margin_deg: f64,
}

/// The tuning, with the loops that it makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuned {
    /// The settings.
    pub settings: Settings,
    /// Current loops: screw, nut.
    pub current: [Crossing; 2],
    /// Speed loops.
    pub speed: [Crossing; 2],
}

impl Tuned {
    /// What settings make of their motors.
    #[must_use]
    pub fn of(settings: &Settings, period_s: f64, step_s: f64) -> Self {
        let loops = [&settings.screw, &settings.nut]
            .map(|motor| Loops::of(motor, settings, period_s, step_s));
        Self {
            settings: *settings,
            current: loops.map(|of| of.current_crossing()),
            speed: loops.map(|of| of.speed_crossing()),
        }
    }

    /// The smallest margin of all loops, degrees.
    #[must_use]
    pub fn margin_deg(&self) -> f64 {
        self.current
            .iter()
            .chain(&self.speed)
            .map(|crossing| crossing.margin_deg)
            .fold(f64::INFINITY, f64::min)
    }
}

/// The settings with speed loops of a cutoff of `speed_rad_s`, and observers that are fast enough for them.
#[must_use]
pub fn with_speed_loops(settings: &Settings, speed_rad_s: f64) -> Settings {
    let mut new = *settings;
    new.tuning.speed_rad_s = speed_rad_s;
    // Five times the speed loop's: see the setting.
    new.tuning.observer_rad_s = settings.tuning.observer_rad_s.max(5.0 * speed_rad_s);
    new
}

/// The largest cutoffs, to within 5 %, up to those that are wanted at which all loops have their margin; `None` if none has.
#[must_use]
pub fn tune(settings: &Settings, wanted: Wanted, period_s: f64, step_s: f64) -> Option<Tuned> {
    let mut new = *settings;
    let of = |settings: &Settings| Tuned::of(settings, period_s, step_s);
    let falling = |from: f64| {
        let next = |w: &f64| Some(w * 0.95);
        std::iter::successors(Some(from), next).take_while(|w| *w >= FROM)
    };
    let margin = |crossings: [Crossing; 2]| {
        crossings
            .iter()
            .all(|crossing| crossing.margin_deg >= wanted.margin_deg)
    };
    new.tuning.current_rad_s = falling(settings.tuning.current_rad_s).find(|w_c| {
        new.tuning.current_rad_s = *w_c;
        margin(of(&new).current)
    })?;
    falling(wanted.speed_rad_s).find_map(|w_w| {
        let tuned = of(&with_speed_loops(&new, w_w));
        margin(tuned.speed).then_some(tuned)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's gains, without delays and with a fast observer: its own loop, whose crossing is that of
    /// `(2 xi w s + w^2) / s^2` at `w sqrt(2 xi^2 + sqrt(4 xi^4 + 1))`, where its phase margin is
    /// `atan(2 xi sqrt(2 xi^2 + sqrt(4 xi^4 + 1)))`.
    #[test]
    fn without_delays_the_loops_are_those_of_a_second_order() {
        let mut settings = Settings::DEFAULT;
        settings.tuning.observer_rad_s = 1e9;
        settings.tuning.current_rad_s = 1e6;
        let xi = settings.tuning.damping;
        let factor = (2.0 * xi * xi + (4.0 * xi.powi(4) + 1.0).sqrt()).sqrt();
        let loops = Loops::of(&settings.screw, &settings, 0.0, 0.0);
        let speed = loops.speed_crossing();
        let (bandwidth, margin) = (200.0 * factor, (2.0 * xi * factor).atan().to_degrees());
        assert!(
            (speed.bandwidth_rad_s / bandwidth - 1.0).abs() < 1e-3,
            "{speed:?}, expected {bandwidth} rad/s"
        );
        assert!(
            (speed.margin_deg - margin).abs() < 0.1,
            "{speed:?}, expected {margin} degrees"
        );
    }

    /// However far from what the motors can have: a person asks for any.
    #[test]
    fn the_largest_cutoff_does_not_depend_on_how_much_more_is_wanted() {
        let largest = |speed_rad_s| {
            let wanted = Wanted {
                speed_rad_s,
                margin_deg: 45.0,
            };
            let tuned = tune(&Settings::DEFAULT, wanted, 50e-6, 200e-6).unwrap();
            tuned.settings.tuning.speed_rad_s
        };
        let (near, far) = (largest(200.0), largest(10_000.0));
        assert!(
            (0.95..1.0 / 0.95).contains(&(far / near)),
            "{far} rad/s of 10000, expected {near} within a step"
        );
    }

    /// Behind -360 degrees too, where an angle within a turn would be that of a stable loop.
    #[test]
    fn a_faster_speed_loop_never_has_the_greater_margin() {
        let margin = |speed_rad_s| {
            let settings = with_speed_loops(&Settings::DEFAULT, speed_rad_s);
            Tuned::of(&settings, 50e-6, 200e-6).speed[0].margin_deg
        };
        let mut before = margin(100.0);
        for speed_rad_s in (1..100).map(|k| 100.0 + 200.0 * f64::from(k)) {
            let now = margin(speed_rad_s);
            assert!(
                now < before,
                "{now} degrees at {speed_rad_s} rad/s, expected below {before}"
            );
            before = now;
        }
    }

    #[test]
    fn a_margin_that_is_wanted_is_kept_at_the_cost_of_bandwidth() {
        let wanted = Wanted {
            speed_rad_s: 2000.0,
            margin_deg: 45.0,
        };
        let tuned = tune(&Settings::DEFAULT, wanted, 50e-6, 200e-6).unwrap();
        let speed = tuned.settings.tuning.speed_rad_s;
        assert!(tuned.margin_deg() >= 45.0 && speed < 2000.0, "{tuned:?}");
        let mut faster = tuned.settings;
        faster.tuning.speed_rad_s /= 0.95;
        faster.tuning.observer_rad_s = (5.0 * speed / 0.95).max(1000.0);
        let margin = Tuned::of(&faster, 50e-6, 200e-6).speed[0].margin_deg;
        assert!(
            margin < 45.0,
            "at {speed} rad/s / 0.95 the margin is {margin}"
        );
    }
}
