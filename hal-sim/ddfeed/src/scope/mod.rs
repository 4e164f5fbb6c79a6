//! `ddfeed scope`: serves the browser page, and the line to a drive as a WebSocket.

mod access;
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
}

/// Serves until Ctrl-C.
///
/// # Errors
/// The page is not there, the drive is not reached, or the address is in use.
pub fn run(options: &ScopeOptions) -> Result<()> {
    let page = page::read(options.page.as_deref())?;
    server::run(options, page)
}
