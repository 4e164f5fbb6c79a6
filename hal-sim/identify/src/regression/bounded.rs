//! Least squares within bounds, from normal equations: minimise `x' G x / 2 - r' x` with each `|x_k| <= bound_k`.
//!
//! A primal active-set method (Nocedal and Wright, *Numerical Optimization*, algorithm 16.3; for least squares: Stark and
//! Parker's BVLS, 1995). It starts from the free solution with the parameters that leave their bounds held there one by
//! one, and then releases every bound whose multiplier says that the cost falls inwards.

use crate::regression::inverse::of_gram;
use nalgebra::{DMatrix, DVector};

/// A multiplier counts as of the wrong sign beyond this share of the gradient's own size.
const TOLERANCE: f64 = 1e-9;
/// Changes of the active set, as a multiple of the parameters: the method needs fewer; a cycle of degenerate bounds ends.
const MOST_CHANGES: usize = 10;

/// Parameters that minimise, and their covariance under white noise of variance 1 (0 for those that are held).
#[derive(Clone)]
pub struct Solution {
    /// Value of each parameter.
    pub values: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Parameters that are held at a bound or a given value, and where.
    pub held: Vec<(usize, f64)>,
}

/// Inverse of a Gram matrix; zeros where it has none: its parameters then stay 0.
fn inverse(gram: DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    of_gram(&gram).unwrap_or_else(|| DMatrix::zeros(n, n))
}

/// Least squares with given parameters held.
pub fn solve_holding(gram: &DMatrix<f64>, rhs: &DVector<f64>, held: &[(usize, f64)]) -> Solution {
    let n = rhs.len();
    let free: Vec<usize> = (0..n)
        .filter(|k| held.iter().all(|(h, _)| h != k))
        .collect();
    let mut reduced = DVector::from_iterator(free.len(), free.iter().map(|&k| rhs[k]));
    for (row, &k) in free.iter().enumerate() {
        reduced[row] -= held
            .iter()
            .map(|&(h, value)| gram[(k, h)] * value)
            .sum::<f64>();
    }
    let inverse = inverse(gram.select_rows(&free).select_columns(&free));
    let found = &inverse * reduced;
    let mut values = DVector::zeros(n);
    let mut covariance = DMatrix::zeros(n, n);
    held.iter().for_each(|&(k, value)| values[k] = value);
    for (row, &k) in free.iter().enumerate() {
        values[k] = found[row];
        for (column, &j) in free.iter().enumerate() {
            covariance[(k, j)] = inverse[(row, column)];
        }
    }
    Solution {
        values,
        covariance,
        held: held.to_vec(),
    }
}

/// Least squares with each parameter within `-bounds[k]..=bounds[k]` and those of `fixed` at their values.
pub fn solve_within(
    gram: &DMatrix<f64>,
    rhs: &DVector<f64>,
    bounds: &[f64],
    fixed: &[(usize, f64)],
) -> Solution {
    let n = rhs.len();
    let at_bound = |k: usize, sign: f64| (k, bounds[k].copysign(sign));
    let mut held = fixed.to_vec();
    // A feasible start: what leaves its bounds is held there, the one that goes furthest first.
    let mut solution = loop {
        let solution = solve_holding(gram, rhs, &held);
        let furthest = (0..n)
            .filter(|k| held.iter().all(|(h, _)| h != k))
            .map(|k| (k, solution.values[k].abs() / bounds[k]))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        match furthest {
            Some((k, ratio)) if ratio > 1.0 => held.push(at_bound(k, solution.values[k])),
            _ => break solution,
        }
    };
    for _ in 0..MOST_CHANGES * n {
        // At an upper bound the gradient must not point outwards, at a lower one not inwards.
        let gradient = gram * &solution.values - rhs;
        let wrong = held
            .iter()
            .enumerate()
            .skip(fixed.len())
            .map(|(place, &(k, value))| {
                let scale = rhs[k].abs().max(gram[(k, k)] * bounds[k]).max(1e-300);
                (place, gradient[k] * value.signum() / scale)
            })
            .filter(|(_, multiplier)| *multiplier > TOLERANCE)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((place, _)) = wrong else { break };
        held.remove(place);
        // Towards the minimum of the new active set, as far as the bounds let it.
        loop {
            let target = solve_holding(gram, rhs, &held);
            let step = &target.values - &solution.values;
            let blocking = (0..n)
                .filter(|k| held.iter().all(|(h, _)| h != k) && step[*k] != 0.0)
                .map(|k| {
                    let room = bounds[k].copysign(step[k]) - solution.values[k];
                    (k, (room / step[k]).max(0.0))
                })
                .min_by(|a, b| a.1.total_cmp(&b.1));
            match blocking {
                Some((k, share)) if share < 1.0 => {
                    solution.values += step.scale(share);
                    let (_, bound) = at_bound(k, step[k]);
                    solution.values[k] = bound;
                    held.push((k, bound));
                }
                _ => {
                    solution = target;
                    break;
                }
            }
        }
    }
    Solution { held, ..solution }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// The conditions of Karush, Kuhn and Tucker on random problems, badly conditioned ones among them.
    #[test]
    fn what_is_found_is_optimal_on_random_problems() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
        let mut even = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        for problem in 0..400 {
            let n = 2 + problem % 14;
            let rows = n + 3;
            let tilt = if problem % 3 == 0 { 0.98 } else { 0.0 };
            let common = DVector::from_fn(rows, |_, _| even(-1.0, 1.0));
            let design = DMatrix::from_fn(rows, n, |row, _| {
                tilt * common[row] + (1.0 - tilt) * even(-1.0, 1.0)
            });
            let measured = DVector::from_fn(rows, |_, _| even(-3.0, 3.0));
            let gram = design.tr_mul(&design);
            let rhs = design.tr_mul(&measured);
            let bounds: Vec<f64> = (0..n)
                .map(|k| {
                    if k % 5 == 4 {
                        f64::INFINITY
                    } else {
                        even(0.05, 2.0)
                    }
                })
                .collect();
            let found = solve_within(&gram, &rhs, &bounds, &[]).values;
            let gradient = &gram * &found - &rhs;
            let size = rhs.amax();
            for k in 0..n {
                let (x, g, bound) = (found[k], gradient[k] / size, bounds[k]);
                assert!(
                    x.abs() <= bound * (1.0 + 1e-9),
                    "{problem}: {x} beyond {bound}"
                );
                let optimal = match x.abs() > bound * (1.0 - 1e-9) {
                    true => g * x.signum() < 1e-6,
                    false => g.abs() < 1e-6,
                };
                assert!(optimal, "{problem}: x[{k}] = {x} of {bound}, gradient {g}");
            }
        }
    }
}
