//! Motors alone: drawn machines with and without effects, told from currents and voltages.

use crate::draw::{self, Machine};
use identify::analysis::Outcome;
use identify::machines::pmsm;
use plant::Axis;
use plant::effects::EffectModel;
use plant::machine::Machine as Plant;
use serde_json::{Value, json};

/// Kinds that a motor alone can have.
const KINDS: [&str; 11] = [
    "current_offset",
    "current_gain",
    "dead_time",
    "resistance_drift",
    "flux_drift",
    "torque_harmonic",
    "flux_harmonic",
    "cogging",
    "angle_periodic",
    "time_periodic",
    "encoder_eccentricity",
];
/// Values may be off by this share.
const TOLERANCE: f64 = 0.15;

/// What is said of a drawn motor.
pub(super) fn told(machine: &Machine) -> Outcome {
    let own = |record: &plant::recording::Recording| record.axis(Axis::Nut).clone();
    let (fit, check) = (own(&machine.fit), own(&machine.check));
    pmsm::identify(
        &machine.declared.nut,
        &machine.declared.sensing,
        &fit,
        &check,
    )
}

fn value(effect: &EffectModel, name: &str) -> Option<f64> {
    let parameters = effect.effect().parameters();
    parameters
        .into_iter()
        .find(|(known, _)| known == name)
        .map(|(_, value)| value)
}

/// Whether what was found is what is there.
fn right(truth: &[EffectModel], outcome: &Outcome) -> bool {
    let same = |a: &EffectModel, b: &EffectModel| {
        a.effect().kind() == b.effect().kind()
            && a.effect()
                .parameters()
                .iter()
                .all(|(name, x)| match name.as_str() {
                    "phase" | "duration_s" => true,
                    "order" | "hz" => value(b, name).is_some_and(|y| (x - y).abs() <= 0.02 * x),
                    _ => value(b, name).is_some_and(|y| (x - y).abs() <= TOLERANCE * x.abs()),
                })
    };
    truth.len() == outcome.effects.len()
        && truth
            .iter()
            .all(|t| outcome.effects.iter().any(|f| same(t, &f.effect)))
}

/// Drawn motors with one or two effects: machines, and those told right; then clean ones, and those on which something is
/// named.
pub(super) fn drawn(machines: u64, clean: u64) -> Value {
    let mut count = 0;
    for seed in 0..machines {
        let first = (seed as usize) % KINDS.len();
        let second = (first + 1 + (seed as usize / KINDS.len()) % (KINDS.len() - 1)) % KINDS.len();
        let kinds = match seed % 3 {
            2 => vec![KINDS[first], KINDS[second]],
            _ => vec![KINDS[first]],
        };
        let machine = draw::alone(40_000 + seed, &kinds, &|_: &mut Plant| ());
        let outcome = told(&machine);
        let is_right = right(&machine.effects, &outcome);
        count += u64::from(is_right);
        if !is_right {
            eprintln!("pmsm {seed}: has {:?}", machine.effects);
            for found in &outcome.effects {
                eprintln!(
                    "    found {:?} fall {:.0} check {:.0}",
                    found.effect, found.fall, found.check_fall
                );
            }
        }
        eprintln!(
            "pmsm {seed} {kinds:?} right {is_right}: {}",
            outcome.verdict()
        );
    }
    let alarms = (0..clean)
        .filter(|seed| {
            let outcome = told(&draw::alone(50_000 + seed, &[], &|_: &mut Plant| ()));
            eprintln!("clean pmsm {seed}: {}", outcome.judged().said.sentence());
            !outcome.effects.is_empty()
        })
        .count();
    json!({
        "machines": machines,
        "right_percent": 100.0 * count as f64 / machines.max(1) as f64,
        "clean": clean,
        "false_alarms": alarms,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::model::MotorModel;

    /// A plate that is wrong by more than its tolerance is no effect: half of the friction was Stribeck friction, a resistance too low a dead
    /// time. The report says which value it is, and what it would be: within the tolerance that the others have.
    #[test]
    fn a_wrong_plate_has_no_name_and_is_asked_about() {
        type Value = fn(&mut MotorModel) -> &mut f64;
        let cases: [(&str, Value, f64, f64); 4] = [
            ("motor.coulomb_nm", |motor| &mut motor.coulomb_nm, 0.5, 0.25),
            (
                "motor.resistance_ohm",
                |motor| &mut motor.resistance_ohm,
                0.85,
                0.04,
            ),
            (
                "motor.inertia_kg_m2",
                |motor| &mut motor.inertia_kg_m2,
                1.3,
                0.04,
            ),
            ("motor.flux_wb", |motor| &mut motor.flux_wb, 1.08, 0.02),
        ];
        for (name, value, wrong, within) in cases {
            let (mut asked, mut corrected) = (0, 0);
            for seed in 0..2 {
                let mut machine = draw::alone(50_000 + seed, &[], &|_: &mut Plant| ());
                *value(&mut machine.declared.nut) *= wrong;
                let outcome = told(&machine);
                let sentence = outcome.judged().said.sentence();
                println!("{name} {seed}: {sentence}");
                assert!(outcome.effects.is_empty(), "{name} {seed}: {sentence}");
                asked += usize::from(sentence.contains(name));
                let Some(correction) = &outcome.correction else {
                    continue;
                };
                let own = correction.values.iter().find(|own| own.parameter == name);
                let off = own.map(|own| own.factor * wrong - 1.0);
                assert!(
                    off.is_some_and(|off| off.abs() < within),
                    "{name} {seed}: {correction:?} for {}",
                    1.0 / wrong
                );
                corrected += 1;
            }
            // A shape without a name may take what the plate value lacks.
            assert!(asked > 0, "{name}: no report asks about it");
            assert!(corrected > 0, "{name}: none is corrected");
        }
    }
}
