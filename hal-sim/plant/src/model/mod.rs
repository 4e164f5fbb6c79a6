//! The model of a machine, as `model.toml` declares it.
//!
//! Every field's unit is the suffix of its name. Reading checks each value against its physical range; an error names
//! file, line, key, what was read and what is allowed.

mod error;
mod installation;
mod measured;
mod presets;
mod read;
mod write;

pub use error::ModelError;
pub use installation::{Brake, InstallationModel};
pub use measured::{MeasuredFeed, MeasuredModel, MeasuredMotor};

use crate::Axis;
use crate::effects::EffectModel;
use crate::limits;
use serde::{Deserialize, Serialize};

/// All that is known of a machine.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// The motor that turns the screw, with all that turns with it.
    pub screw: MotorModel,
    /// The motor that turns the nut, with all that turns with it.
    pub nut: MotorModel,
    /// Screw-nut pair, table and guideway.
    pub feed: FeedModel,
    /// What measures the machine.
    pub sensing: SensingModel,
    /// Where it stands.
    pub installation: InstallationModel,
    /// How well the motors' values are known, where they were measured.
    pub measured: Option<MeasuredModel>,
    /// What the machine has beyond that: `[[effects]]`, in the order of the file.
    pub effects: Vec<EffectModel>,
}

impl Model {
    /// The motor of one axis.
    pub fn motor(&self, axis: Axis) -> &MotorModel {
        match axis {
            Axis::Screw => &self.screw,
            Axis::Nut => &self.nut,
        }
    }

    /// The motor of one axis, to change.
    pub fn motor_mut(&mut self, axis: Axis) -> &mut MotorModel {
        match axis {
            Axis::Screw => &mut self.screw,
            Axis::Nut => &mut self.nut,
        }
    }
}

/// A surface-mounted permanent-magnet motor (`L_d = L_q`) and the inertia and friction on its shaft (Eqs 1 to 6).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorModel {
    /// Phase resistance; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub resistance_ohm: f64,
    /// Phase inductance, of d and q alike; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub inductance_h: f64,
    /// Pole pairs; 1 to 1000.
    #[serde(deserialize_with = "limits::pole_pairs")]
    pub pole_pairs: u32,
    /// Magnet flux in power-invariant scaling: `torque = pole_pairs * flux * i_q`; above 0. From a datasheet: 0.00955 Ke / pole_pairs, with
    /// Ke in V rms between two leads at 1000 rpm.
    #[serde(deserialize_with = "limits::positive")]
    pub flux_wb: f64,
    /// Inertia of everything that turns with the shaft, without the table; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub inertia_kg_m2: f64,
    /// Viscous friction, N m per rad/s; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub viscous_nm_s: f64,
    /// Coulomb friction; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub coulomb_nm: f64,
    /// Torque harmonics of the electrical angle (Eq 15).
    #[serde(default)]
    pub torque_harmonics: Vec<TorqueHarmonic>,
}

/// `amplitude * cos(order * theta_e + phase)`, added to the shaft's torque (Eq 15).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueHarmonic {
    /// Periods per electrical turn; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude_nm: f64,
    /// Phase.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase_rad: f64,
}

/// Screw-nut pair, table and guideway.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeedModel {
    /// Travel per relative turn of screw against nut; not 0. Negative for a left-handed screw.
    #[serde(deserialize_with = "limits::lead")]
    pub lead_m: f64,
    /// Mass of table and load; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub table_mass_kg: f64,
    /// Stiffness between the screw's thread and the table; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub axial_stiffness_n_per_m: f64,
    /// Damping of the table on that stiffness, relative to critical; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub axial_damping_ratio: f64,
    /// Coulomb friction of the guideway; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub guideway_coulomb_n: f64,
    /// Viscous friction of the guideway, N per m/s; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub guideway_viscous_n_s_per_m: f64,
    /// Coulomb friction of the screw-nut pair on the relative speed; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub pair_coulomb_nm: f64,
    /// Travel of the table over which all Coulomb friction is elastic before it slides (LuGre), m; 0 or above. 0 if left out.
    #[serde(
        default,
        deserialize_with = "limits::non_negative",
        skip_serializing_if = "is_zero"
    )]
    pub presliding_m: f64,
    /// Constant force against positive travel.
    #[serde(deserialize_with = "limits::finite")]
    pub load_n: f64,
}

/// What serde takes to leave a key out.
#[allow(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl FeedModel {
    /// Travel per radian of screw against nut, m/rad.
    pub fn travel_per_radian(&self) -> f64 {
        self.lead_m / std::f64::consts::TAU
    }
}

/// Sampling and sensors. Their noise and quantisation belong to the board's simulation; the machine itself uses none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensingModel {
    /// Rate of a recording's rows; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub sample_hz: f64,
    /// Rate of the current loops; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub control_hz: f64,
    /// Counts per mechanical turn of either encoder, or of the screw's: four times the lines of an incremental one; 1 to 2^31.
    #[serde(deserialize_with = "limits::counts")]
    pub encoder_counts_per_turn: u32,
    /// Counts per mechanical turn of the nut's encoder; 1 to 2^31. As the screw's if left out.
    #[serde(
        default,
        deserialize_with = "limits::some_counts",
        skip_serializing_if = "Option::is_none"
    )]
    pub nut_encoder_counts_per_turn: Option<u32>,
    /// Kind of either encoder, or of the screw's: `incremental`, `index` (incremental with an index) or `absolute`, which has 2^21 counts. `incremental` if left out.
    #[serde(default)]
    pub encoder: EncoderKind,
    /// Kind of the nut's encoder. As the screw's if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nut_encoder: Option<EncoderKind>,
    /// One count of the current measurement; 0 (ideal) or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub current_lsb_a: f64,
    /// Standard deviation of the current's noise; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub current_noise_a: f64,
    /// Standard deviation of the table scale's noise; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub table_noise_m: f64,
    /// Error of the table's scale that repeats with its period (sub-divisional error), amplitude; 0 or above. 0 if left out.
    #[serde(
        default,
        deserialize_with = "limits::non_negative",
        skip_serializing_if = "is_zero"
    )]
    pub table_error_m: f64,
    /// Period of the scale's error along the travel; above 0. 20 um if left out.
    #[serde(
        default = "common_scale_period_m",
        deserialize_with = "limits::positive",
        skip_serializing_if = "is_common_scale_period"
    )]
    pub table_error_period_m: f64,
    /// Standard deviation of the instant at which an encoder's angle is taken; 0 or above. 0 if left out.
    #[serde(
        default,
        deserialize_with = "limits::non_negative",
        skip_serializing_if = "is_zero"
    )]
    pub encoder_jitter_s: f64,
}

/// Period of common optical scales, m (Heidenhain LIDA 400, Renishaw RGSZ20: 20 um).
pub const COMMON_SCALE_PERIOD_M: f64 = 20e-6;

fn common_scale_period_m() -> f64 {
    COMMON_SCALE_PERIOD_M
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_common_scale_period(value: &f64) -> bool {
    *value == COMMON_SCALE_PERIOD_M
}

impl SensingModel {
    /// Counts per mechanical turn of a motor's encoder.
    #[must_use]
    pub fn counts_per_turn(&self, axis: Axis) -> u32 {
        let nut = self
            .nut_encoder_counts_per_turn
            .filter(|_| axis == Axis::Nut);
        nut.unwrap_or(self.encoder_counts_per_turn)
    }

    /// Kind of a motor's encoder.
    #[must_use]
    pub fn encoder_kind(&self, axis: Axis) -> EncoderKind {
        let nut = self.nut_encoder.filter(|_| axis == Axis::Nut);
        nut.unwrap_or(self.encoder)
    }
}

/// What an encoder knows of its shaft when power comes up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EncoderKind {
    /// Nothing: it counts from where the shaft stands.
    #[default]
    Incremental,
    /// Nothing, until the shaft passes its index: there the count is zero.
    Index,
    /// The shaft's angle.
    Absolute,
}
