//! Independent runs on all cores.

use rayon::prelude::*;

/// `run` of each of `of`, in their order, whatever core is first.
pub fn on_all_cores<T: Sync, R: Send>(of: &[T], run: impl Fn(&T) -> R + Sync) -> Vec<R> {
    of.par_iter().map(&run).collect()
}
