//! Whatever a model's or a mapping's text says, it is read or refused with a sentence. `FUZZ_EXECUTIONS` sets how many damaged
//! texts each test takes, `FUZZ_SEED` which.

mod asked;

use asked::asked;
use identify::machines::feed_axis::{Axis, Term};
use identify::records::Mapping;
use plant::model::Model;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::path::Path;

/// What a person or a tool may have put into a text: values first.
const PIECES: &[&str] = &[
    "0",
    "1",
    "2.5",
    "1e-3",
    "-1",
    "-0.25",
    "1e308",
    "1e-320",
    "nan",
    "inf",
    "-inf",
    "65536",
    "9223372036854775808",
    "\"\"",
    "true",
    "[]",
    "{}",
    "\"count\"",
    "\"motor\"",
    "1979-05-27",
    "[[",
    "]]",
    "[",
    "]",
    "{",
    "}",
    "=",
    ".",
    ",",
    "\"",
    "'",
    "\n",
    "#",
    "\u{feff}",
    "\u{b0}",
    "\0",
    "\\u",
    "effects",
    "kind",
    "columns",
    "unit",
    "period",
    "name",
    "number",
    "rows",
    "files",
    "\"*\"",
    "pole_pairs",
    "order",
];
const VALUES: usize = 20;

/// A text with up to four of its pieces changed, left out, exchanged or twice.
fn damaged(random: &mut Xoshiro256PlusPlus, sound: &str) -> String {
    let mut text = sound.to_owned();
    for _ in 0..random.random_range(1..5) {
        // Where words begin and end, or anywhere.
        let place = |random: &mut Xoshiro256PlusPlus, text: &str| {
            let at = random.random_range(0..=text.len());
            let at = match random.random_range(0..3) {
                0 => at,
                _ => text[text.floor_char_boundary(at)..]
                    .find(['\n', ' ', '=', ',', '[', ']'])
                    .map_or(text.len(), |further| text.floor_char_boundary(at) + further),
            };
            text.floor_char_boundary(at)
        };
        let from = place(random, &text);
        let to = place(random, &text[from..].chars().take(40).collect::<String>()) + from;
        let to = text.floor_char_boundary(to);
        match random.random_range(0..8) {
            0 => text.replace_range(from..to, ""),
            1 => text.truncate(from),
            2 => {
                let piece = text[from..to].to_owned();
                let at = place(random, &text);
                text.insert_str(at, &piece);
            }
            3 => text.insert_str(from, PIECES[random.random_range(0..PIECES.len())]),
            // The value behind the next name.
            4..=6 => {
                if let Some(value) = text[from..].find("= ").map(|further| from + further + 2) {
                    let end = text[value..]
                        .find('\n')
                        .map_or(text.len(), |end| value + end);
                    let piece = PIECES[random.random_range(0..VALUES)];
                    text.replace_range(value..end, piece);
                }
            }
            _ => text.replace_range(from..to, PIECES[random.random_range(0..PIECES.len())]),
        }
    }
    text
}

/// Damages each of the texts in turn; what `read` makes of a damaged one is none, or the sentence that refuses it.
fn each_is_read_or_refused(
    what: &str,
    texts: &[String],
    read: impl Fn(&str) -> Result<(), String>,
) {
    for text in texts {
        assert_eq!(read(text), Ok(()), "{what} is sound");
    }
    let (count, seed) = (asked("FUZZ_EXECUTIONS", 2000), asked("FUZZ_SEED", 1));
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut taken = 0u64;
    for execution in 0..count {
        let sound = &texts[execution as usize % texts.len()];
        let text = damaged(&mut random, sound);
        match read(&text) {
            Ok(()) => taken += 1,
            Err(sentence) => assert!(
                sentence.len() > 20 && sentence.len() < 6000,
                "seed {seed}, execution {execution}: {sentence}"
            ),
        }
    }
    println!("{what}: {count} damaged texts, {taken} read all the same");
    assert!(
        taken > count / 100 && taken < count,
        "{what}: {taken} of {count} were read: the damage is none, or all"
    );
}

#[test]
fn any_text_as_a_model() {
    let effects = "\n[[effects]]\nkind = \"cogging\"\nwhere = \"nut\"\norder = 36\namplitude = 1\n";
    let texts = [
        Model::paper().to_toml(),
        Model::coupled().to_toml() + effects,
    ];
    each_is_read_or_refused("model of a double drive", &texts, |text| {
        let model = Model::parse(text, "model.toml").map_err(|error| error.to_string())?;
        let again = Model::parse(&model.to_toml(), "again.toml");
        assert_eq!(again.as_ref().ok(), Some(&model), "{text}\n{again:?}");
        Ok(())
    });
}

#[test]
fn any_text_as_a_feed_axis() {
    let more = Axis {
        terms: vec![
            (Term::Stribeck, vec![3.5, 0.02]),
            (Term::Periodic(36.0), vec![1.0, -0.5]),
        ],
        ..Axis::published()
    };
    let texts = [Axis::published().to_toml(), more.to_toml()];
    each_is_read_or_refused("model of a feed axis", &texts, |text| {
        let axis = Axis::parse(text, "model.toml").map_err(|error| error.to_string())?;
        let again = Axis::parse(&axis.to_toml(), "again.toml");
        assert!(again.is_ok(), "{text}\n{again:?}");
        let orders = axis.terms.iter().filter_map(|(term, _)| match term {
            Term::Periodic(order) => Some(*order),
            _ => None,
        });
        let mut numbers = axis.parameters().into_iter().chain(orders);
        assert!(numbers.all(f64::is_finite), "{text}");
        Ok(())
    });
}

#[test]
fn any_text_as_a_mapping() {
    let folder = Path::new("mappings");
    let texts: Vec<String> = [
        "emps",
        "laas",
        "moteus",
        "odrive",
        "odrive-map",
        "simplefoc",
        "vesc",
    ]
    .map(|name| {
        let path = folder.join(format!("{name}.toml"));
        std::fs::read_to_string(path).expect("a mapping of the project")
    })
    .to_vec();
    each_is_read_or_refused("mapping", &texts, |text| {
        Mapping::parse(text, "mapping.toml")
            .map(|_| ())
            .map_err(|error| error.to_string())
    });
}
