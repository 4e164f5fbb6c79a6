//! Which parameter of an effect the residuals are linear in.

use plant::effects::{AnyEffect, CurrentGain, EffectModel};

/// A reading's error as a share of the current, from its share of the reading, which alone is known.
pub(crate) fn of_the_current(share: f64) -> f64 {
    share / (1.0 - share.min(0.5))
}

/// An effect as the balances have it: what it adds to a record is linear in its parameters.
pub(super) fn linear(effect: &EffectModel) -> EffectModel {
    let AnyEffect::CurrentGain(gain) = effect.effect() else {
        return effect.clone();
    };
    let of_the_reading = |share: f64| share / (1.0 + share);
    let gain = CurrentGain {
        gain_a: of_the_reading(gain.gain_a),
        gain_b: of_the_reading(gain.gain_b),
    };
    EffectModel::new(effect.place(), AnyEffect::from(gain)).expect("the place that it was at")
}
