//! Do the encoders belong to their motors, and do both motors mean the same direction?
//!
//! Equal torques are tried in four ways: against each other, and together, each both ways round. Against each other the
//! screw-nut pair slips, and the encoders must see the screw go ahead of the nut; encoders that are exchanged see it
//! fall back. (That matters where the pair's friction is above the bearings': one motor alone then takes the other
//! along, and both encoders see the same.) And against each other the pair's friction and the guideway's come on top of
//! the bearings', so that it takes more torque than together: with `b` and `p` of both,
//! `(b + p) - b = p`, the load's parts cancelling between the two ways round. Where it takes less, positive torques do
//! not turn both motors the same way: one has two phases and its encoder's channels swapped, which no look at one motor alone shows.

use super::Reason;
use super::probe::{Broken, Probe, ProbeConfig, ProbeStep};
use crate::base::format::Angle;

/// Signs of the torques: screw, nut, in the screw's direction.
const WAYS: [[i32; 2]; 4] = [[1, -1], [-1, 1], [1, 1], [-1, -1]];

/// State of a test of the pair.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pair {
    way: u8,
    /// The way that is tried.
    probe: Option<Probe>,
    /// Ways in which screw against nut went as asked, and the other way.
    right: u8,
    wrong: u8,
    /// Torques that it took, 2^-16 of the limit: against each other, together.
    against: u32,
    together: u32,
}

/// What the test asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PairStep {
    /// No torque.
    Rest,
    /// This part of the torques' limits, 2^-16, with these signs.
    Ramp(u16, [i32; 2]),
    /// All is as it should be.
    Right,
    /// Both encoders count the same way, or not, where both turn together: to be tried again with that.
    Same(bool),
    /// It is not.
    Wrong(Reason),
}

impl Pair {
    /// One step, with both encoders' angles, and whether they count the same way where both turn together, if that is known.
    pub(super) fn step(
        &mut self,
        probes: &ProbeConfig,
        theta: [Angle; 2],
        same: Option<bool>,
    ) -> PairStep {
        let Some(&[screw, nut]) = WAYS.get(usize::from(self.way)) else {
            return self.conclude(same);
        };
        let same_way = same.unwrap_or(true);
        let signs = [screw, if same_way { nut } else { nut.wrapping_neg() }];
        let probe = self.probe.get_or_insert_with(|| {
            if screw == nut {
                Probe::default()
            } else {
                Probe::apart(same_way)
            }
        });
        match probe.step(probes, theta) {
            ProbeStep::Rest => PairStep::Rest,
            ProbeStep::Ramp(level) => PairStep::Ramp(level, signs),
            ProbeStep::Moves(_) => PairStep::Wrong(Reason::LoadMoves),
            ProbeStep::Found(broken) => {
                self.take(probes, &broken, [screw, nut], same_way);
                self.way = self.way.saturating_add(1);
                self.probe = None;
                PairStep::Rest
            }
        }
    }

    fn take(&mut self, probes: &ProbeConfig, broken: &Broken, signs: [i32; 2], same: bool) {
        let [screw, nut] = broken.moved;
        let nut = if same { nut } else { nut.wrapping_neg() };
        let [sign, nut_sign] = signs;
        if sign == nut_sign {
            self.together = self.together.saturating_add(broken.level.into());
            return;
        }
        self.against = self.against.saturating_add(broken.level.into());
        let apart = screw.saturating_sub(nut);
        if apart.unsigned_abs() >= probes.motion {
            let as_asked = (apart > 0) == (sign > 0);
            self.right = self.right.saturating_add(u8::from(as_asked));
            self.wrong = self.wrong.saturating_add(u8::from(!as_asked));
        }
    }

    fn conclude(&self, same: Option<bool>) -> PairStep {
        if self.right == 0 && self.wrong == 0 {
            return PairStep::Wrong(Reason::Held);
        }
        if same.is_none() {
            return PairStep::Same(self.together <= self.against);
        }
        if self.wrong > self.right {
            return PairStep::Wrong(Reason::Exchanged);
        }
        PairStep::Right
    }
}
