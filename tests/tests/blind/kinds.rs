//! Which effects a machine has.

use plant::effects::AnyEffect;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Of every eight machines one is clean, three have a pair of two kinds, four have one effect. First effects take the
/// kinds in turn.
pub fn kinds(seed: u64) -> Vec<&'static str> {
    let all = AnyEffect::KINDS;
    let count = all.len() as u64;
    let first = (seed % count) as usize;
    match seed % 8 {
        7 => Vec::new(),
        4..=6 => {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(!seed);
            let other = (first + rng.random_range(1..all.len())) % all.len();
            vec![all[first], all[other]]
        }
        _ => vec![all[first]],
    }
}
