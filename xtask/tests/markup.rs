//! HTML and SVG come from templates, where what is not markup is escaped.

use std::fs;
use std::path::{Path, PathBuf};

/// All Rust files below a folder, builds left out.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the project") {
        let path = entry.expect("an entry").path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn no_rust_outside_tests_closes_a_tag() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 500, "{} Rust files", files.len());
    // The crate that has the shell, and checks pages tag by tag.
    let shell = root.join("hal-sim/page");
    let judged = files.iter().filter(|path| {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let in_tests = path
            .parent()
            .is_some_and(|folder| folder.ends_with("tests"));
        !path.starts_with(&shell) && !name.ends_with("test") && !in_tests
    });
    let closing: Vec<_> = judged
        .flat_map(|path| {
            let text = fs::read_to_string(path).expect("a Rust file");
            let product = text.split("#[cfg(test)]").next().unwrap_or_default();
            let lines = product.lines().map(str::trim_start);
            lines
                .filter(|line| !line.starts_with("//"))
                .filter(|line| line.contains("</") || line.contains("/>"))
                .map(|line| format!("{}: {line}", path.display()))
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(
        closing.is_empty(),
        "markup beside the templates:\n{}",
        closing.join("\n")
    );
}
