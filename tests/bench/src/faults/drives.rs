//! The drives that a matrix, random pairs and long runs are of.

use control::plate::DrivePlate;
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::switching::Switching;

/// The same on both boards.
#[derive(Clone, Copy, Debug)]
pub struct Drives {
    /// They compensate what repeats with their angles, as the firmware's feature `smooth` does.
    pub compensated: bool,
    /// Their bridges switch; `None`: they hold mean voltages.
    pub switching: Option<Switching>,
}

impl Drives {
    /// As the boards ship, on bridges of mean voltages.
    pub const SHIPPED: Self = Self {
        compensated: false,
        switching: None,
    };
    /// The same with compensation.
    pub const COMPENSATED: Self = Self {
        compensated: true,
        ..Self::SHIPPED
    };

    pub(super) fn plate(self, board: BoardKind) -> DrivePlate {
        if self.compensated {
            board.smooth_plate()
        } else {
            board.plate()
        }
    }

    /// `config` with these bridges.
    pub(super) fn on(self, config: BoardConfig) -> BoardConfig {
        BoardConfig {
            switching: self.switching,
            ..config
        }
    }
}
