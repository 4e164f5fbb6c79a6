//! The archive alone: unpacked elsewhere, and run without the environment of this computer's tools.

use anyhow::{Context, Result, ensure};
use flate2::read::GzDecoder;
use std::fs::File;
use std::path::Path;
use std::process::Command;

/// Commands that must work where nothing else is installed.
const COMMANDS: [&[&str]; 3] = [
    &["--version"],
    &["settings"],
    &["simulate", "--out", "report"],
];

/// Unpacks `archive`, whose files are in the folder `name`, and runs its program.
///
/// # Errors
/// A command fails.
pub fn run(archive: &Path, name: &str) -> Result<()> {
    let folder = tempfile::tempdir().context("there is no room for a trial")?;
    let packed =
        File::open(archive).with_context(|| format!("cannot read {}", archive.display()))?;
    tar::Archive::new(GzDecoder::new(packed)).unpack(folder.path())?;
    let program = folder.path().join(name).join("ddfeed");
    for words in COMMANDS {
        let output = Command::new(&program)
            .args(words)
            .env_clear()
            .current_dir(folder.path())
            .output()
            .context("the released program does not start")?;
        ensure!(
            output.status.success(),
            "the released program fails with `ddfeed {}`: {}",
            words.join(" "),
            String::from_utf8_lossy(&output.stderr).trim_end()
        );
    }
    Ok(())
}
