//! A single feed axis, one motor in a position loop: the Electro-Mechanical Positioning System (Janot, Gautier, Brunot
//! 2019) is one, a ball screw with its nut held. Parameters and effects from one record, errors in closed-loop
//! simulation of another.

mod axis;
mod balance;
mod file;
mod fit;
mod left;
mod limits;
mod record;
mod select;
mod simulate;
mod stage;
mod study;
mod width;

pub use axis::{Axis, Term};
pub(crate) use record::balance_record;
pub use record::{Law, Record};
pub use select::Trial;
pub use simulate::{Moment, Run};
pub use stage::{Errors, Stage};
pub use study::{OwnFriction, Study};
