//! How noisy each channel is over frequency, and the filter that makes it white.

use crate::signal::channel::Channel;
use crate::signal::fourier::{Fourier, edge};
use crate::signal::signals::relative_noise;
use crate::signal::signals::{Signals, angle_noise, current_noise};
use fft::Complex64;
use plant::Axis;
use plant::model::Model;
use std::f64::consts::TAU;

/// Share of the decimated Nyquist frequency up to which a channel is used.
pub(crate) const USED: f64 = 0.8;
/// Share of the table's resonance up to which its position is used: nearer to it the model amplifies the encoders'
/// quantisation, and a wrong resonance would pay by amplifying it less.
const BELOW_RESONANCE: f64 = 0.6;
/// Share of a motor's torque or voltage, rms, below which nothing has a name: friction alone repeats less well from run to run.
pub(crate) const SHARE_OF_DRIVE: f64 = 0.002;
/// Share of a motor's torque, rms, and of its voltage, below which a residual counts as nothing. The rest of an effect that was taken
/// for another is larger. Without effects [`SHARE_OF_DRIVE`] counts as nothing in a torque and in the d voltage. There an angle of an encoder
/// that is wrong by 0.1 electrical degrees makes as much of the back EMF.
const SMALL_TORQUE: f64 = 0.001;
const SMALL_VOLTAGE: f64 = 0.000_5;
/// Damping ratio below which the filter that makes noise white would ring beyond the margin of the rows that do not count.
const LEAST_DAMPING: f64 = 0.1;
/// Smallest density of a channel.
const LEAST: f64 = 1e-30;
/// How much more power than the sensors' may be taken for noise.
const MOST_NOISE: f64 = 2.0;
/// Upper edges of the bands over which the noise is estimated, Hz. Below the first, noise and slow misfit are one.
pub(crate) const BANDS_HZ: [f64; 16] = [
    6.0, 12.0, 20.0, 32.0, 48.0, 68.0, 92.0, 120.0, 155.0, 195.0, 240.0, 290.0, 345.0, 405.0,
    470.0, 560.0,
];

/// Resonance of the table on the declared axial stiffness, Hz.
pub fn declared_resonance_hz(model: &Model) -> f64 {
    (model.feed.axial_stiffness_n_per_m / model.feed.table_mass_kg).sqrt() / TAU
}

/// Noise density of the channels: variance per row of the record if it were white at that level.
#[derive(Clone)]
pub struct Noise {
    density: [Vec<f64>; Channel::COUNT],
    /// Power that the sensors have in each bin, of that density. It differs from 1 where an encoder turns evenly: its rounding is
    /// a few lines, and nothing beside them. A filter as narrow as lines would ring, so they do not whiten.
    lines: [Vec<f64>; Channel::COUNT],
    /// Rms of what drives the channel, in its unit.
    drive: [f64; Channel::COUNT],
    /// Frequency up to which a channel is used, Hz.
    top: [f64; Channel::COUNT],
}

/// Mean squares of a whitened residual in a band.
#[derive(Clone, Copy)]
pub(crate) struct BandPower {
    /// Of the sensors; 1 of white noise.
    pub(crate) sensors: f64,
    /// Up to which the residual counts as nothing.
    pub(crate) small: f64,
}

impl BandPower {
    /// Of white noise, where every residual counts.
    pub(crate) const WHITE: BandPower = BandPower {
        sensors: 1.0,
        small: 0.0,
    };
}

impl Noise {
    /// What sensors of the declared resolution make of a channel.
    pub fn declared(model: &Model, signals: &Signals, fourier: &Fourier) -> Self {
        Self::with_resonance(model, signals, fourier, declared_resonance_hz(model))
    }

    /// As [`Noise::declared`], of a table with another resonance: near it the balance amplifies the encoders' noise.
    pub fn with_resonance(
        model: &Model,
        signals: &Signals,
        fourier: &Fourier,
        resonance_hz: f64,
    ) -> Self {
        let sensing = &model.sensing;
        let current = current_noise(sensing);
        let step = |column: &[f64]| {
            let sum: f64 = column.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
            (0.5 * sum / column.len() as f64).max(1e-12)
        };
        let steps = Axis::ALL.map(|axis| {
            let motor = &signals.motors[axis.index()];
            (step(&motor.u_d), step(&motor.u_q))
        });
        // Of a voltage, to which an angle's rounding adds the back EMF of a rad/s, so many times.
        let of_voltage = |axis: Axis, white: f64, times: f64, bin: usize| {
            let motor = model.motor(axis);
            let gain = (f64::from(motor.pole_pairs) * motor.flux_wb * times).powi(2);
            let rounding = signals.motors[axis.index()].angle_rounding[bin];
            [white, gain * angle_noise(sensing, axis), gain * rounding]
        };
        // Of a channel: what is white whatever turns, what is made of an angle's rounding, and that as the record has it.
        let parts = Channel::ALL.map(|channel| {
            let at = |bin: usize, hz: f64| match channel {
                Channel::Torque(axis) => {
                    let motor = model.motor(axis);
                    let constant = f64::from(motor.pole_pairs) * motor.flux_wb;
                    let gains = Axis::ALL
                        .map(|of| torque_of_angle(model, signals, [axis, of], hz, resonance_hz));
                    let sum = |rounding: [f64; 2]| {
                        gains[0].powi(2) * rounding[0] + gains[1].powi(2) * rounding[1]
                    };
                    [
                        2.0 * constant * constant * current,
                        sum(Axis::ALL.map(|axis| angle_noise(sensing, axis))),
                        sum(signals
                            .motors
                            .each_ref()
                            .map(|motor| motor.angle_rounding[bin])),
                    ]
                }
                // A rounded angle turns a part of the back EMF into the d axis.
                Channel::VoltageD(axis) => {
                    let pole_pairs = f64::from(model.motor(axis).pole_pairs);
                    let speed = signals.motors[axis.index()].rms_speed;
                    of_voltage(axis, steps[axis.index()].0, pole_pairs * speed, bin)
                }
                // The back EMF is by the slope of a rounded angle.
                Channel::VoltageQ(axis) => of_voltage(axis, steps[axis.index()].1, TAU * hz, bin),
                Channel::Table => {
                    let lead = model.feed.travel_per_radian();
                    let u = hz / resonance_hz;
                    let damping = 2.0 * model.feed.axial_damping_ratio * u;
                    let amplified = 1.0 / ((1.0 - u * u).powi(2) + damping * damping).max(1e-6);
                    let gain = lead * lead * amplified;
                    [
                        sensing.table_noise_m.powi(2),
                        gain * relative_noise(sensing),
                        gain * signals.relative_rounding(bin),
                    ]
                }
            };
            let bins = (0..fourier.bins()).map(|bin| at(bin, fourier.hz(bin)));
            bins.collect::<Vec<[f64; 3]>>()
        });
        let density = parts.each_ref().map(|bins| {
            let sum = bins.iter().map(|[white, angle, _]| white + angle);
            sum.map(|density| density.max(LEAST)).collect()
        });
        let lines = parts.each_ref().map(|bins| {
            let lines = bins.iter().map(|[white, angle, rounding]| {
                (white + rounding).max(LEAST) / (white + angle).max(LEAST)
            });
            lines.collect()
        });
        let top = USED * fourier.hz(fourier.bins());
        let top = Channel::ALL.map(|channel| match channel {
            Channel::Table => top.min(BELOW_RESONANCE * declared_resonance_hz(model)),
            _ => top,
        });
        Noise {
            density,
            lines,
            drive: Channel::ALL.map(|channel| drive_rms(model, signals, channel)),
            top,
        }
    }

    /// Frequency up to which a channel is used, Hz.
    pub fn top(&self, channel: Channel) -> f64 {
        self.top[channel.index()]
    }

    /// Density of a channel over the bins of a spectrum.
    pub fn density(&self, channel: Channel) -> &[f64] {
        &self.density[channel.index()]
    }

    /// Power between two frequencies of a spectrum, Hz, after a whitening by `gain`. The sensors' is at least that of white noise. `alone`: no
    /// effects were found.
    pub(crate) fn power(
        &self,
        (channel, alone): (Channel, bool),
        [from, to]: [f64; 2],
        fourier: &Fourier,
        gain: &[f64],
    ) -> BandPower {
        let index = channel.index();
        let bin = |hz: f64| ((hz / fourier.hz(1)) as usize).min(self.lines[index].len());
        let band = bin(from)..bin(to);
        let bins = band.len().max(1) as f64;
        let (mut sensors, mut density) = (0.0, 0.0);
        for bin in band {
            let gain = gain[bin] * gain[bin] / fourier.step() as f64;
            sensors += self.density[index][bin] * self.lines[index][bin] * gain;
            density += self.density[index][bin];
        }
        let floor = density / (fourier.bins() * fourier.step()) as f64;
        BandPower {
            sensors: (sensors / bins).max(1.0),
            small: (small_share(channel, alone) * self.drive[index]).powi(2) / floor.max(LEAST),
        }
    }

    /// Greatest relative difference of two densities.
    pub(crate) fn differs(&self, other: &Noise) -> f64 {
        let pairs = self
            .density
            .iter()
            .flatten()
            .zip(other.density.iter().flatten());
        pairs.map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max)
    }

    /// The gain over frequency after which the channel's noise is white with variance 1 at the decimated rate.
    pub fn whitening(&self, channel: Channel, fourier: &Fourier) -> Vec<f64> {
        let top = self.top[channel.index()];
        let scale = (fourier.step() as f64).sqrt();
        self.density(channel)
            .iter()
            .enumerate()
            .map(|(bin, d)| scale * edge(fourier.hz(bin), top, 1.2 * top) / d.sqrt())
            .collect()
    }

    /// Noise floor of a channel within the band that is used, rms in the channel's unit.
    pub fn floor(&self, channel: Channel, fourier: &Fourier) -> f64 {
        let band = self.band(channel, fourier);
        let width = fourier.hz(1) / (fourier.hz(fourier.bins()) * fourier.step() as f64);
        let sum: f64 = self
            .density(channel)
            .iter()
            .zip(&self.lines[channel.index()])
            .zip(&band)
            .map(|((density, lines), gain)| density * lines * gain * gain)
            .sum();
        (sum * width).sqrt()
    }

    /// The gain that limits a channel to the band that is used, without whitening.
    pub fn band(&self, channel: Channel, fourier: &Fourier) -> Vec<f64> {
        let top = self.top[channel.index()];
        (0..fourier.bins())
            .map(|bin| edge(fourier.hz(bin), top, 1.2 * top))
            .collect()
    }

    /// Corrects the density by the median power of what whitening left, band by band: lines of an effect do not move a
    /// median, a raised floor does. A channel is never taken for less noisy than half of what the sensors make, nor for
    /// more than [`MOST_NOISE`] times: what is louder is for an effect to explain.
    pub fn corrected(
        &self,
        declared: &Noise,
        left: &[Option<Vec<f64>>],
        fourier: &Fourier,
    ) -> Self {
        let mut corrected = self.clone();
        for (channel, signal) in left.iter().enumerate() {
            let Some(signal) = signal else { continue };
            let used = signal.iter().filter(|x| **x != 0.0).count().max(1) as f64;
            // At the decimated rate; a record put at the full rate only to reuse the transform would be the same.
            let power = power_spectrum(signal);
            let width = fourier.hz(fourier.bins()) / power.len() as f64;
            let mut points: Vec<(f64, f64)> = Vec::new();
            let mut low = 0.3;
            for high in BANDS_HZ {
                let (from, to) = (
                    (low / width) as usize,
                    ((high / width) as usize).min(power.len()),
                );
                if from + 8 < to && high <= 1.05 * self.top[channel] {
                    let mut band = power[from..to].to_vec();
                    let middle = band.len() / 2;
                    let (_, median, _) = band.select_nth_unstable_by(middle, f64::total_cmp);
                    // The power of white noise is exponentially distributed: its median is ln 2 of its mean.
                    let level = *median / std::f64::consts::LN_2 / used;
                    points.push((0.5 * (low + high), level.max(1e-6)));
                }
                low = high;
            }
            if points.is_empty() {
                continue;
            }
            for bin in 0..fourier.bins() {
                let sensors = declared.density[channel][bin];
                let level = self.density[channel][bin] * interpolate(&points, fourier.hz(bin));
                corrected.density[channel][bin] = level.clamp(0.5 * sensors, MOST_NOISE * sensors);
            }
        }
        corrected
    }
}

/// Torque that the balance of the first motor takes for that of a wave of the second one's angle, N m per rad, at a frequency, Hz. It
/// accelerates the motor by its own angle, and the table by the difference of both. The damping of a slightly damped screw is taken
/// for [`LEAST_DAMPING`].
pub(crate) fn torque_of_angle(
    model: &Model,
    signals: &Signals,
    [of, by]: [Axis; 2],
    hz: f64,
    resonance_hz: f64,
) -> f64 {
    let feed = &model.feed;
    let table = match signals.machine.has_feed() {
        true => {
            let u = hz / resonance_hz;
            let damping = 2.0 * feed.axial_damping_ratio.max(LEAST_DAMPING) * u;
            let rigid = feed.table_mass_kg * feed.travel_per_radian().powi(2);
            rigid / Complex64::new(1.0 - u * u, damping)
        }
        false => Complex64::default(),
    };
    let own = match of == by {
        true => model.motor(of).inertia_kg_m2,
        false => 0.0,
    };
    (own + table).norm() * (TAU * hz).powi(2)
}

/// Rms of a residual that counts as nothing, in its channel's unit; 0 of the table's position.
pub(crate) fn small_rms(model: &Model, signals: &Signals, channel: Channel) -> f64 {
    small_share(channel, true) * drive_rms(model, signals, channel)
}

/// Share of what drives a channel, rms, that counts as nothing: beside no effects (`alone`), or beside some.
fn small_share(channel: Channel, alone: bool) -> f64 {
    match (channel, alone) {
        (Channel::Torque(_) | Channel::VoltageD(_), true) => SHARE_OF_DRIVE,
        (Channel::Torque(_), false) => SMALL_TORQUE,
        _ => SMALL_VOLTAGE,
    }
}

/// Rms of what drives a channel: a motor's torque, N m, or its voltage, V; 0 of the table's position.
pub(crate) fn drive_rms(model: &Model, signals: &Signals, channel: Channel) -> f64 {
    match channel {
        Channel::Torque(axis) => {
            let motor = model.motor(axis);
            let constant = f64::from(motor.pole_pairs) * motor.flux_wb;
            constant * signals.motors[axis.index()].i_q_rms
        }
        Channel::VoltageD(axis) | Channel::VoltageQ(axis) => signals.motors[axis.index()].u_rms,
        Channel::Table => 0.0,
    }
}

/// Squared magnitudes of a signal's spectrum.
pub fn power_spectrum(signal: &[f64]) -> Vec<f64> {
    let transform = crate::signal::fourier::transform(signal.len());
    let mut input = signal.to_vec();
    let mut output = transform.make_output_vec();
    transform
        .process(&mut input, &mut output)
        .expect("lengths of the plan");
    output.iter().map(|c| c.norm_sqr()).collect()
}

/// Linear in the logarithm of the value, constant beyond the ends.
fn interpolate(points: &[(f64, f64)], at: f64) -> f64 {
    let after = points.partition_point(|(x, _)| *x < at);
    if after == 0 {
        return points[0].1;
    }
    if after == points.len() {
        return points[after - 1].1;
    }
    let ((x0, y0), (x1, y1)) = (points[after - 1], points[after]);
    (y0.ln() + (y1 / y0).ln() * (at - x0) / (x1 - x0)).exp()
}
