//! Errors over time, about their mean.

/// Takes the mean off all errors, and gives their root mean square, in their unit. Pairs of (s, error).
pub fn about_mean(errors: &mut [(f64, f64)]) -> f64 {
    let count = errors.len() as f64;
    let mean = errors.iter().map(|(_, off)| off).sum::<f64>() / count;
    errors.iter_mut().for_each(|(_, off)| *off -= mean);
    (errors.iter().map(|(_, off)| off * off).sum::<f64>() / count).sqrt()
}
