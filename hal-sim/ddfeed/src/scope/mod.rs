//! `ddfeed scope`: serves the browser page, and the line to a drive as a WebSocket.

mod access;
#[cfg(feature = "foxglove")]
mod foxglove;
mod page;
mod relay;
mod server;

use crate::drive::LineOptions;
use anyhow::Result;
use clap::Args;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Which drive, and where the page is served.
#[derive(Args, Debug)]
#[command(mut_group("LineOptions", |group| group.required(false)))]
pub struct ScopeOptions {
    /// The drive. Without it the page simulates one by itself.
    #[command(flatten)]
    pub line: Option<LineOptions>,
    /// Bits a second of the serial port. [default: 4000000, the firmware's]
    #[arg(long, requires = "serial")]
    pub baud: Option<u32>,
    /// Address of the page. Any other than this computer's own takes the token that is printed.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:7475")]
    pub listen: SocketAddr,
    /// The page's file. [default: scope.html beside this program, or out/scope.html]
    #[arg(long, value_name = "FILE")]
    pub page: Option<PathBuf>,
    /// Serve the drive to Foxglove in place of the page, at an address of this computer. [default address: 127.0.0.1:8765]
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8765",
        conflicts_with_all = ["listen", "page"],
        requires = "LineOptions"
    )]
    pub foxglove: Option<SocketAddr>,
    /// Foxglove may arm and home the drive, and set its settings. Without it Foxglove sees, and may stop.
    #[arg(long, requires = "foxglove")]
    pub foxglove_commands: bool,
}

/// Serves until Ctrl-C.
///
/// # Errors
/// The page is not there, the drive is not reached, or the address is in use.
pub fn run(options: &ScopeOptions) -> Result<()> {
    if let (Some(listen), Some(line)) = (options.foxglove, &options.line) {
        return by_foxglove(options, line, listen);
    }
    let page = page::read(options.page.as_deref())?;
    server::run(options, page)
}

#[cfg(feature = "foxglove")]
use foxglove::run as by_foxglove;

#[cfg(not(feature = "foxglove"))]
fn by_foxglove(_: &ScopeOptions, _: &LineOptions, _: SocketAddr) -> Result<()> {
    Err(crate::missing_feature("--foxglove", "foxglove"))
}
