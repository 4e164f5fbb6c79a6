//! The drive's configuration, in RAM: the board's own, until the start has put another in its place.
//!
//! Settings that change without a restart make a whole configuration in a [`Change`]. It takes the place of the old one while the tasks that
//! read it are held off, so that none sees a part of a change. The current loops have a copy of what they read, which changes with a
//! restart only.

use crate::board;
use crate::hw::encoder::InputFilter;
use crate::hw::flash::SettingsPages;
use application::configured::{CommandWords, Configured};
use application::exchange::DriveExchange;
use application::keep::Keeper;
use application::server::NotSet;
use control::guard::GuardPlate;
use control::plate::{DriveConfig, DrivePlate};
use control::scale_watch::ScaleWatchPlate;
use control::speed_task::SpeedTask;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use link::codes::Origin;
use link::message::Refusal;
use link::settings::{EncoderInterface, Setting, Settings, Unfit};
use link::telemetry::Header;

/// The board's own settings; with the feature `smooth` the drive learns the ripple that motors, encoders and lead usually have.
const OWN: Settings = if cfg!(feature = "smooth") {
    board::SETTINGS.smooth()
} else {
    board::SETTINGS
};

/// The plate that they make.
pub(crate) const PLATE: DrivePlate = OWN.plate(&board::PLATE.board);

/// Of the board's own plate, computed while compiling: a number that does not fit its format stops the build.
pub(crate) const BOARD: Configured = Configured {
    plate: PLATE,
    drive: match PLATE.config() {
        Ok(config) if cfg!(feature = "encoders-at-zero") => config.aligned(&PLATE),
        Ok(config) => config,
        Err(_) => {
            panic!("a number of the board's plate does not fit its fixed-point format")
        }
    },
    guard: board::GUARD,
    header: Header::of_plate(&PLATE),
    travel: PLATE.travel_config(),
    words: CommandWords::new(&PLATE),
};

/// The words to and from the speed task, its state and what it is configured with, side by side, so that one address in a register
/// serves for all.
#[repr(C)]
struct Held {
    words: DriveExchange,
    task: UnsafeCell<MaybeUninit<SpeedTask>>,
    configured: UnsafeCell<Configured>,
}

// SAFETY: `take_up` writes what is configured before anybody else reads it, and `Change` while nobody does. The task's state is its
// task's alone.
unsafe impl Sync for Held {}

/// A static, for its address is a constant to the speed task. By a reference that RTIC holds that task takes 28 cycles more; what is
/// `Shared` by value would be copied with the timers running.
static HELD: Held = Held {
    words: DriveExchange::new(),
    task: UnsafeCell::new(MaybeUninit::uninit()),
    configured: UnsafeCell::new(BOARD),
};

/// The words between the application's parts.
#[inline(always)]
pub(crate) fn words() -> &'static DriveExchange {
    &HELD.words
}

/// Where the speed task's state lies.
///
/// # Safety
/// For the speed task alone, which may not have it twice at a time.
#[inline(always)]
pub(crate) unsafe fn task() -> &'static mut MaybeUninit<SpeedTask> {
    // SAFETY: as is asked of the caller.
    unsafe { &mut *HELD.task.get() }
}

/// What the drive runs on, for one step of a task: see [`Change::take_up`].
#[inline(always)]
pub(crate) fn configured() -> &'static Configured {
    // SAFETY: nobody writes it during a step of a task that reads it.
    unsafe { &*HELD.configured.get() }
}

/// The control's configuration.
#[inline(always)]
pub(crate) fn config() -> &'static DriveConfig {
    &configured().drive
}

/// A configuration that is to hold.
pub(crate) struct Change(MaybeUninit<Configured>);

impl Change {
    /// None yet.
    pub(crate) const fn new() -> Self {
        Self(MaybeUninit::uninit())
    }

    /// Makes it of these settings, if they fit.
    ///
    /// # Errors
    /// [`NotSet`]; it is of no use then.
    #[inline(never)]
    pub(crate) fn fits(&mut self, settings: &Settings, before: &Settings) -> Result<(), NotSet> {
        // SAFETY: it is copied from one place to another, without a third on the stack.
        let next = unsafe {
            let next = self.0.as_mut_ptr();
            HELD.configured.get().copy_to_nonoverlapping(next, 1);
            &mut *next
        };
        config_fits(settings, before, &mut next.drive)?;
        configure_the_rest(settings, next);
        Ok(())
    }

    /// Puts it in the place of the one that holds.
    ///
    /// # Safety
    /// It was made, and its settings fit. The caller holds off speed task and supervision, and has no reference to the configuration.
    #[inline(never)]
    pub(crate) unsafe fn take_up(&self) {
        // SAFETY: as is asked of the caller.
        unsafe {
            HELD.configured
                .get()
                .copy_from_nonoverlapping(self.0.as_ptr(), 1)
        };
    }
}

/// Takes up the settings that are stored, if they fit, and configures the drive with them.
///
/// # Safety
/// To be called once in the start, before the tasks' states are made: no reference to a configuration may be alive.
#[inline(never)]
pub(crate) unsafe fn take_up(
    place: &'static mut MaybeUninit<Keeper<SettingsPages>>,
) -> &'static mut Keeper<SettingsPages> {
    // SAFETY: as is asked of the caller.
    let held = unsafe { &mut *HELD.configured.get() };
    let keeper = keep_own(place);
    keeper.take_up(
        || OWN,
        |settings| fits_instead_of_own(settings, &mut held.drive),
    );
    let found = keeper.found();
    let left_out = found.left_out;
    if left_out.unknown > 0 {
        defmt::warn!(
            "{=u32} stored settings are left out: this firmware does not have them",
            left_out.unknown
        );
    }
    if left_out.refused > 0 {
        defmt::warn!(
            "{=u32} stored settings are left out: their values are beyond their ranges. The first has the number {=u16:#06x}",
            left_out.refused,
            left_out.first_refused
        );
    }
    match found.origin {
        Origin::Own | Origin::Changed => {}
        Origin::Unfit => {
            held.drive = const { BOARD.drive };
            defmt::warn!(
                "{=str} The first of them has the number {=u16:#06x}",
                found.origin.sentence(),
                found.unfit
            );
        }
        Origin::Stored => {
            defmt::info!("{=str}", found.origin.sentence());
            configure_the_rest(keeper.settings(), held);
        }
    }
    keeper
}

#[inline(never)]
fn keep_own(
    place: &'static mut MaybeUninit<Keeper<SettingsPages>>,
) -> &'static mut Keeper<SettingsPages> {
    place.write(Keeper::new(SettingsPages::new(), OWN))
}

#[inline(never)]
fn fits_instead_of_own(settings: &Settings, config: &mut DriveConfig) -> Result<(), NotSet> {
    config_fits(settings, &OWN, config)
}

/// All but the control's configuration, of settings that fit.
#[inline(never)]
fn configure_the_rest(settings: &Settings, held: &mut Configured) {
    held.plate = settings.plate(&PLATE.board);
    if cfg!(feature = "encoders-at-zero") {
        held.drive = held.drive.aligned(&held.plate);
    }
    if let Ok(guard) = guard_plate(settings).config() {
        held.guard = guard;
    }
    held.header = Header::of_plate(&held.plate);
    held.travel = held.plate.travel_config();
    held.words = CommandWords::new(&held.plate);
}

/// The board's limits, with the scale that is set.
fn guard_plate(settings: &Settings) -> GuardPlate {
    let feed = settings.feed.plate();
    GuardPlate {
        scale: Some(ScaleWatchPlate::usual(feed.scale_count_m, feed.lead_m)),
        ..board::GUARDS
    }
}

/// Whether a drive on this board can be configured with these settings, in the place of `before`: then `config` is the control's
/// configuration.
#[inline(never)]
fn config_fits(
    settings: &Settings,
    before: &Settings,
    config: &mut DriveConfig,
) -> Result<(), NotSet> {
    // Those of `before` are the board's.
    let interfaces = [settings, before]
        .map(|settings| [&settings.screw, &settings.nut].map(|motor| motor.encoder.interface));
    if interfaces[0] != interfaces[1] {
        return Err(NotSet::Refused(Refusal::Interface));
    }
    settings.fits(before, &PLATE.board, config)?;
    let unfit = |id: u16| {
        move |misfit| {
            let setting = Setting::numbered(id);
            NotSet::Unfit(Unfit {
                setting: setting.and_then(|setting| Some((setting, settings.get(id)?))),
                misfit,
            })
        }
    };
    guard_plate(settings)
        .config()
        .map_err(unfit(SCALE_COUNT_NM))?;
    let rates = [
        (
            SCREW_COUNTS,
            counts_per_s(
                settings.screw.speed_max_rpm,
                settings.screw.encoder.counts_per_turn,
            ),
        ),
        (
            NUT_COUNTS,
            counts_per_s(
                settings.nut.speed_max_rpm,
                settings.nut.encoder.counts_per_turn,
            ),
        ),
        (
            SCALE_COUNT_NM,
            settings.feed.velocity_max_mm_s * 1e6 / settings.feed.scale_count_nm,
        ),
    ];
    // An absolute encoder has no edges to count.
    let counted = interfaces[0].map(|interface| interface != EncoderInterface::Mt6835);
    for ((id, rate), counted) in rates.into_iter().zip([counted[0], counted[1], true]) {
        if counted {
            InputFilter::passes(rate).map_err(unfit(id))?;
        }
    }
    Ok(())
}

/// Numbers of settings that the board's timers bound.
const SCREW_COUNTS: u16 = 0x010C;
const NUT_COUNTS: u16 = 0x020C;
const SCALE_COUNT_NM: u16 = 0x0402;

fn counts_per_s(rpm: f64, counts_per_turn: u32) -> f64 {
    rpm / 60.0 * f64::from(counts_per_turn)
}
