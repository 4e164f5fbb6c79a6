//! One motor's voltages against its equation: resistance, inductance, flux and dead time.

use super::super::regress::{Fit, fit};
use super::super::{Finding, Limits};
use super::{Blocks, Motor, Rotated, made_by};
use crate::regression::bounded::solve_within;
use nalgebra::{DMatrix, DVector};
use std::borrow::Cow;
use std::ops::RangeInclusive;

/// Share of the voltages' squares by which a value of the plate must matter. At one speed resistance and flux are distinguished by next to
/// nothing, and a little that no equation has moves either by a multiple: of 200 sound machines eight, whose records show one speed or
/// two, were called wrong without this. A resistance of a hundredth, where little current flows, matters by a thousandth.
const MATTERS: f64 = 2e-4;

/// Share of the dead time's loss that the column of this equation may lack: near zero current the loss has a width that no plate tells.
/// A motor of 50 W that turns freely on 158 V loses more there than its resistance takes. Without this its resistance was -1.5 times the
/// plate's, and the sign of `ud_v` was called wrong.
const DEAD_TIME_SHAPE: f64 = 0.5;

/// Share of the bus that a drive may give too much at small currents. Up to 1 to 10 % of the rated current the charge of the legs makes a
/// bridge's loss proportional to the current, and the drive compensates 500 ns of 50 us of it. What it gives too much looks like a
/// resistance below nothing, which no plate makes.
const GIVEN_OF_BUS: f64 = 2.5e-3;

/// By how much a voltage may be older or younger than the angle of its row, s: two periods of a drive at 10 kHz. Rotated by what the
/// shaft turns meanwhile, `ud_v` has a part of `uq_v`.
const AGE_S: f64 = 2e-4;

impl<'a> Motor<'a> {
    /// Resistance, inductance, flux and dead time by the voltage equation, over those that are declared; dead time in V.
    fn equation(&self) -> Option<Fit> {
        let (columns, voltages) = self.equation_rows()?;
        fit(&columns, &voltages)
    }

    /// Whether values within their ranges explain as much of the voltages as any, but for what a drive may have `given` too much, V.
    fn explained_within(&self, free: &Fit, ranges: [&RangeInclusive<f64>; 3], given: f64) -> bool {
        let Some((columns, voltages)) = self.equation_rows() else {
            return true;
        };
        let age = self.age_column(&columns, &voltages);
        let columns: Vec<&Vec<f64>> = columns.iter().chain([&age]).collect();
        let design = DMatrix::from_fn(voltages.len(), columns.len(), |row, k| columns[k][row]);
        let voltages = DVector::from_vec(voltages);
        // A dead time may be any. Within bounds about the middle of each range.
        let middle = DVector::from_fn(columns.len(), |k, _| {
            ranges.get(k).map_or(0.0, |r| 0.5 * (r.start() + r.end()))
        });
        let half = |k: usize| 0.5 * (ranges[k].end() - ranges[k].start());
        let bounds = [half(0), half(1), half(2), f64::INFINITY, 1.0];
        let left = &voltages - &design * middle;
        let (gram, rhs) = (design.tr_mul(&design), design.tr_mul(&left));
        let within = solve_within(&gram, &rhs, &bounds, &[]).values;
        let dead = (DEAD_TIME_SHAPE * free.values[3].abs()).max(given);
        let unknown = dead * dead * design.column(3).norm_squared();
        let left = (left - design * within).norm_squared();
        left <= (1.0 - free.explained + MATTERS) * voltages.norm_squared() + unknown
    }

    /// What an age of [`AGE_S`] makes of the voltages, V, by the equation's columns: the third is that of the speed.
    fn age_column(&self, [_, _, back_emf, _]: &[Vec<f64>; 4], voltages: &[f64]) -> Vec<f64> {
        let pairs = voltages.chunks_exact(2).zip(back_emf.chunks_exact(2));
        let rotated = |(voltage, back_emf): (&[f64], &[f64])| {
            let turned = AGE_S * back_emf[1] / self.plate.flux_wb;
            [turned * voltage[1], -turned * voltage[0]]
        };
        pairs.flat_map(rotated).collect()
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
    pub(in crate::records::quality) fn voltage(
        &self,
        other: Option<&Motor>,
        limits: &Limits,
        found: &mut Vec<Finding>,
    ) -> bool {
        let Some(own) = self.equation() else {
            return true;
        };
        let ranges = [
            &limits.resistance_ratio,
            &limits.inductance_ratio,
            &limits.flux_ratio,
        ];
        let wrong = [0, 1, 2].map(|k| {
            let (value, error) = (own.values[k], limits.sigmas * own.errors[k]);
            value + error < *ranges[k].start() || value - error > *ranges[k].end()
        });
        let is_wrong = wrong.contains(&true) && !self.explained_within(&own, ranges, 0.0);
        // At rest voltages are what the loops make of noise.
        let follows = own.explained >= limits.voltage_explained || self.electrical_turns() < 1.0;
        if !is_wrong && follows {
            return true;
        }
        let mended = self
            .mended_voltages(other)
            .into_iter()
            .find(|(changed, _)| {
                let fit = changed.equation();
                fit.is_some_and(|fit| self.equation_sound(&fit, limits))
            });
        let given = GIVEN_OF_BUS * self.bus_v;
        let may_be_given = mended.is_none() && follows && own.values[0] < 0.0;
        if may_be_given && self.explained_within(&own, ranges, given) {
            return true;
        }
        let flux = [own.values[2], *limits.flux_ratio.end()];
        let (code, statistic, sentence) = match mended {
            Some((_, words)) => ("voltages", flux, words),
            None => {
                let statistic = if wrong[0] && !wrong[2] {
                    [own.values[0], *limits.resistance_ratio.end()]
                } else {
                    flux
                };
                let sentence = self.wrong_equation(&own, wrong, limits);
                ("voltage_equation", statistic, sentence)
            }
        };
        let [ud, uq] = ["ud_v", "uq_v"].map(|name| self.name(name));
        found.push(Finding::new(code, &[&ud, &uq], statistic, sentence));
        false
    }

    /// Which of resistance, inductance and flux is wrong, in words.
    fn wrong_equation(&self, own: &Fit, wrong: [bool; 3], limits: &Limits) -> String {
        let [ud, uq] = ["ud_v", "uq_v"].map(|name| self.name(name));
        let [r, l, f] = [own.values[0], own.values[1], own.values[2]];
        let plate = self.plate;
        if wrong[0] && !wrong[2] {
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
        }
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
}
