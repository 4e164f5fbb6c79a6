//! What a record says: coordinates, channels, filters, spectra, orders and the noise floor.

pub(crate) mod along;
pub mod channel;
pub(crate) mod filter;
pub mod fourier;
pub(crate) mod frames;
pub(crate) mod leftover;
pub mod noise;
pub(crate) mod quantile;
pub(crate) mod recount;
pub(crate) mod rounding;
pub mod scan;
pub mod signals;
pub(crate) mod white;
