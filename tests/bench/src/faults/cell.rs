//! The cells: an input, what is wrong with it, and what the drive is doing then.

use control::encoder::Interface;
use control::sense::Shunts;
use hal_sim::boards::BoardKind;
use plant::Axis;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// An input of the drive that the simulated board has. A task that hangs, bits of memory that are wrong and what a pin does between two
/// samples are the emulated chip's: `tests/tests/chip/faults.rs`, `supply.rs`, `power_stage.rs`, `settling.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Input {
    /// A current channel: motor, phase (0 to 2 for a to c).
    Current(Axis, usize),
    /// The bus voltage at a motor's bridge.
    Bus(Axis),
    /// A heat sink's temperature.
    Temperature(Axis),
    /// A motor's encoder.
    Encoder(Axis),
    /// The index of a motor's encoder.
    Index(Axis),
    /// The table's scale.
    Scale,
    /// The end switch ahead of positive velocity.
    EndForward,
    /// The end switch ahead of negative velocity.
    EndBackward,
    /// One of the enable switch's two contacts. Somebody opens the switch 0.1 s after its fault.
    Enable(usize),
    /// A gate driver's fault line. The driver finds a fault 0.1 s after the drive was asked.
    DriverFault(Axis),
    /// What velocity is asked.
    Command,
    /// The word that changes while somebody commands.
    Heartbeat,
    /// What is demanded: stuck low it is rest, stuck high a reset, noisy anything.
    Demand,
    /// The controller's reset: by its pin, a debugger, a stored setting or a watchdog. Stuck low it stays, as while it is flashed.
    Reset,
    /// The controller's crystal.
    Clock,
    /// The controller's supply, 3.3 V.
    Supply,
}

/// What is wrong with an input, for good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Defect {
    /// Its wire is off.
    Missing,
    /// It keeps its last value.
    Frozen,
    /// At the low end of its range.
    StuckLow,
    /// At the high end.
    StuckHigh,
    /// Off by a constant.
    Offset,
    /// With noise.
    Noisy,
    /// Old.
    Late,
    /// Of the wrong sign, or polarity.
    WrongSign,
    /// It shows its neighbour.
    Swapped,
    /// Gone for some milliseconds, and back.
    Dips,
    /// It falls to nothing in seconds.
    Falls,
}

impl Defect {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Missing,
        Self::Frozen,
        Self::StuckLow,
        Self::StuckHigh,
        Self::Offset,
        Self::Noisy,
        Self::Late,
        Self::WrongSign,
        Self::Swapped,
        Self::Dips,
        Self::Falls,
    ];

    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Frozen => "frozen",
            Self::StuckLow => "stuck low",
            Self::StuckHigh => "stuck high",
            Self::Offset => "offset",
            Self::Noisy => "noisy",
            Self::Late => "late",
            Self::WrongSign => "wrong sign",
            Self::Swapped => "swapped",
            Self::Dips => "dips",
            Self::Falls => "falls",
        }
    }
}

/// What the drive is doing when the fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Situation {
    /// The fault is there before power comes up.
    Boot,
    /// Bridges open, the rotor angles not known. Alignment is demanded 0.2 s after the fault.
    Unaligned,
    /// One second into the alignment.
    Aligning,
    /// Bridges off, aligned.
    Ready,
    /// The nut held, the table at 2.5 mm/s.
    Cdfs,
    /// The nut at 800 rpm, the table at 20 mm/s.
    Ddfs,
    /// 40 ms into a reversal of table and base from there.
    Reversing,
    /// 50 ms into a stop from there.
    Stopping,
}

impl Situation {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Boot,
        Self::Unaligned,
        Self::Aligning,
        Self::Ready,
        Self::Cdfs,
        Self::Ddfs,
        Self::Reversing,
        Self::Stopping,
    ];

    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::Unaligned => "unaligned",
            Self::Aligning => "aligning",
            Self::Ready => "ready",
            Self::Cdfs => "CDFS 2.5 mm/s",
            Self::Ddfs => "DDFS 800 rpm",
            Self::Reversing => "reversing",
            Self::Stopping => "stopping",
        }
    }
}

/// One cell of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Cell {
    /// The board.
    pub board: BoardKind,
    /// Which input.
    pub input: Input,
    /// What is wrong with it.
    pub defect: Defect,
    /// When.
    pub situation: Situation,
}

impl Input {
    /// Those of a board.
    #[must_use]
    pub fn of(board: BoardKind) -> Vec<Self> {
        let plate = board.plate();
        let phases = match plate.board.shunts {
            Shunts::Two => 2,
            Shunts::Three => 3,
        };
        let mut inputs = Vec::new();
        for axis in Axis::ALL {
            inputs.extend((0..phases).map(|phase| Self::Current(axis, phase)));
            inputs.extend([
                Self::Bus(axis),
                Self::Temperature(axis),
                Self::Encoder(axis),
            ]);
            if plate.motors[axis.index()].encoder.interface == Interface::IncrementalWithIndex {
                inputs.push(Self::Index(axis));
            }
            inputs.push(Self::DriverFault(axis));
        }
        inputs.extend([
            Self::Scale,
            Self::EndForward,
            Self::EndBackward,
            Self::Enable(0),
            Self::Enable(1),
            Self::Command,
            Self::Heartbeat,
            Self::Demand,
            Self::Reset,
            Self::Clock,
            Self::Supply,
        ]);
        inputs
    }

    /// Whether `defect` is one of this input, and not the same as another of it.
    #[must_use]
    pub fn can_be(self, defect: Defect, board: BoardKind) -> bool {
        use Defect::{
            Dips, Falls, Frozen, Late, Missing, Noisy, Offset, StuckHigh, StuckLow, Swapped,
            WrongSign,
        };
        if matches!(defect, Dips | Falls) {
            return self == Self::Supply || (self, defect) == (Self::Reset, Dips);
        }
        match self {
            // Of two channels, each is the other's neighbour.
            Self::Current(_, phase) => {
                defect != Swapped || phase == 0 || board.plate().board.shunts == Shunts::Three
            }
            // A divider that is torn reads one end of the range; a voltage has no sign.
            Self::Bus(_) | Self::Temperature(_) => !matches!(defect, Missing | WrongSign),
            Self::Encoder(_) => true,
            // A line that stands at either end has no edge.
            Self::Index(_) => matches!(defect, Missing | Offset | Noisy),
            // A count that is torn stands; there is one scale.
            Self::Scale => !matches!(defect, Missing | Swapped),
            // Torn it is open; frozen it is as before, closed.
            Self::EndForward | Self::EndBackward => {
                matches!(
                    defect,
                    Missing | StuckLow | Noisy | Late | WrongSign | Swapped
                )
            }
            Self::Enable(_) => matches!(defect, Missing | StuckLow | Noisy | Late | WrongSign),
            Self::DriverFault(_) => matches!(defect, Missing | StuckLow | Noisy | Swapped),
            Self::Command => matches!(
                defect,
                Frozen | StuckLow | StuckHigh | Offset | Noisy | Late | WrongSign
            ),
            Self::Heartbeat => matches!(defect, Missing | Noisy | Late),
            Self::Demand => matches!(defect, StuckLow | StuckHigh | Noisy),
            Self::Reset => matches!(defect, StuckLow),
            // Frozen or stuck at either end it has no edges: missing. Offset it is fast, late it is slow.
            Self::Clock => matches!(defect, Missing | Offset | Noisy | Late),
            // Offset it is low, and above what the chip watches; stuck low it is below that, and above what resets it.
            Self::Supply => matches!(defect, Missing | StuckLow | Offset | Noisy),
        }
    }

    /// Its name in a few words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Current(axis, phase) => {
                format!("current {}, {}", ["a", "b", "c"][phase], axis.name())
            }
            Self::Bus(axis) => format!("bus, {}", axis.name()),
            Self::Temperature(axis) => format!("temperature, {}", axis.name()),
            Self::Encoder(axis) => format!("encoder, {}", axis.name()),
            Self::Index(axis) => format!("index, {}", axis.name()),
            Self::Scale => "scale".into(),
            Self::EndForward => "end switch, forwards".into(),
            Self::EndBackward => "end switch, backwards".into(),
            Self::Enable(contact) => format!("enable, contact {}", contact + 1),
            Self::DriverFault(axis) => format!("driver fault, {}", axis.name()),
            Self::Command => "command".into(),
            Self::Heartbeat => "heartbeat".into(),
            Self::Demand => "demand".into(),
            Self::Reset => "reset".into(),
            Self::Clock => "clock".into(),
            Self::Supply => "controller's supply".into(),
        }
    }
}

impl Cell {
    /// All of them, of both boards at 20 kHz.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut cells = Vec::new();
        for board in [BoardKind::Nucleo, BoardKind::Mains] {
            for input in Input::of(board) {
                for defect in Defect::ALL.into_iter().filter(|d| input.can_be(*d, board)) {
                    cells.extend(Situation::ALL.map(|situation| Self {
                        board,
                        input,
                        defect,
                        situation,
                    }));
                }
            }
        }
        cells
    }

    /// Its name in a few words.
    #[must_use]
    pub fn name(&self) -> String {
        format!(
            "{}: {} {}, {}",
            self.board.name(),
            self.input.name(),
            self.defect.name(),
            self.situation.name()
        )
    }
}

/// Two faults that come at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The board.
    pub board: BoardKind,
    /// Two inputs and what is wrong with each.
    pub faults: [(Input, Defect); 2],
    /// When.
    pub situation: Situation,
}

impl Pair {
    /// So many, drawn from the matrix's cells: two of one board, of two inputs, in the situation of the first.
    #[must_use]
    pub fn drawn(count: usize, seed: u64) -> Vec<Self> {
        let cells = Cell::all();
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut draw = || cells[(random.next_u64() % cells.len() as u64) as usize];
        let mut pairs = Vec::with_capacity(count);
        while pairs.len() < count {
            let (one, other) = (draw(), draw());
            if one.board == other.board && one.input != other.input {
                pairs.push(Self {
                    board: one.board,
                    faults: [(one.input, one.defect), (other.input, other.defect)],
                    situation: one.situation,
                });
            }
        }
        pairs
    }

    /// Its name in a few words.
    #[must_use]
    pub fn name(&self) -> String {
        let [one, other] = self
            .faults
            .map(|(input, defect)| format!("{} {}", input.name(), defect.name()));
        format!(
            "{}: {one} and {other}, {}",
            self.board.name(),
            self.situation.name()
        )
    }
}
