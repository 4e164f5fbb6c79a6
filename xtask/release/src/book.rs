//! The pages as HTML, by mdBook.

use anyhow::{Context, Result, ensure};
use mdbook_driver::MDBook;
use std::fs;
use std::path::Path;

/// Pages in the order of reading. Links start at the checkout.
const SUMMARY: &str = include_str!("../SUMMARY.md");
/// Folders whose pages and pictures the book has. Links between them stay as they are.
const FOLDERS: [&str; 4] = ["", "docs", "firmware/boards", "hal-sim/identify"];
/// Other files that pages link to.
const FILES: [&str; 5] = [
    "LICENSE",
    "deny.toml",
    "firmware/control/examples/own_plant.rs",
    "hal-sim/examples/link_client.rs",
    "hal-sim/identify/examples/own_motor.rs",
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
    for file in FILES {
        let copy = source.join(file);
        fs::create_dir_all(copy.parent().context("a file lies in no folder")?)?;
        fs::copy(checkout.join(file), copy)
            .with_context(|| format!("the checkout has no {file}"))?;
    }
    fs::write(source.join("SUMMARY.md"), SUMMARY)?;
    fs::write(source.join("settings.md"), settings)?;
    fs::write(book.path().join("book.toml"), SETTINGS)?;
    for folder in FOLDERS {
        check_links(&source.join(folder))?;
    }
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

/// Checks that each page of a folder links to files that are there.
fn check_links(folder: &Path) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_none_or(|ending| ending != "md") {
            continue;
        }
        for target in links(&fs::read_to_string(&path)?) {
            ensure!(
                folder.join(&target).exists(),
                "{} links to {target}, which the pages of a release do not have: add it to FILES or FOLDERS in {}",
                path.file_name().unwrap_or_default().display(),
                file!()
            );
        }
    }
    Ok(())
}

/// Relative targets of the links of a page, without the place on the page.
fn links(page: &str) -> Vec<String> {
    let targets = page
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split([')', ' ']).next());
    targets
        .filter(|target| !target.contains(':'))
        .filter_map(|target| target.split('#').next())
        .filter(|file| !file.is_empty())
        .map(str::to_owned)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{links, write};

    #[test]
    fn the_pages_of_this_checkout_become_a_book() {
        let folder = tempfile::tempdir().unwrap();
        let root = xtask::tools::root().unwrap();
        write(&root, "# Settings\n", folder.path()).unwrap();
        for page in ["index", "settings", "docs/smooth"] {
            assert!(
                folder.path().join(format!("{page}.html")).is_file(),
                "{page}"
            );
        }
    }

    #[test]
    fn links_to_files_are_found() {
        let page = "[a](b/c.md#d), ![e](f.svg), [g](#h) and [i](https://example.org).";
        assert_eq!(links(page), ["b/c.md", "f.svg"]);
    }
}
