//! A host's session without a line or a clock: commands to bytes, bytes to the drive's frames.
//!
//! [`Client`](super::client::Client) waits for answers over a [`Line`](super::client::Line). A browser does not wait and uses this.

use crate::frame::{Decoder, FRAME_MAX, FrameCount, encode};
use crate::message::{Command, DriveFrame, HostFrame, Reply};
use anyhow::{Context, Result};

/// A session with a drive.
#[derive(Debug, Default)]
pub struct Session {
    decoder: Decoder,
    number: u32,
    sequence: u32,
    /// Number of the last [`Command::Hello`].
    hello: u32,
    simulated: bool,
    pwm_hz: f64,
    speed_hz: f64,
}

impl Session {
    /// No session yet: the drive's answer to [`Command::Hello`] opens it.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The bytes of a command's frame. Its number is then [`sequence`](Self::sequence).
    ///
    /// # Errors
    /// The command is longer than a frame.
    pub fn request(&mut self, command: Command) -> Result<Vec<u8>> {
        self.sequence = self.sequence.wrapping_add(1);
        if command == Command::Hello {
            self.hello = self.sequence;
        }
        let frame = HostFrame {
            session: self.number,
            sequence: self.sequence,
            command,
        };
        let mut buffer = [0; FRAME_MAX];
        let bytes = encode(&frame, &mut buffer).context("the command is longer than a frame")?;
        Ok(bytes.to_vec())
    }

    /// Number of the last command.
    #[must_use]
    pub fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Takes the next byte of the drive. Returns the frame that it ends.
    pub fn take(&mut self, byte: u8) -> Option<DriveFrame> {
        let frame = self.decoder.take(byte)?;
        if let DriveFrame::Reply(sequence, reply) = &frame
            && *sequence == self.hello
            && let Reply::Hello {
                session,
                simulated,
                pwm_hz,
                speed_divider,
            } = reply
        {
            (self.number, self.simulated) = (*session, *simulated);
            self.pwm_hz = f64::from(*pwm_hz);
            self.speed_hz = self.pwm_hz / f64::from((*speed_divider).max(1));
        }
        Some(frame)
    }

    /// Frames that came, and those that could not be read.
    #[must_use]
    pub fn count(&self) -> FrameCount {
        self.decoder.count()
    }

    /// The drive is a simulated one.
    #[must_use]
    pub fn simulated(&self) -> bool {
        self.simulated
    }

    /// PWM periods a second; 0 before the session is open.
    #[must_use]
    pub fn pwm_hz(&self) -> f64 {
        self.pwm_hz
    }

    /// Steps of the speed task a second; 0 before the session is open.
    #[must_use]
    pub fn speed_hz(&self) -> f64 {
        self.speed_hz
    }
}
