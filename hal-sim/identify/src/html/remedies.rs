//! What is done about an effect.

use plant::effects::{AnyEffect, Kind};

/// In place of a compensation by a model whose simulation is further from the record than the declared model's.
pub(super) const FURTHER_OFF: (&str, &str) = (
    "record again",
    "Do not compensate with this model: its simulated ripple is further from the record. Record other speeds and loads first.",
);

/// What is done about a kind of effect, in a word and in a sentence.
pub(super) fn remedy(kind: &str) -> (&'static str, &'static str) {
    electrical_remedy(kind)
        .or_else(|| mechanical_remedy(kind))
        .or_else(|| Some(AnyEffect::kind_named(kind).and_then(Kind::linear)?.remedy))
        .unwrap_or((
            "compensate",
            "Put the term into the model that feeds forward.",
        ))
}

/// What is done about an effect of the sensors, the bridge or the windings.
fn electrical_remedy(kind: &str) -> Option<(&'static str, &'static str)> {
    Some(match kind {
        "current_offset" => (
            "compensate",
            "Take the zero of both sensors again at rest, bridge off, and subtract it.",
        ),
        "current_gain" => (
            "calibrate",
            "Match the gains of both phases against one meter, and put the ratio into the scaling.",
        ),
        "encoder_eccentricity" => (
            "re-align",
            "Centre the encoder\u{2019}s disc, or correct the angle by a table of that order.",
        ),
        "dead_time" => (
            "compensate",
            "Add the lost voltage in the direction of each phase\u{2019}s current.",
        ),
        "resistance_drift" | "flux_drift" => (
            "compensate",
            "Track the winding\u{2019}s temperature in the model that feeds forward, or let the record begin warm.",
        ),
        "reported_current_lag" => (
            "calibrate",
            "Read the current before its filter: nothing is wrong with the motor.",
        ),
        "force_lag" => (
            "calibrate",
            "Shorten the delay of the amplifier, or allow for it in the loop.",
        ),
        _ => return None,
    })
}

/// What is done about torques that repeat, friction, the feed, and curves without a name.
fn mechanical_remedy(kind: &str) -> Option<(&'static str, &'static str)> {
    Some(match kind {
        "measured" => (
            "compensate",
            "Feed the curve forward within its range, and look for its cause with a record at other speeds.",
        ),
        "torque_harmonic" | "flux_harmonic" => (
            "compensate",
            "Feed the opposite current forward at that order of the electrical angle.",
        ),
        "cogging" => (
            "compensate",
            "Feed the opposite current forward over the mechanical angle, from a map of a slow turn both ways.",
        ),
        "angle_periodic" => (
            "replace",
            "Find the part with that order (bearing, belt, gear) and replace it; a feed-forward over the angle helps till then.",
        ),
        "coupling_misalignment" => (
            "re-align",
            "Check the coupling\u{2019}s alignment first, then whether rotor and load run true.",
        ),
        "time_periodic" => (
            "remove",
            "Find the source with that frequency (pump, fan, mains) and decouple it.",
        ),
        "stribeck_friction" => (
            "replace",
            "Lubricate, or lower the preload; drive the nut so that no surface is slow (the point of two motors).",
        ),
        "lead_error" => (
            "compensate",
            "Correct the travel by a table over the screw against the nut.",
        ),
        "ball_passage" => (
            "replace",
            "Look at preload and ball return; replace the nut where it grows.",
        ),
        "axial_compliance" => (
            "replace",
            "Stiffen the bearing or lower the mass; a notch at that frequency keeps the loop from exciting it.",
        ),
        "backlash" => (
            "replace",
            "Push the table with known forces while the motors stand: a soft screw gives with the force, backlash does not. Preload the nut against backlash; a load that never changes its sign hides it.",
        ),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::effects;

    #[test]
    fn each_effect_has_a_remedy_of_its_own() {
        for [kind, ..] in effects() {
            assert_ne!(
                remedy(kind),
                remedy("no kind"),
                "{kind}: what is to be done about it is not said"
            );
        }
    }
}
