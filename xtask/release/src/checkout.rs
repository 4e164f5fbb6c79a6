//! The committed files, in a folder of their own.

use anyhow::{Context, Result, ensure};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// The commit that a release is built from.
pub struct Commit {
    hash: String,
    /// Its time, s since 1970.
    pub time_s: u64,
}

impl Commit {
    /// The first digits of its hash.
    #[must_use]
    pub fn short(&self) -> &str {
        &self.hash[..12]
    }
}

/// Its files, without anything that is not committed.
pub struct Checkout {
    /// Their folder: outside of the clone, whose `.cargo/config.toml` would hold a second time there.
    pub folder: TempDir,
    /// See [`Commit::time_s`].
    pub time_s: u64,
}

/// The commit of the clone at `root`.
///
/// # Errors
/// It is no clone, or it has changes that are not committed.
pub fn commit(root: &Path) -> Result<Commit> {
    let changes = git(root, &["status", "--porcelain"])?;
    ensure!(
        changes.is_empty(),
        "the clone has changes, but a release is built from a commit: commit them, or put them away with `git stash`:\n{}",
        String::from_utf8_lossy(&changes).trim_end()
    );
    let line = String::from_utf8(git(root, &["log", "-1", "--format=%H %ct"])?)?;
    let (hash, time) = line.trim().split_once(' ').context("git gave no commit")?;
    Ok(Commit {
        hash: hash.to_owned(),
        time_s: time.parse().context("git gave no time of the commit")?,
    })
}

impl Checkout {
    /// Exports `commit` into a new folder.
    ///
    /// # Errors
    /// Git fails, or the folder cannot be written.
    pub fn export(root: &Path, commit: &Commit) -> Result<Self> {
        let folder = tempfile::tempdir().context("there is no room for the committed files")?;
        let files = git(root, &["archive", "--format=tar", &commit.hash])?;
        tar::Archive::new(&files[..])
            .unpack(folder.path())
            .with_context(|| {
                format!(
                    "cannot write the committed files into {}",
                    folder.path().display()
                )
            })?;
        Ok(Self {
            folder,
            time_s: commit.time_s,
        })
    }
}

fn git(root: &Path, words: &[&str]) -> Result<Vec<u8>> {
    let output = Command::new("git")
        .arg("-C")
        .arg(root)
        .args(words)
        .output()
        .context("git does not start: is it on the PATH?")?;
    ensure!(
        output.status.success(),
        "`git {}` failed in {}: {}",
        words.join(" "),
        root.display(),
        String::from_utf8_lossy(&output.stderr).trim_end()
    );
    Ok(output.stdout)
}
