//! One motor's phase currents against their reference, in the rotor's frame.

use super::super::regress::rms;
use super::super::{Finding, Limits};
use super::{Motor, made_by};
use crate::signal::frames::clarke;
use nalgebra::{Complex, Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Rows that a fit of the currents looks at: enough for a hundredth.
const LOOKED_AT: usize = 6000;
/// Pole pairs that are tried.
const MOST_POLE_PAIRS: i32 = 64;

/// What is wrong: a check's name, a statistic with its threshold, and a sentence.
type Told = (&'static str, [f64; 2], String);

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

    /// Whether something of it is surely wrong, or too little is explained. `size` is the reference's rms, A.
    fn wrong(&self, size: f64, limits: &Limits) -> bool {
        self.explained < limits.current_explained
            || !limits.current_ratio.contains(&self.gain.norm()) && self.explained > limits.fixed
            || self.gain.arg().abs() > limits.current_angle && self.explained > limits.fixed
            || self.negative > limits.negative_sequence
            || self.has_offset(size, limits)
    }

    /// Whether the constant part is large beside the reference's rms, A.
    fn has_offset(&self, size: f64, limits: &Limits) -> bool {
        self.offset > limits.current_offset * size
    }
}

impl Motor<'_> {
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
            let along_d = self.id_ref.as_ref().map_or(0.0, |d| d[k]);
            let reference = Complex::new(r[k], -along_d);
            let columns = Vector3::new(reference, turn, turn * turn * reference.conj());
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

    /// Phase currents in the rotor's frame and their reference. Whether they agree.
    pub(in crate::records::quality) fn current(
        &self,
        other: Option<&Motor>,
        limits: &Limits,
        found: &mut Vec<Finding>,
    ) -> bool {
        let Some(reference) = &self.iq_ref else {
            return true;
        };
        let Some(own) = self.currents(f64::from(self.plate.pole_pairs)) else {
            return true;
        };
        let size = rms(reference);
        // Noise shows nothing.
        let loud = size > 5.0 * 3f64.sqrt() * self.current_noise && size > 1e-6;
        if !loud {
            return true;
        }
        let names = self.current_names();
        let all = names.each_ref().map(String::as_str);
        let mut push = |channels: &[&str], (code, statistic, sentence): Told| {
            found.push(Finding::new(code, channels, statistic, sentence));
            false
        };
        if let Some(told) = self.of_other(&own, other, limits) {
            return push(&all, told);
        }
        if own.sound(limits) {
            let slow = own.has_offset(size, limits) && self.electrical_turns() > 2.0;
            return !slow || push(&all[..2], self.zeros(&own, size, limits));
        }
        if !own.wrong(size, limits) {
            return true;
        }
        let follows = own.explained > limits.fixed
            && own.negative < limits.negative_sequence
            && !own.has_offset(size, limits);
        if follows {
            return push(&all, self.misscaled(&own, limits));
        }
        let explained = [own.explained, limits.current_explained];
        let told = if let Some(how) = self.mended(other, limits) {
            ("currents_exchanged", explained, how)
        } else if let Some((best, currents)) = self.other_pole_pairs(limits) {
            let sentence = self.turns_otherwise(&own, best, &currents);
            ("pole_pairs", explained, sentence)
        } else if self.electrical_turns() < 1.0 {
            // At rest a reference is the speed's noise, faster than a current follows.
            return true;
        } else {
            ("currents", explained, self.disagree(&own, size, limits))
        };
        push(&all, told)
    }

    /// Names of phase currents, reference and angle.
    fn current_names(&self) -> [String; 4] {
        ["ia_a", "ib_a", "iq_ref_a", "angle_rad"].map(|name| self.name(name))
    }

    /// Where the currents follow the other motor's reference.
    fn of_other(&self, own: &Currents, other: Option<&Motor>, limits: &Limits) -> Option<Told> {
        let other = other?;
        let changed = Motor {
            iq_ref: other.iq_ref.clone(),
            ..self.clone()
        };
        let currents = changed.currents(f64::from(self.plate.pole_pairs))?;
        let better = 1.0 - own.explained > limits.better * (1.0 - currents.explained);
        let [_, _, iq, _] = self.current_names();
        (currents.sound(limits) && better).then(|| {
            (
                "currents_exchanged",
                [own.explained, limits.fixed],
                format!(
                    "the measured current follows `{}iq_ref_a`, expected it to follow `{iq}`: columns of screw and nut are exchanged; \
                     exchange them in the mapping",
                    other.prefix
                ),
            )
        })
    }

    /// A constant part that a current loop would have driven out.
    fn zeros(&self, own: &Currents, size: f64, limits: &Limits) -> Told {
        let [ia, ib, ..] = self.current_names();
        (
            "current_offset",
            [own.offset, limits.current_offset * size],
            format!(
                "`{ia}` and `{ib}` have a constant part of {:.3} A beside {size:.3} A rms of torque current, expected less \
                 than half of it: the current loop would have driven it out; check the sensors' zeros in the mapping",
                own.offset
            ),
        )
    }

    /// Currents that follow their reference with another sign, angle or size.
    fn misscaled(&self, own: &Currents, limits: &Limits) -> Told {
        let [ia, ib, iq, angle] = self.current_names();
        let (ratio, turned) = (own.gain.norm(), own.gain.arg());
        if turned.abs() > PI - limits.current_angle {
            (
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
            )
        } else if turned.abs() > limits.current_angle {
            (
                "electrical_zero",
                [turned, limits.current_angle],
                format!(
                    "the measured current is turned against `{iq}` by {:.0} degrees electrical, expected 0: `{angle}` has \
                     another zero than the rotor's field; give it the offset {:.5} rad in a mapping file",
                    turned.to_degrees(),
                    turned / f64::from(self.plate.pole_pairs)
                ),
            )
        } else {
            (
                "current_scale",
                [ratio, *limits.current_ratio.end()],
                format!(
                    "the measured current is {ratio:.4} times `{iq}`, expected once{}; give their units in a mapping file",
                    made_by(ratio)
                ),
            )
        }
    }

    /// Currents that turn with another number of pole pairs, in words.
    fn turns_otherwise(&self, own: &Currents, best: i32, currents: &Currents) -> String {
        let [ia, ib, _, angle] = self.current_names();
        if f64::from(best) == -f64::from(self.plate.pole_pairs) {
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
        }
    }

    /// Currents that no single error explains, in words.
    fn disagree(&self, own: &Currents, size: f64, limits: &Limits) -> String {
        let [ia, ib, iq, angle] = self.current_names();
        if own.negative > limits.negative_sequence {
            format!(
                "`{ia}` and `{ib}` are no two phases of one motor: their negative sequence is {:.0} % of the positive one, \
                 expected less than {:.0} %; one of them has another sign or unit, or is another column",
                100.0 * own.negative,
                100.0 * limits.negative_sequence
            )
        } else if own.has_offset(size, limits) {
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
        }
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
}
