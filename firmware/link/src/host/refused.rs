//! Why a drive does not do what was asked, in sentences.

use crate::message::{Refusal, Reply};
use crate::settings::{Setting, Settings, Value};
use std::fmt;

/// The drive does not do what was asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Refused {
    /// For this reason.
    For(Refusal),
    /// The settings do not fit its formats, in a sentence.
    Unfit(String),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::For(refusal) => f.write_str(refusal.sentence()),
            Self::Unfit(sentence) => f.write_str(sentence),
        }
    }
}

impl std::error::Error for Refused {}

/// The drive does not answer any more.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost(pub String);

impl Lost {
    /// No answer came in time.
    #[must_use]
    pub fn silent() -> Self {
        Self(
            "the drive does not answer: is it there, has it power, and is nothing else on the line?"
                .to_owned(),
        )
    }
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Lost {}

/// What does not fit the drive's numbers, and by how much.
fn misfit(name: &str, unit: &str, is: f64, [least, below]: [f64; 2]) -> String {
    // A unit of the format's own: only the ratio says something.
    if unit.starts_with("2^-n") {
        return if is > below {
            format!(
                "{name} would be {:.3} times too large for the drive's number format",
                is / below
            )
        } else {
            format!(
                "{name} would be too small for the drive's number format, by a factor of {:.3}",
                least / is
            )
        };
    }
    // Only one end is a limit where the other is the largest number there is.
    let possible = if below == f64::MAX {
        format!("at least {least} {unit} is needed")
    } else if least == f64::MIN {
        format!("at most {below} {unit} is possible")
    } else {
        format!("{least} to {below} {unit} are possible")
    };
    format!("{name} would be {is} {unit}, but {possible}")
}

/// Where a setting does not fit: that it does with the value that it has.
pub(super) fn advised(error: anyhow::Error, held: &Settings, asked: &Settings) -> anyhow::Error {
    let Some(Refused::Unfit(sentence)) = error.downcast_ref() else {
        return error;
    };
    let unfit = held
        .differences(asked)
        .find(|(setting, ..)| sentence.starts_with(&format!("{setting} = ")));
    let Some((setting, now, _)) = unfit else {
        return error;
    };
    let (now, unit) = (now.shown(setting), setting.unit());
    let space = if unit.is_empty() { "" } else { " " };
    let advice =
        format!("{sentence}. It fits with {now}{space}{unit}: choose a value nearer to that");
    Refused::Unfit(advice).into()
}

/// Why the drive did not do what was asked, by its answer: [`Refused`], or that the answer is not the expected one.
#[must_use]
pub fn unexpected(reply: &Reply) -> anyhow::Error {
    match reply {
        Reply::Refused(word) => match Refusal::of_word(*word) {
            Some(refusal) => Refused::For(refusal).into(),
            None => {
                anyhow::anyhow!("the drive refuses, for a reason that this program does not know")
            }
        },
        Reply::Unfit {
            id,
            value,
            name,
            unit,
            is,
            least,
            below,
        } => {
            let setting = Setting::numbered(*id);
            let begin = match (setting, value) {
                (Some(setting), Some(value)) => {
                    format!(
                        "{setting} = {} does not fit: ",
                        Value::from(*value).shown(setting)
                    )
                }
                _ => "the settings do not fit: ".to_owned(),
            };
            Refused::Unfit(format!(
                "{begin}{}",
                misfit(name, unit, is.get(), [least.get(), below.get()])
            ))
            .into()
        }
        _ => anyhow::anyhow!("the drive answers something else than was asked"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_on_one_side_is_said_as_one() {
        for (limits, expected) in [
            ([0.0, f64::MAX], "at least 0 V/A is needed"),
            ([f64::MIN, 3.0], "at most 3 V/A is possible"),
            ([0.0, 3.0], "0 to 3 V/A are possible"),
        ] {
            let said = misfit("gain", "V/A", -1.0, limits);
            assert_eq!(said, format!("gain would be -1 V/A, but {expected}"));
        }
    }
}
