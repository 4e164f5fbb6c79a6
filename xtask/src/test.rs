//! `cargo xtask test`: everything that must hold, in the order in which it fails fastest.

use crate::steps::{Step, prepare, run_all};
use anyhow::Result;
use xtask::firmware::{BROWSER, Board, Build, TARGET};
use xtask::tools::{
    browser_tools, cross_compiler, emulator_environment, mcap_reader, target_folder,
};

/// All that runs on this computer, in one go with all features, so that no library is built twice.
const HOST: &str = "--workspace --exclude firmware --features ddfeed/full";

/// Runs all checks; stops at the first that fails.
pub fn run() -> Result<()> {
    prepare()?;
    run_all(&Step::formatting()?)?;
    cross_compiler();
    let target = target_folder()?;
    mcap_reader(&target);
    let emulator = emulator_environment(&target)?;
    let firmware = format!("--package firmware --profile firmware --target {TARGET}");
    let mains = "--no-default-features --features board-mains";
    run_all(&[
        Step::cargo(format!("clippy {HOST} --all-targets -- -D warnings")).with(&emulator),
        // As it is built by default. Without its default features the browser page has it.
        Step::cargo("clippy --package ddfeed -- -D warnings"),
        Step::documentation(HOST).with(&emulator),
        // Both boards; the default one last, whose ELF is the one that is flashed.
        Step::cargo(format!("clippy {firmware} {mains} -- -D warnings")),
        Step::cargo(format!("clippy {firmware} -- -D warnings")),
        Step::documentation(&firmware),
    ])?;
    xtask::firmware::build(Build {
        board: Board::Nucleo,
        pwm_khz: 20,
    })?;
    run_all(&[Step::cargo(format!("test {HOST}")).with(&emulator)])?;
    if browser_tools() {
        // As the tests built all that is under it.
        run_all(&[Step::cargo(format!("build {HOST} --bin browser")).with(&emulator)])?;
        let built = |name: &str| target.join("debug").join(name).into_os_string();
        run_all(&[
            Step::program(built("browser"), "--check --test").with(&[("DDFEED", built("ddfeed"))])
        ])?;
    } else {
        run_all(&[Step::cargo(format!(
            "check --package scope --lib --target {BROWSER}"
        ))])?;
    }
    println!("All checks passed.");
    Ok(())
}
