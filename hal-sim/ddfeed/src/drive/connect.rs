//! Lines to a drive.

use super::options::LineOptions;
use anyhow::{Context, Result, bail};
use link::host::client::{Client, Line};
use link::host::refused::Lost;
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

/// A line that can go to another thread.
pub type SentLine = Box<dyn Line + Send>;

/// Which line leads to a drive.
#[derive(Clone, Debug)]
pub enum DriveLine {
    /// A served drive at this address.
    Sim(String),
    /// A serial port and its bits a second.
    Serial(String, u32),
    /// A debug probe, by a part of its line in the list.
    Probe(Option<String>),
    /// None was given.
    None,
}

impl DriveLine {
    /// Of what was asked.
    #[must_use]
    pub fn of(options: Option<&LineOptions>, baud: Option<u32>) -> Self {
        let Some(options) = options else {
            return Self::None;
        };
        match (&options.sim, &options.serial, &options.probe) {
            (Some(address), ..) => Self::Sim(address.clone()),
            (_, Some(port), _) => Self::Serial(port.clone(), baud.unwrap_or(link::SERIAL_BAUD)),
            (.., Some(which)) => Self::Probe(which.clone()),
            _ => Self::None,
        }
    }

    /// Each opening is a line of its own.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        matches!(self, Self::Sim(_))
    }

    /// Opens it.
    ///
    /// # Errors
    /// The drive is not reached.
    pub fn open(&self) -> Result<SentLine> {
        match self {
            Self::Sim(address) => by_tcp(address),
            Self::Serial(port, baud) => by_serial(port, *baud),
            Self::Probe(which) => by_probe(which.as_deref()),
            Self::None => bail!("which drive? Give --sim, --serial or --probe"),
        }
    }

    fn place(&self) -> String {
        match self {
            Self::Sim(place) | Self::Serial(place, _) => format!("at {place}"),
            Self::Probe(_) | Self::None => "through the debug probe".to_owned(),
        }
    }
}

/// Opens a session with the drive that is asked for.
pub fn open(options: &LineOptions, baud: Option<u32>) -> Result<Drive> {
    let line = DriveLine::of(Some(options), baud);
    let opened: Box<dyn Line> = line.open()?;
    Client::open(opened).with_context(|| line.place())
}

/// The line to a simulated drive.
pub fn by_tcp(address: &str) -> Result<SentLine> {
    Ok(Box::new(Tcp(connect(address)?)))
}

/// The line to a drive at a serial port or a pseudo-terminal.
pub fn by_serial(port: &str, baud: u32) -> Result<SentLine> {
    Ok(Box::new(Serial(serial(port, baud)?)))
}

#[cfg(feature = "probe")]
fn by_probe(which: Option<&str>) -> Result<SentLine> {
    let which = crate::session::Which {
        probe: which.map(str::to_owned),
    };
    Ok(Box::new(crate::probe::line::open(&which)?))
}

#[cfg(not(feature = "probe"))]
fn by_probe(_: Option<&str>) -> Result<SentLine> {
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
        // No time at all would be without end.
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
