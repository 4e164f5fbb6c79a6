//! From what was asked to a drive's set-up; what cannot be is refused before anything is run.

use super::options::{BoardName, Bridges, MachineOptions, Preset, RECORD_S, Sensing};
use anyhow::{Context, Result, ensure};
use control::mt6835::COUNTS_PER_TURN;
use control::plate::DrivePlate;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::smooth::known::Known;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::{EncoderKind, Model, SensingModel};
use std::f64::consts::TAU;

const _: () = assert!(RECORD_S == hal_sim::experiment::RECORD_S);

impl BoardName {
    /// The board that ships; `None`: the paper's machine.
    #[must_use]
    pub fn kind(self) -> Option<BoardKind> {
        match self {
            Self::Mains => Some(BoardKind::Mains),
            Self::Nucleo => Some(BoardKind::Nucleo),
            Self::Paper => None,
        }
    }
}

impl Bridges {
    /// The parts of a power stage that switches.
    #[must_use]
    pub fn switching(self) -> Option<Switching> {
        (self == Self::Switching).then(Switching::usual)
    }
}

impl MachineOptions {
    /// What measures the machine.
    pub fn sensing(&self) -> Sensing {
        let of_machine = match self.model {
            Some(_) => Sensing::Declared,
            None => Sensing::Real,
        };
        self.sensors.unwrap_or(of_machine)
    }

    /// The machine or its sensors are no shipped board's.
    fn is_own(&self) -> bool {
        self.model.is_some() || self.sensors.is_some()
    }

    /// The shipped board; `None`: the paper's machine.
    pub fn board(&self) -> Option<BoardKind> {
        match self.board {
            Some(board) => board.kind(),
            None => (!self.is_own()).then_some(BoardKind::Mains),
        }
    }

    /// The set-up, and the machine's name. `preset` is used where none is asked.
    pub fn setup(&self, preset: Preset) -> Result<(Setup, String)> {
        let board = self.board();
        let (model, coupling, name) = match (&self.model, self.machine.unwrap_or(preset)) {
            (Some(path), _) => (
                Model::load(path)?,
                Coupling::Coupled,
                path.display().to_string(),
            ),
            (None, Preset::Paper) => (Model::paper(), Coupling::Lumped, "paper".to_owned()),
            (None, Preset::Coupled) => (Model::coupled(), Coupling::Coupled, "coupled".to_owned()),
        };
        ensure!(
            model.feed.lead_m > 0.0,
            "{name}: `feed.lead_m` is {} m, but the drive counts a right-handed screw: exchange two phases and the tracks A and B of both \
             motors, and give {} m",
            model.feed.lead_m,
            -model.feed.lead_m
        );
        let name = match (board, &self.model) {
            (Some(board), Some(_)) => format!("{name} (on the {} board)", board.name()),
            (Some(BoardKind::Nucleo | BoardKind::Nucleo40kHz), None) => {
                format!("{name} (the NUCLEO board's motors)")
            }
            (Some(BoardKind::Mains), None) | (None, _) => name,
        };
        if let Some(load) = self.load {
            finite("--load", "N m", load, -1e3, 1e3)?;
        }
        ensure!(
            board.is_none() || self.sensors.is_none(),
            "--board names a board that has its own sensors, but --sensors is given too: leave one out, or give --board paper"
        );
        let mut setup = match (board, self.sensing()) {
            (Some(board), Sensing::Declared) => {
                ensure_simulated(&model.sensing)?;
                ensure_supplied(board, model.installation.bus_v)?;
                Setup::on_electronics(board, model, coupling)
            }
            (Some(board), _) => Setup::shipped(board, &model, coupling),
            (None, Sensing::Ideal) => Setup::ideal(model, coupling),
            (None, Sensing::Real) => Setup::real(model, coupling),
            (None, Sensing::Declared) => {
                ensure_simulated(&model.sensing)?;
                Setup::declared(model, coupling)
            }
        };
        if let Some(load) = self.load {
            let feed = &mut setup.model.feed;
            feed.load_n = load * TAU / feed.lead_m;
        }
        setup.board.switching = self.bridges.switching();
        setup.board.seed = self.seed;
        Ok((setup, name))
    }
}

/// Checks that the encoders of a model file can be simulated.
fn ensure_simulated(sensing: &SensingModel) -> Result<()> {
    for axis in Axis::ALL {
        let (counts, name) = (sensing.counts_per_turn(axis), axis.name());
        ensure!(
            sensing.encoder_kind(axis) != EncoderKind::Absolute || counts == COUNTS_PER_TURN,
            "sensing.encoder_counts_per_turn is {counts} of the {name}'s absolute encoder, but the simulated one is an MT6835 of \
             {COUNTS_PER_TURN} counts: give as many, or another sensing.encoder"
        );
    }
    Ok(())
}

/// Checks that a board works on a supply and measures it.
fn ensure_supplied(board: BoardKind, bus_v: f64) -> Result<()> {
    let DrivePlate {
        bridge,
        board: scales,
        ..
    } = board.plate();
    let [low, high] = [
        board.guards().bus_min_v,
        bridge
            .brake_fade_from_v
            .min(f64::from(scales.adc_counts - 1) * scales.bus_volts_per_count),
    ];
    ensure!(
        bus_v > low && bus_v < high,
        "installation.bus_v of the model is {bus_v} V, but the {} board works from {low} to {high} V: give another supply, or another \
         --board",
        board.name()
    );
    Ok(())
}

/// Checks a table velocity in mm/s against what the feed allows, before anything is run.
pub fn table_speed(value: f64, setup: &Setup) -> Result<f64> {
    let limit = setup.plate().feed.velocity_max * 1e3;
    finite("--table-speed", "mm/s", value, -limit, limit)?;
    anyhow::ensure!(
        value.abs() >= 1e-3,
        "--table-speed is {value} mm/s, but ripple is measured against the table's velocity: give at least 0.001 mm/s"
    );
    Ok(value * 1e-3)
}

/// Checks a nut speed in rpm against the motor, before anything is run; mechanical rad/s.
pub fn nut_speed(value: f64, velocity: f64, setup: &Setup) -> Result<f64> {
    let plate = setup.plate();
    let [screw, nut] = plate.motors.map(|motor| motor.speed_max_rpm);
    finite("--nut-rpm", "rpm", value, -nut, nut)?;
    let screw_rpm =
        value + velocity / setup.model.feed.travel_per_radian() / hal_sim::experiment::RPM;
    finite(
        "the screw's speed, --nut-rpm plus the table's share,",
        "rpm",
        screw_rpm,
        -screw,
        screw,
    )?;
    Ok(value * hal_sim::experiment::RPM)
}

/// The plate of a drive that compensates the orders and the friction of its model.
pub fn knowing_plate(setup: &Setup) -> DrivePlate {
    let known = Known::of(&setup.model);
    DrivePlate {
        compensation: known.compensation,
        friction: known.friction,
        ..setup.plate()
    }
}

/// Checks a record's length.
pub fn duration(value: f64) -> Result<f64> {
    finite("--duration", "s", value, 0.01, 1000.0)?;
    Ok(value)
}

fn finite(name: &str, unit: &str, value: f64, low: f64, high: f64) -> Result<()> {
    Some(value)
        .filter(|v| (low..=high).contains(v))
        .map(drop)
        .with_context(|| {
            format!("{name} is {value} {unit}, but {low} to {high} {unit} is possible")
        })
}
