//! What a leg of a bridge loses to its dead time.

/// Part of its dead time that a leg loses, at a current over the turning current `2 C V / t`: that which turns the leg within the dead
/// time `t`. `C` is a switch's capacitance, `V` the bus voltage.
///
/// A current into the motor keeps the leg low until the high side closes: all of the dead time is lost. It then pulls the leg down when
/// the high side opens, on a slope that gives a part of it back: half of what the slope takes, or, where it ends above, all but that
/// much.
#[must_use]
pub fn lost_part(x: f64) -> f64 {
    let size = x.abs();
    let lost = if size < 1.0 {
        0.5 * size
    } else {
        1.0 - 0.5 / size
    };
    lost.copysign(x)
}
