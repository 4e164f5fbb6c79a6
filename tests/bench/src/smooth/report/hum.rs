//! From a hum to silence: machines with effects drawn at random are recorded, identified, compensated, and heard again.

use crate::smooth::hum::{Hum, Silence};
use hal_sim::parallel::on_all_cores;
use identify::analysis::analyse;
use plant::effects::EffectModel;
use serde_json::{Value, json};

/// Machines of the bench.
const MACHINES: u64 = 20;
/// First seed; no other test draws from it on.
const FIRST_SEED: u64 = 77_000;

/// What became of a machine.
pub(super) struct Told {
    seed: u64,
    effects: Vec<EffectModel>,
    found: Vec<EffectModel>,
    nut_rpm: f64,
    silence: Result<Silence, String>,
}

/// Records, identifies, compensates and records again.
fn told(seed: u64) -> Told {
    let hum = Hum::draw(seed);
    let machine = &hum.machine;
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    Told {
        seed,
        effects: machine.effects.clone(),
        found: outcome
            .effects
            .iter()
            .map(|found| found.effect.clone())
            .collect(),
        nut_rpm: hum.point.base / hal_sim::experiment::RPM,
        silence: hum
            .silence(&outcome.model)
            .map_err(|error| error.to_string()),
    }
}

/// All machines, on all cores.
pub(super) fn measure() -> Vec<Told> {
    let seeds: Vec<u64> = (FIRST_SEED..FIRST_SEED + MACHINES).collect();
    on_all_cores(&seeds, |&seed| told(seed))
}

fn names(effects: &[EffectModel]) -> String {
    let names: Vec<String> = effects
        .iter()
        .map(|effect| format!("{} ({})", effect.effect().kind(), effect.place().name()))
        .collect();
    if names.is_empty() {
        "nothing".into()
    } else {
        names.join(", ")
    }
}

impl Told {
    pub(super) fn json(&self) -> Value {
        let silence = self.silence.as_ref().ok();
        json!({
            "machine": self.seed,
            "effects": names(&self.effects),
            "found": names(&self.found),
            "nut_rpm": self.nut_rpm,
            "vrf_before": silence.map(|s| s.before),
            "vrf_with_declared": silence.map(|s| s.declared),
            "vrf_after": silence.map(|s| s.learned),
            "vrf_after_without_learning": silence.map(|s| s.after),
            "vrf_predicted": silence.map(|s| s.predicted),
            "fall_predicted": silence.map(Silence::fall_predicted),
            "failed": self.silence.as_ref().err(),
        })
    }
}

/// Prints a line for each machine.
pub(super) fn print(told: &[Told]) {
    println!(
        "\nFrom a hum to silence, coupled, 2.5 mm/s: ripple before, with what the plate declares, with what identification \
         found, learning on from it; part of the fall that it predicted; what there was, what was found"
    );
    for one in told {
        match &one.silence {
            Ok(silence) => println!(
                "  {} nut {:>4.0} rpm {:>7.2} % {:>7.2} % {:>7.2} % {:>7.2} % {:>6.0} %   {} -> {}",
                one.seed,
                one.nut_rpm,
                silence.before,
                silence.declared,
                silence.after,
                silence.learned,
                silence.fall_predicted(),
                names(&one.effects),
                names(&one.found)
            ),
            Err(error) => println!("  {} {}: {error}", one.seed, names(&one.effects)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Machines that the bench does not draw: record, identify, compensate, record again.
    #[test]
    fn a_hum_becomes_silence_and_identification_says_by_how_much() {
        let seeds: Vec<u64> = (79_000..79_005).collect();
        let told = on_all_cores(&seeds, |&seed| told(seed));
        print(&told);
        let mut ratios = Vec::new();
        for one in &told {
            let silence = one.silence.as_ref().unwrap();
            let predicted = silence.fall_predicted();
            assert!(
                (90.0..110.0).contains(&predicted),
                "machine {}: identification predicted {predicted:.0} % of the fall, expected 90 to 110",
                one.seed
            );
            ratios.push(silence.learned / silence.before);
        }
        ratios.sort_by(f64::total_cmp);
        let median = ratios[ratios.len() / 2];
        assert!(
            median < 0.1,
            "half of the machines keep {median} of their ripple or more, expected less than a tenth"
        );
    }
}
