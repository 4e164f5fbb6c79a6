//! What may be missing: families, parameters, their physical bounds, what excites them and what they look like.

pub mod family;
pub mod hypothesis;
pub mod limits;
pub(crate) mod lookalike;
pub mod parameter;
pub mod refusals;
pub mod stick_slip;
