//! A kind of effect is a file in the plant. That file says how a record tells it, and the identification does so.

use identify::effects::family::Family;
use identify::effects::hypothesis::Hypothesis;
use plant::effects::{AnyEffect, Kind, Place, Recognition};
use plant::model::Model;
use std::collections::BTreeSet;

/// Orders of the kinds that only their order tells apart, and a shape that all others can have.
const SHAPES: [f64; 5] = [30.0, 12.0, 7.3, 1.0, 2.5];

/// What families make of effects, by kind.
fn named() -> BTreeSet<&'static str> {
    let model = Model::coupled();
    let mut kinds = BTreeSet::new();
    for family in Family::named() {
        let hypotheses = [Place::Screw, Place::Feed]
            .into_iter()
            .flat_map(|place| SHAPES.map(|shape| Hypothesis::new(family, place, shape)));
        let effects: Vec<_> = hypotheses
            .filter_map(|h| h.effect(&model, 10.0, &vec![0.01; h.columns()]))
            .collect();
        assert!(
            !effects.is_empty(),
            "{family:?} is no effect of the plant anywhere"
        );
        kinds.extend(effects.iter().map(|effect| effect.effect().kind()));
    }
    kinds
}

#[test]
fn each_kind_is_told_or_its_file_says_why_not() {
    let is_never = |kind: &&Kind| matches!(kind.recognition, Recognition::Never(_));
    let (never, told): (Vec<&Kind>, Vec<&Kind>) = AnyEffect::CATALOGUE.iter().partition(is_never);
    let told: BTreeSet<_> = told.iter().map(|kind| kind.name).collect();
    assert_eq!(
        named(),
        told,
        "kinds that families make, and kinds of the plant"
    );
    for kind in never {
        let Recognition::Never(reason) = kind.recognition else {
            continue;
        };
        assert!(
            reason.contains(' '),
            "{}: `{reason}` is no reason",
            kind.name
        );
    }
}
