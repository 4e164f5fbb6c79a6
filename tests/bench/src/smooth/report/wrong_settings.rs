//! The ripple of a drive that has wrong settings.

use crate::smooth::bench::{Change, robustness};
use hal_sim::parallel::on_all_cores;
use serde_json::{Value, json};

/// What is other than the drive was told, and the ripple of the PI and of ours, %; `None` after a fault.
pub type Robust = (Change, [Option<f64>; 2]);

/// Of all changes.
pub fn measure() -> Vec<Robust> {
    on_all_cores(&Change::ALL, |&change| (change, robustness(change)))
}

/// As JSON.
pub fn json(robust: &[Robust]) -> Value {
    let one = |(change, [pi, ours]): &Robust| {
        json!({
            "change": change.name(),
            "vrf_pi": pi,
            "vrf_ours": ours,
            "stable": ours.is_some(),
        })
    };
    robust.iter().map(one).collect()
}

/// For a person.
pub fn print(robust: &[Robust]) {
    println!(
        "\nCoupled, DDFS 800 rpm, 2.5 mm/s, when something is other than the drive was told: PI, ours"
    );
    for (change, [pi, ours]) in robust {
        let say = |vrf: &Option<f64>| vrf.map_or("fault".into(), |vrf| format!("{vrf:.2} %"));
        println!("  {:<36} {:>9} {:>9}", change.name(), say(pi), say(ours));
    }
}
