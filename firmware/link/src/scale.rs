//! Fraction bits of the fixed-point words: a word's value is its integer times `2^-bits` of the unit.
//!
//! The firmware checks at compile time that these are its control law's formats.

/// Current, A.
pub const CURRENT: u32 = 20;
/// Voltage, V.
pub const VOLTAGE: u32 = 18;
/// Angular speed of the shaft or of the electrical angle, rad/s.
pub const SPEED: u32 = 16;
/// Base speed in a command, mechanical rad/s.
pub const BASE_SPEED: u32 = 18;
/// Table velocity in a command, m/s.
pub const TABLE_VELOCITY: u32 = 28;

/// What a telemetry sample leaves out of a current: 2^-12 A are a tenth of a count of a 12-bit ADC over 10 A.
pub const SAMPLE_CURRENT_DROPS: u32 = 8;
/// What a telemetry sample leaves out of a voltage: 2^-13 V are a three-hundredth of a step of the PWM at 310 V.
pub const SAMPLE_VOLTAGE_DROPS: u32 = 5;

/// A word's value in its unit.
#[must_use]
pub fn value(word: i32, bits: u32) -> f64 {
    f64::from(word) / (1u64 << (bits & 31)) as f64
}

/// The word for a value, the nearest; `None` if the format does not hold it.
#[must_use]
pub fn word(value: f64, bits: u32) -> Option<i32> {
    let scaled = value * (1u64 << (bits & 31)) as f64;
    // The cast rounds towards zero, so half a step is added away from it.
    let rounded = if scaled < 0.0 {
        scaled - 0.5
    } else {
        scaled + 0.5
    };
    #[allow(clippy::cast_possible_truncation)]
    (rounded > -2_147_483_649.0 && rounded < 2_147_483_648.0).then_some(rounded as i32)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn a_word_is_the_nearest_and_none_beyond_the_format() {
        assert_eq!(word(-1.5, CURRENT), Some(-3 << 19));
        assert_eq!(value(-3 << 19, CURRENT), -1.5);
        assert_eq!(word(0.49, 1), Some(1));
        for beyond in [8.0, -8.1, f64::NAN, f64::INFINITY] {
            assert_eq!(word(beyond, TABLE_VELOCITY), None);
        }
    }
}
