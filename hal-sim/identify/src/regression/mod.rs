//! Columns, normal equations, bounded least squares, and a covariance that holds for coloured residuals.

pub(crate) mod bounded;
pub(crate) mod column;
pub mod design;
pub mod gain;
pub(crate) mod inverse;
pub mod normal;
pub(crate) mod sandwich;
