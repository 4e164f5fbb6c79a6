//! What the terms of an effect at a motor add.

use super::{Balance, Contribution, brake, shaped};
use crate::signal::channel::Channel;
use crate::signal::frames::{clarke, park};
use crate::signal::signals::{SMOOTH_HZ, rounded_sign};
use plant::Axis;
use plant::effects::{Coordinate, Law, Site, Term};
use std::f64::consts::TAU;

impl Balance<'_> {
    /// Highest frequency that a law has over a coordinate that moves at up to `speed` rad/s (time: at 1).
    fn content(law: &Law, speed: f64) -> f64 {
        match law {
            Law::Periodic { order, .. } => order.abs() * speed / TAU,
            _ => SMOOTH_HZ,
        }
    }

    pub(super) fn motor_term(&self, axis: Axis, term: &Term, sum: &mut Contribution) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        let pole_pairs = f64::from(motor.pole_pairs);
        let (torque, q) = (Channel::Torque(axis), Channel::VoltageQ(axis));
        let omega_e = |k: usize| pole_pairs * s.omega[k];
        let law = &term.law;
        let value = |k: usize| match term.coordinate {
            Coordinate::None => law.value(0.0),
            Coordinate::ElectricalAngle => law.value(pole_pairs * s.theta[k]),
            Coordinate::MechanicalAngle => law.value(s.theta[k]),
            Coordinate::Time => law.value(self.signals.time[k]),
            Coordinate::Speed => law.value(s.omega[k]),
            // These belong to the feed; no motor's term has them.
            _ => 0.0,
        };
        let hz = match term.coordinate {
            Coordinate::ElectricalAngle => Self::content(law, pole_pairs * s.top_speed),
            Coordinate::MechanicalAngle => Self::content(law, s.top_speed),
            Coordinate::Time => Self::content(law, 1.0),
            _ => SMOOTH_HZ,
        };
        match term.site {
            Site::ShaftTorque => sum.add(torque, -1.0, &self.spectrum_of(hz, value)),
            Site::Flux => {
                let constant = pole_pairs * motor.flux_wb;
                sum.add(
                    torque,
                    -constant,
                    &self.spectrum_of(hz, |k| value(k) * s.i_q_smooth[k]),
                );
                sum.add(
                    q,
                    motor.flux_wb,
                    &self.spectrum_of(hz, |k| value(k) * omega_e(k)),
                );
            }
            Site::Resistance => {
                sum.add(
                    q,
                    motor.resistance_ohm,
                    &self.spectrum_of(hz, |k| value(k) * s.i_q_smooth[k]),
                );
            }
            Site::CurrentReadingA | Site::CurrentReadingB => {
                let phase = usize::from(term.site == Site::CurrentReadingB);
                let error = |k: usize| match term.coordinate {
                    Coordinate::PhaseCurrent => law.value(s.phases[phase][k]),
                    _ => value(k),
                };
                self.reading(axis, phase, error, sum);
            }
            Site::PhaseVoltage => {
                let round = self
                    .model
                    .sensing
                    .current_noise_a
                    .max(self.model.sensing.current_lsb_a);
                self.phase_voltage(axis, law.value(1.0), round, sum);
            }
            Site::EncoderReading => self.encoder(axis, hz, value, sum),
            Site::Friction => {
                let friction =
                    |k: usize| value(k) * rounded_sign(s.omega[k], self.rounding.bearing);
                sum.add(torque, 1.0, &self.spectrum_of(hz, friction));
            }
            // These belong to the feed; no motor's term has them.
            _ => {}
        }
    }

    /// A voltage of `size` that each phase loses against the sign of its current. Over the ripple and noise of a current
    /// near zero the mean of a sign is a rounded one, over `round` A.
    pub fn phase_voltage(&self, axis: Axis, size: f64, round: f64, sum: &mut Contribution) {
        let s = &self.signals.motors[axis.index()];
        let (lost_d, lost_q): (Vec<f64>, Vec<f64>) = (0..self.signals.len())
            .map(|k| {
                let (a, b) = (s.phases[0][k], s.phases[1][k]);
                let [a, b, c] = [a, b, -a - b].map(|i| size * rounded_sign(i, round));
                let mean = (a + b + c) / 3.0;
                park(clarke(a - mean, b - mean), s.rotor[k])
            })
            .unzip();
        sum.add(
            Channel::VoltageD(axis),
            -1.0,
            &self.fourier.spectrum(&lost_d),
        );
        sum.add(
            Channel::VoltageQ(axis),
            -1.0,
            &self.fourier.spectrum(&lost_q),
        );
    }

    /// An error of a phase current's reading shows as torque that is not there and in the voltages that the true
    /// current did not need.
    fn reading(
        &self,
        axis: Axis,
        phase: usize,
        error: impl Fn(usize) -> f64,
        sum: &mut Contribution,
    ) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        // The currents and twice the electrical frequency.
        let electrical = f64::from(motor.pole_pairs) * s.top_speed / TAU;
        let stride = self.fourier.stride(SMOOTH_HZ.max(2.0 * electrical));
        let value = self.sampled(stride, error);
        let rate = crate::signal::fourier::slope(&value, self.signals.rate / stride as f64);
        let two_phase = |x: f64| {
            if phase == 0 {
                clarke(x, 0.0)
            } else {
                clarke(0.0, x)
            }
        };
        let n = value.len();
        let (mut torque, mut d, mut q) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for k in 0..n {
            let rotor = s.rotor[k * stride];
            let (read_d, read_q) = park(two_phase(value[k]), rotor);
            let (rate_d, rate_q) = park(two_phase(rate[k]), rotor);
            torque[k] = read_q;
            d[k] = motor.resistance_ohm * read_d + motor.inductance_h * rate_d;
            q[k] = motor.resistance_ohm * read_q + motor.inductance_h * rate_q;
        }
        let constant = f64::from(motor.pole_pairs) * motor.flux_wb;
        let spectrum = |signal: &[f64]| self.fourier.spectrum_at(stride, signal);
        sum.add(Channel::Torque(axis), constant, &spectrum(&torque));
        sum.add(Channel::VoltageD(axis), -1.0, &spectrum(&d));
        sum.add(Channel::VoltageQ(axis), -1.0, &spectrum(&q));
    }

    /// An error of the angle's reading, without content above `hz`, shows in every balance that uses the angle.
    fn encoder(&self, axis: Axis, hz: f64, error: impl Fn(usize) -> f64, sum: &mut Contribution) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        let pole_pairs = f64::from(motor.pole_pairs);
        let torque = Channel::Torque(axis);
        let highest = motor
            .torque_harmonics
            .iter()
            .map(|h| h.order * pole_pairs)
            .fold(0.0, f64::max);
        let harmonics = self.spectrum_of(hz + highest * s.top_speed / TAU, |k| {
            let slope: f64 = motor
                .torque_harmonics
                .iter()
                .map(|h| {
                    let order = h.order * pole_pairs;
                    -h.amplitude_nm * order * (order * s.theta[k] + h.phase_rad).sin()
                })
                .sum();
            slope * error(k)
        });
        sum.add(torque, 1.0, &harmonics);
        let stride = self.fourier.stride(hz.max(SMOOTH_HZ));
        let error = self.sampled(stride, error);
        let curvature = self.fourier.curvature_at(stride, &error);
        sum.add(torque, -motor.inertia_kg_m2, &curvature);
        let emf = pole_pairs * motor.flux_wb;
        let turned: Vec<f64> = error
            .iter()
            .zip(s.omega.iter().step_by(stride))
            .map(|(e, w)| pole_pairs * w * e)
            .collect();
        sum.add(
            Channel::VoltageD(axis),
            emf,
            &self.fourier.spectrum_at(stride, &turned),
        );
        sum.add(
            Channel::VoltageQ(axis),
            -emf,
            &self.fourier.slope_at(stride, &error),
        );
        // The travel counts from the first row, whose reading has the error too.
        let travel: Vec<f64> = error.iter().map(|e| e - error[0]).collect();
        let side = brake(axis);
        sum.add(
            Channel::Table,
            -side * self.lead,
            &self.fourier.spectrum_at(stride, &travel),
        );
        let feed = &self.model.feed;
        let dynamic = shaped(&curvature, &self.screw.compliance);
        let scale = self.lead * feed.table_mass_kg / self.screw.stiffness;
        sum.add(Channel::Table, side * scale, &dynamic);
    }
}
