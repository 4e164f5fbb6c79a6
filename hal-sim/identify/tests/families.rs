//! A kind of effect is a file in the plant and a family here: neither is there without the other.

use identify::effects::family::Family;
use identify::effects::hypothesis::Hypothesis;
use plant::effects::{AnyEffect, Place};
use plant::model::Model;
use std::collections::BTreeSet;
use std::path::Path;

/// Orders of the kinds that only their order tells apart, and a shape that all others can have.
const SHAPES: [f64; 5] = [30.0, 12.0, 7.3, 1.0, 2.5];

/// What families make of effects, by kind.
fn named() -> BTreeSet<&'static str> {
    let model = Model::coupled();
    let mut kinds = BTreeSet::new();
    for family in Family::NAMED {
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
fn each_kind_of_the_plant_has_a_family() {
    let all: BTreeSet<_> = AnyEffect::KINDS.iter().copied().collect();
    assert_eq!(
        named(),
        all,
        "kinds that families make, and kinds of the plant"
    );
}

#[test]
fn each_file_of_the_plants_effects_is_a_kind() {
    let folder = Path::new("../plant/src/effects");
    let files: BTreeSet<String> = std::fs::read_dir(folder)
        .expect("the plant's effects")
        .map(|file| file.expect("a file").path())
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
        .filter(|name| !["mod", "entry", "term", "measured"].contains(&name.as_str()))
        .collect();
    let kinds: BTreeSet<String> = AnyEffect::KINDS
        .iter()
        .map(|kind| (*kind).to_owned())
        .collect();
    assert_eq!(
        files, kinds,
        "files of effects, and kinds that are registered"
    );
}
