//! A cell from its fault to its end: how far the table goes wrong, and how the drive reacts.

use super::{
    CDFS, Event, FAR_M, Healthy, NEAR_M, OPENED_S, REST_S, Run, SOFT_M, START_S, WATCHED_S, stop_m,
};
use crate::faults::bench::{Ends, Soft};
use crate::faults::cause::{names, names_two_channels};
use crate::faults::cell::{Defect, Input, Situation};
use crate::faults::{Drives, Hazard, Limits, Outcome};
use control::plate::DrivePlate;
use control::supervisor::{Demand, State};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::ExperimentError;

/// Runs a situation with faults in it; `healthy` is what a healthy drive does, `None` for that drive itself.
pub(in crate::faults) fn run(
    drives: Drives,
    board: BoardKind,
    situation: Situation,
    faults: &[(Input, Defect)],
    event: Event,
    seed: u64,
    healthy: Option<&Healthy>,
) -> Result<(Outcome, Healthy), ExperimentError> {
    let (plate, config) = (&drives.plate(board), drives.on(board.config()));
    let mut run = Run::on(board, plate, situation, faults, seed, config)?;
    run.place_ends(plate, event);
    run.bench.break_down();
    run.returned_j = 0.0;
    let moves = !matches!(
        situation,
        Situation::Boot | Situation::Unaligned | Situation::Aligning | Situation::Ready
    );
    let position = run.bench.position;
    let mut watched = Watched {
        run,
        plate,
        event,
        healthy,
        demanded: faults.iter().any(|(input, _)| *input == Input::Demand),
        position,
        asked: moves.then_some((0.0, position)),
        since_asked: 0.0,
        unaligned: 0.0,
        ready: 0.0,
        still: 0.0,
        now: 0.0,
        off: 0.0,
        reacted: None,
        since: 0.0,
        regular: 0.0,
        faulted: false,
        path: Vec::new(),
    };
    while !watched.period()? {}
    let outcome = watched.outcome(faults);
    let reacted_s = watched.reacted.map(|(at, _)| at);
    let path = watched.path;
    Ok((outcome, Healthy { path, reacted_s }))
}

impl Run {
    fn place_ends(&mut self, plate: &DrivePlate, event: Event) {
        let switch = if event == Event::End { NEAR_M } else { FAR_M };
        self.bench.ends = Ends {
            middle: self.bench.position,
            switch,
            // A tenth more than the stop takes: see the interlock.
            stop: switch + 1.1 * stop_m(plate, plate.feed.velocity_max),
        };
        if event == Event::End {
            let scale = self.bench.scale_counts();
            self.bench.soft = Some(Soft::new(plate, switch + SOFT_M, scale));
        }
    }
}

/// A drive that is watched since its fault.
struct Watched<'a> {
    run: Run,
    plate: &'a DrivePlate,
    event: Event,
    healthy: Option<&'a Healthy>,
    /// The fault is one of the demand.
    demanded: bool,
    /// Where the table was at the fault.
    position: f64,
    /// Since it was last asked: seconds, and where it was.
    asked: Option<(f64, f64)>,
    since_asked: f64,
    /// How long it has been unaligned, ready and at rest, s.
    unaligned: f64,
    ready: f64,
    still: f64,
    now: f64,
    /// How far it went wrong until the drive reacted, m; when that was, and where.
    off: f64,
    reacted: Option<(f64, f64)>,
    /// How far it went from there, and how far the stop takes it, m.
    since: f64,
    regular: f64,
    /// It was in a fault.
    faulted: bool,
    /// Where the table went, since it was asked.
    path: Vec<f64>,
}

impl Watched<'_> {
    /// A period; `true` after the last.
    fn period(&mut self) -> Result<bool, ExperimentError> {
        self.run.spoil_command(self.path.len());
        self.run.period();
        let period_s = self.run.drive.board.period_s();
        self.now += period_s;
        let x = self.run.bench.position;
        self.ask_next(x, period_s)?;
        self.since_asked = self.asked.as_ref().map_or(0.0, |(seconds, _)| *seconds);
        self.happen();
        self.look_at_travel(x, period_s);
        if self.reacted.is_none() && self.run.reacts() {
            self.reacted = Some((self.now, x));
            if self.run.drive.state() == State::Stopping {
                let velocity = self.run.drive.board.machine.table_velocity();
                self.regular = stop_m(self.plate, velocity);
            }
        }
        self.still = if self.run.at_rest() {
            self.still + period_s
        } else {
            0.0
        };
        Ok(self.is_over(x))
    }

    /// A drive that waits is asked to align, and to run.
    fn ask_next(&mut self, x: f64, period_s: f64) -> Result<(), ExperimentError> {
        let run = &mut self.run;
        if run.drive.state() == State::Unaligned && !run.was_reset {
            self.unaligned += period_s;
            if self.unaligned > 0.2 {
                run.drive.request.demand = Demand::Align;
            }
        }
        if run.drive.state() == State::Ready && self.asked.is_none() {
            self.ready += period_s;
            if self.ready > 0.2 && !run.was_reset {
                run.ask(CDFS)?;
                self.asked = Some((0.0, x));
            }
        }
        Ok(())
    }

    fn happen(&mut self) {
        let comes = self.since_asked > OPENED_S;
        self.run.bench.enable_opened = self.event == Event::Opened && comes;
        self.run.failed_driver = match self.event {
            Event::DriverFault(axis) if comes => Some(axis),
            _ => None,
        };
    }

    fn look_at_travel(&mut self, x: f64, period_s: f64) {
        if let Some((seconds, origin)) = &mut self.asked {
            let moved = x - *origin;
            self.path.push(moved);
            let expected = self.healthy.map_or(moved, |healthy| {
                let last = healthy.path.last().copied().unwrap_or_default();
                let at = (*seconds / self.run.period_s).round() as usize;
                healthy.path.get(at).copied().unwrap_or(last)
            });
            *seconds += period_s;
            if self.reacted.is_none() {
                self.off = self.off.max((moved - expected).abs());
            }
        } else if self.reacted.is_none() {
            self.off = self.off.max((x - self.position).abs());
        }
    }

    fn is_over(&mut self, x: f64) -> bool {
        let Some((at, from)) = self.reacted else {
            let never_asked = self.asked.is_none() && self.now > START_S;
            return self.since_asked > WATCHED_S || never_asked;
        };
        let run = &self.run;
        self.since = self.since.max((x - from).abs());
        // After a reset it waits with open bridges, or stands for good.
        let ended = match run.drive.state() {
            State::Fault(_) => true,
            State::Unaligned | State::Ready => run.was_reset,
            _ => run.controller.stands(),
        };
        // A demand that is wrong may leave the fault and run again, as is demanded.
        let faulty = matches!(run.drive.state(), State::Fault(_));
        let runs_again = self.demanded && self.faulted && !faulty;
        self.faulted |= faulty;
        let longest = if run.was_reset { START_S } else { REST_S };
        runs_again || ended && self.still > 0.05 || self.now - at > longest
    }

    fn outcome(&self, faults: &[(Input, Defect)]) -> Outcome {
        let run = &self.run;
        let judged = !faults
            .iter()
            .any(|(input, _)| matches!(input, Input::Command | Input::Demand));
        let state = run.drive.state();
        let misalignment = run.drive.misalignment();
        let seen = run.bench.seen;
        let by_event = self
            .healthy
            .and_then(|healthy| healthy.reacted_s)
            .zip(self.reacted)
            .is_some_and(|(healthy, (at, _))| at >= healthy - 2e-3);
        let mut outcome = Outcome {
            detected_s: self.reacted.filter(|_| !by_event).map(|(at, _)| at),
            peak_a: seen.peak_a,
            // A sensor sees it a period later at the latest.
            over_current_periods: (f64::from(seen.over_most) / 2.0 - 1.0).max(0.0),
            returned_j: run.returned_j,
            travel_m: (self.since - self.regular).max(0.0) + if judged { self.off } else { 0.0 },
            end_force_n: seen.end_force_n,
            state,
            misalignment,
            wrong_cause: match state {
                State::Fault(fault) => {
                    let named = |input| names(input, fault, misalignment);
                    let inputs = || faults.iter().map(|(input, _)| *input);
                    let named = inputs().any(named) || names_two_channels(inputs(), fault);
                    !run.bench.is_at_end(fault) && !named
                }
                _ => false,
            },
            seconds: self.now,
            hazards: Vec::new(),
        };
        let limits = Limits::OF_THE_MATRIX;
        for (hazard, there) in [
            (
                Hazard::OverCurrent,
                outcome.over_current_periods > limits.over_current_periods,
            ),
            (Hazard::Travel, outcome.travel_m > limits.travel_m),
            (
                Hazard::WrongCause,
                outcome.wrong_cause && !faults.is_empty(),
            ),
        ] {
            if there {
                outcome.hazards.push(hazard);
            }
        }
        outcome
    }
}
