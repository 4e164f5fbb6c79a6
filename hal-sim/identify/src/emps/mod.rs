//! A single feed axis: the Electro-Mechanical Positioning System (Janot, Gautier, Brunot 2019), a ball screw with its
//! nut held. Parameters from one record, effects one by one, errors in closed-loop simulation of another.

mod axis;
mod filter;
mod fit;
mod record;
mod study;

pub use axis::{Axis, Term};
pub(crate) use filter::butterworth_100;
pub(crate) use record::numbers;
pub use record::{EmpsError, Record};
pub use study::{Errors, Stage, Study};
