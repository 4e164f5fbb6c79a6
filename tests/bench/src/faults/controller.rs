//! The controller chip where its clock or its supply is not what it should be. What the chip does then without an instruction of the
//! drive is in its manual, as `firmware/src/hw/clock.rs` cites it, and the emulated chip's tests hold the firmware to it
//! (`tests/tests/chip/supply.rs`):
//!
//! | what | by | here |
//! | --- | --- | --- |
//! | crystal stops | clock security system | both bridges open at once; the NMI resets; no start without a crystal |
//! | crystal fast or slow | nothing: what a bring-up lets pass | all times by that factor |
//! | supply below 2.9 V | voltage detector on the timers' break | both bridges open at once and are held open; fault `ControllerSupply` |
//! | supply below 2.8 V | brown-out reset | all pins released; a new start above 2.9 V (datasheet, level 4 rising; memory) |
//! | reset by its pin, a debugger, a stored setting, a watchdog | the same, for a millisecond or, while it is flashed, for good | all pins released; a new start |
//! | supply low and above that | the firmware, by the chip's internal reference: `control::controller_supply` | it is the ADC's reference, and what does not go with it reads more, until both motors have stopped |
//!
//! A clock that stands inside the chip behind a crystal that runs is not modelled: the watchdog's own clock ends that.

use super::cell::{Defect, Input};
use super::spoiled::{Reading, Spoiled};
use hal_sim::board::SUPPLY_V;

/// What breaks and resets, V.
const BREAK_V: f64 = 2.9;
const RESET_V: f64 = 2.8;
/// A supply that is low, V: stuck between the two, or offset by so much to above both.
const LOW_V: f64 = 2.85;
const OFFSET_V: f64 = -0.35;
/// Standard deviation of its noise: 3 % of it, as of the other inputs.
const NOISE_V: f64 = 0.03 * SUPPLY_V;
/// How long a reset is held that is no flashing, s: the chip holds its own pin for 20 us at least (datasheet; memory).
const PULSE_S: f64 = 1e-3;
/// How long it is gone where it dips, s, and how fast it falls, V/s.
const DIP_S: f64 = 20e-3;
const FALLS_V_S: f64 = 1.0;
/// How much a crystal is off: what the bring-up's look at it against HSI16 lets pass (`xtask/src/bringup/clock.rs`).
const CLOCK_OFF: f64 = 0.015;
/// From a reset to the first period, s: the start copies its data and code at the internal clock.
const START_S: f64 = 8e-3;

/// What the chip does in a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Doing {
    /// It is in reset, or starts.
    Stands,
    /// It runs, its clock slow by a factor, its supply as a part of the nominal.
    Runs {
        slow: f64,
        supply: f64,
        change: Option<Change>,
    },
}

/// What else becomes of a chip that runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// Its code begins again.
    Starts,
    /// Both bridges are held open.
    Breaks,
}

/// State of the chip.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controller {
    /// It stands, and is started in so many seconds after supply and clock are there.
    starts_s: Option<f64>,
    /// How long the supply has been wrong, s.
    wrong_s: f64,
}

impl Controller {
    /// It was reset and has not started yet.
    pub(super) const fn stands(&self) -> bool {
        self.starts_s.is_some()
    }

    /// A period of so many seconds.
    pub(super) fn period(&mut self, spoiled: &mut [Spoiled], seconds: f64) -> Doing {
        let (mut supply_v, mut slow, mut crystal) = (SUPPLY_V, 1.0, true);
        let (mut wrong, mut reset) = (false, false);
        for one in spoiled.iter_mut().filter(|one| one.on) {
            match (one.input, one.defect) {
                (Input::Clock, Defect::Missing) => crystal = false,
                (Input::Clock, Defect::Offset) => slow = 1.0 - CLOCK_OFF,
                (Input::Clock, Defect::Late) => slow = 1.0 + CLOCK_OFF,
                (Input::Clock, _) => slow = 1.0 + CLOCK_OFF * one.random(),
                (Input::Reset, defect) => {
                    wrong = true;
                    reset |= defect != Defect::Dips || self.wrong_s < PULSE_S;
                }
                (Input::Supply, defect) => {
                    wrong = true;
                    supply_v = match defect {
                        Defect::Dips if self.wrong_s < DIP_S => 0.0,
                        Defect::Falls => SUPPLY_V - FALLS_V_S * self.wrong_s,
                        _ => one.read(Reading {
                            now: SUPPLY_V,
                            missing: 0.0,
                            span: [LOW_V, SUPPLY_V],
                            offset: OFFSET_V,
                            sigma: NOISE_V,
                            late: 0,
                            neighbour: SUPPLY_V,
                        }),
                    };
                }
                _ => {}
            }
        }
        self.wrong_s = if wrong { self.wrong_s + seconds } else { 0.0 };
        if !crystal || reset || supply_v < RESET_V {
            self.starts_s = Some(START_S);
            return Doing::Stands;
        }
        let mut change = (supply_v < BREAK_V).then_some(Change::Breaks);
        if let Some(left) = &mut self.starts_s {
            if supply_v >= BREAK_V {
                *left -= seconds;
            }
            if *left > 0.0 {
                return Doing::Stands;
            }
            self.starts_s = None;
            change = Some(Change::Starts);
        }
        Doing::Runs {
            slow,
            supply: supply_v / SUPPLY_V,
            change,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// And not with the one that it was reset by, with which the bus would read too much.
    #[test]
    fn a_chip_starts_with_the_supply_of_then() {
        const PERIOD_S: f64 = 50e-6;
        let mut controller = Controller::default();
        let mut falls = Spoiled::new(Input::Supply, Defect::Falls, 1);
        falls.on = true;
        let mut spoiled = [falls];
        let reset = (0..20_000).any(|_| controller.period(&mut spoiled, PERIOD_S) == Doing::Stands);
        assert!(reset && controller.stands());
        let starts = (0..20_000)
            .map(|_| controller.period(&mut [], PERIOD_S))
            .find(|doing| *doing != Doing::Stands);
        let expected = Doing::Runs {
            slow: 1.0,
            supply: 1.0,
            change: Some(Change::Starts),
        };
        assert_eq!(starts, Some(expected));
    }
}
