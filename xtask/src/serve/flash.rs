//! The flash of a simulated drive, as a file.

use crate::output::Folder;
use anyhow::{Context, Result, ensure};
use hal_sim::flash::{PAGE, SimulatedFlash};
use hal_sim::served::SimulatedDrive;
use link::server::Served;
use link::settings::Settings;
use link::settings::store::Store;
use std::fs;
use std::path::{Path, PathBuf};

/// Pages of the flash that are the settings': as many erases as all of them bear are as many saves.
const PAGES: usize = 4;

/// The settings' pages.
pub struct Flash {
    store: Store<SimulatedFlash>,
    stored: Settings,
    path: PathBuf,
}

impl Flash {
    /// The flash in the file `path`; what it holds, `drive` is set to.
    pub fn open(path: &Path, drive: &mut SimulatedDrive) -> Result<Self> {
        let flash = if path.exists() {
            let bytes =
                fs::read(path).with_context(|| format!("{} cannot be read", path.display()))?;
            ensure!(
                bytes.len() == PAGES * PAGE,
                "{} has {} bytes, but a flash of settings has {}: name another file",
                path.display(),
                bytes.len(),
                PAGES * PAGE
            );
            SimulatedFlash::of_bytes(&bytes)
        } else {
            SimulatedFlash::new(PAGES, 0)
        };
        let (store, loaded) = Store::open(flash);
        if let Some(loaded) = loaded {
            drive
                .configure(&loaded.settings)
                .with_context(|| format!("what {} holds", path.display()))?;
            if loaded.unknown + loaded.refused > 0 {
                eprintln!(
                    "{}: {} settings of another version are left out, {} are beyond their ranges and have their defaults",
                    path.display(),
                    loaded.unknown,
                    loaded.refused
                );
            }
        }
        Ok(Self {
            store,
            stored: *drive.settings(),
            path: path.to_owned(),
        })
    }

    /// Stores what the drive is set to, if that has changed.
    pub fn keep(&mut self, drive: &SimulatedDrive) -> Result<()> {
        if *drive.settings() == self.stored {
            return Ok(());
        }
        self.store.save(drive.settings())?;
        self.stored = *drive.settings();
        let name = self.path.file_name().and_then(|name| name.to_str());
        let name = name.with_context(|| format!("{} is no file", self.path.display()))?;
        let folder = match self.path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let bytes = self.store.flash().bytes();
        Folder::open(folder)?.put(name, |path| Ok(fs::write(path, bytes)?))
    }
}
