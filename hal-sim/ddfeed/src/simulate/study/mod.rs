//! The simulations and their reports.

mod curves;
mod heat;
mod html;
mod learned;
mod progress;
mod records;
mod replay;
mod report;
mod run;
mod sweep;
mod sweep_html;
mod sweep_report;
mod table;

pub use progress::progress_bar;
pub use replay::run as replay;
pub use run::{PAPER_MEASURED, analytic_percent, run};
pub use sweep::run as sweep;

use super::options;
