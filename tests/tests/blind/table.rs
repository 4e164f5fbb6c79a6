//! What became of each machine, and the sums.

use crate::matrix::Matrix;
use crate::oracle::{self, Oracle};
use crate::score::{self, Score, Told};
use bench::draw::Machine;
use identify::analysis::{Outcome, Unexplained};
use identify::record::Record;
use plant::effects::EffectModel;
use std::fmt::{self, Display, Formatter};

/// One machine.
pub struct Row {
    pub seed: u64,
    style: String,
    truth: Vec<EffectModel>,
    found: Vec<EffectModel>,
    score: Score,
    /// What the report would say is left without a cause.
    left: Vec<String>,
    /// Of each effect: its greatest share of a channel's noise floor.
    floors: Vec<f64>,
    /// Values that are named right, with their intervals.
    told: Vec<Told>,
    /// Asked only where the machine was not told right.
    oracle: Option<Oracle>,
}

/// How many of how many.
#[derive(Clone, Copy, Default)]
pub struct Count {
    pub right: u32,
    pub of: u32,
}

/// All machines.
pub struct Table(pub Vec<Row>);

impl Row {
    pub fn new(seed: u64, machine: &Machine, outcome: &Outcome) -> Self {
        let score = score::score(&machine.effects, outcome);
        let record = Record::new(&machine.fit, &machine.declared);
        let found: Vec<_> = outcome.effects.iter().map(|f| f.hypothesis).collect();
        Row {
            seed,
            style: machine.style.clone(),
            truth: machine.effects.clone(),
            found: outcome.effects.iter().map(|f| f.effect.clone()).collect(),
            left: outcome.unexplained.iter().map(left).collect(),
            floors: machine
                .effects
                .iter()
                .map(|effect| score::above_floor(&machine.declared, &record, effect))
                .collect(),
            told: score::told(&machine.effects, outcome),
            oracle: (!score.right)
                .then(|| oracle::ask(&machine.declared, &record, &machine.effects, &found)),
            score,
        }
    }

    /// In one line.
    pub fn line(&self) -> String {
        let result = match (self.score.right, self.score.wrong) {
            (true, _) => "right",
            (_, true) => "wrong name",
            _ => "in part or silent",
        };
        let visible = if self.is_visible() { "visible" } else { "" };
        format!(
            "{} {} effects {visible}: {result}",
            self.seed,
            self.truth.len()
        )
    }

    fn is_clean(&self) -> bool {
        self.truth.is_empty()
    }

    fn is_visible(&self) -> bool {
        !self.is_clean() && self.floors.iter().all(|floor| *floor >= 1.0)
    }

    /// What the record could have told.
    fn reason(&self) -> &'static str {
        match &self.oracle {
            None => "",
            Some(oracle) if oracle.falls.iter().any(|fall| *fall < 1.0) => {
                "an effect explains less than what an effect must explain"
            }
            Some(_) if self.score.named => "named right, a value is off",
            Some(oracle) if oracle.behind < 0.0 => "the truth explains more: the search missed it",
            Some(_) => "what was found explains more than the truth: the balances are too simple",
        }
    }
}

fn left(left: &Unexplained) -> String {
    format!(
        "{} over {}, order {:?}, {:?} Hz: {:.2e} {}; {}",
        left.channel.name(),
        left.coordinate,
        left.order,
        left.hz,
        left.size,
        left.channel.unit(),
        left.reason
    )
}

fn text(effect: &EffectModel) -> String {
    let parameters: Vec<String> = effect
        .effect()
        .parameters()
        .iter()
        .filter(|(name, _)| !matches!(name.as_str(), "phase" | "duration_s"))
        .map(|(name, value)| format!("{name} {value:.3e}"))
        .collect();
    format!(
        "{} {}: {}",
        effect.effect().kind(),
        effect.place().name(),
        parameters.join(", ")
    )
}

impl Display for Row {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let size = match (self.is_clean(), self.is_visible()) {
            (true, _) => "clean",
            (_, true) => "above the floor",
            _ => "below the floor",
        };
        let result = match (self.score.wrong, self.found.is_empty()) {
            _ if self.score.right => "right, but not the verdict",
            (true, _) => "WRONG NAME",
            (_, true) => "silent",
            _ => "in part",
        };
        writeln!(
            f,
            "{} ({}), {size}, {result}: {}",
            self.seed,
            self.style,
            self.reason()
        )?;
        for (k, effect) in self.truth.iter().enumerate() {
            write!(
                f,
                "    has   {}, {:.2} of the floor",
                text(effect),
                self.floors[k]
            )?;
            match &self.oracle {
                Some(oracle) => writeln!(
                    f,
                    ", {:.1} of what an effect must explain, {:?}",
                    oracle.falls[k], oracle.values[k]
                )?,
                None => writeln!(f)?,
            }
        }
        for effect in &self.found {
            writeln!(f, "    found {}", text(effect))?;
        }
        for left in &self.left {
            writeln!(f, "    left  {left}")?;
        }
        Ok(())
    }
}

impl Table {
    fn count(&self, which: impl Fn(&Row) -> bool) -> Count {
        let rows = || self.0.iter().filter(|row| which(row));
        Count {
            right: rows().filter(|row| row.score.right).count() as u32,
            of: rows().count() as u32,
        }
    }

    /// Machines all of whose effects are above the noise floor.
    pub fn visible(&self) -> Count {
        self.count(Row::is_visible)
    }

    /// Machines without effects.
    pub fn clean(&self) -> Count {
        self.count(Row::is_clean)
    }

    /// Intervals that hold the truth, of those of values that are named right.
    pub fn covered(&self) -> Count {
        let told = || self.0.iter().flat_map(|row| &row.told);
        Count {
            right: told().filter(|told| told.holds()).count() as u32,
            of: told().count() as u32,
        }
    }

    /// What was there and what was told.
    pub fn matrix(&self) -> Matrix {
        let mut matrix = Matrix::default();
        for row in &self.0 {
            matrix.count(&row.truth, &row.score.found);
        }
        matrix
    }

    fn wrong(&self) -> usize {
        self.0.iter().filter(|row| row.score.wrong).count()
    }

    /// Machines that were told right and yet get the verdict `unexplained`.
    fn unexplained(&self, which: impl Fn(&Row) -> bool) -> usize {
        let rows = self.0.iter().filter(|row| which(row) && row.score.right);
        rows.filter(|row| !row.left.is_empty()).count()
    }

    /// The intervals, one a line: which kinds have too narrow ones, and which too widely.
    pub fn intervals(&self) -> String {
        let lines = self.0.iter().flat_map(|row| {
            row.told.iter().map(|told| {
                let [low, high] = told.interval;
                format!(
                    "{},{},{},{},{low},{high},{:.2}\n",
                    row.seed,
                    told.name,
                    told.truth,
                    told.value,
                    told.off()
                )
            })
        });
        std::iter::once("seed,value of,truth,told,low,high,off by half widths\n".into())
            .chain(lines)
            .collect()
    }

    /// What `cargo xtask bench identify` reads.
    pub fn json(&self) -> String {
        let (visible, clean) = (self.visible(), self.clean());
        let all = self.count(|row| !row.is_clean());
        let covered = self.covered();
        let percent = |right: u32, of: u32| 100.0 * f64::from(right) / f64::from(of.max(1));
        let figures = serde_json::json!({
            "machines": all.of,
            "right_percent": percent(visible.right, visible.of),
            "coverage_percent": percent(covered.right, covered.of),
            "intervals": covered.of,
            "right": visible.right,
            "of": visible.of,
            "false_alarms": clean.of - clean.right,
            "clean": clean.of,
            "all": {"right": all.right, "of": all.of, "wrong_names": self.wrong()},
        });
        format!("{figures}\n")
    }
}

impl Display for Table {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let whole = |row: &&Row| row.score.right && row.left.is_empty();
        for row in self.0.iter().filter(|row| !whole(row)) {
            write!(f, "{row}")?;
        }
        let (visible, clean) = (self.visible(), self.clean());
        let single = self.count(|row| row.truth.len() == 1);
        let pairs = self.count(|row| row.truth.len() == 2);
        let below = self.count(|row| !row.is_clean() && !row.is_visible());
        let silent = |row: &&Row| !row.is_clean() && !row.score.right && row.found.is_empty();
        writeln!(
            f,
            "above the noise floor: {} of {} right; below: {} of {} right\n\
             one effect: {} of {} right; pairs: {} of {} right; silent: {}\n\
             false alarms: {} of {} clean machines; wrong names: {} of {} machines\n\
             told right, yet something said to be left: {} clean machines, {} others",
            visible.right,
            visible.of,
            below.right,
            below.of,
            single.right,
            single.of,
            pairs.right,
            pairs.of,
            self.0.iter().filter(silent).count(),
            clean.of - clean.right,
            clean.of,
            self.wrong(),
            self.0.len(),
            self.unexplained(Row::is_clean),
            self.unexplained(|row| !row.is_clean()),
        )
    }
}
