//! Records of a motor: how it moves, and what its sensors make of it.

use super::kind::Kind;
use super::shaft::{Plate, RATE, SUBSTEPS, Shaft};
use identify::machines::motor::Record;
use identify::records::DataQuality;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

/// How a record moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    /// Steps between several speeds both ways, of a fit record and a check record.
    Fit,
    Check,
    /// Thin records.
    Standstill,
    Creep,
    OneSpeed,
    OneSecond,
    QuarterTurn,
}

/// Those that are thin.
pub(super) const THIN: [Motion; 5] = [
    Motion::Standstill,
    Motion::Creep,
    Motion::OneSpeed,
    Motion::OneSecond,
    Motion::QuarterTurn,
];

impl Motion {
    fn seconds(self) -> f64 {
        match self {
            Motion::OneSecond => 1.0,
            Motion::Fit | Motion::Check => 14.0,
            _ => 8.0,
        }
    }

    /// Speed asked for, rad/s.
    pub(super) fn speed(self, t: f64) -> f64 {
        let steps: &[f64] = match self {
            Motion::Fit => &[10.0, -25.0, 4.0, -12.0, 30.0, -6.0, 18.0, -19.0],
            Motion::Check => &[12.0, -20.0, 5.0, -14.0, 26.0, -5.0, 16.0, -20.0],
            Motion::Standstill => &[0.0],
            Motion::Creep => &[0.2],
            Motion::OneSpeed => &[15.0],
            Motion::OneSecond => &[10.0, -10.0],
            Motion::QuarterTurn => return 1.2 * (1.6 * t).cos(),
        };
        let hold = self.seconds() / steps.len() as f64;
        let at = ((t / hold) as usize).min(steps.len() - 1);
        // A ramp of a tenth of a second from the last speed.
        let before = if at == 0 { 0.0 } else { steps[at - 1] };
        let share = ((t - at as f64 * hold) / 0.1).min(1.0);
        before + share * (steps[at] - before)
    }
}

/// What is recorded of a way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    /// What there is.
    All,
    /// What a machine without the effect shows on the same way.
    Plain,
}

/// The sensor of the current.
struct CurrentSensor {
    kind: Kind,
    coulomb: f64,
    noise: f64,
    /// Size of an error, A.
    size: f64,
    /// Noise of half a second.
    slow: f64,
    late: [f64; 2],
    asked: Vec<f64>,
    reported: Vec<f64>,
}

impl CurrentSensor {
    /// The next row.
    fn read(&mut self, asked: f64, w: f64, normal: &mut impl FnMut() -> f64) {
        let row = self.asked.len();
        let t = row as f64 / RATE;
        self.asked.push(asked);
        self.slow = 0.998 * self.slow + 0.0632 * normal();
        let mut reported = self.shown(asked, w, t);
        let noise = louder(self.kind, asked / self.coulomb, w) * self.noise;
        if self.kind == Kind::RedNoise {
            reported += 3.0 * noise * self.slow;
        }
        reported += noise * normal();
        if self.kind == Kind::CoarseCurrent {
            let coarse = 0.2 * self.coulomb;
            reported = (reported / coarse).round() * coarse;
        }
        self.reported.push(match self.kind {
            Kind::Held if !row.is_multiple_of(4) => self.reported[row - 1],
            Kind::Spikes if row % 500 == 250 => reported + 5.0 * self.size,
            _ => reported,
        });
    }

    /// Without its noise.
    fn shown(&mut self, asked: f64, w: f64, t: f64) -> f64 {
        let Self { size, coulomb, .. } = *self;
        let row = self.asked.len() - 1;
        let before = |rows: usize| self.asked[row.saturating_sub(rows)];
        match self.kind {
            Kind::Delay(by) => before(by),
            Kind::DelayGrows => before(row / 2000),
            Kind::Lag(tau) => self.lagging([tau, 0.0], asked),
            Kind::TwoLags(tau) => self.lagging([tau, tau], asked),
            Kind::GainByDirection => asked * (1.0 + 0.1 * w.signum()),
            Kind::GainBySign => asked * (1.0 + 0.1 * asked.signum()),
            Kind::GainSteps => asked * (1.0 + 0.1 * f64::from(t > 7.0)),
            Kind::OffsetSteps => asked + size * f64::from(t > 7.0),
            Kind::OffsetByDirection => asked + size * w.signum(),
            Kind::Drift => asked + size * (t / 14.0).powi(2),
            Kind::Curved => asked * (1.0 - 0.05 * (asked / coulomb).powi(2)),
            Kind::DeadBand if asked.abs() < 0.5 * coulomb => 0.0,
            Kind::Saturated => asked.clamp(-1.2 * coulomb, 1.2 * coulomb),
            Kind::SlowNoise => asked + 0.5 * size * self.slow,
            Kind::HumOfCurrent(hz) => asked + 0.5 * size * (TAU * hz * t).cos(),
            _ => asked,
        }
    }

    /// Behind two low-passes, s.
    fn lagging(&mut self, times_s: [f64; 2], asked: f64) -> f64 {
        let mut input = asked;
        for (late, tau) in self.late.iter_mut().zip(times_s) {
            *late += (input - *late) * (1.0 - (-1.0 / (RATE * tau)).exp());
            input = *late;
        }
        input
    }
}

/// How much louder the noise is than at rest. It is noise all the same.
fn louder(kind: Kind, current: f64, w: f64) -> f64 {
    match kind {
        Kind::NoiseByCurrent => 1.0 + 3.0 * current.abs(),
        Kind::NoiseBySpeed => 1.0 + 0.2 * w.abs(),
        _ => 1.0,
    }
}

/// The angle as an encoder has it in a row, rad.
fn seen_angle(shaft: &Shaft, kind: Kind, row: usize, before: f64) -> f64 {
    let theta = shaft.theta;
    match kind {
        Kind::Eccentric => theta + 0.02 * theta.sin(),
        Kind::EncoderOrder(order, size) => theta + size * (order * theta).sin(),
        Kind::EncoderGain => 1.01 * theta,
        Kind::EncoderHysteresis => theta - 0.01 * shaft.w.signum(),
        Kind::EncoderHeld if !row.is_multiple_of(2) => before,
        // It counts one step in 500 too many on its way forth.
        Kind::EncoderSlips => theta + 0.002 * theta.max(0.0),
        Kind::AngleSpikes if row % 1000 == 500 => theta + 0.5,
        _ => theta,
    }
}

/// What rows that a logger loses or repeats make of a column.
fn logged(kind: Kind, column: Vec<f64>) -> Vec<f64> {
    let is_odd = |row: usize| row % 100 == 50;
    let rows = column.iter().enumerate();
    match kind {
        Kind::RowsLost => rows
            .filter(|(row, _)| !is_odd(*row))
            .map(|(_, value)| *value)
            .collect(),
        Kind::RowsTwice => rows
            .flat_map(|(row, value)| vec![*value; 1 + usize::from(is_odd(row))])
            .collect(),
        _ => column,
    }
}

/// Records one motor.
pub(super) fn record(seed: u64, motion: Motion, kind: Kind, strength: f64, what: Seen) -> Record {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut plain = Plate::drawn(&mut random);
    let is_check = motion == Motion::Check;
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5eed ^ motion as u64);
    let mut normal = move || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    match kind {
        Kind::CoarseEncoder => plain.counts = 500.0,
        Kind::NoNoise => plain.noise = 1e-7,
        Kind::NoisyCheck if is_check => plain.noise *= 10.0,
        _ => {}
    }
    let mut plate = plain;
    if kind == Kind::OtherMachine && is_check {
        plate.inertia *= 1.5;
        plate.coulomb *= 1.0 + 2.0 * strength;
    }
    if kind == Kind::NoisyFit && !is_check {
        plate.noise *= 10.0;
    }
    let size = strength * plate.coulomb;
    let count = TAU / plate.counts;
    let mut shaft = Shaft::new(kind, [plate, plain], size, is_check);
    let mut sensor = CurrentSensor {
        kind,
        coulomb: plate.coulomb,
        noise: plate.noise,
        size,
        slow: 0.0,
        late: [0.0; 2],
        asked: Vec::new(),
        reported: Vec::new(),
    };
    let mut position = Vec::new();
    let mut plain_current = Vec::new();
    let rows = (motion.seconds() * RATE) as usize;
    for row in 0..rows {
        let t = row as f64 / RATE;
        let asked = shaft.asked(motion.speed(t), normal());
        // A clock that jitters reads the angle in one of the row's steps.
        let read_at = match (kind, what) {
            (Kind::ClockJitter, Seen::All) => (row * 7919) % SUBSTEPS,
            _ => SUBSTEPS - 1,
        };
        let mut angle = 0.0;
        for step in 0..SUBSTEPS {
            shaft.step(asked, t);
            if step == read_at {
                let before = position.last().copied().unwrap_or(0.0);
                angle = match what {
                    Seen::All => seen_angle(&shaft, kind, row, before),
                    Seen::Plain => shaft.theta,
                };
            }
        }
        match what {
            Seen::All => sensor.read(asked, shaft.w, &mut normal),
            Seen::Plain => {
                let noise = louder(kind, asked / plate.coulomb, shaft.w) * plain.noise;
                plain_current.push(shaft.plain_current + noise * normal());
            }
        }
        if kind == Kind::EncoderNoise {
            angle += 3.0 * count * normal();
        }
        position.push((angle / count).round() * count);
    }
    if what == Seen::Plain {
        return of(RATE, position, plain_current);
    }
    if kind == Kind::Missed {
        // The encoder loses counts: the angle jumps.
        let from = rows / 2;
        position[from..].iter_mut().for_each(|angle| *angle += 0.15);
    }
    let rate = match kind {
        Kind::ClockWrong => 1.01 * RATE,
        _ => RATE,
    };
    of(rate, logged(kind, position), logged(kind, sensor.reported))
}

/// Looked at as the reader of a file does.
fn of(rate: f64, position: Vec<f64>, current: Vec<f64>) -> Record {
    let time: Vec<f64> = (0..position.len()).map(|row| row as f64 / rate).collect();
    let mut account = DataQuality::default();
    account.note_spikes("position_rad", &time, &position);
    account.note_spikes("current_a", &time, &current);
    Record {
        rate,
        position,
        current,
        account,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simulated_motor_follows_its_speed() {
        let own = record(3, Motion::Fit, Kind::Clean, 0.3, Seen::All);
        let rows = own.position.len();
        assert_eq!(rows, 14_000);
        let turned = own.position[rows - 1] - own.position[rows - 500];
        assert!(
            (turned / 0.499 / Motion::Fit.speed(13.9) - 1.0).abs() < 0.05,
            "{turned} rad"
        );
        assert!(own.current.iter().all(|current| current.abs() < 60.0));
    }
}
