//! What to try: hypotheses with listed shapes, and those that the order spectra of a residual suggest.

use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::limits::excited;
use crate::regression::column::counted;
use crate::regression::normal::Solution;
use crate::search::select::Search;
use crate::signal::along::{LEAST_ORDER, LEAST_RELATIVE_ORDER};
use crate::signal::channel::Channel;
use crate::signal::noise::USED;
use crate::signal::noise::declared_resonance_hz;
use crate::signal::scan::{OrderSpectrum, Stretch, peaks};
use plant::Axis;
use plant::effects::Place;

/// Where to look for what repeats with screw against nut.
const RELATIVE_ORDERS: std::ops::Range<f64> = LEAST_RELATIVE_ORDER..60.0;

impl Search<'_> {
    /// The hypotheses with a listed shape, and those whose shape the order spectra suggest.
    pub(crate) fn hypotheses(&self, solution: &Solution) -> Vec<Hypothesis> {
        let mut list = Vec::new();
        let sensing = &self.balance.model.sensing;
        let ripple = sensing.current_noise_a.max(sensing.current_lsb_a).max(1e-3);
        for place in [Place::Screw, Place::Nut] {
            list.push(Hypothesis::new(Family::DeadTime, place, ripple));
            for family in [
                Family::CurrentOffset,
                Family::CurrentGain,
                Family::ResistanceDrift,
                Family::FluxDrift,
            ] {
                list.push(Hypothesis::new(family, place, 0.0));
            }
            for order in [1.0, 2.0] {
                list.push(Hypothesis::new(Family::EncoderEccentricity, place, order));
            }
            for speed in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
                list.push(Hypothesis::new(Family::StribeckFriction, place, speed));
            }
        }
        list.push(Hypothesis::new(Family::DeadTime, Place::Both, ripple));
        for place in [Place::Screw, Place::Nut, Place::Feed] {
            let there = Family::linear().filter(|family| family.is_at(place));
            list.extend(there.map(|family| Hypothesis::new(family, place, 0.0)));
        }
        list.push(Hypothesis::new(Family::Backlash, Place::Feed, 0.0));
        // The play of a table that turns, in place of one that a load holds on a flank.
        list.push(Hypothesis::new(Family::Backlash, Place::Feed, 1.0));
        for speed in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
            list.push(Hypothesis::new(
                Family::StribeckFriction,
                Place::Feed,
                speed * self.balance.lead,
            ));
        }
        let declared = declared_resonance_hz(self.balance.model);
        for share in [
            0.08, 0.12, 0.17, 0.24, 0.33, 0.42, 0.52, 0.62, 0.73, 0.82, 0.9,
        ] {
            list.push(Hypothesis::new(
                Family::AxialCompliance,
                Place::Feed,
                share * declared,
            ));
        }
        list.extend(self.scanned(solution));
        let machine = self.balance.signals.machine;
        list.retain(|hypothesis| hypothesis.is_on(machine));
        list.retain(|hypothesis| match excited(hypothesis, self.balance) {
            Ok(()) => true,
            Err(reason) => {
                let refusals = &self.balance.refusals;
                refusals.count(hypothesis.name(), hypothesis.place, reason);
                false
            }
        });
        list
    }

    /// The residual through the whitening once more, by channel.
    fn scores(&self, solution: &Solution) -> Vec<Vec<f64>> {
        let left = self.normal.residual(&solution.values);
        Channel::ALL
            .iter()
            .map(|&channel| match &left.parts[channel.index()] {
                Some(part) => self
                    .balance
                    .fourier
                    .again(part, self.whitener.gain(channel)),
                None => vec![0.0; self.balance.fourier.decimated_rows()],
            })
            .collect()
    }

    /// Operating points without the parts of their ramps that are faster than the plateau.
    fn stretches(&self, speed: &dyn Fn(usize) -> f64) -> Vec<Stretch> {
        self.whitener
            .folds
            .iter()
            .map(|fold| {
                let middle = fold.start + (fold.end - fold.start) / 2;
                let around =
                    fold.start.max(middle.saturating_sub(200))..(middle + 200).min(fold.end);
                let n = around.len().max(1) as f64;
                let plateau = around.map(|k| speed(k).abs()).sum::<f64>() / n;
                let end = fold
                    .clone()
                    .rev()
                    .find(|&k| speed(k).abs() <= 1.1 * plateau + 0.1)
                    .map_or(fold.end, |k| k + 1);
                Stretch {
                    rows: fold.start..end,
                    speed: plateau,
                }
            })
            .collect()
    }

    fn scanned(&self, solution: &Solution) -> Vec<Hypothesis> {
        let scores = self.scores(solution);
        let step = self.balance.fourier.step();
        let signals = self.balance.signals;
        let mut list = Vec::new();
        for &axis in signals.machine.axes() {
            let place = Place::from(axis);
            let spectrum = self.torque_orders(&scores, axis);
            for order in spectrum.peaks(5, 2.0 / spectrum.turns) {
                let near = order.round();
                let whole = near >= 1.0 && (order - near).abs() < 1.0 / spectrum.turns;
                let order = if whole { near } else { order };
                list.push(Hypothesis::new(Family::AngleTorque, place, order));
            }
            for order in self.flux_orders(&scores, axis) {
                list.push(Hypothesis::new(Family::FluxHarmonic, place, order));
            }
            for hz in self.frequencies(&scores, axis) {
                list.push(Hypothesis::new(Family::TimePeriodic, place, hz));
            }
        }
        if !signals.machine.has_feed() {
            return list;
        }
        let relative: Vec<f64> = (0..self.balance.fourier.decimated_rows())
            .map(|k| signals.relative[k * step])
            .collect();
        let stretches = self.stretches(&|k| signals.relative_speed[k * step]);
        let table = OrderSpectrum::new(
            &scores[Channel::Table.index()],
            &relative,
            &stretches,
            &|index, hz| self.weight(Channel::Table, &stretches[index], hz),
            self.highest_hz(),
            RELATIVE_ORDERS,
        );
        for order in table.peaks(4, 2.0 / table.turns) {
            list.push(Hypothesis::new(Family::LeadError, Place::Feed, order));
        }
        let pair: Vec<f64> = scores[0]
            .iter()
            .zip(&scores[1])
            .map(|(a, b)| a - b)
            .collect();
        let weight = |index: usize, hz: f64| {
            Axis::ALL
                .iter()
                .map(|&axis| self.weight(Channel::Torque(axis), &stretches[index], hz))
                .sum()
        };
        let pair = OrderSpectrum::new(
            &pair,
            &relative,
            &stretches,
            &weight,
            self.highest_hz(),
            RELATIVE_ORDERS,
        );
        for order in pair.peaks(4, 2.0 / pair.turns) {
            list.push(Hypothesis::new(Family::BallPassage, Place::Feed, order));
        }
        list
    }

    /// Highest frequency that is used, Hz: above it whitening leaves next to nothing to weigh by.
    fn highest_hz(&self) -> f64 {
        let fourier = self.balance.fourier;
        USED * fourier.hz(fourier.bins())
    }

    /// Squared whitening gain of a channel at a frequency, times the rows of a stretch that count.
    fn weight(&self, channel: Channel, stretch: &Stretch, hz: f64) -> f64 {
        let fourier = self.balance.fourier;
        let bin = (hz / fourier.hz(1)) as usize;
        let gain = self.whitener.gain(channel).get(bin).copied().unwrap_or(0.0);
        let open = counted(&self.whitener.mask(channel)[stretch.rows.clone()]);
        gain * gain * open as f64
    }

    /// The order spectrum of a motor's torque residual.
    pub fn torque_orders(&self, scores: &[Vec<f64>], axis: Axis) -> OrderSpectrum {
        let step = self.balance.fourier.step();
        let motor = &self.balance.signals.motors[axis.index()];
        let angle: Vec<f64> = (0..self.balance.fourier.decimated_rows())
            .map(|k| motor.theta[k * step])
            .collect();
        let stretches = self.stretches(&|k| motor.omega[k * step]);
        let channel = Channel::Torque(axis);
        OrderSpectrum::new(
            &scores[channel.index()],
            &angle,
            &stretches,
            &|index, hz| self.weight(channel, &stretches[index], hz),
            self.highest_hz(),
            // From below one period per turn to what the slowest operating point resolves.
            LEAST_ORDER..126.0,
        )
    }

    /// The orders per electrical turn at which a flux harmonic would explain most.
    fn flux_orders(&self, scores: &[Vec<f64>], axis: Axis) -> Vec<f64> {
        let step = self.balance.fourier.step();
        let motor = &self.balance.signals.motors[axis.index()];
        let declared = self.balance.model.motor(axis);
        let pole_pairs = f64::from(declared.pole_pairs);
        let rows = self.balance.fourier.decimated_rows();
        let angle: Vec<f64> = (0..rows)
            .map(|k| pole_pairs * motor.theta[k * step])
            .collect();
        let per_current = -pole_pairs * declared.flux_wb;
        let (torque, q) = (Channel::Torque(axis), Channel::VoltageQ(axis));
        let emf = |k: usize| declared.flux_wb * pole_pairs * motor.omega[k * step];
        let score: Vec<f64> = (0..rows)
            .map(|k| {
                per_current * motor.i_q_smooth[k * step] * scores[torque.index()][k]
                    + emf(k) * scores[q.index()][k]
            })
            .collect();
        let stretches = self.stretches(&|k| pole_pairs * motor.omega[k * step]);
        let currents: Vec<f64> = stretches
            .iter()
            .map(|s| {
                let mean = s
                    .rows
                    .clone()
                    .map(|k| motor.i_q_smooth[k * step].powi(2))
                    .sum::<f64>()
                    / s.rows.len().max(1) as f64;
                per_current * per_current * mean
            })
            .collect();
        let weight = |index: usize, hz: f64| {
            let stretch = &stretches[index];
            let volts = declared.flux_wb * stretch.speed;
            currents[index] * self.weight(torque, stretch, hz)
                + volts * volts * self.weight(q, stretch, hz)
        };
        let spectrum = OrderSpectrum::new(
            &score,
            &angle,
            &stretches,
            &weight,
            self.highest_hz(),
            0.7..30.0,
        );
        let mut whole: Vec<(f64, f64)> = (1..30)
            .filter_map(|n| {
                let at = (f64::from(n) / spectrum.spacing).round() as usize;
                spectrum.fall.get(at).map(|&fall| (fall, f64::from(n)))
            })
            .collect();
        whole.sort_by(|a, b| b.0.total_cmp(&a.0));
        whole.into_iter().take(3).map(|(_, n)| n).collect()
    }

    /// The frequencies at which a torque locked to time would explain most.
    fn frequencies(&self, scores: &[Vec<f64>], axis: Axis) -> Vec<f64> {
        let channel = Channel::Torque(axis);
        let fourier = self.balance.fourier;
        let rate = self.balance.signals.rate / fourier.step() as f64;
        let rows = scores[channel.index()].len();
        let line = rate / (2 * rows) as f64;
        // Zeros behind the record halve the distance of the lines, so that none falls between two.
        let mut padded = scores[channel.index()].clone();
        padded.resize(2 * rows, 0.0);
        let power = crate::signal::noise::power_spectrum(&padded);
        let open = self.whitener.rows(channel) as f64;
        let fall: Vec<f64> = power
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let hz = k as f64 * line;
                let gain = self
                    .whitener
                    .gain(channel)
                    .get((hz / fourier.hz(1)) as usize)
                    .copied()
                    .unwrap_or(0.0);
                if hz < 0.7 || gain * gain < 1e-12 {
                    0.0
                } else {
                    2.0 * p / (gain * gain * open)
                }
            })
            .collect();
        let peaks = peaks(fall, 3, 8);
        peaks.into_iter().map(|at| at as f64 * line).collect()
    }
}
