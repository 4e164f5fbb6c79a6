//! What a measurement of a loop gives: the response to a step and the open loop, beside those of the model.

use crate::tune::Crossing;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A loop's response to a step, measured and predicted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LoopResponse {
    /// What steps: `A` of the current along d, `rpm` of a motor's speed.
    pub unit: String,
    /// From this value, in that unit.
    pub from: f64,
    /// To this one.
    pub to: f64,
    /// Steps that were averaged.
    pub steps: usize,
    /// Since the reference's step, s.
    pub time_s: Vec<f64>,
    /// Of the step.
    pub measured: Vec<f64>,
    /// The same of the model with the settings that hold.
    pub predicted: Vec<f64>,
    /// Frequencies of the open loop, Hz.
    pub hz: Vec<f64>,
    /// Its gain, dB.
    pub gain_db: Vec<f64>,
    /// Its phase, degrees, -360 to 0.
    pub phase_deg: Vec<f64>,
    /// The same of the model.
    pub predicted_gain_db: Vec<f64>,
    /// The same of the model.
    pub predicted_phase_deg: Vec<f64>,
    /// Bandwidth and phase margin; `None` if the gain of 1 is not among the frequencies.
    pub crossing: Option<Crossing>,
    /// The same of the model, at any frequency. That of a current loop is sampled, as the drive is: a loop taken as continuous is a few percent faster.
    pub predicted_crossing: Option<Crossing>,
}

impl LoopResponse {
    /// A step's response and the open loop, each measured and of the model, with the model's crossing. The frequencies are the measured
    /// ones, among which the model's crossing need not be.
    pub(crate) fn beside(
        measured: Vec<f64>,
        predicted: Vec<f64>,
        found: OpenLoop,
        model: OpenLoop,
        predicted_crossing: Option<Crossing>,
    ) -> Self {
        Self {
            measured,
            predicted,
            crossing: found.crossing(),
            predicted_crossing,
            hz: found.hz,
            gain_db: found.gain_db,
            phase_deg: found.phase_deg,
            predicted_gain_db: model.gain_db,
            predicted_phase_deg: model.phase_deg,
            ..Self::default()
        }
    }
}

/// An open loop at some frequencies.
#[derive(Default)]
pub(crate) struct OpenLoop {
    hz: Vec<f64>,
    gain_db: Vec<f64>,
    phase_deg: Vec<f64>,
}

impl OpenLoop {
    /// Its value at a frequency above the earlier ones.
    pub(crate) fn add(&mut self, hz: f64, value: Complex<f64>) {
        self.hz.push(hz);
        self.gain_db.push(20.0 * value.norm().log10());
        // -360 to 0 degrees.
        self.phase_deg.push((-value).arg().to_degrees() - 180.0);
    }

    /// No frequency was clear.
    pub(crate) fn is_empty(&self) -> bool {
        self.hz.is_empty()
    }

    /// Where the gain last falls through 1.
    pub(crate) fn crossing(&self) -> Option<Crossing> {
        let falls = |two: &[f64]| two[0] > 0.0 && two[1] <= 0.0;
        let k = self.gain_db.windows(2).rposition(falls)?;
        let part = self.gain_db[k] / (self.gain_db[k] - self.gain_db[k + 1]);
        let between = |of: &[f64]| of[k] + part * (of[k + 1] - of[k]);
        Some(Crossing {
            bandwidth_rad_s: TAU * between(&self.hz),
            margin_deg: 180.0 + between(&self.phase_deg),
        })
    }
}

/// So many frequencies and one, evenly on a logarithmic scale.
pub(crate) fn frequencies([low, high]: [f64; 2], points: u32) -> impl Iterator<Item = f64> {
    (0..=points).map(move |k| low * (high / low).powf(f64::from(k) / f64::from(points)))
}

/// The Fourier transform of samples at `turned` rad a sample.
pub(crate) fn spectrum(values: impl Iterator<Item = f64>, turned: f64) -> Complex<f64> {
    values
        .enumerate()
        .map(|(n, value)| Complex::cis(-turned * n as f64) * value)
        .sum()
}
