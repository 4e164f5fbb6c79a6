//! Figures in sentences.

/// At most three significant digits, without powers of ten.
pub fn three(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.0}");
    }
    let places = 2 - value.abs().log10().floor() as i32;
    let unit = 10f64.powi(-places);
    let text = format!(
        "{:.*}",
        places.max(0) as usize,
        (value / unit).round() * unit
    );
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_three_digits() {
        for (value, text) in [
            (292_499.1, "292000"),
            (603.4, "603"),
            (42.37, "42.4"),
            (1.0, "1"),
            (0.012_345, "0.0123"),
            (9.999, "10"),
            (0.0, "0"),
        ] {
            assert_eq!(three(value), text);
        }
    }
}
