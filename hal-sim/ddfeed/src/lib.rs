//! The commands of the program `ddfeed`, and what other programs use of them: output folders, and recordings of a drive's
//! telemetry.
#![forbid(unsafe_code)]

#[cfg(feature = "cli")]
pub mod compensate;
#[cfg(feature = "cli")]
pub mod drive;
pub mod hold;
#[cfg(feature = "cli")]
pub mod identify;
#[cfg(any(feature = "cli", feature = "probe"))]
pub mod interrupt;
#[cfg(feature = "mcap")]
pub mod mcap_file;
pub mod output;
#[cfg(feature = "probe")]
pub mod probe;
pub mod record;
#[cfg(feature = "cli")]
pub mod ripple;
#[cfg(feature = "scope")]
pub mod scope;
#[cfg(feature = "cli")]
pub mod serve;
pub mod session;
#[cfg(feature = "cli")]
pub mod simulate;
pub mod trigger;

/// The error of a command that needs a feature which this program was built without.
#[cfg(feature = "cli")]
pub fn missing_feature(what: &str, feature: &str) -> anyhow::Error {
    anyhow::anyhow!(
        "{what} needs the feature `{feature}`, and this ddfeed was built without it. In a clone, run `cargo ddfeed-full` in \
         place of `cargo ddfeed`. To install it, run `cargo install --path hal-sim/ddfeed --features {feature}`."
    )
}
