//! Attacks: simulated motors in a speed loop whose friction, sensors and loads are not those of the tool's own simulators.
//! Their laws are written here from textbooks, not taken from the plant.
//!
//! Every quantity is in amperes of torque-making current: the torque constant is 1.

use identify::machines::motor::{MotorModel, Record, Study};
use identify::records::DataQuality;
use identify::report::{Report, motor};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;
use std::f64::consts::TAU;

const RATE: f64 = 1000.0;
/// Steps of the simulation in a row.
const SUBSTEPS: usize = 4;
/// Effects are this share of the Coulomb friction.
const STRENGTH: f64 = 0.3;
/// Share of the current's rms below which a smooth effect has no name.
const SMOOTH: f64 = 0.01;

/// How a record moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motion {
    /// Steps between several speeds both ways, of a fit record and a check record.
    Fit,
    Check,
    /// Thin records.
    Standstill,
    Creep,
    OneSpeed,
    OneSecond,
    QuarterTurn,
}

const THIN: [Motion; 5] = [
    Motion::Standstill,
    Motion::Creep,
    Motion::OneSpeed,
    Motion::OneSecond,
    Motion::QuarterTurn,
];

impl Motion {
    fn seconds(self) -> f64 {
        match self {
            Motion::OneSecond => 1.0,
            Motion::Fit | Motion::Check => 14.0,
            _ => 8.0,
        }
    }

    /// Speed asked for, rad/s.
    fn speed(self, t: f64) -> f64 {
        let steps: &[f64] = match self {
            Motion::Fit => &[10.0, -25.0, 4.0, -12.0, 30.0, -6.0, 18.0, -19.0],
            Motion::Check => &[12.0, -20.0, 5.0, -14.0, 26.0, -5.0, 16.0, -20.0],
            Motion::Standstill => &[0.0],
            Motion::Creep => &[0.2],
            Motion::OneSpeed => &[15.0],
            Motion::OneSecond => &[10.0, -10.0],
            Motion::QuarterTurn => return 1.2 * (1.6 * t).cos(),
        };
        let hold = self.seconds() / steps.len() as f64;
        let at = ((t / hold) as usize).min(steps.len() - 1);
        // A ramp of a tenth of a second from the last speed.
        let before = if at == 0 { 0.0 } else { steps[at - 1] };
        let share = ((t - at as f64 * hold) / 0.1).min(1.0);
        before + share * (steps[at] - before)
    }
}

/// What can be there.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Clean,
    // Torques that repeat in a coordinate.
    Order(f64),
    OrderBySpeed(f64),
    Windage,
    Stribeck,
    Asymmetry,
    TightPlace,
    Dahl,
    Spring,
    // Torques that do not come again.
    RandomWalk,
    Warming,
    Step,
    Hum,
    Bursts,
    // Mechanics behind the motor.
    SoftLoad,
    Backlash,
    Gravity,
    // Measurement.
    Lag(f64),
    Delay(usize),
    GainByDirection,
    Eccentric,
    Drift,
    Clipped,
    CoarseCurrent,
    SlowNoise,
    RedNoise,
    NoisyFit,
    OtherMachine,
    Held,
    Missed,
}

/// Every kind, and whether its torque repeats in a coordinate that the records cover.
const KINDS: [(Kind, bool); 38] = [
    (Kind::Clean, false),
    (Kind::Order(12.0), true),
    (Kind::Order(1.0), true),
    (Kind::Order(2.0), true),
    (Kind::Order(3.7), true),
    (Kind::Order(7.3), true),
    (Kind::OrderBySpeed(1.0), true),
    (Kind::OrderBySpeed(3.0), true),
    (Kind::Windage, true),
    (Kind::Stribeck, true),
    (Kind::Asymmetry, true),
    (Kind::TightPlace, true),
    (Kind::Dahl, true),
    (Kind::Spring, true),
    (Kind::RandomWalk, false),
    (Kind::Warming, false),
    (Kind::Step, false),
    (Kind::Hum, false),
    (Kind::Bursts, false),
    (Kind::SoftLoad, false),
    (Kind::Backlash, false),
    (Kind::Gravity, true),
    (Kind::Lag(0.004), false),
    (Kind::Lag(0.03), false),
    (Kind::Lag(0.12), false),
    (Kind::Delay(2), false),
    (Kind::Delay(8), false),
    (Kind::GainByDirection, false),
    (Kind::Eccentric, false),
    (Kind::Drift, false),
    (Kind::Clipped, false),
    (Kind::CoarseCurrent, false),
    (Kind::SlowNoise, false),
    (Kind::RedNoise, false),
    (Kind::NoisyFit, false),
    (Kind::OtherMachine, false),
    (Kind::Held, false),
    (Kind::Missed, false),
];

/// A motor's plate, drawn.
#[derive(Clone, Copy)]
struct Plate {
    inertia: f64,
    coulomb: f64,
    width: f64,
    viscous: f64,
    noise: f64,
    counts: f64,
}

impl Plate {
    fn drawn(random: &mut Xoshiro256PlusPlus) -> Self {
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

/// A motor on its way through a record.
struct Shaft {
    kind: Kind,
    plate: Plate,
    /// The plate without a change, and the current that it takes on this way, A, mean of a row.
    plain: Plate,
    plain_current: f64,
    /// Size of the injected torque, N m.
    size: f64,
    is_check: bool,
    theta: f64,
    w: f64,
    integral: f64,
    /// States of the effects that have one.
    dahl: f64,
    walk: f64,
    load_theta: f64,
    load_w: f64,
}

impl Shaft {
    /// The current that the drive asks in a row, A.
    fn asked(&mut self, speed: f64) -> f64 {
        let error = speed - self.w;
        self.integral += error / RATE;
        let asked = 60.0 * self.plate.inertia * (error + 15.0 * self.integral);
        let most = 1.4 * self.plate.coulomb;
        match self.kind {
            Kind::Clipped => asked.clamp(-most, most),
            _ => asked,
        }
    }

    fn step(&mut self, asked: f64, t: f64) {
        let dt = 1.0 / RATE / SUBSTEPS as f64;
        let way = (self.w / self.plate.width).tanh();
        self.dahl += (self.w - self.dahl * self.w.abs() / 0.2) * dt;
        let behind = self.behind();
        self.load_w += behind / (0.5 * self.plate.inertia) * dt;
        self.load_theta += self.load_w * dt;
        let more = self.put_in(way, t);
        let torque =
            asked - self.plate.coulomb * way - self.plate.viscous * self.w - more - behind - 0.02;
        let acceleration = torque / self.plate.inertia;
        let Plate {
            inertia,
            coulomb,
            viscous,
            ..
        } = self.plain;
        self.plain_current +=
            (inertia * acceleration + coulomb * way + viscous * self.w + 0.02) / SUBSTEPS as f64;
        self.w += acceleration * dt;
        self.theta += self.w * dt;
    }

    /// Torque of a load that follows on a spring, N m.
    fn behind(&self) -> f64 {
        let twist = self.theta - self.load_theta;
        let spring = 400.0 * self.plate.inertia * 40.0;
        match self.kind {
            Kind::SoftLoad => spring * twist + 0.02 * spring / 40.0 * (self.w - self.load_w),
            Kind::Backlash => spring * (twist - twist.clamp(-0.02, 0.02)),
            _ => 0.0,
        }
    }

    /// The injected torque, N m.
    fn put_in(&self, way: f64, t: f64) -> f64 {
        let Self { size, theta, w, .. } = *self;
        match self.kind {
            Kind::Order(order) => size * (order * theta + 0.7).cos(),
            Kind::OrderBySpeed(order) => size * w / 15.0 * (order * theta).cos(),
            Kind::Windage => size * w * w.abs() / 400.0,
            Kind::Stribeck => size * way * (-(w / 6.0).powi(2)).exp(),
            Kind::Asymmetry => size * (w / 15.0).max(0.0),
            Kind::TightPlace => size * 2.0 * way * (-(theta / 3.0 - 1.0).powi(2)).exp(),
            Kind::Dahl => size * 3.0 * (self.dahl / 0.2),
            Kind::Spring => size * (theta / 6.0).tanh(),
            Kind::Gravity => size * theta.sin(),
            Kind::RandomWalk => self.walk,
            Kind::Warming => size * way * (-t / 5.0).exp() * 2.0,
            Kind::Step => size * f64::from(t > 6.2),
            Kind::Hum => size * (TAU * 13.7 * t).cos(),
            Kind::Bursts => {
                size * (TAU * 9.0 * t).sin()
                    * (TAU * 0.31 * t + f64::from(self.is_check)).sin().max(0.0)
            }
            _ => 0.0,
        }
    }
}

/// What is recorded of a way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seen {
    /// What there is.
    All,
    /// What a machine without the effect shows on the same way.
    Plain,
}

/// Records one motor.
fn record(seed: u64, motion: Motion, kind: Kind, strength: f64, what: Seen) -> Record {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut plate = Plate::drawn(&mut random);
    let plain = plate;
    let is_check = motion == Motion::Check;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5eed ^ motion as u64);
    let mut normal = move || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    if kind == Kind::OtherMachine && is_check {
        plate.inertia *= 1.5;
        plate.coulomb *= 1.0 + 2.0 * strength;
    }
    let size = strength * plate.coulomb;
    let noise = match kind {
        Kind::NoisyFit if !is_check => 10.0 * plate.noise,
        _ => plate.noise,
    };
    let count = TAU / plate.counts;
    let coarse = 0.2 * plate.coulomb;
    let mut shaft = Shaft {
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
        load_theta: 0.0,
        load_w: 0.0,
    };
    let (mut slow, mut late) = (0.0_f64, 0.0_f64);
    let mut position = Vec::new();
    let mut current: Vec<f64> = Vec::new();
    let mut asked_of: Vec<f64> = Vec::new();
    let rows = (motion.seconds() * RATE) as usize;
    for row in 0..rows {
        let t = row as f64 / RATE;
        let asked = shaft.asked(motion.speed(t));
        shaft.walk += 0.1 * size * normal() / RATE.sqrt() * 5.0;
        shaft.plain_current = 0.0;
        for _ in 0..SUBSTEPS {
            shaft.step(asked, t);
        }
        asked_of.push(asked);
        if what == Seen::Plain {
            position.push((shaft.theta / count).round() * count);
            current.push(shaft.plain_current + plain.noise * normal());
            continue;
        }
        let seen = match kind {
            Kind::Eccentric => shaft.theta + 0.02 * shaft.theta.sin(),
            _ => shaft.theta,
        };
        position.push((seen / count).round() * count);
        slow = 0.998 * slow + 0.0632 * normal();
        late += (asked - late)
            * match kind {
                Kind::Lag(tau) => 1.0 - (-1.0 / (RATE * tau)).exp(),
                _ => 1.0,
            };
        let mut reported = match kind {
            Kind::Delay(by) => asked_of[row.saturating_sub(by)],
            Kind::GainByDirection => asked * (1.0 + 0.1 * shaft.w.signum()),
            Kind::Drift => asked + size * (t / 14.0).powi(2),
            Kind::SlowNoise => asked + 0.5 * size * slow,
            _ => late,
        };
        reported += match kind {
            Kind::RedNoise => 3.0 * noise * slow + noise * normal(),
            _ => noise * normal(),
        };
        if kind == Kind::CoarseCurrent {
            reported = (reported / coarse).round() * coarse;
        }
        current.push(match kind {
            Kind::Held if row % 4 != 0 => current[row - 1],
            _ => reported,
        });
    }
    if kind == Kind::Missed && what == Seen::All {
        // The encoder loses counts: the angle jumps.
        let from = rows / 2;
        position[from..].iter_mut().for_each(|angle| *angle += 0.15);
    }
    Record {
        rate: RATE,
        position,
        current,
        account: DataQuality::default(),
    }
}

/// What was said of a pair of records.
struct Said {
    report: Report,
    /// Rms of the check residual before and after, A.
    errors: [f64; 2],
    /// Up to which frequency, Hz.
    band_hz: f64,
    /// Rms of the check record's current, A.
    signal: f64,
}

fn said(records: [&Record; 2]) -> Said {
    let study = Study::new(records[0], records[1], None);
    let errors = [&study.before, &study.curved].map(|fit| study.left_rms(fit, 1));
    let report = motor(&study, MotorModel { pole_pairs: 4 }, Default::default());
    Said {
        report,
        errors,
        band_hz: study.band_hz,
        signal: study.signal_rms(1),
    }
}

/// Rms that a pair of records leaves of the check record without a name, up to a frequency, A.
fn floor(records: &[Record; 2], hz: f64) -> f64 {
    let stretches = [0, 1].map(|k: usize| std::slice::from_ref(&records[k]));
    let study = Study::below(hz, stretches, None);
    study.left_rms(&study.before, 1)
}

/// A machine's fit and check record.
fn pair(seed: u64, kind: Kind, what: Seen) -> [Record; 2] {
    [Motion::Fit, Motion::Check].map(|motion| record(seed, motion, kind, STRENGTH, what))
}

/// Verdicts on clean machines, and how many names each has.
pub fn clean(seeds: &[u64]) -> Vec<(&'static str, usize)> {
    let of = |seed: &u64| {
        let [fit, check] = pair(*seed, Kind::Clean, Seen::All);
        let report = said([&fit, &check]).report;
        (report.verdict, report.effects.len())
    };
    seeds.iter().map(of).collect()
}

impl Said {
    fn is_sure(&self) -> bool {
        matches!(self.report.verdict, "explained" | "nothing missing")
    }

    /// Names that are not there.
    fn false_names(&self, kind: Kind) -> usize {
        let is_there = |effect: &identify::report::Effect| match (effect.kind.as_str(), kind) {
            ("measured", _) => true,
            ("reported_current_lag", Kind::Lag(tau)) => {
                (effect.parameters["value"] / tau - 1.0).abs() < 0.2
            }
            ("angle_periodic", Kind::Order(order)) => effect.order == Some(order),
            // An eccentric encoder shows the torque of its own order; a load under gravity is one.
            ("angle_periodic", Kind::Eccentric | Kind::Gravity) => effect.order == Some(1.0),
            ("angle_periodic", Kind::OrderBySpeed(order)) => effect.order == Some(order),
            _ => false,
        };
        let effects = self.report.effects.iter();
        effects.filter(|effect| !is_there(effect)).count()
    }
}

/// Counts over attacks.
#[derive(Debug, Default, Serialize)]
pub struct Attacks {
    /// Kinds that were tried.
    pub kinds: usize,
    /// Runs.
    pub runs: usize,
    /// Runs that are called explained or nothing missing and have something larger than the report says.
    pub sure_and_wrong: usize,
    /// Names that are not there.
    pub false_names: usize,
    /// Clean machines, and how many of them are called `nothing missing`, and missing something.
    pub clean: [usize; 3],
}

/// Counts over curves.
#[derive(Debug, Default, Serialize)]
pub struct Curves {
    /// Runs with an effect that repeats in a coordinate.
    pub runs: usize,
    /// Share in which the power beyond the clean machine's residual is less than half of what it was, %.
    pub halved_percent: f64,
    /// Runs whose check error rose by 5 % or more.
    pub made_worse: usize,
}

/// Counts over thin records.
#[derive(Debug, Default, Serialize)]
pub struct Thin {
    /// Runs.
    pub runs: usize,
    /// Runs that are called explained or nothing missing.
    pub sure_and_wrong: usize,
    /// Runs that say what to record.
    pub advised: usize,
}

/// Attacks every `every`th kind with `rounds` machines, from seed `first` on; a long run is watched on standard error.
pub fn attacks(first: u64, rounds: u64, every: usize) -> (Attacks, Curves) {
    let mut attacks = Attacks {
        kinds: KINDS.len().div_ceil(every.max(1)),
        ..Attacks::default()
    };
    let (mut curves, mut halved) = (Curves::default(), 0);
    for round in 0..rounds {
        let seed = first + 1000 * round;
        for (number, (kind, repeats)) in KINDS.into_iter().enumerate().step_by(every.max(1)) {
            let seed = seed + number as u64;
            let [fit, check] = pair(seed, kind, Seen::All);
            let said_of = said([&fit, &check]);
            let floor = floor(&pair(seed, kind, Seen::Plain), said_of.band_hz);
            let names = said_of.false_names(kind);
            let [before, after] = said_of.errors;
            // What is not louder than the residual of a clean machine on the same way is not there to be found.
            let is_there = before > 1.2 * floor;
            let excess = |error: f64| (error * error - floor * floor).max(0.0);
            let is_left = after > 1.2 * floor && excess(after).sqrt() > SMOOTH * said_of.signal;
            // A time between motion and current is a nuisance: said, it is not wrong.
            let summary = &said_of.report.summary;
            let is_allowed_for =
                matches!(kind, Kind::Delay(_) | Kind::Held) && summary.contains("is allowed for");
            // A report that states the size of its residual claims no more than that.
            let is_said = is_allowed_for || summary.contains("Nothing is missing above that.");
            let wrong = kind != Kind::Clean && said_of.is_sure() && is_there && is_left && !is_said;
            attacks.runs += 1;
            attacks.sure_and_wrong += usize::from(wrong);
            attacks.false_names += names;
            if kind == Kind::Clean {
                attacks.clean[0] += 1;
                attacks.clean[1] += usize::from(said_of.report.verdict == "nothing missing");
                attacks.clean[2] += usize::from(!said_of.report.effects.is_empty());
            }
            if repeats && is_there {
                curves.runs += 1;
                halved += usize::from(excess(after) < 0.5 * excess(before));
            }
            curves.made_worse += usize::from(after > 1.05 * before);
            let named: Vec<String> = said_of
                .report
                .effects
                .iter()
                .map(|effect| match &effect.curve {
                    Some(curve) => format!("[{}]", curve.coordinate),
                    None => format!("{} {:?}", effect.kind, effect.order),
                })
                .collect();
            eprintln!(
                "{seed} {kind:?}: {}{}{}; {before:.4} -> {after:.4}, clean {floor:.4} A; {}",
                said_of.report.verdict,
                if wrong { ", SURE AND WRONG" } else { "" },
                if names > 0 { ", FALSE NAME" } else { "" },
                named.join(", ")
            );
        }
    }
    curves.halved_percent = 100.0 * halved as f64 / curves.runs.max(1) as f64;
    (attacks, curves)
}

/// Thin records, `runs` of them, clean and with effects.
pub fn thin(first: u64, runs: u64) -> Thin {
    let mut thin = Thin::default();
    for run in 0..runs {
        let motion = THIN[run as usize % THIN.len()];
        let (kind, _) = KINDS[run as usize / THIN.len() % KINDS.len()];
        let seed = first + run;
        let pair = [seed, seed + 7_000_000].map(|seed| {
            let mut own = record(seed, motion, kind, STRENGTH, Seen::All);
            // One machine, two records: the noise differs.
            own.current.rotate_left((seed % 3) as usize);
            own
        });
        let said = said([&pair[0], &pair[1]]);
        let advised = said.report.summary.contains("record ");
        thin.runs += 1;
        thin.sure_and_wrong += usize::from(said.is_sure());
        thin.advised += usize::from(advised);
        if said.is_sure() || !advised {
            eprintln!(
                "thin {run} {motion:?} {kind:?}: {}: {}",
                said.report.verdict, said.report.summary
            );
        }
    }
    thin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulated_motor_follows_its_speed() {
        let own = record(3, Motion::Fit, Kind::Clean, STRENGTH, Seen::All);
        let rows = own.position.len();
        assert_eq!(rows, 14_000);
        let turned = own.position[rows - 1] - own.position[rows - 500];
        assert!(
            (turned / 0.499 / Motion::Fit.speed(13.9) - 1.0).abs() < 0.05,
            "{turned} rad"
        );
        assert!(own.current.iter().all(|current| current.abs() < 60.0));
    }
}
