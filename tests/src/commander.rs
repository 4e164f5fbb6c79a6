//! A host's session over RTT's link channels in the chip's memory: how a [`Bench`](crate::bench::Bench) commands the firmware.
//!
//! Frames are written into the down-channel and read from the up-channel while no time of the chip passes.

use crate::emulator::Emulator;
use anyhow::{Context, Result};
use link::frame::{Decoder, FRAME_MAX, encode};
use link::host::rtt::Channel;
use link::message::{Command, DriveFrame, HostFrame, Reply};
use link::telemetry::Frame;
use link::{LINK_DOWN_CHANNEL, LINK_UP_CHANNEL};

/// The host's end of one session.
#[derive(Debug)]
pub struct Commander {
    up: Channel,
    down: Channel,
    decoder: Decoder,
    session: u32,
    sequence: u32,
    replies: Vec<(u32, Reply)>,
    telemetry: Vec<Frame>,
}

impl Commander {
    /// Of a firmware that has started, whose RTT block is at `block`. The first command must be [`Command::Hello`].
    ///
    /// # Errors
    /// The firmware has not set its channels up.
    pub fn new(memory: &mut Emulator, block: u32) -> Result<Self> {
        let missing = "the firmware has not set its channels up";
        Ok(Self {
            up: Channel::find(memory, block, LINK_UP_CHANNEL)?.context(missing)?,
            down: Channel::find_down(memory, block, LINK_DOWN_CHANNEL)?.context(missing)?,
            decoder: Decoder::new(),
            session: 0,
            sequence: 0,
            replies: Vec::new(),
            telemetry: Vec::new(),
        })
    }

    /// Writes a command, and gives its number.
    ///
    /// # Errors
    /// The channel has no room.
    pub fn put(&mut self, memory: &mut Emulator, command: Command) -> Result<u32> {
        self.sequence += 1;
        let frame = HostFrame {
            session: self.session,
            sequence: self.sequence,
            command,
        };
        let mut buffer = [0; FRAME_MAX];
        let bytes = encode(&frame, &mut buffer).context("a command fits a frame")?;
        let count = self.down.fill(memory, bytes)?;
        anyhow::ensure!(count == bytes.len(), "the down-channel is full");
        Ok(self.sequence)
    }

    /// The answer to the command of that number, if it has come.
    ///
    /// # Errors
    /// The channel is not as the firmware has it.
    pub fn reply(&mut self, memory: &mut Emulator, number: u32) -> Result<Option<Reply>> {
        self.drain(memory)?;
        let place = self.replies.iter().position(|(of, _)| *of == number);
        let reply = place.map(|place| self.replies.drain(..=place).next_back());
        let reply = reply.flatten().map(|(_, reply)| reply);
        if let Some(Reply::Hello { session, .. }) = reply {
            (self.session, self.sequence) = (session, 0);
        }
        Ok(reply)
    }

    /// The telemetry that has come since it was last taken.
    ///
    /// # Errors
    /// The channel is not as the firmware has it.
    pub fn take_telemetry(&mut self, memory: &mut Emulator) -> Result<Vec<Frame>> {
        self.drain(memory)?;
        Ok(std::mem::take(&mut self.telemetry))
    }

    fn drain(&mut self, memory: &mut Emulator) -> Result<()> {
        let mut bytes = Vec::new();
        self.up.drain(memory, &mut bytes)?;
        for byte in bytes {
            match self.decoder.take::<DriveFrame>(byte) {
                Some(DriveFrame::Reply(number, reply)) => self.replies.push((number, reply)),
                Some(DriveFrame::Telemetry(frame)) => self.telemetry.push(frame),
                Some(DriveFrame::Event(_)) | None => {}
            }
        }
        Ok(())
    }
}
