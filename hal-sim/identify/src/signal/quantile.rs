//! Quantiles of values.

/// The value that a share of the values, 0 to 1, is below; `None` where there is none.
pub(crate) fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let at = (share * values.len().checked_sub(1)? as f64) as usize;
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Of the values' sizes; 0 where there is none.
pub(crate) fn quantile_of_sizes(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    quantile(values.into_iter().map(f64::abs), share).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_values_is_below() {
        let values = || (0..=100).rev().map(f64::from);
        for (share, expected) in [(0.0, 0.0), (0.05, 5.0), (0.5, 50.0), (1.0, 100.0)] {
            assert_eq!(quantile(values(), share), Some(expected));
        }
        assert_eq!(quantile([], 0.5), None);
        assert_eq!(quantile_of_sizes([-3.0, 1.0, 2.0], 1.0), 3.0);
        assert_eq!(quantile_of_sizes([], 0.5), 0.0);
    }
}
