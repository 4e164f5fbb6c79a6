//! Why a model could not be read.

use std::path::PathBuf;
use thiserror::Error;

/// Why a model could not be read.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The file could not be opened or read.
    #[error("{}: cannot read the model: {source}; give the path of an existing model.toml", path.display())]
    File {
        /// The path that was tried.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The text is no valid model. Displays file, line, key, what was read and what is allowed.
    #[error("{origin}, line {line}{}: {reason}", if key.is_empty() { String::new() } else { format!(", key `{key}`") })]
    Content {
        /// File, or the name that the caller gave to the text.
        origin: String,
        /// Line of the text, from 1.
        line: usize,
        /// Path of the key, such as `screw.torque_harmonics[0].order`; empty where no key is concerned.
        key: String,
        /// What was read and what is allowed.
        reason: String,
    },
}
