//! What a bridge loses to its dead time, and what the drive adds for it.
//!
//! A phase's current must charge both switches of its leg before the leg turns. Below the turning current `2 C V / t` it does not do so
//! within the dead time `t`, with `C` a switch's capacitance and `V` the bus voltage.

/// Part of its dead time that a leg loses, at a current over the turning current.
///
/// At the switching edge that this current supports, the leg's node falls on a slope. The leg gets back the area under the slope: half of
/// its time, or what the slope leaves where the dead time ends first.
#[must_use]
pub fn lost(x: f64) -> f64 {
    let size = x.abs();
    let part = if size < 1.0 {
        0.5 * size
    } else {
        1.0 - 0.5 / size
    };
    part.copysign(x)
}

/// Part of the dead time that the drive adds, at a current over that of full compensation (`bridge.dead_time_fade_a`).
#[must_use]
pub fn compensated(x: f64) -> f64 {
    x.clamp(-1.0, 1.0)
}
