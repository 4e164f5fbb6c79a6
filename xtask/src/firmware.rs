//! `cargo xtask build | emulate | cost | sizes`: the firmware, on an emulated chip, and what it takes.

use crate::program::Program;
use crate::tools::{emulator_environment, root, target_folder};
use anyhow::{Context, Result, ensure};
use clap::Args;
use std::ffi::OsString;
use std::fs::File;
use std::path::PathBuf;
use std::process::Command;

/// The target that the firmware is built for.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The target of a browser.
pub const BROWSER: &str = "wasm32-unknown-unknown";

/// What `cost` can be asked.
#[derive(Args)]
pub struct CostOptions {
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Keep the figures as the baseline that the tests hold the firmware to.
    #[arg(long)]
    keep: bool,
    /// Measure the firmware that compensates ripple: eight orders a motor, all learning.
    #[arg(long, conflicts_with = "keep")]
    smooth: bool,
}

/// What `sizes` can be asked.
#[derive(Args)]
pub struct SizesOptions {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// One build of a firmware at a time on this computer, until what is returned is dropped: all boards' ELFs leave cargo by the same
/// name.
pub fn alone() -> Result<File> {
    let folder = folder()?;
    std::fs::create_dir_all(&folder)?;
    let path = folder.join("building");
    let file = File::create(&path)?;
    file.lock()
        .with_context(|| format!("{} cannot be locked", path.display()))?;
    Ok(file)
}

/// Where cargo leaves firmwares.
pub fn folder() -> Result<PathBuf> {
    Ok(target_folder()?.join(TARGET).join("firmware"))
}

/// Builds the firmware as it is flashed and says where its ELF is.
pub fn build() -> Result<PathBuf> {
    cargo(
        &[
            "build",
            "--package",
            "firmware",
            "--profile",
            "firmware",
            "--target",
            TARGET,
        ],
        &[],
    )?;
    let elf = folder()?.join("firmware");
    println!("{}", elf.display());
    Ok(elf)
}

/// Runs the firmware on the emulated chip and prints what its interrupts cost.
pub fn cost(options: &CostOptions) -> Result<()> {
    let CostOptions { json, keep, smooth } = *options;
    let flags = [(json, "--json"), (keep, "--keep"), (smooth, "--smooth")];
    report("cost", flags)
}

/// Prints what the firmware takes of the chip's memories.
pub fn sizes(options: &SizesOptions) -> Result<()> {
    report("sizes", [(options.json, "--json")])
}

/// Runs the firmware on the emulated chip, which a debugger and a host reach.
pub fn emulate(words: Vec<OsString>) -> Result<()> {
    emulator("emulate", words)
}

/// Runs one of the emulator's programs that print figures.
fn report<const N: usize>(program: &str, flags: [(bool, &str); N]) -> Result<()> {
    let flags = flags.into_iter().filter(|(on, _)| *on);
    emulator(program, flags.map(|(_, flag)| flag.into()).collect())
}

fn emulator(program: &str, words: Vec<OsString>) -> Result<()> {
    let emulator = Program {
        build: &["--package", "tests", "--bin", program],
        environment: &emulator_environment(&target_folder()?)?,
    };
    emulator.run(words)
}

/// The identification's blind test on so many machines.
pub fn blind(machines: u32) -> Result<()> {
    let mut environment = emulator_environment(&target_folder()?)?;
    environment.push(("DDFEED_BLIND", machines.to_string().into()));
    test(&["--package", "tests", "--test", "blind"], environment)
}

/// A debugger's session with the emulated chip, one test after the other, so that each is timed alone: as `cargo xtask test` builds
/// them.
pub fn probe() -> Result<()> {
    let environment = emulator_environment(&target_folder()?)?;
    let words =
        "--workspace --exclude firmware --features ddfeed/full --test probe -- --test-threads=1";
    let words: Vec<_> = words.split(' ').collect();
    test(&words, environment)
}

/// Tests whose figures a benchmark reads. What they say belongs beside the figures, not among them.
fn test(words: &[&str], environment: Vec<(&'static str, OsString)>) -> Result<()> {
    let status = Command::new("cargo")
        .args(["test", "--quiet"])
        .args(words)
        .envs(environment)
        .current_dir(root()?)
        .stdout(std::io::stderr())
        .status()
        .context("the tests could not be started")?;
    ensure!(status.success(), "the tests failed ({status})");
    Ok(())
}

fn cargo(arguments: &[&str], environment: &[(&str, OsString)]) -> Result<()> {
    let line = format!("cargo {}", arguments.join(" "));
    eprintln!("> {line}");
    let status = Command::new("cargo")
        .args(arguments)
        .envs(environment.iter().map(|(name, value)| (name, value)))
        .current_dir(root()?)
        .status()
        .with_context(|| format!("`{line}` could not be started"))?;
    ensure!(status.success(), "`{line}` failed ({status})");
    Ok(())
}
