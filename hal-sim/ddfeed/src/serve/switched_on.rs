//! A simulated drive as it is switched on: its machine, its settings, its flash.

use super::ServeOptions;
use super::flash::Flash;
use crate::simulate::Preset;
use anyhow::{Context, Result};
use hal_sim::experiment::Setup;
use hal_sim::served::SimulatedDrive;
use hal_sim::start::Start;

/// The drive that the options describe.
pub struct SwitchedOn {
    /// Machine and board.
    pub setup: Setup,
    /// The machine's name.
    pub name: String,
    /// The drive.
    pub drive: SimulatedDrive,
    /// The file of its flash, if it has one.
    pub flash: Option<Flash>,
}

impl SwitchedOn {
    /// # Errors
    /// No such machine, or settings or a flash that are not taken.
    pub fn new(options: &ServeOptions) -> Result<Self> {
        let (setup, name) = options.machine.setup(Preset::Coupled)?;
        let mut drive = if options.cold {
            SimulatedDrive::cold(&Start::anywhere(&setup))
        } else {
            SimulatedDrive::new(&setup)
        }
        .with_context(|| format!("no drive can be configured for the machine {name}"))?;
        if let Some(path) = &options.settings {
            let text = std::fs::read_to_string(path)
                .with_context(|| format!("{} cannot be read", path.display()))?;
            let settings = link::host::settings::of_toml(drive.settings(), &text)
                .with_context(|| format!("{} is not taken", path.display()))?;
            drive.configure(&settings)?;
        }
        let flash = match &options.flash {
            Some(path) => Some(Flash::open(path, &mut drive)?),
            None => None,
        };
        Ok(Self {
            setup,
            name,
            drive,
            flash,
        })
    }
}
