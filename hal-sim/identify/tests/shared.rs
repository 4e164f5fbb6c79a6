//! On the recordings and measured data beside the project; skipped by name where they are absent.

use identify::analysis::analyse;
use identify::{emps, laas};
use plant::model::Model;
use plant::recording::Recording;
use std::path::PathBuf;

fn shared(what: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("DDFEED_SHARED")
        .map_or_else(
            || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
            PathBuf::from,
        )
        .join(what);
    if folder.exists() {
        return Some(folder);
    }
    eprintln!("skipped: {what} is not there");
    None
}

/// Every machine's report holds what any report must: an explained machine's residual falls to the noise, on the check
/// record too, and a machine without an effect is left as it is.
#[test]
fn what_is_found_brings_the_residual_to_the_noise() {
    let Some(folder) = shared("recordings") else {
        return;
    };
    for k in [4, 5, 9] {
        let at = folder.join(format!("open-{k:02}"));
        let model = Model::load(&at.join("model.toml")).expect("a model");
        let fit = Recording::load(&at.join("fit.csv.gz")).expect("a recording");
        let check = Recording::load(&at.join("check.csv.gz")).expect("a recording");
        let outcome = analyse(&model, &fit, &check);
        assert!(
            outcome.unexplained.is_empty(),
            "open-{k:02}: something is left"
        );
        for figures in &outcome.channels {
            let name = figures.channel.name();
            assert!(
                figures.whitened < 1.1,
                "open-{k:02}, {name}: {} of noise is left",
                figures.whitened
            );
            assert!(
                figures.check_after < 1.3 * figures.noise_floor,
                "open-{k:02}, {name}: the check record is not explained"
            );
        }
        for found in &outcome.effects {
            assert!(
                found.check_fall > 0.1 * found.fall,
                "open-{k:02}: the check record does not bear it out"
            );
        }
    }
}

#[test]
fn emps_is_simulated_better_effect_by_effect() {
    let Some(folder) = shared("measured/emps") else {
        return;
    };
    let load =
        |name: &str| emps::Record::load(&folder.join(name)).expect("a file of the benchmark");
    let study = emps::Study::new(&load("DATA_EMPS.mat"), &load("DATA_EMPS_PULSES.mat"));
    // Published: 4.083 % and 5.982 %.
    assert!(
        (study.inverse_percent[0] - 4.083).abs() < 0.3,
        "{:?}",
        study.inverse_percent
    );
    assert!(
        (study.inverse_percent[1] - 5.982).abs() < 0.3,
        "{:?}",
        study.inverse_percent
    );
    let last = study.stages.last().expect("there are stages");
    assert!(last.homed.force_percent < 2.9, "{:?}", last.homed);
    assert!(study.stages[0].test.force_percent > 1.5 * last.homed.force_percent);
}

#[test]
fn laas_current_is_explained_by_the_orders_of_its_map() {
    let Some(folder) = shared("measured/laas") else {
        return;
    };
    let study = laas::Study::new(&folder).expect("the measured data");
    let orders: Vec<u32> = study
        .orders
        .iter()
        .take(5)
        .map(|order| order.order)
        .collect();
    assert_eq!(orders, [72, 18, 12, 24, 36]);
    assert!(
        study.after_percent < 5.0 && study.before_percent > 4.0 * study.after_percent,
        "{study:?}"
    );
}
