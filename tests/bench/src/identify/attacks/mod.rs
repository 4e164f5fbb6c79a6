//! Attacks: simulated motors in a speed loop whose friction, sensors and loads are not those of the tool's own simulators.
//! Their laws are written here from textbooks, not taken from the plant.
//!
//! Every quantity is in amperes of torque-making current: the torque constant is 1.

mod kind;
mod record;
mod shaft;

use identify::machines::motor::{MotorModel, Record, Study};
use identify::report::{Report, motor};
use kind::{KINDS, Kind};
use record::{Motion, Seen, THIN, record};
use serde::Serialize;

/// Effects are this share of the Coulomb friction.
const STRENGTH: f64 = 0.3;
/// Share of the current's rms below which a smooth effect has no name.
const SMOOTH: f64 = 0.01;

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
    let accounts = records.map(|record| record.account.clone());
    let report = motor(&study, MotorModel { pole_pairs: 4 }, accounts);
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
        let is_there = |effect: &identify::report::Effect| match effect.kind.as_str() {
            "measured" => true,
            "reported_current_lag" => kind.has_lag(effect.parameters["value"]),
            "angle_periodic" => effect.order.is_some_and(|order| kind.has_order(order)),
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
            let summary = &said_of.report.summary;
            let is_allowed_for = kind.is_late() && summary.contains("is allowed for");
            // A report that states the size of its residual claims no more than that.
            let is_noted = kind.is_noted()
                && (said_of.report.records.iter()).any(|account| !account.notes.is_empty());
            let is_said =
                is_allowed_for || is_noted || summary.contains("Nothing is missing above that.");
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
            if wrong {
                eprintln!("  {summary}");
            }
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
