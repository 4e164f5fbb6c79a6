//! Which settings a drive runs on: those that its store holds, if they fit it, or its own.
//!
//! The firmware and the simulated drive do it by this code. A change that needs a restart is stored. Another holds in RAM, until it is
//! stored by a command of its own.

use crate::server::NotSet;
use embedded_storage::nor_flash::NorFlash;
use link::codes::Origin;
use link::message::Refusal;
use link::settings::store::{Loaded, Store};
use link::settings::{Settings, Unfit};

/// The settings that a drive runs on, and the store that they come from.
#[derive(Clone, Debug)]
pub struct Keeper<F> {
    store: Store<F>,
    settings: Settings,
    found: Found,
}

/// What a drive found in its store when it started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// Which settings it runs on.
    pub origin: Origin,
    /// Number of the stored setting that does not fit; 0: none, or none by itself.
    pub unfit: u16,
    /// Stored settings that are left out: the drive has its own instead.
    pub left_out: Loaded,
}

impl Found {
    const NOTHING: Self = Self {
        origin: Origin::Own,
        unfit: 0,
        left_out: Loaded {
            unknown: 0,
            refused: 0,
            first_refused: 0,
        },
    };
}

impl<F: NorFlash> Keeper<F> {
    /// Of a drive with its `own` settings, which has not [taken up](Keeper::take_up) what the flash holds.
    pub fn new(flash: F, own: Settings) -> Self {
        Self {
            store: Store::open(flash),
            settings: own,
            found: Found::NOTHING,
        }
    }

    /// At the start of a drive: takes up the settings that are stored, if there are some that can be read and that fit it. Otherwise it
    /// runs on its `own`.
    pub fn take_up(
        &mut self,
        own: impl Fn() -> Settings,
        fits: impl FnOnce(&Settings) -> Result<(), NotSet>,
    ) {
        let Some(left_out) = self.store.load(&mut self.settings) else {
            self.settings = own();
            return;
        };
        self.found.left_out = left_out;
        match fits(&self.settings) {
            Ok(()) => self.found.origin = Origin::Stored,
            Err(error) => {
                self.found.origin = Origin::Unfit;
                self.found.unfit = error.setting();
                self.settings = own();
            }
        }
    }

    /// Those that it runs on.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What it found in its store.
    pub const fn found(&self) -> Found {
        self.found
    }

    /// The drive runs on these settings, which fit, from now on. The store keeps what it has.
    pub fn change(&mut self, settings: &Settings) {
        if *settings != self.settings {
            self.settings = *settings;
            self.found.origin = Origin::Changed;
        }
    }

    /// Stores settings that fit: those that the drive runs on, or those of its next start.
    ///
    /// # Errors
    /// [`NotSet`]; nothing is changed then.
    pub fn store(&mut self, settings: &Settings) -> Result<(), NotSet> {
        // A flash wears with each writing.
        if self.found.origin == Origin::Stored
            && self.found.left_out == Loaded::default()
            && *settings == self.settings
        {
            return Ok(());
        }
        self.store
            .save(settings)
            .map_err(|_| NotSet::Refused(Refusal::NotStored))?;
        if *settings == self.settings {
            self.found = Found {
                origin: Origin::Stored,
                ..Found::NOTHING
            };
        }
        Ok(())
    }

    /// The flash.
    pub fn flash(&mut self) -> &mut F {
        self.store.flash()
    }

    /// The flash, to restart with.
    pub fn release(self) -> F {
        self.store.release()
    }
}

impl NotSet {
    /// Number of the setting that does not fit; 0: none by itself.
    fn setting(&self) -> u16 {
        match self {
            Self::Unfit(Unfit {
                setting: Some((setting, _)),
                ..
            }) => setting.id,
            _ => 0,
        }
    }
}
