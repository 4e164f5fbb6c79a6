//! End switches that are exchanged: the one behind the table opens while the table moves away from it.
//!
//! The interlock would let such a table go on to its mechanical end, for it looks at the switch ahead only. A switch that
//! bounces as the table leaves it is none: it has to have been closed for [`CLEAR`] of the way before it opens.

/// Way for which a switch must have been closed, 2^-32 turn of screw against nut: a tenth of a turn.
const CLEAR: i64 = (1 << 32) / 10;
/// Way in one direction that says where the table moves.
const MOVING: i64 = CLEAR / 10;
/// Looks in a row in which a switch must be open, as the interlock has it.
const SETTLED: u8 = 2;

/// State of the watch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndsWatch {
    /// Way in the present direction, 2^-32 turn, and its sign.
    way: i64,
    /// Way since each was closed: ahead of positive velocity, and of negative.
    closed: [i64; 2],
    /// Looks in a row in which each was open.
    open: [u8; 2],
    /// Each opened behind a table that moved away.
    behind: [bool; 2],
}

impl EndsWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            way: 0,
            closed: [CLEAR; 2],
            open: [0; 2],
            behind: [false; 2],
        }
    }

    /// One look: what the screw has turned more than the nut since the last, 2^-32 turn, and which switches are open: ahead of
    /// positive velocity, and of negative. `true` if they are exchanged, until the switch is closed again.
    pub fn step(&mut self, moved: i64, open: [bool; 2]) -> bool {
        let turns_back = self.way.signum().saturating_mul(moved.signum()) < 0;
        self.way = if turns_back {
            moved
        } else {
            self.way.saturating_add(moved)
        };
        let switches = self.closed.iter_mut().zip(&mut self.open);
        let switches = switches.zip(&mut self.behind).zip(open);
        for ((((closed, looks), behind), open), away) in switches.zip([-1, 1]) {
            if open {
                *looks = looks.saturating_add(1).min(SETTLED.saturating_add(1));
                if *looks == SETTLED {
                    let leaves = self.way.saturating_mul(away) > MOVING;
                    *behind = *closed >= CLEAR && leaves;
                    *closed = 0;
                }
            } else {
                (*looks, *behind) = (0, false);
                *closed = closed.saturating_add(moved.saturating_abs());
            }
        }
        self.behind.contains(&true)
    }
}

impl Default for EndsWatch {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// A table that moves through `way`, in turns a look, past switches at ±`ends` turns; the look at which it is found.
    fn found(way: &[f64], ends: f64, exchanged: bool, bounces: bool) -> Option<usize> {
        let (mut watch, mut at) = (EndsWatch::new(), 0.0f64);
        way.iter().enumerate().position(|(k, moved)| {
            at += moved;
            let edge = |past: f64| past > 0.0 || bounces && past > -0.05 && k % 3 > 0;
            let mut open = [edge(at - ends), edge(-at - ends)];
            if exchanged {
                open.swap(0, 1);
            }
            watch.step((moved * 2f64.powi(32)) as i64, open)
        })
    }

    /// To one end, over it, back to the other, and over that.
    fn there_and_back(by: f64) -> Vec<f64> {
        let looks = (2.2 / by.abs()) as usize;
        let mut way = vec![by; looks];
        way.extend(vec![-by; 2 * looks]);
        way.extend(vec![by; 2 * looks]);
        way
    }

    #[test]
    fn switches_in_their_places_are_none() {
        for by in [1e-3, 5e-3, 20e-3] {
            for bounces in [false, true] {
                assert_eq!(
                    found(&there_and_back(by), 2.0, false, bounces),
                    None,
                    "{by}"
                );
            }
        }
    }

    #[test]
    fn exchanged_ones_are_found_with_the_first() {
        for by in [1e-3, 5e-3, 20e-3] {
            for (way, ends) in [
                (there_and_back(by), 2.0),
                (there_and_back(-by), 2.0),
                (vec![by; 1000], 0.05),
            ] {
                let looks = (ends / by) as usize;
                let at = found(&way, ends, true, false).unwrap();
                assert!(
                    at >= looks - 1 && at <= looks + 3,
                    "found in look {at} of {looks}"
                );
            }
        }
    }
}
