//! `cargo xtask bringup | flash | run | attach`: a board at a debug probe. `cargo xtask` builds and starts this program.
#![forbid(unsafe_code)]

mod ask;
mod session;

use anyhow::Result;
use board::flash;
use clap::Parser;
use ddfeed::probe::{Image, attach, find};
use session::Session;
use std::process::ExitCode;

/// A board at a debug probe.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    session: Session,
}

fn run(session: Session) -> Result<()> {
    session.check()?;
    // First, so that a missing probe is said at once and not after a build.
    let probe = find(&session.chosen().which)?;
    let alone = xtask::firmware::alone()?;
    let elf = xtask::firmware::build(session.chosen().build)?;
    let image = Image::read(&elf)?;
    drop(alone);
    if !matches!(session, Session::Attach(_)) {
        flash::flash(probe.clone(), &image)?;
    }
    match session {
        Session::Flash(_) => Ok(()),
        Session::Run(_) => flash::follow(probe, &image),
        Session::Attach(_) => attach::attach(probe, image.drive()?),
        Session::Bringup(options) => ask::bringup(probe, &image, &options),
    }
}

fn main() -> ExitCode {
    // Ends quietly on a broken pipe.
    sigpipe::reset();
    match run(Arguments::parse().session) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use given::pages::commands;

    #[test]
    fn commands_of_the_pages_are_read() {
        for name in ["attach", "bringup", "flash", "run"] {
            let commands = commands(&format!("cargo xtask {name}"));
            assert!(!commands.is_empty(), "{name}");
            for command in commands {
                let read = Arguments::try_parse_from(&command.words[1..]);
                if let Err(error) = read
                    && error.use_stderr()
                {
                    panic!("{}: {error}", command.place);
                }
            }
        }
    }
}
