//! A motor in a speed loop on its way through a record.

use super::kind::Kind;
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{PI, TAU};

/// Rows a second.
pub(super) const RATE: f64 = 1000.0;
/// Steps of the simulation in a row.
pub(super) const SUBSTEPS: usize = 4;
/// Load and friction that every motor has, A.
const BIAS: f64 = 0.02;

/// A motor's plate, drawn.
#[derive(Clone, Copy)]
pub(super) struct Plate {
    pub(super) inertia: f64,
    pub(super) coulomb: f64,
    pub(super) width: f64,
    pub(super) viscous: f64,
    pub(super) noise: f64,
    pub(super) counts: f64,
}

impl Plate {
    pub(super) fn drawn(random: &mut Xoshiro256PlusPlus) -> Self {
        let mut log = |low: f64, high: f64| low * (high / low).powf(random.random::<f64>());
        Plate {
            inertia: log(2e-3, 1e-2),
            coulomb: log(0.15, 0.5),
            width: log(0.05, 1.5),
            viscous: log(1e-3, 1e-2),
            noise: log(2e-3, 1e-2),
            counts: log(8e3, 1e6).round(),
        }
    }
}

/// A motor on its way.
pub(super) struct Shaft {
    kind: Kind,
    plate: Plate,
    /// The plate without a change, and the current that it takes on this way, A, mean of a row.
    plain: Plate,
    pub(super) plain_current: f64,
    /// Size of the injected torque, A.
    size: f64,
    is_check: bool,
    pub(super) theta: f64,
    pub(super) w: f64,
    integral: f64,
    /// States of the effects that have one.
    dahl: f64,
    walk: f64,
    noise: f64,
    acceleration: f64,
    load_theta: f64,
    load_w: f64,
    /// Where it turned round last, rad, and which way it goes.
    turned_at: f64,
    goes: f64,
}

impl Shaft {
    /// At rest. `plate` is what it has, `plain` what it has without the effect.
    pub(super) fn new(kind: Kind, [plate, plain]: [Plate; 2], size: f64, is_check: bool) -> Self {
        Self {
            kind,
            plate,
            plain,
            plain_current: 0.0,
            size,
            is_check,
            theta: 0.0,
            w: 0.0,
            integral: 0.0,
            dahl: 0.0,
            walk: 0.0,
            noise: 0.0,
            acceleration: 0.0,
            load_theta: 0.0,
            load_w: 0.0,
            turned_at: 0.0,
            goes: 1.0,
        }
    }

    /// The current that the drive asks in a row, A. `random` is of unit variance.
    pub(super) fn asked(&mut self, speed: f64, random: f64) -> f64 {
        self.walk += 0.1 * self.size * random / RATE.sqrt() * 5.0;
        self.noise = random;
        self.plain_current = 0.0;
        let error = speed - self.w;
        self.integral += error / RATE;
        let asked = 60.0 * self.plate.inertia * (error + 15.0 * self.integral);
        let most = 1.4 * self.plate.coulomb;
        match self.kind {
            Kind::Clipped => asked.clamp(-most, most),
            _ => asked,
        }
    }

    pub(super) fn step(&mut self, asked: f64, t: f64) {
        let dt = 1.0 / RATE / SUBSTEPS as f64;
        let way = (self.w / self.plate.width).tanh();
        let round = match self.kind {
            Kind::Dahl(round) => round,
            _ => 1.0,
        };
        self.dahl += (self.w - self.dahl * self.w.abs() / round) * dt;
        if self.w * self.goes < 0.0 {
            (self.goes, self.turned_at) = (-self.goes, self.theta);
        }
        let behind = self.behind();
        self.load_w += behind / (0.5 * self.plate.inertia) * dt;
        self.load_theta += self.load_w * dt;
        let more = self.injected(way, asked, t);
        let Plate {
            coulomb, viscous, ..
        } = self.plate;
        let torque = asked - coulomb * way - viscous * self.w - more - behind - BIAS;
        let inertia = match self.kind {
            Kind::HeavierLate if t > 7.0 => 1.5 * self.plate.inertia,
            _ => self.plate.inertia,
        };
        self.acceleration = torque / inertia;
        let Plate {
            inertia,
            coulomb,
            viscous,
            ..
        } = self.plain;
        let plain = inertia * self.acceleration + coulomb * way + viscous * self.w + BIAS;
        self.plain_current += plain / SUBSTEPS as f64;
        self.w += self.acceleration * dt;
        self.theta += self.w * dt;
    }

    /// Torque of a load that follows on a spring, A.
    fn behind(&self) -> f64 {
        let twist = self.theta - self.load_theta;
        let spring = 400.0 * self.plate.inertia * 40.0;
        match self.kind {
            Kind::SoftLoad(part) => {
                spring * part * twist + 0.02 * spring / 40.0 * (self.w - self.load_w)
            }
            Kind::Backlash(play) => spring * (twist - twist.clamp(-play, play)),
            _ => 0.0,
        }
    }

    /// The injected torque, A. `way` is the direction, turned round as friction is.
    fn injected(&self, way: f64, asked: f64, t: f64) -> f64 {
        let Self { size, theta, w, .. } = *self;
        let over = |at: f64, width: f64| (-((theta - at) / width).powi(2)).exp();
        match self.kind {
            Kind::Order(order) => size * (order * theta + 0.7).cos(),
            Kind::OrderBySpeed(order) => size * w / 15.0 * (order * theta).cos(),
            Kind::OrderByCurrent(order) => {
                size * asked / self.plate.coulomb * (order * theta).cos()
            }
            Kind::OrderByDirection(order) => size * way * (order * theta).cos(),
            Kind::TwoOrders(one, other) => size * ((one * theta).cos() + (other * theta).sin()),
            Kind::Square(order) => size * (order * theta).cos().signum(),
            Kind::Sawtooth => size * (theta.rem_euclid(TAU) / PI - 1.0),
            Kind::Dent => size * 3.0 * (-((theta.rem_euclid(TAU) - PI) / 0.1).powi(2)).exp(),
            Kind::Resonant(order) => {
                let off = (order * w.abs() - 100.0) / 30.0;
                size * 2.0 / (1.0 + off * off) * (order * theta).cos()
            }
            Kind::Windage => size * w * w.abs() / 400.0,
            Kind::Cubic => size * (w / 20.0).powi(3),
            Kind::Stribeck => size * way * (-(w / 6.0).powi(2)).exp(),
            Kind::StribeckOneWay => size * way.max(0.0) * (-(w / 6.0).powi(2)).exp(),
            Kind::Asymmetry => size * (w / 15.0).max(0.0),
            Kind::OneWayFriction => size * way.max(0.0),
            Kind::LoadedFriction => size * way * asked.abs() / self.plate.coulomb,
            Kind::TightPlace => size * 2.0 * way * over(3.0, 3.0),
            Kind::TightHalf => size * way * f64::from(theta.sin() > 0.0),
            Kind::Breakaway => size * 3.0 * way * (-(theta - self.turned_at).abs() / 0.05).exp(),
            Kind::Dahl(round) => size * 3.0 * (self.dahl / round),
            Kind::Spring => size * (theta / 6.0).tanh(),
            Kind::Detent => size * 2.0 * over(3.0, 0.5),
            Kind::Gravity => size * theta.sin(),
            // The torque that a momentum which changes with the angle takes.
            Kind::Crank => {
                let change = 0.3 * self.plate.inertia;
                change * (self.acceleration * (2.0 * theta).cos() - w * w * (2.0 * theta).sin())
            }
            _ => self.injected_once(way, t),
        }
    }

    /// The injected torque that does not come again, A.
    fn injected_once(&self, way: f64, t: f64) -> f64 {
        let Self { size, theta, w, .. } = *self;
        match self.kind {
            Kind::OrderFades(order) => 2.0 * size * (-t / 5.0).exp() * (order * theta).cos(),
            Kind::OrderStarts(order) => size * f64::from(t > 7.0) * (order * theta).cos(),
            Kind::RandomWalk => self.walk,
            Kind::RandomTorque => size * self.noise,
            Kind::Warming(tau) => size * way * (-t / tau).exp() * 2.0,
            Kind::WarmingOil => size * w / 15.0 * (-t / 4.0).exp() * 2.0,
            Kind::Ramp => size * t / 14.0,
            Kind::Step => size * f64::from(t > 6.2),
            Kind::OnlyInFit => size * way * f64::from(!self.is_check),
            Kind::OnlyInCheck => size * way * f64::from(self.is_check),
            Kind::Hum(hz) => size * (TAU * hz * t).cos(),
            Kind::Bursts => {
                size * (TAU * 9.0 * t).sin()
                    * (TAU * 0.31 * t + f64::from(self.is_check)).sin().max(0.0)
            }
            Kind::Hammer => size * 3.0 * f64::from(t.fract() < 0.02),
            _ => 0.0,
        }
    }
}
