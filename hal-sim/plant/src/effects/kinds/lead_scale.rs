//! Relative error of the lead.

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Linear, Place, Places, Recognition, Serialize,
    Site, Term, limits,
};

/// Travel times `1 + value`; the axial force works back on the shafts through the same slope.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeadScale {
    /// Relative error of the lead; above -1.
    #[serde(deserialize_with = "limits::above_minus_one")]
    pub value: f64,
}

impl Effect for LeadScale {
    const KIND: &'static str = "lead_scale";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Linear(Linear {
        number: "value",
        unit: "",
        says: "has a lead that is off by {}",
        remedy: (
            "compensate",
            "Correct the travel by a table over the screw against the nut.",
        ),
    });
    const EXAMPLE: Example = (Place::Feed, &[("value", 1e-4)]);

    fn terms(&self) -> Vec<Term> {
        let law = Law::Linear { slope: self.value };
        vec![Term {
            site: Site::Travel,
            coordinate: Coordinate::NominalTravel,
            law,
        }]
    }
}
