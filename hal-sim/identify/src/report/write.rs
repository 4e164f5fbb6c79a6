//! The files of a report.

use super::Report;
use std::path::{Path, PathBuf};

/// Why the files could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The folder could not be made.
    #[error("{}: cannot make the output folder: {source}; choose one that can be written", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file could not be written.
    #[error("{}: cannot write: {source}; choose a folder that can be written", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Writes `report.json`, `model.toml`, `residual.csv`, `report.html` and its first picture, `orders.svg`, into `folder`, which is made if it is not there.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write(report: &Report, folder: &Path) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|source| WriteError::Folder {
        path: folder.to_owned(),
        source,
    })?;
    let file = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| WriteError::File { path, source })
    };
    let mut json = serde_json::to_string_pretty(report).expect("a report has a text");
    json.push('\n');
    file("report.json", json)?;
    file("model.toml", report.model.clone())?;
    file("residual.csv", residual_csv(report))?;
    file("report.html", crate::html::live_page(report))?;
    match crate::html::picture(report) {
        Some(picture) => file("orders.svg", picture),
        None => Ok(()),
    }
}

fn residual_csv(report: &Report) -> String {
    let mut text = String::from("t_s");
    for channel in &report.channels {
        let name = channel.name.replace(' ', "_");
        let unit = channel.unit.replace(' ', "").to_lowercase();
        text.push_str(&format!(",{name}_before_{unit},{name}_after_{unit}"));
    }
    text.push('\n');
    for (row, time) in report.time.iter().enumerate() {
        text.push_str(&format!("{time:.4}"));
        for side in report.channels.iter().flat_map(|channel| &channel.residual) {
            text.push_str(&format!(",{:.4e}", side.get(row).copied().unwrap_or(0.0)));
        }
        text.push('\n');
    }
    text
}
