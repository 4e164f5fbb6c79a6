//! What the encoders of a board that ships read wrong, as its simulated machine has it.

use crate::boards::BoardKind;
use plant::effects::{EffectModel, EncoderEccentricity, Place};

/// Amplitude of the error once a turn of a disc that sits off its centre, degrees.
const ECCENTRICITY_DEG: f64 = 20.0 / 3600.0;
/// Largest error of the mains board's MT6835 after its own calibration, degrees (MagnTek's data sheet, second hand).
const MAGNETIC_DEG: f64 = 0.07;
/// The same of an encoder with a disc of lines, degrees: as once a turn. Our choice, as the motors' manuals give none.
const OPTICAL_DEG: f64 = ECCENTRICITY_DEG;

/// Once a turn on both encoders; orders 2 and 4 with half of the encoder's largest error each.
#[must_use]
pub fn encoder_errors(board: BoardKind) -> Vec<EffectModel> {
    let screw_deg = match board {
        BoardKind::Mains => MAGNETIC_DEG,
        BoardKind::Nucleo | BoardKind::Nucleo40kHz => OPTICAL_DEG,
    };
    [(Place::Screw, screw_deg), (Place::Nut, OPTICAL_DEG)]
        .into_iter()
        .flat_map(|(place, degrees)| {
            [
                (1.0, ECCENTRICITY_DEG),
                (2.0, 0.5 * degrees),
                (4.0, 0.5 * degrees),
            ]
            .map(|parts| (place, parts))
        })
        .filter_map(|(place, (order, degrees))| {
            let error = EncoderEccentricity {
                order,
                amplitude: f64::to_radians(degrees),
                // The once-a-turn error begins at zero; the others begin elsewhere, so that they do not add up in one place.
                phase: if order == 1.0 { 0.0 } else { order },
            };
            EffectModel::new(place, error)
        })
        .collect()
}
