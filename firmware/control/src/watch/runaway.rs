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
//! | voltage | the same, but not by a back-EMF of its own size that is only turned, or now and then, which a wrong angle is not: a current sensor, the encoder's signals, a phase, the bus's measurement. By much more than any angle explains (three times the back-EMF) it is found in half the time | `...Voltage` |
//! | stall | the motor is at its torque limit and hardly turns: what blocks it, or an angle wrong by a quarter turn, whose current makes no torque and no speed, so that none of the others sees it; or the table hardly moves although it is asked to, while both motors may turn on together | `...Stalled` |
//!
//! And where a motor has three current sensors: currents that do not add up to nothing in two looks in a row (`...CurrentSum`). While both
//! run it looks in the steps that do not look at motion, but for one of the nut. It looks in each step while they are aligned or come to rest.
//!
//! Each is tolerated for a time: a [`Tally`] counts up in a look that shows it and down in one that does not.

use crate::base::fault::Fault;
use crate::base::format::{Gain, ScaledCurrent, Speed, Voltage, multiply_upper};
use crate::base::tolerance::{Tally, Tolerance};
use crate::current::exchange::MotorExchange;
use crate::current::regulator::Induced;
use crate::current::sense::{Codes, CurrentSense};
use crate::current::transform::DirectQuadrature;

/// Limits of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunawayConfig {
    /// Fastest that the shaft may turn, 2^-32 turn a sample.
    pub theta_step_max: u32,
    /// Furthest that the speed may be from its reference, electrical.
    pub following: Speed,
    /// Furthest that a current may be from its reference, [`ScaledCurrent`].
    pub current: u32,
    /// Furthest that three currents may be from adding up to nothing, the same.
    pub current_sum: u32,
    /// Stator resistance: [`ScaledCurrent`] to [`Voltage`].
    pub resistance: Gain,
    /// Part of the back-EMF that the voltage may be off by, 2^-32.
    pub emf_part: i32,
    /// What it may be off by at any speed, in the steps of a [`Voltage`]: errors of resistance, dead time and inductance.
    pub emf_floor: u32,
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
    /// The voltage is not that of the currents at any angle.
    Voltage,
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
    /// Those that have a tally. [`Sign::Voltage`] is found by that of the angle.
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
            Self::Voltage => Fault::ScrewVoltage,
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
            Self::Voltage => Fault::NutVoltage,
            Self::CurrentError => Fault::NutCurrentError,
            Self::OverSpeed => Fault::NutOverSpeed,
            Self::Following => Fault::NutFollowing,
            Self::Stalled => Fault::NutStalled,
        }
    }
}

/// Two steps in a row.
const TWICE: Tolerance = Tolerance {
    weight: 2,
    events: 1,
};

/// How three currents fail to add up to nothing, in events: one past the limit, two past twice the limit, which noise is not.
#[must_use]
#[inline(always)]
pub fn sum_events(config: &RunawayConfig, sense: &CurrentSense, codes: Codes) -> u32 {
    let Some(ScaledCurrent(sum)) = sense.sum(codes) else {
        return 0;
    };
    let (off, most) = (sum.unsigned_abs(), config.current_sum);
    u32::from(off > most).saturating_add(u32::from(off > most.saturating_mul(2)))
}

/// Watch of the sum of three currents, a step of the speed task at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurrentSum {
    tally: Tally,
}

impl CurrentSum {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            tally: Tally::new(),
        }
    }

    /// One step at a motor whose bridge is closed: its currents do not add up.
    pub fn step(
        &mut self,
        config: &RunawayConfig,
        sense: &CurrentSense,
        exchange: &MotorExchange,
    ) -> bool {
        let events = sum_events(config, sense, exchange.codes_of_one_period());
        self.tally.step(TWICE, events)
    }
}

/// State of one motor's watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Runaway {
    tallies: [Tally; 5],
    /// Looks since the angle's tally was empty; those of them in which the voltage was off, and in which a turned back-EMF
    /// explains it.
    looks: u8,
    off: u8,
    turned: u8,
    /// A tally is not empty.
    counting: bool,
}

impl Runaway {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            tallies: [Tally::new(); 5],
            looks: 0,
            off: 0,
            turned: 0,
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
        // One word, in a register: an array would be written to memory in each look.
        let past = u8::from(angle)
            | u8::from(current) << 1
            | u8::from(speed) << 2
            | u8::from(following) << 3
            | u8::from(stalled) << 4;
        self.count(config, past, induced, exchange, motion.theta_step)
    }

    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn count(
        &mut self,
        config: &RunawayConfig,
        past: u8,
        induced: &Induced,
        exchange: &MotorExchange,
        theta_step: i32,
    ) -> Option<Sign> {
        let mut found = None;
        self.counting = false;
        let [tally, ..] = &self.tallies;
        if *tally == Tally::new() {
            (self.looks, self.off, self.turned) = (0, 0, 0);
        } else {
            self.looks = self.looks.saturating_add(1);
        }
        let [angle_off, current, speed, following, stalled] =
            [0, 1, 2, 3, 4].map(|bit: u8| u32::from(past >> bit & 1));
        let off = if angle_off == 0 {
            Off::None
        } else {
            Off::of(config, induced, exchange, theta_step)
        };
        self.off = self.off.saturating_add((off != Off::None).into());
        self.turned = self.turned.saturating_add((off == Off::Turned).into());
        let events = [angle_off, current, speed, following, stalled];
        let [tolerance, ..] = config.tolerances;
        // A wrong angle is there in nearly each look, which takes twice the tolerated ones.
        let now_and_then = u32::from(self.looks) > tolerance.events.saturating_mul(4);
        let tallies = self.tallies.iter_mut().zip(config.tolerances);
        for ((tally, tolerance), (events, sign)) in tallies.zip(events.into_iter().zip(Sign::ALL)) {
            if tally.step(tolerance, events) && found.is_none() {
                found = Some(sign);
            }
            self.counting |= *tally != Tally::new();
        }
        let mostly = u32::from(self.turned).saturating_mul(2) > u32::from(self.off);
        let turned = mostly || off == Off::Turned;
        match found {
            Some(Sign::Angle) if now_and_then || !turned => Some(Sign::Voltage),
            found => found,
        }
    }
}

/// How a voltage is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Off {
    /// It is not.
    None,
    /// As if the back-EMF were turned, which a wrong angle does: its size stays.
    Turned,
    /// Otherwise.
    Otherwise,
}

impl Off {
    /// How the voltage that acted in the period that ended with the sample is off.
    fn of(
        config: &RunawayConfig,
        induced: &Induced,
        exchange: &MotorExchange,
        theta_step: i32,
    ) -> Self {
        let off = voltage_off(config, induced, exchange, theta_step);
        let emf = induced.back_emf(theta_step.wrapping_mul(config.pole_pairs));
        let (size, floor) = (emf.unsigned_abs(), config.emf_floor);
        // Voltages are within 2^31, so their squares' sum fits.
        let square = |x: i64| x.unsigned_abs().saturating_mul(x.unsigned_abs());
        let q = i64::from(off.q).saturating_add(i64::from(emf));
        let seen = square(off.d.into()).saturating_add(square(q));
        // What the model may be off by anyway.
        let unsure = i64::from(floor / 2).max(i64::from(size / 4));
        let least = i64::from(size).saturating_sub(unsure).max(0);
        let most = i64::from(size).saturating_add(unsure);
        if seen >= square(least) && seen <= square(most) {
            Self::Turned
        } else {
            Self::Otherwise
        }
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
    let most = config.current;

    let emf = induced.back_emf(theta_step.wrapping_mul(config.pole_pairs));
    let part = multiply_upper(emf, config.emf_part).unsigned_abs();
    let emf_max = part.max(config.emf_floor);
    [
        larger(voltage_off(config, induced, exchange, theta_step)) > emf_max,
        error_d > most || error_q > most && !motion.voltage_limited,
        theta_step.unsigned_abs() > config.theta_step_max,
        motion
            .reference
            .saturating_sub(motion.omega_e)
            .saturating_abs()
            > config.following,
        motion.torque_limited && motion.omega_e.saturating_abs() < config.stall,
    ]
}

/// The larger part, without its sign.
#[inline(always)]
fn larger(off: DirectQuadrature<i32>) -> u32 {
    off.d.unsigned_abs().max(off.q.unsigned_abs())
}

/// The voltage that acted in the period that ended with the sample, less what the equations make of the currents.
#[inline(always)]
fn voltage_off(
    config: &RunawayConfig,
    induced: &Induced,
    exchange: &MotorExchange,
    theta_step: i32,
) -> DirectQuadrature<i32> {
    let current = exchange.current();
    let voltage = exchange.voltage(exchange.periods().wrapping_sub(2));
    let theta_e_step = theta_step.wrapping_mul(config.pole_pairs);
    let model = induced.voltage(current, theta_e_step);
    let ohmic = |i: i32| config.resistance.times(i);
    let off = |volts: Voltage, amps: ScaledCurrent| volts.to_bits().wrapping_sub(ohmic(amps.0));
    DirectQuadrature {
        d: off(voltage.d, current.d).wrapping_add(model.d),
        q: off(voltage.q, current.q).wrapping_sub(model.q),
    }
}
