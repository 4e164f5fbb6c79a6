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
    /// Measure the page in Chromium: `cargo xtask bench scope` does this.
    #[arg(long)]
    measure: bool,
    /// Time that the frames are counted for.
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 60,
        requires = "measure"
    )]
    seconds: u32,
    /// Print the figures as JSON.
    #[arg(long, requires = "measure")]
    json: bool,
}

fn run(options: &Options) -> Result<()> {
    let out = absolute(&options.out)?;
    let (root, target) = (root()?, target_folder()?);
    let page = Page::prepare(&root, &target, &[], &[])?;
    if options.check {
        page.check()?;
    }
    page.bundle(&out)?;
    if options.test {
        page.test(&out)?;
    }
    if !options.measure {
        println!("{}", options.out.display());
        return Ok(());
    }
    let figures = page.measure(&root, &target, &out, options.seconds)?;
    if options.json {
        println!("{}", serde_json::to_string(&figures)?);
    } else {
        for (name, value) in figures {
            println!("{name}: {value}");
        }
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
        let page = commands("cargo xtask page");
        let bench = commands("cargo xtask bench scope");
        assert!(!page.is_empty() && !bench.is_empty());
        let page = page
            .into_iter()
            .map(|command| (command.place, command.words[2..].to_vec()));
        let bench = bench.into_iter().map(|command| {
            let mut words = command.words[3..].to_vec();
            words.insert(1, "--measure".to_owned());
            (command.place, words)
        });
        for (place, words) in page.chain(bench) {
            let read = Options::try_parse_from(words);
            if let Err(error) = read
                && error.use_stderr()
            {
                panic!("{place}: {error}");
            }
        }
    }
}
