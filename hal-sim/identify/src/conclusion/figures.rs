//! The residual, in figures.

use crate::balance::Balance;
use crate::conclusion::channels::{ChannelRest, Figures, TableForce};
use crate::conclusion::remains::{Fixed, rms, whiteness};
use crate::regression::column::{Column, counted, dot};
use crate::signal::channel::Channel;
use plant::Axis;

/// The residual of a fit record and a check record, before and after, and of the fit record made white.
pub(crate) fn figures(
    fit: [&[f64]; 2],
    open: &[bool],
    check: [&[f64]; 2],
    check_open: &[bool],
    noise_floor: f64,
    white: &[f64],
) -> Figures {
    let rows = counted(open).max(1) as f64;
    Figures {
        fit_before: rms(fit[0], open),
        fit_after: rms(fit[1], open),
        check_before: rms(check[0], check_open),
        check_after: rms(check[1], check_open),
        noise_floor,
        whitened: (dot(white, white) / rows).sqrt(),
        whiteness: whiteness(white),
    }
}

/// The force on the table, from both torque balances.
pub(crate) fn table_force(
    balance: &Balance,
    channels: &[ChannelRest],
    fixed: &Fixed,
    whitened: &Column,
) -> TableForce {
    let [screw, nut] = Axis::ALL.map(|axis| Channel::Torque(axis).index());
    let half = |a: &[f64], b: &[f64], scale: f64| -> Vec<f64> {
        a.iter().zip(b).map(|(a, b)| scale * (a - b)).collect()
    };
    let both =
        |a: &[bool], b: &[bool]| -> Vec<bool> { a.iter().zip(b).map(|(a, b)| *a && *b).collect() };
    let per_torque = 0.5 / balance.lead;
    let force = |side: [&[f64]; 2]| half(side[0], side[1], per_torque);
    let residual = [0, 1].map(|k: usize| {
        let of = |channel: usize| &channels[channel].residual[k];
        force([of(screw), of(nut)])
    });
    let check = [&fixed.before, &fixed.after].map(|side| force([&side[screw], &side[nut]]));
    let open = both(&channels[screw].open, &channels[nut].open);
    let part = |channel: usize| whitened.parts[channel].as_deref().unwrap_or_default();
    let floor = |channel: usize| channels[channel].figures.noise_floor;
    TableForce {
        figures: figures(
            [&residual[0], &residual[1]],
            &open,
            [&check[0], &check[1]],
            &both(&fixed.masks[screw], &fixed.masks[nut]),
            per_torque * floor(screw).hypot(floor(nut)),
            &half(part(screw), part(nut), 0.5_f64.sqrt()),
        ),
        residual,
        open,
    }
}
