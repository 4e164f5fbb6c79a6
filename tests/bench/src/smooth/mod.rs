//! How smooth the table moves on machines with the defects of real drives, with the drive's compensation, with others' and
//! without.

pub mod bench;
pub mod floor;
pub mod hum;
mod lugre;
mod machine;
pub mod rejection;
pub mod report;
pub mod reversal;
mod rivals;
pub mod undeclared;
pub mod vanishing;

pub use machine::{Machine, orders, setup, torque_orders};
pub use rivals::{Compensator, Rival};

use hal_sim::smooth::{
    Smoothness, drive, learned, sample_s, settle, smoothness, smoothness_through, still_runs,
    velocities,
};
