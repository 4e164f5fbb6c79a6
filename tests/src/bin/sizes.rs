//! Prints what the firmware takes of the chip's memories, as a table or with `--json` as JSON.

use std::process::ExitCode;
use tests::bench::firmware;
use tests::image::Image;
use tests::sizes::sizes;

fn main() -> ExitCode {
    sigpipe::reset();
    let json = std::env::args()
        .skip(1)
        .any(|argument| argument == "--json");
    match firmware()
        .and_then(|path| Image::read(&path))
        .and_then(|image| sizes(&image))
    {
        Ok(sizes) if json => println!("{}", sizes.json()),
        Ok(sizes) => println!("{sizes}"),
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
