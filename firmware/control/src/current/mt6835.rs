//! MagnTek MT6835: what its burst read of the angle says (MT6835 datasheet, SPI interface).
//!
//! After the 16 bits of the command (`0xA`, address `0x003`) the sensor sends registers 0x003 to 0x006, which are taken
//! as one word: 21 bits of angle, 3 of status, 8 of check. The check is the remainder of the first 24 bits by
//! `x^8 + x^2 + x + 1`, from zero, highest bit first; so the whole word leaves none. It finds every burst of up to eight
//! wrong bits, and all but one in 256 of what is longer.

/// Counts a turn.
pub const COUNTS_PER_TURN: u32 = 1 << 21;

/// What to send, as words of 16 bits: the command, and clocks for the answer.
pub const BURST_READ: [u16; 3] = [0xA003, 0, 0];

/// Status bits: rotation too fast for the sensor, magnetic field too weak, supply too low. With any of them the angle
/// is not to be trusted.
const STATUS: u32 = 0x700;

/// The angle in counts, if the frame arrived whole and the sensor vouches for it.
#[must_use]
#[inline(always)]
pub const fn counts(frame: u32) -> Option<u32> {
    if remainder(frame) == 0 && frame & STATUS == 0 {
        Some(frame >> 11)
    } else {
        None
    }
}

/// The frame arrived whole, whatever its status says.
#[must_use]
pub const fn is_whole(frame: u32) -> bool {
    remainder(frame) == 0
}

/// The residual of `frame` modulo `x^8 + x^2 + x + 1`, without a table: `x^16` is `x^4 + x^2 + 1` there, and `x^8` is
/// `x^2 + x + 1`, so the upper bits fold onto the lower ones: 32 bits to 20, to 14, to 8.
#[inline(always)]
const fn remainder(frame: u32) -> u32 {
    let upper = frame >> 16;
    let folded = frame & 0xFFFF ^ upper ^ upper << 2 ^ upper << 4;
    let upper = folded >> 8;
    let folded = folded & 0xFF ^ upper ^ upper << 1 ^ upper << 2;
    let upper = folded >> 8;
    folded & 0xFF ^ upper ^ upper << 1 ^ upper << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The check as the datasheet states it, bit by bit.
    fn check(angle_and_status: u32) -> u32 {
        let mut register = 0;
        for bit in (0..24).rev() {
            let out = ((register >> 7) ^ (angle_and_status >> bit)) & 1;
            register = ((register << 1) & 0xFF) ^ (out * 0x07);
        }
        register
    }

    fn frame(counts: u32, status: u32) -> u32 {
        let data = counts << 3 | status;
        data << 8 | check(data)
    }

    /// CRC-8 of this polynomial (CRC-8/SMBUS: no reflection, from zero) has published checks: "123456789" gives 0xF4;
    /// of three bytes, those of 0xFFFFFF (a line that is held high) and 0x000001 are known by hand.
    #[test]
    fn known_answers() {
        assert_eq!(check(0xFF_FFFF), 0x0F);
        assert_eq!(check(0x00_0001), 0x07);
        assert_eq!(counts(0xFFFF_FFFF), None, "a line that is held high");
        assert_eq!(counts(0x0000_0107), None, "over-speed, though whole");
        let nine = b"123456789".iter().fold(0u32, |register, byte| {
            (0..8).rev().fold(register, |register, bit| {
                let out = ((register >> 7) ^ u32::from(byte >> bit)) & 1;
                ((register << 1) & 0xFF) ^ (out * 0x07)
            })
        });
        assert_eq!(nine, 0xF4);
    }

    proptest! {
        #[test]
        fn what_the_sensor_sends_is_read(angle in 0..COUNTS_PER_TURN, status in 0u32..8) {
            let expected = (status == 0).then_some(angle);
            prop_assert_eq!(counts(frame(angle, status)), expected);
        }

        #[test]
        fn a_burst_of_wrong_bits_is_found(angle in 0..COUNTS_PER_TURN, burst in 1u32..256, at in 0u32..25) {
            prop_assert_eq!(counts(frame(angle, 0) ^ burst << at), None);
        }

        #[test]
        fn the_folded_remainder_is_the_check(word in any::<u32>()) {
            prop_assert_eq!(remainder(word), check(word >> 8) ^ word & 0xFF);
        }
    }
}
