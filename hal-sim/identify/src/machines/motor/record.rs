//! The record of a motor, and what is known of the motor.

use crate::machines::ModelFileError;
use crate::records::{
    DataQuality, How, LoadError, Mapping, OnFault, Record as Loaded, load, load_map,
};
use serde::Deserialize;
use std::path::Path;

/// One record, even in time.
#[derive(Debug, Clone)]
pub struct Record {
    /// Rows a second.
    pub rate: f64,
    /// Mechanical angle, rad.
    pub position: Vec<f64>,
    /// Torque-making current, A.
    pub current: Vec<f64>,
    /// What became of the file's rows.
    pub account: DataQuality,
}

impl Record {
    /// Of columns that were loaded.
    pub fn new(loaded: Loaded) -> Self {
        let mut loaded = loaded.longest();
        Record {
            rate: loaded.rate,
            position: loaded.take("position_rad"),
            current: loaded.take("current_a"),
            account: loaded.quality,
        }
    }

    /// Rows from `from` up to `to`.
    fn part(&self, from: usize, to: usize) -> Self {
        Record {
            position: self.position[from..to].to_vec(),
            current: self.current[from..to].to_vec(),
            account: self.account.clone(),
            ..*self
        }
    }

    /// Its first and its second half.
    pub fn halves(&self) -> [Self; 2] {
        let (rows, middle) = (self.position.len(), self.position.len() / 2);
        [self.part(0, middle), self.part(middle, rows)]
    }

    /// LAAS's speed test and slow turn in `folder`.
    ///
    /// # Errors
    /// As [`load`].
    pub fn laas(folder: &Path) -> Result<(Self, [Vec<f64>; 2]), LoadError> {
        let mapping = Mapping::parse(include_str!("../../../mappings/laas.toml"), "laas.toml")?;
        let how = How {
            mapping: &mapping,
            on_fault: OnFault::Refuse,
            declared_hz: None,
        };
        let record = Record::new(load(&folder.join("speed_test.txt"), how, &mut |_| ())?);
        let map = load_map(&folder.join("stopped_data.txt"), &mapping, &mut |_| ())?;
        Ok((record, map))
    }
}

/// What is known of a motor.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorModel {
    /// Pole pairs.
    pub pole_pairs: u32,
}

impl MotorModel {
    /// Reads a model file.
    ///
    /// # Errors
    /// A file that cannot be read or has other keys.
    pub fn load(path: &Path) -> Result<Self, ModelFileError> {
        ModelFileError::read(path, Self::parse)
    }

    /// LAAS's motor.
    pub fn laas() -> Self {
        let text = include_str!("../../../mappings/laas-model.toml");
        Self::parse(text, "laas-model.toml").expect("the project's own file")
    }

    fn parse(text: &str, origin: &str) -> Result<Self, ModelFileError> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct File {
            motor: MotorModel,
        }
        let fault = |reason: String| {
            let expected = "expected the table [motor] with pole_pairs";
            ModelFileError::new(origin, format!("{reason}; {expected}"))
        };
        let File { motor } = toml::from_str(text).map_err(|e| fault(e.to_string()))?;
        match motor.pole_pairs {
            1..=200 => Ok(motor),
            other => Err(fault(format!("pole_pairs is {other}, expected 1 to 200"))),
        }
    }
}
