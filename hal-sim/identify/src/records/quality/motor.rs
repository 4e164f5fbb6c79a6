//! What one motor's channels say of each other: angle and speed reference, currents in the rotor's frame and their
//! reference, voltages and the motor's equation. Where a relation fails, the errors that people make are tried on the
//! record; one that mends the relation is named.

use super::regress::{Fit, fit, rms};
use super::{Finding, Limits};
use crate::regression::bounded::solve_within;
use crate::signal::frames::{clarke, park};
use nalgebra::{Complex, DMatrix, DVector, Matrix3, Vector3};
use plant::model::MotorModel;
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::{Range, RangeInclusive};

/// Length of the stretches that are averaged, s: noise of sensors and PWM is gone, ramps are not.
const BLOCK_S: f64 = 5e-3;
/// Share of the voltages' squares by which a value of the plate must matter. At one speed resistance and flux are distinguished by next to
/// nothing, and a little that no equation has moves either by a multiple: of 200 sound machines eight, whose records show one speed or
/// two, were called wrong without this. A resistance of a hundredth, where little current flows, matters by a thousandth.
const MATTERS: f64 = 2e-4;
/// Rows that a fit of the currents looks at: enough for a hundredth.
const LOOKED_AT: usize = 6000;
/// Stretches that a regression looks at.
const BLOCKS: usize = 1500;
/// Pole pairs that are tried.
const MOST_POLE_PAIRS: i32 = 64;

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
    pub(super) speed_ref: Option<Cow<'a, [f64]>>,
    pub(super) plate: &'a MotorModel,
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

/// How the phase currents follow their reference in the rotor's frame: `z = gain r + offset e^-jpt + negative r e^-2jpt`.
struct Currents {
    /// 1 where all is right: measured against reference, turned by the angle between them.
    gain: Complex<f64>,
    /// Constant part of the phases, A.
    offset: f64,
    /// Negative sequence against positive.
    negative: f64,
    explained: f64,
}

impl Currents {
    /// Whether nothing of it is wrong.
    fn sound(&self, limits: &Limits) -> bool {
        self.explained > limits.fixed
            && limits.current_ratio.contains(&self.gain.norm())
            && self.gain.arg().abs() < limits.current_angle
            && self.negative < limits.negative_sequence
    }
}

/// A row's current in the rotor's frame, and the direction of a dead time's voltage.
struct Rotated {
    d: f64,
    q: f64,
    dead_d: f64,
    dead_q: f64,
}

impl<'a> Motor<'a> {
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

    /// The fit of the currents with so many pole pairs; `None` without phases or reference.
    fn currents(&self, pole_pairs: f64) -> Option<Currents> {
        let ([a, b], r) = (self.phases.as_ref()?, self.iq_ref.as_ref()?);
        let step = (a.len() / LOOKED_AT).max(1);
        let turning = self.electrical_turns() > 2.0;
        let mut normal = Matrix3::<Complex<f64>>::zeros();
        let mut right = Vector3::<Complex<f64>>::zeros();
        let mut rows = Vec::with_capacity(LOOKED_AT);
        for k in (0..a.len()).step_by(step) {
            let turn = Complex::from_polar(1.0, -pole_pairs * self.angle[k]);
            let (alpha, beta) = clarke(a[k], b[k]);
            let vector = Complex::new(alpha, beta);
            // The reference is along q, a quarter turn ahead of d.
            let z = vector * turn * Complex::from_polar(1.0, -FRAC_PI_2);
            let columns = Vector3::new(r[k].into(), turn, turn * turn * r[k]);
            let width = if turning { 3 } else { 1 };
            for i in 0..width {
                right[i] += columns[i].conj() * z;
                for j in 0..width {
                    normal[(i, j)] += columns[i].conj() * columns[j];
                }
            }
            rows.push((z, columns));
        }
        if !turning {
            normal[(1, 1)] = 1.0.into();
            normal[(2, 2)] = 1.0.into();
        }
        let found = normal.lu().solve(&right)?;
        let (mut left, mut whole) = (0.0, 0.0);
        for (z, columns) in &rows {
            let model: Complex<f64> = (0..3).map(|k| columns[k] * found[k]).sum();
            left += (z - model).norm_sqr();
            whole += z.norm_sqr();
        }
        Some(Currents {
            gain: found[0],
            offset: found[1].norm() / 1.5f64.sqrt(),
            negative: found[2].norm() / found[0].norm().max(1e-12),
            explained: if whole > 0.0 { 1.0 - left / whole } else { 0.0 },
        })
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

    /// Phase currents in the rotor's frame and their reference. Whether they agree.
    pub(super) fn current(
        &self,
        other: Option<&Motor>,
        limits: &Limits,
        found: &mut Vec<Finding>,
    ) -> bool {
        let Some(reference) = &self.iq_ref else {
            return true;
        };
        let pole_pairs = f64::from(self.plate.pole_pairs);
        let Some(own) = self.currents(pole_pairs) else {
            return true;
        };
        let size = rms(reference);
        let names = ["ia_a", "ib_a", "iq_ref_a", "angle_rad"].map(|name| self.name(name));
        let [ia, ib, iq, angle] = &names;
        let all = [ia.as_str(), ib.as_str(), iq.as_str(), angle.as_str()];
        // Noise shows nothing.
        let loud = size > 5.0 * 3f64.sqrt() * self.current_noise && size > 1e-6;
        if !loud {
            return true;
        }
        let of_other = other.and_then(|other| {
            let changed = Motor {
                iq_ref: other.iq_ref.clone(),
                ..self.clone()
            };
            let currents = changed.currents(pole_pairs)?;
            let better = 1.0 - own.explained > limits.better * (1.0 - currents.explained);
            (currents.sound(limits) && better).then_some(other)
        });
        if let Some(other) = of_other {
            found.push(Finding::new(
                "currents_exchanged",
                &all,
                [own.explained, limits.fixed],
                format!(
                    "the measured current follows `{}iq_ref_a`, expected it to follow `{iq}`: columns of screw and nut are exchanged; \
                     exchange them in the mapping",
                    other.prefix
                ),
            ));
            return false;
        }
        if own.sound(limits) {
            let slow = own.offset > limits.current_offset * size && self.electrical_turns() > 2.0;
            if slow {
                found.push(Finding::new(
                    "current_offset",
                    &[ia, ib],
                    [own.offset, limits.current_offset * size],
                    format!(
                        "`{ia}` and `{ib}` have a constant part of {:.3} A beside {size:.3} A rms of torque current, expected less \
                         than half of it: the current loop would have driven it out; check the sensors' zeros in the mapping",
                        own.offset
                    ),
                ));
            }
            return !slow;
        }
        let offset = own.offset > limits.current_offset * size;
        let wrong = own.explained < limits.current_explained
            || !limits.current_ratio.contains(&own.gain.norm()) && own.explained > limits.fixed
            || own.gain.arg().abs() > limits.current_angle && own.explained > limits.fixed
            || own.negative > limits.negative_sequence
            || offset;
        if !wrong {
            return true;
        }
        let mut push = |code: &'static str, statistic: [f64; 2], sentence: String| {
            found.push(Finding::new(code, &all, statistic, sentence));
        };
        let explained = [own.explained, limits.current_explained];
        if own.explained > limits.fixed && own.negative < limits.negative_sequence && !offset {
            let (ratio, turned) = (own.gain.norm(), own.gain.arg());
            if turned.abs() > PI - limits.current_angle {
                push(
                    "current_sign",
                    [turned, limits.current_angle],
                    format!(
                        "`{ia}` and `{ib}` make a torque current of {:.3} times `{iq}`, expected once: the sign of the currents is \
                         reversed{}; give them the scale -1 in a mapping file",
                        -ratio,
                        if limits.current_ratio.contains(&ratio) {
                            String::new()
                        } else {
                            made_by(ratio)
                        }
                    ),
                );
            } else if turned.abs() > limits.current_angle {
                push(
                    "electrical_zero",
                    [turned, limits.current_angle],
                    format!(
                        "the measured current is turned against `{iq}` by {:.0} degrees electrical, expected 0: `{angle}` has \
                         another zero than the rotor's field; give it the offset {:.5} rad in a mapping file",
                        turned.to_degrees(),
                        turned / pole_pairs
                    ),
                );
            } else {
                push(
                    "current_scale",
                    [ratio, *limits.current_ratio.end()],
                    format!(
                        "the measured current is {ratio:.4} times `{iq}`, expected once{}; give their units in a mapping file",
                        made_by(ratio)
                    ),
                );
            }
            return false;
        }
        if let Some(how) = self.mended(other, limits) {
            push("currents_exchanged", explained, how);
            return false;
        }
        if let Some((best, currents)) = self.other_pole_pairs(limits) {
            let sentence = if f64::from(best) == -pole_pairs {
                format!(
                    "the current turns against `{angle}`, expected with it: the angle's sign is reversed, or phases a and b are \
                     exchanged; give the angle the scale -1, or exchange `{ia}` and `{ib}`"
                )
            } else {
                format!(
                    "the current turns {best} times a turn of `{angle}` ({:.0} % explained), expected the plate's {} pole pairs \
                     ({:.0} %); correct pole_pairs in the model, or the angle's unit",
                    100.0 * currents.explained,
                    self.plate.pole_pairs,
                    100.0 * own.explained.max(0.0)
                )
            };
            push("pole_pairs", explained, sentence);
            return false;
        }
        let sentence = if own.negative > limits.negative_sequence {
            format!(
                "`{ia}` and `{ib}` are no two phases of one motor: their negative sequence is {:.0} % of the positive one, \
                 expected less than {:.0} %; one of them has another sign or unit, or is another column",
                100.0 * own.negative,
                100.0 * limits.negative_sequence
            )
        } else if offset {
            format!(
                "`{ia}` and `{ib}` have a constant part of {:.3} A beside {size:.3} A rms of torque current, expected less than \
                 half of it; check the sensors' zeros in the mapping",
                own.offset
            )
        } else {
            format!(
                "the phase currents do not follow `{iq}` in the rotor's frame ({:.0} % explained, expected more than {:.0} %): one of \
                 `{ia}`, `{ib}`, `{iq}`, `{angle}` is not what its name says",
                100.0 * own.explained.max(0.0),
                100.0 * limits.current_explained
            )
        };
        push("currents", explained, sentence);
        false
    }

    /// The number of pole pairs, or its negative, with which the currents turn.
    fn other_pole_pairs(&self, limits: &Limits) -> Option<(i32, Currents)> {
        if self.electrical_turns() < 2.0 {
            return None;
        }
        (-MOST_POLE_PAIRS..=MOST_POLE_PAIRS)
            .filter(|p| *p != 0 && *p != self.plate.pole_pairs as i32)
            .filter_map(|p| Some((p, self.currents(f64::from(p))?)))
            .filter(|(_, currents)| {
                currents.explained > limits.fixed && currents.negative < limits.negative_sequence
            })
            .max_by(|a, b| a.1.explained.total_cmp(&b.1.explained))
    }

    /// The error in one column that explains the currents, in words.
    fn mended(&self, other: Option<&Motor>, limits: &Limits) -> Option<String> {
        let pole_pairs = f64::from(self.plate.pole_pairs);
        let [ia, ib] = ["ia_a", "ib_a"].map(|name| self.name(name));
        let phases = self.phases.clone()?;
        let scaled = |which: usize, factor: f64| {
            let mut changed = self.clone();
            let mut phases = phases.clone();
            phases[which] = phases[which].iter().map(|v| v * factor).collect();
            changed.phases = Some(phases);
            changed
        };
        let mut tried: Vec<(Motor, String)> = Vec::new();
        let exchanged = Motor {
            phases: Some([phases[1].clone(), phases[0].clone()]),
            ..self.clone()
        };
        for (which, name) in [(0, &ia), (1, &ib)] {
            for factor in [-1.0, 1e-3, 1e3] {
                let words = format!(
                    "`{name}` fits the other phase and the reference only times {factor}, expected as it is: its sign or unit is wrong; give its \
                     unit or scale in a mapping file"
                );
                tried.push((scaled(which, factor), words));
            }
        }
        tried.push((exchanged, format!("`{ia}` and `{ib}` are exchanged: so the current turns with the angle, expected as they are mapped; exchange them in the mapping")));
        if let Some(other) = other
            && let Some(theirs) = &other.phases
        {
            for (which, name) in [(0, &ia), (1, &ib)] {
                let mut changed = self.clone();
                let mut own = phases.clone();
                own[which] = theirs[which].clone();
                changed.phases = Some(own);
                tried.push((changed, format!("`{name}` is the other motor's, expected this one's: with `{}{}` in its place the currents follow their reference; exchange them in the mapping", other.prefix, ["ia_a", "ib_a"][which])));
            }
            let both = Motor {
                phases: Some(theirs.clone()),
                ..self.clone()
            };
            tried.push((both, format!("`{ia}` and `{ib}` are the other motor's, expected this one's; exchange the columns in the mapping")));
            let angle = Motor {
                angle: other.angle.clone(),
                ..self.clone()
            };
            tried.push((angle, format!("`{}` is the other motor's, expected this one's; exchange the columns in the mapping", self.name("angle_rad"))));
            let reference = Motor {
                iq_ref: other.iq_ref.clone(),
                ..self.clone()
            };
            tried.push((reference, format!("`{}` is the other motor's, expected this one's; exchange the columns in the mapping", self.name("iq_ref_a"))));
        }
        tried
            .into_iter()
            .find(|(changed, _)| {
                changed
                    .currents(pole_pairs)
                    .is_some_and(|c| c.sound(limits))
            })
            .map(|(_, words)| words)
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

    /// Resistance, inductance, flux and dead time by the voltage equation, over those that are declared; dead time in V.
    fn equation(&self) -> Option<Fit> {
        let (columns, voltages) = self.equation_rows()?;
        fit(&columns, &voltages)
    }

    /// Whether values within their ranges explain as much of the voltages as any.
    fn explained_within(&self, free: &Fit, ranges: [&RangeInclusive<f64>; 3]) -> bool {
        let Some((columns, voltages)) = self.equation_rows() else {
            return true;
        };
        let design = DMatrix::from_fn(voltages.len(), columns.len(), |row, k| columns[k][row]);
        let voltages = DVector::from_vec(voltages);
        // A dead time may be any. Within bounds about the middle of each range.
        let middle = DVector::from_fn(columns.len(), |k, _| {
            ranges.get(k).map_or(0.0, |r| 0.5 * (r.start() + r.end()))
        });
        let bounds = [0, 1, 2, 3].map(|k| {
            let range = ranges.get(k);
            range.map_or(f64::INFINITY, |r| 0.5 * (r.end() - r.start()))
        });
        let left = &voltages - &design * middle;
        let (gram, rhs) = (design.tr_mul(&design), design.tr_mul(&left));
        let within = solve_within(&gram, &rhs, &bounds, &[]).values;
        let left = (left - design * within).norm_squared();
        left <= (1.0 - free.explained + MATTERS) * voltages.norm_squared()
    }

    /// Columns of the voltage equation and the voltages, d and q of each stretch.
    fn equation_rows(&self) -> Option<([Vec<f64>; 4], Vec<f64>)> {
        let [ud, uq] = self.voltages.as_ref()?;
        if !self.has_currents() {
            return None;
        }
        let blocks = Blocks::new(self);
        let speed = self.electrical_speed(&blocks);
        let rotated = self.rotated(&blocks);
        let mean = |value: fn(&Rotated) -> f64| -> Vec<f64> {
            let of = |rows: &Vec<Rotated>| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
            rotated.iter().map(of).collect()
        };
        let (id, iq) = (mean(|i| i.d), mean(|i| i.q));
        let (sd, sq) = (mean(|i| i.dead_d), mean(|i| i.dead_q));
        let (md, mq) = (blocks.mean(|k| ud[k]), blocks.mean(|k| uq[k]));
        let pair = |d: &dyn Fn(usize) -> f64, q: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..speed.len()).flat_map(|k| [d(k), q(k)]).collect()
        };
        let plate = self.plate;
        let columns = [
            pair(&|k| plate.resistance_ohm * id[k], &|k| {
                plate.resistance_ohm * iq[k]
            }),
            pair(&|k| -plate.inductance_h * speed[k] * iq[k], &|k| {
                plate.inductance_h * speed[k] * id[k]
            }),
            pair(&|_| 0.0, &|k| plate.flux_wb * speed[k]),
            pair(&|k| sd[k], &|k| sq[k]),
        ];
        Some((columns, pair(&|k| md[k], &|k| mq[k])))
    }

    fn equation_sound(&self, fit: &Fit, limits: &Limits) -> bool {
        fit.explained > limits.fixed
            && limits.flux_ratio.contains(&fit.values[2])
            && limits.resistance_ratio.contains(&fit.values[0])
    }

    /// Voltages and the motor's equation. Whether they agree.
    pub(super) fn voltage(
        &self,
        other: Option<&Motor>,
        limits: &Limits,
        found: &mut Vec<Finding>,
    ) -> bool {
        let Some(own) = self.equation() else {
            return true;
        };
        let names = ["ud_v", "uq_v"].map(|name| self.name(name));
        let [ud, uq] = &names;
        let ranges = [
            &limits.resistance_ratio,
            &limits.inductance_ratio,
            &limits.flux_ratio,
        ];
        let wrong = [0, 1, 2].map(|k| {
            let (value, error) = (own.values[k], limits.sigmas * own.errors[k]);
            value + error < *ranges[k].start() || value - error > *ranges[k].end()
        });
        let [r, l, f] = [own.values[0], own.values[1], own.values[2]];
        let is_wrong = wrong.contains(&true) && !self.explained_within(&own, ranges);
        if !is_wrong && own.explained >= limits.voltage_explained {
            return true;
        }
        let statistic = [f, *limits.flux_ratio.end()];
        let mut push = |code: &'static str, statistic: [f64; 2], sentence: String| {
            found.push(Finding::new(
                code,
                &[ud.as_str(), uq.as_str()],
                statistic,
                sentence,
            ));
        };
        for (changed, words) in self.mended_voltages(other) {
            if changed
                .equation()
                .is_some_and(|fit| self.equation_sound(&fit, limits))
            {
                push("voltages", statistic, words);
                return false;
            }
        }
        let plate = self.plate;
        let sentence = if wrong[0] && !wrong[2] {
            format!(
                "by the voltage equation the resistance is {:.4} ohm, but the model declares {:.4} ohm, a factor of {r:.3} that no \
                 temperature makes (expected {:.1} to {:.1}); correct resistance_ohm, or the unit of the currents",
                r * plate.resistance_ohm,
                plate.resistance_ohm,
                limits.resistance_ratio.start(),
                limits.resistance_ratio.end()
            )
        } else if wrong[2] {
            format!(
                "by the voltage equation the back-EMF is {f:.4} times that of {} pole pairs and {:.5} Wb, expected {:.1} to {:.2}{}; \
                 correct pole_pairs or flux_wb, or the unit or sign of `{uq}` or of the angle",
                plate.pole_pairs,
                plate.flux_wb,
                limits.flux_ratio.start(),
                limits.flux_ratio.end(),
                made_by(f)
            )
        } else if wrong[1] {
            format!(
                "by the voltage equation the inductance is {:.6} H, but the model declares {:.6} H, a factor of {l:.3} (expected {:.2} \
                 to {:.1}); correct inductance_h, or is `{ud}` another column?",
                l * plate.inductance_h,
                plate.inductance_h,
                limits.inductance_ratio.start(),
                limits.inductance_ratio.end()
            )
        } else {
            format!(
                "`{ud}` and `{uq}` do not follow currents and speed ({:.0} % explained with any resistance, inductance and flux, \
                 expected more than {:.0} %); are they the right columns?",
                100.0 * own.explained.max(0.0),
                100.0 * limits.voltage_explained
            )
        };
        push(
            "voltage_equation",
            if wrong[0] && !wrong[2] {
                [r, *limits.resistance_ratio.end()]
            } else {
                statistic
            },
            sentence,
        );
        false
    }

    /// Errors in the voltages' columns that are tried.
    fn mended_voltages(&self, other: Option<&Motor<'a>>) -> Vec<(Motor<'a>, String)> {
        let Some([d, q]) = self.voltages.clone() else {
            return Vec::new();
        };
        let [ud, uq] = ["ud_v", "uq_v"].map(|name| self.name(name));
        let with = |d: Cow<'a, [f64]>, q: Cow<'a, [f64]>| Motor {
            voltages: Some([d, q]),
            ..self.clone()
        };
        let times = |values: &Cow<'a, [f64]>, factor: f64| -> Cow<'a, [f64]> {
            values.iter().map(|v| v * factor).collect()
        };
        let mut tried = vec![(
            with(q.clone(), d.clone()),
            format!(
                "`{ud}` and `{uq}` are exchanged: so they follow currents and speed, expected as they are mapped; exchange them in the mapping"
            ),
        )];
        for factor in [-1.0, 1e-3, 1e3, 0.816_496_581, 1.224_744_871] {
            let why = made_by(1.0 / factor);
            tried.push((
                with(times(&d, factor), times(&q, factor)),
                format!("`{ud}` and `{uq}` follow currents and speed only times {factor}, expected as they are{why}; give their unit or scale in a mapping file"),
            ));
            tried.push((
                with(d.clone(), times(&q, factor)),
                format!("`{uq}` follows currents and speed only times {factor}, expected as it is{why}; give its unit or scale in a mapping file"),
            ));
            tried.push((
                with(times(&d, factor), q.clone()),
                format!("`{ud}` follows currents and speed only times {factor}, expected as it is{why}; give its unit or scale in a mapping file"),
            ));
        }
        if let Some(other) = other
            && let Some([od, oq]) = &other.voltages
        {
            let theirs = |what: &str| {
                format!(
                    "{what} the other motor's, expected this one's; exchange the columns in the mapping"
                )
            };
            tried.push((with(d.clone(), oq.clone()), theirs(&format!("`{uq}` is"))));
            tried.push((with(od.clone(), q.clone()), theirs(&format!("`{ud}` is"))));
            tried.push((
                with(od.clone(), oq.clone()),
                theirs(&format!("`{ud}` and `{uq}` are")),
            ));
        }
        tried
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
