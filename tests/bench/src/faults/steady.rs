//! Long steady running at common speeds and loads, in which no watch may stop the drive.

use super::Drives;
use control::fault::Fault;
use control::supervisor::State;
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, RPM};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

/// Table velocity, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Nut speeds, rpm: the single drive, the paper's, and faster ones.
const NUT_RPM: [f64; 6] = [0.0, 300.0, 500.0, 800.0, 1000.0, 1200.0];
/// Loads at each motor, of the rated torque. A nut that stands may make less than 0.7 of it for minutes.
const LOADS: [f64; 3] = [0.0, 0.25, 0.5];
/// Part of the largest torque that is the rated one, on both boards.
const RATED: f64 = 1.0 / 1.5;
/// The load comes when both motors hold it, s.
const LOADED_S: f64 = 0.3;

/// A steady run of the coupled machine on a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// The board.
    pub board: BoardKind,
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Load at each motor, of its rated torque.
    pub load: f64,
}

impl Steady {
    /// Both boards at all common speeds and loads.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for board in [BoardKind::Nucleo, BoardKind::Mains] {
            for nut_rpm in NUT_RPM {
                all.extend(LOADS.map(|load| Self {
                    board,
                    nut_rpm,
                    load,
                }));
            }
        }
        all
    }

    /// The fault that has stopped it within `seconds`, and after how many.
    ///
    /// # Errors
    /// [`ExperimentError`] if the drive cannot be configured or commanded.
    pub fn run(
        &self,
        drives: Drives,
        seconds: f64,
        seed: u64,
    ) -> Result<Option<(Fault, f64)>, ExperimentError> {
        let plate = drives.plate(self.board);
        let mut model = self.board.machine(&Model::coupled(), Coupling::Coupled);
        model.feed.load_n = 0.0;
        let config = BoardConfig {
            seed,
            ..drives.on(self.board.config())
        };
        let mut drive = Drive::aligned(&model, Coupling::Coupled, config, &plate)?;
        drive.command(VELOCITY, self.nut_rpm * RPM)?;
        let rated_nm = RATED * plate.motors[0].torque_max_nm;
        let load_n = self.load * rated_nm * TAU / model.feed.lead_m;
        let period_s = config.pwm_period_s();
        for period in 0..(seconds / period_s) as u64 {
            if period == (LOADED_S / period_s) as u64 {
                drive.board.machine.set_load_force(load_n);
            }
            drive.period();
            if let State::Fault(fault) = drive.state() {
                return Ok(Some((fault, period as f64 * period_s)));
            }
        }
        Ok(None)
    }
}
