//! Lists the kinds of effects: each file of `src/effects/kinds` is one.

use std::env;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// The struct that a kind's file defines: `lead_error` gives `LeadError`.
fn pascal(kind: &str) -> String {
    let words = kind.split('_').filter_map(|word| {
        let first = word.chars().next()?;
        Some(first.to_uppercase().to_string() + &word[first.len_utf8()..])
    });
    words.collect()
}

/// The modules and the registry's list, which `src/effects/mod.rs` includes.
fn list(files: &[PathBuf]) -> String {
    let (mut modules, mut registry) = (String::new(), String::from("registry! {\n"));
    for file in files {
        let kind = file.file_stem().unwrap_or_default().to_string_lossy();
        let path = file.display().to_string();
        // Writing to memory does not fail.
        let _ = writeln!(modules, "#[path = {path:?}]\nmod {kind};");
        let _ = writeln!(registry, "    {kind}::{} in {path:?},", pascal(&kind));
    }
    modules + &registry + "}\n"
}

fn main() {
    let folder = Path::new(&env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"))
        .join("src/effects/kinds");
    println!("cargo::rerun-if-changed={}", folder.display());
    let entries = fs::read_dir(&folder).expect("the folder of the kinds can be read");
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.expect("its entries can be read").path())
        .filter(|path| path.extension().is_some_and(|end| end == "rs"))
        .collect();
    files.sort();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    fs::write(out.join("kinds.rs"), list(&files)).expect("the build's folder can be written");
}
