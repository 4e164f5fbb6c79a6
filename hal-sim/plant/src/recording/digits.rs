//! Numbers with a fixed count of digits behind the point, quicker than the standard library's exact ones.

use std::io::Write;

/// Units of the last digit up to which scaling rounds by less than a hundredth of one (2^-53 of it).
const LARGEST: f64 = 5e13;

/// Appends `value` with `decimals` digits behind the point, up to 9, rounded to the nearest; what is not finite or too large as
/// the standard library writes it.
pub(super) fn append(line: &mut Vec<u8>, value: f64, decimals: usize) {
    let unit = 10u64.pow(decimals as u32);
    let scaled = (value * unit as f64).round();
    if scaled.is_nan() || scaled.abs() >= LARGEST {
        // Writing to memory does not fail.
        let _ = write!(line, "{value:.decimals$}");
        return;
    }
    // As the standard library writes what rounds to zero, too.
    if value.is_sign_negative() {
        line.push(b'-');
    }
    let digits = scaled.abs() as u64;
    let mut buffer = itoa::Buffer::new();
    line.extend_from_slice(buffer.format(digits / unit).as_bytes());
    if decimals > 0 {
        line.push(b'.');
        // A leading 1 keeps the zeros behind the point.
        let behind = buffer.format(unit + digits % unit).as_bytes();
        line.extend_from_slice(&behind[1..]);
    }
}

#[cfg(test)]
mod tests {
    use super::append;
    use proptest::prelude::*;

    fn text(value: f64, decimals: usize) -> String {
        let mut line = Vec::new();
        append(&mut line, value, decimals);
        String::from_utf8(line).unwrap()
    }

    proptest! {
        /// Within half a last digit of the value, as the standard library's is.
        #[test]
        fn it_is_the_standard_librarys_number(value in -1e4..1e4f64, decimals in 0usize..10) {
            let (got, exact) = (text(value, decimals), format!("{value:.decimals$}"));
            let off = (got.parse::<f64>().unwrap() - value).abs();
            let last = 10f64.powi(-(decimals as i32));
            prop_assert!(off <= 0.51 * last, "{got} for {exact}");
            let fraction = |text: &str| text.split_once('.').map_or(0, |(_, behind)| behind.len());
            prop_assert_eq!(fraction(&got), decimals);
        }
    }

    #[test]
    fn ends_and_zeros() {
        for (value, decimals, expected) in [
            (0.0, 4, "0.0000"),
            (-0.000_01, 4, "-0.0000"),
            (-1.5, 3, "-1.500"),
            (0.000_000_001, 9, "0.000000001"),
            (1e300, 0, &format!("{:.0}", 1e300)),
            (f64::NAN, 4, "NaN"),
            (f64::NEG_INFINITY, 4, "-inf"),
        ] {
            assert_eq!(text(value, decimals), expected);
        }
    }
}
