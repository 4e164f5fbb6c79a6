//! Alignment: where both rotors stand, before any torque is asked of them by the encoder.
//!
//! An incremental encoder starts at zero wherever its rotor stands, so each start and each reset begins here, between the
//! calibration of the currents and being ready. In this order, for the screw and then for the nut:
//!
//! | stage | what is done | what it finds |
//! | --- | --- | --- |
//! | still | the bridges stay open until all stands, for three seconds at most | a load that nothing holds |
//! | [`wiring`] | small currents at rest | shunts, current channels, open phases |
//! | [`locate`] | the rotor breaks away in eight directions | about where it stands |
//!
//! and for both:
//!
//! | stage | what is done | what it finds |
//! | --- | --- | --- |
//! | [`pair`] | equal torques against each other and together | exchanged encoders, motors that mean opposite directions |
//! | [`swing`] | both turn together, thirty electrical degrees each way | which way each encoder counts |
//! | [`turn`] | both turn together, once each way, past an [`index`] | pole pairs, the offset within a degree, a stored angle that is not true |
//!
//! No current makes more torque than the plate's alignment torque, and the rotors move against each other by no more than
//! the plate's travel: where what moves would stand past that, or the table does by its scale, alignment stops. Between two torques both windings are shorted,
//! which brakes rotors of any angle. What a load pushes on before it is held, and what an encoder's counts do not show, comes on top. Screw and nut together may turn as they like, since the table moves with their difference.

mod index;
mod locate;
mod pair;
mod probe;
mod reason;
pub(crate) mod swing;
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
use locate::{Locate, LocateStep, Located};
use pair::{Pair, PairStep};
use probe::{Probe, ProbeStep};
use swing::{Swing, SwingStep};
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
    /// How it swings.
    pub swing: RotorSwing,
    /// Stator resistance, ohm.
    pub resistance: Current,
    /// Stator inductance, H.
    pub inductance: I4F28,
    /// Speed above which the back-EMF says something, electrical rad/s.
    pub least_speed: Speed,
    /// Smallest back-EMF at the speed of the turning.
    pub least_emf: Voltage,
}

/// How a rotor swings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorSwing {
    /// Current across the axis, A.
    pub across: Current,
    /// Speed, electrical rad/s, in the encoder's direction.
    pub speed: Speed,
    /// Speed that is added for each 2^-32 turn that it is behind, 2^-48 electrical rad/s.
    pub gain: i64,
    /// The same for what is past half of [`SwingConfig::late`], and no more than that half.
    pub break_away_gain: i64,
    /// Torque of an ampere, 2^-15 of the stronger motor's.
    pub torque_per_ampere: i32,
    /// Its speed loop, within what the current across leaves of the limit.
    pub speed_loop: SpeedLoopConfig,
}

impl MotorAlignment {
    /// Torque of the largest current, 2^-35 of an ampere's torque of the motor with the most.
    fn torque_limit(&self) -> i64 {
        i64::from(self.limit.to_bits()).saturating_mul(self.swing.torque_per_ampere.into())
    }
}

impl RotorSwing {
    /// The current of a torque, 2^-35 of an ampere's torque of the motor with the most.
    fn current(&self, torque: i64) -> Current {
        let bits = torque
            .checked_div(self.torque_per_ampere.into())
            .unwrap_or(0);
        Current::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
    }
}

/// How both swing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwingConfig {
    /// Furthest from the middle, and how far in a step, 2^-32 turn.
    pub furthest: i32,
    /// See `furthest`.
    pub step: i32,
    /// Change of the speed in a step, 2^-10 of it.
    pub ramp: i32,
    /// Further behind than this none goes on, 2^-32 turn.
    pub late: u32,
    /// Steps that it waits for a rotor, and that it may take at most.
    pub waits: u16,
    /// See `waits`.
    pub steps: u16,
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
    /// What a count of the table's scale is as a turn of screw against nut, 2^-40 turn.
    pub scale: i64,
    /// How both swing.
    pub swing: SwingConfig,
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

/// Scans that may tell nothing of where the rotors stand, or of how their encoders count. Each next one moves twice as far.
const SCANS: u8 = 2;

/// Both bridges open.
const OPEN: [CurrentReference; 2] = AlignmentStep::new().current;

#[derive(Clone, Copy, Debug)]
enum Stage {
    /// With the steps since the last motion.
    Still(u16),
    /// Waits until both rest.
    Resting(Probe),
    Wiring(usize, Wiring),
    Locate(usize, Locate),
    Pair(Pair),
    Swing(Swing),
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
    /// Where the rotors stand, and how they were located.
    located: [Option<Located>; 2],
    locations: [Option<Locate>; 2],
    /// Scans that told nothing.
    scans: u8,
    found: [Option<EncoderAlignment>; 2],
    /// Both encoders count the same way where both motors turn together, by how much torque that takes.
    same_by_torque: Option<bool>,
    table: Table,
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
            located: [None; 2],
            locations: [None; 2],
            scans: 0,
            found: [None; 2],
            same_by_torque: None,
            table: Table::new(),
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
    pub fn step(
        &mut self,
        config: &AlignmentConfig,
        mut seen: [MotorSeen; 2],
        scale: Option<u32>,
    ) -> AlignmentStep {
        self.table.step(scale);
        let table = self.table.turned(config);
        let mut again = None;
        let coasts = matches!(self.stage, Stage::Still(_) | Stage::Resting(_));
        for (motor, (index, seen)) in self.index.iter_mut().zip(&mut seen).enumerate() {
            if index.step(seen, coasts) {
                again = Some(motor);
            }
        }
        let theta = seen.map(|motor| motor.theta);
        self.check_end(config, theta, again);
        let from = *self.from.get_or_insert(theta);
        self.check_travel(config, seen, from, table);
        let current = match self.stage {
            Stage::Still(_) => {
                self.wait(config, theta, from);
                OPEN
            }
            Stage::Resting(_) => {
                self.rest(config, theta);
                OPEN
            }
            Stage::Wiring(motor, _) => self.wiring(config, motor, seen),
            Stage::Locate(motor, _) => self.locate(config, motor, theta, table),
            Stage::Pair(_) => self.pair(config, theta),
            Stage::Swing(_) => self.swing(config, seen, from),
            Stage::Turn(_) => self.turn(config, seen),
            Stage::Braking(..) => self.brake(config, theta),
            Stage::Done | Stage::Failed(_) => OPEN,
        };
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

    /// Ends it where an encoder missed its index (`again`), where it takes too long, and where it was interrupted.
    fn check_end(&mut self, config: &AlignmentConfig, theta: [Angle; 2], again: Option<usize>) {
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
    }

    /// Ends it where the table went too far, by its scale or by the encoders, which stood at `from`.
    fn check_travel(
        &mut self,
        config: &AlignmentConfig,
        seen: [MotorSeen; 2],
        from: [Angle; 2],
        table: i64,
    ) {
        let theta = seen.map(|motor| motor.theta);
        let drives = matches!(
            self.stage,
            Stage::Wiring(..)
                | Stage::Locate(..)
                | Stage::Pair(_)
                | Stage::Swing(_)
                | Stage::Turn(_)
        );
        let stands_at = if self.index.iter().any(Index::followed) {
            theta
        } else {
            braked(seen, config.braking_steps)
        };
        let away = self
            .travelled(config, stands_at, from)
            .max(clamp(table.unsigned_abs()));
        let far = away > config.travel.saturating_mul(2);
        if drives && away > config.travel {
            match &mut self.stage {
                // A stop of both together moves the table less than one of each by itself.
                Stage::Turn(turn) if !far => {
                    turn.stop(Reason::Travel);
                }
                _ => self.fail(theta, Part::Pair, Reason::Travel),
            }
        }
    }

    /// Waits until both rotors stand.
    fn wait(&mut self, config: &AlignmentConfig, theta: [Angle; 2], from: [Angle; 2]) {
        let Stage::Still(steps) = &mut self.stage else {
            return;
        };
        self.step = self.step.saturating_add(1);
        *steps = steps.saturating_add(1);
        if probe::moves(&config.probes, probe::moved(theta, from)) {
            self.from = Some(theta);
            *steps = 0;
        }
        if *steps >= config.still_steps {
            self.stage = Stage::Resting(Probe::resting(theta));
        } else if self.step >= config.coast_steps {
            self.fail(theta, Part::Pair, Reason::LoadMoves);
        }
    }

    /// Waits until both rotors rest as after a probe. Shafts that coast slowly seemed to stand before, and were found moving during the
    /// first probes.
    fn rest(&mut self, config: &AlignmentConfig, theta: [Angle; 2]) {
        let Stage::Resting(probe) = &mut self.stage else {
            return;
        };
        self.step = self.step.saturating_add(1);
        match probe.step(&config.probes, theta) {
            ProbeStep::Found(_) => {
                self.from = Some(theta);
                self.table.begin();
                self.stage = Stage::Wiring(0, Wiring::default());
            }
            _ if self.step >= config.coast_steps => {
                self.fail(theta, Part::Pair, Reason::LoadMoves);
            }
            ProbeStep::Moves(_) => self.stage = Stage::Resting(Probe::resting(theta)),
            ProbeStep::Ramp(_) | ProbeStep::Rest => {}
        }
    }

    /// Tries the phases of a motor.
    fn wiring(
        &mut self,
        config: &AlignmentConfig,
        index: usize,
        seen: [MotorSeen; 2],
    ) -> [CurrentReference; 2] {
        let mut current = OPEN;
        let theta = seen.map(|motor| motor.theta);
        if let (Stage::Wiring(_, wiring), Some(limits), Some(seen)) =
            (&mut self.stage, config.motors.get(index), seen.get(index))
        {
            match wiring.step(&limits.wiring, seen.phases) {
                WiringStep::Rest => {}
                WiringStep::Kick(at, i) => vector(&mut current, index, at, [i, Current::ZERO]),
                WiringStep::Right => self.stage = Stage::Locate(index, Locate::default()),
                WiringStep::Wrong(reason) => self.fail(theta, Part::motor(index), reason),
            }
        }
        current
    }

    /// Looks for the rotor of a motor.
    fn locate(
        &mut self,
        config: &AlignmentConfig,
        index: usize,
        theta: [Angle; 2],
        table: i64,
    ) -> [CurrentReference; 2] {
        let mut current = OPEN;
        let (Stage::Locate(_, locate), Some(limits)) = (&mut self.stage, config.motors.get(index))
        else {
            return current;
        };
        let probes = config.probes.coarser(self.scans);
        match locate.step(limits, &probes, index, theta, table) {
            LocateStep::Rest => current = [SHORT; 2],
            LocateStep::Vector(at, i) => vector(&mut current, index, at, [i, Current::ZERO]),
            LocateStep::Found(found) => {
                if let Some(place) = self.located.get_mut(index) {
                    *place = Some(found);
                }
                if let Some(place) = self.locations.get_mut(index) {
                    *place = Some(*locate);
                }
                self.stage = if self.located.iter().any(Option::is_none) {
                    Stage::Wiring(1, Wiring::default())
                } else if self.table_stood(config) {
                    self.scans = self.scans.saturating_add(1);
                    (self.located, self.locations) = ([None; 2], [None; 2]);
                    Stage::Locate(0, Locate::default())
                } else {
                    Stage::Pair(Pair::default())
                };
            }
            LocateStep::Failed(Reason::Exchanged) => {
                self.fail(theta, Part::Pair, Reason::Exchanged);
            }
            // Friction is elastic before it slides, and remembers how it was left: the next scan moves further.
            LocateStep::Failed(Reason::Unsteady) if self.scans < SCANS => {
                self.scans = self.scans.saturating_add(1);
                self.stage = Stage::Locate(index, Locate::default());
            }
            LocateStep::Failed(reason) => self.fail(theta, Part::motor(index), reason),
            LocateStep::Moves(moving) => {
                self.fail(theta, moves_by_itself(index, moving), Reason::LoadMoves);
            }
        }
        current
    }

    /// No rotor has moved the table by its scale, or taken the other along, so nothing says which way the encoders count. A soft screw
    /// winds up before its table slides: the next scan moves further.
    fn table_stood(&self, config: &AlignmentConfig) -> bool {
        self.table.last.is_some() && self.scans < SCANS && self.same(config).is_none()
    }

    /// Tries whether both encoders count the same way.
    fn pair(&mut self, config: &AlignmentConfig, theta: [Angle; 2]) -> [CurrentReference; 2] {
        let mut current = OPEN;
        let same = self.same(config);
        let Stage::Pair(pair) = &mut self.stage else {
            return current;
        };
        match pair.step(&config.probes, theta, same) {
            PairStep::Rest => current = [SHORT; 2],
            PairStep::Ramp(level, signs) => {
                let motors = config.motors.iter().zip(&self.located).zip(signs);
                let torque = probe::torque(&config.motors, level);
                for (index, ((motor, located), sign)) in motors.enumerate() {
                    let axis = located.map_or(Angle(0), |located| located.axis);
                    let i = motor.swing.current(torque).min(motor.limit);
                    let i = if sign > 0 { i } else { i.saturating_neg() };
                    vector(&mut current, index, axis, [i, Current::ZERO]);
                }
            }
            PairStep::Right => self.stage = Stage::Swing(Swing::default()),
            PairStep::Same(same) => {
                self.same_by_torque = Some(same);
                self.stage = Stage::Pair(Pair::default());
            }
            PairStep::Wrong(reason) => self.fail(theta, Part::Pair, reason),
        }
        current
    }

    /// Swings both motors together.
    fn swing(
        &mut self,
        config: &AlignmentConfig,
        seen: [MotorSeen; 2],
        from: [Angle; 2],
    ) -> [CurrentReference; 2] {
        let mut current = OPEN;
        let theta = seen.map(|motor| motor.theta);
        let same = self.same(config);
        let apart = apart(theta, same).minus(apart(from, same));
        let held = self.index.each_ref().map(Index::followed);
        let Stage::Swing(swing) = &mut self.stage else {
            return current;
        };
        match swing.step(config, &seen, same.unwrap_or(true), apart, held) {
            SwingStep::Drive(currents) => {
                let currents = currents.into_iter().zip(&self.located);
                for (index, (amperes, located)) in currents.enumerate() {
                    let axis = located.map_or(Angle(0), |located| located.axis);
                    vector(&mut current, index, axis, amperes);
                }
            }
            SwingStep::Found(reversed) => self.swung(config, theta, reversed),
            SwingStep::Failed(motor, reason) => self.fail(theta, Part::motor(motor), reason),
        }
        current
    }

    /// Turns both motors together, by the rotors that were found.
    fn turn(&mut self, config: &AlignmentConfig, seen: [MotorSeen; 2]) -> [CurrentReference; 2] {
        let mut current = OPEN;
        let theta = seen.map(|motor| motor.theta);
        let index_awaited = self.index.iter().any(Index::awaited);
        let Stage::Turn(turn) = &mut self.stage else {
            return current;
        };
        match turn.step(config, &config.turn, seen, index_awaited) {
            TurnStep::Turn(turning) => {
                self.found = turning.map(|turning| Some(turning.alignment));
                current = turning.map(|turning| torque(turning.i_q));
            }
            TurnStep::Found(found) => self.finish(config, theta, found),
            TurnStep::Interrupted => self.stop(theta, None),
            TurnStep::Failed(_, Reason::Travel) => self.fail(theta, Part::Pair, Reason::Travel),
            TurnStep::Failed(motor, reason) => self.fail(theta, Part::motor(motor), reason),
        }
        current
    }

    /// Shorts both windings until the rotors stand.
    fn brake(&mut self, config: &AlignmentConfig, theta: [Angle; 2]) -> [CurrentReference; 2] {
        let Stage::Braking(failed, rest) = &mut self.stage else {
            return OPEN;
        };
        match rest.step(&config.probes, theta) {
            ProbeStep::Rest | ProbeStep::Ramp(_) => [SHORT; 2],
            ProbeStep::Found(_) | ProbeStep::Moves(_) => {
                self.stage = Stage::Failed(*failed);
                OPEN
            }
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

    /// The swing has seen which encoders count backwards: the plate may say otherwise, and both motors may mean opposite directions.
    fn swung(&mut self, config: &AlignmentConfig, theta: [Angle; 2], reversed: [bool; 2]) {
        let motors = config.motors.iter().zip(self.located).zip(reversed);
        let mut found = [EncoderAlignment::default(); 2];
        for (index, (((motor, located), reversed), found)) in motors.zip(&mut found).enumerate() {
            if motor.reversed.is_some_and(|declared| declared != reversed) {
                return self.fail(theta, Part::motor(index), Reason::Reversed);
            }
            if let Some(located) = located {
                *found = located.alignment(motor, reversed);
            }
        }
        let [screw, nut] = reversed;
        if self.same(config) != Some(screw == nut) {
            return self.fail(theta, Part::Pair, Reason::Opposed);
        }
        self.found = found.map(Some);
        self.stage = Stage::Turn(Turn::new(found));
    }

    /// Both encoders count the same way where both motors turn together: by how one motor took the other along or moved the table, by
    /// how much torque it took, or by the plate.
    fn same(&self, config: &AlignmentConfig) -> Option<bool> {
        let senses = self
            .locations
            .each_ref()
            .map(|locate| locate.as_ref().map(Locate::senses));
        if let [Some(screw), Some(nut)] = senses {
            // Screw and nut move the table opposite ways.
            let by_table = match screw.table.signum().saturating_mul(nut.table.signum()) {
                0 => 0,
                sign => {
                    let least = screw
                        .table
                        .unsigned_abs()
                        .min(nut.table.unsigned_abs())
                        .cast_signed();
                    if sign > 0 {
                        least.saturating_neg()
                    } else {
                        least
                    }
                }
            };
            let votes = screw
                .other
                .saturating_add(nut.other)
                .saturating_add(by_table);
            if votes != 0 {
                return Some(votes > 0);
            }
        }
        let [screw, nut] = &config.motors;
        let declared = screw.reversed.zip(nut.reversed);
        self.same_by_torque
            .or(declared.map(|(screw, nut)| screw == nut))
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
            Stage::Locate(..) | Stage::Pair(_) | Stage::Swing(_) => {
                Stage::Braking(failed, Probe::resting(theta))
            }
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
        let located = self.locations.iter().flatten();
        matches!(
            reason,
            Reason::Travel | Reason::Unsteady | Reason::Held | Reason::Opposed | Reason::Reversed
        ) && located.chain(locating).any(Locate::suspects_exchange)
    }

    /// How far screw and nut moved against each other; as long as it is not known which way their encoders count beside each other:
    /// then only one motor is driven, and where the other moves too, it is taken along.
    fn travelled(&self, config: &AlignmentConfig, theta: [Angle; 2], from: [Angle; 2]) -> u32 {
        let same = self.same(config);
        if same.is_some() {
            return apart(theta, same).minus(apart(from, same)).unsigned_abs();
        }
        let [screw, nut] = probe::moved(theta, from);
        let same_way = screw.wrapping_sub(nut).unsigned_abs();
        same_way.min(screw.wrapping_add(nut).unsigned_abs())
    }
}

/// Where the table is by its scale.
#[derive(Clone, Copy, Debug)]
struct Table {
    last: Option<u32>,
    /// Counts since the start.
    counts: i32,
}

impl Table {
    const fn new() -> Self {
        Self {
            last: None,
            counts: 0,
        }
    }

    /// The alignment begins here.
    const fn begin(&mut self) {
        self.counts = 0;
    }

    fn step(&mut self, scale: Option<u32>) {
        let Some(count) = scale else { return };
        let last = self.last.replace(count).unwrap_or(count);
        self.counts = self
            .counts
            .wrapping_add(count.wrapping_sub(last).cast_signed());
    }

    /// As a turn of screw against nut, 2^-32 turn.
    fn turned(&self, config: &AlignmentConfig) -> i64 {
        i64::from(self.counts).saturating_mul(config.scale) >> 8
    }
}

fn clamp(wide: u64) -> u32 {
    u32::try_from(wide).unwrap_or(u32::MAX)
}

/// How far the screw is ahead of the nut, by the screw's count: the table's travel. Where nobody knows how the encoders count beside each
/// other, they are taken to count the same way.
fn apart([screw, nut]: [Angle; 2], same: Option<bool>) -> Angle {
    Angle(if same.unwrap_or(true) {
        screw.0.wrapping_sub(nut.0)
    } else {
        screw.0.wrapping_add(nut.0)
    })
}

/// What goes on moving while the motor `index` is located and no current flows: the other, if that one stands.
fn moves_by_itself(index: usize, moving: [bool; 2]) -> Part {
    let own = moving.get(index).copied().unwrap_or(true);
    Part::motor(if own { index } else { index ^ 1 })
}

/// Where both stand after their windings are shorted.
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

/// Asks one motor for a current along an electrical angle, and one across.
fn vector(current: &mut [CurrentReference; 2], motor: usize, at: Angle, [i_d, i_q]: [Current; 2]) {
    if let Some(reference) = current.get_mut(motor) {
        *reference = CurrentReference {
            mode: Mode::Drive,
            frame: Frame::Commanded(at),
            i_d,
            i_q,
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

/// A torque-making current in the rotor's frame.
fn torque(i_q: Current) -> CurrentReference {
    CurrentReference {
        mode: Mode::Drive,
        frame: Frame::Rotor,
        i_d: Current::ZERO,
        i_q,
    }
}
