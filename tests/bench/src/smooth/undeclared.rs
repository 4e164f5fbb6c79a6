//! Ripple whose orders no setting names, on the elastic machine and on boards as they ship: the orders are searched in a recording, then learned.

use super::machine::without_ripple;
use super::{Machine, drive, orders, settle, setup, velocities};
use crate::smooth::bench::{COLD_S, LEARNING_S};
use anyhow::Result;
use control::plate::CompensationPlate;
use ddfeed::compensate;
use hal_sim::drive::Drive;
use hal_sim::experiment::{self, ExperimentError, OperatingPoint, RPM, Recorder, Setup};
use hal_sim::seam::Straight;
use hal_sim::smooth::smoothness;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::effects::{
    AnyEffect, BallPassage, EffectModel, EncoderEccentricity, FluxHarmonic, LeadError, Place,
};
use plant::recording::Recording;
use std::f64::consts::PI;

/// Damping of the axial mode.
const DAMPING: f64 = 0.016;
/// Table velocity, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Rows a second of the recording, its table velocity in m/s, nut speeds in rpm, and length of each hold in s.
const ROWS_HZ: f64 = 5e3;
const RECORDED_VELOCITY: f64 = 5e-3;
const RECORDED_RPM: [f64; 3] = [150.0, 300.0, 700.0];
const HOLD_S: f64 = 4.0;
/// Standard deviation of the instant at which an encoder is read, s.
const JITTER_S: f64 = 0.2e-6;
/// The loads under which it is recorded, of the machine's. A board that ships has none.
const LOADS: [f64; 2] = [0.2, 1.0];

/// What the machine has beside the defects of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undeclared {
    /// Nothing.
    Nothing,
    /// The same, and the search is not run: the settings name all orders.
    Declared,
    /// Both encoders err twice a turn by 8 arcsec.
    EncoderOrder2,
    /// Balls pass 11.3 times a relative turn; the lead errs twice.
    BallPassage,
    /// The flux has harmonics 6, 12, 18 and 24 in place of torques that do not depend on the current.
    Flux,
    /// The scale errs by 20 nm, 1.7 periods a turn of the screw: no order of the lead's.
    Scale,
    /// The encoders are read 0.2 us early or late, at random.
    Jitter,
    /// That alone, on a machine without ripple and a drive without orders.
    JitterAlone,
}

impl Undeclared {
    /// All.
    pub const ALL: [Self; 8] = [
        Self::Declared,
        Self::Nothing,
        Self::EncoderOrder2,
        Self::BallPassage,
        Self::Flux,
        Self::Scale,
        Self::Jitter,
        Self::JitterAlone,
    ];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Declared => "orders declared",
            Self::Nothing => "orders searched",
            Self::EncoderOrder2 => "encoder order 2, 8 arcsec",
            Self::BallPassage => "ball passage 11.3, lead order 2",
            Self::Flux => "flux harmonics 6, 12, 18, 24",
            Self::Scale => "scale error, 20 nm",
            Self::Jitter => "encoder jitter, 0.2 us",
            Self::JitterAlone => "encoder jitter alone",
        }
    }

    /// The machine with it, on mean bridges or on switching ones.
    fn setup(self, machine: Machine, switching: Option<Switching>) -> Setup {
        let mut setup = setup(machine, 1);
        setup.board.switching = switching;
        setup.model.feed.axial_damping_ratio = DAMPING;
        let (model, sensors) = (&mut setup.model, &mut setup.board.sensors);
        let mut add = |place, effect: AnyEffect| {
            model.effects.extend(EffectModel::new(place, effect));
        };
        let (amplitude, phase) = (8.0 / 3600.0 * PI / 180.0, 0.7);
        match self {
            Self::Declared | Self::Nothing => {}
            Self::EncoderOrder2 => {
                let order = 2.0;
                add(
                    Place::Both,
                    EncoderEccentricity {
                        order,
                        amplitude,
                        phase,
                    }
                    .into(),
                );
            }
            Self::BallPassage => {
                let balls = BallPassage {
                    order: 11.3,
                    amplitude: 0.01,
                    phase,
                };
                let lead = LeadError {
                    order: 2.0,
                    amplitude: 1e-6,
                    phase,
                };
                add(Place::Feed, balls.into());
                add(Place::Feed, lead.into());
            }
            Self::Flux => {
                for (order, amplitude) in [(6.0, 0.06), (12.0, 0.02), (18.0, 0.01), (24.0, 0.005)] {
                    add(
                        Place::Both,
                        FluxHarmonic {
                            order,
                            amplitude,
                            phase,
                        }
                        .into(),
                    );
                }
                for axis in Axis::ALL {
                    model.motor_mut(axis).torque_harmonics.clear();
                }
            }
            Self::Scale => {
                sensors.scale_error_m = 20e-9;
                sensors.scale_period_m = model.feed.lead_m / 1.7;
            }
            Self::Jitter => sensors.encoder_jitter_s = JITTER_S,
            Self::JitterAlone => {
                without_ripple(model);
                sensors.encoder_jitter_s = JITTER_S;
            }
        }
        setup.model.sensing = setup.board.sensors.described(setup.model.sensing);
        setup
    }
}

/// Ripple of the table at 2.5 mm/s (Eq 19), %, at a nut speed in rpm; 0 is CDFS.
///
/// # Errors
/// A drive that cannot be configured or is stopped by a fault; a recording that cannot be searched.
pub fn ripple(
    machine: Machine,
    switching: Option<Switching>,
    case: Undeclared,
    nut_rpm: f64,
) -> Result<f64> {
    let setup = case.setup(machine, switching);
    let point = OperatingPoint {
        velocity: VELOCITY,
        base: nut_rpm * RPM,
    };
    let declared = orders(&setup, LEARNING_S, true);
    let plate = match case {
        Undeclared::Declared => declared,
        Undeclared::JitterAlone => CompensationPlate::NONE,
        _ => CompensationPlate {
            learning_s: LEARNING_S,
            scale_count_m: declared.scale_count_m,
            ..compensate::orders(&recording(&setup)?, &setup.model)?.plate()
        },
    };
    let mut drive = drive(&setup, plate)?;
    settle(&mut drive, point, &mut Straight)?;
    velocities(&mut drive, COLD_S, &mut Straight)?;
    Ok(smoothness(&mut drive, point, 0.0)?.vrf)
}

/// Holds at three nut speeds, under two loads, without a compensation. Rows are taken on the way to a hold too: they count the turns.
fn recording(setup: &Setup) -> Result<Recording> {
    let mut recording = Recording::default();
    let mut recorder = Recorder::default();
    let mut drive = setup.drive()?;
    let period_s = setup.board.pwm_period_s();
    let periods = (1.0 / (ROWS_HZ * period_s)).round() as u64;
    let mut row = |drive: &mut Drive| {
        if drive.periods().is_multiple_of(periods) {
            recording.push(&recorder.row(drive));
        }
    };
    for load in LOADS {
        let force = load * setup.model.feed.load_n;
        drive.board.machine.set_load_force(force);
        for rpm in RECORDED_RPM {
            let point = OperatingPoint {
                velocity: RECORDED_VELOCITY,
                base: rpm * RPM,
            };
            experiment::settle(&mut drive, point, |drive| {
                row(drive);
                Ok::<_, ExperimentError>(())
            })?;
            for _ in 0..(HOLD_S / period_s) as u64 {
                drive.period();
                row(&mut drive);
            }
        }
    }
    Ok(recording)
}
