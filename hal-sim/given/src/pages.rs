//! The commands that the project's pages show, for tests that read them as their program does.

use std::fs;
use std::path::{Path, PathBuf};

/// A command of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PageCommand {
    /// Where it stands, as `docs/drive.md:7`.
    pub place: String,
    /// Whether it stands in a block of code. Between backticks, options may be left out.
    pub is_whole: bool,
    /// Its words.
    pub words: Vec<String>,
}

/// Commands of the project's pages that start with these words, in code blocks and between backticks.
///
/// A command that leaves something out (`...`) is not among them.
///
/// # Panics
/// A page cannot be read.
#[must_use]
pub fn commands(start: &str) -> Vec<PageCommand> {
    let root = root();
    let mut found = Vec::new();
    for page in pages(&root) {
        let text = fs::read_to_string(&page).unwrap_or_else(|error| panic!("{page:?}: {error}"));
        let name = page.strip_prefix(&root).unwrap_or(&page).display();
        for (line, is_whole, words) in commands_of(&text) {
            if words.join(" ").starts_with(start) {
                found.push(PageCommand {
                    place: format!("{name}:{line}"),
                    is_whole,
                    words,
                });
            }
        }
    }
    found
}

/// The folder of `Cargo.lock`.
fn root() -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    let mut folders = here.ancestors();
    let root = folders.find(|folder| folder.join("Cargo.lock").is_file());
    root.map(Path::to_path_buf).unwrap_or(here)
}

/// Pages for people: at the top, in `docs`, and beside the boards.
fn pages(root: &Path) -> Vec<PathBuf> {
    let mut pages = Vec::new();
    for folder in ["", "docs", "firmware/boards"] {
        let Ok(entries) = fs::read_dir(root.join(folder)) else {
            continue;
        };
        let files = entries.flatten().map(|entry| entry.path());
        pages.extend(files.filter(|file| file.extension().is_some_and(|end| end == "md")));
    }
    pages.sort();
    pages
}

/// Each command of a page with its line's number from 1, and whether it stands in a block.
fn commands_of(text: &str) -> Vec<(usize, bool, Vec<String>)> {
    let mut found = Vec::new();
    let mut line = 1;
    // Every second part stands in a block.
    for (index, part) in text.split("```").enumerate() {
        if index % 2 == 1 {
            let joined = part.replace("\\\n", "\u{0} ");
            let mut at = line;
            for (row, command) in joined.split('\n').enumerate() {
                let lines = 1 + command.matches('\u{0}').count();
                // The first row is the block's language.
                let command = if row == 0 { "" } else { command };
                found.extend(words(&command.replace('\u{0}', "")).map(|words| (at, true, words)));
                at += lines;
            }
        } else {
            let mut at = line;
            // Every second part stands between backticks, and may go over lines.
            for (index, span) in part.split('`').enumerate() {
                if index % 2 == 1 {
                    found.extend(words(span).map(|words| (at, false, words)));
                }
                at += span.matches('\n').count();
            }
        }
        line += part.matches('\n').count();
    }
    found
}

/// Words of a command, without its prompt, comment, variables and what a shell does with its output.
fn words(command: &str) -> Option<Vec<String>> {
    let command = command.trim().trim_start_matches("$ ");
    let words: Vec<String> = command
        .split_whitespace()
        .skip_while(|word| word.contains('=') && !word.starts_with('-'))
        .take_while(|word| !["#", "|", ">", "&&", "&", ";"].contains(word))
        .map(|word| word.trim_matches(['"', '\'']).to_owned())
        .collect();
    (!words.is_empty()
        && words
            .iter()
            .all(|word| !word.contains("...") && !word.contains('…')))
    .then_some(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_backticks_are_read() {
        let text = "Run `cargo\n a --b` or `cargo a ...`.\n\n```sh\n$ X=1 cargo a \\\n  c   # why\ncargo d | less\n```\n";
        let found = commands_of(text).into_iter();
        let joined: Vec<(usize, bool, String)> = found
            .map(|(line, is_whole, words)| (line, is_whole, words.join(" ")))
            .collect();
        let expected = [
            (1, false, "cargo a --b"),
            (5, true, "cargo a c"),
            (7, true, "cargo d"),
        ];
        assert_eq!(
            joined,
            expected.map(|(line, is_whole, words)| (line, is_whole, words.to_owned()))
        );
    }
}
