//! A network address at which a debugger finds the probe. One debugger at a time: another is turned away.

use super::remote::{LONGEST, Remote};
use crate::emulator::Emulator;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

/// How often another debugger is looked for: each look costs a call of the system.
const OTHERS: Duration = Duration::from_millis(5);

/// The debugger that is connected. A thread reads what it sends, so that a look costs no call of the system.
struct Debugger {
    stream: TcpStream,
    sent: Receiver<Vec<u8>>,
    /// What has come and is not answered yet.
    waiting: Option<Vec<u8>>,
    remote: Remote,
    /// Bytes of a command that has not ended; `None`: none has begun.
    command: Option<Vec<u8>>,
}

impl Drop for Debugger {
    fn drop(&mut self) {
        // The reading thread ends with the connection, which may have ended before.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

/// The address, and who is there.
pub struct Server {
    listener: TcpListener,
    debugger: Option<Debugger>,
    /// When somebody was last looked for.
    looked: Instant,
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
            looked: Instant::now(),
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
        if self.looked.elapsed() < OTHERS {
            return Ok(came);
        }
        self.looked = Instant::now();
        let stream = match self.listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(came),
            Err(error) => return Err(error),
        };
        // Who comes next may come before the end of the last was heard.
        came |= self.answer(chip);
        match self.debugger {
            None => self.debugger = Some(Debugger::new(stream)?),
            // The other hears the end of its connection.
            Some(_) => drop(stream),
        }
        Ok(came)
    }

    /// Waits until the debugger sends something, at most so long.
    pub fn rest(&mut self, most: Duration) {
        match &mut self.debugger {
            Some(debugger) => debugger.rest(most),
            None => thread::sleep(most),
        }
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
    fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        let mut reader = stream.try_clone()?;
        let (sender, sent) = channel();
        thread::spawn(move || {
            let mut bytes = [0; 4 * LONGEST];
            while let Ok(count @ 1..) = reader.read(&mut bytes) {
                if sender.send(bytes[..count].to_vec()).is_err() {
                    break;
                }
            }
        });
        Ok(Self {
            stream,
            sent,
            waiting: None,
            remote: Remote::default(),
            command: None,
        })
    }

    fn rest(&mut self, most: Duration) {
        if self.waiting.is_some() {
            return;
        }
        match self.sent.recv_timeout(most) {
            Ok(bytes) => self.waiting = Some(bytes),
            // The next look hears that it is gone.
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
        }
    }

    /// Answers the commands that have come: how many bytes there were.
    fn answer(
        &mut self,
        chip: &mut Emulator,
        refused: &mut dyn FnMut(String),
    ) -> io::Result<usize> {
        let bytes = match self.waiting.take() {
            Some(bytes) => bytes,
            None => match self.sent.try_recv() {
                Ok(bytes) => bytes,
                Err(TryRecvError::Empty) => return Ok(0),
                Err(TryRecvError::Disconnected) => return Err(ErrorKind::ConnectionReset.into()),
            },
        };
        let mut answers = String::new();
        for &byte in &bytes {
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
        self.stream.write_all(answers.as_bytes())?;
        Ok(bytes.len())
    }
}
