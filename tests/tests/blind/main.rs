//! The identification on machines that it has not seen, told from records of the full drive in closed loop.
//!
//! Twenty machines as a test; `DDFEED_BLIND=240 cargo test -p tests --test blind` for a long run, of
//! seeds from `DDFEED_BLIND_SEED` on, and `DDFEED_BLIND_CLEAN=200` for as many clean machines after them: one false alarm
//! in a hundred is not seen on thirty. It writes `blind.json` (what `cargo xtask bench identify` reads), `table.txt` (each
//! machine that was not told right, and why), `intervals.csv` and `confusion.svg` into the target folder's `blind`.

mod alias;
mod friction;
mod kinds;
mod light;
mod matrix;
mod oracle;
mod score;
mod strange;
mod table;

use hal_sim::parallel::on_all_cores;
use identify::analysis::analyse;
use std::path::PathBuf;
use table::{Row, Table};

/// Machines of the short run.
const SHORT: u64 = 20;
/// First seed: machines of other seeds were used while the tool was built.
const FIRST_SEED: u64 = 10_000;
/// Smallest share of right machines whose effects are above the noise floor.
const RIGHT: f64 = 0.95;
/// Smallest share of 95 % intervals that hold the truth.
const COVERED: f64 = 0.83;
/// Greatest share of false alarms on clean machines.
const FALSE_ALARMS: f64 = 0.01;

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name)
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(otherwise)
}

fn told(seed: u64, kinds: &[&str]) -> Row {
    let machine = bench::draw::draw(seed, kinds);
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    Row::new(seed, &machine, &outcome)
}

#[test]
fn unseen_machines_are_told_apart() {
    let machines = setting("DDFEED_BLIND", SHORT);
    let clean = setting("DDFEED_BLIND_CLEAN", 0);
    let first = setting("DDFEED_BLIND_SEED", FIRST_SEED);
    let seeds: Vec<u64> = (first..first + machines + clean).collect();
    let table = Table(on_all_cores(&seeds, |&seed| {
        let row = match seed - first {
            n if n < machines => told(seed, &kinds::kinds(seed)),
            _ => told(seed, &[]),
        };
        // A long run is watched.
        eprintln!("{}", row.line());
        row
    }));
    println!("{table}");

    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("../blind");
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    let write = |name: &str, text: String| {
        std::fs::write(folder.join(name), text).expect("the target folder can be written");
    };
    write("blind.json", table.json());
    write("table.txt", table.to_string());
    write("intervals.csv", table.intervals());
    write("confusion.svg", table.matrix().svg());

    let (visible, clean, covered) = (table.visible(), table.clean(), table.covered());
    // A short run holds too few machines for a share of 95 %: it may miss one.
    let missed = f64::from(visible.of - visible.right);
    assert!(
        missed <= (f64::from(visible.of) * (1.0 - RIGHT)).max(1.0),
        "{} of {} machines above the noise floor right",
        visible.right,
        visible.of
    );
    // The short run has 32 intervals: of so many that each hold the truth with a chance of 95 % fewer do so once in 220 times.
    assert!(
        f64::from(covered.right) >= COVERED * f64::from(covered.of),
        "{} of {} intervals hold the truth",
        covered.right,
        covered.of
    );
    assert!(
        f64::from(clean.of - clean.right) <= f64::from(clean.of) * FALSE_ALARMS,
        "{} false alarms on {} clean machines",
        clean.of - clean.right,
        clean.of
    );
}
