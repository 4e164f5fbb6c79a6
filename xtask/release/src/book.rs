//! The pages as HTML, by mdBook.

use anyhow::{Context, Result};
use mdbook_driver::MDBook;
use std::fs;
use std::path::Path;

/// Pages in the order of reading. Links start at the checkout.
const SUMMARY: &str = include_str!("../SUMMARY.md");
/// Folders whose pages and pictures the book has. Links between them stay as they are.
const FOLDERS: [&str; 5] = [
    "",
    "xtask",
    "xtask/guide",
    "firmware/boards",
    "hal-sim/identify",
];
/// Names of pages and pictures end so.
const ENDINGS: [&str; 4] = ["md", "svg", "png", "webp"];

const SETTINGS: &str = r#"
[book]
title = "ddfeed"
language = "en"
src = "src"

[output.html]
no-section-label = true
"#;

/// Writes the pages of `checkout` into `to`, with `settings` as the page of all settings.
///
/// # Errors
/// A page cannot be read or written, or the list of pages is wrong.
pub fn write(checkout: &Path, settings: &str, to: &Path) -> Result<()> {
    let book = tempfile::tempdir().context("there is no room for the pages")?;
    let source = book.path().join("src");
    for folder in FOLDERS {
        copy(&checkout.join(folder), &source.join(folder))?;
    }
    fs::write(source.join("SUMMARY.md"), SUMMARY)?;
    fs::write(source.join("settings.md"), settings)?;
    fs::write(book.path().join("book.toml"), SETTINGS)?;
    let mut pages = MDBook::load(book.path()).context("mdBook cannot read the pages")?;
    pages.config.build.build_dir = to.to_owned();
    pages.build().context("mdBook cannot write the pages")
}

/// Copies pages and pictures of a folder, not of those below.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
        let path = entry?.path();
        if let (Some(name), Some(ending)) = (path.file_name(), path.extension())
            && ENDINGS.iter().any(|known| ending == *known)
        {
            fs::copy(&path, to.join(name))?;
        }
    }
    Ok(())
}
