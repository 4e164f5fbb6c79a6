//! `cargo xtask page`: builds the browser page.
#![forbid(unsafe_code)]

use anyhow::Result;
use browser::Page;
use clap::Parser;
use std::path::{PathBuf, absolute};
use std::process::ExitCode;
use xtask::tools::{root, target_folder};

/// Build the browser page: one HTML file with the simulated drive in it. It takes Node 20 or newer with npm.
#[derive(Parser)]
#[command(name = "cargo xtask page", bin_name = "cargo xtask page")]
struct Options {
    /// File of the page.
    #[arg(long, value_name = "FILE", default_value = "out/scope.html")]
    out: PathBuf,
    /// Check the types of the page's TypeScript before.
    #[arg(long)]
    check: bool,
    /// Run the page's tests in Chromium after. Those at `ddfeed scope` need a build of `ddfeed` with all features: its path is in DDFEED.
    #[arg(long)]
    test: bool,
    /// Measure the page in Chromium for so many seconds, and print JSON.
    #[arg(long, value_name = "SECONDS")]
    measure: Option<u32>,
}

fn run(options: &Options) -> Result<()> {
    let out = absolute(&options.out)?;
    let root = root()?;
    let page = Page::prepare(&root, &target_folder()?, &[], &[])?;
    if options.check {
        page.check()?;
    }
    page.bundle(&out)?;
    if options.test {
        page.test(&out)?;
    }
    match options.measure {
        Some(seconds) => println!("{}", page.measure(&root, &out, seconds)?),
        None => println!("{}", options.out.display()),
    }
    Ok(())
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
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
        let commands = commands("cargo xtask page");
        assert!(!commands.is_empty());
        for command in commands {
            let read = Options::try_parse_from(&command.words[2..]);
            if let Err(error) = read
                && error.use_stderr()
            {
                panic!("{}: {error}", command.place);
            }
        }
    }
}
