//! Do voltages and currents of a motor's phases belong together? Found at rest, before anything moves.
//!
//! A kick asks for a small current along one phase, and the currents that come are read as soon as one of them is
//! clear, a few hundred microseconds later. Currents that belong to their phases come as (1, -1/2, -1/2). A channel with the wrong
//! sign, two exchanged ones and an open phase each make a pattern of their own over the kicks along a, b and c, which is
//! looked up. A wrong one makes the current loop unstable, but its current doubles in 0.23 ms (at 3000 rad/s) and each
//! kick ends before it has passed the torque limit's.
//!
//! What this cannot see, since it is the same to voltages and currents: phases of the motor's cable that are permuted
//! behind the bridge and its shunts. An even permutation turns the winding by a third of an electrical turn, which is an
//! offset, and is learned with it; an odd one reverses it, which shows in how the encoder counts.

use super::Reason;
use crate::base::format::{Angle, Current};
use crate::current::sense::Shunts;

/// What a wiring test needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WiringConfig {
    /// Current of a kick.
    pub kick: Current,
    /// A current that is clear, in any phase.
    pub clear: Current,
    /// Longest that a kick waits for it, steps.
    pub steps: u16,
    /// Which phases are measured.
    pub shunts: Shunts,
}

/// Along a, b, c, then the same backwards.
const KICKS: u8 = 6;

/// Steps between two kicks with the bridge off: the diodes take the current down within one.
const GAP: u16 = 3;

/// Currents of the phases to kicks along a, b and c.
type Response = [[i32; 3]; 3];

/// State of a wiring test.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wiring {
    kick: u8,
    step: u16,
    resting: bool,
    /// What the phases show before a kick acts: offsets that nobody measured.
    offsets: [Current; 3],
    response: Response,
}

/// What a wiring test asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WiringStep {
    /// The bridge off.
    Rest,
    /// This current along this electrical angle.
    Kick(Angle, Current),
    /// All is as it should be.
    Right,
    /// It is not.
    Wrong(Reason),
}

impl Wiring {
    /// One step, with the currents of the phases.
    pub(super) fn step(&mut self, config: &WiringConfig, phases: [Current; 3]) -> WiringStep {
        self.step = self.step.saturating_add(1);
        if self.resting {
            if self.step < GAP {
                return WiringStep::Rest;
            }
            self.step = 0;
            self.resting = false;
            self.kick = self.kick.saturating_add(1);
        }
        if self.kick >= KICKS {
            return match name(&self.response, config.shunts) {
                None => WiringStep::Right,
                Some(reason) => WiringStep::Wrong(reason),
            };
        }
        let (along, backwards) = (self.kick % 3, self.kick >= 3);
        let measured = match config.shunts {
            Shunts::Two => 2,
            Shunts::Three => 3,
        };
        // Before the first period of a kick has acted, there is nothing else to be seen.
        if self.step <= 1 {
            self.offsets = phases;
        }
        let [a, b, c] = phases;
        let [a_offset, b_offset, c_offset] = self.offsets;
        let phases = [
            a.saturating_sub(a_offset),
            b.saturating_sub(b_offset),
            c.saturating_sub(c_offset),
        ];
        let clear = phases
            .iter()
            .take(measured)
            .any(|i| i.unsigned_abs() >= config.clear.unsigned_abs());
        if self.step > 1 && (clear || self.step > config.steps) {
            if clear && let Some(column) = self.response.get_mut(usize::from(along)) {
                for (sum, i) in column.iter_mut().zip(phases) {
                    let i = i.to_bits() >> 2;
                    *sum = sum.saturating_add(if backwards { i.wrapping_neg() } else { i });
                }
            }
            self.step = 0;
            self.resting = true;
            return WiringStep::Rest;
        }
        let third = 0x5555_5555u32.wrapping_mul(u32::from(along));
        let at = Angle(third).plus(Angle(if backwards { 1 << 31 } else { 0 }));
        WiringStep::Kick(at, config.kick)
    }
}

/// A pattern: what the phases make of kicks along a, b, c, in quarters.
type Pattern = [[i32; 3]; 3];

const RIGHT: Pattern = [[4, -2, -2], [-2, 4, -2], [-2, -2, 4]];

/// The pattern with `change` made to what each kick gives.
const fn changed(signs: [i32; 3], from: [usize; 3]) -> Pattern {
    let mut pattern = RIGHT;
    let mut kick = 0;
    while kick < 3 {
        let mut channel = 0;
        while channel < 3 {
            #[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects)]
            {
                pattern[kick][channel] = RIGHT[kick][from[channel]] * signs[channel];
            }
            #[allow(clippy::arithmetic_side_effects)]
            {
                channel += 1;
            }
        }
        #[allow(clippy::arithmetic_side_effects)]
        {
            kick += 1;
        }
    }
    pattern
}

const IN_PLACE: [usize; 3] = [0, 1, 2];

/// What has a name.
static PATTERNS: [(Option<Reason>, Pattern); 18] = [
    (None, RIGHT),
    (Some(Reason::SignA), changed([-1, 1, 1], IN_PLACE)),
    (Some(Reason::SignB), changed([1, -1, 1], IN_PLACE)),
    (Some(Reason::SignC), changed([1, 1, -1], IN_PLACE)),
    (Some(Reason::SignAll), changed([-1, -1, -1], IN_PLACE)),
    (Some(Reason::ChannelsAb), changed([1, 1, 1], [1, 0, 2])),
    (Some(Reason::ChannelsBc), changed([1, 1, 1], [0, 2, 1])),
    (Some(Reason::ChannelsCa), changed([1, 1, 1], [2, 1, 0])),
    (Some(Reason::ChannelsRotated), changed([1, 1, 1], [1, 2, 0])),
    (Some(Reason::ChannelsRotated), changed([1, 1, 1], [2, 0, 1])),
    // The same where the dead time takes much of a kick. Its compensation goes by the channels: it holds one phase of two at zero.
    (
        Some(Reason::ChannelsRotated),
        [[-3, 0, 3], [3, -3, 0], [0, 3, -3]],
    ),
    (
        Some(Reason::ChannelsRotated),
        [[-3, 3, 0], [0, -3, 3], [3, 0, -3]],
    ),
    (Some(Reason::DeadChannelA), changed([0, 1, 1], IN_PLACE)),
    (Some(Reason::DeadChannelB), changed([1, 0, 1], IN_PLACE)),
    (Some(Reason::DeadChannelC), changed([1, 1, 0], IN_PLACE)),
    // Two phases in series: a kick along the third moves nothing.
    (
        Some(Reason::OpenPhaseA),
        [[0, 0, 0], [0, 3, -3], [0, -3, 3]],
    ),
    (
        Some(Reason::OpenPhaseB),
        [[3, 0, -3], [0, 0, 0], [-3, 0, 3]],
    ),
    (
        Some(Reason::OpenPhaseC),
        [[3, -3, 0], [-3, 3, 0], [0, 0, 0]],
    ),
];

/// Largest part of a column.
const FULL: i32 = 1024;

/// A column scaled to a largest part of [`FULL`], with the first bits that make the division one of 32 bits: the kicks end
/// with currents of different size.
fn scaled(column: [i32; 3], channels: usize) -> [i32; 3] {
    let size = column
        .iter()
        .take(channels)
        .map(|i| i.unsigned_abs())
        .max()
        .unwrap_or(0);
    // Of 20 bits and a sign at most.
    let cut = 12u32.saturating_sub(size.leading_zeros());
    let size = (size >> (cut & 31)).cast_signed();
    column.map(|i| {
        (i >> (cut & 31))
            .wrapping_mul(FULL)
            .checked_div(size)
            .unwrap_or(0)
    })
}

/// It is of the third channel.
const fn is_of_third(reason: Option<Reason>) -> bool {
    matches!(
        reason,
        Some(
            Reason::SignC
                | Reason::ChannelsBc
                | Reason::ChannelsCa
                | Reason::ChannelsRotated
                | Reason::DeadChannelC
        )
    )
}

/// The pattern that is nearest to the response, if one is near: what is wrong.
fn name(response: &Response, shunts: Shunts) -> Option<Reason> {
    let channels = match shunts {
        Shunts::Two => 2,
        Shunts::Three => 3,
    };
    if response.iter().flatten().all(|i| *i == 0) {
        return Some(Reason::NoCurrent);
    }
    let response = response.map(|column| scaled(column, channels));
    let distance = |pattern: &Pattern, own: i32| {
        let columns = response.iter().zip(pattern).enumerate();
        columns.fold(0i32, |sum, (kick, (column, expected))| {
            let pairs = column.iter().zip(scaled(*expected, channels));
            pairs
                .take(channels)
                .enumerate()
                .fold(sum, |sum, (channel, (got, expected))| {
                    let off = got.wrapping_sub(expected);
                    let weight = if channel == kick { own } else { 1 };
                    sum.wrapping_add(off.wrapping_mul(off).wrapping_mul(weight))
                })
        })
    };
    // A channel that is not measured cannot be wrong.
    let possible = |reason: &Option<Reason>| channels == 3 || !is_of_third(*reason);
    // Dead time may hold a phase at zero that another phase's kick should move. So a phase's own kick counts twice.
    let nearest = PATTERNS
        .iter()
        .filter(|(reason, _)| possible(reason))
        .min_by_key(|(_, pattern)| distance(pattern, 2));
    // Seven tenths of the largest part off in each of the kicks is no pattern.
    const LIMIT: i32 = 3 * FULL * FULL / 2;
    match nearest {
        Some((reason, pattern)) if distance(pattern, 1) < LIMIT => *reason,
        _ => Some(Reason::Wiring),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A winding that is right, whose channels show an offset above what is clear. Dead time keeps its current at zero at first.
    #[test]
    fn an_offset_that_nobody_measured_is_no_wrong_wiring() {
        let amps = |x: f64| Current::from_num(x);
        let config = WiringConfig {
            kick: amps(4.0),
            clear: amps(0.5),
            steps: 20,
            shunts: Shunts::Three,
        };
        let offsets = [0.74, -0.55, 0.0];
        let (mut wiring, mut current, mut kicked) = (Wiring::default(), [0.0; 3], 0);
        for _ in 0..1000 {
            let phases = [0, 1, 2].map(|k| amps(current[k] + offsets[k]));
            match wiring.step(&config, phases) {
                WiringStep::Rest => (current, kicked) = ([0.0; 3], 0),
                WiringStep::Kick(..) if kicked < 5 => kicked += 1,
                WiringStep::Kick(at, _) => {
                    let along = f64::from(at.0) / 2f64.powi(32);
                    for (k, i) in current.iter_mut().enumerate() {
                        let turn = core::f64::consts::TAU * (along - k as f64 / 3.0);
                        *i += 0.1 * turn.cos();
                    }
                }
                WiringStep::Right => return,
                WiringStep::Wrong(reason) => panic!("{reason:?}"),
            }
        }
        panic!("it does not end");
    }

    /// A drawn machine on bridges that switch, whose legs have no capacitance.
    #[test]
    fn a_wrong_sign_is_named_where_dead_time_holds_its_phase_at_zero() {
        let response = [
            [-25_600, -25_600, 51_200],
            [3840, 48_000, -51_840],
            [3200, -28_160, 24_960],
        ];
        assert_eq!(name(&response, Shunts::Two), Some(Reason::SignA));
    }

    /// Drawn machines without capacitance at their legs, on bridges that switch and on mean ones.
    #[test]
    fn rotated_channels_are_named_where_dead_time_holds_a_phase_at_zero() {
        for response in [
            [
                [-24_320, -2560, 27_520],
                [32_000, -32_640, -1280],
                [-3840, 31_360, -30_720],
            ],
            [
                [-25_600, 28_800, -3200],
                [-640, -19_840, 17_920],
                [20_480, 1280, -19_840],
            ],
            [
                [-19_200, 1920, 18_560],
                [28_800, -26_240, -1920],
                [-1280, 27_520, -24_960],
            ],
        ] {
            assert_eq!(
                name(&response, Shunts::Three),
                Some(Reason::ChannelsRotated)
            );
        }
    }

    #[test]
    fn each_pattern_is_named_and_no_two_are_near() {
        for shunts in [Shunts::Two, Shunts::Three] {
            for (reason, pattern) in &PATTERNS {
                let known = shunts == Shunts::Three || !is_of_third(*reason);
                if !known {
                    continue;
                }
                // Kicks end with currents of different size, with a tenth of error.
                for (size, off) in [(1000, 100), (30_000, -3000)] {
                    let response = core::array::from_fn(|kick| {
                        let size = size * (1 + kick as i32) / 4;
                        pattern[kick].map(|i| i * size + i.signum().abs() * off)
                    });
                    assert_eq!(name(&response, shunts), *reason, "{shunts:?} {pattern:?}");
                }
            }
            assert_eq!(name(&[[0; 3]; 3], shunts), Some(Reason::NoCurrent));
        }
    }
}
