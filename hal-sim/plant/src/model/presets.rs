//! Models that need no file.

use super::{
    COMMON_SCALE_PERIOD_M, EncoderKind, FeedModel, InstallationModel, Model, MotorModel,
    SensingModel, TorqueHarmonic,
};
use crate::Axis;
use std::f64::consts::TAU;

/// Rated torque of the paper's motors, N m (Table 1).
const RATED_TORQUE_NM: f64 = 1.3;
/// Lead of the paper's screw, m (Table 1).
const LEAD_M: f64 = 0.005;

impl Model {
    /// The machine of the paper: Table 1, everything lumped into `J_M` of each motor, harmonics of Section 5.
    ///
    /// Meant for [`Coupling::Lumped`](crate::machine::Coupling::Lumped), in which the feed contributes its lead and its
    /// load only. The load force is the one that the lead turns into 1 N m at each motor. `B` of Table 1 is read as
    /// N m s/rad. The table's mass and stiffness are there so that the model is complete; the lumped machine has them
    /// in `J_M` already.
    pub fn paper() -> Self {
        let motor = MotorModel {
            resistance_ohm: 1.7,
            inductance_h: 5.9e-3,
            pole_pairs: 5,
            flux_wb: 0.11,
            inertia_kg_m2: 7.2e-4,
            viscous_nm_s: 0.002,
            coulomb_nm: 0.0,
            torque_harmonics: vec![
                TorqueHarmonic {
                    order: 6.0,
                    amplitude_nm: 0.06 * RATED_TORQUE_NM,
                    phase_rad: 0.0,
                },
                TorqueHarmonic {
                    order: 12.0,
                    amplitude_nm: 0.02 * RATED_TORQUE_NM,
                    phase_rad: 0.0,
                },
            ],
        };
        Model {
            screw: motor.clone(),
            nut: motor,
            feed: FeedModel {
                lead_m: LEAD_M,
                table_mass_kg: 20.0,
                axial_stiffness_n_per_m: 2.0e8,
                axial_damping_ratio: 0.05,
                guideway_coulomb_n: 0.0,
                guideway_viscous_n_s_per_m: 0.0,
                pair_coulomb_nm: 0.0,
                presliding_m: 0.0,
                load_n: TAU / LEAD_M,
            },
            sensing: SensingModel {
                sample_hz: 10_000.0,
                control_hz: 20_000.0,
                encoder_counts_per_turn: 1 << 20,
                encoder: EncoderKind::Incremental,
                nut_encoder_counts_per_turn: None,
                nut_encoder: None,
                current_lsb_a: 10.0 / 4096.0,
                current_noise_a: 5.0 / 4096.0,
                table_noise_m: 0.0,
                table_error_m: 0.0,
                table_error_period_m: COMMON_SCALE_PERIOD_M,
                encoder_jitter_s: 0.0,
            },
            installation: InstallationModel::default(),
            measured: None,
            effects: Vec::new(),
        }
    }

    /// The coupled machine: the paper's motors and harmonics with bearing friction, an elastic screw, a table on a
    /// guideway and friction of the screw-nut pair.
    ///
    /// Meant for [`Coupling::Coupled`](crate::machine::Coupling::Coupled). What the paper does not give is of the size
    /// of common feed axes.
    pub fn coupled() -> Self {
        let mut model = Model::paper();
        for axis in Axis::ALL {
            let motor = model.motor_mut(axis);
            motor.inertia_kg_m2 = 7.0e-4;
            motor.viscous_nm_s = 4.0e-4;
            motor.coulomb_nm = 0.04;
        }
        model.feed.guideway_coulomb_n = 20.0;
        model.feed.guideway_viscous_n_s_per_m = 400.0;
        model.feed.pair_coulomb_nm = 0.03;
        model.feed.load_n = 400.0;
        model.sensing = SensingModel {
            sample_hz: 5_000.0,
            control_hz: 20_000.0,
            encoder_counts_per_turn: 131_072,
            encoder: EncoderKind::Incremental,
            nut_encoder_counts_per_turn: None,
            nut_encoder: None,
            current_lsb_a: 20.0 / 4096.0,
            current_noise_a: 0.004,
            table_noise_m: 1.0e-8,
            ..Self::paper().sensing
        };
        model
    }
}
