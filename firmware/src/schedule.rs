//! The tasks: priorities, rates, deadlines, and what a missed one means.
//!
//! | task | bound to | priority | rate | deadline | when it is missed | past the limit |
//! | --- | --- | --- | --- | --- | --- | --- |
//! | current loop hung | TIM7 | 16 | never | - | - | what it is: 2.5 periods without the screw's loop; opens both bridges, fault `LoopHung` |
//! | screw current loop | ADC1_2 | 15 | 20 kHz | the screw timer's next top, 50 us | counted; the old compare values hold for a period | fault `ScrewLoopLate` |
//! | nut current loop | ADC4 | 15 | 20 kHz | the nut timer's next top, 50 us | the same | fault `NutLoopLate` |
//! | speed | FMAC | 12 | 5 kHz | its next step, 200 us | counted; the references hold, and go to rest after 400 us | fault `SpeedTaskLate` |
//! | time queue | SysTick | 8 | 1 kHz | 1 ms | the two below run late | theirs |
//! | supervise | async | 4 | 1 kHz | its next step, 1 ms | counted | fault `SupervisionLate`; after 20 ms the watchdog resets the chip, which opens both bridges |
//! | telemetry | async | 1 | 1 kHz | 12.8 ms | samples are dropped and counted | none: the drive does not hang on it |
//!
//! The limit of each is six misses in a row, or more than one in 100 ms for long: `control::guard`. All counts are in
//! the debug view.
//!
//! The two current loops are half a period apart and cannot interrupt each other: each must end within 25 us, 4250 cycles
//! (12.5 us and 2125 with the feature `pwm-40khz`). `cargo xtask cost` prints what they take, and the longest path through
//! their code, which a test holds to that.

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{FPU, SCB};

/// Gives SysTick its priority, RTIC's 8 on 4 priority bits: the HAL's would be above the current loops.
pub(crate) fn lower_systick(scb: &mut SCB) {
    const PRIORITY: u8 = (16 - 8) << 4;
    // SAFETY: no critical section relies on SysTick's priority: they mask all interrupts.
    unsafe { scb.set_priority(SystemHandler::SysTick, PRIORITY) };
}

/// Interrupts neither save float registers nor reserve room for them: nothing in them uses the FPU (PM0214 4.6.2).
pub(crate) fn no_lazy_float_state(fpu: &FPU) {
    const ASPEN: u32 = 1 << 31;
    const LSPEN: u32 = 1 << 30;
    // SAFETY: no float register is live, and both bits only choose what exceptions save.
    unsafe { fpu.fpccr.modify(|bits| bits & !(ASPEN | LSPEN)) };
}
