//! Sizes of a signal in order.

/// Size that `share` of `whole` values stay below; 0 of none.
pub(crate) fn quantile(values: &[f64], share: usize, whole: usize) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|x| x.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let at = (sizes.len() - 1) * share / whole;
    *sizes.select_nth_unstable_by(at, f64::total_cmp).1
}
