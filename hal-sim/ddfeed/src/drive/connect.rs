//! Lines to a drive.

use super::options::LineOptions;
use anyhow::{Context, Result, bail};
use link::host::client::{Client, Line, Lost};
use serialport::SerialPort;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(3);
/// How long bytes may take to go.
const SEND: Duration = Duration::from_secs(1);

/// A session with any drive.
pub type Drive = Client<Box<dyn Line>>;

/// Opens a session with the drive that is asked for.
pub fn open(options: &LineOptions, baud: Option<u32>) -> Result<Drive> {
    let baud = baud.unwrap_or(link::SERIAL_BAUD);
    if let Some(which) = &options.probe {
        return by_probe(which.as_deref());
    }
    let (line, begin) = match (&options.sim, &options.serial) {
        (Some(address), _) => (by_tcp(address)?, format!("at {address}")),
        (None, Some(port)) => (by_serial(port, baud)?, format!("at {port}")),
        (None, None) => bail!("which drive? Give --sim, --serial or --probe"),
    };
    Client::open(line).context(begin)
}

/// The line to a simulated drive.
pub fn by_tcp(address: &str) -> Result<Box<dyn Line>> {
    Ok(Box::new(Tcp(connect(address)?)))
}

/// The line to a drive at a serial port or a pseudo-terminal.
pub fn by_serial(port: &str, baud: u32) -> Result<Box<dyn Line>> {
    Ok(Box::new(Serial(serial(port, baud)?)))
}

#[cfg(feature = "probe")]
fn by_probe(which: Option<&str>) -> Result<Drive> {
    let which = crate::session::Which {
        probe: which.map(str::to_owned),
    };
    let line: Box<dyn Line> = Box::new(crate::probe::line::open(&which)?);
    Client::open(line).context("through the debug probe")
}

#[cfg(not(feature = "probe"))]
fn by_probe(_: Option<&str>) -> Result<Drive> {
    Err(crate::missing_feature("--probe", "probe"))
}

fn connect(address: &str) -> Result<TcpStream> {
    let known = address.to_socket_addrs().with_context(|| {
        format!("--sim is `{address}`, but an address and a port are needed, as in 127.0.0.1:7474")
    })?;
    for address in known {
        if let Ok(stream) = TcpStream::connect_timeout(&address, CONNECT) {
            stream.set_nodelay(true)?;
            stream.set_write_timeout(Some(SEND))?;
            return Ok(stream);
        }
    }
    bail!(Lost(format!(
        "no drive is served at {address}: start one with `ddfeed serve`"
    )))
}

fn serial(port: &str, baud: u32) -> Result<Box<dyn SerialPort>> {
    serialport::new(port, baud)
        .timeout(SEND)
        .open()
        .map_err(|error| {
            Lost(format!(
                "the serial port {port} cannot be opened ({error}): is the board plugged in, is another program on the \
                 port, and may you use it?"
            ))
            .into()
        })
}

struct Tcp(TcpStream);

impl Line for Tcp {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        // No time at all would be for ever.
        let patience = patience.max(Duration::from_millis(1));
        self.0.set_read_timeout(Some(patience))?;
        match self.0.read(bytes) {
            Ok(0) => Err(io::Error::new(
                ErrorKind::UnexpectedEof,
                "it was closed at the other end",
            )),
            read => nothing_yet(read),
        }
    }
}

struct Serial(Box<dyn SerialPort>);

impl Line for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.set_timeout(SEND)?;
        self.0.write_all(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        self.0.set_timeout(patience.max(Duration::from_millis(1)))?;
        nothing_yet(self.0.read(bytes))
    }
}

fn nothing_yet(read: io::Result<usize>) -> io::Result<usize> {
    match read {
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
            ) =>
        {
            Ok(0)
        }
        other => other,
    }
}
