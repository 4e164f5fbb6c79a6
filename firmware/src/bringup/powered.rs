//! The second stage: the bus is at 12 V, the gate drivers sleep, wake and sleep again.
//!
//! The timers start the conversions by the drive's own set-up, and everything converts as in a running drive. No main output is
//! enabled: the timers hold the bridges' pins at their idle level, both switches off.

use super::{Started, comparators, pause, put, wait_until};
use crate::board;
use crate::bridges::{BREAK_SOURCES, PLAN};
use crate::hw::{analog, pwm};
use control::power_stage::StageLook;
use core::sync::atomic::Ordering::Relaxed;
use link::bringup::{BINS, BringupReport, CurrentReading, POWERED_CONVERSIONS};
use stm32g4xx_hal::stm32::{ADC4, TIM1, TIM8};

/// Conversions of a mean.
const MEAN: u32 = 16;
/// Twice what a driver takes to wake, us.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const WAKE_US: u32 = (2e6 * board::DRIVER_WAKE_S) as u32;

/// Leaves the report as it is where the timers do not run.
pub(super) fn read(report: &BringupReport, started: &Started<'_>) {
    // SAFETY: interrupts are masked and the drive's start has not reached the timers: nobody else is at them.
    let (screw, nut) = unsafe { (TIM1::steal(), TIM8::steal()) };
    started.converters.convert_for_nothing();
    if !pwm::start(&screw, &nut, &PLAN, BREAK_SOURCES) {
        return;
    }
    started.converters.arm();
    look(report, started, 0);
    started.pins.outputs.enable_drivers();
    pause(WAKE_US);
    look(report, started, 1);
    convert(report);
    comparators::read(&report.comparators);
    for driver in started.pins.outputs.drivers.into_iter().flatten() {
        driver.switch(false);
    }
    pause(WAKE_US);
    look(report, started, 2);
}

/// The next period of both motors: what its conversions gave. `None` if it does not come.
fn next_period() -> Option<[StageLook; 2]> {
    const LOOKS: u32 = 20_000;
    const JEOC_JEOS: u32 = 1 << 5 | 1 << 6;
    // SAFETY: interrupts are masked, so nobody else takes the flags.
    let adc = unsafe { &*ADC4::ptr() };
    // SAFETY: flags are cleared by writing ones.
    adc.isr().write(|w| unsafe { w.bits(JEOC_JEOS) });
    wait_until(LOOKS, || adc.isr().read().jeos().bit_is_set()).then(analog::stages)
}

/// Levels of all channels and of the fault lines at one of the three moments.
fn look(report: &BringupReport, started: &Started<'_>, moment: usize) {
    for _ in 0..MEAN {
        let Some(looks) = next_period() else { return };
        for (stage, look) in report.stages.iter().zip(looks) {
            for (current, code) in stage.currents.iter().zip(look.current) {
                if let Some(level) = current.levels.get(moment) {
                    put(level, level.load(Relaxed).wrapping_add(code.into()));
                }
            }
        }
    }
    for (stage, line) in report.stages.iter().zip(started.pins.fault_lines) {
        let levels = stage.currents.iter();
        for level in levels.filter_map(|current| current.levels.get(moment)) {
            put(level, (level.load(Relaxed) + MEAN / 2) / MEAN);
        }
        let pulled = u32::from(line.is_pulled()) << moment;
        put(&stage.pulled, stage.pulled.load(Relaxed) | pulled);
    }
}

/// Histograms of the currents, and the sum of the bus.
fn convert(report: &BringupReport) {
    for _ in 0..POWERED_CONVERSIONS {
        let Some(looks) = next_period() else { return };
        for (stage, look) in report.stages.iter().zip(looks) {
            for (current, code) in stage.currents.iter().zip(look.current) {
                count(current, code.into());
            }
            let bus = stage.bus.load(Relaxed);
            put(&stage.bus, bus.wrapping_add(look.bus.into()));
            put(&stage.conversions, stage.conversions.load(Relaxed) + 1);
        }
    }
}

fn count(current: &CurrentReading, code: u32) {
    let off = code
        .wrapping_sub(current.levels[1].load(Relaxed))
        .cast_signed();
    #[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation)]
    let middle = (BINS / 2) as i32;
    let bin = off.saturating_add(middle).clamp(0, 2 * middle);
    if let Some(bin) = current.histogram.get(bin.cast_unsigned() as usize) {
        put(bin, bin.load(Relaxed) + 1);
    }
    let sum = current.sum.load(Relaxed).wrapping_add(off);
    current.sum.store(sum, Relaxed);
    let square = off.unsigned_abs().saturating_mul(off.unsigned_abs());
    put(
        &current.squares,
        current.squares.load(Relaxed).saturating_add(square),
    );
}
