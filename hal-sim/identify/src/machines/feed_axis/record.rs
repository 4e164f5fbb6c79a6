//! The record of an axis.

use crate::machines::motor;
use crate::records::{DataQuality, How, LoadError, Mapping, Record as Loaded, load};
use crate::signal::filter::butterworth_100;
use crate::signal::fourier::slope;
use std::f64::consts::TAU;
use std::path::Path;

/// How a controller takes dq/dt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// As it is: the loop is closed without delay, reference and pulses are straight lines between rows.
    Ideal,
    /// As the difference over so many of its last periods, once a row.
    Difference(usize),
}

/// One record.
#[derive(Debug, Clone)]
pub struct Record {
    /// Rows a second.
    pub rate: f64,
    /// Measured position of the carriage, m.
    pub position: Vec<f64>,
    /// Reference position, m.
    pub reference: Vec<f64>,
    /// The controller's output, V.
    pub output: Vec<f64>,
    /// Voltage added to the controller's, V.
    pub pulses: Vec<f64>,
    /// Force per volt, N/V.
    pub force_per_volt: f64,
    /// Gain of the position loop, 1/s.
    pub kp: f64,
    /// Gain of the velocity loop, V s/m.
    pub kv: f64,
    /// What became of the file's rows.
    pub account: DataQuality,
}

/// An axis' record as that of a motor: the angle of the screw, rad, and the force, N, in the place of the current. `None`
/// where no force is known.
pub(crate) fn balance_record(loaded: Loaded, lead_m: f64) -> Option<motor::Record> {
    let mut loaded = loaded.longest();
    let position = loaded.take("position_m").into_iter();
    let per_volt = loaded
        .constant("force_per_volt_n")
        .filter(|gain| gain.is_finite());
    let force = match (loaded.take("force_n"), per_volt) {
        (force, _) if !force.is_empty() => force,
        (_, Some(gain)) => loaded
            .take("output_v")
            .into_iter()
            .map(|v| v * gain)
            .collect(),
        _ => return None,
    };
    let position: Vec<f64> = position.map(|x| TAU * x / lead_m).collect();
    (force.len() == position.len() && !force.is_empty()).then_some(motor::Record {
        rate: loaded.rate,
        position,
        current: force,
        account: loaded.quality,
    })
}

impl Record {
    /// Whether the log tells the control law, so that the loop can be simulated: output, reference, gains.
    pub(crate) fn has_law(loaded: &Loaded) -> bool {
        let constants = ["force_per_volt_n", "kp_per_s", "kv_v_s_per_m"];
        let known = |name: &&str| loaded.constant(name).is_some_and(f64::is_finite);
        constants.iter().all(known)
            && loaded.get("output_v").is_some()
            && loaded.get("reference_m").is_some()
    }

    /// Reads a file of the benchmark.
    ///
    /// # Errors
    /// As [`load`].
    pub fn emps(path: &Path) -> Result<Self, LoadError> {
        let mapping = Mapping::parse(include_str!("../../../mappings/emps.toml"), "emps.toml")?;
        let how = How {
            mapping: &mapping,
            on_fault: Default::default(),
            declared_hz: None,
        };
        Ok(Self::new(load(path, how, &mut |_| ())?))
    }

    /// A reference, m, to be followed by a loop like the benchmark's: nothing measured yet. [`super::Axis::simulate`] says what an
    /// axis makes of it.
    #[must_use]
    pub fn to_follow(reference: Vec<f64>, rate: f64) -> Self {
        let nothing = vec![0.0; reference.len()];
        Record {
            rate,
            position: nothing.clone(),
            output: nothing.clone(),
            pulses: nothing,
            reference,
            force_per_volt: 35.0,
            kp: 160.0,
            kv: 240.0,
            account: DataQuality::default(),
        }
    }

    /// Of columns that were loaded.
    pub fn new(loaded: Loaded) -> Self {
        let mut loaded = loaded.longest();
        let rows = loaded.len();
        let or_zero = |values: Vec<f64>| match values.is_empty() {
            true => vec![0.0; rows],
            false => values,
        };
        let constant = |loaded: &Loaded, name| loaded.constant(name).unwrap_or(f64::NAN);
        Record {
            rate: loaded.rate,
            position: loaded.take("position_m"),
            reference: or_zero(loaded.take("reference_m")),
            output: loaded.take("output_v"),
            pulses: or_zero(loaded.take("pulses_v")),
            force_per_volt: constant(&loaded, "force_per_volt_n"),
            kp: constant(&loaded, "kp_per_s"),
            kv: constant(&loaded, "kv_v_s_per_m"),
            account: loaded.quality,
        }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Where the travel begins, and how long it is, m.
    pub(super) fn travelled(&self) -> (f64, f64) {
        let ends = |(low, high): (f64, f64), x: &f64| (low.min(*x), high.max(*x));
        let (low, high) = self.position.iter().fold((f64::MAX, f64::MIN), ends);
        (low, (high - low).max(0.0))
    }

    /// Greatest speed that is asked for, m/s.
    pub(super) fn top_speed(&self) -> f64 {
        let reference = butterworth_100(&self.reference, self.rate);
        let speeds = slope(&reference, self.rate).into_iter();
        speeds.fold(0.0, |most, v| v.abs().max(most))
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// The first rows of it.
    pub(super) fn first(&self, rows: usize) -> Self {
        let cut = |column: &[f64]| column[..rows.min(column.len())].to_vec();
        Record {
            position: cut(&self.position),
            reference: cut(&self.reference),
            output: cut(&self.output),
            pulses: cut(&self.pulses),
            account: self.account.clone(),
            ..*self
        }
    }

    /// Motor force, N.
    pub fn force(&self) -> Vec<f64> {
        self.output
            .iter()
            .map(|v| v * self.force_per_volt)
            .collect()
    }

    /// Reference a share of a period after row `k`, m.
    pub(super) fn reference_at(&self, k: usize, share: f64) -> f64 {
        between(&self.reference, k, share)
    }

    /// Pulses a share of a period after row `k`, V.
    pub(super) fn pulses_at(&self, k: usize, share: f64) -> f64 {
        between(&self.pulses, k, share)
    }

    /// What of the output, below 100 Hz, its law leaves, as a share of its rms.
    pub(crate) fn law_leaves(&self) -> f64 {
        let (law, _) = self.law();
        let asked: Vec<f64> = (0..self.len())
            .map(|k| self.output[k] - self.pulses[k])
            .collect();
        let left: Vec<f64> = (0..self.len())
            .map(|k| asked[k] - self.by_law(law, k))
            .collect();
        let rms = |values: &[f64]| {
            let filtered = butterworth_100(values, self.rate);
            let mean = filtered.iter().sum::<f64>() / filtered.len().max(1) as f64;
            let squares = filtered.iter().map(|value| (value - mean).powi(2));
            squares.sum::<f64>().sqrt()
        };
        rms(&left) / rms(&asked)
    }

    /// The output by its law in a row, V.
    fn by_law(&self, law: Law, k: usize) -> f64 {
        let periods = match law {
            Law::Ideal => 1,
            Law::Difference(periods) => periods,
        };
        let before = self.position[k.saturating_sub(periods)];
        let speed = (self.position[k] - before) * self.rate / periods as f64;
        self.kv * (self.kp * (self.reference[k] - self.position[k]) - speed)
    }

    /// How the controller differentiated: over how many periods its output follows its law best, and the rms of the
    /// residual, V.
    pub fn law(&self) -> (Law, f64) {
        let left = |periods: usize| {
            let rows = 10..self.len();
            let count = rows.len().max(1) as f64;
            let square = rows
                .map(|k| {
                    let law = self.by_law(Law::Difference(periods), k);
                    (self.output[k] - self.pulses[k] - law).powi(2)
                })
                .sum::<f64>();
            (square / count).sqrt()
        };
        (1..=8)
            .map(|periods| (Law::Difference(periods), left(periods)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((Law::Ideal, f64::NAN))
    }
}

fn between(values: &[f64], k: usize, share: f64) -> f64 {
    let next = values.get(k + 1).copied().unwrap_or(values[k]);
    values[k] + share * (next - values[k])
}
