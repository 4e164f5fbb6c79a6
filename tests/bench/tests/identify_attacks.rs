//! A sample of the attacks; `cargo xtask bench identify --only attacks --long` runs all of them on several machines.

use bench::identify::attacks::{attacks, clean, thin};

#[test]
fn nothing_is_said_too_surely() {
    let (attacks, curves) = attacks(11, 1, 14);
    println!("{attacks:?} {curves:?}");
    assert_eq!(attacks.sure_and_wrong, 0, "{attacks:?}");
    assert_eq!(attacks.clean[2], 0, "{attacks:?}");
    assert_eq!(curves.made_worse, 0, "{curves:?}");
}

#[test]
fn thin_records_are_told_what_to_record() {
    let thin = thin(500, 10);
    assert_eq!(
        (thin.sure_and_wrong, thin.advised),
        (0, thin.runs),
        "{thin:?}"
    );
}

/// Encoders of 9,000 to 13,000 counts: their rounding is most of the acceleration above 30 Hz. At an even speed it is lines. The second
/// machine has 108,000 counts, and an order of less than 0.2 % of the current by chance.
#[test]
fn a_coarse_encoder_is_no_lag_of_the_current() {
    let said = clean(&[0, 3_000, 16_000, 21_000, 23_000, 38_000]);
    for verdict in &said {
        assert_eq!(*verdict, ("nothing missing", 0), "{said:?}");
    }
}
