//! `cargo xtask completions`: the door's grammar for a shell, as a script that it reads.

use anyhow::Result;
use clap::{Args, Command};
use clap_complete::Shell;
use std::io::{Write, stdout};

/// What the script completes: cargo completes what stands behind `cargo`, so this is a shell function's name.
const NAME: &str = "xtask";

/// Which shell.
#[derive(Args)]
pub struct CompletionsOptions {
    /// The shell that reads the script.
    pub shell: Shell,
}

/// Prints the script.
pub fn run(options: &CompletionsOptions, door: Command) -> Result<()> {
    stdout().write_all(&script(options.shell, door))?;
    Ok(())
}

/// The script of the grammar `door` for `shell`.
fn script(shell: Shell, door: Command) -> Vec<u8> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut door.name(NAME), NAME, &mut script);
    script
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Arguments;
    use clap::CommandFactory;
    use std::process::Command as Process;

    fn text(shell: Shell) -> String {
        String::from_utf8(script(shell, Arguments::command())).unwrap()
    }

    /// All commands of all depths, as words.
    fn commands(of: &Command, path: &[String], all: &mut Vec<Vec<String>>) {
        for command in of.get_subcommands() {
            let path = [path, &[command.get_name().to_owned()]].concat();
            commands(command, &path, all);
            all.push(path);
        }
    }

    #[test]
    fn each_shell_s_script_has_each_command_and_flag() {
        let mut all = Vec::new();
        commands(&Arguments::command(), &[], &mut all);
        assert!(all.contains(&["drive", "settings", "set"].map(str::to_owned).to_vec()));
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let script = text(shell);
            for path in &all {
                let name = path.last().unwrap();
                assert!(script.contains(name.as_str()), "{shell}: no {path:?}");
            }
            for flag in ["table-speed", "speed-loop", "json", "pty"] {
                assert!(script.contains(flag), "{shell}: no --{flag}");
            }
        }
    }

    /// What a line that ends with the word to complete is completed to by bash; `None` where bash is not there.
    fn completed(line: &str) -> Option<String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("xtask.bash");
        std::fs::write(&file, text(Shell::Bash)).unwrap();
        let parsed = Process::new("bash").arg("-n").arg(&file).status().ok()?;
        assert!(parsed.success(), "bash does not parse the script");
        let asked = "source \"$1\"; COMP_WORDS=($2); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); \
                     \"$(complete -p xtask | sed 's/.*-F \\([^ ]*\\).*/\\1/')\" xtask \"${COMP_WORDS[-1]}\" \
                     \"${COMP_WORDS[-2]}\"; echo \"${COMPREPLY[*]}\"";
        let output = Process::new("bash")
            .args(["-c", asked, "bash"])
            .arg(&file)
            .arg(line)
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        Some(String::from_utf8(output.stdout).unwrap().trim().to_owned())
    }

    #[test]
    fn bash_completes_commands_flags_and_values() {
        for (line, expected) in [
            ("xtask ser", "serve"),
            ("xtask drive --sim 127.0.0.1:7474 tu", "tune"),
            (
                "xtask drive --sim 127.0.0.1:7474 tune --spe",
                "--speed-loop",
            ),
            ("xtask drive settings imp", "import"),
            ("xtask bench com", "commission"),
            ("xtask completions fi", "fish"),
        ] {
            let Some(words) = completed(line) else { return };
            assert_eq!(words, expected, "{line}");
        }
    }
}
