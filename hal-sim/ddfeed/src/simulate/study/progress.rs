//! How far a study has come, on the terminal.

use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// A bar for `steps` steps; silent where no person watches.
pub fn progress_bar(steps: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg} ({elapsed})");
    let bar = ProgressBar::new(steps as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
