//! The parts of the speed task: references, speed loops, compensation, alignment, brake.

pub mod alignment;
pub mod brake;
pub mod compensation;
pub mod coordinator;
pub mod current_limit;
pub mod disturbance;
pub mod friction;
pub mod notch;
pub mod profile;
pub mod speed_loop;
pub(crate) mod table_speed;
pub mod thermal;
pub mod torque;
