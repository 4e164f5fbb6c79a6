//! `cargo xtask`: builds xtask and runs it.
#![forbid(unsafe_code)]

use launch::Program;
use std::process::ExitCode;

fn main() -> ExitCode {
    let xtask = Program {
        package: "xtask",
        build: &[],
        environment: &[],
    };
    match xtask.run(std::env::args_os().skip(1)) {
        Ok(status) if status.success() => ExitCode::SUCCESS,
        // It has said why.
        Ok(status) => status
            .code()
            .and_then(|code| u8::try_from(code).ok())
            .map_or(ExitCode::FAILURE, ExitCode::from),
        Err(error) => {
            eprintln!("error: cargo could not be started: {error}; is it on the PATH?");
            ExitCode::FAILURE
        }
    }
}
