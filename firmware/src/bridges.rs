//! How both bridges are switched, and what breaks them: constants of the board.

use crate::board;
use crate::hw::protection;
use crate::hw::pwm::{self, PwmPlan};

/// How both bridges are switched.
pub(crate) const PLAN: PwmPlan = PwmPlan::new(&board::PLATE, board::BREAK_FILTER_S);

/// `TIMx_BDTR` of both timers without the main output enable.
pub(crate) const BRIDGES_OFF: u32 = pwm::bdtr(&PLAN);

/// `TIMx_AF1` of both timers: what breaks them.
pub(crate) const BREAK_SOURCES: [u32; 2] = {
    let [screw, nut] = &board::OVER_CURRENT;
    let driver = board::DRIVER_FAULT;
    [
        protection::break_sources(screw, driver),
        protection::break_sources(nut, driver),
    ]
};
