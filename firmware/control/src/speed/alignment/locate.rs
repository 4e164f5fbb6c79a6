//! Where a rotor stands, by motion of a part of a degree.
//!
//! A current vector of length `i` at an angle `delta` from the flux makes the torque `p*flux*i*sin(delta)`, and the rotor
//! breaks away where that passes what holds it. So the break-away vectors of one direction end on a line along the flux,
//! those of the other on a second one opposite; friction and a held load are how far the lines are from zero, and move neither's
//! direction. Eight directions 45 degrees apart are tried, each with a growing current. `sum(+-1/i * (cos, sin))` points along the
//! axis of torque: `1/i` where the limit moves nothing is symmetric about it, and eight directions hold
//! its first harmonic apart from all but the seventh and ninth.
//!
//! Friction is elastic before it slides, and remembers how it was left. So the axis is known to some tens of degrees only: that
//! suffices for a [`swing`](super::swing), and the rest is left to the turning's back-EMF.

use super::probe::{Broken, Probe, ProbeConfig, ProbeStep, current};
use super::vector;
use super::{MotorAlignment, Reason};
use crate::base::format::{Angle, Current};
use crate::current::observer::EncoderAlignment;

/// Directions of a scan.
const DIRECTIONS: u8 = 8;

/// State of a rotor's location.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Locate {
    probe: Probe,
    count: u8,
    sum: [i64; 2],
    weight: i64,
    /// How often its own encoder moved, and how often only the other motor's.
    own: u8,
    others: u8,
    /// What the encoders said of each other, and of the table's scale.
    senses: Senses,
    /// Where the encoder was at the start, and the table at that of a probe.
    from: Option<Angle>,
    table_from: Option<i64>,
    /// How far the table went until something gave way.
    table: i64,
}

/// Which way an encoder counts beside others, each as how much more often the same way than the other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Senses {
    /// Both encoders, while one motor took the other along.
    pub(super) other: i8,
    /// The encoder and the table's scale, while the other motor stood.
    pub(super) table: i8,
}

/// Where a rotor stands: an electrical angle and the encoder's there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Located {
    /// Electrical angle of a current that moves the encoder's count up.
    pub(super) axis: Angle,
    at: Angle,
}

impl Located {
    /// What that says of an encoder that counts forwards, or backwards.
    pub(super) fn alignment(&self, config: &MotorAlignment, reversed: bool) -> EncoderAlignment {
        const QUARTER: i32 = 1 << 30;
        let mechanical = self.at.times(config.pole_pairs);
        let theta_e_at_zero = if reversed {
            self.axis.turned(QUARTER).plus(mechanical)
        } else {
            let flux = self.axis.turned(QUARTER.wrapping_neg());
            Angle(flux.0.wrapping_sub(mechanical.0))
        };
        EncoderAlignment {
            reversed,
            theta_e_at_zero,
            index_awaited: false,
        }
    }
}

/// What a location asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LocateStep {
    /// No current.
    Rest,
    /// This current along this electrical angle.
    Vector(Angle, Current),
    /// Found.
    Found(Located),
    /// Not to be found.
    Failed(Reason),
    /// Not to be found while encoders move although no current flows: which.
    Moves([bool; 2]),
}

impl Locate {
    /// What was seen of the encoders' directions.
    pub(super) const fn senses(&self) -> Senses {
        self.senses
    }

    /// Its encoder stood while only the other motor's moved, again and again: what is taken along goes no further than what takes it.
    /// A rotor that no friction holds goes on alone too, but less often.
    pub(super) const fn suspects_exchange(&self) -> bool {
        self.others > 2 && self.others > self.own >> 2
    }

    /// One step for `motor`, with both encoders' angles and where the table is by its scale, 2^-32 turn.
    pub(super) fn step(
        &mut self,
        config: &MotorAlignment,
        probes: &ProbeConfig,
        motor: usize,
        theta: [Angle; 2],
        table: i64,
    ) -> LocateStep {
        let own = theta.get(motor).copied().unwrap_or_default();
        let from = *self.from.get_or_insert(own);
        let table_from = *self.table_from.get_or_insert(table);
        let at = self.direction();
        match self.probe.step(probes, theta) {
            ProbeStep::Rest => LocateStep::Rest,
            ProbeStep::Ramp(level) => {
                self.table = table.saturating_sub(table_from);
                LocateStep::Vector(at, current(config.limit, level))
            }
            ProbeStep::Moves(moving) => LocateStep::Moves(moving),
            ProbeStep::Found(broken) => {
                self.probe = Probe::default();
                self.table_from = None;
                self.take(probes, motor, &broken);
                self.count = self.count.saturating_add(1);
                if self.count < DIRECTIONS {
                    return LocateStep::Rest;
                }
                // The rotor went a little to and fro about the middle.
                let at = from.turned(own.minus(from) >> 1);
                self.axis().map_or_else(LocateStep::Failed, |axis| {
                    LocateStep::Found(Located { axis, at })
                })
            }
        }
    }

    /// The electrical angle of the probe that is due: an eighth of a turn on after each two, which are opposite and take back
    /// each other's motion.
    fn direction(&self) -> Angle {
        let half = Angle(if self.count & 1 == 1 { 1 << 31 } else { 0 });
        Angle(0x2000_0000u32.wrapping_mul(u32::from(self.count >> 1))).plus(half)
    }

    /// Takes what a probe found.
    fn take(&mut self, probes: &ProbeConfig, motor: usize, broken: &Broken) {
        let sign = broken.sign(probes, motor);
        if sign == 0 {
            if broken.sign(probes, motor ^ 1) != 0 {
                self.others = self.others.saturating_add(1);
            }
            return;
        }
        self.own = self.own.saturating_add(1);
        if let Some(same) = broken.together(probes) {
            let vote = if same { 1 } else { -1 };
            self.senses.other = self.senses.other.saturating_add(vote);
        }
        let moved = broken.moved.get(motor).copied().unwrap_or(0);
        if self.table.unsigned_abs() > u64::from(moved.unsigned_abs() >> 2) {
            let vote = if (self.table < 0) == (moved < 0) {
                1
            } else {
                -1
            };
            self.senses.table = self.senses.table.saturating_add(vote);
        }
        // At most sixteen times that of the limit.
        let weight = (1i64 << 24).checked_div(broken.level.into()).unwrap_or(0);
        let (cos, sin) = self.direction().cos_sin();
        let part = |unit: crate::base::format::Unit| {
            i64::from(unit.to_bits() >> 15)
                .wrapping_mul(weight)
                .wrapping_mul(i64::from(sign))
        };
        let [x, y] = self.sum;
        self.sum = [x.saturating_add(part(cos)), y.saturating_add(part(sin))];
        self.weight = self.weight.saturating_add(weight);
    }

    /// The axis from all probes.
    fn axis(&self) -> Result<Angle, Reason> {
        if self.others > self.own {
            return Err(Reason::Exchanged);
        }
        let [x, y] = self.sum;
        // Half of what they would be long if all pointed the same way; they spread over less than half a turn.
        let (x16, y16) = (x >> 16, y >> 16);
        let long = x16
            .saturating_mul(x16)
            .saturating_add(y16.saturating_mul(y16));
        let half = self.weight >> 1;
        if self.own == 0 {
            return Err(Reason::Held);
        }
        if long < half.saturating_mul(half) {
            return Err(Reason::Unsteady);
        }
        Ok(vector::angle(x, y))
    }
}
