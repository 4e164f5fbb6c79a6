//! The page's file.

use anyhow::{Context, Result, bail};
use std::env::current_exe;
use std::fs;
use std::path::{Path, PathBuf};

/// Reads the page: the named file, or the one beside this program, or the one that a clone builds.
pub fn read(named: Option<&Path>) -> Result<String> {
    if let Some(path) = named {
        return fs::read_to_string(path)
            .with_context(|| format!("--page is {}, which cannot be read", path.display()));
    }
    let beside = current_exe()
        .ok()
        .and_then(|program| Some(program.parent()?.join("scope.html")));
    let places = beside.into_iter().chain([PathBuf::from("out/scope.html")]);
    for place in places {
        if let Ok(page) = fs::read_to_string(&place) {
            return Ok(page);
        }
    }
    bail!(
        "the page is neither beside this program nor at out/scope.html: build it with `cargo xtask page` in a clone, or name its file \
         with --page"
    )
}
