//! Small regressions over stretches of a record, with errors that hold whatever the residual's colour.

use crate::regression::inverse::eigenvalue_range;
use nalgebra::{DMatrix, DVector};

/// Groups of neighbouring rows that are left out in turn.
const GROUPS: usize = 10;

/// Coefficients with their standard errors.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) values: Vec<f64>,
    pub(super) errors: Vec<f64>,
    /// Share of the measured squares that is explained.
    pub(super) explained: f64,
}

/// Least squares of `measured` on `columns`; errors by the delete-a-group jackknife, which needs no model of the
/// residual's correlation (Kott, *Journal of Official Statistics* 17, 521-526, 2001). `None` where the columns do not tell
/// the coefficients apart.
pub(super) fn fit(columns: &[Vec<f64>], measured: &[f64]) -> Option<Fit> {
    let (rows, width) = (measured.len(), columns.len());
    if rows < 3 * GROUPS * width.max(1) {
        return None;
    }
    let scales: Vec<f64> = columns.iter().map(|column| rms(column)).collect();
    if scales
        .iter()
        .any(|scale| !(*scale > 0.0 && scale.is_finite()))
    {
        return None;
    }
    let mut groups = Vec::with_capacity(GROUPS);
    for group in 0..GROUPS {
        let rows = rows * group / GROUPS..rows * (group + 1) / GROUPS;
        let mut normal = DMatrix::zeros(width, width);
        let mut right = DVector::zeros(width);
        for row in rows {
            for a in 0..width {
                let x = columns[a][row] / scales[a];
                right[a] += x * measured[row];
                for b in 0..=a {
                    normal[(a, b)] += x * columns[b][row] / scales[b];
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        groups.push((normal, right));
    }
    let sum = |without: Option<usize>| {
        let kept = groups
            .iter()
            .enumerate()
            .filter(|(k, _)| Some(*k) != without);
        kept.fold(
            (DMatrix::zeros(width, width), DVector::zeros(width)),
            |(a, b), (_, (normal, right))| (a + normal, b + right),
        )
    };
    let solve = |(normal, right): (DMatrix<f64>, DVector<f64>)| {
        let [least, most] = eigenvalue_range(&normal)?;
        (least > 1e-7 * most).then(|| normal.cholesky().map(|c| c.solve(&right)))?
    };
    let all = solve(sum(None))?;
    let mut spread = DVector::zeros(width);
    for group in 0..GROUPS {
        let other = solve(sum(Some(group)))?;
        spread += (other - &all).map(|d| d * d);
    }
    let errors = spread.map(|s| (s * (GROUPS - 1) as f64 / GROUPS as f64).sqrt());
    let values: Vec<f64> = (0..width).map(|k| all[k] / scales[k]).collect();
    let (mut left, mut whole) = (0.0, 0.0);
    for row in 0..rows {
        let model: f64 = (0..width).map(|k| values[k] * columns[k][row]).sum();
        left += (measured[row] - model).powi(2);
        whole += measured[row].powi(2);
    }
    Some(Fit {
        errors: (0..width).map(|k| errors[k] / scales[k]).collect(),
        values,
        explained: if whole > 0.0 { 1.0 - left / whole } else { 0.0 },
    })
}

pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_hold_for_a_coloured_residual() {
        let (mut state, mut noise) = (1u64, 0.0);
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as f64 / f64::from(1u32 << 31) - 0.5
        };
        let (mut off, trials) = (0, 200);
        for _ in 0..trials {
            let x: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.05).sin()).collect();
            let measured: Vec<f64> = x
                .iter()
                .map(|x| {
                    noise = 0.9 * noise + random();
                    2.0 * x + noise
                })
                .collect();
            let fit = fit(&[x, vec![1.0; 1000]], &measured).expect("a fit");
            off += usize::from((fit.values[0] - 2.0).abs() > 3.0 * fit.errors[0]);
        }
        assert!(
            off <= trials / 20,
            "{off} of {trials} are more than three errors off"
        );
    }
}
