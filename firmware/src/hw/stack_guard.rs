//! A stack that overflows is a fault, not silent damage: the memory between it and the variables is closed to everybody
//! (PM0214 4.2, memory protection unit).
//!
//! The function with the largest frame must not step over it: a test compares each frame of the program with its size.

use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// Bytes of the guard, a power of two; `memory.x` has the same. The link takes a drive's settings, a kilobyte and a half, in its
/// functions' frames.
const BYTES: u32 = 4096;

/// Closes the guard. A write to it, or an exception's frame in it, is a hard fault, for which the unit is off: its handler
/// runs below the guard.
pub(crate) fn start(mpu: &MPU) {
    unsafe extern "C" {
        static __sguard: u32;
    }
    let start = (&raw const __sguard) as u32;
    const VALID: u32 = 1 << 4;
    const NO_EXECUTION: u32 = 1 << 28;
    const NO_ACCESS: u32 = 0 << 24;
    const SIZE: u32 = (BYTES.trailing_zeros() - 1) << 1;
    const ENABLE: u32 = 1;
    // All else is as without the unit (PRIVDEFENA).
    const BACKGROUND: u32 = 1 << 2;
    // SAFETY: region 0 closes memory that is nobody's; the barriers let the next access see it.
    unsafe {
        mpu.rbar.write(start | VALID);
        mpu.rasr.write(NO_EXECUTION | NO_ACCESS | SIZE | ENABLE);
        mpu.ctrl.write(BACKGROUND | ENABLE);
    }
    asm::dsb();
    asm::isb();
}

/// The fault that is being handled was a write to the guard, or a frame in it.
pub(crate) fn overflowed() -> bool {
    // SCB_CFSR: data access violation, while unstacking, while stacking (PM0214 4.4.15).
    const DATA: u32 = 1 << 1;
    const UNSTACKING: u32 = 1 << 3;
    const STACKING: u32 = 1 << 4;
    // SAFETY: a status is read.
    let status = unsafe { (*cortex_m::peripheral::SCB::PTR).cfsr.read() };
    status & (DATA | UNSTACKING | STACKING) != 0
}
