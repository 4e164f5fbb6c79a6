//! The model file of a single permanent-magnet motor.

use crate::machines::ModelFileError;
use plant::model::{EncoderKind, Model, MotorModel, SensingModel};
use serde::Deserialize;
use std::path::Path;

/// What is declared of a motor and of what measures it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PmsmModel {
    /// The motor, with all that turns with it.
    pub motor: MotorModel,
    #[serde(default)]
    sensing: Sensing,
    #[serde(skip)]
    origin: String,
}

/// Rate of a common current loop, Hz.
const USUAL_CONTROL_HZ: f64 = 10_000.0;

/// Sensors. The part that is left out is that of a common drive: the noise floor rests on it, so give your own.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Sensing {
    /// Counts per mechanical turn; 16384 if left out.
    encoder_counts_per_turn: u32,
    /// One count of the current measurement; 0.01 if left out.
    current_lsb_a: f64,
    /// Standard deviation of the current's noise; 0.02 if left out.
    current_noise_a: f64,
    /// Rate of the current loop; 10000 if left out, or the rate of the rows if that is higher.
    control_hz: Option<f64>,
}

impl Default for Sensing {
    fn default() -> Self {
        Sensing {
            encoder_counts_per_turn: 16_384,
            current_lsb_a: 0.01,
            current_noise_a: 0.02,
            control_hz: None,
        }
    }
}

impl PmsmModel {
    /// Reads a model file.
    ///
    /// # Errors
    /// A file that cannot be read, or has other keys or values out of their range.
    pub fn load(path: &Path) -> Result<Self, ModelFileError> {
        ModelFileError::read(path, Self::parse)
    }

    fn parse(text: &str, origin: &str) -> Result<Self, ModelFileError> {
        let fault = |reason: String| {
            let expected = "expected the table [motor] and, if it is known, [sensing]";
            ModelFileError::new(origin, format!("{reason}; {expected}"))
        };
        let mut model: PmsmModel =
            toml::from_str(text).map_err(|error| fault(error.to_string()))?;
        let sensing = model.sensing;
        let sizes = [sensing.current_lsb_a, sensing.current_noise_a];
        let rate = sensing.control_hz.unwrap_or(1.0);
        let sound = sizes.iter().all(|v| v.is_finite() && *v >= 0.0)
            && sensing.encoder_counts_per_turn > 0
            && rate.is_finite()
            && rate > 0.0;
        if !sound {
            return Err(fault("a value of [sensing] is out of its range".into()));
        }
        origin.clone_into(&mut model.origin);
        Ok(model)
    }

    /// What measures it, at a rate of rows.
    pub fn sensing(&self, rate: f64) -> SensingModel {
        let own = &self.sensing;
        SensingModel {
            sample_hz: rate,
            control_hz: own.control_hz.unwrap_or(rate.max(USUAL_CONTROL_HZ)),
            encoder_counts_per_turn: own.encoder_counts_per_turn,
            encoder: EncoderKind::Incremental,
            nut_encoder_counts_per_turn: None,
            nut_encoder: None,
            current_lsb_a: own.current_lsb_a,
            current_noise_a: own.current_noise_a,
            table_noise_m: 1e-6,
            ..Model::paper().sensing
        }
    }

    /// That the mapping has other pole pairs.
    pub(crate) fn other_pole_pairs(&self, other: f64) -> ModelFileError {
        let own = self.motor.pole_pairs;
        ModelFileError::new(
            &self.origin,
            format!(
                "it declares {own} pole pairs, but the mapping {other}; expected the same, correct one of them"
            ),
        )
    }

    /// That a record has no voltages.
    pub(crate) fn no_voltages(&self, file: &str) -> ModelFileError {
        let reason = "it has no voltages, expected ud_v and uq_v, phase voltages or duties with the bus; without them map its q \
                      current and angle as a motor: machine = \"motor\"";
        ModelFileError::new(file, reason.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_alone_is_declared_by_its_plate() {
        let text = "[motor]\nresistance_ohm = 0.1\ninductance_h = 1e-4\npole_pairs = 7\nflux_wb = 0.005\n\
                    inertia_kg_m2 = 1e-4\nviscous_nm_s = 0.0\ncoulomb_nm = 0.01\n";
        let model = PmsmModel::parse(text, "model.toml").expect("a model");
        assert_eq!(model.motor.pole_pairs, 7);
        assert_eq!(model.sensing(500.0).control_hz, USUAL_CONTROL_HZ);
        assert_eq!(model.sensing(20_000.0).control_hz, 20_000.0);
        let wrong = PmsmModel::parse(&text.replace("flux_wb", "flux"), "model.toml");
        assert!(wrong.unwrap_err().to_string().contains("flux"));
        let zero = PmsmModel::parse(
            &format!("{text}[sensing]\ncontrol_hz = 0.0\n"),
            "model.toml",
        );
        assert!(zero.unwrap_err().to_string().contains("[sensing]"));
    }
}
