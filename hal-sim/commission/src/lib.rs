//! Commissioning: what an engineer measures of a drive on the first day, over its link, by one command.
//!
//! | step | what the drive does | what is measured |
//! | --- | --- | --- |
//! | start | measures zeros, aligns both rotors | wiring, directions, pole pairs: the drive names what is wrong |
//! | [`electrical`] | turns both motors together, with currents along d | resistance, inductance, flux, angle offset, what the dead time takes |
//! | [`mechanical`] | accelerates both together and the table against them | inertia and friction of both motors, the feed's, lead and direction of the scale |
//! | [`tune`](mod@tune) | starts anew with what was found | nothing: bandwidth and margin are computed |
//! | [`current_response`], [`speed_response`] | turns both motors together, with steps of the current along d and of their speed | the loops' responses, bandwidths and margins, beside the computed ones |
//!
//! [`procedure`] does them one after the other; [`proposal`] is a tuning of the settings that hold, which needs no motion.
//!
//! Both motors turn in the same direction, so the table rests while the motors are measured. A current along d makes no
//! torque, so the motors may turn freely while it is set.
//!
//! All is power invariant: `v_d = R i_d - w L i_q`, `v_q = R i_q + w (L i_d + flux)`, `T = pole_pairs flux i_q`.
//!
//! A step takes what the drive's settings say of its motors as a rough beginning, and gives settings back.
#![forbid(unsafe_code)]

mod axial;
pub mod current_response;
pub mod electrical;
mod fit;
mod loop_response;
pub mod mechanical;
pub mod procedure;
pub mod proposal;
pub mod quantity;
mod session;
pub mod speed_response;
pub mod tune;

pub use fit::{Estimate, Fit};
pub use loop_response::LoopResponse;
pub use session::{MotorPoint, Point, Session, encoder_angle};

use std::fmt;

/// Why a step cannot be done: what was measured, what was expected, what to check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What was measured.
    pub measured: String,
    /// What was expected.
    pub expected: String,
    /// What to check.
    pub check: String,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "measured: {}; expected: {}; check: {}",
            self.measured, self.expected, self.check
        )
    }
}

impl std::error::Error for Failure {}

/// Something that a step must not exceed, and how near it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// The largest that was measured.
    pub reached: f64,
    /// The limit.
    pub limit: f64,
}

impl Bound {
    /// Nothing of `limit` yet.
    #[must_use]
    pub const fn of(limit: f64) -> Self {
        Self {
            reached: 0.0,
            limit,
        }
    }

    /// One more value, of which the size counts.
    pub fn take(&mut self, value: f64) {
        self.reached = self.reached.max(value.abs());
    }

    /// The same in a unit that is smaller by `factor`.
    #[must_use]
    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            reached: factor * self.reached,
            limit: factor * self.limit,
        }
    }

    /// It is kept.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.reached <= self.limit
    }
}
