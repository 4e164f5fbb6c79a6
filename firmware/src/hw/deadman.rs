//! A hung current loop: TIM7 runs out unless the screw's loop puts it back each period, and its interrupt, the only one
//! above the current loops, opens both bridges.
//!
//! Both loops have one priority, so a hung one holds the other up too, and one timer sees either. It waits two and a half
//! periods: a single late period is counted and tolerated.

use crate::bridges::BRIDGES_OFF;
use crate::debug_view::DRIVE_VIEW;
use application::exchange::show;
use control::fault::Fault;
use control::supervisor::State;
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};
use stm32g4xx_hal::stm32::{TIM1, TIM7, TIM8, tim7};

/// What its interrupt and the speed task share by reference.
pub struct Deadman {
    /// It has run out, and no reset was asked since.
    ran_out: AtomicBool,
}

fn timer() -> &'static tim7::RegisterBlock {
    // SAFETY: only this module touches the timer, with single writes.
    unsafe { &*TIM7::ptr() }
}

impl Deadman {
    /// Lets it run. `half_period`: of the PWM, timer counts.
    pub(crate) fn start(_: TIM7, half_period: u16) -> Self {
        // SAFETY: any 16-bit value; five half periods of 40 to 10 kHz fit (10 625 to 42 500).
        timer()
            .arr()
            .write(|w| unsafe { w.bits(5 * u32::from(half_period)) });
        // Only running out is an update (URS).
        timer().cr1().write(|w| w.urs().set_bit());
        Self::put_back();
        timer().dier().write(|w| w.uie().set_bit());
        timer().cr1().write(|w| w.urs().set_bit().cen().set_bit());
        Self {
            ran_out: AtomicBool::new(false),
        }
    }

    /// A period has passed as it should.
    #[inline(always)]
    pub(crate) fn put_back() {
        timer().egr().write(|w| w.ug().set_bit());
    }

    /// It has run out: opens both bridges and says why, for nobody below can.
    pub(crate) fn run_out(&self) {
        timer().sr().write(|w| w.uif().clear_bit());
        // SAFETY: the two registers' configured fields without the main output enable; a current loop that is interrupted
        // between its own read and write of it does not exist, for it writes only.
        unsafe {
            (*TIM1::ptr()).bdtr().write(|w| w.bits(BRIDGES_OFF));
            (*TIM8::ptr()).bdtr().write(|w| w.bits(BRIDGES_OFF));
        }
        self.ran_out.store(true, Relaxed);
        show(&DRIVE_VIEW, State::Fault(Fault::LoopHung));
    }

    /// Whether it has run out; a reset that is asked forgives that.
    #[inline(always)]
    pub(crate) fn has_run_out(&self, reset: bool) -> bool {
        if reset {
            self.ran_out.store(false, Relaxed);
        }
        self.ran_out.load(Relaxed)
    }
}
