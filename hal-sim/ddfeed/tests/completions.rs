//! What each shell makes of its completion script. A shell that is not installed is not asked: its test is ignored by name.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Lines that end with the word to complete, and what it is completed to.
const LINES: [(&str, &str); 5] = [
    ("ddfeed ser", "serve"),
    ("ddfeed drive --sim 127.0.0.1:7474 tun", "tune"),
    (
        "ddfeed drive --sim 127.0.0.1:7474 tune --spe",
        "--speed-loop",
    ),
    ("ddfeed drive settings imp", "import"),
    ("ddfeed completions fi", "fish"),
];

/// The completion of bash calls a function, which fills `COMPREPLY`.
const ASK_BASH: &str = r#"source "$1"; COMP_WORDS=($2); COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
"$(complete -p ddfeed | sed 's/.*-F \([^ ]*\).*/\1/')" ddfeed "${COMP_WORDS[-1]}" "${COMP_WORDS[-2]}"
echo "${COMPREPLY[*]}""#;

/// zsh completes where a line is edited: in a terminal, by a key of which the line is said.
const ASK_ZSH: &str = r#"zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell "PS1=; autoload -Uz compinit; compinit -D -u; source ${(q)1}
complete-and-say() { zle complete-word; print -r -- \"\$BUFFER\" > ${(q)3}; exit }
zle -N complete-and-say; bindkey '^X' complete-and-say"
zpty -w -n shell "$2"$'\x18'
while zpty -r shell line; do :; done
words=(${(z)"$(<$3)"}); print -r -- ${words[-1]%=}"#;

const ASK_FISH: &str = "source $argv[1]; complete -C $argv[2] | string replace -r '\\t.*' ''";

/// A shell that is quiet, reads no settings of a person, and is given these words.
fn output(shell: &Path, home: &Path, words: &[&str]) -> Output {
    Command::new(shell)
        .env("HOME", home)
        .env("XDG_CONFIG_HOME", home)
        .env("XDG_DATA_HOME", home)
        .args(words)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// That the shell reads the script without a word, and completes [`LINES`]: `ask` is given to it behind `options`, with the script,
/// a line and a file of its own.
fn completes(shell: &Path, options: &[&str], ask: &str) {
    let folder = tempfile::tempdir().unwrap();
    let name = shell.file_name().unwrap().to_str().unwrap();
    let printed = Command::new(env!("CARGO_BIN_EXE_ddfeed"))
        .args(["completions", name])
        .output()
        .unwrap();
    let script = folder.path().join("script");
    std::fs::write(&script, printed.stdout).unwrap();
    let (script, own) = (script.to_str().unwrap(), folder.path().join("own"));
    let read = output(shell, folder.path(), &["-n", script]);
    let said = String::from_utf8_lossy(&read.stderr);
    assert!(
        read.status.success() && said.is_empty(),
        "{name} does not read the script: {said}"
    );
    let mut wrong = String::new();
    for (line, expected) in LINES {
        let words = [
            options,
            &[ask],
            &words_behind(name),
            &[script, line, own.to_str().unwrap()],
        ]
        .concat();
        let answer = output(shell, folder.path(), &words);
        let completed = String::from_utf8_lossy(&answer.stdout);
        if completed.trim() != expected {
            let said = String::from_utf8_lossy(&answer.stderr);
            let _ = writeln!(wrong, "`{line}`: {:?} {said}", completed.trim());
        }
    }
    assert!(wrong.is_empty(), "{name} completes\n{wrong}");
}

/// bash and zsh take the word behind `-c`'s text for the name of what runs.
fn words_behind(name: &str) -> Vec<&str> {
    if name == "fish" { vec![] } else { vec![name] }
}

fn bash_completes_commands_flags_and_values(shell: &Path) {
    completes(shell, &["--norc", "-c"], ASK_BASH);
}

fn zsh_completes_commands_flags_and_values(shell: &Path) {
    completes(shell, &["-f", "-c"], ASK_ZSH);
}

fn fish_completes_commands_flags_and_values(shell: &Path) {
    completes(shell, &["--no-config", "-c"], ASK_FISH);
}

/// A program on the PATH.
fn installed(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .map(|folder| folder.join(name))
        .find(|program| program.is_file())
}

macro_rules! shells {
    ($($name:literal => $test:ident),+) => {
        [$(given::Test::new($name.to_owned(), installed($name), stringify!($test), $test)),+]
    };
}

fn main() {
    given::run(shells! {
        "bash" => bash_completes_commands_flags_and_values,
        "zsh" => zsh_completes_commands_flags_and_values,
        "fish" => fish_completes_commands_flags_and_values
    })
}
