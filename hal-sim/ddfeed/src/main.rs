//! The program `ddfeed`.
#![forbid(unsafe_code)]

mod completions;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};
#[cfg(feature = "scope")]
use ddfeed::scope;
use ddfeed::{compensate, drive, identify, ripple, serve, simulate};
use std::process::ExitCode;

/// Drive software for a double-drive differential feed.
#[derive(Parser)]
#[command(name = "ddfeed", version)]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run the drive on a simulated machine and report how smoothly the table moves.
    Simulate(Box<simulate::Options>),
    /// Compare a model with a recording, and find the effect that the model lacks.
    Identify(identify::IdentifyOptions),
    /// Simulate a drive behind its link, in real time. `drive --sim` commands it.
    Serve(serve::ServeOptions),
    /// Command a drive over its link: a simulated one, or one at a serial port or a debug probe.
    Drive(drive::DriveOptions),
    /// Print the ripple of each hold of a recording with its strongest orders, and draw them on a page.
    Ripple(ripple::RippleOptions),
    /// Turn a model's effects into settings that compensate them, and predict the ripple.
    Compensate(compensate::CompensateOptions),
    /// Print all settings of a drive with unit, range, default and meaning.
    Settings(drive::ReferenceOptions),
    /// Record a drive over its link, into a folder that `identify` reads: the same as `drive ... record`.
    Record(drive::RecordCommand),
    /// Serve the browser page: live plots and commands for a drive.
    #[cfg(feature = "scope")]
    Scope(scope::ScopeOptions),
    /// Serve the browser page. This ddfeed was built without it.
    #[cfg(not(feature = "scope"))]
    #[command(disable_help_flag = true)]
    Scope(Unread),
    /// Print a script that completes this command line in a shell.
    Completions(completions::CompletionsOptions),
}

/// Words of a command that this program lacks.
#[cfg(not(feature = "scope"))]
#[derive(clap::Args)]
struct Unread {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _words: Vec<String>,
}

/// Every value may be a negative number: an option's own range then says what is possible.
fn with_negative_numbers(command: Command) -> Command {
    command
        .mut_args(|argument| match argument.get_action().takes_values() {
            true => argument.allow_negative_numbers(true),
            false => argument,
        })
        .mut_subcommands(with_negative_numbers)
}

fn main() -> ExitCode {
    // Ends quietly on a broken pipe: `ddfeed ... | head`.
    sigpipe::reset();
    let matches = with_negative_numbers(Arguments::command()).get_matches();
    let arguments = Arguments::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match arguments.command {
        Task::Simulate(options) => simulate::run(&options),
        Task::Identify(options) => identify::run(&options),
        Task::Serve(options) => serve::run(&options),
        Task::Drive(options) => drive::run(&options),
        Task::Ripple(options) => ripple::run(&options),
        Task::Compensate(options) => compensate::run(&options).map(drop),
        Task::Settings(options) => {
            drive::reference(&options);
            Ok(())
        }
        Task::Record(options) => drive::run(&options.into()),
        #[cfg(feature = "scope")]
        Task::Scope(options) => scope::run(&options),
        #[cfg(not(feature = "scope"))]
        Task::Scope(_) => Err(ddfeed::missing_feature("`scope`", "scope")),
        Task::Completions(options) => completions::run(&options, Arguments::command()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            drive::exit_code(&error)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::error::ErrorKind;
    use given::pages::commands;

    /// What a command between backticks may leave out.
    const LEFT_OUT: [ErrorKind; 3] = [
        ErrorKind::InvalidValue,
        ErrorKind::MissingRequiredArgument,
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand,
    ];

    #[test]
    fn commands_of_the_pages_are_read() {
        let commands = commands("cargo ddfeed");
        assert!(!commands.is_empty());
        for command in commands {
            let read = with_negative_numbers(Arguments::command())
                .try_get_matches_from(&command.words[1..]);
            if let Err(error) = read
                && error.use_stderr()
                && (command.is_whole || !LEFT_OUT.contains(&error.kind()))
            {
                panic!("{}: {error}", command.place);
            }
        }
    }
}
