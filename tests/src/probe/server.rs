//! A network address at which a debugger finds the probe. One debugger at a time: another is turned away.

use super::remote::{LONGEST, Remote};
use crate::emulator::Emulator;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};

/// The debugger that is connected.
struct Debugger {
    stream: TcpStream,
    remote: Remote,
    /// Bytes of a command that has not ended; `None`: none has begun.
    command: Option<Vec<u8>>,
}

/// The address, and who is there.
pub struct Server {
    listener: TcpListener,
    debugger: Option<Debugger>,
    /// What the chip refused a debugger, in sentences that were not taken yet.
    pub refused: Vec<String>,
}

impl Server {
    /// Waits at an address.
    ///
    /// # Errors
    /// The address cannot be had.
    pub fn new(address: impl ToSocketAddrs) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            debugger: None,
            refused: Vec::new(),
        })
    }

    /// The address.
    ///
    /// # Errors
    /// The system does not say.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Somebody is connected.
    #[must_use]
    pub fn is_used(&self) -> bool {
        self.debugger.is_some()
    }

    /// Ends the debugger's connection, as a cable does that is pulled. The chip stays as it was left.
    pub fn hang_up(&mut self) {
        self.debugger = None;
    }

    /// Answers what has come; the chip's time passes only by what is asked for. `true`: something had come.
    ///
    /// # Errors
    /// The address is lost.
    pub fn serve(&mut self, chip: &mut Emulator) -> io::Result<bool> {
        let mut came = self.answer(chip);
        let stream = match self.listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(came),
            Err(error) => return Err(error),
        };
        // Who comes next may come before the end of the last was heard.
        came |= self.answer(chip);
        match self.debugger {
            None => {
                stream.set_nonblocking(true)?;
                stream.set_nodelay(true)?;
                self.debugger = Some(Debugger {
                    stream,
                    remote: Remote::default(),
                    command: None,
                });
            }
            // The other hears the end of its connection.
            Some(_) => drop(stream),
        }
        Ok(came)
    }

    /// Answers the debugger. `true`: something had come.
    fn answer(&mut self, chip: &mut Emulator) -> bool {
        let Some(debugger) = &mut self.debugger else {
            return false;
        };
        match debugger.answer(chip, &mut |error| self.refused.push(error)) {
            Ok(count) => count > 0,
            // It is gone; the chip stays as it was left.
            Err(_) => {
                self.debugger = None;
                true
            }
        }
    }
}

impl Debugger {
    /// Answers the commands that have come: how many bytes there were.
    fn answer(
        &mut self,
        chip: &mut Emulator,
        refused: &mut dyn FnMut(String),
    ) -> io::Result<usize> {
        let mut bytes = [0; 4 * LONGEST];
        let count = match self.stream.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::ConnectionReset.into()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(0),
            Err(error) => return Err(error),
        };
        let mut answers = String::new();
        for &byte in &bytes[..count] {
            match (byte, &mut self.command) {
                (b'!', command) => *command = Some(Vec::new()),
                (b'#', command) => {
                    if let Some(command) = command.take() {
                        let command = String::from_utf8_lossy(&command);
                        answers += &self.remote.answer(&command, chip, refused);
                    }
                }
                (byte, Some(command)) if command.len() < LONGEST => command.push(byte),
                // Beyond the longest, or outside of a command.
                (_, command) => *command = None,
            }
        }
        self.stream.set_nonblocking(false)?;
        self.stream.write_all(answers.as_bytes())?;
        self.stream.set_nonblocking(true)?;
        Ok(count)
    }
}
