//! An alignment that is interrupted at a random moment: what the bridges, the motors and the table do, and whether the next arming aligns.

use super::Situation;
use super::cell::{Defect, Input};
use super::run::Run;
use super::soak::recover;
use control::fault::Fault;
use control::supervisor::{Demand, State};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::ExperimentError;
use hal_sim::start::settle;
use plant::Axis;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// From the cause to the reaction, s.
pub const REACTS_S: f64 = 2e-3;
/// Furthest that the table may be from where the alignment began, m.
pub const TRAVEL_MAX_M: f64 = 0.2e-3;
/// Longest that both motors may take to rest with open bridges after the cause, s.
const RESTS_S: f64 = 1.5;
/// A shaft is let go or shorted where it does not turn: what cogging and a neighbour's stop may add to its speed after the reaction, rad/s.
const FASTER: f64 = 0.5;

/// What interrupts it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interruption {
    /// Either contact of the enable switch opens, drawn.
    Enable,
    /// Either end switch opens, drawn.
    EndSwitch,
    /// The command times out.
    Heartbeat,
    /// Rest is demanded.
    Stop,
    /// A bus or a current that reads its upper end, drawn.
    Watch,
    /// The supply is gone for 20 ms, or the chip is reset, drawn.
    Reset,
}

impl Interruption {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Enable,
        Self::EndSwitch,
        Self::Heartbeat,
        Self::Stop,
        Self::Watch,
        Self::Reset,
    ];

    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Enable => "enable contact",
            Self::EndSwitch => "end switch",
            Self::Heartbeat => "lost heartbeat",
            Self::Stop => "stop",
            Self::Watch => "a watch's fault",
            Self::Reset => "brown-out or reset",
        }
    }

    /// Both bridges open at once. After the others both motors come to rest first.
    const fn opens_at_once(self) -> bool {
        matches!(self, Self::Watch | Self::Reset)
    }

    /// The state in which it ends.
    fn ends_in(self, state: State) -> bool {
        use Fault as F;
        match self {
            Self::Enable => matches!(state, State::Fault(F::Disabled | F::EnableApart)),
            Self::EndSwitch => matches!(state, State::Fault(F::EndForward | F::EndBackward)),
            Self::Heartbeat => state == State::Fault(F::CommandLost),
            Self::Watch => matches!(
                state,
                State::Fault(
                    F::OverVoltage
                        | F::ScrewBreak
                        | F::NutBreak
                        | F::ScrewOverCurrent
                        | F::NutOverCurrent
                        | F::ScrewCurrentSum
                        | F::NutCurrentSum
                )
            ),
            Self::Stop | Self::Reset => state == State::Unaligned,
        }
    }
}

/// What came of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interrupted {
    /// The moment, s after the alignment began.
    pub moment_s: f64,
    /// Furthest of the table from where the alignment began, until both motors rested, m.
    pub travel_m: f64,
    /// From the cause to the last closed bridge, s.
    pub open_s: f64,
    /// What a shaft got faster by once [`REACTS_S`] had passed, rad/s.
    pub faster: f64,
    /// The bridges did what the reaction asks within [`REACTS_S`].
    pub in_time: bool,
    /// The state in which it ended.
    pub state: State,
    /// The state names the cause.
    pub named: bool,
    /// The next arming made it ready.
    pub aligns_again: bool,
}

impl Interrupted {
    /// All is as it must be.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.in_time && self.named && self.aligns_again && self.travel_m <= TRAVEL_MAX_M
    }
}

/// A machine on `board` whose alignment has just begun, its rotors at angles of `seed`.
fn begun(board: BoardKind, seed: u64) -> Result<Run, ExperimentError> {
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(seed);
    let (plate, config) = (board.plate(), board.config());
    let mut run = Run::on(board, &plate, Situation::Boot, &[], seed, config)?;
    let angles = [(); 2].map(|()| part(&mut dice) * TAU);
    settle(&mut run.drive.board, angles);
    run.bench.position = run.drive.board.machine.table_position();
    run.until(State::Aligning)?;
    Ok(run)
}

fn part(dice: &mut Xoshiro256PlusPlus) -> f64 {
    (dice.next_u64() >> 11) as f64 / (1u64 << 53) as f64
}

/// How long the alignment of the machine of `seed` takes, s.
///
/// # Errors
/// [`ExperimentError`] if it cannot be configured or is not aligned.
pub fn alignment_s(board: BoardKind, seed: u64) -> Result<f64, ExperimentError> {
    let mut run = begun(board, seed)?;
    let from = run.drive.periods();
    run.until(State::Ready)?;
    Ok((run.drive.periods() - from) as f64 * run.period_s)
}

/// The alignment of the machine of `seed`, which takes `whole_s`, interrupted at a moment of `draw`.
///
/// # Errors
/// [`ExperimentError`] as for [`alignment_s`].
pub fn interrupt(
    board: BoardKind,
    interruption: Interruption,
    seed: u64,
    whole_s: f64,
    draw: u64,
) -> Result<Interrupted, ExperimentError> {
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(draw);
    let mut run = begun(board, seed)?;
    let from = run.bench.position;
    let heartbeat_s = run.bench.plate.command.heartbeat_s;
    let silent_s = match interruption {
        Interruption::Heartbeat => heartbeat_s,
        _ => 0.0,
    };
    // Not in the last milliseconds, in which it may have ended before it reacts.
    let last_s = (whole_s - silent_s - 10e-3).max(0.0);
    let moment_s = part(&mut dice) * last_s;
    let mut travel_m = 0.0f64;
    let mut step = |run: &mut Run| {
        run.period();
        travel_m = travel_m.max((run.bench.position - from).abs());
    };
    for _ in 0..(moment_s / run.period_s) as u64 {
        step(&mut run);
    }
    let other = dice.next_u64() & 1 == 1;
    let axis = if other { Axis::Screw } else { Axis::Nut };
    let mut put_in = |input, defect| run.bench.put_in(input, defect, draw);
    match interruption {
        Interruption::Enable => put_in(Input::Enable(usize::from(other)), Defect::Missing),
        Interruption::EndSwitch if other => put_in(Input::EndForward, Defect::Missing),
        Interruption::EndSwitch => put_in(Input::EndBackward, Defect::Missing),
        Interruption::Heartbeat => run.drive.attended = false,
        Interruption::Stop => run.drive.request.demand = Demand::Rest,
        Interruption::Watch if dice.next_u64() & 1 == 1 => {
            put_in(Input::Bus(axis), Defect::StuckHigh);
        }
        Interruption::Watch => put_in(Input::Current(axis, 0), Defect::StuckHigh),
        Interruption::Reset if other => put_in(Input::Supply, Defect::Dips),
        Interruption::Reset => put_in(Input::Reset, Defect::Dips),
    }
    // The last command counts until its time is over.
    for _ in 0..(silent_s / run.period_s) as u64 {
        step(&mut run);
    }
    let speed = |run: &Run| {
        let machine = &run.drive.board.machine;
        Axis::ALL
            .map(|axis| machine.motor(axis).omega.abs())
            .into_iter()
            .fold(0.0, f64::max)
    };
    let (mut open_s, mut at_reaction, mut fastest) = (0.0, 0.0f64, 0.0f64);
    let periods = (RESTS_S / run.period_s) as u64;
    for k in 0..periods {
        step(&mut run);
        let now = (k + 1) as f64 * run.period_s;
        // Of a chip in reset no output is on.
        let closed = !run.controller.stands()
            && Axis::ALL.iter().any(|&axis| run.drive.compare(axis).enable);
        if closed {
            open_s = now;
        }
        if now <= REACTS_S {
            at_reaction = at_reaction.max(speed(&run));
        } else {
            fastest = fastest.max(speed(&run));
        }
    }
    let faster = (fastest - at_reaction).max(0.0);
    // A stop of both that turn takes back their acceleration with the base's largest jerk: `a^2 / 2 j` meanwhile.
    let feed = &run.bench.plate.feed;
    let ramps = feed.base_acceleration_max.powi(2) / (2.0 * feed.base_jerk_max);
    let longest = if interruption.opens_at_once() {
        REACTS_S
    } else {
        RESTS_S - 0.1
    };
    let state = run.drive.state();
    run.bench.spoiled.clear();
    run.drive.attended = true;
    recover(&mut run);
    Ok(Interrupted {
        moment_s,
        travel_m,
        open_s,
        faster,
        in_time: open_s <= longest && faster <= FASTER + ramps,
        state,
        named: interruption.ends_in(state),
        aligns_again: run.drive.state() == State::Ready,
    })
}
