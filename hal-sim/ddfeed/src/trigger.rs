//! What makes a recording begin, with what came before it: an oscilloscope's trigger on a drive's telemetry.

use plant::recording::{COLUMNS, Sample};
use std::collections::VecDeque;
use std::str::FromStr;

/// When a recording begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The drive has a fault.
    Fault,
    /// A column of the recording passes a level.
    Level {
        /// Its place among [`COLUMNS`].
        column: usize,
        /// It is above the level, and not below it.
        above: bool,
        /// The level, in the column's unit.
        level: f64,
    },
}

impl Trigger {
    fn fires(self, sample: &Sample) -> bool {
        match self {
            Self::Fault => false,
            Self::Level {
                column,
                above,
                level,
            } => match above {
                true => sample.column(column) > level,
                false => sample.column(column) < level,
            },
        }
    }
}

impl FromStr for Trigger {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "fault" {
            return Ok(Self::Fault);
        }
        let wanted = "give `fault`, or a column above or below a level, as in screw_ia_a>3";
        let at = text
            .find(['>', '<'])
            .ok_or_else(|| format!("`{text}` has neither > nor <: {wanted}"))?;
        let (name, level) = (text[..at].trim(), text[at + 1..].trim());
        let column = COLUMNS.iter().position(|known| *known == name);
        let column = column.ok_or_else(|| {
            let names = COLUMNS[1..].join(", ");
            format!("a recording has no column `{name}`; it has {names}")
        })?;
        let level = level.parse().ok().filter(|level: &f64| level.is_finite());
        Ok(Self::Level {
            column,
            above: text[at..].starts_with('>'),
            level: level
                .ok_or_else(|| format!("`{text}` has no finite number for a level: {wanted}"))?,
        })
    }
}

/// Keeps what came last until its trigger fires.
#[derive(Debug)]
pub struct Gate {
    trigger: Trigger,
    past: usize,
    kept: VecDeque<Sample>,
    /// A fault that is waited for has come: it opens with the next row.
    faulty: bool,
}

impl Gate {
    /// Opens by a trigger, with so many rows before it.
    #[must_use]
    pub fn new(trigger: Trigger, past: usize) -> Self {
        Self {
            trigger,
            past,
            kept: VecDeque::with_capacity(past + 1),
            faulty: false,
        }
    }

    /// The drive has a fault.
    pub fn fault(&mut self) {
        self.faulty |= self.trigger == Trigger::Fault;
    }

    /// Keeps a row; `true` if it opens with that.
    pub fn take(&mut self, sample: Sample) -> bool {
        self.kept.push_back(sample);
        if self.kept.len() > self.past + 1 {
            self.kept.pop_front();
        }
        self.faulty || self.trigger.fires(&sample)
    }

    /// What came before the row that opened it, and that row.
    #[must_use]
    pub fn into_rows(self) -> VecDeque<Sample> {
        self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time_s: f64) -> Sample {
        Sample {
            time_s,
            table_position_m: time_s * 1e-3,
            ..Sample::default()
        }
    }

    #[test]
    fn a_gate_opens_at_its_level_with_what_came_before() {
        let trigger: Trigger = "table_position_m > 4.5e-3".parse().unwrap();
        let mut gate = Gate::new(trigger, 3);
        assert!((0..10).any(|k| gate.take(row(f64::from(k)))));
        let times: Vec<f64> = gate.into_rows().iter().map(|row| row.time_s).collect();
        assert_eq!(times, [2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_fault_opens_only_the_gate_that_waits_for_one() {
        for (text, opens) in [("fault", true), ("screw_ia_a<-1", false)] {
            let mut gate = Gate::new(text.parse().unwrap(), 2);
            assert!(!gate.take(row(0.0)));
            gate.fault();
            assert_eq!(gate.take(row(1.0)), opens, "{text}");
        }
    }

    #[test]
    fn what_is_no_trigger_is_said() {
        for (text, expected) in [
            ("screw_ia_a", "neither > nor <"),
            ("current>3", "no column `current`"),
            ("screw_ia_a>", "no finite number"),
            ("screw_ia_a>inf", "no finite number"),
        ] {
            let error = text.parse::<Trigger>().unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
