//! A pattern through RTT, as fast as the probe takes it.

use super::put;
use core::sync::atomic::AtomicU32;
use link::bringup::stream_byte;
use rtt_target::{ChannelMode, UpChannel};

/// Sends while `asked`; counts what went into the channel.
pub(super) fn send(channel: &mut UpChannel, sent: &AtomicU32, asked: impl Fn() -> bool) {
    let mut count = 0u32;
    let mut piece = [0; 64];
    channel.set_mode(ChannelMode::NoBlockTrim);
    while asked() {
        for (byte, k) in piece.iter_mut().zip(0..) {
            *byte = stream_byte(count.wrapping_add(k));
        }
        #[allow(clippy::cast_possible_truncation)]
        let taken = channel.write(&piece) as u32;
        count = count.wrapping_add(taken);
        put(sent, count);
    }
}
