//! What the terms of an effect at the feed add.

use super::{Balance, Contribution, Spring, brake, compliance, shaped};
use crate::signal::channel::Channel;
use crate::signal::fourier::Spectrum;
use crate::signal::signals::{SMOOTH_HZ, rounded_sign};
use plant::Axis;
use plant::effects::{Coordinate, Site, Term};
use std::f64::consts::TAU;

impl Balance<'_> {
    pub(super) fn feed_term(&self, term: &Term, sum: &mut Contribution) {
        let signals = self.signals;
        let law = &term.law;
        let value = |k: usize| match term.coordinate {
            Coordinate::RelativeAngle => law.value(self.relative_angle(k)),
            Coordinate::NominalTravel => law.value(self.lead * signals.relative[k]),
            Coordinate::TablePosition => law.value(signals.table[k]),
            Coordinate::Speed => law.value(self.lead * signals.relative_speed[k]),
            Coordinate::Time => law.value(signals.time[k]),
            _ => law.value(0.0),
        };
        match term.site {
            Site::Travel => {
                let origin = value(0);
                sum.add(
                    Channel::Table,
                    1.0,
                    &self.spectrum_of(SMOOTH_HZ, |k| value(k) - origin),
                );
            }
            Site::PairTorque => {
                let spectrum = self.spectrum_of(SMOOTH_HZ, value);
                for axis in Axis::ALL {
                    sum.add(Channel::Torque(axis), brake(axis), &spectrum);
                }
            }
            Site::TableForce => sum.add_all(1.0, &self.guideway(value)),
            Site::Friction => {
                let force = |k: usize| {
                    value(k) * rounded_sign(signals.relative_speed[k], self.rounding.guideway)
                };
                sum.add_all(1.0, &self.guideway(force));
            }
            Site::AxialResonance => sum.add_all(1.0, &self.softer(law.value(0.0))),
            Site::AxialGap => sum.add_all(1.0, &self.gap(law.value(0.0))),
            // These belong to a motor; no term of the feed has them.
            _ => {}
        }
    }

    /// What a force (N at a row) on the guideway's side of the table adds.
    pub(crate) fn guideway(&self, force: impl Fn(usize) -> f64) -> Contribution {
        let mut sum = Contribution::default();
        let spectrum = self.spectrum_of(SMOOTH_HZ, force);
        for axis in Axis::ALL {
            sum.add(Channel::Torque(axis), brake(axis) * self.lead, &spectrum);
        }
        sum.add(
            Channel::Table,
            -1.0 / self.screw.stiffness,
            &shaped(&spectrum, &self.screw.compliance),
        );
        sum
    }

    /// The declared screw's residual of the table less that of one with another resonance, as far as the record shows it: a screw that
    /// is taken for stiffer than it is amplifies less of the encoders' noise.
    fn softer(&self, hz: f64) -> Contribution {
        let feed = &self.model.feed;
        let softer = Spring::swinging(self.model, self.fourier, hz, self.damping);
        let acceleration = &self.relative_acceleration_told;
        let mut difference = self.table(&self.declared, acceleration);
        difference.add_all(-1.0, &self.table(&softer, acceleration));
        let inertia = feed.table_mass_kg * self.lead * self.lead;
        let change: Spectrum = softer
            .compliance
            .iter()
            .zip(&self.declared.compliance)
            .map(|(new, old)| new - old)
            .collect();
        let table = shaped(acceleration, &change);
        for axis in Axis::ALL {
            let table = self.seen_by(axis, &table);
            difference.add(Channel::Torque(axis), brake(axis) * inertia, &table);
        }
        difference
    }

    /// What a relative change of the damping of a softer screw with the resonance `hz` adds.
    pub fn axial_damping(&self, hz: f64) -> Contribution {
        let feed = &self.model.feed;
        let ratio = self.damping;
        let stiffness = feed.table_mass_kg * (TAU * hz).powi(2);
        let change: Spectrum = compliance(self.fourier, hz, 1.05 * ratio)
            .iter()
            .zip(&compliance(self.fourier, hz, 0.95 * ratio))
            .map(|(more, less)| (more - less) * 10.0)
            .collect();
        let mut sum = Contribution::default();
        let acceleration = shaped(&self.relative_acceleration_told, &change);
        let scale = self.lead * feed.table_mass_kg / stiffness;
        sum.add(Channel::Table, -scale, &acceleration);
        let force = shaped(&self.table_force_spectrum, &change);
        sum.add(Channel::Table, -1.0 / stiffness, &force);
        let inertia = feed.table_mass_kg * self.lead * self.lead;
        for axis in Axis::ALL {
            let table = self.seen_by(axis, &acceleration);
            sum.add(Channel::Torque(axis), brake(axis) * inertia, &table);
        }
        sum
    }

    /// Play that shows where the table turns: it follows the thread half the gap behind.
    pub fn play(&self, width: f64) -> Contribution {
        let mut sum = Contribution::default();
        let lag = |k: usize| {
            -0.5 * width * rounded_sign(self.signals.relative_speed[k], self.rounding.guideway)
        };
        sum.add(Channel::Table, 1.0, &self.spectrum_of(f64::INFINITY, lag));
        sum
    }

    /// Play under a load: the table lies on the flank that the force on it chooses, half the gap from the middle where
    /// it started.
    fn gap(&self, width: f64) -> Contribution {
        let mut sum = Contribution::default();
        let rest = 0.02 * self.model.feed.guideway_coulomb_n;
        let flank = |k: usize| -0.5 * width * rounded_sign(self.table_force[k], rest.max(1e-9));
        sum.add(Channel::Table, 1.0, &self.spectrum_of(f64::INFINITY, flank));
        sum
    }
}
