//! The boards that the firmware is built for, as the simulation has them: plates from the firmware's own sources.

use crate::board::{BoardConfig, Chopper};
use crate::sensors::{Adc, CurrentSensing, Sensors};
use control::guard::GuardPlate;
use control::plate::{DrivePlate, Settings};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

#[path = "../../firmware/src/board/mains_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod mains_plate;
#[path = "../../firmware/src/board/nucleo_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod nucleo_plate;
#[path = "../../firmware/src/board/paper_machine.rs"]
mod paper_machine;

/// A board, as the firmware's board module of that name has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BoardKind {
    /// `nucleo_g474re`: external amplifiers, incremental encoders, three shunts, 24 to 48 V.
    Nucleo,
    /// The same with its bridges at 40 kHz.
    Nucleo40kHz,
    /// `mains_310v`: external amplifiers, three shunts, the screw's encoder on SPI, the nut's with an index.
    Mains,
}

/// Capacitance of a switch of the mains board, F: the middle of the 100 to 300 pF that are taken to be usual; no board was measured.
const MAINS_SWITCH_F: f64 = 200e-12;
/// That of the NUCLEO's stages, F: 83 nC of output charge at 30 V. These are the figures of TI's CSD18540Q5B (60 V, 1.8 mohm; ZHCSCO6B),
/// as the data sheet of the stages' CSD88599Q5DC (60 V, 1.7 mohm) was not at hand.
const NUCLEO_SWITCH_F: f64 = 83e-9 / 30.0;

/// Both boards' shunts are under the low sides.
pub const SENSING: CurrentSensing = CurrentSensing::LowSide;

impl BoardKind {
    /// As a command's `--board` calls it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nucleo => "nucleo",
            Self::Nucleo40kHz => "nucleo at 40 kHz",
            Self::Mains => "mains",
        }
    }

    /// The drive's own settings on it.
    #[must_use]
    pub const fn settings(self) -> Settings {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => nucleo_plate::SETTINGS,
            Self::Mains => mains_plate::SETTINGS,
        }
    }

    /// Plate data of the drive on it.
    #[must_use]
    pub fn plate(self) -> DrivePlate {
        match self {
            Self::Nucleo => nucleo_plate::PLATE,
            Self::Nucleo40kHz => nucleo_plate::PLATE_40_KHZ,
            Self::Mains => mains_plate::PLATE,
        }
    }

    /// The same of a drive that compensates: [`Settings::smooth`].
    #[must_use]
    pub fn smooth_plate(self) -> DrivePlate {
        self.settings().smooth().plate(&self.plate().board)
    }

    /// What it bears.
    #[must_use]
    pub fn guards(self) -> GuardPlate {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => nucleo_plate::GUARDS,
            Self::Mains => mains_plate::GUARDS,
        }
    }

    /// What its ADCs read of its heat sinks at a temperature, degrees Celsius.
    #[must_use]
    pub fn counts_at(self, celsius: f64) -> [u16; 2] {
        let guards = self.guards();
        guards
            .temperatures
            .map(|plate| plate.counts(celsius, guards.adc_counts) as u16)
    }

    /// One count of its linear scale, m.
    #[must_use]
    pub fn scale_count_m(self) -> f64 {
        self.plate().feed.scale_count_m
    }

    /// Bus voltage that its tests run at, V.
    #[must_use]
    pub const fn bus_v(self) -> f64 {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => 36.0,
            Self::Mains => 310.0,
        }
    }

    /// Peak phase current that its comparators let pass, A.
    #[must_use]
    pub const fn over_current_a(self) -> f64 {
        match self {
            Self::Nucleo | Self::Nucleo40kHz => nucleo_plate::OVER_CURRENT_A,
            Self::Mains => mains_plate::OVER_CURRENT_A,
        }
    }

    /// `template` with the motors that its plate declares. The mains board's are the paper's, as those of the
    /// models are; others get electrical data and inertia of the plate, friction and torque harmonics in proportion to the
    /// torque, and the load in proportion to the inertia, so that it pulls the free-wheeling motors no faster.
    #[must_use]
    pub fn machine(self, template: &Model, coupling: Coupling) -> Model {
        let (plate, paper) = (self.plate(), Self::Mains.plate());
        let mut model = template.clone();
        let r = model.feed.travel_per_radian();
        let table = match coupling {
            Coupling::Lumped => 0.0,
            Coupling::Coupled => model.feed.table_mass_kg * r * r,
        };
        for axis in Axis::ALL {
            let (declared, known) = (&plate.motors[axis.index()], &paper.motors[axis.index()]);
            if declared.inertia_kg_m2 == known.inertia_kg_m2 {
                // The paper's motor, of which a model knows more than the plate.
                return model;
            }
            let torque = declared.torque_max_nm / known.torque_max_nm;
            let motor = model.motor_mut(axis);
            motor.resistance_ohm = declared.resistance_ohm;
            motor.inductance_h = declared.inductance_h;
            motor.pole_pairs = declared.pole_pairs;
            motor.flux_wb = declared.flux_wb;
            motor.inertia_kg_m2 = declared.inertia_kg_m2 - table;
            motor.viscous_nm_s *= declared.inertia_kg_m2 / known.inertia_kg_m2;
            motor.coulomb_nm *= torque;
            for harmonic in &mut motor.torque_harmonics {
                harmonic.amplitude_nm *= torque;
            }
        }
        let inertia = plate.motors[0].inertia_kg_m2 / paper.motors[0].inertia_kg_m2;
        model.feed.load_n *= inertia;
        model.feed.guideway_viscous_n_s_per_m *= inertia;
        model.feed.guideway_coulomb_n *= inertia;
        model.feed.pair_coulomb_nm *= plate.motors[0].torque_max_nm / paper.motors[0].torque_max_nm;
        model
    }

    /// The simulated board that has what the plate says.
    #[must_use]
    pub fn config(self) -> BoardConfig {
        let plate = self.plate();
        let board = &plate.board;
        let adc = |per_count, zero| Adc {
            counts: board.adc_counts,
            per_count,
            zero,
            noise: 0.5,
        };
        BoardConfig {
            timer_hz: board.timer_hz,
            pwm_hz: board.pwm_hz,
            bus_v: self.bus_v(),
            break_a: self.over_current_a(),
            shunts: board.shunts,
            dead_time_s: plate.bridge.dead_time_s,
            leg_f: match self {
                Self::Nucleo | Self::Nucleo40kHz => NUCLEO_SWITCH_F,
                Self::Mains => MAINS_SWITCH_F,
            },
            measure_zeros: plate.bridge.measure_zeros,
            sensing: SENSING,
            sensors: Sensors {
                encoders: plate.motors.map(|motor| motor.encoder),
                scale_count_m: self.scale_count_m(),
                current: adc(board.amps_per_count, board.zero_counts),
                bus: adc(board.bus_volts_per_count, 0.0),
                ..Sensors::real()
            },
            ..BoardConfig::default()
        }
    }

    /// The same on the bus that its wiring page asks for at this voltage, behind a supply that takes no current back: capacitors
    /// that take what both motors hold, or a brake chopper.
    #[must_use]
    pub fn config_on_its_bus(self) -> BoardConfig {
        let (bus_f, chopper) = match self {
            Self::Nucleo | Self::Nucleo40kHz => (9.8e-3, None),
            Self::Mains => {
                let chopper = Chopper {
                    on_off_v: [370.0, 360.0],
                    ohm: 100.0,
                };
                (470e-6, Some(chopper))
            }
        };
        BoardConfig {
            bus_f,
            chopper,
            ..self.config()
        }
    }
}
