//! What is outside the chip's digital pins, as a net of resistors: what a pin reads is the voltage of its net.

use super::wiring::Wiring;
use std::collections::HashMap;

/// A pin: port (0 is A) and number.
pub type Pin = (usize, u32);

/// The chip's own pull resistors, ohm (DS12288, I/O static characteristics: 25 to 55 kohm).
const PULL_OHM: f64 = 40e3;
/// A driven output, here or elsewhere, ohm.
const DRIVEN_OHM: f64 = 50.0;
/// A short, ohm.
const SHORT_OHM: f64 = 1.0;

/// What the chip does to a pin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inside {
    /// It drives it to this level.
    pub drives: Option<bool>,
    /// Its pull resistor is on, to this level.
    pub pulls: Option<bool>,
    /// Another resistor of the chip's to ground, ohm.
    pub grounds: Option<f64>,
}

/// What is outside a pin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Circuit {
    /// A resistor to ground, ohm.
    PullDown(f64),
    /// A resistor to the supply, ohm.
    PullUp(f64),
    /// An output elsewhere.
    Driven(bool),
}

/// What is outside all pins.
#[derive(Clone, Debug, Default)]
pub struct Outside {
    /// By pin; one that is not here is open.
    pub circuits: HashMap<Pin, Circuit>,
    /// Pins that are shorted to each other.
    pub bridges: Vec<[Pin; 2]>,
    /// Pins that are shorted to ground or to the supply.
    pub shorts: HashMap<Pin, bool>,
    /// What pins were last at that nothing holds now: they keep their charge.
    charges: HashMap<Pin, bool>,
}

/// The contacts of a board, closed to ground while all is well: the enable switch's two, forward and backward end switch.
#[must_use]
pub const fn contacts(board: Wiring) -> [Pin; 4] {
    match board {
        Wiring::Nucleo | Wiring::Nucleo40kHz => [(2, 9), (2, 4), (1, 9), (1, 11)],
        Wiring::Mains => [(2, 9), (0, 9), (0, 8), (0, 10)],
    }
}

/// A gate driver's input: its pin, the alternate function that is its timer's output, and the timer, 0 for TIM1.
pub type Gate = (Pin, u32, usize);

/// The twelve gate drivers' inputs of a board.
#[must_use]
pub fn gates(board: Wiring) -> [Gate; 12] {
    let [high, low, last] = match board {
        Wiring::Nucleo | Wiring::Nucleo40kHz => [
            [((0, 8), 6, 0), ((0, 9), 6, 0), ((0, 10), 6, 0)],
            [((0, 11), 6, 0), ((0, 12), 6, 0), ((1, 15), 4, 0)],
            [((2, 10), 4, 1), ((2, 11), 4, 1), ((1, 5), 3, 1)],
        ],
        Wiring::Mains => [
            [((2, 0), 2, 0), ((2, 1), 2, 0), ((2, 2), 2, 0)],
            [((0, 11), 6, 0), ((0, 12), 6, 0), ((1, 9), 12, 0)],
            [((2, 10), 4, 1), ((2, 11), 4, 1), ((1, 1), 4, 1)],
        ],
    };
    let high_tim8 = [((2, 6), 4, 1), ((2, 7), 4, 1), ((2, 8), 4, 1)];
    let all = [high, low, high_tim8, last];
    std::array::from_fn(|k| all[k / 3][k % 3])
}

impl Outside {
    /// What is on a board: the power stages' pull-downs, and encoders that stand.
    #[must_use]
    pub fn of(board: Wiring) -> Self {
        let encoders: &[(Pin, bool)] = match board {
            Wiring::Nucleo | Wiring::Nucleo40kHz => &[
                ((0, 15), false),
                ((1, 3), true),
                ((1, 2), true),
                ((2, 12), true),
                ((1, 6), false),
                ((1, 7), false),
            ],
            // The screw's is on SPI: an input of the sensor does not hold its line, nor does its output unless selected.
            Wiring::Mains => &[
                ((1, 2), true),
                ((2, 12), true),
                ((1, 12), false),
                ((1, 6), false),
                ((1, 7), false),
            ],
        };
        // The default board's have the drivers' own resistors alone.
        let ohm = match board {
            Wiring::Nucleo | Wiring::Nucleo40kHz => 100e3,
            Wiring::Mains => 10e3,
        };
        let gates = gates(board)
            .into_iter()
            .map(|(pin, ..)| (pin, Circuit::PullDown(ohm)));
        let encoders = encoders
            .iter()
            .map(|(pin, level)| (*pin, Circuit::Driven(*level)));
        let contacts = contacts(board).map(|pin| (pin, Circuit::Driven(false)));
        Self {
            circuits: gates.chain(encoders).chain(contacts).collect(),
            ..Self::default()
        }
    }

    /// Whether `pin` reads high, where `inside` says what the chip does to each, and `circuit` what is outside those that
    /// have no fixed circuit.
    pub fn reads(
        &self,
        pin: Pin,
        inside: impl Fn(Pin) -> Inside,
        circuit: impl Fn(Pin) -> Option<Circuit>,
    ) -> bool {
        // All pins that are shorted together are one net.
        let mut net = vec![pin];
        let mut looked = 0;
        while let Some(&one) = net.get(looked) {
            looked += 1;
            for pair in &self.bridges {
                for (here, there) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                    if here == one && !net.contains(&there) {
                        net.push(there);
                    }
                }
            }
        }
        // Conductances to the supply, and altogether.
        let (mut up, mut all) = (0.0, 0.0);
        let mut connect = |level: bool, ohm: f64| {
            all += ohm.recip();
            if level {
                up += ohm.recip();
            }
        };
        for pin in net {
            let Inside {
                drives,
                pulls,
                grounds,
            } = inside(pin);
            if let Some(ohm) = grounds {
                connect(false, ohm);
            }
            if let Some(level) = drives {
                connect(level, DRIVEN_OHM);
            }
            if let Some(level) = pulls {
                connect(level, PULL_OHM);
            }
            match self.circuits.get(&pin).copied().or_else(|| circuit(pin)) {
                Some(Circuit::PullDown(ohm)) => connect(false, ohm),
                Some(Circuit::PullUp(ohm)) => connect(true, ohm),
                Some(Circuit::Driven(level)) => connect(level, DRIVEN_OHM),
                None => {}
            }
            if let Some(level) = self.shorts.get(&pin) {
                connect(*level, SHORT_OHM);
            }
        }
        if all > 0.0 {
            up / all > 0.5
        } else {
            self.charges.get(&pin).copied().unwrap_or(false)
        }
    }

    /// `pin` is at `level` from now on, should nothing hold it later.
    pub fn charge(&mut self, pin: Pin, level: bool) {
        self.charges.insert(pin, level);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Pin = (0, 8);
    const B: Pin = (0, 9);

    fn pulled(one: Pin, level: bool) -> impl Fn(Pin) -> Inside {
        move |pin| Inside {
            pulls: Some(if pin == one { level } else { !level }),
            ..Inside::default()
        }
    }

    #[test]
    fn an_open_pin_follows_its_pull_and_a_resistor_of_10_kohm_wins_over_it() {
        let mut outside = Outside::default();
        assert!(outside.reads(A, pulled(A, true), |_| None));
        assert!(!outside.reads(A, pulled(A, false), |_| None));
        outside.circuits.insert(A, Circuit::PullDown(10e3));
        assert!(!outside.reads(A, pulled(A, true), |_| None));
        // A gate driver's own 100 kohm does not.
        outside.circuits.insert(A, Circuit::PullDown(100e3));
        assert!(outside.reads(A, pulled(A, true), |_| None));
    }

    #[test]
    fn a_bridge_shows_where_one_end_is_stronger() {
        let mut outside = Outside::default();
        outside.bridges.push([A, B]);
        outside.circuits.insert(A, Circuit::Driven(true));
        assert!(
            outside.reads(B, pulled(A, true), |_| None),
            "the driven end wins"
        );
        outside.shorts.insert(B, false);
        assert!(!outside.reads(A, pulled(A, true), |_| None));
    }
}
