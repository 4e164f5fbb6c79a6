//! A model that has all friction of the feed at the pair, as commissioning writes it: torques do not tell where it is.

use bench::draw::draw;
use hal_sim::parallel::on_all_cores;
use identify::analysis::analyse;
use plant::effects::AnyEffect;

/// Friction of the guideway winds up the screw at a reversal, as a play of `2 F / k` does.
#[test]
fn friction_at_the_guideway_is_no_backlash() {
    let seeds: Vec<u64> = (30_000..30_008).collect();
    let shares = on_all_cores(&seeds, |&seed| {
        let mut machine = draw(seed, &["cogging"]);
        let feed = &mut machine.declared.feed;
        let (guideway_n, lead) = (feed.guideway_coulomb_n, feed.travel_per_radian().abs());
        feed.pair_coulomb_nm += guideway_n * lead;
        feed.guideway_coulomb_n = 0.0;
        let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
        let plays = outcome.effects.iter().filter_map(|found| {
            let AnyEffect::Backlash(play) = found.effect.effect() else {
                return None;
            };
            Some(play.value)
        });
        let (plays, found_n) = (
            plays.collect::<Vec<_>>(),
            outcome.model.feed.guideway_coulomb_n,
        );
        println!("{seed}: guideway {found_n:.2} N of {guideway_n:.2} N, plays {plays:?}");
        assert!(plays.is_empty(), "{seed}: plays {plays:?} m");
        found_n / guideway_n
    });
    // The true friction is within a fifth of the declared one.
    for share in shares {
        assert!(
            (share - 1.0).abs() < 0.5,
            "{share} of the guideway's friction"
        );
    }
}
