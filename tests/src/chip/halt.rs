//! What stands still while a debugger halts the core and the board's time goes on: the core's own counters, and what the freeze
//! bits of DBGMCU name (RM0440 47.8.6 to 47.8.8).

use super::Chip;

/// DBGMCU_APB1FZR1: TIM7, the independent watchdog.
const TIM7: u32 = 1 << 5;
const IWDG: u32 = 1 << 12;
/// DBGMCU_APB2FZR: TIM1, TIM8.
const TIM1: u32 = 1 << 11;
const TIM8: u32 = 1 << 13;

impl Chip {
    /// The core halts now. A PWM timer that stops with it takes its outputs off (RM0440 29.3.30).
    pub fn core_halts(&mut self) {
        let [apb1, apb2] = self.system.stops_with_the_core();
        let (unknown, both) = (
            [apb1 & !(TIM7 | IWDG), apb2 & !(TIM1 | TIM8)],
            apb2 & (TIM1 | TIM8),
        );
        if unknown != [0; 2] {
            self.fail(format!(
                "this model stops TIM1, TIM8, TIM7 and IWDG with the core, not what DBGMCU names beside them: APB1FZR1 {:#x}, \
                 APB2FZR {:#x}",
                unknown[0], unknown[1]
            ));
        } else if both != 0 && both != TIM1 | TIM8 {
            self.fail("this model stops both bridges' timers with the core, or none".into());
        }
        let now = self.now;
        self.nvic.hold(now);
        if both != 0 {
            for index in 0..2 {
                if self.pwm[index].hold(now) {
                    self.machine.borrow_mut().stopped(Self::motor(index));
                }
            }
        }
        if apb1 & TIM7 != 0 {
            self.deadman.hold(now);
        }
        if apb1 & IWDG != 0 {
            self.watchdog.hold(now);
        }
        self.reschedule();
    }

    /// The core goes on now: what stood still goes on from where it stood.
    pub fn core_goes_on(&mut self) {
        let now = self.now;
        self.nvic.release(now);
        if self
            .pwm
            .iter_mut()
            .fold(false, |any, timer| timer.release(now) | any)
        {
            self.machine.borrow_mut().driven_again();
        }
        self.deadman.release(now);
        self.watchdog.release(now);
        self.reschedule();
    }

    /// Lets time run to `to` while the core is halted. The machine coasts where its bridges' timers stand.
    pub fn advance_halted(&mut self, to: u64) {
        if self.pwm[0].held().is_some() {
            self.machine.borrow_mut().coast(to - self.now);
        }
        self.advance(to);
    }
}
