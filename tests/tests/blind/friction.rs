//! Friction whose sign turns round over other widths than those that are tried first.

use bench::draw::Widths;
use bench::draw::profile::Profile;
use identify::analysis::analyse;
use identify::conclusion::verdict::Verdict;
use plant::model::Model;

/// Table velocities, mm/s, nut speeds, rpm, and times, s: from speeds below the widths to those far above.
const FIT: [(f64, f64, f64); 8] = [
    (0.4, 0.0, 2.0),
    (-1.0, 0.0, 2.0),
    (2.5, 0.0, 2.0),
    (-5.0, 0.0, 2.0),
    (1.0, 10.0, 2.0),
    (-1.0, -20.0, 2.0),
    (2.5, 60.0, 2.0),
    (2.5, 200.0, 2.0),
];
const CHECK: [(f64, f64, f64); 5] = [
    (0.6, 0.0, 2.0),
    (-1.5, 0.0, 2.0),
    (1.5, 15.0, 2.0),
    (-4.0, 0.0, 2.0),
    (2.0, 100.0, 2.0),
];

#[test]
fn the_width_of_friction_is_no_effect() {
    for (seed, [bearing, pair, guideway]) in [
        (1, [0.6, 0.15, 0.06]),
        (2, [4.0, 0.5, 0.2]),
        (3, [1.0, 1.0, 1.0]),
    ] {
        let widths = Widths {
            bearing,
            pair,
            guideway,
        };
        let profiles = [&FIT[..], &CHECK[..]].map(|legs| Profile::of(0.2, legs));
        let machine = bench::draw::rubbing(Model::coupled(), widths, seed, profiles);
        let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
        assert!(
            outcome.effects.is_empty(),
            "{widths:?}: {:?}",
            outcome.effects
        );
        let judged = outcome.judged();
        assert_eq!(
            judged.verdict,
            Verdict::NothingMissing,
            "{widths:?}: {:?}",
            judged.said
        );
    }
}
