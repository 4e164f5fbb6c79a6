//! The MagnTek MT6835 as its datasheet has it: what it sends for an angle.

/// The word of registers 0x003 to 0x006 for an angle of 21 bits and a status of 3: both, and their check by
/// `x^8 + x^2 + x + 1`, highest bit first, from zero.
#[must_use]
pub fn frame(counts: u32, status: u32) -> u32 {
    let data = ((counts & 0x1F_FFFF) << 3) | (status & 7);
    let check = (0..24).rev().fold(0, |register, bit| {
        let out = ((register >> 7) ^ (data >> bit)) & 1;
        ((register << 1) & 0xFF) ^ (out * 0x07)
    });
    (data << 8) | check
}
