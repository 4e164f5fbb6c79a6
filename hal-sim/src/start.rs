//! A drive that does not know where its rotors stand, before it is switched on.

use crate::board::{Board, BoardConfig};
use crate::experiment::Setup;
use control::plate::DrivePlate;
use plant::Axis;
use plant::model::Model;
use rand_distr::{Distribution, Uniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

/// A machine and a drive before they are switched on.
#[derive(Clone, Debug)]
pub struct Start {
    /// The machine.
    pub model: Model,
    /// The board and how it is wired.
    pub board: BoardConfig,
    /// What the drive is given.
    pub plate: DrivePlate,
    /// Where the rotors stand, mechanical rad: screw, nut.
    pub angles: [f64; 2],
}

/// Time for which the machine is left alone before the drive is switched on, s: it stands where friction holds it.
const ALONE_S: f64 = 0.5;

impl Start {
    /// The machine and board of a set-up, with its rotors where the board's seed puts them.
    #[must_use]
    pub fn anywhere(setup: &Setup) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(setup.board.seed);
        let mut turn = || Uniform::new(0.0, TAU).map_or(0.0, |range| range.sample(&mut random));
        Self {
            model: setup.model.clone(),
            board: setup.board,
            plate: setup.plate(),
            angles: [turn(), turn()],
        }
    }
}

/// The machine at `angles`, left alone until friction holds it; then power comes up.
pub fn settle(board: &mut Board, angles: [f64; 2]) {
    for (axis, angle) in Axis::ALL.into_iter().zip(angles) {
        board.machine.set_motor_angle(axis, angle);
    }
    for _ in 0..(2.0 * ALONE_S / board.config().pwm_period_s()) as u32 {
        board.advance();
    }
    board.wake_encoders();
}
