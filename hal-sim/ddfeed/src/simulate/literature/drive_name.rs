//! The name of a drive in tables and charts.

use page::document::short;

/// How a drive with this nut speed, rpm, is called.
pub fn drive_name(nut_rpm: f64) -> String {
    match nut_rpm == 0.0 {
        true => "CDFS".into(),
        false => format!("DDFS, {} rpm", short(nut_rpm)),
    }
}
