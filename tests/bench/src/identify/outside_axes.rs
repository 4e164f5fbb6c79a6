//! What no family has, on feed axes: further forces on the carriage in closed loop, lap after lap.

use super::outside::{Memory, Said};
use identify::machines::feed_axis::{Axis, Law, Moment, Record, Study};
use identify::records::DataQuality;
use identify::report;
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

/// One kind: its name, the coordinates that a description of it may name, and its force against the motion's positive
/// direction, N.
struct Kind {
    name: &'static str,
    coordinates: &'static [&'static str],
    force: fn(&Moment, &Memory) -> f64,
}

const RATE: f64 = 1000.0;
/// Turns a second of a lap's strokes on either record, and how long one is, s.
const STROKES: [[f64; 6]; 2] = [
    [8.0, -12.0, 12.0, -8.0, 3.0, -3.0],
    [10.0, -5.0, 5.0, -10.0, 2.0, -2.0],
];
const STROKE_S: f64 = 1.0;
/// Share of a stroke in which it comes to its speed, and to rest.
const RAMP: f64 = 0.15;
/// Standard deviation of the measured force's noise, V.
const NOISE_V: f64 = 0.02;

/// How often a force acts, s: four times a row.
const STEP_S: f64 = 0.25 / RATE;

fn way(m: &Moment) -> f64 {
    (m.velocity_m_s / 1e-3).tanh()
}

/// Every kind.
const KINDS: &[Kind] = &[
    Kind {
        name: "force in time",
        coordinates: &["time"],
        force: |m, _| 6.0 * (TAU * 3.1 * m.time_s).cos(),
    },
    Kind {
        name: "load that steps",
        coordinates: &["time"],
        force: |m, _| 8.0 * f64::from(m.time_s > 5.3),
    },
    Kind {
        name: "tight place of the guideway",
        coordinates: &["position, against the motion", "position"],
        force: |m, _| {
            let inside = ((m.position_m - 4e-3) / 5e-3).clamp(0.0, 1.0);
            12.0 * (PI * inside).sin().powi(2) * way(m)
        },
    },
    Kind {
        name: "guideway that runs dry",
        coordinates: &["time"],
        force: |m, _| 8.0 * m.time_s / 12.0 * way(m),
    },
    Kind {
        name: "hump of the load",
        coordinates: &["position", "position, against the motion"],
        force: |m, _| 10.0 * (-((m.position_m - 8e-3) / 2e-3).powi(2)).exp(),
    },
    Kind {
        name: "order that grows with speed",
        coordinates: &["angle of the screw", "time"],
        force: |m, _| {
            let turn = TAU * m.position_m / 2.5e-3;
            8.0 * (m.velocity_m_s / 0.025).powi(2) * (3.0 * turn).cos()
        },
    },
    Kind {
        name: "knocks at random",
        coordinates: &["none", "time"],
        force: |_, x| {
            if x.noise() > 0.9995 {
                x.state[0].set(60.0 * x.noise().signum());
            }
            x.state[0].set(x.state[0].get() * 0.95);
            x.state[0].get()
        },
    },
    Kind {
        name: "random walk of the force",
        coordinates: &["none", "time"],
        force: |_, x| {
            let walk = x.state[0].get() * (1.0 - STEP_S / 2.0) + 0.12 * x.noise();
            x.state[0].set(walk);
            walk
        },
    },
    Kind {
        name: "drag by the cube of the speed",
        coordinates: &["velocity"],
        force: |m, _| 12.0 * (m.velocity_m_s / 0.025).powi(3),
    },
    Kind {
        name: "swinging load",
        coordinates: &["none", "time"],
        force: |m, x| {
            let (mass, w) = (25.0, TAU * 9.0);
            let [at, speed] = [0, 1].map(|k: usize| x.state[k].get());
            let force = mass * (w * w * (m.position_m - at) + 0.06 * w * (m.velocity_m_s - speed));
            let speed = speed + force / mass * STEP_S;
            x.state[1].set(speed);
            x.state[0].set(at + speed * STEP_S);
            force
        },
    },
    Kind {
        name: "hum that comes and goes at random",
        coordinates: &["time", "none"],
        force: |m, x| {
            let swell = x.state[0].get() * (1.0 - STEP_S) + 0.06 * x.noise();
            x.state[0].set(swell);
            4.0 * swell * (TAU * 31.0 * m.time_s).cos()
        },
    },
    Kind {
        name: "drive gain that falls with the force",
        coordinates: &["none", "velocity"],
        force: |m, _| 0.15 * m.force_n * (m.force_n / 60.0).powi(2).min(1.0),
    },
    Kind {
        name: "brake that drags for a while",
        coordinates: &["time"],
        force: |m, _| 8.0 * f64::from((3.0..6.5).contains(&m.time_s)) * way(m),
    },
];

/// How many kinds there are.
pub(super) const COUNT: usize = KINDS.len();

/// Two laps of a programme and a half.
fn reference(axis: &Axis, strokes: [f64; 6]) -> Vec<f64> {
    let mut at = 0.0;
    let rows = (2.5 * STROKE_S * RATE) as usize * strokes.len();
    (0..rows)
        .map(|row| {
            let t = row as f64 / RATE / STROKE_S;
            let within = t.fract();
            let share = (within.min(1.0 - within) / RAMP).min(1.0);
            at += axis.lead_m * strokes[t as usize % strokes.len()] * share / RATE;
            at
        })
        .collect()
}

fn record(axis: &Axis, kind: &Kind, seed: u64, strength: f64, strokes: [f64; 6]) -> Record {
    let memory = Memory {
        random: Cell::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
        ..Memory::default()
    };
    let mut record = Record::to_follow(reference(axis, strokes), RATE);
    let run = axis.simulate_under(&record, |moment| strength * (kind.force)(moment, &memory));
    // Of even numbers the standard deviation is the root of a third.
    let noise = || 3f64.sqrt() * NOISE_V * memory.noise();
    let volts = run.force.iter().map(|force| force / record.force_per_volt);
    record.output = volts.map(|u| u + noise()).collect();
    record.position = run.position;
    record
}

/// Runs one axis.
pub(super) fn said(case: usize, run: usize, strength: f64) -> Said {
    let kind = &KINDS[case];
    let mut axis = Axis {
        law: Law::Difference(2),
        ..Axis::published()
    };
    let seed = 900 + 2 * run as u64;
    let drawn = Memory {
        random: Cell::new(seed | 1),
        ..Memory::default()
    };
    axis.base = axis.base.map(|value| value * (1.0 + 0.15 * drawn.noise()));
    let [fit, check] =
        [0, 1].map(|k: usize| record(&axis, kind, seed + k as u64, strength, STROKES[k]));
    let study = Study::new(&Axis::published(), &fit, &check);
    let report = report::feed_axis(
        &study,
        &fit,
        [DataQuality::default(), DataQuality::default()],
    );
    eprintln!(
        "{run}, feed axis, {}: {}. {}",
        kind.name, report.verdict, report.summary
    );
    for effect in &report.effects {
        eprintln!("    named {} {:?}", effect.kind, effect.parameters);
    }
    for left in &report.unexplained {
        let (order, hz, size) = (left.order, left.hz, left.size);
        eprintln!(
            "    left {} over {} {order:?} {hz:?} {size:.2}: {}",
            left.channel, left.coordinate, left.reason
        );
    }
    Said {
        sure: matches!(report.verdict, "explained" | "nothing missing"),
        is_below: false,
        names: report.effects.len(),
        excess: [0.0; 2],
        curves: 0,
        coordinate: (report.unexplained.first())
            .is_some_and(|left| kind.coordinates.contains(&left.coordinate.as_str())),
    }
}
