//! The phases of the start that set the chip up, before there is a task.

use crate::board;
use crate::bridges::{BREAK_SOURCES, PLAN};
use crate::debug_view::DRIVE_VIEW;
use crate::hw::pwm;
use crate::hw::watchdog::reset_reason;
use crate::hw::{clock, cycles, outputs::Outputs, stack_guard};
use crate::lines::{RTT_DOWN_BYTES, RTT_UP_BYTES};
use crate::{crash, journal, log, schedule};
use application::keep::Found;
use application::start::log_start;
use control::journal::Journal;
use control::plate::DrivePlate;
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::Peripherals as Core;
use link::codes::ResetReason;
use rtt_target::{DownChannel, UpChannel};
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::{DBGMCU, FLASH, TIM1, TIM8};

/// From here on the run says what goes wrong with it. The link's channels: to the host, from the host.
pub(crate) fn observe(core: &mut Core) -> (UpChannel, DownChannel) {
    let channels = rtt_target::rtt_init! {
        up: {
            0: { size: 1024, name: "defmt" }
            1: { size: RTT_UP_BYTES, name: "link", section: ".uninit.link" }
        }
        down: {
            0: { size: RTT_DOWN_BYTES, name: "link" }
        }
    };
    stack_guard::start(&core.MPU);
    log::start(channels.up.0);
    cycles::start(&mut core.DCB, &mut core.DWT);
    schedule::no_lazy_float_state(&core.FPU);
    // Before anything that may end this run too.
    crash::take(|text| defmt::error!("the last run ended: {=str}", text));
    (channels.up.1, channels.down.0)
}

/// Says which chip this is, and why it starts.
pub(crate) fn report(rcc: &mut Rcc, debug: &DBGMCU, flash: &FLASH) -> ResetReason {
    let reason = reset_reason(rcc);
    DRIVE_VIEW.reset_reason.store(reason.word(), Relaxed);
    defmt::info!("started after a reset by {=str}", reason.name());
    defmt::info!("silicon revision {=u16:#06x}", clock::revision(debug));
    clock::report_option_bytes(flash);
    reason
}

/// Wakes the gate drivers before the breaks are armed: a driver that wakes says that it has a fault.
pub(crate) fn wake_drivers(outputs: &Outputs) {
    outputs.enable_drivers();
    cortex_m::asm::delay(const { (board::DRIVER_WAKE_S * clock::CORE_HZ as f64) as u32 });
}

/// Takes the journal up, and notes this start and what a person should read of it: `found` are the settings that the drive of `plate`
/// runs on.
pub(crate) fn note(reason: ResetReason, found: Found, plate: &DrivePlate) -> &'static mut Journal {
    let journal = journal::take_up();
    for warning in log_start(journal, reason, found, plate) {
        defmt::warn!("{=str}", warning.sentence());
    }
    journal
}

/// Lets both timers run, half a period apart, with the bridges off.
pub(crate) fn run_timers(screw: &TIM1, nut: &TIM8) {
    if !pwm::start(screw, nut, &PLAN, BREAK_SOURCES) {
        crash::refuse("the PWM timers do not run: check the board's crystal");
    }
}
