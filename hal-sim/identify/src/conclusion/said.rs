//! What is said of a machine, an answer to each question: verdict, residual, untested quantities, further record.

use crate::digits::three;
use crate::predict::excitation::{Ask, Excitation};

/// Table speed of a command that records, mm/s, and how long it holds each point, s.
const TABLE_MM_S: f64 = 2.5;
const HELD_S: f64 = 3.0;

/// See the module.
#[derive(Debug, Clone, Default)]
pub struct Said {
    /// What the verdict rests on.
    pub why: String,
    /// The residual, and where most of it is.
    pub left: Option<String>,
    /// What the records do not test; `None` where nothing has examined it.
    pub untested: Option<Vec<String>>,
    /// What a further record must have.
    pub next: Vec<String>,
    /// The command that records it, of a machine that the drive runs.
    pub command: Option<String>,
    /// The channel that is named as the loudest.
    pub channel: Option<&'static str>,
}

impl Said {
    /// All of it but the command, as sentences.
    pub fn sentence(&self) -> String {
        let untested = self.untested_words().map(|words| match words.as_str() {
            NOTHING => String::new(),
            words => format!("Not tested by this record: {words}."),
        });
        let next = self.next_words();
        let next = next.map(|words| format!("To test it, record {words}."));
        let parts = [Some(self.why.clone()), self.left.clone(), untested, next];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let parts = parts.iter().map(String::as_str).filter(|p| !p.is_empty());
        parts.collect::<Vec<_>>().join(" ")
    }

    /// What the records do not test: `nothing`, or what it is. `None` where nothing has examined it.
    pub fn untested_words(&self) -> Option<String> {
        let untested = self.untested.as_ref()?;
        Some(match untested.is_empty() {
            true => NOTHING.into(),
            false => untested.join("; "),
        })
    }

    /// What a further record must have, if it must have something.
    pub fn next_words(&self) -> Option<String> {
        (!self.next.is_empty()).then(|| self.next.join("; "))
    }

    /// Adds what the records excite of each shaft.
    pub(crate) fn test(&mut self, shafts: &[(Excitation, &str)]) {
        let of = |(own, shaft): &(Excitation, &str)| own.lacks(shaft);
        let lacks: Vec<_> = shafts.iter().flat_map(of).collect();
        let mut asks: Vec<Ask> = Vec::new();
        for lack in &lacks {
            if !asks.contains(&lack.asks) {
                asks.push(lack.asks);
            }
        }
        let rpm = example_rpm(shafts);
        self.next = asks.into_iter().map(|ask| ask.words(rpm)).collect();
        self.untested = Some(lacks.into_iter().map(|lack| lack.untested).collect());
    }

    /// Adds the command of the drive that records what is asked for.
    pub(crate) fn commanded(&mut self, shafts: &[(Excitation, &str)]) {
        self.command = (!self.next.is_empty()).then(|| command(example_rpm(shafts)));
    }
}

/// Where everything was tested.
const NOTHING: &str = "nothing";

/// Speeds that a record of all shafts should have: those of the fastest.
fn example_rpm(shafts: &[(Excitation, &str)]) -> [f64; 3] {
    let examples = shafts.iter().map(|(own, _)| own.example_rpm());
    examples.fold(
        [0.0; 3],
        |most, own| if own[0] > most[0] { own } else { most },
    )
}

/// The command of the drive that holds each speed in both directions.
pub fn command(rpm: [f64; 3]) -> String {
    let holds = rpm.map(|speed| {
        let speed = three(speed);
        format!("--hold {TABLE_MM_S},{speed},{HELD_S} --hold=-{TABLE_MM_S},-{speed},{HELD_S}")
    });
    format!(
        "ddfeed drive --sim 127.0.0.1:7474 record rec --name fit2 --arm {}",
        holds.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::basis::At;

    /// A record of one speed is asked for more of them once, whatever the number of shafts, with the command that records them.
    #[test]
    fn a_record_of_one_speed_asks_for_more() {
        let speed = 602.6 * std::f64::consts::TAU / 60.0;
        let rows = (0..1000).map(|row| At {
            angle: speed * f64::from(row) / 100.0,
            speed,
            ..At::default()
        });
        let own = Excitation::new(&rows.collect::<Vec<_>>(), 100.0);
        let shafts = [(own.clone(), "screw's motor"), (own, "nut's motor")];
        let mut said = Said {
            why: "It holds.".into(),
            ..Said::default()
        };
        said.test(&shafts);
        said.commanded(&shafts);
        let next = "at least 3 speeds a factor of 2 apart, for example 603, 301 and 151 rpm";
        assert_eq!(said.next, [next, "both directions"]);
        let command = said.command.as_deref().unwrap();
        assert!(command.contains("--hold 2.5,603,3 --hold=-2.5,-603,3 --hold 2.5,301,3"));
        let sentence = said.sentence();
        assert!(sentence.starts_with("It holds. Not tested by this record: friction over speed"));
        assert!(sentence.ends_with(&format!("To test it, record {next}; both directions.")));
        assert!(!sentence.contains("Not excited"));
    }

    #[test]
    fn the_command_drives_both_directions() {
        assert_eq!(
            command([603.0, 301.4, 150.7]),
            "ddfeed drive --sim 127.0.0.1:7474 record rec --name fit2 --arm --hold 2.5,603,3 --hold=-2.5,-603,3 \
             --hold 2.5,301,3 --hold=-2.5,-301,3 --hold 2.5,151,3 --hold=-2.5,-151,3"
        );
    }
}
