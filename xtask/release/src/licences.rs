//! Texts of the licences of linked libraries.

use anyhow::{Context, Result, ensure};
use cargo_metadata::Package;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

/// Beginnings of the names of files that hold a licence or a notice, in capitals.
const NAMES: [&str; 5] = ["LICENSE", "LICENCE", "COPYING", "NOTICE", "UNLICENSE"];

/// All libraries with their licences, and each text once.
///
/// # Errors
/// A library states no licence, or its folder cannot be read.
pub fn texts(packages: &[Package]) -> Result<String> {
    let mut list = String::from("Libraries in this release\n\n");
    // Text: the libraries that have it.
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in packages {
        let name = format!("{} {}", package.name, package.version);
        let licence = package
            .license
            .as_deref()
            .or(package.license_file.as_ref().map(|file| file.as_str()));
        let licence = licence
            .with_context(|| format!("{name} states no licence: ask its authors, or replace it"))?;
        writeln!(list, "{name}: {licence}")?;
        for text in files(package)? {
            texts.entry(text).or_default().push(name.clone());
        }
    }
    ensure!(
        !texts.is_empty(),
        "no library has a file with its licence: is cargo's registry complete?"
    );
    for (text, names) in texts {
        write!(
            list,
            "\n{}\n{}\n\n{text}\n",
            "-".repeat(80),
            names.join(", ")
        )?;
    }
    Ok(list)
}

/// The texts in the package's folder, in the order of their names.
fn files(package: &Package) -> Result<Vec<String>> {
    let folder = package
        .manifest_path
        .parent()
        .context("a manifest lies in no folder")?;
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {folder}"))? {
        let path = entry?.path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .to_uppercase();
        if path.is_file() && NAMES.iter().any(|start| name.starts_with(start)) {
            found.push(path);
        }
    }
    found.sort();
    let read = |path| -> Result<String> {
        let bytes = fs::read(&path)?;
        Ok(String::from_utf8_lossy(&bytes)
            .replace("\r\n", "\n")
            .trim()
            .to_owned())
    };
    found.into_iter().map(read).collect()
}
