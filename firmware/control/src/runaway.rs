//! Motion that the drive does not have in hand: what stops a motor before a wrong angle or a lost encoder runs it away.
//!
//! Looked at by the speed task, each motor in every fourth step, while the motor is driven in the rotor's frame.
//!
//! | what | when it is one | fault |
//! | --- | --- | --- |
//! | over-speed | the shaft turns faster than its limit | `...OverSpeed` |
//! | following error | the speed is further from its reference than its limit. Where a motor is at its torque or voltage limit the coordinator takes the reference to what it can follow, so that a limit alone is none | `...Following` |
//! | current error | `i_d` is further from its reference than its limit; `i_q` too, unless the voltage circle cut the voltage, which serves d first | `...CurrentError` |
//! | angle | the voltage that acted is not the one that the motor's equations (Eqs 1 and 2) give at the encoder's angle and speed: an angle wrong by `delta` turns the back-EMF, and leaves `2 * sin(delta / 2)` of it over | `...Angle` |
//! | stall | the motor is at its torque limit and hardly turns: what blocks it, or an angle wrong by a quarter turn, whose current makes no torque and no speed, so that none of the others sees it | `...Stalled` |
//!
//! Each is tolerated for a time: a [`Tally`] counts up in a look that shows it and down in one that does not.

use crate::exchange::MotorExchange;
use crate::fault::Fault;
use crate::format::{Gain, Speed, Voltage, multiply_upper};
use crate::regulator::Induced;
use crate::tolerance::{Tally, Tolerance};

/// Limits of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunawayConfig {
    /// Fastest that the shaft may turn, 2^-32 turn a sample.
    pub theta_step_max: i32,
    /// Furthest that the speed may be from its reference, electrical.
    pub following: Speed,
    /// Furthest that a current may be from its reference, [`ScaledCurrent`](crate::format::ScaledCurrent).
    pub current: i32,
    /// Stator resistance: [`ScaledCurrent`](crate::format::ScaledCurrent) to [`Voltage`].
    pub resistance: Gain,
    /// Part of the back-EMF that the voltage may be off by, 2^-32.
    pub emf_part: i32,
    /// Voltage that it may be off by at any speed: errors of resistance, dead time and inductance.
    pub emf_floor: Voltage,
    /// Slowest that a motor at its torque limit must turn, electrical.
    pub stall: Speed,
    /// Electrical turns a mechanical turn.
    pub pole_pairs: i32,
    /// How long each is tolerated, in looks: in the order of [`Sign`].
    pub tolerances: [Tolerance; 5],
}

/// How a motor moves, and was asked to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Speed that was asked, electrical.
    pub reference: Speed,
    /// Speed, electrical.
    pub omega_e: Speed,
    /// It is at its torque limit.
    pub torque_limited: bool,
    /// How far the shaft turns in a period, 2^-32 turn.
    pub theta_step: i32,
    /// The voltage circle cut the last period's voltage.
    pub voltage_limited: bool,
}

/// A sign of a runaway, the likelier cause of others first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// The voltage is not that of the encoder's angle.
    Angle,
    /// A current is far from its reference.
    CurrentError,
    /// The shaft turns too fast.
    OverSpeed,
    /// The speed is far from its reference.
    Following,
    /// The motor stands at its torque limit.
    Stalled,
}

impl Sign {
    const ALL: [Self; 5] = [
        Self::Angle,
        Self::CurrentError,
        Self::OverSpeed,
        Self::Following,
        Self::Stalled,
    ];

    /// The screw's fault.
    #[must_use]
    pub const fn of_screw(self) -> Fault {
        match self {
            Self::Angle => Fault::ScrewAngle,
            Self::CurrentError => Fault::ScrewCurrentError,
            Self::OverSpeed => Fault::ScrewOverSpeed,
            Self::Following => Fault::ScrewFollowing,
            Self::Stalled => Fault::ScrewStalled,
        }
    }

    /// The nut's fault.
    #[must_use]
    pub const fn of_nut(self) -> Fault {
        match self {
            Self::Angle => Fault::NutAngle,
            Self::CurrentError => Fault::NutCurrentError,
            Self::OverSpeed => Fault::NutOverSpeed,
            Self::Following => Fault::NutFollowing,
            Self::Stalled => Fault::NutStalled,
        }
    }
}

/// State of one motor's watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Runaway {
    tallies: [Tally; 5],
    /// A tally is not empty.
    counting: bool,
}

impl Runaway {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            tallies: [Tally::new(); 5],
            counting: false,
        }
    }

    /// One look at a motor that is driven: which sign is past its patience.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &RunawayConfig,
        induced: &Induced,
        exchange: &MotorExchange,
        motion: Motion,
    ) -> Option<Sign> {
        let past = past(config, induced, exchange, motion);
        let [angle, current, speed, following, stalled] = past;
        if !(angle | current | speed | following | stalled | self.counting) {
            return None;
        }
        self.count(config, past)
    }

    #[cold]
    #[inline(never)]
    fn count(&mut self, config: &RunawayConfig, past: [bool; 5]) -> Option<Sign> {
        let mut found = None;
        self.counting = false;
        let tallies = self.tallies.iter_mut().zip(config.tolerances);
        for ((tally, tolerance), (past, sign)) in tallies.zip(past.into_iter().zip(Sign::ALL)) {
            if tally.step(tolerance, past.into()) && found.is_none() {
                found = Some(sign);
            }
            self.counting |= *tally != Tally::new();
        }
        found
    }
}

/// What is past its limit in this look.
#[inline(always)]
fn past(
    config: &RunawayConfig,
    induced: &Induced,
    exchange: &MotorExchange,
    motion: Motion,
) -> [bool; 5] {
    let theta_step = motion.theta_step;
    let (asked, current) = (exchange.reference(), exchange.current());
    // All are within half of their words, or nearly so: their differences fit.
    let error_d = asked.d.0.wrapping_sub(current.d.0).unsigned_abs();
    let error_q = asked.q.0.wrapping_sub(current.q.0).unsigned_abs();
    let most = config.current.unsigned_abs();

    // The voltage that acted in the period that ended with the sample, less what the equations make of the currents.
    let voltage = exchange.voltage(exchange.periods().wrapping_sub(2));
    let theta_e_step = theta_step.wrapping_mul(config.pole_pairs);
    let model = induced.voltage(current, theta_e_step);
    let ohmic = |i: i32| config.resistance.times(i);
    let off_d = voltage
        .d
        .to_bits()
        .wrapping_sub(ohmic(current.d.0))
        .wrapping_add(model.d);
    let off_q = voltage
        .q
        .to_bits()
        .wrapping_sub(ohmic(current.q.0))
        .wrapping_sub(model.q);
    let part = multiply_upper(induced.back_emf(theta_e_step), config.emf_part).unsigned_abs();
    let floor = config.emf_floor.to_bits().unsigned_abs();
    let emf_max = part.max(floor);

    [
        off_d.unsigned_abs().max(off_q.unsigned_abs()) > emf_max,
        error_d > most || error_q > most && !motion.voltage_limited,
        theta_step.unsigned_abs() > config.theta_step_max.unsigned_abs(),
        motion
            .reference
            .saturating_sub(motion.omega_e)
            .saturating_abs()
            > config.following,
        motion.torque_limited && motion.omega_e.saturating_abs() < config.stall,
    ]
}
