//! The flash of a simulated drive, as a file.

use crate::output::Folder;
use anyhow::{Context, Result, ensure};
use application::keep::Found;
use hal_sim::flash::{PAGE, SimulatedFlash};
use hal_sim::served::SimulatedDrive;
use link::codes::Origin;
use link::settings::Setting;
use link::settings::store::PAGES;
use std::fs;
use std::path::{Path, PathBuf};

/// What a person should know of what was found in a flash, which may be erased.
fn told(found: &Found, is_erased: bool) -> Vec<String> {
    let mut sentences = Vec::new();
    let named = Setting::numbered;
    match found.origin {
        Origin::Own if !is_erased => sentences.push(
            "it holds no settings that can be read, for it was damaged or is no flash of settings; the drive runs on its own, and \
             writes over it when it is set"
                .to_owned(),
        ),
        Origin::Unfit => {
            let first = named(found.unfit).map_or_else(String::new, |setting| {
                format!(" The first of them is {setting}.")
            });
            sentences.push(format!("{}{first}", found.origin.sentence()));
        }
        _ => {}
    }
    let left_out = found.left_out;
    if let Some(setting) = named(left_out.first_refused) {
        let others = match left_out.refused {
            1 => String::new(),
            2 => ", and so is that of one more setting".to_owned(),
            count => format!(", and so are those of {} more settings", count - 1),
        };
        sentences.push(format!(
            "the stored value of {setting} is beyond its range ({} possible){others}: left out; the drive has its own instead. Set it anew",
            setting.possible()
        ));
    }
    match left_out.unknown {
        0 => {}
        1 => sentences
            .push("one stored setting is left out: this version does not have it".to_owned()),
        count => sentences.push(format!(
            "{count} stored settings are left out: this version does not have them"
        )),
    }
    sentences
}

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
            for sentence in told(&drive.found(), bytes.iter().all(|byte| *byte == 0xFF)) {
                eprintln!("{}: {sentence}", path.display());
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

#[cfg(test)]
mod tests {
    use super::*;
    use link::settings::Setting;
    use link::settings::store::Loaded;

    #[test]
    fn what_is_left_out_of_a_flash_is_named_with_what_to_do() {
        let found = |origin, left_out| Found {
            origin,
            unfit: 0,
            left_out,
        };
        let lead = Setting::named("feed.lead_mm").unwrap();
        let bad = Loaded {
            unknown: 1,
            refused: 2,
            first_refused: lead.id,
        };
        let said = told(&found(Origin::Stored, bad), false).join("\n");
        for word in [
            "feed.lead_mm",
            "0.01 to 1000 mm are possible",
            "one more setting",
            "Set it anew",
            "one stored setting is left out",
        ] {
            assert!(said.contains(word), "{said}");
        }
        let none = Loaded::default();
        assert!(told(&found(Origin::Stored, none), false).is_empty());
        assert!(told(&found(Origin::Own, none), true).is_empty());
        let said = told(&found(Origin::Own, none), false).join("\n");
        assert!(said.contains("damaged"), "{said}");
        let unfit = Found {
            unfit: lead.id,
            ..found(Origin::Unfit, none)
        };
        let said = told(&unfit, false).join("\n");
        assert!(said.contains("feed.lead_mm"), "{said}");
    }
}
