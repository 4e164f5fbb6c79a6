//! What a number in `model.toml` may be. Each function is named by `#[serde(deserialize_with)]` at the field it guards.

use serde::Deserializer;
use serde::de::{Error, Unexpected, Visitor};
use std::fmt;

struct Limited<A> {
    allowed: &'static str,
    accepts: A,
}

impl<A: Fn(f64) -> bool> Visitor<'_> for Limited<A> {
    type Value = f64;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.allowed)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        if value.is_finite() && (self.accepts)(value) {
            Ok(value)
        } else {
            Err(E::invalid_value(Unexpected::Float(value), &self))
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        // Whole numbers are a convenient way to write a float; 2^53 bounds what survives the conversion.
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<f64, E> {
        self.visit_f64(value as f64)
    }
}

macro_rules! limits {
    ($($name:ident: $allowed:literal, $accepts:expr;)*) => {$(
        #[doc = concat!("Accepts ", $allowed, ".")]
        pub(crate) fn $name<'de, D: Deserializer<'de>>(input: D) -> Result<f64, D::Error> {
            input.deserialize_f64(Limited { allowed: $allowed, accepts: $accepts })
        }
    )*};
}

limits! {
    finite: "a finite number", |_| true;
    positive: "a finite number above 0", |x| x > 0.0;
    non_negative: "a finite number, 0 or above", |x| x >= 0.0;
    above_minus_one: "a finite number above -1 (a relative change; -1 would leave nothing)", |x| x > -1.0;
    whole_order: "a whole number from 1 to 10000", |x: f64| x.fract() == 0.0 && (1.0..=10_000.0).contains(&x);
    order: "a number above 0, at most 10000", |x| x > 0.0 && x <= 10_000.0;
    lead: "a finite number other than 0", |x| x != 0.0;
    first_or_second: "1 or 2", |x| x == 1.0 || x == 2.0;
    of_encoder: "1, 2 or 4", |x| x == 1.0 || x == 2.0 || x == 4.0;
}

struct Count {
    allowed: &'static str,
    most: i64,
}

impl Visitor<'_> for Count {
    type Value = u32;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.allowed)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<u32, E> {
        match u32::try_from(value) {
            Ok(count) if (1..=self.most).contains(&value) => Ok(count),
            _ => Err(E::invalid_value(Unexpected::Signed(value), &self)),
        }
    }
}

/// Accepts the pole pairs of a motor.
pub(crate) fn pole_pairs<'de, D: Deserializer<'de>>(input: D) -> Result<u32, D::Error> {
    input.deserialize_i64(Count {
        allowed: "a whole number from 1 to 1000",
        most: 1000,
    })
}

/// As [`counts`], of a key that may be left out.
pub(crate) fn some_counts<'de, D: Deserializer<'de>>(input: D) -> Result<Option<u32>, D::Error> {
    counts(input).map(Some)
}

/// Accepts the counts per turn of an encoder, up to 31 bits.
pub(crate) fn counts<'de, D: Deserializer<'de>>(input: D) -> Result<u32, D::Error> {
    input.deserialize_i64(Count {
        allowed: "a whole number from 1 to 2147483648",
        most: 1 << 31,
    })
}
