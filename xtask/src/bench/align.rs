//! `cargo xtask bench align`: starts on drawn machines and on the boards' own, wrong wiring, and loads that nothing holds.

use super::AlignOptions;
use anyhow::Result;
use hal_sim::alignment::{Outcome, Start, miswirings};
use hal_sim::boards::BoardKind;
use hal_sim::parallel::on_all_cores;
use serde::Serialize;

/// Largest error of the electrical angle, degrees.
const ERROR_GOAL_DEG: f64 = 2.0;
/// Furthest that the table may move, um.
const TRAVEL_GOAL_UM: f64 = 50.0;
/// Starts with a load that friction does not hold.
const LOOSE: u64 = 12;
/// Seeds of what is wired wrongly and of loose loads.
const MISWIRED_SEED: u64 = 1_000_000;
const LOOSE_SEED: u64 = 2_000_000;

/// Starts of one kind of machine.
#[derive(Default, Serialize)]
struct Starts {
    starts: usize,
    aligned: usize,
    error_deg_worst: f64,
    travel_um_worst: f64,
    torque_nm_worst: f64,
    seconds_worst: f64,
}

impl Starts {
    fn add(&mut self, outcome: &Outcome) {
        self.starts += 1;
        self.travel_um_worst = self.travel_um_worst.max(outcome.travel_m * 1e6);
        self.torque_nm_worst = self.torque_nm_worst.max(outcome.torque_nm);
        self.seconds_worst = self.seconds_worst.max(outcome.seconds);
        if outcome.is_ready() {
            self.aligned += 1;
            self.error_deg_worst = self.error_deg_worst.max(outcome.error_deg_worst());
        }
    }

    fn and(&self, other: &Self) -> Self {
        Self {
            starts: self.starts + other.starts,
            aligned: self.aligned + other.aligned,
            error_deg_worst: self.error_deg_worst.max(other.error_deg_worst),
            travel_um_worst: self.travel_um_worst.max(other.travel_um_worst),
            torque_nm_worst: self.torque_nm_worst.max(other.torque_nm_worst),
            seconds_worst: self.seconds_worst.max(other.seconds_worst),
        }
    }

    fn sentence(&self) -> String {
        format!(
            "{} of {} starts aligned, the worst {:.2} degrees off (goal {ERROR_GOAL_DEG}); the table moved by at most {:.1} um \
             (goal {TRAVEL_GOAL_UM}), currents made at most {:.3} N m; {:.2} s at most",
            self.aligned,
            self.starts,
            self.error_deg_worst,
            self.travel_um_worst,
            self.torque_nm_worst,
            self.seconds_worst
        )
    }
}

/// Starts of machines of a kind: those whose rotors friction holds at every angle, and the others.
#[derive(Serialize)]
struct Kind {
    machine: &'static str,
    held: Starts,
    loose: Starts,
}

impl Kind {
    /// Runs the starts that `of` draws from the seeds; `tell` hears of each refusal where friction holds.
    fn run(
        machine: &'static str,
        seeds: &[u64],
        of: impl Fn(u64) -> Start + Sync,
        tell: impl Fn(String) + Copy,
    ) -> Result<Self> {
        let outcomes = on_all_cores(seeds, |&seed| {
            let start = of(seed);
            start.run().map(|outcome| (start.margin_nm(), outcome))
        });
        let mut kind = Self {
            machine,
            held: Starts::default(),
            loose: Starts::default(),
        };
        for (seed, outcome) in seeds.iter().zip(outcomes) {
            let (margin_nm, outcome) = outcome?;
            if margin_nm > 0.0 {
                if !outcome.is_ready() {
                    tell(format!(
                        "{machine}, start {seed} refused: {}",
                        said(&outcome)
                    ));
                }
                kind.held.add(&outcome);
            } else {
                kind.loose.add(&outcome);
            }
        }
        Ok(kind)
    }
}

#[derive(Serialize)]
struct Report {
    /// All drawn machines.
    #[serde(flatten)]
    drawn: Starts,
    machines: Vec<Kind>,
    miswirings: usize,
    named: usize,
    miswired_travel_um_worst: f64,
    miswired_torque_nm_worst: f64,
    loose: u64,
    loose_refused: u64,
}

/// What a drive says of an outcome.
fn said(outcome: &Outcome) -> String {
    match outcome.misalignment {
        Some(found) => {
            format!("{:?}: {}", found.part, found.reason.name())
        }
        None => format!("{:?}", outcome.state),
    }
}

/// Runs and prints.
pub(super) fn run(options: &AlignOptions) -> Result<()> {
    let mut report = Report {
        drawn: Starts::default(),
        machines: Vec::new(),
        miswirings: 0,
        named: 0,
        miswired_travel_um_worst: 0.0,
        miswired_torque_nm_worst: 0.0,
        loose: LOOSE,
        loose_refused: 0,
    };
    let tell = |sentence: String| {
        if !options.json {
            println!("{sentence}");
        }
    };
    let seeds: Vec<u64> = (1..=options.starts).collect();
    let board = |kind| move |seed| Start::of_board(kind, seed);
    report.machines = vec![
        Kind::run("drawn", &seeds, Start::drawn, tell)?,
        Kind::run("nucleo", &seeds, board(BoardKind::Nucleo), tell)?,
        Kind::run("mains", &seeds, board(BoardKind::Mains), tell)?,
    ];
    if let [drawn, ..] = &report.machines[..] {
        report.drawn = drawn.held.and(&drawn.loose);
    }
    let miswired = miswirings(MISWIRED_SEED);
    let outcomes = on_all_cores(&miswired, |miswiring| miswiring.start.run());
    for (miswiring, outcome) in miswired.iter().zip(outcomes) {
        let outcome = outcome?;
        report.miswirings += 1;
        let right = match miswiring.expected {
            Some(expected) => outcome.misalignment == Some(expected),
            None => outcome.is_ready() && outcome.error_deg_worst() < ERROR_GOAL_DEG,
        };
        report.named += usize::from(right);
        report.miswired_travel_um_worst =
            report.miswired_travel_um_worst.max(outcome.travel_m * 1e6);
        report.miswired_torque_nm_worst = report.miswired_torque_nm_worst.max(outcome.torque_nm);
        let mark = if right { ' ' } else { '!' };
        tell(format!("{mark} {:<48} {}", miswiring.name, said(&outcome)));
    }
    for seed in 0..LOOSE {
        let outcome = Start::loose(LOOSE_SEED + seed).run()?;
        report.loose_refused += u64::from(outcome.misalignment.is_some());
    }
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    println!();
    for kind in &report.machines {
        println!(
            "{}, friction holds the rotors at every angle: {}",
            kind.machine,
            kind.held.sentence()
        );
        println!("{}, it does not: {}", kind.machine, kind.loose.sentence());
    }
    println!(
        "{} of {} miswirings named or harmless as expected, within {:.1} um and {:.3} N m; {} of {} loose loads refused",
        report.named,
        report.miswirings,
        report.miswired_travel_um_worst,
        report.miswired_torque_nm_worst,
        report.loose_refused,
        report.loose
    );
    Ok(())
}
