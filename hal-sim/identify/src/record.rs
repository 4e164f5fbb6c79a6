//! A record made ready: transforms, signals, balances and noise under a model.

use crate::balance::{Assumed, Balance, Contribution};
use crate::effects::parameter::Parameter;
use crate::machines::{DoubleDrive, Machine};
use crate::regression::design::{Whitener, operating_points};
use crate::regression::normal::Normal;
use crate::signal::fourier::Fourier;
use crate::signal::noise::declared_resonance_hz;
use crate::signal::signals::Signals;
use crate::signal::signals::coarsest;
use plant::effects::{AnyEffect, EffectModel};
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::{PI, TAU};

/// Rate at which balances are compared, Hz: twice what the sensors leave of an acceleration.
const BALANCE_RATE_HZ: f64 = 1250.0;
/// Zeros behind a record, s.
const PAD_S: f64 = 0.4;
/// A record and its transforms.
pub struct Record {
    /// Transforms of its length.
    pub fourier: Fourier,
    /// Its signals.
    pub signals: Signals,
}

impl Record {
    /// Of a recording of the machine `model`.
    pub fn new(recording: &Recording, model: &Model) -> Self {
        Self::of(recording, model, &DoubleDrive)
    }

    /// Of a recording of a machine of any kind.
    pub fn of(recording: &Recording, model: &Model, machine: &'static dyn Machine) -> Self {
        let rate = model.sensing.sample_hz;
        let step = ((rate / BALANCE_RATE_HZ) as usize).max(1);
        let fourier = Fourier::new(recording.len(), rate, step, (PAD_S * rate) as usize);
        let signals = Signals::new(recording, model, &fourier, machine);
        Record { fourier, signals }
    }

    /// The balances under a model and what is assumed beside it.
    pub(crate) fn balance_with<'a>(&'a self, model: &'a Model, assumed: Assumed) -> Balance<'a> {
        Balance::new(model, &self.signals, &self.fourier, assumed)
    }
}

/// Contributions of the declared model and its parameters, before whitening.
pub struct Base {
    /// Residual of the declared model.
    pub residual: Contribution,
    /// Each parameter with what it adds.
    pub parameters: Vec<(Parameter, Contribution)>,
}

impl Base {
    /// Of the balances.
    pub fn new(balance: &Balance) -> Self {
        let machine = balance.signals.machine;
        let feed = machine.has_feed();
        let counts = coarsest(&balance.model.sensing);
        let count_m = balance.lead.abs() * TAU / f64::from(counts);
        let rounding = rests(balance.signals).into_iter().flat_map(|(from, to)| {
            [
                Parameter::RestOffset { from, to, count_m },
                Parameter::RestDrift { from, to, count_m },
            ]
        });
        let origin = feed.then(|| Parameter::TableOrigin {
            within: origin_within(balance),
        });
        let ends = machine.axes().iter().flat_map(|&axis| {
            [0, balance.signals.len() - 1].map(|row| Parameter::EndSpeed { axis, row })
        });
        let measured = balance.model.measured.filter(|_| feed);
        let table = measured.and_then(|measured| measured.feed);
        let table = table.map(|table| Parameter::TableMass {
            within: table.table_mass,
        });
        Base {
            residual: balance.residual(),
            parameters: machine
                .parameters()
                .into_iter()
                .chain(table)
                .chain(origin)
                .chain(ends)
                .chain(rounding.filter(|_| feed))
                .map(|p| (p, balance.parameter(p)))
                .collect(),
        }
    }

    /// The same with measured effects, of each of which the record may have another share.
    pub(crate) fn with_curves(&self, balance: &Balance, curves: &[EffectModel]) -> Self {
        let residual = self.residual.clone();
        let own = curves.iter().enumerate();
        let own = own.map(|(k, curve)| (Parameter::Curve(k), balance.effect(curve)));
        Base {
            parameters: self.parameters.iter().cloned().chain(own).collect(),
            residual,
        }
    }

    /// The regression of the declared parameters under a noise.
    pub fn normal(&self, whitener: &Whitener) -> Normal {
        let mut normal = Normal::new(whitener.column(&self.residual), &whitener.folds);
        for (parameter, contribution) in &self.parameters {
            normal.push(whitener.column(contribution), parameter.prior());
        }
        normal
    }
}

/// Rows of the operating points at which one of the motors rests.
fn rests(signals: &Signals) -> Vec<(usize, usize)> {
    operating_points(signals)
        .into_iter()
        .filter(|rows| {
            let middle = rows.start + rows.len() / 2;
            signals
                .references
                .iter()
                .any(|reference| reference[middle] == 0.0)
                && signals
                    .references
                    .iter()
                    .any(|reference| reference[middle] != 0.0)
        })
        .map(|rows| (rows.start, rows.end))
        .collect()
}

/// How much the declared errors of encoders and lead can change the table's place against the angles, m.
fn declared_reading_error_m(balance: &Balance) -> f64 {
    let lead = balance.lead.abs();
    let effects = balance.model.effects.iter();
    let errors = effects.map(|effect| match effect.effect() {
        AnyEffect::EncoderEccentricity(error) => lead * error.amplitude.abs(),
        AnyEffect::LeadError(error) => error.amplitude.abs(),
        _ => 0.0,
    });
    2.0 * errors.sum::<f64>()
}

/// How far the zero of the table's scale may be from where the first row has it, m. Where the table sinks onto its spring
/// within the first 50 ms, as it does when a run starts with the load put on a relaxed screw, the first row is a sampling
/// period at most after that. A sag that is as small as a drift at rest is no sign of it: who does not know the stiffness declares a large
/// one.
fn origin_within(balance: &Balance) -> f64 {
    const ANYWHERE: f64 = 5e-2;
    const ROUNDING: f64 = 2e-7;
    let signals = balance.signals;
    let rows = ((0.05 * signals.rate) as usize).clamp(2, signals.len() - 1);
    let error = |k: usize| signals.table[k] - balance.lead * signals.relative[k];
    let settled = (rows / 2..rows).map(error).sum::<f64>() / (rows - rows / 2) as f64;
    let feed = &balance.model.feed;
    let sag = feed.load_n.abs() / feed.axial_stiffness_n_per_m;
    // Declared errors of the readings change as much while the shafts turn.
    let readings = declared_reading_error_m(balance);
    let told = (5.0 * balance.model.sensing.table_noise_m).max(2.0 * ROUNDING);
    let sinks = (settled - error(0)).abs() > 0.3 * sag + readings && sag > told;
    if !sinks {
        return ANYWHERE;
    }
    let swing = TAU * declared_resonance_hz(balance.model) / signals.rate;
    ROUNDING + sag * (1.0 - swing.min(PI).cos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::recording::Sample;

    /// Of a table that moves by `sunk_m` within 10 ms on shafts that rest, on a screw that the load bends by `sag_m`.
    fn within(sag_m: f64, sunk_m: f64) -> f64 {
        let mut model = Model::coupled();
        model.feed.load_n = 20.0;
        model.feed.axial_stiffness_n_per_m = model.feed.load_n / sag_m;
        model.sensing.table_noise_m = 1e-8;
        let mut recording = Recording::default();
        for row in 0..2000 {
            let time_s = f64::from(row) / model.sensing.sample_hz;
            recording.push(&Sample {
                time_s,
                table_position_m: sunk_m * (time_s / 0.01).min(1.0),
                ..Sample::default()
            });
        }
        let record = Record::new(&recording, &model);
        origin_within(&record.balance_with(&model, Assumed::PLAIN))
    }

    /// A table that sank by 60 um later was a play of 145 um: its first row was taken for that of a relaxed spring.
    #[test]
    fn a_drift_at_rest_is_no_sag() {
        let (sinks, drifts) = (within(5e-6, -4e-6), within(1.1e-7, -5e-8));
        assert!(
            sinks < 1e-5 && drifts > 1e-3,
            "sinks: within {sinks:e} m, drifts: {drifts:e} m"
        );
    }
}
