//! A single permanent-magnet motor with its electrical side: angle, currents and voltages.

use super::Machine;
use crate::analysis::{Outcome, analyse_as};
use crate::effects::family::Family;
use crate::effects::parameter::{MotorParameter, Parameter};
use crate::signal::channel::Channel;
use plant::Axis;
use plant::effects::Place;
use plant::model::{FeedModel, InstallationModel, Model, MotorModel, SensingModel};
use plant::recording::{AxisRecord, Recording};
use std::f64::consts::TAU;

/// See the module.
#[derive(Debug)]
pub struct Pmsm;

const CHANNELS: [Channel; 3] = [
    Channel::Torque(Axis::Screw),
    Channel::VoltageD(Axis::Screw),
    Channel::VoltageQ(Axis::Screw),
];

impl Machine for Pmsm {
    fn channels(&self) -> &'static [Channel] {
        &CHANNELS
    }

    fn axes(&self) -> &'static [Axis] {
        &[Axis::Screw]
    }

    fn parameters(&self) -> Vec<Parameter> {
        let own = Parameter::of_a_drive(Axis::Screw);
        // There is no table that would show when the angle was read.
        let lag = Parameter::Motor(Axis::Screw, MotorParameter::ReadingLag);
        own.into_iter()
            .filter(|parameter| *parameter != lag)
            .chain([
                Parameter::Motor(Axis::Screw, MotorParameter::Reversal),
                Parameter::Motor(Axis::Screw, MotorParameter::Load),
            ])
            .collect()
    }

    fn can_have(&self, family: Family) -> bool {
        family.is_of_a_motor()
    }

    fn name(&self, channel: Channel) -> &'static str {
        match channel {
            Channel::VoltageD(_) => "d voltage",
            Channel::VoltageQ(_) => "q voltage",
            _ => "torque",
        }
    }

    fn place(&self, _: Place) -> &'static str {
        "motor"
    }
}

/// The model of a machine that is this motor alone: nothing moves behind it.
pub fn model(motor: MotorModel, sensing: SensingModel) -> Model {
    Model {
        nut: motor.clone(),
        screw: motor,
        feed: FeedModel {
            lead_m: 1e-9,
            table_mass_kg: 1e-9,
            axial_stiffness_n_per_m: 1e9,
            axial_damping_ratio: 0.1,
            guideway_coulomb_n: 0.0,
            guideway_viscous_n_s_per_m: 0.0,
            pair_coulomb_nm: 0.0,
            presliding_m: 0.0,
            load_n: 0.0,
        },
        sensing,
        installation: InstallationModel::default(),
        measured: None,
        effects: Vec::new(),
    }
}

/// Identifies a motor alone from its own columns.
pub fn identify(
    motor: &MotorModel,
    sensing: &SensingModel,
    fit: &AxisRecord,
    check: &AxisRecord,
) -> Outcome {
    let model = model(motor.clone(), sensing.clone());
    let [fit, check] = [fit, check].map(|own| recording(sensing.sample_hz, own.clone()));
    analyse_as(&Pmsm, &model, &fit, &check)
}

/// A motor's columns as those of the screw's motor, the nut at rest.
pub fn recording(rate: f64, own: AxisRecord) -> Recording {
    let rows = own.angle_rad.len();
    let nothing = || vec![0.0; rows];
    let at_rest = AxisRecord {
        angle_rad: nothing(),
        ia_a: nothing(),
        ib_a: nothing(),
        ud_v: nothing(),
        uq_v: nothing(),
        iq_ref_a: nothing(),
        speed_ref_rad_s: nothing(),
    };
    Recording {
        time_s: (0..rows).map(|row| row as f64 / rate).collect(),
        axes: [own, at_rest],
        table_position_m: nothing(),
    }
}

/// Phase currents a and b of currents in the rotor's frame, power-invariant, at electrical angles.
pub fn phases(id: &[f64], iq: &[f64], electrical: impl Fn(usize) -> f64) -> [Vec<f64>; 2] {
    let phase = |lag: f64| {
        let scale = (2.0_f64 / 3.0).sqrt();
        (0..iq.len())
            .map(|row| {
                let (sin, cos) = (electrical(row) - lag).sin_cos();
                scale * (id[row] * cos - iq[row] * sin)
            })
            .collect()
    };
    [phase(0.0), phase(TAU / 3.0)]
}
