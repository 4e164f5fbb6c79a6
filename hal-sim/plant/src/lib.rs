//! The machine: two motors, a ball screw between them, a table, and what disturbs them.
//!
//! - [`model`]: what is declared of a machine (`model.toml`).
//! - [`effects`]: what a machine may have beyond that, one file for each kind.
//! - [`machine`]: state and integration of the machine that a model describes.
//! - [`recording`]: records of a run, in and out.
//!
//! SI units and `f64` throughout. Angles are mechanical unless a name says `theta_e`. Two-phase quantities use the
//! power-invariant Clarke transform, so that torque is `p * flux * i_q` with no 3/2 (Eqs 5 and 6 of Wang et al. 2020,
//! "the paper" in what follows).
#![forbid(unsafe_code)]

mod document;
pub mod effects;
pub mod leg;
mod limits;
pub mod machine;
pub mod model;
pub mod recording;

/// One of the two motors of the double drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Axis {
    /// The motor that turns the screw; index 0.
    Screw = 0,
    /// The motor that turns the nut; index 1.
    Nut = 1,
}

impl Axis {
    /// Both, in the order of their index.
    pub const ALL: [Axis; 2] = [Axis::Screw, Axis::Nut];

    /// 0 for the screw, 1 for the nut.
    #[inline]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `screw` or `nut`, as in `model.toml` and in the columns of a recording.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::Screw => "screw",
            Axis::Nut => "nut",
        }
    }
}
