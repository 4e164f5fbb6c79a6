//! Builds that hold no path of this computer.

use crate::checkout::Checkout;
use anyhow::{Context, Result, ensure};
use browser::Page;
use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::firmware::{BROWSER, TARGET};

/// A firmware of the release.
#[derive(Clone, Copy)]
pub struct Firmware {
    /// Its name in the archive.
    pub file: &'static str,
    features: &'static [&'static str],
}

/// Each board at each of its PWM rates.
pub const FIRMWARES: [Firmware; 3] = [
    Firmware {
        file: "nucleo-20khz.elf",
        features: &[],
    },
    Firmware {
        file: "nucleo-40khz.elf",
        features: &["--no-default-features", "--features", "pwm-40khz"],
    },
    Firmware {
        file: "mains-20khz.elf",
        features: &["--no-default-features", "--features", "board-mains"],
    },
];

/// This computer's target.
///
/// # Errors
/// There is no compiler.
pub fn host() -> Result<String> {
    let said = output(Path::new("rustc"), &["--version", "--verbose"])?;
    let host = said.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc does not name its host")?.to_owned())
}

/// Builds the program with all features.
///
/// # Errors
/// The build fails.
pub fn program(checkout: &Checkout, target: &Path) -> Result<PathBuf> {
    let host = host()?;
    let strip = "profile.release.strip=\"debuginfo\"";
    let words = [
        "--package",
        "ddfeed",
        "--features",
        "full",
        "--release",
        "--config",
        strip,
    ];
    build(checkout, target, &host, &words)?;
    Ok(target.join(host).join("release/ddfeed"))
}

/// Builds a firmware, with all that a debugger reads.
///
/// # Errors
/// The build fails.
pub fn firmware(checkout: &Checkout, target: &Path, firmware: Firmware) -> Result<PathBuf> {
    let words = [
        &["--package", "firmware", "--profile", "firmware"],
        firmware.features,
    ]
    .concat();
    build(checkout, target, TARGET, &words)?;
    Ok(target.join(TARGET).join("firmware/firmware"))
}

/// Builds the browser page's parts.
///
/// # Errors
/// The build fails, or Node is missing.
pub fn page(checkout: &Checkout, target: &Path) -> Result<Page> {
    let flags = flags(checkout, target, BROWSER)?;
    let time = [("SOURCE_DATE_EPOCH", checkout.time_s.to_string())];
    Page::prepare(checkout.folder.path(), target, &["--config", &flags], &time)
}

/// Flags by which no path of this computer is in a program. Cargo joins them with those that the checkout has for the chip.
fn flags(checkout: &Checkout, target: &Path, triple: &str) -> Result<String> {
    Ok(format!(
        "target.{triple}.rustflags={:?}",
        remapped(checkout, target, "--remap-path-prefix")?
    ))
}

/// A compiler's flag for each folder of this computer.
fn remapped(checkout: &Checkout, target: &Path, flag: &str) -> Result<Vec<String>> {
    let folders = [
        (checkout.folder.path().to_owned(), "ddfeed"),
        (target.to_owned(), "target"),
        (cargo_home()?, "cargo"),
    ];
    let flags = folders
        .iter()
        .map(|(from, to)| format!("{flag}={}={to}", from.display()));
    Ok(flags.collect())
}

fn build(checkout: &Checkout, target: &Path, triple: &str, words: &[&str]) -> Result<()> {
    let flags = flags(checkout, target, triple)?;
    let c_flags = remapped(checkout, target, "-ffile-prefix-map")?.join(" ");
    let status = Command::new("cargo")
        .args(["build", "--locked", "--target", triple, "--config", &flags])
        .args(words)
        .current_dir(checkout.folder.path())
        .env("CARGO_TARGET_DIR", target)
        .env("CFLAGS", c_flags)
        .env("SOURCE_DATE_EPOCH", checkout.time_s.to_string())
        // Either would take the place of the flags above.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .status()
        .context("cargo does not start: is it on the PATH?")?;
    ensure!(
        status.success(),
        "`cargo build {}` failed ({status})",
        words.join(" ")
    );
    Ok(())
}

/// Where cargo keeps the sources of libraries.
fn cargo_home() -> Result<PathBuf> {
    if let Some(home) = env::var_os("CARGO_HOME") {
        return Ok(home.into());
    }
    let home = env::home_dir().context("neither CARGO_HOME nor a home folder is set")?;
    Ok(home.join(".cargo"))
}

/// The standard output of a program.
///
/// # Errors
/// It does not start, or fails.
pub fn output(program: &Path, words: &[&str]) -> Result<String> {
    let output = Command::new(program)
        .args(words)
        .output()
        .with_context(|| format!("{} does not start", program.display()))?;
    ensure!(
        output.status.success(),
        "`{} {}` failed: {}",
        program.display(),
        words.join(" "),
        String::from_utf8_lossy(&output.stderr).trim_end()
    );
    Ok(String::from_utf8(output.stdout)?)
}
