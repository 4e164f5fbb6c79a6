//! What one motor's channels say of each other: angle and speed reference, currents in the rotor's frame and their
//! reference, voltages and the motor's equation. Where a relation fails, the errors that people make are tried on the
//! record; one that mends the relation is named.

mod currents;
mod voltages;

use super::regress::{fit, rms};
use super::{Finding, Limits};
use crate::signal::frames::{clarke, park};
use plant::model::MotorModel;
use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Length of the stretches that are averaged, s: noise of sensors and PWM is gone, ramps are not.
const BLOCK_S: f64 = 5e-3;
/// Stretches that a regression looks at.
const BLOCKS: usize = 1500;

/// The channels of one motor.
#[derive(Clone)]
pub(super) struct Motor<'a> {
    /// Before its channels' names: `screw_`, or nothing.
    pub(super) prefix: &'static str,
    pub(super) rate: f64,
    pub(super) segments: &'a [Range<usize>],
    pub(super) angle: Cow<'a, [f64]>,
    /// Phase currents, where they were recorded.
    pub(super) phases: Option<[Cow<'a, [f64]>; 2]>,
    /// d-q currents, where the phases were not recorded.
    pub(super) dq: Option<[Cow<'a, [f64]>; 2]>,
    pub(super) voltages: Option<[Cow<'a, [f64]>; 2]>,
    pub(super) iq_ref: Option<Cow<'a, [f64]>>,
    /// Reference of the d current; none is 0.
    pub(super) id_ref: Option<Cow<'a, [f64]>>,
    pub(super) speed_ref: Option<Cow<'a, [f64]>>,
    pub(super) plate: &'a MotorModel,
    /// Of the bridge, V; 0 if it is not known.
    pub(super) bus_v: f64,
    /// Standard deviation of a phase current's noise and rounding, A.
    pub(super) current_noise: f64,
}

/// Names of factors that are made by a unit.
const UNITS: [(f64, &str); 10] = [
    (180.0 / PI, "degrees stand for rad"),
    (1.0 / TAU, "turns stand for rad"),
    (60.0 / TAU, "rpm stand for rad/s"),
    (TAU, "rad stand for turns"),
    (1e3, "thousandths stand for the unit"),
    (1e-3, "the unit stands for thousandths"),
    (1e6, "millionths stand for the unit"),
    (
        1.224_744_871,
        "an amplitude-invariant scaling stands for a power-invariant one",
    ),
    (
        0.816_496_581,
        "a power-invariant scaling stands for an amplitude-invariant one",
    ),
    (1.732_050_808, "line values stand for phase values"),
];

/// What a factor is usually made by.
pub(super) fn made_by(factor: f64) -> String {
    let near = |target: f64| (factor.abs() / target - 1.0).abs() < 0.04;
    let sign = if factor < 0.0 {
        "a sign is reversed and "
    } else {
        ""
    };
    if near(1.0) && factor < 0.0 {
        return "; as where a sign is reversed".into();
    }
    UNITS
        .iter()
        .find(|(target, _)| near(*target))
        .map_or_else(String::new, |(_, name)| format!("; as where {sign}{name}"))
}

/// Averages over stretches.
struct Blocks {
    /// Rows of each.
    rows: Vec<Range<usize>>,
    seconds: f64,
}

impl Blocks {
    fn new(motor: &Motor) -> Self {
        let length = ((BLOCK_S * motor.rate).round() as usize).max(2);
        let all: Vec<Range<usize>> = motor
            .segments
            .iter()
            .flat_map(|segment| {
                (segment.start..segment.end.saturating_sub(length))
                    .step_by(length)
                    .map(move |from| from..from + length)
            })
            .collect();
        let every = all.len().div_ceil(BLOCKS).max(1);
        let rows = all.into_iter().step_by(every).collect();
        Blocks {
            rows,
            seconds: length as f64 / motor.rate,
        }
    }

    fn mean(&self, value: impl Fn(usize) -> f64) -> Vec<f64> {
        self.rows
            .iter()
            .map(|rows| rows.clone().map(&value).sum::<f64>() / rows.len() as f64)
            .collect()
    }

    /// Mean slope of a signal.
    fn slope(&self, values: &[f64]) -> Vec<f64> {
        self.rows
            .iter()
            .map(|rows| (values[rows.end] - values[rows.start]) / self.seconds)
            .collect()
    }
}

/// A row's current in the rotor's frame, and the direction of a dead time's voltage.
struct Rotated {
    d: f64,
    q: f64,
    dead_d: f64,
    dead_q: f64,
}

impl Motor<'_> {
    fn name(&self, channel: &str) -> String {
        format!("{}{channel}", self.prefix)
    }

    /// Electrical turns of the record.
    fn electrical_turns(&self) -> f64 {
        let pole_pairs = f64::from(self.plate.pole_pairs);
        let step = ((0.01 * self.rate) as usize).max(1);
        let every: Vec<f64> = self.angle.iter().copied().step_by(step).collect();
        every.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>() * pole_pairs / TAU
    }

    /// Angle and speed reference. Whether they agree.
    pub(super) fn speed(
        &self,
        other: Option<&Motor>,
        limits: &Limits,
        found: &mut Vec<Finding>,
    ) -> bool {
        let Some(reference) = &self.speed_ref else {
            return true;
        };
        let blocks = Blocks::new(self);
        let speed = blocks.slope(&self.angle);
        let asked = blocks.mean(|k| reference[k]);
        if rms(&asked) < 0.2 {
            return true;
        }
        let Some(own) = fit(std::slice::from_ref(&asked), &speed) else {
            return true;
        };
        let ratio = own.values[0];
        let of_other = other.and_then(|other| {
            let reference = other.speed_ref.as_ref()?;
            let fit = fit(&[blocks.mean(|k| reference[k])], &speed)?;
            let follows =
                fit.explained > limits.fixed && limits.speed_ratio.contains(&fit.values[0]);
            let better = 1.0 - own.explained > limits.better * (1.0 - fit.explained);
            (follows && better).then_some(other)
        });
        let sound = own.explained > limits.speed_explained && limits.speed_ratio.contains(&ratio);
        if sound && of_other.is_none() {
            return true;
        }
        let names = [self.name("angle_rad"), self.name("speed_ref_rad_s")];
        let [angle, asked_for] = &names;
        let sentence = if let Some(other) = of_other {
            format!(
                "`{angle}` turns as `{}` asks, expected as `{asked_for}` does: columns of screw and nut are exchanged; map each \
                 to its own",
                other.name("speed_ref_rad_s")
            )
        } else if rms(&speed) < 1e-3 * rms(&asked) {
            format!(
                "`{angle}` stands while `{asked_for}` asks for {:.2} rad/s rms, expected it to turn; is it frozen, or the wrong column?",
                rms(&asked)
            )
        } else if own.explained > limits.fixed {
            let pole_pairs = f64::from(self.plate.pole_pairs);
            let electrical = (ratio / pole_pairs - 1.0).abs() < 0.03 && pole_pairs > 1.0;
            let why = if electrical {
                "; it is the electrical angle".to_owned()
            } else {
                made_by(ratio)
            };
            format!(
                "`{angle}` turns {ratio:.4} times as fast as `{asked_for}` asks, expected once{why}: give its unit, or a scale, in \
                 a mapping file"
            )
        } else {
            format!(
                "`{angle}` does not turn as `{asked_for}` asks ({:.0} % of its speed is explained, expected more than {:.0} %); is \
                 it the right column, or did the motor not follow?",
                100.0 * own.explained.max(0.0),
                100.0 * limits.speed_explained
            )
        };
        found.push(Finding::new(
            "angle",
            &[angle, asked_for],
            [ratio, *limits.speed_ratio.end()],
            sentence,
        ));
        false
    }

    /// Mean electrical speed of each block, rad/s.
    fn electrical_speed(&self, blocks: &Blocks) -> Vec<f64> {
        let pole_pairs = f64::from(self.plate.pole_pairs);
        let slopes = blocks.slope(&self.angle);
        slopes.iter().map(|w| w * pole_pairs).collect()
    }

    /// Lag of the currents behind the angle by how their angle grows with the speed. Whether there is none.
    pub(super) fn lag(&self, limits: &Limits, found: &mut Vec<Finding>) -> bool {
        let (Some(_), Some(r)) = (&self.phases, &self.iq_ref) else {
            return true;
        };
        let blocks = Blocks::new(self);
        let speed = self.electrical_speed(&blocks);
        let currents = self.rotated(&blocks);
        // For small angles the part across is the part along times speed and lag.
        let squares = blocks.mean(|k| r[k] * r[k]);
        let across: Vec<f64> = blocks
            .rows
            .iter()
            .zip(&currents)
            .map(|(rows, of)| {
                // Against the q axis: the part along d with its sign.
                let sum: f64 = rows.clone().zip(of).map(|(k, i)| -i.d * r[k]).sum();
                sum / rows.len() as f64
            })
            .collect();
        let with: Vec<f64> = squares
            .iter()
            .zip(&speed)
            .map(|(square, w)| square * w)
            .collect();
        let Some(fit) = fit(&[with, squares], &across) else {
            return true;
        };
        let (rows, error) = (-fit.values[0] * self.rate, fit.errors[0] * self.rate);
        if rows.abs() < limits.lag_rows + limits.sigmas * error {
            return true;
        }
        let names = ["ia_a", "ib_a", "angle_rad"].map(|name| self.name(name));
        found.push(Finding::new(
            "lag",
            &[&names[0], &names[1], &names[2]],
            [rows, limits.lag_rows],
            format!(
                "`{}` and `{}` lag {rows:.1} rows behind `{}`, expected less than {}: the columns were not sampled at once; shift \
                 them against each other, or record them together",
                names[0], names[1], names[2], limits.lag_rows
            ),
        ));
        false
    }

    /// Currents and dead time's signs in the rotor's frame, of each row of each stretch; nothing without currents.
    fn rotated(&self, blocks: &Blocks) -> Vec<Vec<Rotated>> {
        let pole_pairs = f64::from(self.plate.pole_pairs);
        let of = |k: usize| {
            let (sin, cos) = (pole_pairs * self.angle[k]).sin_cos();
            let (d, q) = match (&self.dq, &self.phases) {
                (Some([d, q]), _) => (d[k], q[k]),
                (None, Some([a, b])) => park(clarke(a[k], b[k]), (cos, sin)),
                (None, None) => (0.0, 0.0),
            };
            // A dead time's voltage is along the signs of the phases' currents.
            let (alpha, beta) = (d * cos - q * sin, d * sin + q * cos);
            let third = 3f64.sqrt() / 2.0;
            let signs = [
                alpha,
                third * beta - 0.5 * alpha,
                -third * beta - 0.5 * alpha,
            ]
            .map(f64::signum);
            let scale = (2.0f64 / 3.0).sqrt();
            let along = scale * (signs[0] - 0.5 * (signs[1] + signs[2]));
            let across = scale * third * (signs[1] - signs[2]);
            Rotated {
                d,
                q,
                dead_d: along * cos + across * sin,
                dead_q: across * cos - along * sin,
            }
        };
        blocks
            .rows
            .iter()
            .map(|rows| rows.clone().map(of).collect())
            .collect()
    }

    fn has_currents(&self) -> bool {
        self.dq.is_some() || self.phases.is_some()
    }

    /// Torque and acceleration: the inertia, over the declared one with what is coupled to the shaft.
    pub(super) fn inertia(&self, coupled: f64, limits: &Limits, found: &mut Vec<Finding>) -> bool {
        if !self.has_currents() {
            return true;
        }
        let blocks = Blocks::new(self);
        let plate = self.plate;
        let declared = plate.inertia_kg_m2 + coupled;
        let constant = f64::from(plate.pole_pairs) * plate.flux_wb;
        // Differences over 20 ms, so that the encoder's counts are no acceleration.
        let reach = ((0.02 * self.rate).round() as usize).max(1);
        let within = |rows: &Range<usize>| {
            self.segments
                .iter()
                .any(|s| rows.start >= s.start + reach && rows.end + reach <= s.end)
        };
        let blocks = Blocks {
            rows: blocks.rows.into_iter().filter(within).collect(),
            seconds: blocks.seconds,
        };
        let speed = blocks.slope(&self.angle);
        let span = reach as f64 / self.rate;
        let acceleration: Vec<f64> = blocks
            .rows
            .iter()
            .map(|rows| {
                let k = (rows.start + rows.end) / 2;
                declared * (self.angle[k + reach] - 2.0 * self.angle[k] + self.angle[k - reach])
                    / (span * span)
            })
            .collect();
        let torque: Vec<f64> = self
            .rotated(&blocks)
            .iter()
            .map(|rows| constant * rows.iter().map(|i| i.q).sum::<f64>() / rows.len() as f64)
            .collect();
        let size = rms(&acceleration);
        let whole = rms(&torque);
        let columns = [
            acceleration,
            speed.iter().map(|w| (w / 0.3).tanh()).collect(),
            speed,
            vec![1.0; torque.len()],
        ];
        let Some(fit) = fit(&columns, &torque) else {
            return true;
        };
        let (ratio, error) = (fit.values[0], limits.sigmas * fit.errors[0]);
        // Without acceleration an inertia is unknown.
        if size * ratio.abs().max(1.0) < 0.2 * whole {
            return true;
        }
        let range = &limits.inertia_ratio;
        if ratio + error > *range.start() && ratio - error < *range.end() {
            return true;
        }
        let what = match ratio < 0.0 {
            true => format!(
                "the torque current works against the acceleration (the inertia is {ratio:.3} times the declared one), expected with it: \
                 the sign of the currents or of the angle is reversed"
            ),
            false => format!(
                "torque and acceleration give an inertia of {:.6} kg m2, but the model declares {declared:.6} kg m2, a factor of \
                 {ratio:.3} (expected {:.2} to {:.1}); correct inertia_kg_m2, or the unit of currents or angle",
                ratio * declared,
                range.start(),
                range.end()
            ),
        };
        let names = [self.name("angle_rad"), self.name("ia_a")];
        found.push(Finding::new(
            "inertia",
            &[&names[0], &names[1]],
            [ratio, *range.end()],
            what,
        ));
        false
    }
}
