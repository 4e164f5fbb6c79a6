//! The drive as a whole: states, the speed task, moves and homing.

pub mod homing;
pub mod journal;
pub mod speed_task;
pub mod supervisor;
pub mod table_move;
