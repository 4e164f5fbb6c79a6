//! A bare motor of which angle and current are known: inertia, friction, the orders of its turn, and how late its current
//! is reported; and how much of the current they explain on a record that they were not fitted to.

mod band;
mod base;
mod columns;
mod fit;
mod left;
mod orders;
mod record;
mod search;
mod stretch;
mod study;

pub use base::Base;
pub use orders::Order;
pub use record::{MotorModel, Record};

pub use fit::Fit;
pub use search::Lost;
pub use study::{Lag, Study};
