//! `ddfeed completions`: the command line's grammar as a script for a shell.

use anyhow::Result;
use clap::{Args, Command};
use clap_complete::Shell;
use std::io::{Write, stdout};

/// The program that the script completes.
const NAME: &str = "ddfeed";

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
    let mut door = door.name(NAME);
    clap_complete::generate(shell, &mut door, NAME, &mut script);
    if shell == Shell::Fish {
        for command in door.get_subcommands() {
            let name = command.get_name();
            let condition = format!("__fish_{NAME}_using_subcommand {name}");
            script.extend(positional_values(command, &condition).into_bytes());
        }
    }
    script
}

/// What clap's script for fish lacks: the values that a word without a flag may have, of a command and those below it.
fn positional_values(command: &Command, condition: &str) -> String {
    let values = command
        .get_positionals()
        .flat_map(|word| word.get_possible_values())
        .map(|value| {
            let value = value.get_name();
            format!("complete -c {NAME} -n \"{condition}\" -f -a \"{value}\"\n")
        });
    let below = command.get_subcommands().map(|below| {
        let name = below.get_name();
        positional_values(
            below,
            &format!("{condition}; and __fish_seen_subcommand_from {name}"),
        )
    });
    values.chain(below).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Arguments;
    use clap::CommandFactory;

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
}
