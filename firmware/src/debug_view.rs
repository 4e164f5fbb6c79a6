//! The words that a probe session reads while the drive runs, at a known symbol. [`link::view`] defines them.
//!
//! A debugger observes. Commands come over the link, which arms and takes a heartbeat.

pub(crate) use application::exchange::count;
use control::format::{Current, MechanicalSpeed, Speed, TableVelocity, Voltage};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::scale;
use link::view::DriveView;

/// At a symbol that a debugger knows: [`link::VIEW_SYMBOL`].
#[used]
#[unsafe(no_mangle)]
pub(crate) static DRIVE_VIEW: DriveView = DriveView::new();

/// The words are passed on as the control law has them.
const _: () = assert!(
    Current::FRAC_NBITS == scale::CURRENT
        && Voltage::FRAC_NBITS == scale::VOLTAGE
        && Speed::FRAC_NBITS == scale::SPEED
        && MechanicalSpeed::FRAC_NBITS == scale::BASE_SPEED
        && TableVelocity::FRAC_NBITS == scale::TABLE_VELOCITY
);

/// Keeps the largest value. Only the word's one writer may call it.
#[inline(always)]
pub(crate) fn keep_max(word: &AtomicU32, value: u32) {
    if value > word.load(Relaxed) {
        word.store(value, Relaxed);
    }
}
