//! `cargo xtask build | emulate | chip | cost | sizes`: the firmware, on an emulated chip, and what it takes.

use crate::program::{COMPILES, Program};
use crate::tools::{emulator_environment, root, target_folder};
use anyhow::{Context, Result, bail, ensure};
use clap::{Args, ValueEnum};
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

/// A board that the firmware is built for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// A NUCLEO-G474RE and two BOOSTXL-DRV8323RH.
    #[default]
    Nucleo,
    /// The paper's motors on 310 V.
    Mains,
}

/// Which firmware is built.
#[derive(Args, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Build {
    /// The board.
    #[arg(long, value_enum, default_value_t)]
    pub board: Board,
    /// PWM rate, kHz: both current loops run at it. 20, or 40 on the nucleo board; the speed task keeps its 5 kHz.
    #[arg(long, value_name = "KHZ", default_value_t = 20)]
    pub pwm_khz: u32,
}

impl Build {
    /// Cargo's words for it.
    ///
    /// # Errors
    /// The board does not run at that rate.
    pub fn features(self) -> Result<&'static [&'static str]> {
        Ok(match (self.board, self.pwm_khz) {
            (Board::Nucleo, 20) => &[],
            (Board::Nucleo, 40) => &["--no-default-features", "--features", "pwm-40khz"],
            (Board::Mains, 20) => &["--no-default-features", "--features", "board-mains"],
            (Board::Nucleo, other) => bail!(
                "--pwm-khz is {other}, but the nucleo board runs at 20 or 40 kHz: at 80 kHz the longest ways of both current loops do not fit a period"
            ),
            (Board::Mains, other) => bail!(
                "--pwm-khz is {other}, but the mains board runs at 20 kHz: its plate is made for no other rate"
            ),
        })
    }
}

/// Builds a firmware as it is flashed and says where its ELF is.
pub fn build(which: Build) -> Result<PathBuf> {
    let of_chip = [
        "build",
        "--package",
        "firmware",
        "--profile",
        "firmware",
        "--target",
        TARGET,
    ];
    cargo(&[&of_chip, which.features()?].concat(), &[])?;
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

/// Which tests of the emulated chip run.
#[derive(Args)]
pub struct ChipOptions {
    /// A part of the names of tests, and options of a test's program: `same_bits`, `--ignored two_hundred`. Without any, all tests run.
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "FILTER"
    )]
    pub words: Vec<OsString>,
}

/// The tests of the firmware on the emulated chip.
pub fn chip(ChipOptions { words }: &ChipOptions) -> Result<()> {
    eprintln!("{COMPILES}");
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    let mut arguments = vec!["test", "--package", "tests", "--test", "chip", "--"];
    arguments.extend(words.iter().map(|word| &**word));
    cargo(&arguments, &emulator_environment(&target_folder()?)?)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_a_board_does_not_run_at_is_refused() {
        for (board, pwm_khz, runs) in [
            (Board::Nucleo, 20, true),
            (Board::Nucleo, 40, true),
            (Board::Nucleo, 80, false),
            (Board::Mains, 20, true),
            (Board::Mains, 40, false),
        ] {
            let features = Build { board, pwm_khz }.features();
            assert_eq!(features.is_ok(), runs, "{board:?} at {pwm_khz} kHz");
        }
    }
}
