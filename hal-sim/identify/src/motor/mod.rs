//! A bare motor in a speed loop: which orders of its turn its current has, and how much of the current they explain on
//! a stretch that they were not fitted to. LAAS's motor that cogs is one.

mod left;
mod orders;
mod record;
mod study;

pub use orders::Order;
pub use record::{MotorModel, MotorModelError, Record};
pub(crate) use study::rms;
pub use study::{Fit, Study};
