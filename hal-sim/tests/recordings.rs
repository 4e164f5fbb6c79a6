//! The shared recordings' profiles, driven again.

use hal_sim::experiment::Setup;
use hal_sim::replay::compare;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::path::PathBuf;

/// `../shared` beside the project, or where `DDFEED_SHARED` points.
fn shared() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let path = std::env::var_os("DDFEED_SHARED").map_or(beside, PathBuf::from);
    path.join("recordings").is_dir().then_some(path)
}

/// Machines whose ripple the declared model explains.
const EXPLAINED: [&str; 4] = ["open-04", "open-05", "open-07", "open-10"];

#[test]
fn ripple_of_every_hold_is_met_within_ten_percent() {
    let Some(shared) = shared() else {
        println!(
            "skipped: ripple_of_every_hold_is_met_within_ten_percent needs ../shared/recordings (or DDFEED_SHARED)"
        );
        return;
    };
    for name in EXPLAINED {
        let folder = shared.join("recordings").join(name);
        let setup = Setup::declared(
            Model::load(&folder.join("model.toml")).unwrap(),
            Coupling::Coupled,
        );
        for file in ["fit.csv.gz", "check.csv.gz"] {
            let compared = compare(&setup, &Recording::load(&folder.join(file)).unwrap()).unwrap();
            assert!(
                compared.len() >= 6,
                "{name}/{file} has {} holds",
                compared.len()
            );
            for c in compared {
                let ratio = c.simulated_percent / c.recorded_percent;
                assert!(
                    (ratio - 1.0).abs() <= 0.1,
                    "{name}/{file}: ratio {ratio:.3} in {:?}",
                    c.hold
                );
            }
        }
    }
}
