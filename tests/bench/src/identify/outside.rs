//! Effects that no family has, in the plant in closed loop: whatever is said of them, nothing may be said that is sure and
//! wrong.

use super::{alone, outside_axes};
use crate::draw::{self, profile};
use identify::analysis::{Outcome, analyse};
use identify::signal::channel::Channel;
use plant::Axis;
use plant::machine::Machine as Plant;
use serde_json::{Value, json};
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

/// One kind: its name, the coordinates that a description of it may name (none: it has no shape), and what it does.
struct Kind {
    name: &'static str,
    coordinates: &'static [&'static str],
    act: fn(&mut Plant, &Memory),
}

/// What a kind keeps between two steps, and its strength.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) strength: f64,
    pub(super) state: [Cell<f64>; 4],
    pub(super) random: Cell<u64>,
    /// Steps in which a resistance is another, and their sum of squares of the current times the relative change.
    pub(super) resistive: Cell<(u32, f64)>,
}

impl Memory {
    /// An even random number from -1 to 1.
    pub(super) fn noise(&self) -> f64 {
        let next = self
            .random
            .get()
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.random.set(next);
        (next >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Changes a motor's resistance by a share.
    fn resist(&self, machine: &mut Plant, axis: Axis, share: f64) {
        machine.set_winding_change(axis, share, 0.0);
        let motor = machine.motor(axis);
        let square = motor.i_alpha * motor.i_alpha + motor.i_beta * motor.i_beta;
        let (steps, sum) = self.resistive.get();
        (self.resistive).set((steps + 1, sum + share * share * square));
    }

    /// Rms of the voltage that this is of a declared resistance.
    fn volts(&self, resistance: f64) -> Option<f64> {
        let (steps, sum) = self.resistive.get();
        (steps > 0).then(|| resistance * (sum / f64::from(steps)).sqrt())
    }
}

/// Half a control period at 20 kHz, s: how often a disturbance acts.
const STEP_S: f64 = 2.5e-5;
const LOAD_N: f64 = 400.0;

fn hump(t: f64) -> f64 {
    ((t / 14.0).clamp(0.0, 1.0) * PI).sin().powi(2)
}

const ANGLES: [&str; 4] = [
    "angle of the screw",
    "angle of the nut",
    "angle of screw against nut",
    "time",
];

/// A mass on a spring on a motor's shaft: its torque.
fn oscillator(machine: &Plant, memory: &Memory, axis: Axis, hz: f64, share: f64) -> f64 {
    let motor = machine.motor(axis);
    let inertia = share * 7e-4;
    let stiffness = inertia * (TAU * hz).powi(2);
    let damping = 0.02 * 2.0 * (inertia * stiffness).sqrt();
    let [angle, speed] = [0, 1].map(|k: usize| memory.state[k].get());
    let torque = stiffness * (angle - motor.theta) + damping * (speed - motor.omega);
    let speed = speed - torque / inertia * STEP_S;
    memory.state[1].set(speed);
    memory.state[0].set(angle + speed * STEP_S);
    torque
}

/// Every kind.
const KINDS: &[Kind] = &[
    Kind {
        name: "torque over the other motor's angle",
        coordinates: &["angle of the nut"],
        act: |m, x| {
            let angle = m.motor(Axis::Nut).theta;
            m.set_disturbance_torque(Axis::Screw, 0.03 * x.strength * (13.0 * angle).cos());
        },
    },
    Kind {
        name: "resistance rises and falls back",
        coordinates: &["time", "time, times current of the screw"],
        act: |m, x| {
            x.resist(m, Axis::Screw, 0.12 * x.strength * hump(m.time()));
        },
    },
    Kind {
        name: "resistance steps",
        coordinates: &["time", "time, times current of the nut"],
        act: |m, x| {
            x.resist(m, Axis::Nut, 0.1 * x.strength * f64::from(m.time() > 6.0));
        },
    },
    Kind {
        name: "flux sags and comes back",
        coordinates: &["time", "time, times speed of the nut"],
        act: |m, x| {
            m.set_winding_change(Axis::Nut, 0.0, -0.05 * x.strength * hump(m.time()));
        },
    },
    Kind {
        name: "torque constant falls with current",
        coordinates: &["none", "speed of the screw", "speed of the nut"],
        act: |m, x| {
            let s = m.motor(Axis::Screw);
            let square = s.i_alpha * s.i_alpha + s.i_beta * s.i_beta;
            m.set_winding_change(Axis::Screw, 0.0, -0.06 * x.strength * square / 4.0);
        },
    },
    Kind {
        name: "windage",
        coordinates: &["speed of the nut"],
        act: |m, x| {
            let w = m.motor(Axis::Nut).omega;
            m.set_disturbance_torque(Axis::Nut, -1.2e-5 * x.strength * w * w.abs());
        },
    },
    Kind {
        name: "drag in one direction",
        coordinates: &["speed of the nut"],
        act: |m, x| {
            let w = m.motor(Axis::Nut).omega;
            m.set_disturbance_torque(Axis::Nut, -0.03 * x.strength * (w / 5.0).max(0.0).tanh());
        },
    },
    Kind {
        name: "order that grows with speed",
        coordinates: &[
            "angle of the nut, times its speed",
            "angle of the screw",
            "angle of the nut",
            "angle of screw against nut",
            "time",
        ],
        act: |m, x| {
            let s = m.motor(Axis::Nut);
            let size = 0.04 * x.strength * (s.omega / 60.0).powi(2);
            m.set_disturbance_torque(Axis::Nut, size * (7.0 * s.theta).cos());
        },
    },
    Kind {
        name: "chirp in time",
        coordinates: &["time", "none"],
        act: |m, x| {
            let t = m.time();
            m.set_disturbance_torque(
                Axis::Screw,
                0.03 * x.strength * (TAU * (15.0 * t + 2.0 * t * t)).cos(),
            );
        },
    },
    Kind {
        name: "hum that comes and goes at random",
        coordinates: &["time"],
        act: |m, x| {
            let t = m.time();
            let swell = x.state[0].get() * (1.0 - STEP_S) + 0.02 * x.noise();
            x.state[0].set(swell);
            let size = 0.04 * x.strength * swell;
            m.set_disturbance_torque(Axis::Nut, size * (TAU * 47.0 * t).cos());
        },
    },
    Kind {
        name: "knocks at random",
        coordinates: &["none", "time"],
        act: |m, x| {
            if x.noise() > 0.99995 {
                x.state[0].set(0.6 * x.strength * x.noise().signum());
            }
            let knock = x.state[0].get();
            x.state[0].set(knock * 0.98);
            m.set_disturbance_torque(Axis::Screw, knock);
        },
    },
    Kind {
        name: "a knock each turn",
        coordinates: &ANGLES,
        act: |m, x| {
            let turn = (m.motor(Axis::Screw).theta / TAU).rem_euclid(1.0);
            let knock = (-((turn - 0.4) / 0.01).powi(2)).exp();
            m.set_disturbance_torque(Axis::Screw, 0.15 * x.strength * knock);
        },
    },
    Kind {
        name: "bearing that warms",
        coordinates: &["time", "time, against the motion of the nut"],
        act: |m, x| {
            let s = m.motor(Axis::Nut);
            let more = 0.04 * x.strength * (-m.time() / 3.0).exp();
            m.set_disturbance_torque(Axis::Nut, -more * (s.omega / 0.5).tanh());
        },
    },
    Kind {
        name: "friction by direction",
        coordinates: &["speed of the screw"],
        act: |m, x| {
            let w = m.motor(Axis::Screw).omega;
            m.set_disturbance_torque(Axis::Screw, 0.03 * x.strength * (w / 3.0).tanh().powi(2));
        },
    },
    Kind {
        name: "product of both angles",
        coordinates: &ANGLES,
        act: |m, x| {
            let [a, b] = [m.motor(Axis::Screw).theta, m.motor(Axis::Nut).theta];
            m.set_disturbance_torque(
                Axis::Screw,
                0.04 * x.strength * (5.0 * a).sin() * (3.0 * b).sin(),
            );
        },
    },
    Kind {
        name: "noise in a band",
        coordinates: &["none", "time"],
        act: |m, x| {
            let [v, p] = [0, 1].map(|k: usize| x.state[k].get());
            let w = TAU * 45.0;
            let v = v + STEP_S * (w * w * (400.0 * x.noise() - p) - 0.3 * w * v);
            x.state[0].set(v);
            x.state[1].set(p + STEP_S * v);
            m.set_disturbance_torque(Axis::Screw, 2e-3 * x.strength * p);
        },
    },
    Kind {
        name: "random walk of the torque",
        coordinates: &["none", "time"],
        act: |m, x| {
            let walk = x.state[0].get() * (1.0 - STEP_S / 4.0) + 4e-4 * x.strength * x.noise();
            x.state[0].set(walk);
            m.set_disturbance_torque(Axis::Nut, walk);
        },
    },
    Kind {
        name: "brake that drags for a while",
        coordinates: &["time", "time, against the motion of the nut"],
        act: |m, x| {
            let t = m.time();
            let on = f64::from((4.0..7.0).contains(&t));
            let w = m.motor(Axis::Nut).omega;
            m.set_disturbance_torque(Axis::Nut, -0.04 * x.strength * on * (w / 0.5).tanh());
        },
    },
    Kind {
        name: "force on the table in time",
        coordinates: &["time"],
        act: |m, x| {
            m.set_load_force(LOAD_N + 40.0 * x.strength * (TAU * 3.7 * m.time()).cos());
        },
    },
    Kind {
        name: "drag by the square of the table's speed",
        coordinates: &["speed of screw against nut"],
        act: |m, x| {
            let v = m.table_velocity();
            m.set_load_force(LOAD_N + 3e5 * x.strength * v * v.abs());
        },
    },
    Kind {
        name: "tight place of the guideway",
        coordinates: &[
            "position of the table, against its motion",
            "position of the table",
        ],
        act: |m, x| {
            let inside = ((m.table_position() - 4e-3) / 2e-3).clamp(0.0, 1.0);
            let force = 30.0 * x.strength * (PI * inside).sin().powi(2);
            m.set_load_force(LOAD_N + force * (m.table_velocity() / 1e-5).tanh());
        },
    },
    Kind {
        name: "load that steps",
        coordinates: &["time"],
        act: |m, x| {
            m.set_load_force(LOAD_N + 60.0 * x.strength * f64::from(m.time() > 5.0));
        },
    },
    Kind {
        name: "force on the table at random",
        coordinates: &["none", "time"],
        act: |m, x| {
            let slow = x.state[0].get()
                + STEP_S * TAU * 20.0 * (4000.0 * x.strength * x.noise() - x.state[0].get());
            x.state[0].set(slow);
            m.set_load_force(LOAD_N + slow);
        },
    },
    Kind {
        name: "cable chain",
        coordinates: &[
            "position of the table",
            "position of the table, against its motion",
            "angle of screw against nut",
        ],
        act: |m, x| {
            let p = m.table_position();
            m.set_load_force(LOAD_N + 30.0 * x.strength * (TAU * p / 3.1e-3).cos().signum());
        },
    },
    Kind {
        name: "guideway that runs dry",
        coordinates: &["time", "time, against the motion of the table"],
        act: |m, x| {
            let more = 25.0 * x.strength * (m.time() / 14.0);
            m.set_load_force(LOAD_N + more * (m.table_velocity() / 1e-5).tanh());
        },
    },
    Kind {
        name: "friction by the table's direction",
        coordinates: &["speed of screw against nut"],
        act: |m, x| {
            m.set_load_force(
                LOAD_N + 25.0 * x.strength * (m.table_velocity() / 1e-5).tanh().powi(2),
            );
        },
    },
    Kind {
        name: "flux that swings in time",
        coordinates: &["time", "time, times speed of the screw"],
        act: |m, x| {
            m.set_winding_change(
                Axis::Screw,
                0.0,
                0.03 * x.strength * (TAU * 0.31 * m.time()).sin(),
            );
        },
    },
    Kind {
        name: "resistance by direction",
        coordinates: &["speed of the nut", "speed of the nut, times its current"],
        act: |m, x| {
            let way = (m.motor(Axis::Nut).omega / 3.0).tanh();
            x.resist(m, Axis::Nut, 0.08 * x.strength * way);
        },
    },
    Kind {
        name: "resistance over the angle",
        coordinates: &["angle of the screw"],
        act: |m, x| {
            let angle = m.motor(Axis::Screw).theta;
            x.resist(m, Axis::Screw, 0.1 * x.strength * (3.0 * angle).cos());
        },
    },
    Kind {
        name: "swinging mass on the nut",
        coordinates: &["none", "time"],
        act: |m, x| {
            let torque = oscillator(m, x, Axis::Nut, 38.0, 0.1 * x.strength);
            m.set_disturbance_torque(Axis::Nut, torque);
        },
    },
    Kind {
        name: "swinging mass on the screw",
        coordinates: &["none", "time"],
        act: |m, x| {
            let torque = oscillator(m, x, Axis::Screw, 90.0, 0.1 * x.strength);
            m.set_disturbance_torque(Axis::Screw, torque);
        },
    },
    Kind {
        name: "spring that clutches the nut",
        coordinates: &[
            "none",
            "angle of the nut",
            "angle of the nut since its reversal",
            "speed of the nut",
        ],
        act: |m, x| {
            let s = m.motor(Axis::Nut);
            let stretch = (s.theta - x.state[0].get()).clamp(-2.0, 2.0);
            x.state[0].set(s.theta - stretch);
            m.set_disturbance_torque(Axis::Nut, -0.02 * x.strength * stretch);
        },
    },
    Kind {
        name: "torque that depends on both speeds",
        coordinates: &[
            "none",
            "speed of the nut",
            "speed of the screw",
            "speed of screw against nut",
            "speed of the screw, against the motion of the table",
            "speed of the nut, against the motion of the table",
        ],
        act: |m, x| {
            let [a, b] = [m.motor(Axis::Screw).omega, m.motor(Axis::Nut).omega];
            m.set_disturbance_torque(
                Axis::Screw,
                -0.05 * x.strength * ((a - b) / 3.0).tanh() * (b / 80.0).abs(),
            );
        },
    },
    Kind {
        name: "viscous friction that sags in time",
        coordinates: &["time", "time, times speed of the nut"],
        act: |m, x| {
            let w = m.motor(Axis::Nut).omega;
            m.set_disturbance_torque(Axis::Nut, 4e-4 * x.strength * w * hump(m.time()));
        },
    },
];

/// Torques that repeat in a coordinate: each ends as a curve.
const REPEATING: [Kind; 3] = [
    Kind {
        name: "torque over the angle with a kink",
        coordinates: &["angle of the screw"],
        act: |m, x| {
            let turn = (m.motor(Axis::Screw).theta / TAU).rem_euclid(1.0);
            let kinked = (turn - 0.3).abs().min(0.4) - 0.25;
            m.set_disturbance_torque(Axis::Screw, 0.25 * x.strength * kinked);
        },
    },
    Kind {
        name: "friction with a bump over the speed",
        coordinates: &["speed of the nut"],
        act: |m, x| {
            let w = m.motor(Axis::Nut).omega;
            let bump = (-((w.abs() - 45.0) / 12.0).powi(2)).exp();
            m.set_disturbance_torque(Axis::Nut, -0.04 * x.strength * bump * (w / 0.5).tanh());
        },
    },
    Kind {
        name: "knock of the nut each turn",
        coordinates: &ANGLES,
        act: |m, x| {
            let turn = (m.motor(Axis::Nut).theta / TAU).rem_euclid(1.0);
            let knock = (-((turn - 0.4) / 0.04).powi(2)).exp();
            m.set_disturbance_torque(Axis::Nut, 0.1 * x.strength * knock);
        },
    },
];

/// What was said of one machine.
pub(super) struct Said {
    /// `explained`, or `nothing missing` above a size that it has.
    pub(super) sure: bool,
    /// `nothing missing` above a size that is larger.
    pub(super) is_below: bool,
    pub(super) names: usize,
    /// The residual is first is described over a coordinate that is right.
    pub(super) coordinate: bool,
    /// Power beyond the noise floor on the check record, without and with what was found and measured; whether a curve was added.
    pub(super) excess: [f64; 2],
    pub(super) curves: usize,
}

/// Kinds that a motor alone can have: what acts on the nut only.
const ALONE: [&str; 12] = [
    "resistance steps",
    "flux sags and comes back",
    "drag in one direction",
    "order that grows with speed",
    "hum that comes and goes at random",
    "bearing that warms",
    "random walk of the torque",
    "brake that drags for a while",
    "resistance by direction",
    "swinging mass on the nut",
    "spring that clutches the nut",
    "viscous friction that sags in time",
];

/// Strengths of the kinds, from one round through all of them to the next.
const STRENGTHS: [f64; 3] = [1.0, 0.6, 1.6];

/// Kinds on all machines.
const CASES: usize = KINDS.len() + ALONE.len() + outside_axes::COUNT;

/// Runs one machine: the kinds on a double drive, then those of a motor alone, then those of a feed axis.
fn said(run: usize) -> Said {
    let case = run % CASES;
    let strength = STRENGTHS[run / CASES % STRENGTHS.len()];
    if let Some(case) = case.checked_sub(KINDS.len() + ALONE.len()) {
        return outside_axes::said(case, run, strength);
    }
    let seed = 300 + run as u64;
    let named = |name: &str| KINDS.iter().find(|kind| kind.name == name);
    let kind = match case.checked_sub(KINDS.len()) {
        None => &KINDS[case],
        Some(place) => named(ALONE[place]).expect("one of the kinds"),
    };
    told(kind, case < KINDS.len(), seed, strength)
}

/// What is said of a kind on a double drive, or on a motor alone.
fn told(kind: &Kind, is_double: bool, seed: u64, strength: f64) -> Said {
    let memory = Memory {
        strength,
        random: Cell::new(seed | 1),
        ..Memory::default()
    };
    let act = |machine: &mut Plant| (kind.act)(machine, &memory);
    let (on, machine, outcome) = if is_double {
        let profiles = [profile::recorded(), profile::recorded_check()];
        let machine = draw::acted_on(seed, &act, profiles);
        let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
        ("double drive", machine, outcome)
    } else {
        let machine = draw::alone(seed, &[], &act);
        let outcome = alone::told(&machine);
        ("motor alone", machine, outcome)
    };
    let declared = &machine.declared;
    let resistance = f64::max(declared.screw.resistance_ohm, declared.nut.resistance_ohm);
    let volts = memory.volts(resistance);
    let is_below = outcome.verdict() == "nothing missing"
        && volts.is_some_and(|volts| volts < stated_volts(&outcome));
    tell(&format!("seed {seed}, {on}, {}", kind.name), &outcome);
    Said {
        sure: matches!(outcome.verdict(), "explained" | "nothing missing") && !is_below,
        is_below,
        names: outcome.effects.len(),
        coordinate: outcome.unexplained.first().is_some_and(|left| {
            let mut right = kind.coordinates.iter();
            right.any(|right| match is_double {
                true => *right == left.coordinate,
                // The nut's motor alone has the screw's place in the balances.
                false => right.replace("the nut", "the screw") == left.coordinate,
            })
        }),
        excess: excess(&outcome),
        curves: outcome.curves.len(),
    }
}

/// The smallest rms of a q voltage above which the verdict states that nothing is missing.
fn stated_volts(outcome: &Outcome) -> f64 {
    let all = outcome.channels.iter();
    let volts = all.filter(|rest| matches!(rest.channel, Channel::VoltageQ(_)));
    volts.fold(f64::INFINITY, |least, rest| {
        least.min(rest.figures.check_after)
    })
}

/// One of the kinds that repeat: on a double drive, or where only the nut has it on a motor alone, in turn.
fn repeating(run: usize) -> Said {
    let places = [(0, true), (1, true), (2, true), (1, false), (2, false)];
    let (kind, is_double) = places[run % places.len()];
    let strength = STRENGTHS[run / places.len() % STRENGTHS.len()];
    told(&REPEATING[kind], is_double, 90_300 + run as u64, strength)
}

/// Sums of squares beyond the floor of the torque balances on the check record, before and after.
fn excess(outcome: &Outcome) -> [f64; 2] {
    let torques = || {
        let all = outcome.channels.iter();
        all.filter(|rest| matches!(rest.channel, Channel::Torque(_)))
    };
    [0, 1].map(|when: usize| torques().map(|rest| rest.levels[when].excess).sum())
}

/// Runs so many machines and counts. A long run is watched on standard error.
pub(super) fn measure(first: usize, runs: usize) -> Value {
    let own: Vec<Said> = (first..first + runs).map(said).collect();
    let repeating: Vec<Said> = (first..first + runs / 4).map(repeating).collect();
    let mut all = counted(&own);
    all["repeating"] = counted(&repeating);
    all
}

fn counted(said: &[Said]) -> Value {
    let runs = said.len();
    let count = |which: &dyn Fn(&Said) -> bool| said.iter().filter(|said| which(said)).count();
    let percent = |count: usize| 100.0 * count as f64 / runs.max(1) as f64;
    json!({
        "runs": runs,
        "kinds": KINDS.len(),
        "kinds_of_a_motor_alone": ALONE.len(),
        "kinds_of_a_feed_axis": outside_axes::COUNT,
        "sure_and_wrong": count(&|said| said.sure),
        "below_the_stated_size": count(&|said| said.is_below),
        "false_names": count(&|said| said.names > 0),
        "curves": count(&|said| said.curves > 0),
        "halved": count(&|said| said.curves > 0 && said.excess[1] < 0.5 * said.excess[0]),
        "made_worse": count(&|said| said.excess[1] > 1.05 * said.excess[0]),
        "coordinate_right_percent": percent(count(&|said| said.coordinate)),
    })
}

fn tell(name: &str, outcome: &Outcome) {
    eprintln!(
        "{name}: {}. {}",
        outcome.verdict(),
        outcome.judged().said.sentence()
    );
    for found in &outcome.effects {
        let effect = found.effect.effect();
        let (kind, place, parameters) = (
            effect.kind(),
            found.effect.place().name(),
            effect.parameters(),
        );
        let (fit, check) = (found.fall, found.check_fall);
        eprintln!("    named {kind} {place} {parameters:?}: {fit:.0}, check {check:.0}");
    }
    for curve in &outcome.curves {
        let (place, along) = (curve.effect.place().name(), &curve.along);
        eprintln!(
            "    measured {place} over {along} {:?}: {:.0}",
            curve.order, curve.fall
        );
    }
    let [before, after] = excess(outcome);
    eprintln!("    torques beyond their floor: {before:.0} -> {after:.0}");
    for left in &outcome.unexplained {
        let (channel, over) = (left.channel.name(), left.coordinate);
        let (order, hz, reason) = (left.order, left.hz, &left.reason);
        eprintln!("    left {channel} over {over} {order:?} {hz:?}: {reason}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Machines on which a part was named once. Double drives:
    /// - half a drift
    /// - a scale of the lead of 4e-7 beside a random walk
    /// - torques in time on both motors, for one force on the table
    /// - an error of the lead, for a force over the travel
    /// - a load that grows with the position, for one that steps or depends on the direction
    /// - friction that falls up to the greatest speed
    /// - friction of the screw for a drag of the nut, and of the nut for a spring
    ///
    /// Feed axes:
    /// - one whose load steps was called explained, to the difference from lap to lap
    /// - an order that grows with the speed
    /// - friction, for a drag by the cube of the speed
    ///
    /// A motor alone: a drift of the resistance, for a step.
    const NAMED_ONCE: [usize; 12] = [2, 6, 16, 18, 21, 23, 25, 47, 51, 54, 90, 93];

    /// Effects of no family that repeat in a coordinate: none gets a name or a sure verdict. Most end as a curve that halves what is beyond
    /// the floor. A torque over the speed with a bump stays unexplained: machines 1 and 3.
    #[test]
    fn what_repeats_and_has_no_name_becomes_a_curve() {
        let mut halved = Vec::new();
        for run in 0..5 {
            let said = repeating(run);
            let [before, after] = said.excess;
            assert!(
                said.names == 0 && !said.sure,
                "machine {run}: {} names, sure: {}",
                said.names,
                said.sure
            );
            assert!(
                after < 1.05 * before,
                "machine {run}: beyond the floor {before:.0} -> {after:.0}"
            );
            if said.curves > 0 && after < 0.5 * before {
                halved.push(run);
            }
        }
        assert!(
            halved.len() >= 3,
            "only {halved:?} of 5 machines have a curve that halves it"
        );
    }

    #[test]
    fn what_no_family_has_is_described_and_not_named() {
        for run in NAMED_ONCE {
            let said = said(run);
            assert!(
                said.names == 0 && !said.sure,
                "machine {run}: {} names, sure: {}; expected neither",
                said.names,
                said.sure
            );
        }
    }
}
