//! Frames of the link: postcard between a version and a check, ended by a zero byte.
//!
//! A frame is [`LAYOUT`](crate::LAYOUT) in a byte, the message, and the CRC-32 of both (ISO-HDLC, lowest byte first); COBS
//! takes all zero bytes out of it, so that a zero ends it and a reader finds the next frame wherever it starts.

use crc::{CRC_32_ISO_HDLC, Crc};
use postcard::ser_flavors::crc::CrcModifier;
use postcard::ser_flavors::{Cobs, Slice};
use serde::{Deserialize, Serialize};

/// Longest frame, bytes, its end included.
pub const FRAME_MAX: usize = 256;

/// The version in each frame.
#[allow(clippy::cast_possible_truncation)]
const VERSION: u8 = crate::LAYOUT as u8;
const _: () = assert!(crate::LAYOUT <= 0xFF, "the version is a byte");

/// With a table of 1 kB, which is the form that postcard takes.
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A message's frame, in `buffer`. `None` if it is longer than [`FRAME_MAX`].
pub fn encode<'b>(message: &impl Serialize, buffer: &'b mut [u8; FRAME_MAX]) -> Option<&'b [u8]> {
    let cobs = Cobs::try_new(Slice::new(buffer)).ok()?;
    postcard::serialize_with_flavor(&(VERSION, message), CrcModifier::new(cobs, CRC.digest()))
        .ok()
        .map(|bytes| &*bytes)
}

/// How many frames came, and what was wrong with the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameCount {
    /// Frames that were right.
    pub frames: u32,
    /// Frames whose coding or check is wrong: garbage, or a piece of a frame.
    pub damaged: u32,
    /// Frames that are longer than any.
    pub too_long: u32,
    /// Frames of another version.
    pub versions: u32,
}

/// Finds the frames in a stream of bytes.
#[derive(Clone, Debug)]
pub struct Decoder {
    frame: [u8; FRAME_MAX],
    length: usize,
    too_long: bool,
    count: FrameCount,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Of a stream that begins anywhere.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            frame: [0; FRAME_MAX],
            length: 0,
            too_long: false,
            count: FrameCount {
                frames: 0,
                damaged: 0,
                too_long: 0,
                versions: 0,
            },
        }
    }

    /// How it went so far.
    #[must_use]
    pub const fn count(&self) -> FrameCount {
        self.count
    }

    /// The next byte; a message, if it ends one. What is none is counted.
    pub fn take<T: for<'de> Deserialize<'de>>(&mut self, byte: u8) -> Option<T> {
        if byte != 0 {
            match self.frame.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.too_long = true,
            }
            return None;
        }
        let (length, too_long) = (self.length, self.too_long);
        (self.length, self.too_long) = (0, false);
        if too_long {
            count(&mut self.count.too_long);
            return None;
        }
        if length == 0 {
            // The end of nothing: a host begins with it, to end what stood in the line.
            return None;
        }
        let frame = self.frame.get_mut(..length)?;
        let message = match open(frame) {
            Ok(message) => message,
            Err(Wrong::Version) => {
                count(&mut self.count.versions);
                return None;
            }
            Err(Wrong::Damaged) => {
                count(&mut self.count.damaged);
                return None;
            }
        };
        count(&mut self.count.frames);
        Some(message)
    }
}

enum Wrong {
    Damaged,
    Version,
}

/// The message of a frame without its end.
fn open<T: for<'de> Deserialize<'de>>(frame: &mut [u8]) -> Result<T, Wrong> {
    let length = cobs::decode_in_place(frame).map_err(|_| Wrong::Damaged)?;
    let (content, check) = frame
        .get(..length)
        .and_then(|bytes| bytes.split_last_chunk::<4>())
        .ok_or(Wrong::Damaged)?;
    if CRC.checksum(content) != u32::from_le_bytes(*check) {
        return Err(Wrong::Damaged);
    }
    let (version, message) = content.split_first().ok_or(Wrong::Damaged)?;
    if *version != VERSION {
        return Err(Wrong::Version);
    }
    match postcard::take_from_bytes(message) {
        Ok((message, [])) => Ok(message),
        _ => Err(Wrong::Damaged),
    }
}

/// One more; it stays at the end of its range.
pub fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    type Message = (u32, [u8; 5], Option<i64>);

    fn frame(message: &Message) -> Vec<u8> {
        encode(message, &mut [0; FRAME_MAX]).unwrap().to_vec()
    }

    fn decode(bytes: &[u8]) -> (Vec<Message>, FrameCount) {
        let mut decoder = Decoder::new();
        let messages = bytes
            .iter()
            .filter_map(|&byte| decoder.take(byte))
            .collect();
        (messages, decoder.count())
    }

    /// The check of the CRC's own catalogue: of "123456789" it is 0xCBF43926 (reveng, CRC-32/ISO-HDLC).
    #[test]
    fn the_check_is_the_catalogue_s() {
        assert_eq!(CRC.checksum(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn another_version_is_told_from_damage() {
        let mut content = [LAST_VERSION, 1, 2, 3].to_vec();
        content.extend(CRC.checksum(&content).to_le_bytes());
        let mut coded = [0; 64];
        let length = cobs::encode(&content, &mut coded);
        let mut bytes = coded[..length].to_vec();
        bytes.push(0);
        let (messages, count) = decode(&bytes);
        assert!(messages.is_empty());
        assert_eq!((count.versions, count.damaged), (1, 0));
    }
    const LAST_VERSION: u8 = VERSION - 1;

    proptest! {
        #[test]
        fn messages_come_back_whatever_stands_between_them(
            messages in prop::collection::vec(any::<Message>(), 1..5),
            garbage in prop::collection::vec(any::<u8>(), 0..600),
        ) {
            let mut bytes = garbage;
            bytes.push(0);
            bytes.extend(messages.iter().flat_map(frame));
            let (got, count) = decode(&bytes);
            // That garbage is a frame takes a check of 32 bits to be right.
            prop_assert_eq!(&got, &messages);
            prop_assert_eq!(count.frames as usize, messages.len());
        }

        #[test]
        fn a_changed_bit_or_a_missing_byte_is_damage(
            message: Message,
            at in any::<prop::sample::Index>(),
            bit in 0u8..8,
            cut: bool,
        ) {
            let mut bytes = frame(&message);
            // Its end stays: what follows would be part of it otherwise.
            let at = at.index(bytes.len() - 1);
            if cut {
                bytes.remove(at);
            } else {
                bytes[at] ^= 1 << bit;
            }
            let (got, count) = decode(&bytes);
            prop_assert!(got.is_empty(), "{got:?}");
            prop_assert_eq!(count.frames, 0);
            prop_assert!(count.damaged >= 1);
        }

        #[test]
        fn any_bytes_are_counted_and_nothing_else(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let ends = bytes.split(|byte| *byte == 0).rev().skip(1);
            let frames = ends.filter(|frame| !frame.is_empty()).count();
            let (_, count) = decode(&bytes);
            let counted = count.frames + count.damaged + count.too_long + count.versions;
            prop_assert_eq!(counted as usize, frames);
        }
    }
}
