//! Both motors together at a common speed: the back-EMF finds the last degrees.
//!
//! Relative position is held by the drive's own coordinator and speed loops, so that the table stays. With the current along
//! q, the residual of the voltage in d is the back-EMF of a rotor that is `off` ahead of where it is taken to be:
//!
//! `e_d = v_d - R*i_d + omega*L*i_q = -omega*flux*sin(off)`, `e_q = v_q - R*i_q - omega*L*i_d = omega*flux*cos(off)`.
//!
//! Their ratio needs neither flux nor speed. Errors of the dead time and of the resistance lie along the current, in q. Where a load
//! drives a rotor, they are against `e_q`. Where they are larger, such a rotor is not listened to. A delay
//! is odd in the speed, so it cancels between turning forwards and backwards. On the way up the offset follows
//! `off` in steps. If the encoder counts the other way, or the pole pairs are others, the offset runs off in proportion to
//! the angle. `d(offset) / d(theta)` is then the error of the number of pole pairs.

use super::vector;
use super::{AlignmentConfig, MotorAlignment, MotorSeen, Reason};
use crate::base::format::{Angle, Current, MechanicalSpeed, Speed, TableVelocity};
use crate::current::observer::EncoderAlignment;
use crate::speed::coordinator::{Command, Coordinator, CoordinatorConfig, Following};
use crate::speed::speed_loop::SpeedLoop;

/// Times the back-EMF by the plate that what looks like one may be. The dead time's voltage turns by steps of 60 degrees, and is up to
/// half of its size across the current. Above twice the back-EMF the offset follows these steps instead of the rotor.
const CLEAR: i64 = 3;

/// Steps whose voltages make one correction.
const WINDOW: u16 = 8;

/// Corrections until the offset's run is looked at.
const SETTLED: u8 = 16;

/// Angle over which it is, 2^-32 turn: three eighths of a turn. What the dead time leaves swings the offset six times an electrical
/// turn. Over this angle it is far below the run of one pole pair.
const JUDGED: u32 = 1_610_612_736;

/// Largest change in one correction, 2^-32 turn: an eighth turn.
const CORRECTION: i32 = 1 << 29;

/// Furthest that the two ways may be apart: a twenty-fourth turn.
const APART: u32 = 178_956_970;

/// Furthest that either may be from the offset that was tracked: an eighth turn, at which 0.7 of the torque is left.
///
/// A tracked offset is a mean over few steps. Current offsets and dead time swing it, by up to 25 degrees of a motor with two pole
/// pairs. The two ways average over whole turns, and agree within 3 degrees there.
const TRACKED: u32 = 1 << 29;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Up,
    MeasureUp,
    Down,
    MeasureDown,
    Stop,
}

/// A motor's offset, followed.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    alignment: EncoderAlignment,
    /// Sums of `e_d`, `e_q`, 2^-18 V, in the direction of turning.
    sums: [i64; 2],
    samples: u16,
    corrections: u8,
    /// Angle where the offset's run began, and how far it ran.
    from: Angle,
    ran: i64,
    judged: bool,
    /// Off, as measured forwards and backwards.
    off: [i32; 2],
    speed: SpeedLoop,
    torque_limited: bool,
}

/// State of the turning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    phase: Phase,
    step: u16,
    coordinator: Coordinator,
    tracks: [Track; 2],
    /// Found on the way: both come to rest together first.
    failed: Option<(usize, Reason)>,
    interrupted: bool,
}

/// What a motor is asked while it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turning {
    /// The torque-making current.
    pub(super) i_q: Current,
    /// What is known of the encoder.
    pub(super) alignment: EncoderAlignment,
}

/// How far the turning is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TurnStep {
    /// On its way.
    Turn([Turning; 2]),
    /// At rest, both found.
    Found([EncoderAlignment; 2]),
    /// Not to be found: 0 is the screw.
    Failed(usize, Reason),
    /// At rest after an interruption.
    Interrupted,
}

impl Turn {
    /// From rest, with what location has found.
    pub(super) fn new(found: [EncoderAlignment; 2]) -> Self {
        Self {
            phase: Phase::Up,
            step: 0,
            coordinator: Coordinator::new(),
            tracks: found.map(|alignment| Track {
                alignment,
                ..Track::default()
            }),
            failed: None,
            interrupted: false,
        }
    }

    /// Both come to rest together, and nothing is found then.
    pub(super) fn interrupt(&mut self) {
        self.interrupted = true;
    }

    /// Both come to rest together, and have failed then.
    pub(super) fn stop(&mut self, reason: Reason) {
        self.failed = self.failed.or(Some((0, reason)));
    }

    /// One step.
    pub(super) fn step(
        &mut self,
        config: &AlignmentConfig,
        coordinator: &CoordinatorConfig,
        seen: [MotorSeen; 2],
        index_awaited: bool,
    ) -> TurnStep {
        self.step = self.step.saturating_add(1);
        if self.step > config.turn_steps {
            return TurnStep::Failed(0, Reason::Held);
        }
        let base = match self.phase {
            Phase::Up | Phase::MeasureUp => config.turn_speed,
            Phase::Down | Phase::MeasureDown => config.turn_speed.saturating_neg(),
            Phase::Stop => MechanicalSpeed::ZERO,
        };
        // Within the motors' limits: the plate's configuration sees to it.
        let command = Command {
            velocity: TableVelocity::ZERO,
            base,
        };
        let _ = self.coordinator.command(coordinator, command);
        let [screw, nut] = &seen;
        let [screw_track, nut_track] = &self.tracks;
        let following = |seen: &MotorSeen, track: &Track| Following {
            omega_e: seen.omega_e,
            limited: seen.voltage_limited || track.torque_limited,
        };
        let references = self.coordinator.step(
            coordinator,
            [following(screw, screw_track), following(nut, nut_track)],
        );

        let measuring = matches!(self.phase, Phase::MeasureUp | Phase::MeasureDown);
        let way = usize::from(self.phase == Phase::MeasureDown);
        let mut asked = [Turning {
            i_q: Current::ZERO,
            alignment: EncoderAlignment::default(),
        }; 2];
        let motors = config.motors.iter().zip(&seen).zip(references);
        let tracks = self.tracks.iter_mut().zip(&mut asked);
        for (index, (((motor, seen), reference), (track, asked))) in motors.zip(tracks).enumerate()
        {
            let output = track.speed.step(
                &motor.speed_loop,
                reference,
                seen.omega_e,
                seen.voltage_limited,
            );
            track.torque_limited = output.limited;
            track.sample(motor, seen);
            if (self.phase == Phase::Up || self.failed.is_some())
                && track.samples >= WINDOW
                && let Err(reason) = track.correct(motor, seen)
            {
                self.failed = self.failed.or(Some((index, reason)));
            }
            if measuring && self.step >= config.measure_steps {
                let off = track.off(motor, config.measure_steps);
                if off.is_none() {
                    self.failed = self.failed.or(Some((index, Reason::Held)));
                }
                if let (Some(off), Some(place)) = (off, track.off.get_mut(way)) {
                    *place = off;
                }
            }
            *asked = Turning {
                i_q: output.i_q,
                alignment: track.alignment,
            };
        }
        if let Some(result) = self.proceed(config, seen, index_awaited) {
            return result;
        }
        TurnStep::Turn(asked)
    }

    /// To the next phase, where this one is done.
    fn proceed(
        &mut self,
        config: &AlignmentConfig,
        seen: [MotorSeen; 2],
        index_awaited: bool,
    ) -> Option<TurnStep> {
        let judged = self.tracks.iter().all(|track| track.judged) && !index_awaited;
        let next = match self.phase {
            Phase::Stop if self.coordinator.at_rest() => {
                let still = seen
                    .iter()
                    .all(|seen| seen.omega_e.unsigned_abs() < config.still_speed.unsigned_abs());
                return still.then(|| self.conclude());
            }
            Phase::Stop => return None,
            _ if self.failed.is_some() || self.interrupted => Phase::Stop,
            Phase::Up if self.coordinator.arrived() && judged => Phase::MeasureUp,
            Phase::Down if self.coordinator.arrived() => Phase::MeasureDown,
            Phase::MeasureUp if self.step >= config.measure_steps => Phase::Down,
            Phase::MeasureDown if self.step >= config.measure_steps => Phase::Stop,
            _ => return None,
        };
        self.phase = next;
        self.step = 0;
        for track in &mut self.tracks {
            (track.sums, track.samples) = ([0; 2], 0);
        }
        None
    }

    fn conclude(&self) -> TurnStep {
        if self.interrupted {
            return TurnStep::Interrupted;
        }
        if let Some((motor, reason)) = self.failed {
            return TurnStep::Failed(motor, reason);
        }
        for (index, track) in self.tracks.iter().enumerate() {
            let [up, down] = track.off;
            let far = |x: i32| x.unsigned_abs() > TRACKED;
            if far(up) || far(down) || up.wrapping_sub(down).unsigned_abs() > APART {
                return TurnStep::Failed(index, Reason::Unsteady);
            }
        }
        TurnStep::Found(self.tracks.map(|track| {
            let [up, down] = track.off;
            let mean = (up >> 1).wrapping_add(down >> 1);
            EncoderAlignment {
                theta_e_at_zero: track.alignment.theta_e_at_zero.turned(mean),
                ..track.alignment
            }
        }))
    }
}

impl Track {
    /// Adds what the back-EMF of the last period was, in the direction of turning.
    fn sample(&mut self, motor: &MotorAlignment, seen: &MotorSeen) {
        if seen.omega_e.unsigned_abs() < motor.least_speed.unsigned_abs() {
            return;
        }
        let [d, q] = motor.back_emf(seen);
        let [sum_d, sum_q] = self.sums;
        self.sums = if seen.omega_e < 0 {
            [sum_d.saturating_sub(d), sum_q.saturating_sub(q)]
        } else {
            [sum_d.saturating_add(d), sum_q.saturating_add(q)]
        };
        self.samples = self.samples.saturating_add(1);
    }

    /// Moves the offset by half of what the sums say.
    fn correct(&mut self, motor: &MotorAlignment, seen: &MotorSeen) -> Result<(), Reason> {
        let [d, q] = self.sums;
        (self.sums, self.samples) = ([0; 2], 0);
        let emf = motor
            .expected_emf(seen.omega_e)
            .saturating_mul(WINDOW.into());
        let driven = (seen.omega_e < 0) != (seen.current.q < 0);
        if d.abs().max(q.abs()) > emf.saturating_mul(CLEAR) || (driven && q < 0) {
            return Ok(());
        }
        let off = vector::angle(q, d.saturating_neg()).minus(Angle(0));
        let correction = (off >> 1).clamp(CORRECTION.wrapping_neg(), CORRECTION);
        let zero = &mut self.alignment.theta_e_at_zero;
        *zero = zero.turned(correction);
        self.corrections = self.corrections.saturating_add(1);
        if self.corrections == SETTLED {
            (self.from, self.ran) = (seen.theta, 0);
        } else {
            self.ran = self.ran.saturating_add(i64::from(correction));
        }
        if self.corrections > SETTLED && !self.judged {
            let turned = seen.theta.minus(self.from);
            if turned.unsigned_abs() >= JUDGED {
                self.judged = true;
                self.judge(motor, turned)?;
            }
        }
        Ok(())
    }

    /// The offset's run over `turned`, three eighths of a turn, is by how many pole pairs the plate is wrong.
    fn judge(&self, motor: &MotorAlignment, turned: i32) -> Result<(), Reason> {
        let turned = i64::from(turned);
        let turned = if self.alignment.reversed {
            turned.wrapping_neg()
        } else {
            turned
        };
        // To the nearest whole number.
        let twice = self.ran.saturating_mul(2);
        let rounded = if (twice < 0) == (turned < 0) {
            twice.saturating_add(turned)
        } else {
            twice.saturating_sub(turned)
        };
        let more = rounded.checked_div(turned.wrapping_mul(2)).unwrap_or(0);
        if more == i64::from(motor.pole_pairs).wrapping_mul(-2) {
            Err(Reason::Reversed)
        } else if more != 0 {
            Err(Reason::PolePairs)
        } else {
            Ok(())
        }
    }

    /// How far off the rotor was over a whole measurement; `None` if there was no back-EMF to tell.
    fn off(&self, motor: &MotorAlignment, steps: u16) -> Option<i32> {
        let [d, q] = self.sums;
        let least = i64::from(motor.least_emf.to_bits()).wrapping_mul(i64::from(steps >> 1));
        (q > least).then(|| vector::angle(q, d.saturating_neg()).minus(Angle(0)))
    }
}

impl MotorAlignment {
    /// Size of the back-EMF at a speed, by the plate, 2^-18 V.
    fn expected_emf(&self, omega_e: Speed) -> i64 {
        // `least_emf` is that at half of the turning's speed, `least_speed` an eighth of that speed.
        let (volts, speed) = (
            i64::from(self.least_emf.to_bits()),
            self.least_speed.to_bits(),
        );
        let at_speed = i64::from(omega_e.unsigned_abs().to_bits()).saturating_mul(volts);
        at_speed
            .checked_div(i64::from(speed).saturating_mul(4))
            .unwrap_or(0)
    }

    /// The back-EMF in d and q, 2^-18 V: voltage less what resistance and inductance take.
    fn back_emf(&self, seen: &MotorSeen) -> [i64; 2] {
        let (i_d, i_q) = (seen.current.d.to_bits(), seen.current.q.to_bits());
        // ohm in 2^-20 times A in 2^-20: 2^-18 V after 22.
        let resistive =
            |i: i32| i64::from(i).wrapping_mul(i64::from(self.resistance.to_bits())) >> 22;
        // H in 2^-28 times A in 2^-20, to Wb in 2^-24: 39 bits; times rad/s in 2^-16: cut to 31 bits before.
        let inductive = |i: i32| {
            let flux = i64::from(i).wrapping_mul(i64::from(self.inductance.to_bits())) >> 24;
            let flux = flux.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
            flux.wrapping_mul(i64::from(seen.omega_e.to_bits())) >> 22
        };
        let (v_d, v_q) = (
            i64::from(seen.voltage.d.to_bits()),
            i64::from(seen.voltage.q.to_bits()),
        );
        [
            v_d.wrapping_sub(resistive(i_d))
                .wrapping_add(inductive(i_q)),
            v_q.wrapping_sub(resistive(i_q))
                .wrapping_sub(inductive(i_d)),
        ]
    }
}
