//! What the readings of a bring-up mean: one item for each thing asked, with what was expected and from where, what was
//! read, what that means, and what to do.

mod analog;
mod clock;
mod encoders;
mod memory;
mod page;
mod pins;
mod powered;
mod protection;

pub use page::page;

use link::bringup::Stage;
use link::codes::{Fault, State};
use link::host::bringup::Readings;
use serde::Serialize;

/// What an item came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As expected.
    Good,
    /// Not as expected.
    Finding,
    /// Could not be told.
    Open,
}

/// One thing asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Item {
    /// Its name for a program: `comparator.3`.
    pub id: String,
    /// What it belongs to.
    pub group: &'static str,
    /// Its name for a person.
    pub what: String,
    /// What was expected.
    pub expected: String,
    /// What was read.
    pub read: String,
    /// What it came to.
    pub verdict: Verdict,
    /// What that means; empty where all is well.
    pub means: String,
    /// What to do; empty where all is well.
    pub todo: String,
    /// Where the expectation is from.
    pub source: &'static str,
}

impl Item {
    /// An item that is as expected, until something is said against it.
    fn new(
        group: &'static str,
        id: impl Into<String>,
        what: impl Into<String>,
        source: &'static str,
    ) -> Self {
        Self {
            id: id.into(),
            group,
            what: what.into(),
            expected: String::new(),
            read: String::new(),
            verdict: Verdict::Good,
            means: String::new(),
            todo: String::new(),
            source,
        }
    }

    fn expected(mut self, text: impl Into<String>) -> Self {
        self.expected = text.into();
        self
    }

    fn read(mut self, text: impl Into<String>) -> Self {
        self.read = text.into();
        self
    }

    fn say(mut self, verdict: Verdict, means: impl Into<String>, todo: impl Into<String>) -> Self {
        self.verdict = verdict;
        self.means = means.into();
        self.todo = todo.into();
        self
    }

    /// Not as expected.
    fn finding(self, means: impl Into<String>, todo: impl Into<String>) -> Self {
        self.say(Verdict::Finding, means, todo)
    }

    /// Could not be told.
    fn open(self, means: impl Into<String>, todo: impl Into<String>) -> Self {
        self.say(Verdict::Open, means, todo)
    }
}

/// All items of a bring-up.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The result in a sentence.
    pub result: String,
    /// How many items are not as expected.
    pub findings: usize,
    /// In the order in which they were asked.
    pub items: Vec<Item>,
    /// How the channels settle: name, and counts away from the longest sampling time by sampling time, ns.
    #[serde(skip)]
    settling: Vec<(String, Vec<(f64, f64)>)>,
}

impl Report {
    /// The items of one verdict.
    pub fn of(&self, verdict: Verdict) -> impl Iterator<Item = &Item> {
        self.items
            .iter()
            .filter(move |item| item.verdict == verdict)
    }

    /// For a terminal: findings in full, then all items in a line each.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut line = |words: String| {
            text.push_str(&words);
            text.push('\n');
        };
        let mut group = "";
        for item in &self.items {
            if item.group != group {
                group = item.group;
                line(format!("\n{group}"));
            }
            let mark = match item.verdict {
                Verdict::Good => "ok",
                Verdict::Finding => "FINDING",
                Verdict::Open => "open",
            };
            line(format!(
                "  {mark:7} {:36} {:32} expected {}",
                item.what, item.read, item.expected
            ));
        }
        for (verdict, title) in [
            (Verdict::Finding, "Findings"),
            (Verdict::Open, "Could not be told"),
        ] {
            for (k, item) in self.of(verdict).enumerate() {
                if k == 0 {
                    line(format!("\n{title}"));
                }
                line(format!("  {}: {} {}", item.what, item.means, item.todo));
            }
        }
        line(format!("\n{}", self.result));
        text
    }
}

/// What the readings mean.
#[must_use]
pub fn judge(readings: &Readings) -> Report {
    let words = &readings.report;
    let mut items = Vec::new();
    let mut settling = Vec::new();
    items.extend(reached(readings));
    if let Some(meter_v) = readings.meter_v {
        items.extend(powered::items(readings, meter_v));
    } else {
        let begun = |stage: Stage| words.stage >= stage.word();
        if begun(Stage::Converters) {
            items.extend(clock::items(words));
        }
        if begun(Stage::Pins) {
            items.extend(analog::items(words));
            settling = analog::settling(words);
        }
        let refused = readings.stage() == Some(Stage::Refused);
        if begun(Stage::Comparators) && !refused {
            items.extend(pins::items(words));
        }
        if begun(Stage::Encoders) && !refused {
            items.extend(protection::items(words));
        }
        if begun(Stage::Idle) && !refused {
            items.extend(encoders::items(words));
        }
        if begun(Stage::Stream) && !refused {
            items.extend(memory::items(readings));
        }
        if let Some(view) = &readings.drive {
            items.extend(drive(view));
        }
    }
    let findings = items
        .iter()
        .filter(|item| item.verdict == Verdict::Finding)
        .count();
    let open = items
        .iter()
        .filter(|item| item.verdict == Verdict::Open)
        .count();
    let good = items.len() - findings - open;
    let counted = |count: usize, one: &str, more: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        n => Some(format!("{n} {more}")),
    };
    let parts = [
        counted(findings, "is a finding", "are findings"),
        counted(open, "could not be told", "could not be told"),
        Some(format!("{good} are as expected")),
    ];
    let result = format!(
        "{} Of {} readings {}.",
        match (findings, readings.meter_v) {
            (0, _) => "No finding.",
            (_, None) => "Do not switch the bus on yet.",
            (_, Some(_)) => "Switch the bus off.",
        },
        items.len(),
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    );
    Report {
        result,
        findings,
        items,
        settling,
    }
}

/// How far the firmware came, if that is not all the way.
fn reached(readings: &Readings) -> Option<Item> {
    let item = Item::new(
        "The bring-up itself",
        "stage",
        "the firmware's way through it",
        "link::bringup::Stage",
    )
    .expected("to its end");
    let stage = readings.stage()?;
    let item = item.read(format!("ended at: {}", stage.name()));
    if let Some(crash) = &readings.crash {
        return Some(item.finding(
            format!("The firmware gave up: {crash}."),
            "Do not switch the bus on. Do what it says, and start again.",
        ));
    }
    match stage {
        Stage::Done => None,
        // The bus says it.
        Stage::Refused => None,
        Stage::Clock => Some(item.finding(
            "The chip starts and does not get past its clock, pins and converters: the crystal does not oscillate, or \
             an ADC has no supply.",
            "Measure 24 MHz at the crystal (on a NUCLEO-G474RE X3, with its solder bridges as delivered), and 3.3 V at VDDA \
             and VREF+. `cargo xtask run` prints what the firmware logs.",
        )),
        stage => Some(item.finding(
            format!(
                "The firmware hangs or was stopped there: {}",
                stage.sentence()
            ),
            "Run it again; if it ends there again, what is asked at that stage does not answer. `cargo xtask run` prints \
             what stopped the firmware.",
        )),
    }
}

/// The interrupts' cost on the emulated chip: what a board is compared with.
const BASELINE: &str = include_str!("../../../../tests/cost-baseline.json");

/// The most cycles that an interrupt may take by the emulated chip's count.
fn bound(name: &str) -> Option<u64> {
    let baseline: serde_json::Value = serde_json::from_str(BASELINE).ok()?;
    let all = baseline["interrupts"].as_array()?;
    let one = all.iter().find(|row| row["name"] == name)?;
    one["cycles"]["bound"].as_u64()
}

/// The drive as it runs afterwards, with its bridges off.
fn drive(view: &link::host::View) -> Vec<Item> {
    const GROUP: &str = "The drive afterwards, bridges off";
    const SOURCE: &str = "cargo xtask cost: the longest path, counted on the emulated chip";
    let words = view.words();
    let mut items = Vec::new();
    for (motor, name) in words.motors.iter().zip(["screw", "nut"]) {
        let bound = bound(&format!("{name} current loop")).unwrap_or(0);
        let item = Item::new(
            GROUP,
            format!("cycles.{name}"),
            format!("longest step of the {name}'s current loop"),
            SOURCE,
        )
        .expected(format!("at most {bound} cycles, none late"))
        .read(format!(
            "{} cycles, {} late",
            motor.cycles_max, motor.missed
        ));
        items.push(if motor.steps == 0 {
            item.finding(
                "The current loop does not run: its ADC's interrupt does not come.",
                "`cargo xtask attach` shows the state; `cargo xtask run` what the firmware logs.",
            )
        } else if u64::from(motor.cycles_max) > bound || motor.missed > 0 {
            item.finding(
                "The step takes longer than counted: flash wait states or the clock are not what they should be, or \
                 code and tables of one memory bank are fetched over two buses at once, which the count leaves out.",
                "See clock and wait states above. If they are right, give the figure to the count \
                 (`tests/src/timing.rs`): it is the first one from a board.",
            )
        } else {
            item
        });
    }
    let state = view.state().map_or("unknown", State::name);
    let item = Item::new(
        GROUP,
        "drive.state",
        "the drive's state",
        "link::codes::State",
    )
    .expected("no fault");
    items.push(match view.fault() {
        Some(Fault::StageSupply) => item
            .expected("no fault, or stages without supply")
            .read("stages without supply, as expected"),
        Some(fault) => item
            .read(format!("{state}: {}", fault.name()))
            .finding(fault.sentence(), "`cargo xtask attach` shows the rest."),
        None if words.fault != 0 => item.read(state).finding(
            "The drive is stopped by a fault that this host does not know.",
            "Flash this firmware: `cargo xtask flash`.",
        ),
        None => item.read(state),
    });
    items
}

#[cfg(test)]
mod tests;
