//! What the tests measure, for `cargo xtask bench probe`: a file a figure in the target folder's `probe`.

use serde_json::Value;
use std::path::PathBuf;

/// Keeps a figure. A dot in its name leads into a group.
pub fn keep(name: &str, figure: impl Into<Value>) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("../probe");
    let written = std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(folder.join(name), figure.into().to_string()));
    written.expect("the target folder can be written");
}

/// Keeps that a failure is named in a sentence.
pub fn named(failure: &str) {
    keep(&format!("failures_named.{failure}"), true);
}
