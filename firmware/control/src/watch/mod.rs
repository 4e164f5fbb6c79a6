//! What finds that something is wrong.

pub mod active_limit;
pub mod controller_supply;
pub mod enable_watch;
pub mod ends_watch;
pub(crate) mod follow;
#[allow(clippy::float_arithmetic)]
pub mod guard;
pub mod interlock;
pub mod power_stage;
pub mod runaway;
#[allow(clippy::float_arithmetic)]
pub mod scale_watch;
pub mod seizure_watch;
pub mod standing_watch;
#[allow(clippy::float_arithmetic)]
pub mod thermometer;
pub mod travel;
