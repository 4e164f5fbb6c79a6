//! The closed loop of an axis, simulated over a record's references and pulses.

use super::axis::{Axis, Term};
use super::record::{Law, Record};
use crate::predict::curve::Over;
use std::f64::consts::{PI, TAU};

/// Integration steps per row.
const SUBSTEPS: usize = 4;

/// What a simulation gives, at every row.
pub struct Run {
    /// Position, m.
    pub position: Vec<f64>,
    /// Velocity, m/s.
    pub velocity: Vec<f64>,
    /// Motor force as the controller asks for it, N.
    pub force: Vec<f64>,
}

/// Where a simulated axis is.
pub struct Moment {
    /// Time, s.
    pub time_s: f64,
    /// Position, m.
    pub position_m: f64,
    /// Velocity, m/s.
    pub velocity_m_s: f64,
    /// Motor force, N.
    pub force_n: f64,
}

/// Where the motion turned round last.
struct SinceReversal {
    from: f64,
    sign: f64,
}

impl SinceReversal {
    /// Way since then, m; slower than 0.1 mm/s nothing turns round.
    fn way(&mut self, x: f64, v: f64) -> f64 {
        if v.abs() > 1e-4 && v.signum() != self.sign {
            (self.from, self.sign) = (x, v.signum());
        }
        (x - self.from).abs()
    }
}

/// Straight lines between values at equal distances over a range; 0 outside of it.
fn between(values: &[f64], [low, high]: [f64; 2], at: f64) -> f64 {
    let last = values.len().saturating_sub(1);
    let place = (at - low) / (high - low) * last as f64;
    if !(0.0..=last as f64).contains(&place) || last == 0 {
        return 0.0;
    }
    let k = (place as usize).min(last - 1);
    values[k] + (place - k as f64) * (values[k + 1] - values[k])
}

/// What a simulation needs of an axis' terms.
struct Numbers {
    mass: f64,
    viscous: f64,
    coulomb: f64,
    offset: f64,
    /// Size at rest, N, and speed of the decay, m/s.
    stribeck: [f64; 2],
    saturation: f64,
    asymmetry: f64,
    /// Stiffness of the bristle before it slides, N/m.
    stiffness: Option<f64>,
    friction_slope: f64,
    load_slope: f64,
    /// Time constant of the force, s.
    lag: f64,
    by_direction: f64,
    /// Orders of the screw, with cosine and sine.
    periodic: Vec<(f64, f64, f64)>,
}

impl Numbers {
    fn new(axis: &Axis) -> Self {
        let [mass, viscous, coulomb, offset] = axis.base;
        let periodic = axis.terms.iter().filter_map(|(term, v)| match term {
            Term::Periodic(order) => Some((*order, v[0], v[1])),
            _ => None,
        });
        Numbers {
            mass: mass.max(1.0),
            viscous,
            coulomb,
            offset,
            stribeck: axis
                .find(Term::Stribeck)
                .map_or([0.0, 1.0], |v| [v[0], v[1].abs().max(1e-4)]),
            saturation: axis.one(Term::Saturation),
            asymmetry: axis.one(Term::Asymmetry),
            stiffness: axis.find(Term::Presliding).map(|v| v[0].clamp(1e4, 5e7)),
            friction_slope: axis.one(Term::PositionFriction),
            load_slope: axis.one(Term::PositionLoad),
            lag: axis.one(Term::Lag).max(0.0),
            by_direction: axis.one(Term::DirectionGain),
            periodic: periodic.collect(),
        }
    }

    /// Share of the missing force that the motor makes up in a step.
    fn follow(&self, dt: f64) -> f64 {
        if self.lag > 0.0 {
            1.0 - (-dt / self.lag).exp()
        } else {
            1.0
        }
    }

    /// Force that repeats with the screw, N.
    fn ripple(&self, theta: f64) -> f64 {
        self.periodic
            .iter()
            .map(|(order, c, s)| c * (order * theta).cos() + s * (order * theta).sin())
            .sum()
    }

    /// Size of the dry friction, N. `rub` is its part over the travel.
    fn level(&self, x: f64, v: f64, rub: f64) -> f64 {
        let [size, speed] = self.stribeck;
        let decay = size * (-(v.abs() / speed)).exp();
        (self.coulomb + decay + self.friction_slope * x + rub).max(0.1)
    }

    /// Dry friction of a carriage on a bristle, N, after LuGre without its own damping.
    /// The bristle follows exactly over a step of constant speed.
    fn presliding(&self, stiffness: f64, level: f64, v: f64, bristle: &mut f64, dt: f64) -> f64 {
        let reach = level / stiffness;
        let rate = v.abs() / reach;
        let target = if v == 0.0 {
            *bristle
        } else {
            reach * v.signum()
        };
        *bristle = target + (*bristle - target) * (-rate * dt).exp();
        stiffness * *bristle + 0.6 * (stiffness * self.mass).sqrt() * v * (-(v.abs() / 2e-3)).exp()
    }

    /// Friction that grows with the speed, N.
    fn drag(&self, v: f64) -> f64 {
        self.viscous * v - self.saturation * v * v.abs() + self.asymmetry * v.abs()
    }
}

impl Axis {
    /// Simulates the closed loop over a record's references and pulses, from its first position at rest.
    pub fn simulate(&self, record: &Record) -> Run {
        self.simulate_under(record, |_| 0.0)
    }

    /// The same with a further force on the carriage, against the positive direction, N, which is asked for four times a row.
    pub fn simulate_under(&self, record: &Record, further: impl Fn(&Moment) -> f64) -> Run {
        let terms = Numbers::new(self);
        let dt = 1.0 / record.rate / SUBSTEPS as f64;
        let inside = self.law == Law::Ideal;
        let rows = record.len();
        let mut run = Run {
            position: Vec::with_capacity(rows),
            velocity: Vec::with_capacity(rows),
            force: Vec::with_capacity(rows),
        };
        let (mut x, mut v) = (record.position[0], 0.0_f64);
        let mut bristle = 0.0_f64;
        let mut since = SinceReversal { from: x, sign: 0.0 };
        let mut applied = record.output[0] * record.force_per_volt;
        let follow = terms.follow(dt);
        for k in 0..rows {
            let speed = match self.law {
                Law::Ideal => v,
                Law::Difference(periods) => {
                    let before = k.checked_sub(periods).map_or(x, |k| run.position[k]);
                    (x - before) * record.rate / periods as f64
                }
            };
            let asked = |x: f64, speed: f64, share: f64| {
                let volts = record.kv * (record.kp * (record.reference_at(k, share) - x) - speed)
                    + record.pulses_at(k, share);
                volts.clamp(-self.limit_v, self.limit_v) * record.force_per_volt
            };
            let mut force = asked(x, speed, 0.0);
            run.position.push(x);
            run.velocity.push(v);
            run.force.push(force);
            let theta = TAU * x / self.lead_m + self.homing;
            let ripple = terms.ripple(theta);
            let measured = self.measured(x, v, since.way(x, v), theta);
            let [load, rub] = [false, true].map(|friction| self.over_travel(friction, x));
            for step in 0..SUBSTEPS {
                if inside {
                    force = asked(x, v, step as f64 / SUBSTEPS as f64);
                }
                applied += (force - applied) * follow;
                let level = terms.level(x, v, rub);
                let way = (v / self.width_m_s).tanh();
                let dry = match terms.stiffness {
                    Some(stiffness) => terms.presliding(stiffness, level, v, &mut bristle, dt),
                    None => level * way,
                };
                let own = terms.drag(v)
                    + dry
                    + terms.offset
                    + ripple
                    + measured
                    + terms.load_slope * x
                    + load;
                let moment = Moment {
                    time_s: (k * SUBSTEPS + step) as f64 * dt,
                    position_m: x,
                    velocity_m_s: v,
                    force_n: applied,
                };
                v += dt / terms.mass
                    * (applied * (1.0 + terms.by_direction * way) - own - further(&moment));
                x += dt * v;
            }
        }
        run
    }

    /// Force of the measured curves, N.
    fn measured(&self, x: f64, v: f64, since: f64, theta: f64) -> f64 {
        let of = |(term, values): &(Term, Vec<f64>)| match *term {
            Term::Measured { over, range, .. } => {
                let way = (v / self.width_m_s).tanh();
                let at = |coordinate: f64| between(values, range, coordinate);
                match over {
                    Over::Speed => at(v),
                    Over::SinceReversal => way * at(since),
                    Over::Position => at(x),
                    Over::PositionByDirection => way * at(x),
                    Over::Turn => at(theta.rem_euclid(TAU)),
                    Over::Period => at(theta.rem_euclid(range[1])),
                    Over::TurnBySpeed => v * at(theta.rem_euclid(TAU)),
                }
            }
            _ => 0.0,
        };
        self.terms.iter().map(of).sum()
    }

    /// Friction or load of the shapes over the travel at a position, N.
    fn over_travel(&self, wanted: bool, x: f64) -> f64 {
        let of = |(term, values): &(Term, Vec<f64>)| match *term {
            Term::Travel {
                friction,
                from_m,
                length_m,
                ..
            } if friction == wanted => {
                let angle = PI * (x - from_m) / length_m;
                (1..)
                    .zip(values)
                    .map(|(k, n)| n * (f64::from(k) * angle).cos())
                    .sum()
            }
            _ => 0.0,
        };
        self.terms.iter().map(of).sum()
    }
}
