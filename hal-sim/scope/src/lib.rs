//! The browser page's Rust: a simulated drive, a client of the link, and what the plots compute.
//!
//! | part | module |
//! | --- | --- |
//! | board, machine and application, millisecond by millisecond | [`simulated`] |
//! | commands and answers as JSON, bytes of the link on the other side | [`client`], [`request`] |
//! | columns of a telemetry row | [`signals`] |
//! | ripple and orders | [`analysis`] |
//! | bandwidth and margin of the loops | [`loops`] |
//! | identification of two recordings, and what compensates it | [`identification`] |
//! | measuring the motors and the feed step by step | [`commissioning`] |
//! | settings and injected faults as lists | [`schema`] |
//! | the functions that JavaScript calls | [`exports`] |

pub mod analysis;
pub mod burst;
pub mod client;
pub mod commissioning;
pub mod exports;
pub mod identification;
pub mod loops;
pub mod request;
pub mod schema;
pub mod signals;
pub mod simulated;
