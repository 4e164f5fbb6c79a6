//! A load that grows with the table's position.

use super::{Coordinate, Deserialize, Effect, Law, Places, Serialize, Site, Term, limits};

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

    fn terms(&self) -> Vec<Term> {
        let law = Law::Linear { slope: self.value };
        vec![Term {
            site: Site::TableForce,
            coordinate: Coordinate::TablePosition,
            law,
        }]
    }
}
