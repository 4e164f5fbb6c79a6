//! `cargo xtask bench align`: starts on drawn machines and on the boards' own, wrong wiring, and loads that nothing holds.

use super::{Outcome, drawn, loose, margin_nm, miswirings, of_board, switch_on, unknown};
use anyhow::Result;
use clap::Args;
use ddfeed::simulate::Bridges;
use hal_sim::boards::BoardKind;
use hal_sim::parallel::on_all_cores;
use hal_sim::start::Start;
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
#[derive(Clone, Default, Serialize)]
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
    /// Runs the starts that `of` draws from the seeds 1, 2, ...: `starts` of which friction holds the rotors, and of the
    /// others that it meets an eighth as many at most; `tell` hears of each refusal where friction holds.
    fn run(
        machine: &'static str,
        starts: usize,
        of: impl Fn(u64) -> Start,
        tell: impl Fn(String) + Copy,
    ) -> Result<Self> {
        let (mut drawn, mut held, mut loose) = (Vec::new(), 0, 0);
        for seed in 1.. {
            if held == starts {
                break;
            }
            let start = of(seed);
            let holds = margin_nm(&start) > 0.0;
            let (count, most) = match holds {
                true => (&mut held, starts),
                false => (&mut loose, starts.div_ceil(8)),
            };
            if *count < most {
                *count += 1;
                drawn.push((seed, holds, start));
            }
        }
        let outcomes = on_all_cores(&drawn, |(_, _, start)| switch_on(start));
        let mut kind = Self {
            machine,
            held: Starts::default(),
            loose: Starts::default(),
        };
        for ((seed, holds, _), outcome) in drawn.into_iter().zip(outcomes) {
            let outcome = outcome?;
            if holds {
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
    /// Drawn machines whose rotors friction holds.
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

/// How many, and how to say it.
#[derive(Args)]
pub struct AlignOptions {
    /// Starts of each kind of machine whose rotors friction holds; a machine that it does not hold comes on top.
    #[arg(long, default_value_t = 500)]
    pub starts: usize,
    /// How the bridges make their voltages.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Runs and prints.
pub fn run(options: &AlignOptions) -> Result<()> {
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
    let kinds: [(&str, &dyn Fn(u64) -> Start); 5] = [
        ("drawn", &drawn),
        ("nucleo", &|seed| of_board(BoardKind::Nucleo, seed)),
        ("mains", &|seed| of_board(BoardKind::Mains, seed)),
        ("nucleo, directions unknown, elastic friction", &|seed| {
            unknown(BoardKind::Nucleo, seed)
        }),
        ("mains, directions unknown, elastic friction", &|seed| {
            unknown(BoardKind::Mains, seed)
        }),
    ];
    for (name, start) in kinds {
        let start = |seed| {
            let mut start = start(seed);
            start.board.switching = options.bridges.switching();
            start
        };
        report
            .machines
            .push(Kind::run(name, options.starts, start, tell)?);
    }
    if let [drawn, ..] = &report.machines[..] {
        report.drawn = drawn.held.clone();
    }
    let miswired = miswirings(MISWIRED_SEED);
    let outcomes = on_all_cores(&miswired, |miswiring| {
        let mut start = miswiring.start.clone();
        start.board.switching = options.bridges.switching();
        switch_on(&start)
    });
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
        let outcome = switch_on(&loose(LOOSE_SEED + seed))?;
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
