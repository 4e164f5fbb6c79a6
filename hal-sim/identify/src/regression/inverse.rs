//! The inverse of a Gram matrix, in a bounded number of steps.

use nalgebra::{DMatrix, SymmetricEigen};

/// Eigenvalues below this share of the largest count as 0: columns then say the same.
const SINGULAR: f64 = 1e-12;
/// Steps of the eigenvalue iteration for each column; it needs about two (Golub and Van Loan, *Matrix Computations*, 8.3).
const STEPS: usize = 50;

/// Inverse of a symmetric positive matrix; of a singular one the minimum-norm (Moore-Penrose) inverse.
///
/// `None` where a number is not finite or the iteration does not end within its bound.
pub(crate) fn of_gram(gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if !gram.iter().all(|value| value.is_finite()) {
        return None;
    }
    let n = gram.nrows();
    if let Some(factor) = gram.clone().cholesky() {
        // Pivots are what each column has of its own beside those before it.
        let l = factor.l_dirty();
        if (0..n).all(|k| l[(k, k)].powi(2) > SINGULAR * gram[(k, k)]) {
            return Some(factor.inverse());
        }
    }
    // Columns of length 1: what is small in its unit is not singular.
    let length = |k: usize| gram[(k, k)].max(1e-300).sqrt();
    let unit = DMatrix::from_fn(n, n, |k, j| gram[(k, j)] / length(k) / length(j));
    let eigen = eigen(&unit)?;
    let most = eigen.eigenvalues.amax();
    let inverses = eigen
        .eigenvalues
        .map(|value| match value > SINGULAR * most {
            true => value.recip(),
            false => 0.0,
        });
    let inverse =
        &eigen.eigenvectors * DMatrix::from_diagonal(&inverses) * eigen.eigenvectors.transpose();
    let inverse = DMatrix::from_fn(n, n, |k, j| inverse[(k, j)] / length(k) / length(j));
    inverse
        .iter()
        .all(|value| value.is_finite())
        .then_some(inverse)
}

/// Smallest and largest eigenvalue of a symmetric matrix; `None` as for [`of_gram`].
pub(crate) fn eigenvalue_range(gram: &DMatrix<f64>) -> Option<[f64; 2]> {
    let values = eigen(gram)?.eigenvalues;
    Some([values.min(), values.max()])
}

fn eigen(gram: &DMatrix<f64>) -> Option<SymmetricEigen<f64, nalgebra::Dyn>> {
    if gram.is_empty() || !gram.iter().all(|value| value.is_finite()) {
        return None;
    }
    SymmetricEigen::try_new(gram.clone(), f64::EPSILON, STEPS * gram.nrows())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_columns_share_their_value() {
        let gram = DMatrix::from_row_slice(2, 2, &[2.0, 2.0, 2.0, 2.0]);
        let inverse = of_gram(&gram).expect("a least-norm inverse");
        assert!(
            inverse.iter().all(|value| (value - 0.125).abs() < 1e-12),
            "{inverse}"
        );
    }

    #[test]
    fn numbers_that_are_not_finite_have_no_inverse() {
        for wrong in [f64::NAN, f64::INFINITY] {
            let mut gram = DMatrix::identity(3, 3);
            gram[(1, 2)] = wrong;
            assert!(of_gram(&gram).is_none());
            assert!(eigenvalue_range(&gram).is_none());
        }
        assert!(eigenvalue_range(&DMatrix::zeros(0, 0)).is_none());
    }
}
