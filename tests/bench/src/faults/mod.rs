//! The fault matrix: each input, wrong in each way, in each situation, on both boards, and what comes of it.
//!
//! The machine is the coupled one with a load of half of what friction holds, end stops, and what the boards have: low-side
//! shunts, comparators that see what the amplifiers show, supervision and analog watchdogs. A cell is unsafe
//!
//! - where a phase current stays above the board's limit for longer than a PWM period after a sensor could see it,
//! - where the table moves by more than 2 mm: until the drive reacts, how far it is from where a healthy drive has it; from
//!   then on the whole way, less what a regular stop from that velocity takes where that is the reaction (1.05 mm from 20 mm/s
//!   and 21.25 mm from 100 mm/s, by the feed's 0.25 m/s^2 and 10 m/s^3),
//! - where the fault that the drive names sends a person to another part.
//!
//! Where the table comes near an end switch, it is homed and has soft limits behind the switches: without them a switch that is welded
//! shows nowhere.
//!
//! A wrong command or demand is not a wrong sensor: the table may go where it is asked, and only the way after the reaction counts.

mod bench;
mod cause;
mod cell;
mod controller;
mod drives;
mod interrupted;
pub mod report;
mod run;
mod scenario;
mod small;
mod soak;
mod spoiled;
mod steady;

pub use cell::{Cell, Defect, Input, Pair, Situation};
pub use drives::Drives;
pub use interrupted::{Interrupted, Interruption, alignment_s, interrupt};
pub use scenario::{Point, Scenario, Story, run as run_scenario};
pub use small::{SmallFault, SmallOutcome, small_fault};
pub use soak::{Soaked, healthy, soak};
pub use steady::Steady;

use control::alignment::Misalignment;
use control::supervisor::State;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::ExperimentError;
use hal_sim::parallel::on_all_cores;
use run::{Event, Healthy};
use std::collections::HashMap;

/// Why a cell is unsafe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Hazard {
    /// Current above the limit for too long.
    OverCurrent,
    /// The table moved too far.
    Travel,
    /// The fault that is named is not the cause.
    WrongCause,
}

impl Hazard {
    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OverCurrent => "over-current",
            Self::Travel => "travel",
            Self::WrongCause => "wrong cause",
        }
    }
}

/// What a cell may do at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Above the current limit after a sensor could see it, PWM periods.
    pub over_current_periods: f64,
    /// Travel, m.
    pub travel_m: f64,
}

impl Limits {
    /// Those of the matrix.
    pub const OF_THE_MATRIX: Self = Self {
        over_current_periods: 1.0,
        travel_m: 2e-3,
    };
}

/// What came of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How long the drive took to react to the fault, s; `None`: it did not, or reacted only to what a healthy one does too.
    pub detected_s: Option<f64>,
    /// Largest phase current, A.
    pub peak_a: f64,
    /// Longest above the limit after a sensor could see it, PWM periods.
    pub over_current_periods: f64,
    /// Energy that went into the bus, J.
    pub returned_j: f64,
    /// How far the table went wrong, m.
    pub travel_m: f64,
    /// Largest force on an end stop, N.
    pub end_force_n: f64,
    /// What the drive was doing at the end.
    pub state: State,
    /// Why it could not be aligned.
    pub misalignment: Option<Misalignment>,
    /// The fault that it names is not the cause.
    pub wrong_cause: bool,
    /// How long it was watched, s.
    pub seconds: f64,
    /// Why it is unsafe; none: it is not.
    pub hazards: Vec<Hazard>,
}

/// What healthy drives do, to hold the others against.
#[derive(Debug)]
pub struct Matrix {
    drives: Drives,
    healthy: HashMap<(BoardKind, Situation, Event), Healthy>,
}

impl Matrix {
    /// Runs a healthy one of `drives` in each situation of `cells`.
    ///
    /// # Errors
    /// [`ExperimentError`] if it cannot be configured or does not come into its situation.
    pub fn of(cells: &[Cell], drives: Drives) -> Result<Self, ExperimentError> {
        let event = |cell: &Cell| Event::of(&[(cell.input, cell.defect)]);
        Self::with(
            drives,
            cells
                .iter()
                .map(|cell| (cell.board, cell.situation, event(cell))),
        )
    }

    /// The same of pairs.
    ///
    /// # Errors
    /// [`ExperimentError`] as for [`Matrix::of`].
    pub fn of_pairs(pairs: &[Pair], drives: Drives) -> Result<Self, ExperimentError> {
        let event = |pair: &Pair| Event::of(&pair.faults);
        Self::with(
            drives,
            pairs
                .iter()
                .map(|pair| (pair.board, pair.situation, event(pair))),
        )
    }

    fn with(
        drives: Drives,
        wanted: impl Iterator<Item = (BoardKind, Situation, Event)>,
    ) -> Result<Self, ExperimentError> {
        let mut keys: Vec<_> = Vec::new();
        for key in wanted {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        let runs = on_all_cores(&keys, |(board, situation, event)| {
            run::run(drives, *board, *situation, &[], *event, 0, None)
        });
        let mut healthy = HashMap::new();
        for (key, run) in keys.into_iter().zip(runs) {
            healthy.insert(key, run?.1);
        }
        Ok(Self { drives, healthy })
    }

    /// Runs a cell.
    ///
    /// # Errors
    /// [`ExperimentError`] as for [`Matrix::of`].
    pub fn run(&self, cell: &Cell) -> Result<Outcome, ExperimentError> {
        self.run_faults(
            cell.board,
            cell.situation,
            &[(cell.input, cell.defect)],
            &cell.name(),
        )
    }

    /// Runs a pair. Either of its faults is a right cause.
    ///
    /// # Errors
    /// [`ExperimentError`] as for [`Matrix::of`].
    pub fn run_pair(&self, pair: &Pair) -> Result<Outcome, ExperimentError> {
        self.run_faults(pair.board, pair.situation, &pair.faults, &pair.name())
    }

    fn run_faults(
        &self,
        board: BoardKind,
        situation: Situation,
        faults: &[(Input, Defect)],
        name: &str,
    ) -> Result<Outcome, ExperimentError> {
        let event = Event::of(faults);
        let healthy = self.healthy.get(&(board, situation, event));
        let seed = run::seed(name);
        run::run(self.drives, board, situation, faults, event, seed, healthy)
            .map(|(outcome, _)| outcome)
    }

    /// Runs all of `cells` on all cores, in their order.
    ///
    /// # Errors
    /// [`ExperimentError`] of the first that fails.
    pub fn run_all(&self, cells: &[Cell]) -> Result<Vec<Outcome>, ExperimentError> {
        on_all_cores(cells, |cell| self.run(cell))
            .into_iter()
            .collect()
    }
}
