//! A power stage that switches: edges, dead times, charge of the legs, diodes and amplifiers, in place of mean voltages.
//!
//! From its turn at the top, a counter goes down for half a period and then up. A high side is wanted while the counter is below the
//! compare value (RM0440, PWM mode 1, centre-aligned). So each leg has at most one edge in each half of a period. After an edge both
//! switches are open for the dead time. Then the current moves the node by its charge, until a diode holds it.

use control::current_loop::PwmCommand;

/// Parts of a power stage that mean voltages do not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switching {
    /// Forward voltage of a switch's diode, V.
    pub diode_v: f64,
    /// Time constant of the current amplifiers, s.
    pub amplifier_s: f64,
    /// When the channels a, b, c are sampled, s after the counter's turn.
    pub sampled_s: [f64; 3],
}

impl Switching {
    /// A silicon diode, taken to be of 1 V: no board was measured. An amplifier that is within 1 % after 300 ns, as the boards' wiring pages ask. Channels that two ADCs
    /// sample 0.3 us after the turn, and the third 0.6 us later, as the firmware configures them.
    #[must_use]
    pub fn usual() -> Self {
        Self {
            diode_v: 1.0,
            amplifier_s: 300e-9 / 100f64.ln(),
            sampled_s: [0.3e-6, 0.3e-6, 0.9e-6],
        }
    }
}

/// Times closer than that are one, s.
pub(crate) const SAME_S: f64 = 1e-12;

/// Supply and charge of the legs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rails {
    /// Bus voltage, V.
    pub(crate) bus_v: f64,
    /// Capacitance of a switch, F.
    pub(crate) leg_f: f64,
    /// Forward voltage of a diode, V.
    pub(crate) diode_v: f64,
}

/// A leg of a bridge.
#[derive(Clone, Copy, Debug, Default)]
struct SwitchedLeg {
    /// Voltage of its node, of the bus.
    node: f64,
    /// The switch that the timer wants closed is the high one.
    high: bool,
    /// Both switches are open for that long, s.
    dead_s: f64,
    /// The current has flowed under the low side for that long, s.
    low_s: f64,
}

impl SwitchedLeg {
    /// The timer wants the high side closed, or the low side.
    fn want(&mut self, high: bool, dead_s: f64) {
        if self.high != high {
            self.high = high;
            self.dead_s = dead_s;
        }
    }

    /// Passes `dt` s, no longer than the dead time that is left, with `amps` into the motor. Mean voltage of the node to the middle of
    /// the bus, V.
    fn pass(&mut self, amps: f64, dt: f64, rails: &Rails) -> f64 {
        let wanted = if self.high { 1.0 } else { 0.0 };
        if self.dead_s <= 0.0 {
            self.node = wanted;
            self.low_s = if self.high { 0.0 } else { self.low_s + dt };
            return (wanted - 0.5) * rails.bus_v;
        }
        let rail = if amps > 0.0 {
            0.0
        } else if amps < 0.0 {
            1.0
        } else {
            self.node
        };
        let charge = 2.0 * rails.leg_f * rails.bus_v;
        let swing_s =
            ((rail - self.node).abs() * charge / amps.abs().max(f64::MIN_POSITIVE)).min(dt);
        let reached = if swing_s < dt {
            rail
        } else {
            self.node - amps * dt / charge
        };
        let held = 1.0 - swing_s / dt;
        let mean = 0.5 * (self.node + reached) * (1.0 - held) + rail * held;
        self.low_s = if rail == 0.0 && held > 0.0 {
            self.low_s + held * dt
        } else {
            0.0
        };
        self.node = reached;
        self.dead_s -= dt;
        if self.dead_s < SAME_S {
            self.dead_s = 0.0;
            self.node = wanted;
        }
        let diode = if amps == 0.0 {
            0.0
        } else {
            rails.diode_v.copysign(amps)
        };
        (mean - 0.5) * rails.bus_v - diode * held
    }
}

/// A bridge within a period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SwitchedBridge {
    legs: [SwitchedLeg; 3],
    /// Compare values over the counter's top.
    duty: [f64; 3],
    /// The counter goes up.
    up: bool,
    /// Edges that are still to come in this half, s from its begin.
    edges: [Option<f64>; 3],
    /// Currents into the legs at the begin of the last segment, A, and its length, s.
    before: ([f64; 3], f64),
}

impl SwitchedBridge {
    /// The counter turns at its top, and takes compare values over.
    pub(crate) fn turn(&mut self, command: PwmCommand, top: u16, dead_s: f64) {
        self.up = true;
        self.duty = command
            .compare
            .map(|compare| (f64::from(compare) / f64::from(top)).min(1.0));
        // From the top on a leg does not switch, so its high side stays closed.
        for (leg, duty) in self.legs.iter_mut().zip(self.duty) {
            leg.want(duty >= 1.0, dead_s);
        }
    }

    /// Half a period of `half_s` begins.
    pub(crate) fn begin_half(&mut self, half_s: f64) {
        self.up = !self.up;
        let up = self.up;
        self.edges = self.duty.map(|duty| {
            let part = if up { duty } else { 1.0 - duty };
            (duty > 0.0 && duty < 1.0).then_some(part * half_s)
        });
    }

    /// Takes the edges up to `at`, s from the begin of the half.
    pub(crate) fn take_edges(&mut self, at: f64, dead_s: f64) {
        for (leg, edge) in self.legs.iter_mut().zip(&mut self.edges) {
            if edge.is_some_and(|edge| edge <= at + SAME_S) {
                *edge = None;
                leg.want(!self.up, dead_s);
            }
        }
    }

    /// Time from `at` to its next edge or end of a dead time, at most `left`, s.
    pub(crate) fn steady_for(&self, at: f64, left: f64) -> f64 {
        let edges = self.edges.iter().flatten().map(|edge| edge - at);
        let dead = self
            .legs
            .iter()
            .map(|leg| leg.dead_s)
            .filter(|dead_s| *dead_s > 0.0);
        edges.chain(dead).fold(left, f64::min)
    }

    /// Passes `dt` s with `amps` into the legs. Mean voltages of the nodes to the middle of the bus, V.
    pub(crate) fn pass(&mut self, amps: [f64; 3], dt: f64, rails: &Rails) -> [f64; 3] {
        self.before = (amps, dt);
        let mut volts = [0.0; 3];
        for ((leg, amps), volts) in self.legs.iter_mut().zip(amps).zip(&mut volts) {
            *volts = leg.pass(amps, dt, rails);
        }
        volts
    }

    /// What the amplifiers of low-side shunts show at the samples of currents `amps` into the legs, A.
    ///
    /// A ramp is shown late by the time constant. A shunt whose low side has just taken the current over is still below it.
    pub(crate) fn shown(&self, amps: [f64; 3], switching: &Switching) -> [f64; 3] {
        let (before, dt) = self.before;
        let mut shown = amps;
        for (k, shown) in shown.iter_mut().enumerate() {
            let (sampled_s, time_s) = (switching.sampled_s[k], switching.amplifier_s);
            let slope = if dt > 0.0 {
                (amps[k] - before[k]) / dt
            } else {
                0.0
            };
            let settled = 1.0 - (-(self.legs[k].low_s + sampled_s) / time_s).exp();
            *shown = settled * (amps[k] + slope * (sampled_s - time_s));
        }
        shown
    }

    /// Opens all switches: the next period begins with the low sides.
    pub(crate) fn open(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEAD_S: f64 = 800e-9;
    const RAILS: Rails = Rails {
        bus_v: 310.0,
        leg_f: 200e-12,
        diode_v: 1.0,
    };

    /// Passes `dt` in one piece and in a thousand: the node, its mean voltage and the time under the low side must be the same.
    #[test]
    fn the_mean_of_a_dead_time_is_that_of_its_parts() {
        for amps in [-3.0, -0.3, -0.1, -0.01, 0.0, 0.01, 0.1, 0.3, 3.0] {
            for high in [false, true] {
                let mut whole = SwitchedLeg {
                    node: if high { 0.0 } else { 1.0 },
                    high: !high,
                    ..SwitchedLeg::default()
                };
                whole.want(high, DEAD_S);
                let mut parts = whole;
                let dt = 0.99 * DEAD_S;
                let mean = whole.pass(amps, dt, &RAILS);
                let n = 1000;
                let each = dt / f64::from(n);
                let sum: f64 = (0..n).map(|_| parts.pass(amps, each, &RAILS)).sum();
                let by_parts = sum / f64::from(n);
                assert!(
                    (mean - by_parts).abs() < 1e-3,
                    "{amps} A, high {high}: {mean:.4} V, by parts {by_parts:.4} V"
                );
                assert!((whole.node - parts.node).abs() < 1e-9);
                assert!((whole.low_s - parts.low_s).abs() < 1.5 * each);
            }
        }
    }

    /// A first-order amplifier follows a ramp late by its time constant. After one time constant it shows `1 - 1/e` of a step.
    #[test]
    fn an_amplifier_is_late_and_settles() {
        let switching = Switching {
            sampled_s: [0.0; 3],
            ..Switching::usual()
        };
        let leg = |low_s| SwitchedLeg {
            low_s,
            ..SwitchedLeg::default()
        };
        let bridge = SwitchedBridge {
            legs: [leg(1.0), leg(switching.amplifier_s), leg(0.0)],
            before: ([1.0, 2.0, 2.0], 1e-6),
            ..SwitchedBridge::default()
        };
        let [ramp, step, missed] = bridge.shown([2.0; 3], &switching);
        let expected = 2.0 - 1e6 * switching.amplifier_s;
        assert!(
            (ramp - expected).abs() < 1e-9,
            "{ramp}, expected {expected}"
        );
        let expected = 2.0 * (1.0 - (-1f64).exp());
        assert!(
            (step - expected).abs() < 1e-9,
            "{step}, expected {expected}"
        );
        assert!(missed.abs() < 1e-9, "{missed}, expected 0");
    }
}
