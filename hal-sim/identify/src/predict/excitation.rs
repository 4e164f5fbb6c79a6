//! What a record excites, and which record would excite the rest.

use super::basis::At;
use crate::digits::three;
use crate::signal::quantile::quantile_of_sizes;
use std::f64::consts::TAU;

/// Smallest length, s; turns; speed classes. A record that goes up and down once passes 3 classes.
const LEAST_S: f64 = 3.0;
const LEAST_TURNS: f64 = 1.0;
const LEAST_CLASSES: usize = 3;
/// Ratio of two speeds that are two classes, and share of the moving rows that one has.
const CLASS: f64 = 1.3;
const SHARE: f64 = 0.03;
/// Speed below which a shaft creeps, rad/s: 5 rpm.
pub(crate) const CREEPS_RAD_S: f64 = 0.5;
/// Smallest top speed of an example, rpm: 3 s of its slowest speed are a turn.
const LEAST_EXAMPLE_RPM: f64 = 80.0;
/// Ratio of two speeds by which viscous friction differs from an offset.
const VISCOUS: f64 = 2.0;

/// See the module.
#[derive(Debug, Clone, Default)]
pub(crate) struct Excitation {
    seconds: f64,
    turns: f64,
    /// Speed classes, the direction counted.
    classes: usize,
    both_ways: bool,
    /// Speed that all but one row in twenty are below, rad/s.
    top: f64,
}

impl Excitation {
    /// Of the rows of a record.
    pub(crate) fn new(rows: &[At], rate: f64) -> Self {
        let top = quantile_of_sizes(rows.iter().map(|at| at.speed), 0.95);
        let mut classes = std::collections::BTreeMap::<(bool, i32), usize>::new();
        let mut moving = 0;
        for at in rows
            .iter()
            .filter(|at| at.speed.abs() > 0.02 * top && at.speed != 0.0)
        {
            moving += 1;
            let class = (at.speed.abs().ln() / CLASS.ln()).floor() as i32;
            *classes.entry((at.speed > 0.0, class)).or_default() += 1;
        }
        let of_way = |way: bool| -> usize {
            classes
                .iter()
                .filter(|((w, _), _)| *w == way)
                .map(|(_, n)| n)
                .sum()
        };
        let least = SHARE * f64::from(moving);
        Excitation {
            seconds: rows.len() as f64 / rate,
            turns: range(rows) / TAU,
            classes: classes
                .values()
                .filter(|count| **count as f64 >= least)
                .count(),
            both_ways: [true, false]
                .into_iter()
                .all(|way| of_way(way) as f64 > least),
            top,
        }
    }

    /// Whether nothing moves, or creeps only.
    pub(crate) fn stands(&self) -> bool {
        self.top < CREEPS_RAD_S
    }

    /// Whether there is too little of it to say that nothing is missing.
    pub(crate) fn is_thin(&self) -> bool {
        self.stands()
            || self.seconds < LEAST_S
            || self.turns < LEAST_TURNS
            || self.classes < LEAST_CLASSES
    }

    /// What it cannot tell of a `shaft`, and the record that would; nothing where it tells all.
    pub(crate) fn lacks(&self, shaft: &str) -> Vec<Lack> {
        let mut lacks = Vec::new();
        let mut lack = |asks, untested| lacks.push(Lack { untested, asks });
        if self.stands() {
            let top = rpm(self.top);
            lack(
                Ask::Faster,
                format!(
                    "inertia, friction, flux and ripple, as the {shaft} moves at {top:.2} rpm at most"
                ),
            );
        }
        if self.seconds < LEAST_S {
            let seconds = three(self.seconds);
            lack(
                Ask::Longer,
                format!("what {seconds} s of the {shaft} are too short for"),
            );
        }
        if self.turns < LEAST_TURNS {
            let turns = self.turns;
            lack(
                Ask::Turns,
                format!("orders of the turn, as the {shaft} covers {turns:.2} turns"),
            );
        }
        if self.classes < LEAST_CLASSES && !self.stands() {
            let shown = self.classes;
            lack(
                Ask::Speeds,
                format!(
                    "friction over speed and viscous friction, as the {shaft} shows {shown} of the {LEAST_CLASSES} speed classes needed"
                ),
            );
        }
        if !self.both_ways && !lacks.is_empty() {
            lacks.push(Lack {
                untested: format!(
                    "Coulomb friction beside an offset, as the {shaft} turns one way only"
                ),
                asks: Ask::BothWays,
            });
        }
        lacks
    }

    /// Speeds that a record should have, rpm.
    pub(crate) fn example_rpm(&self) -> [f64; LEAST_CLASSES] {
        let top = rpm(self.top).max(LEAST_EXAMPLE_RPM);
        [1.0, VISCOUS, VISCOUS * VISCOUS].map(|ratio| top / ratio)
    }
}

/// Revolutions a minute of rad/s.
fn rpm(speed: f64) -> f64 {
    speed * 60.0 / TAU
}

/// What a record cannot tell, and what it takes.
#[derive(Debug, Clone)]
pub(crate) struct Lack {
    /// What the record does not test, and why.
    pub(crate) untested: String,
    /// What a record must have to test it.
    pub(crate) asks: Ask,
}

/// What a record must have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ask {
    Faster,
    Longer,
    Turns,
    Speeds,
    BothWays,
}

impl Ask {
    /// In words, with speeds that would do.
    pub(crate) fn words(self, example_rpm: [f64; LEAST_CLASSES]) -> String {
        match self {
            Ask::Faster => format!("speeds above {:.0} rpm", rpm(CREEPS_RAD_S)),
            Ask::Longer => format!("{LEAST_S:.0} s or more"),
            Ask::Turns => format!("at least {LEAST_TURNS:.0} turn"),
            Ask::Speeds => {
                let [fast, middle, slow] = example_rpm.map(three);
                format!(
                    "at least {LEAST_CLASSES} speeds a factor of {VISCOUS:.0} apart, for example {fast}, {middle} and {slow} rpm"
                )
            }
            Ask::BothWays => "both directions".into(),
        }
    }
}

/// How far the angle goes, rad.
fn range(rows: &[At]) -> f64 {
    let ends = |(low, high): (f64, f64), at: &At| (low.min(at.angle), high.max(at.angle));
    let (low, high) = rows.iter().fold((f64::MAX, f64::MIN), ends);
    (high - low).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(seconds: f64, speed: impl Fn(f64) -> f64) -> Excitation {
        let mut angle = 0.0;
        let rows: Vec<At> = (0..(seconds * 100.0) as usize)
            .map(|k| {
                let speed = speed(k as f64 / 100.0);
                angle += speed / 100.0;
                At {
                    angle,
                    speed,
                    ..At::default()
                }
            })
            .collect();
        Excitation::new(&rows, 100.0)
    }

    #[test]
    fn thin_records_say_what_to_record() {
        for (thin, asks) in [
            (record(10.0, |_| 0.0), "speeds above 5 rpm"),
            (record(10.0, |_| 0.3), "speeds above 5 rpm"),
            (record(10.0, |_| 50.0), "3 speeds"),
            (record(1.0, |t| 50.0 * (9.0 * t).sin()), "3 s or more"),
        ] {
            assert!(thin.is_thin(), "{thin:?}");
            let asked = thin.lacks("motor").into_iter();
            let words: Vec<String> = asked
                .map(|lack| lack.asks.words(thin.example_rpm()))
                .collect();
            assert!(
                words.iter().any(|one| one.contains(asks)),
                "{words:?}: expected {asks}"
            );
        }
    }

    #[test]
    fn a_record_of_many_speeds_is_not_thin() {
        let full = record(10.0, |t| 50.0 * (0.9 * t).sin());
        assert!(
            !full.is_thin() && full.lacks("motor").is_empty(),
            "{full:?}"
        );
    }

    #[test]
    fn no_rows_are_thin() {
        assert!(Excitation::new(&[], 100.0).is_thin());
    }
}
