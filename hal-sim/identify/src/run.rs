//! The whole way from files to a report, for every kind of machine.

use crate::analysis::analyse;
use crate::feed_axis::{self, Axis};
use crate::load::{self, How, LoadError, Machine, Mapping, OnFault, load, load_map};
use crate::motor::{self, MotorModel};
use crate::report::{self, Report};
use plant::model::Model;
use plant::recording::Recording;
use std::path::PathBuf;

/// What to identify from what.
#[derive(Debug, Clone)]
pub struct Task {
    /// The declared model.
    pub model: PathBuf,
    /// The record to identify from.
    pub fit: PathBuf,
    /// Another one of the same machine: it confirms, and errors are reported on it.
    pub check: PathBuf,
    /// Layout of the records.
    pub mapping: Mapping,
    /// What is done with a record's faults.
    pub on_fault: OnFault,
}

/// Told what is going on, and how much of it is done where that is known.
pub type Told<'a> = dyn FnMut(&str, Option<f64>) + 'a;

/// A report, and what a simulation of the check record needs.
pub struct Done {
    /// The report.
    pub report: Report,
    /// Of a double drive: the declared model, the new one, and the check record.
    pub replay: Option<Replay>,
}

/// What a simulation of the check record needs.
pub struct Replay {
    /// The declared model.
    pub declared: Model,
    /// The new one.
    pub new: Model,
    /// The check record.
    pub check: Recording,
}

/// Why nothing was identified.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A record could not be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A double drive's model could not be read.
    #[error(transparent)]
    Model(#[from] plant::model::ModelError),
    /// An axis' model could not be read.
    #[error(transparent)]
    Axis(#[from] feed_axis::AxisModelError),
    /// A machine whose records can be read, but not yet identified.
    #[error(
        "a pmsm can be read but not identified; map its q current and angle as a motor: machine = \"motor\""
    )]
    Machine,
    /// A motor's model could not be read.
    #[error(transparent)]
    Motor(#[from] motor::MotorModelError),
}

impl Task {
    fn how(&self, declared_hz: Option<f64>) -> How<'_> {
        How {
            mapping: &self.mapping,
            on_fault: self.on_fault,
            declared_hz,
        }
    }

    /// Does it.
    ///
    /// # Errors
    /// [`RunError`]: a model or a record that cannot be used.
    pub fn run(&self, told: &mut Told) -> Result<Done, RunError> {
        match self.mapping.machine {
            Machine::DoubleDrive => self.double_drive(told),
            Machine::FeedAxis => self.feed_axis(told),
            Machine::Motor => self.motor(told),
            Machine::Pmsm => Err(RunError::Machine),
        }
    }

    fn double_drive(&self, told: &mut Told) -> Result<Done, RunError> {
        let declared = Model::load(&self.model)?;
        let how = self.how(Some(declared.sensing.sample_hz));
        let fit = load(&self.fit, how, &mut reading("fit record", told))?;
        let check = load(&self.check, how, &mut reading("check record", told))?;
        let accounts = [fit.quality.clone(), check.quality.clone()];
        let (fit, check) = (load::double_drive(fit)?, load::double_drive(check)?);
        told("tracing the residual", None);
        let outcome = analyse(&declared, &fit, &check);
        Ok(Done {
            report: report::traced(&outcome, accounts),
            replay: Some(Replay {
                declared,
                new: outcome.model,
                check,
            }),
        })
    }

    fn feed_axis(&self, told: &mut Told) -> Result<Done, RunError> {
        let declared = Axis::load(&self.model)?;
        let how = self.how(None);
        let mut record = |path, name: &str| {
            Ok::<_, LoadError>(feed_axis::Record::new(load(
                path,
                how,
                &mut reading(name, told),
            )?))
        };
        let (fit, check) = (
            record(&self.fit, "fit record")?,
            record(&self.check, "check record")?,
        );
        told("tracing the residual", None);
        let study = feed_axis::Study::new(&declared, &fit, &check);
        let accounts = [fit.account.clone(), check.account.clone()];
        Ok(Done {
            report: report::feed_axis(&study, &fit, accounts),
            replay: None,
        })
    }

    /// A record that is both fit and check record is halved: its first half fits, its second checks.
    fn motor(&self, told: &mut Told) -> Result<Done, RunError> {
        let model = MotorModel::load(&self.model)?;
        let how = self.how(None);
        let mut record = |path, name: &str| {
            Ok::<_, LoadError>(motor::Record::new(load(
                path,
                how,
                &mut reading(name, told),
            )?))
        };
        let fit = record(&self.fit, "fit record")?;
        let [fit, check] = match self.fit == self.check {
            true => fit.halves(),
            false => [fit, record(&self.check, "check record")?],
        };
        let map = match &self.mapping.map {
            Some(name) => {
                let path = self.fit.with_file_name(name);
                Some(load_map(
                    &path,
                    &self.mapping,
                    &mut reading("slow turn", told),
                )?)
            }
            None => None,
        };
        told("tracing the residual", None);
        let study = motor::Study::new(&fit, &check, map.as_ref());
        let accounts = [fit.account.clone(), check.account.clone()];
        Ok(Done {
            report: report::motor(&study, model, accounts),
            replay: None,
        })
    }
}

/// Progress of one file.
fn reading<'a>(name: &'a str, told: &'a mut Told) -> impl FnMut(f64) + 'a {
    let what = format!("reading the {name}");
    move |share| told(&what, Some(share))
}
