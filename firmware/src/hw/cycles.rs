//! The core's cycle counter: what an interrupt cost.

use cortex_m::peripheral::{DCB, DWT};

/// Starts the counter.
pub(crate) fn start(dcb: &mut DCB, dwt: &mut DWT) {
    dcb.enable_trace();
    dwt.enable_cycle_counter();
}

/// Cycles since [`start`], modulo 2^32 (25 s).
#[inline(always)]
pub(crate) fn now() -> u32 {
    DWT::cycle_count()
}
