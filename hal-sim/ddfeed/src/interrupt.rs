//! Ctrl-C, which ends a command in its own way.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Set by Ctrl-C, from now on.
///
/// # Errors
/// Ctrl-C is caught already.
pub fn ctrl_c() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Relaxed))?;
    Ok(stop)
}
