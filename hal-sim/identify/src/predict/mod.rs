//! Whether anything predicts a residual, whatever families of effects there are, and the curve that does.
//!
//! A ridge regression on smooth functions of the machine's coordinates is trained on the fit record. Declared regressors are
//! partialled out on both records. The check record judges: the products of residual and prediction, averaged over blocks
//! longer than their correlation, must be above 0 (generalised covariance measure: Shah and Peters, *Annals of Statistics*
//! 48, 2020). Lags of the drive quantity and its acceleration are no coordinates: under feedback they predict the residual
//! of a clean machine.

pub(crate) mod basis;
pub(crate) mod curve;
pub(crate) mod excitation;
pub(crate) mod judge;
pub(crate) mod orders;
mod ridge;
mod selected;
pub(crate) mod side;
