//! Alignment: where both rotors stand, before any torque is asked of them by the encoder.
//!
//! An incremental encoder starts at zero wherever its rotor stands, so each start and each reset begins here, between the
//! calibration of the currents and being ready. In this order, for the screw and then for the nut:
//!
//! | stage | what is done | what it finds |
//! | --- | --- | --- |
//! | still | the bridges stay open until all stands, for three seconds at most | a load that nothing holds |
//! | [`wiring`] | small currents at rest | shunts, current channels, open phases |
//! | [`locate`] | the rotor breaks away here and there, a degree or two | where it stands, which way its encoder counts |
//!
//! and for both:
//!
//! | stage | what is done | what it finds |
//! | --- | --- | --- |
//! | [`pair`] | equal torques against each other and together | exchanged encoders, motors that mean opposite directions |
//! | [`turn`] | both turn together, once each way, past an [`index`] | pole pairs, the offset within a degree, a stored angle that is not true |
//!
//! No current makes more torque than the plate's alignment torque, and the rotors move against each other by no more than
//! the plate's travel: where what moves would stand past that, alignment stops. Between two torques both windings are shorted,
//! which brakes rotors of any angle. What a load pushes on before it is held, and what an encoder's counts do not show, comes on top. Screw and nut together may turn as they like, since the table moves with their difference.

mod back;
mod index;
mod locate;
mod pair;
mod probe;
mod reason;
mod turn;
mod vector;
mod wiring;

pub use probe::ProbeConfig;
pub use reason::{Misalignment, Reason};
pub use wiring::WiringConfig;

use crate::base::fault::Part;
use crate::base::format::{Angle, Current, MechanicalSpeed, Speed, Voltage};
use crate::current::current_loop::{CurrentLoopConfig, CurrentReference, Frame, Mode};
use crate::current::exchange::MotorExchange;
use crate::current::observer::EncoderAlignment;
use crate::current::transform::DirectQuadrature;
use crate::speed::coordinator::CoordinatorConfig;
use crate::speed::speed_loop::SpeedLoopConfig;
use fixed::types::I4F28;
use index::Index;
use locate::{Locate, LocateStep};
use pair::{Pair, PairStep};
use probe::{Probe, ProbeStep};
use turn::{Turn, TurnStep};
use wiring::{Wiring, WiringStep};

/// What the alignment of a motor needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorAlignment {
    /// Largest current, A: the plate's alignment torque.
    pub limit: Current,
    /// Its wiring test.
    pub wiring: WiringConfig,
    /// The encoder counts backwards, as the plate says; `None` if that is to be learned.
    pub reversed: Option<bool>,
    /// It has an index; a jump of the count by more than this, 2^-32 turn, is no motion.
    pub index: Option<u32>,
    /// Where an absolute encoder was aligned before.
    pub stored: Option<EncoderAlignment>,
    /// Electrical turns a mechanical turn.
    pub pole_pairs: u32,
    /// Its speed loop, within the limit.
    pub speed_loop: SpeedLoopConfig,
    /// How far location moves the rotor, 2^-32 turn; and how fast, electrical rad/s; and for how many steps at most.
    pub reach: u32,
    /// See `reach`.
    pub reach_speed: Speed,
    /// See `reach`.
    pub reach_steps: u16,
    /// Stator resistance, ohm.
    pub resistance: Current,
    /// Stator inductance, H.
    pub inductance: I4F28,
    /// Speed above which the back-EMF says something, electrical rad/s.
    pub least_speed: Speed,
    /// Least back-EMF at the speed of the turning.
    pub least_emf: Voltage,
}

/// Longest that an alignment may take, s: two to four times what slow machines take.
pub const LONGEST_S: f64 = 30.0;

/// What an alignment needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentConfig {
    /// Screw, nut.
    pub motors: [MotorAlignment; 2],
    /// Probes of break-away.
    pub probes: ProbeConfig,
    /// Steps for which the load must be seen to be still, and by which it must be: it may coast down after a reset.
    pub still_steps: u16,
    /// See `still_steps`.
    pub coast_steps: u16,
    /// Furthest that screw and nut may move against each other, 2^-32 turn.
    pub travel: u32,
    /// In so many steps the shorted windings stop what moves.
    pub braking_steps: u16,
    /// Speed of both motors together, and its limits of acceleration.
    pub turn_speed: MechanicalSpeed,
    /// See `turn_speed`.
    pub turn: CoordinatorConfig,
    /// Steps of a measurement at that speed: two electrical turns or more.
    pub measure_steps: u16,
    /// Longest that one part of the turning may take, steps.
    pub turn_steps: u16,
    /// Below this a motor is at rest, electrical rad/s.
    pub still_speed: Speed,
    /// Steps within which all of it must end: [`LONGEST_S`].
    pub longest_steps: u32,
}

/// What the alignment sees of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorSeen {
    /// The encoder's angle, as it counts.
    pub theta: Angle,
    /// By how much it turns in a step, 2^-32 turn of the encoder.
    pub theta_step: i32,
    /// Its electrical speed, in the direction of the alignment that the current loop has.
    pub omega_e: Speed,
    /// The voltage circle cut the last voltage.
    pub voltage_limited: bool,
    /// Currents of the phases.
    pub phases: [Current; 3],
    /// Current and voltage in the frame that was asked for.
    pub current: DirectQuadrature<Current>,
    /// See `current`.
    pub voltage: DirectQuadrature<Voltage>,
}

impl MotorSeen {
    /// What a current loop of `config` has said.
    #[must_use]
    pub fn of(exchange: &MotorExchange, config: &CurrentLoopConfig, periods: u32) -> Self {
        let (status, current) = (exchange.status(), exchange.current());
        let turned = status.theta_step.wrapping_mul(periods.cast_signed());
        let reversed = exchange.alignment().is_some_and(|held| held.reversed);
        let amperes = config.sense.scale;
        Self {
            theta: config.observer.encoder.angle(exchange.encoder()),
            theta_step: if reversed {
                turned.wrapping_neg()
            } else {
                turned
            },
            omega_e: config.observer.omega_e(status.theta_step),
            voltage_limited: status.voltage_limited,
            phases: config.sense.phases(exchange.codes()),
            current: DirectQuadrature {
                d: amperes.current(current.d),
                q: amperes.current(current.q),
            },
            voltage: exchange.voltage(exchange.periods()),
        }
    }
}

/// How far an alignment is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Progress {
    /// On its way.
    #[default]
    Working,
    /// Both rotors are found, and stand.
    Done,
    /// It cannot be done.
    Failed(Misalignment),
    /// It was interrupted, and both motors have stopped.
    Interrupted,
}

/// What an alignment asks in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentStep {
    /// Of the current loops: screw, nut.
    pub current: [CurrentReference; 2],
    /// What the current loops shall take their encoders to say; `None`: nothing yet.
    pub alignment: [Option<EncoderAlignment>; 2],
    /// How far it is.
    pub progress: Progress,
}

impl AlignmentStep {
    /// Nothing asked, nothing known.
    #[must_use]
    pub const fn new() -> Self {
        const REST: CurrentReference = CurrentReference {
            mode: Mode::Off,
            frame: Frame::Rotor,
            i_d: Current::ZERO,
            i_q: Current::ZERO,
        };
        Self {
            current: [REST; 2],
            alignment: [None; 2],
            progress: Progress::Working,
        }
    }
}

impl Default for AlignmentStep {
    fn default() -> Self {
        Self::new()
    }
}

#[derive(Clone, Copy, Debug)]
enum Stage {
    /// With the steps since the last motion.
    Still(u16),
    Wiring(usize, Wiring),
    Locate(usize, Locate),
    Pair(Pair),
    Turn(Turn),
    Done,
    /// Both windings shorted, until what moves stands. Without a reason: interrupted.
    Braking(Option<Misalignment>, Probe),
    /// Without a reason: interrupted.
    Failed(Option<Misalignment>),
}

/// State of an alignment.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    stage: Stage,
    step: u16,
    /// Steps since it began.
    total: u32,
    /// Where the encoders stood at the start.
    from: Option<[Angle; 2]>,
    found: [Option<EncoderAlignment>; 2],
    /// How they were found.
    located: [Option<Locate>; 2],
    /// How much more often both encoders counted the same way than opposite ways, while one motor took the other along.
    same: i8,
    /// Where the encoders have an index.
    index: [Index; 2],
    interrupted: bool,
}

impl Alignment {
    /// Nothing known yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            stage: Stage::Still(0),
            step: 0,
            total: 0,
            from: None,
            found: [None; 2],
            located: [None; 2],
            same: 0,
            index: [const { Index::new(None) }; 2],
            interrupted: false,
        }
    }

    /// Ends the alignment: the next step begins to stop what moves. Both motors come to rest together where they turn; else the windings
    /// are shorted until the rotors stand, or the bridges open at once where no rotor moves.
    pub fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// The same, of a drive whose encoders may have an index.
    #[must_use]
    pub fn begin(config: &AlignmentConfig) -> Self {
        let [screw, nut] = &config.motors;
        Self {
            index: [Index::new(screw.index), Index::new(nut.index)],
            ..Self::new()
        }
    }

    /// One step of the speed task.
    #[inline(never)]
    pub fn step(&mut self, config: &AlignmentConfig, mut seen: [MotorSeen; 2]) -> AlignmentStep {
        let mut again = None;
        let coasts = matches!(self.stage, Stage::Still(_));
        for (motor, (index, seen)) in self.index.iter_mut().zip(&mut seen).enumerate() {
            if index.step(seen, coasts) {
                again = Some(motor);
            }
        }
        let theta = seen.map(|motor| motor.theta);
        let ends = matches!(
            self.stage,
            Stage::Done | Stage::Braking(..) | Stage::Failed(_)
        );
        if let (false, Some(motor)) = (ends, again) {
            let failed = Misalignment {
                part: Part::motor(motor),
                reason: Reason::Unsteady,
            };
            self.stop(theta, Some(failed));
        }
        self.total = self.total.saturating_add(1);
        if self.total == config.longest_steps && !ends {
            self.fail(theta, Part::Pair, Reason::TimedOut);
        }
        if self.interrupted {
            match &mut self.stage {
                Stage::Turn(turn) => turn.interrupt(),
                Stage::Done | Stage::Braking(..) | Stage::Failed(_) => {}
                _ => self.stop(theta, None),
            }
        }
        let from = *self.from.get_or_insert(theta);
        let mut current = [CurrentReference::default(); 2];
        let drives = matches!(
            self.stage,
            Stage::Wiring(..) | Stage::Locate(..) | Stage::Pair(_) | Stage::Turn(_)
        );
        let stands_at = if self.index.iter().any(Index::followed) {
            theta
        } else {
            braked(seen, config.braking_steps)
        };
        let far = self.travelled(theta, from) > config.travel.saturating_mul(2);
        if drives && self.travelled(stands_at, from) > config.travel {
            match &mut self.stage {
                // A stop of both together moves the table less than one of each by itself.
                Stage::Turn(turn) if !far => {
                    turn.stop(Reason::Travel);
                }
                _ => self.fail(theta, Part::Pair, Reason::Travel),
            }
        }
        let moved = probe::moved(theta, from);
        // Both encoders count the same way where one motor takes the other along, or as the plate says.
        let [screw, nut] = &config.motors;
        let declared = match (screw.reversed, nut.reversed) {
            (Some(screw), Some(nut)) if screw == nut => 1,
            (Some(_), Some(_)) => -1,
            _ => 0,
        };
        let same = if self.same == 0 {
            declared
        } else {
            self.same.signum()
        };
        let away = |motor: usize| {
            let [own, other] = [motor, motor ^ 1].map(|k| moved.get(k).copied().unwrap_or(0));
            own.saturating_sub(other.saturating_mul(same.into()))
        };
        let (directed, same_direction) = (self.directed(theta), self.same_direction());
        let apart = apart(directed).minus(apart(self.directed(from)));
        match &mut self.stage {
            Stage::Still(steps) => {
                self.step = self.step.saturating_add(1);
                *steps = steps.saturating_add(1);
                if probe::moves(&config.probes, probe::moved(theta, from)) {
                    self.from = Some(theta);
                    *steps = 0;
                }
                if *steps >= config.still_steps {
                    self.from = Some(theta);
                    self.stage = Stage::Wiring(0, Wiring::default());
                } else if self.step >= config.coast_steps {
                    self.fail(theta, Part::Pair, Reason::LoadMoves);
                }
            }
            Stage::Wiring(motor, wiring) => {
                let index = *motor;
                if let (Some(limits), Some(seen)) = (config.motors.get(index), seen.get(index)) {
                    match wiring.step(&limits.wiring, seen.phases) {
                        WiringStep::Rest => {}
                        WiringStep::Kick(at, i) => vector(&mut current, index, at, i),
                        WiringStep::Right => {
                            self.stage = Stage::Locate(index, Locate::default());
                        }
                        WiringStep::Wrong(reason) => self.fail(theta, Part::motor(index), reason),
                    }
                }
            }
            Stage::Locate(motor, locate) => {
                let index = *motor;
                if let (Some(limits), Some(seen)) = (config.motors.get(index), seen.get(index)) {
                    let away = away(index);
                    let other = index ^ 1;
                    let helps = self.found.get(other).copied().flatten();
                    let asked = locate.step(
                        limits,
                        &config.probes,
                        index,
                        theta,
                        seen.omega_e,
                        away,
                        (helps.is_some() && same != 0).then_some(config.travel >> ATTEMPTED),
                    );
                    self.same = self.same.saturating_add(locate.take_same());
                    match asked {
                        LocateStep::Rest => current = [SHORT; 2],
                        LocateStep::Vector(at, i) => vector(&mut current, index, at, i),
                        LocateStep::Against(at, level, up) => {
                            vector(&mut current, index, at, probe::current(limits.limit, level));
                            // As the other counts where it is taken along, and against that.
                            let other_up = up != (same > 0);
                            let reversed = helps.is_some_and(|found| found.reversed);
                            let places = current.get_mut(other).zip(config.motors.get(other));
                            if let Some((current, motor)) = places {
                                *current = part(motor, level, other_up != reversed);
                            }
                        }
                        LocateStep::Found(found) => {
                            if let Some(place) = self.found.get_mut(index) {
                                *place = Some(found);
                            }
                            if let Some(place) = self.located.get_mut(index) {
                                *place = Some(*locate);
                            }
                            self.stage = if self.found.iter().all(Option::is_some) {
                                Stage::Pair(Pair::default())
                            } else {
                                Stage::Wiring(1, Wiring::default())
                            };
                            if self.found.iter().all(Option::is_some)
                                && self.same_direction() == Some(false)
                            {
                                self.doubt(config, theta);
                            }
                        }
                        LocateStep::Failed(Reason::Exchanged) => {
                            self.fail(theta, Part::Pair, Reason::Exchanged);
                        }
                        LocateStep::Failed(reason) => self.fail(theta, Part::motor(index), reason),
                        LocateStep::Moves(moving) => {
                            self.fail(theta, moves_by_itself(index, moving), Reason::LoadMoves);
                        }
                    }
                }
            }
            Stage::Pair(pair) => match pair.step(
                &config.probes,
                directed,
                same_direction,
                apart,
                config.travel >> RETURNED,
            ) {
                PairStep::Rest => current = [SHORT; 2],
                PairStep::Ramp(level, signs) => {
                    let asked = current.iter_mut().zip(&config.motors).zip(signs);
                    for ((current, motor), sign) in asked {
                        *current = part(motor, level, sign > 0);
                    }
                }
                PairStep::Right => {
                    let [screw, nut] = self.found;
                    self.stage = Stage::Turn(Turn::new([
                        screw.unwrap_or_default(),
                        nut.unwrap_or_default(),
                    ]));
                }
                PairStep::Wrong(Reason::Opposed) => self.doubt(config, theta),
                PairStep::Wrong(reason) => self.fail(theta, Part::Pair, reason),
            },
            Stage::Turn(turn) => {
                let index_awaited = self.index.iter().any(Index::awaited);
                match turn.step(config, &config.turn, seen, index_awaited) {
                    TurnStep::Turn(turning) => {
                        self.found = turning.map(|turning| Some(turning.alignment));
                        current = turning.map(|turning| torque(turning.i_q));
                    }
                    TurnStep::Found(found) => self.finish(config, theta, found),
                    TurnStep::Interrupted => self.stop(theta, None),
                    TurnStep::Failed(_, Reason::Travel) => {
                        self.fail(theta, Part::Pair, Reason::Travel)
                    }
                    TurnStep::Failed(motor, reason) => self.fail(theta, Part::motor(motor), reason),
                }
            }
            Stage::Braking(failed, rest) => match rest.step(&config.probes, theta) {
                ProbeStep::Rest | ProbeStep::Ramp(_) => current = [SHORT; 2],
                ProbeStep::Found(_) | ProbeStep::Moves(_) => self.stage = Stage::Failed(*failed),
            },
            Stage::Done | Stage::Failed(_) => {}
        }
        let mut alignment = self.found;
        let indices = self.index.iter().zip(&config.motors);
        for (alignment, (index, motor)) in alignment.iter_mut().zip(indices) {
            *alignment = alignment.map(|found| index.of_encoder(found, motor.pole_pairs));
        }
        AlignmentStep {
            current,
            alignment,
            progress: match self.stage {
                Stage::Done => Progress::Done,
                Stage::Failed(Some(failed)) => Progress::Failed(failed),
                Stage::Failed(None) => Progress::Interrupted,
                _ => Progress::Working,
            },
        }
    }

    /// What was found; a stored alignment in its place, where that is true.
    fn finish(
        &mut self,
        config: &AlignmentConfig,
        theta: [Angle; 2],
        found: [EncoderAlignment; 2],
    ) {
        /// A stored angle may be off by a thirty-second of a turn, 11 degrees, of which a rotor keeps 98 % of its torque.
        const TRUE: u32 = 1 << 27;
        self.stage = Stage::Done;
        let mut kept = found;
        for (index, (kept, motor)) in kept.iter_mut().zip(&config.motors).enumerate() {
            let Some(stored) = motor.stored else { continue };
            let off = stored.theta_e_at_zero.minus(kept.theta_e_at_zero);
            if stored.reversed != kept.reversed || off.unsigned_abs() > TRUE {
                return self.fail(theta, Part::motor(index), Reason::StoredAngle);
            }
            *kept = stored;
        }
        self.found = kept.map(Some);
    }

    /// The motors look opposed: they are, or an encoder counts the other way than was found. Where the plate does not say
    /// how it counts, that is looked at again, the least certain first.
    fn doubt(&mut self, config: &AlignmentConfig, theta: [Angle; 2]) {
        let undeclared = |index: usize| {
            let motor = config.motors.get(index)?;
            let locate = self.located.get(index)?.as_ref()?;
            let votes = locate.doubtful()?;
            motor.reversed.is_none().then_some((votes, index, *locate))
        };
        let least = [undeclared(0), undeclared(1)].into_iter().flatten();
        match least.min_by_key(|(votes, ..)| *votes) {
            Some((_, index, locate)) => {
                if let Some(found) = self.found.get_mut(index) {
                    *found = None;
                }
                self.stage = Stage::Locate(index, locate.doubted());
            }
            None => self.fail(theta, Part::Pair, Reason::Opposed),
        }
    }

    fn fail(&mut self, theta: [Angle; 2], part: Part, reason: Reason) {
        let failed = if self.suspects_exchange(reason) {
            Misalignment {
                part: Part::Pair,
                reason: Reason::Exchanged,
            }
        } else {
            Misalignment { part, reason }
        };
        self.stop(theta, Some(failed));
    }

    fn stop(&mut self, theta: [Angle; 2], failed: Option<Misalignment>) {
        self.stage = match self.stage {
            Stage::Locate(..) | Stage::Pair(_) => Stage::Braking(failed, Probe::resting(theta)),
            _ => Stage::Failed(failed),
        };
        self.found = [None; 2];
    }

    /// Exchanged encoders are behind a reason that they may have: the location of a rotor has seen the other encoder move alone.
    fn suspects_exchange(&self, reason: Reason) -> bool {
        let locating = match &self.stage {
            Stage::Locate(_, locate) => Some(locate),
            _ => None,
        };
        let located = self.located.iter().flatten();
        matches!(
            reason,
            Reason::Travel | Reason::Unsteady | Reason::Held | Reason::Opposed | Reason::Reversed
        ) && located.chain(locating).any(Locate::suspects_exchange)
    }

    /// Both encoders' angles, each in its motor's direction as far as that is known.
    fn directed(&self, theta: [Angle; 2]) -> [Angle; 2] {
        let [screw, nut] = theta;
        let [screw_found, nut_found] = self.found;
        let directed = |theta: Angle, found: Option<EncoderAlignment>| match found {
            Some(found) if found.reversed => Angle(theta.0.wrapping_neg()),
            _ => theta,
        };
        [directed(screw, screw_found), directed(nut, nut_found)]
    }

    /// Positive torques turn both motors the same way, by how one took the other along; `None` where none did.
    fn same_direction(&self) -> Option<bool> {
        /// So many more are no chance.
        const SURE: i8 = 3;
        let [screw, nut] = self
            .found
            .map(|found| found.is_some_and(|found| found.reversed));
        (self.same.unsigned_abs() >= SURE.unsigned_abs())
            .then_some((self.same > 0) == (screw == nut))
    }

    /// How far screw and nut moved against each other; as long as the directions of counting are not both known: then only
    /// one motor is driven, and where the other moves too, it is taken along.
    fn travelled(&self, theta: [Angle; 2], from: [Angle; 2]) -> u32 {
        if self.found.iter().all(Option::is_some) {
            let now = apart(self.directed(theta));
            return now.minus(apart(self.directed(from))).unsigned_abs();
        }
        let [screw, nut] = probe::moved(theta, from);
        let same_way = screw.wrapping_sub(nut).unsigned_abs();
        same_way.min(screw.wrapping_add(nut).unsigned_abs())
    }
}

/// The table is back within this part of its travel, a power of two: an eighth.
const RETURNED: u32 = 3;

/// An attempt at a rotor's location begins within this part of it, if both motors can bring it there: a quarter. It takes a sixth.
const ATTEMPTED: u32 = 2;

/// How far the screw is ahead of the nut: the table's travel.
const fn apart([screw, nut]: [Angle; 2]) -> Angle {
    Angle(screw.0.wrapping_sub(nut.0))
}

/// What goes on moving while the motor `index` is located and no current flows: the other, if that one stands.
fn moves_by_itself(index: usize, moving: [bool; 2]) -> Part {
    let own = moving.get(index).copied().unwrap_or(true);
    Part::motor(if own { index } else { index ^ 1 })
}

/// Where both stand once their windings are shorted.
fn braked(seen: [MotorSeen; 2], steps: u16) -> [Angle; 2] {
    seen.map(|motor| {
        let ahead = motor.theta_step.saturating_mul(i32::from(steps));
        motor.theta.turned(ahead)
    })
}

impl Default for Alignment {
    fn default() -> Self {
        Self::new()
    }
}

/// Asks one motor for a current along an electrical angle.
fn vector(current: &mut [CurrentReference; 2], motor: usize, at: Angle, i: Current) {
    if let Some(reference) = current.get_mut(motor) {
        *reference = CurrentReference {
            mode: Mode::Drive,
            frame: Frame::Commanded(at),
            i_d: i,
            i_q: Current::ZERO,
        };
    }
}

/// The winding shorted: what moves is braked, wherever its rotor stands.
const SHORT: CurrentReference = CurrentReference {
    mode: Mode::Short,
    frame: Frame::Rotor,
    i_d: Current::ZERO,
    i_q: Current::ZERO,
};

/// The part `level`, 2^-16, of a motor's torque limit, forwards or backwards.
fn part(motor: &MotorAlignment, level: u16, forwards: bool) -> CurrentReference {
    let i = probe::current(motor.limit, level);
    torque(if forwards { i } else { i.saturating_neg() })
}

/// A torque-making current in the rotor's frame.
fn torque(i_q: Current) -> CurrentReference {
    CurrentReference {
        mode: Mode::Drive,
        frame: Frame::Rotor,
        i_d: Current::ZERO,
        i_q,
    }
}
