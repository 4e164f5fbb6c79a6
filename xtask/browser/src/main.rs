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
    /// Run the page's tests in Chromium after.
    #[arg(long)]
    test: bool,
}

fn run(options: &Options) -> Result<()> {
    let out = absolute(&options.out)?;
    let page = Page::prepare(&root()?, &target_folder()?, &[], &[])?;
    if options.check {
        page.check()?;
    }
    page.bundle(&out)?;
    if options.test {
        page.test(&out)?;
    }
    println!("{}", options.out.display());
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
