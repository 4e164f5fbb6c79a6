//! What others do against ripple, on the same drive: each adds a current to what the PI of the paper asks.
//!
//! Each is what its source describes, at the rate of the speed task, in floats: no word size stands in its way. Where a source
//! leaves a number open it is the best of those tried at 0, 300 and 800 rpm of the nut, for the three together: gains of 0.1,
//! 0.3 and 1, smoothing of 1 to 10 ms, leads of 3 to 8 ms, forgetting of 5 and 20 %.

use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use hal_sim::seam::{Seam, SpeedSeen};
use plant::Axis;
use std::f64::consts::TAU;

/// A way to remove ripple.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rival {
    /// The PI of the paper alone.
    Pi,
    /// The current that balances cogging and friction at each angle, measured once at a crawl and fed forward at any speed:
    /// the anticogging map of hobby drives (ODrive's `anticogging`).
    StaticMap,
    /// Proportional-integral-resonant: resonators beside the PI at the ripple's orders, without a lead for the loops' phase (Xia,
    /// Ji and Yan, IEEE Trans. Industrial Electronics 62, 2015). From memory: not compared with its text.
    Pir,
    /// Iterative learning by the turn with a forgetting factor, P-type (Qian, Panda and Xu, IEEE Trans. Energy Conversion 20,
    /// 2005). Not compared with that text; P-type learning of a motor's speed ripple is described in Algorithms 11(10), 152,
    /// 2018, [doi:10.3390/a11100152](https://doi.org/10.3390/a11100152).
    Ilc,
    /// Repetitive control: the last turn's current, smoothed, plus the last turn's error some samples ahead (Inoue 1990; the
    /// plug-in form). From memory: not compared with its text.
    Repetitive,
}

impl Rival {
    /// All, in the order of a report.
    pub const ALL: [Self; 5] = [
        Self::Pi,
        Self::StaticMap,
        Self::Pir,
        Self::Ilc,
        Self::Repetitive,
    ];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "pi",
            Self::StaticMap => "static map",
            Self::Pir => "pir",
            Self::Ilc => "ilc",
            Self::Repetitive => "repetitive",
        }
    }
}

/// Cells of a map over a turn: more than eight for the fastest ripple, 60 a turn.
const CELLS: usize = 512;
/// Speed at which a static map is measured, rpm, and its turns.
const CRAWL_RPM: f64 = 6.0;
const CRAWL_TURNS: f64 = 2.0;

/// What a learner by the turn leaves open.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    /// Part of the error that is taken: of the speed loop's gain, or of the error itself.
    gain: f64,
    /// Part that is forgotten in a turn.
    forgets: f64,
    /// Half width of its smoothing, s.
    smooth_s: f64,
    /// How far ahead it takes the error, s.
    lead_s: f64,
}

/// Of the iterative learner.
const ILC: Numbers = Numbers {
    gain: 0.3,
    forgets: 0.05,
    smooth_s: 6e-3,
    lead_s: 0.0,
};
/// Of the repetitive one.
const REPETITIVE: Numbers = Numbers {
    gain: 0.3,
    forgets: 0.0,
    smooth_s: 6e-3,
    lead_s: 3e-3,
};
/// Rate of a resonator, rad/s, and its width.
const PIR_RATE: f64 = 6.0;
const PIR_WIDTH: f64 = 0.1;
/// The fastest ripple that a resonator without a lead is used for, rad/s: past the speed loop's crossover the loops lag by more
/// than a quarter turn.
const PIR_FASTEST: f64 = 300.0;

/// One motor's.
#[derive(Clone, Debug)]
struct Motor {
    map: Vec<f64>,
    cell: usize,
    /// Sum and number of the present cell's errors.
    sum: (f64, f64),
    /// Resonators: cosine's and sine's part.
    resonators: Vec<(f64, [f64; 2])>,
    gain: f64,
    integral_gain: f64,
    integral: f64,
}

/// A rival on both motors.
#[derive(Clone, Debug)]
pub struct Compensator {
    rival: Rival,
    step_s: f64,
    /// Electrical turns a mechanical turn.
    pole_pairs: f64,
    numbers: Numbers,
    motors: [Motor; 2],
    /// Measures a map instead of using it.
    measures: bool,
    counts: Vec<[f64; 2]>,
}

impl Compensator {
    /// One that has learned nothing, but for a static map, which is measured on a drive of its own.
    ///
    /// # Errors
    /// [`ExperimentError`] if that drive cannot be configured or does not crawl.
    pub fn new(rival: Rival, setup: &Setup) -> Result<Self, ExperimentError> {
        let orders = super::torque_orders(setup.model.screw.pole_pairs);
        let plate = setup.plate();
        let gains = plate.motors.map(|motor| motor.gains(&plate.tuning));
        let mut this = Self {
            rival,
            step_s: plate.speed_step(),
            pole_pairs: f64::from(setup.model.screw.pole_pairs),
            numbers: if rival == Rival::Ilc { ILC } else { REPETITIVE },
            motors: gains.map(|gains| Motor {
                map: vec![0.0; CELLS],
                cell: 0,
                sum: (0.0, 0.0),
                resonators: orders.iter().map(|&order| (order, [0.0; 2])).collect(),
                gain: gains.k_pw,
                integral_gain: gains.k_iw,
                integral: 0.0,
            }),
            measures: false,
            counts: Vec::new(),
        };
        if rival == Rival::StaticMap {
            this.crawl(setup)?;
        }
        Ok(this)
    }

    /// Both motors turn at a crawl, the table stands; the mean of what each cell takes is its map.
    fn crawl(&mut self, setup: &Setup) -> Result<(), ExperimentError> {
        let mut drive: Drive = setup.drive()?;
        let point = OperatingPoint {
            velocity: 0.0,
            base: CRAWL_RPM * RPM,
        };
        super::settle(&mut drive, point, self)?;
        self.measures = true;
        self.counts = vec![[0.0; 2]; CELLS];
        let periods = CRAWL_TURNS * 60.0 / CRAWL_RPM / drive.board.config().pwm_period_s();
        for _ in 0..periods as u64 {
            drive.period_through(self);
        }
        self.measures = false;
        for (k, motor) in self.motors.iter_mut().enumerate() {
            for (cell, count) in motor.map.iter_mut().zip(&self.counts) {
                *cell /= count[k].max(1.0);
            }
            let mean = motor.map.iter().sum::<f64>() / CELLS as f64;
            motor.map.iter_mut().for_each(|cell| *cell -= mean);
        }
        Ok(())
    }
}

impl Motor {
    /// The map at a part of the turn, on a straight line between its cells' middles.
    fn at(&self, turn: f64) -> f64 {
        let place = turn * CELLS as f64 - 0.5;
        let below = place.floor();
        let part = place - below;
        let cell = |k: f64| self.map[(k as i64).rem_euclid(CELLS as i64) as usize];
        cell(below) * (1.0 - part) + cell(below + 1.0) * part
    }

    /// Calls `each` for the cells that the shaft has left, with the mean error while it was there; a fast shaft passes several
    /// in a step, and they share it.
    fn leave(&mut self, seen: &SpeedSeen, each: impl Fn(&mut [f64], usize, f64)) {
        let now = (seen.turn * CELLS as f64) as usize % CELLS;
        if now == self.cell {
            self.sum = (self.sum.0 + seen.error, self.sum.1 + 1.0);
            return;
        }
        let mean = self.sum.0 / self.sum.1.max(1.0);
        let on = if seen.omega_e >= 0.0 { 1 } else { CELLS - 1 };
        let mut cell = self.cell;
        while cell != now {
            each(&mut self.map, cell, mean);
            cell = (cell + on) % CELLS;
        }
        (self.cell, self.sum) = (now, (seen.error, 1.0));
    }
}

impl Seam for Compensator {
    fn current(&mut self, axis: Axis, seen: &SpeedSeen) -> Option<f64> {
        let k = axis.index();
        let motor = &mut self.motors[k];
        if self.measures {
            let cell = (seen.turn * CELLS as f64) as usize % CELLS;
            motor.map[cell] += seen.i_q;
            self.counts[cell][k] += 1.0;
            return None;
        }
        match self.rival {
            Rival::Pi => None,
            Rival::StaticMap => Some(motor.at(seen.turn)),
            Rival::Pir => {
                let mut sum = 0.0;
                for (order, [cos_part, sin_part]) in &mut motor.resonators {
                    let speed = seen.omega_e.abs() * *order / self.pole_pairs;
                    if speed > PIR_FASTEST {
                        continue;
                    }
                    let (sin, cos) = (TAU * *order * seen.turn).sin_cos();
                    let rate = PIR_RATE * motor.gain * 2.0 * self.step_s;
                    let kept = 1.0 - PIR_WIDTH * self.step_s;
                    *cos_part = kept * *cos_part + rate * seen.error * cos;
                    *sin_part = kept * *sin_part + rate * seen.error * sin;
                    sum += *cos_part * cos + *sin_part * sin;
                }
                Some(sum)
            }
            Rival::Ilc => {
                let gain = self.numbers.gain * motor.gain;
                let width = cells_in(self.numbers.smooth_s, seen, self.pole_pairs);
                let forgets = self.numbers.forgets;
                motor.leave(seen, |map, cell, error| {
                    map[cell] = (1.0 - forgets) * smoothed(map, cell, width) + gain * error;
                });
                Some(motor.at(seen.turn))
            }
            Rival::Repetitive => {
                let gain = self.numbers.gain;
                // The error that comes of a cell's current shows a while after it: a cell behind is due.
                let behind = cells_in(self.numbers.lead_s, seen, self.pole_pairs).round() as i64;
                let width = cells_in(self.numbers.smooth_s, seen, self.pole_pairs);
                motor.leave(seen, |map, cell, error| {
                    let due = (cell as i64 - behind).rem_euclid(CELLS as i64) as usize;
                    map[due] = smoothed(map, due, width) + gain * error;
                });
                // It is added to the speed error, and so goes through the PI.
                let more = motor.at(seen.turn);
                motor.integral += motor.integral_gain * self.step_s * more;
                Some(motor.gain * more + motor.integral)
            }
        }
    }
}

/// Cells that the shaft passes in `seconds`.
fn cells_in(seconds: f64, seen: &SpeedSeen, pole_pairs: f64) -> f64 {
    seen.omega_e.abs() / pole_pairs / TAU * seconds * CELLS as f64
}

/// The mean of a map within `width` cells of one, weighted by a triangle: no phase.
fn smoothed(map: &[f64], cell: usize, width: f64) -> f64 {
    let (mut sum, mut weights) = (map[cell], 1.0);
    let mut away = 1;
    while (away as f64) < width && away < CELLS / 2 {
        let weight = 1.0 - away as f64 / width;
        sum += weight * (map[(cell + away) % CELLS] + map[(cell + CELLS - away) % CELLS]);
        weights += 2.0 * weight;
        away += 1;
    }
    sum / weights
}
