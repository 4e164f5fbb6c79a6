//! A load that grows with the table's position.

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Linear, Place, Places, Recognition, Serialize,
    Site, Term, limits,
};

/// `value * position` against positive travel: a spring, a cable chain, a counterweight out of balance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionLoad {
    /// Force per travel, N/m.
    #[serde(deserialize_with = "limits::finite")]
    pub value: f64,
}

impl Effect for PositionLoad {
    const KIND: &'static str = "position_load";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Linear(Linear {
        number: "value",
        unit: "N/m",
        says: "has a load that grows by {} with the table\u{2019}s position",
        remedy: ("compensate", "Feed the force forward over the position."),
    });
    const EXAMPLE: Example = (Place::Feed, &[("value", 1000.0)]);

    fn terms(&self) -> Vec<Term> {
        let law = Law::Linear { slope: self.value };
        vec![Term {
            site: Site::TableForce,
            coordinate: Coordinate::TablePosition,
            law,
        }]
    }
}
