//! A recording that cannot be driven again is refused.

use hal_sim::experiment::Setup;
use hal_sim::replay::compare;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::{Recording, Sample};

#[test]
fn a_recording_whose_time_makes_no_sense_is_refused() {
    let setup = Setup::declared(Model::coupled(), Coupling::Coupled);
    for interval_s in [0.0, 0.5, -2e-4] {
        let mut recording = Recording::default();
        for row in 0..5000 {
            recording.push(&Sample {
                time_s: interval_s * f64::from(row),
                ..Sample::default()
            });
        }
        let error = compare(&setup, &recording).unwrap_err().to_string();
        assert!(
            error.starts_with("the rows of the recording are"),
            "{error}"
        );
    }
    assert!(
        compare(&setup, &Recording::default()).is_err(),
        "an empty recording was driven again"
    );
}
