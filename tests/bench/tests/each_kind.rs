//! Each kind of effect, alone on simulated machines: the identification names it, or the kind's file says why no record tells it.

use bench::draw::draw;
use hal_sim::parallel::on_all_cores;
use identify::analysis::analyse;
use plant::effects::{AnyEffect, Kind, Recognition};

/// Seeds of the draws of a kind, in the order in which they are tried: the smallest sizes are below the noise.
const SEEDS: [u64; 3] = [30_000, 30_001, 30_002];

/// Whether the identification names the kind where it is.
fn is_named(kind: &Kind, seed: u64) -> bool {
    let machine = draw(seed, &[kind.name]);
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    outcome.effects.iter().any(|found| {
        found.effect.effect().kind() == kind.name
            && found.effect.place() == machine.effects[0].place()
    })
}

#[test]
fn each_kind_is_named() {
    let kinds: Vec<&Kind> = (AnyEffect::CATALOGUE.iter())
        .filter(|kind| !matches!(kind.recognition, Recognition::Never(_)))
        .collect();
    let named = on_all_cores(&kinds, |kind| {
        let first = SEEDS.into_iter().position(|seed| is_named(kind, seed));
        println!("{}: named at draw {first:?}", kind.name);
        (kind.name, first)
    });
    let missed: Vec<_> = named.iter().filter(|(_, first)| first.is_none()).collect();
    assert!(
        missed.is_empty(),
        "not named in {} draws: {missed:?}",
        SEEDS.len()
    );
}
