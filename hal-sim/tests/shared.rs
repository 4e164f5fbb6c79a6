//! The shared recordings' profiles, driven again.

use hal_sim::experiment::Setup;
use hal_sim::replay::compare;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::path::Path;

given::shared_tests! {
    "recordings" => ripple_of_every_hold_is_met_within_ten_percent;
}

/// The machines in which identification finds nothing that their models do not declare.
const CLEAN: [&str; 2] = ["open-05", "open-10"];

/// The peak to peak of a noisy record is itself a little noisy; a few seeds show its middle.
const SEEDS: [u64; 3] = [1, 2, 3];

fn ripple_of_every_hold_is_met_within_ten_percent(recordings: &Path) {
    for name in CLEAN {
        let folder = recordings.join(name);
        let mut setup = Setup::declared(
            Model::load(&folder.join("model.toml")).unwrap(),
            Coupling::Coupled,
        );
        for file in ["fit.csv.gz", "check.csv.gz"] {
            let recording = Recording::load(&folder.join(file)).unwrap();
            let runs = SEEDS.map(|seed| {
                setup.board.seed = seed;
                compare(&setup, &recording).unwrap()
            });
            assert!(
                runs[0].len() >= 6,
                "{name}/{file} has {} holds",
                runs[0].len()
            );
            for (k, c) in runs[0].iter().enumerate() {
                let simulated = runs.iter().map(|run| run[k].simulated_percent).sum::<f64>()
                    / SEEDS.len() as f64;
                let ratio = simulated / c.recorded_percent;
                println!(
                    "{name}/{file}: {:.2} % recorded, ratio {ratio:.3}",
                    c.recorded_percent
                );
                assert!(
                    (ratio - 1.0).abs() <= 0.1,
                    "{name}/{file}: ratio {ratio:.3} in {:?}",
                    c.hold
                );
            }
        }
    }
}
