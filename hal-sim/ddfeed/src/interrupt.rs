//! Ctrl-C, which ends a command in its own way.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

/// What Ctrl-C sets, once it is caught.
static CAUGHT: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);

/// Set by Ctrl-C, from now on. All that ask have the same.
///
/// # Errors
/// Another library catches Ctrl-C already.
pub fn ctrl_c() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let mut caught = CAUGHT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(stop) = &*caught {
        return Ok(Arc::clone(stop));
    }
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    ctrlc::set_handler(move || asked.store(true, Relaxed))?;
    *caught = Some(Arc::clone(&stop));
    Ok(stop)
}
