//! The residual of both records before and after, in the channels' units.

use crate::balance::{Balance, Contribution};
use crate::conclusion::verdict::Level;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::parameter::Parameter;
use crate::regression::column::{Column, counted, dot};
use crate::regression::design::Whitener;
use crate::regression::normal::{Normal, Solution};
use crate::search::case::Case;
use crate::search::select::Search;
use crate::signal::channel::Channel;
use crate::signal::noise::Noise;
use crate::signal::signals::angle_noise;
use plant::Axis;

/// Below it the table's residual is not judged by frequency, Hz.
const SLOW_TABLE_HZ: f64 = 12.0;

/// Frequencies by which a channel is judged, Hz: at rest and at slow travel the encoders' rounding does not average out of
/// the table's residual.
pub(crate) fn judged_hz(channel: Channel, noise: &Noise) -> [f64; 2] {
    let from = match channel {
        Channel::Table => SLOW_TABLE_HZ,
        _ => 0.0,
    };
    [from, noise.top(channel)]
}

/// How loud a channel of a whitened residual is in a band, Hz, beside effects or `alone`. A table beside a motor that rests is judged by its
/// power alone.
pub(crate) fn level(
    case: &Case,
    whitener: &Whitener,
    white: &Column,
    (channel, alone): (Channel, bool),
    band: [f64; 2],
) -> Level {
    let rate = case.balance.signals.rate / case.balance.fourier.step() as f64;
    let open = whitener.mask(channel);
    let mut turning = white.parts[channel.index()].clone().unwrap_or_default();
    let resting = match channel {
        Channel::Table => resting(case),
        _ => Vec::new(),
    };
    let (mut power, mut rows) = (0.0, 0);
    for (k, x) in turning.iter_mut().enumerate() {
        if resting.get(k) == Some(&true) && open[k] {
            power += std::mem::take(x).powi(2);
            rows += 1;
        }
    }
    let gain = whitener.gain(channel);
    let expected = |hz| (case.declared).power((channel, alone), hz, case.balance.fourier, gain);
    let level = Level::new(
        channel,
        &turning,
        counted(open) - rows,
        rate,
        band,
        expected,
    );
    match rows {
        0 => level,
        _ => level.beside(
            power / (rows as f64 * rounding_at_rest(case, band[1])),
            rows,
        ),
    }
}

/// Decimated rows of a record at which one of the motors rests.
fn resting(case: &Case) -> Vec<bool> {
    let step = case.balance.fourier.step();
    let mut resting = vec![false; case.balance.fourier.decimated_rows()];
    for (parameter, _) in &case.base.parameters {
        if let Parameter::RestOffset { from, to, .. } = *parameter {
            let rows = resting.len();
            resting[(from / step).min(rows)..to.div_ceil(step).min(rows)].fill(true);
        }
    }
    resting
}

/// How much more power than white noise of the sensors' resolution the table's residual may have up to `top` Hz while a motor rests. The
/// rounding of an encoder that turns is spread over all frequencies up to half the sampling rate (Widrow's model of quantisation). One
/// that rests moves within its count as slowly as its shaft: all of the rounding's power may be below `top`, and in any band.
fn rounding_at_rest(case: &Case, top: f64) -> f64 {
    let Balance {
        model,
        signals,
        lead,
        ..
    } = case.balance;
    let table = model.sensing.table_noise_m.powi(2);
    let encoder = |axis| lead * lead * angle_noise(&model.sensing, axis);
    let [screw, nut] = Axis::ALL.map(encoder);
    // Either may rest.
    let (fine, coarse) = (screw.min(nut), screw.max(nut));
    (table + fine + coarse * 0.5 * signals.rate / top) / (table + fine + coarse).max(1e-300)
}

pub(crate) fn rms(signal: &[f64], mask: &[bool]) -> f64 {
    let (sum, count) = signal
        .iter()
        .zip(mask)
        .filter(|(_, open)| **open)
        .fold((0.0, 0.0), |(s, n), (x, _)| (s + x * x, n + 1.0));
    if count > 0.0 {
        f64::sqrt(sum / count)
    } else {
        0.0
    }
}

/// Share of the lags up to 0.1 s whose correlation is within the 95 % band of white noise. The band limit makes its own
/// correlation at the first lags; they are left out.
pub(crate) fn whiteness(signal: &[f64]) -> f64 {
    const LAGS: std::ops::Range<usize> = 8..128;
    let n = signal.len();
    if n < 4 * LAGS.end {
        return 0.0;
    }
    let energy: f64 = dot(signal, signal);
    let open = signal.iter().filter(|x| **x != 0.0).count().max(1) as f64;
    let inside = LAGS
        .filter(|lag| {
            let sum: f64 = signal[..n - lag]
                .iter()
                .zip(&signal[*lag..])
                .map(|(a, b)| a * b)
                .sum();
            (sum / energy).abs() < 1.96 / open.sqrt()
        })
        .count();
    inside as f64 / LAGS.len() as f64
}

/// The fit record's residuals in their units.
pub(crate) struct Side {
    pub(crate) before: Vec<Vec<f64>>,
    pub(crate) after: Vec<Vec<f64>>,
}

impl Side {
    pub(crate) fn new(
        case: &Case,
        noise: &Noise,
        whitener: &Whitener,
        plain: &Normal,
        before: &Solution,
        search: &Search,
        after: &Solution,
    ) -> Self {
        // Whitening is a gain over frequency: undone on what the regression left.
        let undo = |normal: &Normal, solution: &Solution| -> Vec<Vec<f64>> {
            let left = normal.residual(&solution.values);
            Channel::ALL
                .iter()
                .map(|&channel| {
                    let band = noise.band(channel, case.balance.fourier);
                    let gain: Vec<f64> = whitener
                        .gain(channel)
                        .iter()
                        .zip(&band)
                        .map(|(&gain, &band)| if gain > 0.0 { band / gain } else { 0.0 })
                        .collect();
                    left.parts[channel.index()]
                        .as_ref()
                        .map_or_else(Vec::new, |part| case.balance.fourier.again(part, &gain))
                })
                .collect()
        };
        Side {
            before: undo(plain, before),
            after: undo(&search.normal, after),
        }
    }
}

/// The check record's residuals with all physical parameters as the fit record has them; only what belongs to a record
/// (the scale's zero, an encoder's rounding at rest) is its own.
pub(crate) struct Fixed {
    /// Of each channel, whitened: how loud it is before and after.
    pub(crate) levels: Vec<[Level; 2]>,
    /// The residual after, whitened.
    pub(crate) white: Column,
    pub(crate) before: Vec<Vec<f64>>,
    pub(crate) after: Vec<Vec<f64>>,
    pub(crate) masks: Vec<Vec<bool>>,
}

impl Fixed {
    pub(crate) fn new(
        case: &Case,
        check: &Case,
        noise: &Noise,
        found: &[Hypothesis],
        plain: &Solution,
        full: &Solution,
    ) -> Self {
        let whitener = check.whitener(noise);
        let in_units = |residual: &Contribution| in_units(residual, check, noise);
        let levels = |white: &Column| -> Vec<Level> {
            let of = |channel| {
                let judged = judged_hz(channel, noise);
                level(check, &whitener, white, (channel, found.is_empty()), judged)
            };
            Channel::ALL.into_iter().map(of).collect()
        };
        let left = |values, effects| left([case, check], &whitener, values, effects);
        let (before, after) = (left(plain, &[]), left(full, found));
        let white = whitener.column(&after);
        Fixed {
            levels: levels(&whitener.column(&before))
                .into_iter()
                .zip(levels(&white))
                .map(|(before, after)| [before, after])
                .collect(),
            white,
            before: in_units(&before),
            after: in_units(&after),
            masks: Channel::ALL
                .iter()
                .map(|&channel| whitener.mask(channel).to_vec())
                .collect(),
        }
    }
}

/// What the fit record's parameters and effects leave of the check record.
/// Parameters that belong to a record are fitted there.
fn left(
    [case, check]: [&Case; 2],
    whitener: &Whitener,
    values: &Solution,
    effects: &[Hypothesis],
) -> Contribution {
    let run_s = check.balance.signals.run_s();
    let mut residual: Contribution = check.base.residual.clone();
    for ((parameter, _), value) in case.base.parameters.iter().zip(values.values.iter()) {
        if parameter.is_of_the_machine()
            && let Some((_, contribution)) =
                check.base.parameters.iter().find(|(p, _)| p == parameter)
        {
            residual.add_all(-value, contribution);
        }
    }
    let mut at = case.base.parameters.len();
    for hypothesis in effects {
        let nuisances = hypothesis.nuisance_contributions(check.balance, run_s);
        for part in hypothesis
            .contributions(check.balance, run_s)
            .iter()
            .chain(nuisances.iter().map(|(contribution, _)| contribution))
        {
            residual.add_all(-values.values[at], part);
            at += 1;
        }
    }
    let mut own = Normal::new(whitener.column(&residual), &whitener.folds);
    let of_record: Vec<_> = check
        .base
        .parameters
        .iter()
        .filter(|(p, _)| !p.is_of_the_machine())
        .collect();
    for (parameter, contribution) in &of_record {
        own.push(whitener.column(contribution), parameter.prior());
    }
    let offsets = own.solve(None);
    for ((_, contribution), value) in of_record.iter().zip(offsets.values.iter()) {
        residual.add_all(-value, contribution);
    }
    residual
}

/// Each channel's residual in its unit, within the band that the noise leaves.
fn in_units(residual: &Contribution, check: &Case, noise: &Noise) -> Vec<Vec<f64>> {
    Channel::ALL
        .iter()
        .map(|&channel| {
            let band = noise.band(channel, check.balance.fourier);
            residual
                .0
                .iter()
                .find(|(c, _)| *c == channel)
                .map_or_else(Vec::new, |(_, spectrum)| {
                    check.balance.fourier.filtered(spectrum, &band)
                })
        })
        .collect()
}
