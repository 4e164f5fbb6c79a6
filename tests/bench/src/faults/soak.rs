//! Long runs: random commands, faults and resets, after which the drive must run again; and hard but healthy running, in which
//! no watch may stop it.

use super::cell::{Defect, Input};
use super::run::Run;
use super::{Drives, Limits, Situation};
use control::supervisor::{Demand, State};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;

/// Furthest that the table is sent from where it began, m.
const FURTHEST_M: f64 = 0.1;
/// How long a command is followed, s.
const HELD_S: [f64; 2] = [0.1, 1.5];
/// How long a fault is left in, and how long the drive has to run again after it, s.
const FAULTY_S: f64 = 1.5;
const RECOVERS_S: f64 = 40.0;

/// What a long run has seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Soaked {
    /// Simulated, s.
    pub seconds: f64,
    /// Commands, faults that were injected.
    pub commands: u32,
    /// See `commands`.
    pub faults: u32,
    /// How often each fault stopped it.
    pub stopped: BTreeMap<&'static str, u32>,
    /// How often it did not run again after the fault was taken out and a reset was asked.
    pub stuck: u32,
    /// Longest above the current limit after a sensor could see it, PWM periods.
    pub over_current_periods: f64,
    /// How often that was for longer than a period.
    pub over_currents: u32,
}

impl Soaked {
    fn recover(&mut self, run: &mut Run) {
        self.seconds += recover(run);
        self.stuck += u32::from(run.drive.state() != State::Ready);
    }
}

struct Dice(Xoshiro256PlusPlus);

impl Dice {
    fn part(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, [least, most]: [f64; 2]) -> f64 {
        least + self.part() * (most - least)
    }

    /// A command within what the feed may, back to the middle where the table is far from it.
    fn command(&mut self, run: &Run, middle: f64) -> OperatingPoint {
        let away = run.bench.position - middle;
        let mut velocity = run.bench.plate.feed.velocity_max * self.between([-0.5, 0.5]);
        if self.part() < 0.3 {
            velocity *= 0.02;
        }
        if away.abs() > FURTHEST_M {
            velocity = -velocity.abs() * away.signum();
        }
        OperatingPoint {
            velocity,
            base: self.between([-1.0, 1.0]) * 1700.0 * RPM,
        }
    }

    /// Asks a command, and lets it hold for a while.
    fn hold(
        &mut self,
        run: &mut Run,
        middle: f64,
        told: &mut Soaked,
    ) -> Result<(), ExperimentError> {
        let point = self.command(run, middle);
        run.ask(point)?;
        told.commands += 1;
        let held = self.between(HELD_S);
        run.pass(held);
        told.seconds += held;
        Ok(())
    }
}

/// `board` on its bus, ready.
fn ready(board: BoardKind, drives: Drives, seed: u64) -> Result<Run, ExperimentError> {
    let (plate, config) = (drives.plate(board), drives.on(board.config_on_its_bus()));
    Run::on(board, &plate, Situation::Ready, &[], seed, config)
}

/// Healthy running of `seconds`: reversals and limits, on `board`.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or does not start.
pub fn healthy(
    board: BoardKind,
    drives: Drives,
    seconds: f64,
    seed: u64,
) -> Result<Soaked, ExperimentError> {
    let mut dice = Dice(Xoshiro256PlusPlus::seed_from_u64(seed));
    let mut run = ready(board, drives, seed)?;
    let (middle, mut told) = (run.bench.position, Soaked::default());
    while told.seconds < seconds {
        dice.hold(&mut run, middle, &mut told)?;
        if let State::Fault(fault) = run.drive.state() {
            *told.stopped.entry(fault.name()).or_default() += 1;
            told.recover(&mut run);
        }
    }
    Ok(told)
}

/// Random commands, with a fault of a random input now and then, for `seconds` on `board`.
///
/// # Errors
/// [`ExperimentError`] as for [`healthy`].
pub fn soak(
    board: BoardKind,
    drives: Drives,
    seconds: f64,
    seed: u64,
) -> Result<Soaked, ExperimentError> {
    let mut dice = Dice(Xoshiro256PlusPlus::seed_from_u64(seed));
    let mut run = ready(board, drives, seed)?;
    let (middle, mut told) = (run.bench.position, Soaked::default());
    let inputs = Input::of(board);
    let limit = Limits::OF_THE_MATRIX.over_current_periods;
    while told.seconds < seconds {
        for _ in 0..3 {
            dice.hold(&mut run, middle, &mut told)?;
        }
        let input = inputs[(dice.part() * inputs.len() as f64) as usize];
        let can: Vec<Defect> = Defect::ALL
            .into_iter()
            .filter(|defect| input.can_be(*defect, board))
            .collect();
        let defect = can[(dice.part() * can.len() as f64) as usize];
        run.bench
            .put_in(input, defect, seed.wrapping_add(told.faults.into()));
        told.faults += 1;
        run.pass(FAULTY_S);
        told.seconds += FAULTY_S;
        let over = (f64::from(run.bench.seen.over_most) / 2.0 - 1.0).max(0.0);
        told.over_current_periods = told.over_current_periods.max(over);
        told.over_currents += u32::from(over > limit);
        if let State::Fault(fault) = run.drive.state() {
            *told.stopped.entry(fault.name()).or_default() += 1;
        }
        run.bench.spoiled.clear();
        told.recover(&mut run);
    }
    Ok(told)
}

/// Comes to rest, leaves a fault, and is ready again: how long that took, s.
pub(super) fn recover(run: &mut Run) -> f64 {
    run.drive.request.demand = Demand::Reset;
    // The enable switch is opened and closed, as a fault of one of its contacts asks.
    run.bench.enable_opened = true;
    run.pass(0.05);
    run.bench.enable_opened = false;
    run.pass(0.05);
    let mut waited = 0.1;
    while run.drive.state() != State::Ready && waited < RECOVERS_S {
        // An alignment can be refused by a table that still coasts. A chip that has begun again is aligned again.
        run.drive.request.demand = match run.drive.state() {
            State::Unaligned | State::Aligning => Demand::Align,
            _ => Demand::Reset,
        };
        run.pass(0.05);
        waited += 0.05;
    }
    run.drive.request.demand = Demand::Rest;
    waited
}
