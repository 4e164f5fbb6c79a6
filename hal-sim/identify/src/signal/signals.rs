//! What a recording says, in the quantities of the balances: angles, speeds, dq currents.

use crate::machines::Machine;
use crate::signal::along::{Along, Factor};
use crate::signal::fourier::{ABOVE_NOISE, CLEAR, EDGE, Fourier, Spectrum, slope};
use crate::signal::frames::{clarke, park};
use crate::signal::quantile::quantile_of_sizes;
use crate::signal::rounding;
use crate::signal::white::white_noise;
use plant::Axis;
use plant::model::{Model, SensingModel};
use plant::recording::Recording;
use std::f64::consts::TAU;

/// Bandwidth of the speeds in laws of friction, Hz. The encoder's quantisation at this bandwidth is below
/// 1 % of the slowest speed of a feed.
pub const SPEED_BANDWIDTH_HZ: f64 = 200.0;
/// Bandwidth of currents where their sign or their product with an effect matters, Hz: the current loop's.
pub const CURRENT_BANDWIDTH_HZ: f64 = 400.0;

/// Above it neither smoothed currents nor what follows speeds and positions have content, Hz.
pub const SMOOTH_HZ: f64 = EDGE * CURRENT_BANDWIDTH_HZ;

/// Speeds below which friction may stick and the torque balance says nothing, rad/s.
pub(crate) const STICKING_RAD_S: f64 = 0.5;

/// One motor's record.
pub struct MotorSignals {
    /// Measured mechanical angle from the first row on, rad.
    pub travel: Vec<f64>,
    /// Measured mechanical angle, rad.
    pub theta: Vec<f64>,
    /// Speed, rad/s, to [`SPEED_BANDWIDTH_HZ`].
    pub omega: Vec<f64>,
    /// Angle since the last reversal, rad, up to [`MOST_SINCE`].
    pub since: Vec<f64>,
    /// cos and sin of the measured electrical angle.
    pub rotor: Vec<(f64, f64)>,
    /// Measured currents in the rotor's frame, their means over a control period, A.
    pub i_d: Vec<f64>,
    /// Measured currents in the rotor's frame, their means over a control period, A.
    pub i_q: Vec<f64>,
    /// Phase currents a and b to [`CURRENT_BANDWIDTH_HZ`], A.
    pub phases: [Vec<f64>; 2],
    /// q current to [`CURRENT_BANDWIDTH_HZ`], A.
    pub i_q_smooth: Vec<f64>,
    /// d current to [`CURRENT_BANDWIDTH_HZ`], A.
    pub i_d_smooth: Vec<f64>,
    /// Commanded voltages, their means in the rotor's frame over a control period, V.
    pub u_d: Vec<f64>,
    /// Commanded voltages, their means in the rotor's frame over a control period, V.
    pub u_q: Vec<f64>,
    /// The same over the time at which they were applied, which is the middle of the control period that ends at their row: d and q, V.
    pub applied: [Spectrum; 2],
    /// First derivatives of the commanded voltages, as far as they are above noise: d and q, V/s.
    pub voltage_rate: [Spectrum; 2],
    /// Size that the q current exceeds in a thousandth of the rows only, A.
    pub peak_a: f64,
    /// Rms of the q current to [`CURRENT_BANDWIDTH_HZ`], A.
    pub i_q_rms: f64,
    /// Rms of the commanded voltage, V.
    pub u_rms: f64,
    /// Size of the speed that a fifth of the rows stay below, rad/s.
    pub slow_speed: f64,
    /// Rms of the speed, rad/s.
    pub rms_speed: f64,
    /// Greatest size of the speed, rad/s.
    pub top_speed: f64,
    /// First derivative of the angle at its full bandwidth, rad/s.
    pub speed: Spectrum,
    /// Density of the angle's rounding over the bins of a spectrum, rad^2.
    pub angle_rounding: Vec<f64>,
    /// Second derivative of the angle, rad/s^2.
    pub acceleration: Spectrum,
    /// What of it is above the encoder's resolution.
    pub acceleration_told: Spectrum,
    /// Step of the q current's reference from the row before, as far as it is above the currents' noise, A.
    pub reference_step: Spectrum,
    /// First derivatives of the currents, A/s.
    pub i_d_rate: Spectrum,
    /// First derivatives of the currents, A/s.
    pub i_q_rate: Spectrum,
}

/// A whole record.
pub struct Signals {
    /// What kind of machine it is of.
    pub machine: &'static dyn Machine,
    /// Rows per second.
    pub rate: f64,
    /// Time from the first row on, s.
    pub time: Vec<f64>,
    /// Screw and nut.
    pub motors: [MotorSignals; 2],
    /// Angle of screw against nut from the first row on, rad.
    pub relative: Vec<f64>,
    /// Its speed, rad/s.
    pub relative_speed: Vec<f64>,
    /// The table's scale, m.
    pub table: Vec<f64>,
    /// Spectrum of the table's scale from the first row on, m.
    pub table_spectrum: Spectrum,
    /// Spectrum of the relative angle, rad.
    pub relative_spectrum: Spectrum,
    /// Speed references of screw and nut.
    pub references: [Vec<f64>; 2],
}

/// `tanh(speed / rounding)`, or the sign.
pub fn rounded_sign(speed: f64, rounding: f64) -> f64 {
    if rounding > 0.0 {
        (speed / rounding).tanh()
    } else if speed == 0.0 {
        0.0
    } else {
        speed.signum()
    }
}

/// Variance of an angle's reading by an encoder's resolution, rad^2.
pub(crate) fn angle_noise(sensing: &SensingModel, axis: Axis) -> f64 {
    let count = TAU / f64::from(sensing.counts_per_turn(axis));
    count * count / 12.0
}

/// Counts a turn of the coarser encoder.
pub(crate) fn coarsest(sensing: &SensingModel) -> u32 {
    let [screw, nut] = Axis::ALL.map(|axis| sensing.counts_per_turn(axis));
    screw.min(nut)
}

/// Variance of both encoders' readings together, rad^2.
pub(crate) fn relative_noise(sensing: &SensingModel) -> f64 {
    Axis::ALL
        .iter()
        .map(|axis| angle_noise(sensing, *axis))
        .sum()
}

/// Variance of a phase current's reading, A^2; of currents in the rotor's frame it is twice that.
pub(crate) fn current_noise(sensing: &SensingModel) -> f64 {
    sensing.current_noise_a.powi(2) + sensing.current_lsb_a.powi(2) / 12.0
}

pub(crate) fn mean_square(column: &[f64]) -> f64 {
    column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64
}

/// Largest angle since a reversal that is distinguished, rad. What friction or a clutch winds up is less than a turn.
pub(crate) const MOST_SINCE: f64 = TAU;
/// Encoder counts of a way back that is a reversal: rounding and noise move an angle that rests by one or two.
const REVERSAL_COUNTS: f64 = 4.0;

/// Angle at each row since the last reversal.
fn since_reversal(travel: &[f64], count: f64) -> Vec<f64> {
    let (mut way, mut turned, mut furthest) = (0.0_f64, f64::INFINITY, 0.0);
    let rows = travel.iter().map(|&angle| {
        if (angle - furthest) * way > 0.0 {
            furthest = angle;
        } else if (angle - furthest).abs() > REVERSAL_COUNTS * count {
            // Where it was before the first reversal is not known.
            turned = if way == 0.0 { f64::INFINITY } else { furthest };
            way = (angle - furthest).signum();
            furthest = angle;
        }
        (angle - turned).abs().min(MOST_SINCE)
    });
    rows.collect()
}

/// By how much the mean of a current over a control period is beside its sample at the period's start, A per V and rad/s of electrical
/// speed, a quarter turn ahead of the voltage. The voltage stands still while the rotor turns under it: in the rotor's frame it is a ramp
/// `-j w t U`, and what the inductance makes of a ramp has the mean `j w U T^2 / 12 L` above its ends.
fn within_period(model: &Model, axis: Axis) -> f64 {
    let period = 1.0 / model.sensing.control_hz;
    period * period / (12.0 * model.motor(axis).inductance_h)
}

impl MotorSignals {
    fn new(recording: &Recording, axis: Axis, model: &Model, fourier: &Fourier, rate: f64) -> Self {
        let record = recording.axis(axis);
        let pole_pairs = f64::from(model.motor(axis).pole_pairs);
        let theta = record.angle_rad.clone();
        let travel: Vec<f64> = theta.iter().map(|t| t - theta[0]).collect();
        let omega = fourier.low_pass(&slope(&travel, rate), SPEED_BANDWIDTH_HZ);
        let rotor: Vec<(f64, f64)> = theta
            .iter()
            .map(|t| {
                let (sin, cos) = (pole_pairs * t).sin_cos();
                (cos, sin)
            })
            .collect();
        let within = within_period(model, axis);
        let (i_d, i_q): (Vec<f64>, Vec<f64>) = (0..theta.len())
            .map(|k| {
                let (d, q) = park(clarke(record.ia_a[k], record.ib_a[k]), rotor[k]);
                let more = within * pole_pairs * omega[k];
                (d - more * record.uq_v[k], q + more * record.ud_v[k])
            })
            .unzip();
        let i_q_smooth = fourier.low_pass(&i_q, CURRENT_BANDWIDTH_HZ);
        // A d current that is held at 0 has ripple yet, which moves the phases' zero crossings.
        let i_d_smooth = fourier.low_pass(&i_d, CURRENT_BANDWIDTH_HZ);
        let phases = [0.0, TAU / 3.0].map(|lag: f64| {
            let (sin_lag, cos_lag) = lag.sin_cos();
            let scale = (2.0_f64 / 3.0).sqrt();
            i_d_smooth
                .iter()
                .zip(&i_q_smooth)
                .zip(&rotor)
                .map(|((d, q), (cos, sin))| {
                    let along = cos * cos_lag + sin * sin_lag;
                    let across = sin * cos_lag - cos * sin_lag;
                    scale * (d * along - q * across)
                })
                .collect()
        });
        // A voltage that stands still for a period while the rotor turns has this mean in the rotor's frame: `sin(x) / x`, `x = w T / 2`.
        let half_period = 0.5 / model.sensing.control_hz;
        let turned_mean = |commanded: &[f64]| -> Vec<f64> {
            let rows = commanded.iter().zip(&omega);
            rows.map(|(u, w)| u * (1.0 - (pole_pairs * w * half_period).powi(2) / 6.0))
                .collect()
        };
        let (u_d, u_q) = (turned_mean(&record.ud_v), turned_mean(&record.uq_v));
        let voltage_rate = [&u_d, &u_q].map(|u| {
            let noise = white_noise(u).powi(2);
            fourier.above_noise(&fourier.slope(u), CLEAR, |bin| {
                noise * (TAU * fourier.hz(bin)).powi(2)
            })
        });
        let acceleration = fourier.curvature(&travel);
        let sensing = &model.sensing;
        let counts = sensing.counts_per_turn(axis);
        let angle_rounding = rounding::density(&omega, rate, counts, fourier);
        let acceleration_told = fourier.above_noise(&acceleration, ABOVE_NOISE, |bin| {
            angle_rounding[bin] * (TAU * fourier.hz(bin)).powi(4)
        });
        let reference = &record.iq_ref_a;
        let step: Vec<f64> = (0..reference.len())
            .map(|k| reference[k] - reference[k.saturating_sub(1)])
            .collect();
        // Of a drive that does not say its reference it is the measured current.
        let reference_step = fourier.above_noise(&fourier.spectrum(&step), ABOVE_NOISE, |bin| {
            let half = 0.5 * TAU * fourier.hz(bin) / rate;
            2.0 * current_noise(sensing) * (2.0 * half.sin()).powi(2)
        });
        MotorSignals {
            angle_rounding,
            acceleration_told,
            reference_step,
            peak_a: quantile_of_sizes(i_q.iter().copied(), 0.999),
            i_q_rms: mean_square(&i_q_smooth).sqrt(),
            u_rms: (mean_square(&record.ud_v) + mean_square(&record.uq_v)).sqrt(),
            slow_speed: quantile_of_sizes(omega.iter().copied(), 0.2),
            rms_speed: mean_square(&omega).sqrt(),
            top_speed: omega.iter().fold(0.0, |top, w| top.max(w.abs())),
            speed: fourier.slope(&travel),
            acceleration,
            since: since_reversal(&travel, TAU / f64::from(counts)),
            i_d_rate: fourier.slope(&i_d),
            i_q_rate: fourier.slope(&i_q),
            travel,
            theta,
            omega,
            rotor,
            i_d,
            i_q,
            phases,
            i_q_smooth,
            i_d_smooth,
            applied: [&u_d, &u_q].map(|u| fourier.delayed(&fourier.spectrum(u), -half_period)),
            voltage_rate,
            u_d,
            u_q,
        }
    }
}

impl Signals {
    /// The value of a coordinate at a row: an angle in rad, of the clock one turn a second.
    pub fn along(&self, along: Along, row: usize) -> f64 {
        match along {
            Along::Angle(axis) | Along::AngleTimes(axis, _) => self.motors[axis.index()].theta[row],
            Along::RelativeAngle => self.motors[0].theta[row] - self.motors[1].theta[row],
            Along::Clock => TAU * self.time[row],
            Along::Speed(axis) | Along::SpeedTimes(axis, _) => self.motors[axis.index()].omega[row],
            Along::SinceReversal(axis) => self.motors[axis.index()].since[row],
            Along::RelativeSpeed => self.relative_speed[row],
            Along::TablePosition | Along::TightPlace => self.table[row],
            Along::Time | Along::TimeTimes(_) => self.time[row],
        }
    }

    /// What a shape over a coordinate is multiplied with at a row.
    pub fn factor(&self, along: Along, row: usize) -> f64 {
        let motor = |axis: Axis| &self.motors[axis.index()];
        match along.factor() {
            Some(Factor::Direction(axis)) => rounded_sign(motor(axis).omega[row], 0.0),
            Some(Factor::RelativeDirection) => rounded_sign(self.relative_speed[row], 0.0),
            Some(Factor::Speed(axis)) => motor(axis).omega[row],
            Some(Factor::Current(axis)) => motor(axis).i_q_smooth[row],
            None => 1.0,
        }
    }

    /// The signals of a recording of the machine `model`.
    pub fn new(
        recording: &Recording,
        model: &Model,
        fourier: &Fourier,
        machine: &'static dyn Machine,
    ) -> Self {
        let rate = model.sensing.sample_hz;
        let motors = Axis::ALL.map(|axis| MotorSignals::new(recording, axis, model, fourier, rate));
        let difference =
            |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>();
        let relative = difference(&motors[0].travel, &motors[1].travel);
        let table = &recording.table_position_m;
        let moved: Vec<f64> = table.iter().map(|x| x - table[0]).collect();
        Signals {
            machine,
            rate,
            table_spectrum: fourier.spectrum(&moved),
            relative_spectrum: fourier.spectrum(&relative),
            time: recording
                .time_s
                .iter()
                .map(|t| t - recording.time_s[0])
                .collect(),
            relative,
            relative_speed: difference(&motors[0].omega, &motors[1].omega),
            table: table.clone(),
            references: [0, 1].map(|k: usize| recording.axes[k].speed_ref_rad_s.clone()),
            motors,
        }
    }

    /// Density of both encoders' rounding together in a bin of a spectrum, rad^2.
    pub(crate) fn relative_rounding(&self, bin: usize) -> f64 {
        let of_motors = self.motors.iter().map(|motor| motor.angle_rounding[bin]);
        of_motors.sum()
    }

    /// Length of the run, s.
    pub fn run_s(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0).max(1e-3)
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_since_a_reversal_starts_where_it_turns_round() {
        // Forth by 40 counts, at rest with noise of a count, back by 30, forth by 300.
        let forth = (0..=40).chain([39, 40, 41, 40]);
        let counts = forth.chain((10..=40).rev()).chain(11..=310);
        let travel: Vec<f64> = counts.map(|count| 0.05 * f64::from(count)).collect();
        let since = since_reversal(&travel, 0.05);
        // What was before the first row is not known.
        assert!(since[..48].iter().all(|x| *x == MOST_SINCE));
        let at = |row: usize| (since[row] / 0.05).round();
        assert_eq!((at(75), at(75 + 100)), (31.0, 100.0));
        assert_eq!(since[travel.len() - 1], MOST_SINCE);
    }
}
