//! The page on a new effect, followed in a copy of the project: its file alone makes the effect simulated, read and named.

use std::fs;
use std::path::Path;
use std::process::Command;

const PAGE: &str = include_str!("../../docs/adding.md");

/// The page's file with its text.
fn file_of_the_page() -> (&'static str, &'static str) {
    let (_, section) = PAGE.split_once("## An effect").expect("the section");
    let (before, rest) = section.split_once("```rust\n").expect("its code");
    let (code, _) = rest.split_once("```").expect("the end of its code");
    let path = before.rsplit('`').nth(1).expect("its path");
    (path, code)
}

/// The section's commands, without their comments.
fn commands_of_the_page() -> Vec<&'static str> {
    let (_, section) = PAGE.split_once("## An effect").expect("the section");
    let (_, rest) = section.split_once("```sh\n").expect("its commands");
    let (commands, _) = rest.split_once("```").expect("the end of its commands");
    let bare = |line: &'static str| line.split('#').next().unwrap_or(line).trim();
    commands.lines().map(bare).collect()
}

/// What git has of a folder, as files in another one.
fn copy(from: &Path, to: &Path) {
    let list = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(from)
        .output()
        .expect("git runs");
    let list = String::from_utf8(list.stdout).expect("names are UTF-8");
    for name in list
        .split_terminator('\0')
        .filter(|name| from.join(name).is_file())
    {
        fs::create_dir_all(to.join(name).parent().expect("a file is in a folder"))
            .expect("a folder can be made");
        fs::copy(from.join(name), to.join(name)).expect("a file can be copied");
    }
}

#[test]
fn the_page_has_a_file_and_commands() {
    let (path, code) = file_of_the_page();
    assert!(
        path.ends_with(".rs") && code.contains("impl Effect for"),
        "{path}: {code}"
    );
    assert!(commands_of_the_page().len() >= 3);
}

#[test]
#[ignore = "takes five minutes: it compiles a copy of the project"]
fn the_page_leads_to_an_effect_that_is_named() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = tempfile::tempdir().expect("a folder");
    copy(&root, folder.path());
    let (path, code) = file_of_the_page();
    fs::write(folder.path().join(path), code).expect("the effect can be written");
    for command in commands_of_the_page() {
        let mut run = Command::new("sh");
        run.args(["-c", command]).current_dir(folder.path());
        let status = run
            .env_remove("CARGO_TARGET_DIR")
            .status()
            .expect("sh runs");
        assert!(status.success(), "`{command}` failed ({status})");
    }
    let reference = fs::read_to_string(folder.path().join("hal-sim/identify/REFERENCE.md"))
        .expect("the reference");
    assert!(reference.contains("#### `tight_guideway`"));
}
