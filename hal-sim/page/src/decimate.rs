//! Fewer points of a line that look the same.

use super::axis::extent;
use std::ops::Range;

/// At most a lowest and a highest point for each of `columns` equal parts of x, in their order. The points must be
/// finite.
pub fn decimate(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let Some(Range { start, end }) = extent(points.iter().map(|p| p.0)) else {
        return Vec::new();
    };
    if points.len() <= 2 * columns || end <= start {
        return points.to_vec();
    }
    let column = |p: &(f64, f64)| ((p.0 - start) / (end - start) * columns as f64) as usize;
    points
        .chunk_by(|a, b| column(a) == column(b))
        .flat_map(|part| {
            let by_y =
                |a: &&(usize, &(f64, f64)), b: &&(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
            let part: Vec<_> = part.iter().enumerate().collect();
            let low = part.iter().min_by(by_y).map(|p| p.0);
            let high = part.iter().max_by(by_y).map(|p| p.0);
            let mut kept: Vec<usize> = low.into_iter().chain(high).collect();
            kept.sort_unstable();
            kept.dedup();
            kept.into_iter()
                .map(move |k| *part[k].1)
                .collect::<Vec<_>>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimation_keeps_the_extremes_and_the_order() {
        let points: Vec<_> = (0..10_000)
            .map(|k| {
                (
                    f64::from(k),
                    if k == 4_321 { 9.0 } else { f64::from(k % 2) },
                )
            })
            .collect();
        let kept = decimate(&points, 50);
        assert!(
            kept.len() <= 102 && kept.contains(&(4_321.0, 9.0)) && kept.iter().any(|p| p.1 == 0.0),
            "kept {} points, allowed 102; peak and floor must be among {kept:?}",
            kept.len()
        );
        assert!(
            kept.is_sorted_by(|a, b| a.0 < b.0),
            "not in order: {kept:?}"
        );
    }
}
