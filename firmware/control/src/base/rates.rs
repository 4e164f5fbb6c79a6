//! How often the speed task looks at what needs no look in each step.

/// Steps from one look at a motor's motion to the next, and from one at the interlock.
pub const STEPS_PER_LOOK: u32 = 4;
/// Steps from one look at a motor's heat to the next.
pub const STEPS_PER_HEAT: u32 = 8;
