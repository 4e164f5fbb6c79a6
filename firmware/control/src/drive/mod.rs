//! The drive as a whole: states, the speed task, moves, homing and streams.

pub mod homing;
pub mod journal;
mod rejection;
pub mod speed_task;
pub mod stream;
pub mod supervisor;
pub mod table_move;
