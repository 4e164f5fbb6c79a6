//! Lengths of a drawing: pixels of the page, units of the SVG.

/// Height of the text, px.
pub const TEXT: f64 = 13.0;
/// The SVG backend rounds to whole units: draw larger, so that lines do not step.
pub const SCALE: u32 = 4;

/// Length in the drawing's units.
pub fn units(px: f64) -> i32 {
    (px * f64::from(SCALE)).round() as i32
}
