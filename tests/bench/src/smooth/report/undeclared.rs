//! Orders that no setting names, on the elastic machine.

use super::mode;
use crate::smooth::undeclared::{Undeclared, ripple};
use hal_sim::parallel::on_all_cores;
use serde_json::{Value, json};

/// Nut speeds, rpm.
const MODES: [f64; 2] = [0.0, 800.0];

/// What the machine has, nut speed in rpm, and ripple in %.
pub type Case = (Undeclared, f64, Result<f64, String>);

/// Of all cases in both modes.
pub fn measure() -> Vec<Case> {
    let cases: Vec<_> = Undeclared::ALL
        .into_iter()
        .flat_map(|case| MODES.map(|rpm| (case, rpm)))
        .collect();
    let left = on_all_cores(&cases, |&(case, rpm)| {
        ripple(case, rpm).map_err(|error| error.to_string())
    });
    cases
        .into_iter()
        .zip(left)
        .map(|((case, rpm), left)| (case, rpm, left))
        .collect()
}

/// As JSON.
pub fn json(cases: &[Case]) -> Value {
    let one = |(case, rpm, left): &Case| {
        json!({
            "machine": case.name(),
            "nut_rpm": rpm,
            "vrf": left.as_ref().ok(),
            "failed": left.as_ref().err(),
        })
    };
    cases.iter().map(one).collect()
}

/// For a person.
pub fn print(cases: &[Case]) {
    println!(
        "\nOrders that no setting names, elastic machine, axial damping 1.6 %, 1 N m at each motor, 20-bit encoders, 2.5 mm/s: searched in a \
         recording, then 12 s of learning from cold; ripple (Eq 19), %"
    );
    for (case, rpm, left) in cases {
        let left = match left {
            Ok(left) => format!("{left:>6.2}"),
            Err(why) => why.clone(),
        };
        println!("  {:<32} {:<14} {left}", case.name(), mode(*rpm));
    }
}
