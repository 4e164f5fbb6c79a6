//! The flash of a simulated drive, as a file.

use crate::output::Folder;
use anyhow::{Context, Result, ensure};
use hal_sim::flash::{PAGE, SimulatedFlash};
use hal_sim::served::SimulatedDrive;
use link::codes::Origin;
use link::settings::store::PAGES;
use std::fs;
use std::path::{Path, PathBuf};

/// The settings' pages.
pub struct Flash {
    kept: Vec<u8>,
    path: PathBuf,
}

impl Flash {
    /// The file `path` as the flash of `drive`, which starts with what it holds.
    pub fn open(path: &Path, drive: &mut SimulatedDrive) -> Result<Self> {
        if path.exists() {
            let bytes =
                fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
            ensure!(
                bytes.len() == PAGES * PAGE,
                "{} has {} bytes, but a flash of settings has {}: name another file",
                path.display(),
                bytes.len(),
                PAGES * PAGE
            );
            drive.put_flash(SimulatedFlash::of_bytes(&bytes))?;
            let found = drive.found();
            if found.origin == Origin::Unfit {
                eprintln!("{}: {}", path.display(), found.origin.sentence());
            }
            if found.left_out > 0 {
                eprintln!(
                    "{}: {} settings of another version or beyond their ranges are left out; the drive has its own instead",
                    path.display(),
                    found.left_out
                );
            }
        }
        Ok(Self {
            kept: drive.flash().bytes().to_vec(),
            path: path.to_owned(),
        })
    }

    /// Keeps what the drive has stored, if that has changed.
    pub fn keep(&mut self, drive: &mut SimulatedDrive) -> Result<()> {
        let bytes = drive.flash().bytes();
        if *bytes == self.kept[..] {
            return Ok(());
        }
        self.kept = bytes.to_vec();
        let name = self.path.file_name().and_then(|name| name.to_str());
        let name = name.with_context(|| format!("{} is no file", self.path.display()))?;
        let folder = match self.path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        Folder::open(folder)?.put(name, |path| Ok(fs::write(path, &self.kept)?))
    }
}
