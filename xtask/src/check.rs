//! `cargo xtask check`: what can be told within a minute of a change: format, lints, documentation, and the tests of
//! control, plant and drive.

use crate::steps::{Step, prepare, run_all};
use anyhow::Result;

/// The tests of the drive that run it on drawn machines and through faults.
const DRIVE: &str = "--test alignment --test commission --test fault_matrix --test interlock --test rejection --test runaway \
                     --test scenarios --test smooth";

/// The slow ones among all of these, which the full tier has.
const SLOW: &str = "--skip of_random_pairs --skip no_cell_is_unsafe --skip an_interrupted_alignment --skip a_power_cut_at_any_moment \
                    --skip drives_from_fifty_watts --skip the_matrix_repeats --skip steady_running_with_compensation \
                    --skip after_each_fault_and_its_reset --skip friction_that_is \
                    --skip observer_and_notch_are_stable --skip ten_thousand_saves";

/// Runs the quick checks; stops at the first that fails.
pub fn run() -> Result<()> {
    prepare()?;
    run_all(&Step::formatting()?)?;
    run_all(&[
        Step::cargo("clippy --all-targets -- -D warnings"),
        Step::documentation(""),
        Step::cargo(format!(
            "test --package control --package link --package application --package plant --package hal-sim -- {SLOW}"
        )),
        Step::cargo(format!("test --package bench {DRIVE} -- {SLOW}")),
    ])?;
    println!("The quick checks passed.");
    Ok(())
}
