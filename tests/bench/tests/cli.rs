//! The benchmarks as a person uses them.

use serde_json::Value;
use std::process::Command;

/// Runs, expects success, and gives the JSON that was printed.
#[track_caller]
fn json(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_bench"))
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn the_bench_prints_its_json() {
    let bench = json(&["drive", "--json"]);
    let vrf = bench["vrf"].as_array().unwrap();
    assert_eq!(vrf.len(), 8);
    for row in vrf {
        for figure in ["nut_rpm", "simulated", "analytic", "measured"] {
            assert!(row[figure].is_number(), "{row}");
        }
        assert!(
            ["ideal", "real"].contains(&row["sensors"].as_str().unwrap()),
            "sensors are {}, expected ideal or real",
            row["sensors"]
        );
    }
    assert!(
        bench["simulated_seconds_per_second"].as_f64().unwrap() > 0.0,
        "measured {}, expected above {}",
        bench["simulated_seconds_per_second"].as_f64().unwrap(),
        0.0
    );
}

/// The bench of the link says of each transport how long a command takes and what telemetry comes.
#[test]
fn the_bench_of_the_link_prints_its_json() {
    let report = json(&["link", "--json", "--round-trips", "50", "--duration", "0.5"]);
    let transports = report["transports"].as_array().unwrap();
    assert_eq!(transports.len(), if cfg!(unix) { 2 } else { 1 });
    for transport in transports {
        let [median, worst] =
            ["median", "worst"].map(|which| number(&transport[format!("round_trip_{which}_ms")]));
        assert!(0.0 < median && median <= worst, "{transport}");
        let rates = transport["rates"].as_array().unwrap();
        let asked: Vec<f64> = rates
            .iter()
            .map(|rate| number(&rate["asked_samples_per_s"]))
            .collect();
        assert_eq!(asked, [1e3, 2.5e3, 5e3, 1e4, 2e4, 5e4]);
        for rate in rates {
            assert_eq!(rate["damaged"], 0, "{rate}");
            assert!(number(&rate["samples"]) > 0.0, "{rate}");
            assert!(
                number(&rate["line_bytes_per_s"]) > 10.0 * number(&rate["samples_per_s"]),
                "{rate}"
            );
        }
    }
}
