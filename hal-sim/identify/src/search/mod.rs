//! From a residual to the hypotheses that explain it: candidates, criterion, second looks.

pub(crate) mod case;
pub(crate) mod forward;
pub(crate) mod holdout;
pub(crate) mod linearised;
pub(crate) mod progress;
pub(crate) mod refine;
pub mod roundings;
pub mod select;
pub mod selection;
pub(crate) mod shapes;
pub(crate) mod suggest;
