//! What a leg of a bridge loses to its dead time.

/// Part of its dead time that a leg loses, at a current over the turning current `2 C V / t`: that which turns the leg within the dead
/// time `t`. `C` is a switch's capacitance, `V` the bus voltage.
///
/// A current into the motor keeps the leg low until the high side closes: all of the dead time is lost. It then pulls the leg down when
/// the high side opens, on a slope that gives a part of it back: half of what the slope takes, or, where it ends above, all but that
/// much.
#[must_use]
pub fn lost_part(x: f64) -> f64 {
    let size = x.abs();
    let lost = if size < 1.0 {
        0.5 * size
    } else {
        1.0 - 0.5 / size
    };
    lost.copysign(x)
}

/// The dead time of a bridge on a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadTime {
    /// Of a PWM period.
    pub part: f64,
    /// Current that turns a leg within it, `2 C V / t`, A.
    pub turning_a: f64,
    /// Bus voltage times a PWM period over the inductance of a phase, A.
    pub bus_a: f64,
}

/// A period of the PWM as its first top sees it.
#[derive(Clone, Copy, Debug)]
pub struct Period {
    /// The high sides' parts of it.
    pub duties: [f64; 3],
    /// Currents into the motor, A.
    pub amps: [f64; 3],
    /// Phase voltages that would keep the currents, of the bus.
    pub balance: [f64; 3],
}

impl DeadTime {
    /// What each leg loses in a period of centre-aligned PWM, of its dead time.
    ///
    /// Each leg rises once after the counter's top and falls once before the next. Its current ripples, so the two edges have currents of
    /// their own. Only a current into the motor turns a falling leg early, and only one out of it a rising leg.
    #[must_use]
    pub fn lost_parts(&self, period: &Period) -> [f64; 3] {
        let Period {
            duties,
            amps,
            balance,
        } = period;
        let mean = duties.iter().sum::<f64>() / 3.0;
        let lost = |edge: f64| lost_part(edge.max(0.0) / self.turning_a);
        [0, 1, 2].map(|k| {
            // Between the top and an edge a phase has a third of what the legs of larger duties give, less what it balances.
            let higher: f64 = duties.map(|duty| (duty - duties[k]).max(0.0)).iter().sum();
            let ripple = 0.5 * (higher / 3.0 + (1.0 - duties[k]) * balance[k]);
            // What a dead time can lose is taken to be lost. More than that makes the current grow until the next top.
            let more = duties[k] - mean - balance[k];
            let grown = more - more.clamp(-self.part, self.part);
            lost(self.bus_a * (ripple + grown) + amps[k]) - lost(self.bus_a * ripple - amps[k])
        })
    }
}
