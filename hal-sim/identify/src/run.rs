//! The whole way from files to a report, for every kind of machine.

use crate::analysis::analyse;
use crate::effects::stick_slip::{self, FreeDrive};
use crate::machines::ModelFileError;
use crate::machines::feed_axis::{self, Axis};
use crate::machines::motor::{self, MotorModel};
use crate::machines::pmsm;
use crate::machines::pmsm_file::PmsmModel;
use crate::machines::voltage_frame;
use crate::records::quality::{Finding, Plate, wrong_data};
use crate::records::{
    self, DataQuality, How, LoadError, Machine, Mapping, OnFault, Record, load, load_map, windows,
};
use crate::report::{self, Report};
use crate::signal::frames::{clarke, park};
use plant::model::Model;
use plant::recording::{AxisRecord, Recording};
use std::path::PathBuf;

/// What to identify from what.
#[derive(Debug, Clone)]
pub struct Task {
    /// The declared model.
    pub model: PathBuf,
    /// The records to identify from.
    pub fit: Vec<PathBuf>,
    /// Others of the same machine: they confirm, and errors are reported on them. Without any, operating points of the
    /// fit record are held back.
    pub check: Vec<PathBuf>,
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
    /// How one record became fit and check record.
    pub split: Option<String>,
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

/// Data in which something is wrong: nothing is identified from it.
#[derive(Debug, Clone, serde::Serialize)]
pub struct WrongData {
    /// `wrong data`.
    pub verdict: &'static str,
    /// None.
    pub effects: [(); 0],
    /// What is wrong.
    pub wrong_data: Vec<Finding>,
    /// The files.
    pub records: Vec<DataQuality>,
}

impl std::fmt::Display for WrongData {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "wrong data")?;
        for finding in &self.wrong_data {
            write!(f, "\n  {}: {}", finding.file, finding.sentence)?;
        }
        Ok(())
    }
}

/// Why nothing was identified.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Something is wrong with the data.
    #[error("{0}")]
    WrongData(Box<WrongData>),
    /// A file is fit and check record.
    #[error(
        "{0} is fit and check record: what is fitted would confirm itself; give another record, or leave out --check, then \
         operating points of it are held back"
    )]
    SameFile(String),
    /// No record, or one that is too short to be divided.
    #[error("{0}")]
    Split(String),
    /// A record could not be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A double drive's model could not be read.
    #[error(transparent)]
    Model(#[from] plant::model::ModelError),
    /// Another machine's model could not be read, or is another than its mapping's.
    #[error(transparent)]
    ModelFile(#[from] ModelFileError),
}

impl Task {
    fn how<'a>(&self, mapping: &'a Mapping, declared_hz: Option<f64>) -> How<'a> {
        How {
            mapping,
            on_fault: self.on_fault,
            declared_hz,
        }
    }

    /// Does it.
    ///
    /// # Errors
    /// [`RunError`]: a model or a record that cannot be used.
    pub fn run(&self, told: &mut Told) -> Result<Done, RunError> {
        self.run_with(None, told)
    }

    /// As [`Task::run`]; a drive that runs free tells what balances cannot: a table that sticks and slips.
    ///
    /// # Errors
    /// [`RunError`]: a model or a record that cannot be used.
    pub fn run_with(
        &self,
        drive: Option<&dyn FreeDrive>,
        told: &mut Told,
    ) -> Result<Done, RunError> {
        match self.mapping.machine {
            Machine::DoubleDrive => self.double_drive(drive, told),
            Machine::FeedAxis => self.feed_axis(told),
            Machine::Motor => self.motor(told),
            Machine::Pmsm => self.pmsm(told),
        }
    }

    /// Fit and check record, in which nothing is wrong, and how they were divided.
    fn records(
        &self,
        mapping: &Mapping,
        declared_hz: Option<f64>,
        plate: Plate,
        told: &mut Told,
    ) -> Result<Front, RunError> {
        let own = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
        if let Some(same) = self
            .fit
            .iter()
            .find(|fit| self.check.iter().any(|check| own(check) == own(fit)))
        {
            return Err(RunError::SameFile(same.display().to_string()));
        }
        let how = self.how(mapping, declared_hz);
        let mut all = |paths: &[PathBuf], name: &str| -> Result<Vec<Record>, LoadError> {
            paths
                .iter()
                .map(|path| load(path, how, &mut reading(name, told)))
                .collect()
        };
        let (fit, check) = (
            all(&self.fit, "fit record")?,
            all(&self.check, "check record")?,
        );
        told("looking for wrong data", None);
        let wrong = wrong_data(&fit, &check, plate);
        if !wrong.is_empty() {
            return Err(RunError::WrongData(Box::new(WrongData {
                verdict: "wrong data",
                effects: [],
                wrong_data: wrong,
                records: fit
                    .iter()
                    .chain(&check)
                    .map(|r| r.quality.clone())
                    .collect(),
            })));
        }
        let [whole, other] = [&fit, &check].map(|records| longest(records.clone()));
        let whole = whole
            .ok_or_else(|| RunError::Split("no record to identify from: give --fit".into()))?;
        if let Some(other) = other {
            return Ok(Front {
                stretches: [fit, check].map(stretches),
                fit: whole,
                check: other,
                split: None,
            });
        }
        let fit = whole;
        let split = records::split(&fit).ok_or_else(|| {
            RunError::Split(format!(
                "{}: {:.2} s are too short to hold some of it back, expected 4 s; give another record with --check",
                fit.quality.file,
                fit.len() as f64 / fit.rate
            ))
        })?;
        Ok(Front {
            stretches: [&split.fit, &split.check].map(|part| part.clone().pieces()),
            fit: split.fit,
            check: split.check,
            split: Some(split.sentence),
        })
    }

    fn double_drive(
        &self,
        drive: Option<&dyn FreeDrive>,
        told: &mut Told,
    ) -> Result<Done, RunError> {
        let declared = Model::load(&self.model)?;
        let front = self.records(
            &self.mapping,
            Some(declared.sensing.sample_hz),
            Plate::DoubleDrive(&declared),
            told,
        )?;
        let accounts = front.accounts();
        let read =
            |record: Record| records::double_drive(record).map(|read| referred(read, &declared));
        let (fit, check) = (read(front.fit)?, read(front.check)?);
        told("tracing the residual", None);
        let sticks = drive.and_then(|drive| stick_slip::traced(&declared, &fit, &check, drive));
        let outcome = sticks.unwrap_or_else(|| analyse(&declared, &fit, &check));
        Ok(Done {
            report: report::traced(&outcome, accounts),
            split: front.split,
            replay: Some(Replay {
                declared,
                new: outcome.model,
                check,
            }),
        })
    }

    fn feed_axis(&self, told: &mut Told) -> Result<Done, RunError> {
        let declared = Axis::load(&self.model)?;
        let plate = Plate::FeedAxis {
            mass_kg: declared.base[0],
        };
        let mut front = self.records(&self.mapping, None, plate, told)?;
        let all = front.stretches.iter().flatten();
        if !all.clone().all(feed_axis::Record::has_law) {
            return axis_by_balance(&declared, front, told);
        }
        let [fit, check] =
            [&front.fit, &front.check].map(|own| feed_axis::Record::new(own.clone()));
        let left = fit.law_leaves().max(check.law_leaves());
        if left.is_nan() || left > LAW_LEFT {
            let [stretches, _] = &mut front.stretches;
            let quality = stretches.first_mut().map(|first| &mut first.quality);
            quality.into_iter().for_each(|quality| quality.notes.push(format!(
                "its output does not follow kv (kp (reference - position) - speed): {:.0} % of its rms is left, expected less than {:.0} %. \
                 Does the drive have a feed-forward, or other gains? The axis is identified by its balance of forces, without its law",
                100.0 * left,
                100.0 * LAW_LEFT
            )));
            return axis_by_balance(&declared, front, told);
        }
        let accounts = front.accounts();
        told("tracing the residual", None);
        let study = feed_axis::Study::new(&declared, &fit, &check);
        Ok(Done {
            report: report::feed_axis(&study, &fit, accounts),
            split: front.split,
            replay: None,
        })
    }

    fn pmsm(&self, told: &mut Told) -> Result<Done, RunError> {
        let model = PmsmModel::load(&self.model)?;
        let mut mapping = self.mapping.clone();
        let pole_pairs = f64::from(model.motor.pole_pairs);
        if let Some(other) = mapping
            .pole_pairs
            .replace(pole_pairs)
            .filter(|p| *p != pole_pairs)
        {
            return Err(model.other_pole_pairs(other).into());
        }
        let front = self.records(&mapping, None, Plate::Pmsm(&model.motor), told)?;
        let mut accounts = front.accounts();
        let sensing = model.sensing(front.fit.rate);
        let own = |record: &Record| {
            let voltages = ["ud_v", "uq_v"].map(|name| record.get(name).map(<[f64]>::to_vec));
            let [Some(ud_v), Some(uq_v)] = voltages else {
                return Err(model.no_voltages(&record.quality.file));
            };
            let angle_rad = record.channel("angle_rad").to_vec();
            let (id, iq) = (record.channel("id_a"), record.channel("iq_a"));
            let [ia_a, ib_a] = match (record.get("ia_a"), record.get("ib_a")) {
                (Some(a), Some(b)) => [a.to_vec(), b.to_vec()],
                _ => pmsm::phases(id, iq, |row| pole_pairs * angle_rad[row]),
            };
            Ok(AxisRecord {
                ia_a,
                ib_a,
                ud_v,
                uq_v,
                iq_ref_a: record.get("iq_ref_a").unwrap_or(iq).to_vec(),
                speed_ref_rad_s: match record.get("speed_ref_rad_s") {
                    Some(reference) => reference.to_vec(),
                    None => record.channel("speed_rad_s").to_vec(),
                },
                angle_rad,
            })
        };
        let mut sides = [own(&front.fit)?, own(&front.check)?];
        let rates = [sensing.sample_hz, sensing.control_hz];
        if let Some(age) = voltage_frame::age_s(&model.motor, rates, &sides[0]) {
            for (record, account) in sides.iter_mut().zip(&mut accounts) {
                voltage_frame::turn(pole_pairs, sensing.sample_hz, age, record);
                account.notes.push(format!(
                    "its voltages are turned by what the rotor turns in {:.1} us: they belong to an angle so much before their row's",
                    1e6 * age
                ));
            }
        }
        let [fit, check] = sides;
        told("tracing the residual", None);
        let outcome = pmsm::identify(&model.motor, &sensing, &fit, &check);
        Ok(Done {
            report: report::traced(&outcome, accounts),
            split: front.split,
            replay: None,
        })
    }

    fn motor(&self, told: &mut Told) -> Result<Done, RunError> {
        let model = MotorModel::load(&self.model)?;
        let front = self.records(&self.mapping, None, Plate::Motor, told)?;
        let front = front.in_windows();
        let accounts = front.joined();
        let [fit, check] = front.stretches.map(|stretches| {
            stretches
                .into_iter()
                .map(motor::Record::new)
                .collect::<Vec<_>>()
        });
        let map = match (&self.mapping.map, self.fit.first()) {
            (Some(name), Some(fit)) => Some(load_map(
                &fit.with_file_name(name),
                &self.mapping,
                &mut reading("slow turn", told),
            )?),
            _ => None,
        };
        told("tracing the residual", None);
        let study = motor::Study::of_stretches([&fit, &check], map.as_ref());
        Ok(Done {
            report: report::motor(&study, model, accounts),
            split: front.split,
            replay: None,
        })
    }
}

/// Fit and check record, and how one record became both.
struct Front {
    /// All stretches without a gap of both, at one rate each.
    stretches: [Vec<Record>; 2],
    fit: Record,
    check: Record,
    split: Option<String>,
}

impl Front {
    /// What became of their files' rows; the split stands with them.
    fn accounts(&self) -> [DataQuality; 2] {
        let mut accounts = [self.fit.quality.clone(), self.check.quality.clone()];
        accounts[0].notes.extend(self.split.clone());
        accounts
    }

    /// With as many rows as a search over bare columns can use.
    fn in_windows(self) -> Self {
        Front {
            stretches: self.stretches.map(windows),
            ..self
        }
    }

    /// The same where all stretches are used.
    fn joined(&self) -> [DataQuality; 2] {
        let mut accounts = [0, 1].map(|k: usize| {
            let parts = &self.stretches[k];
            let mut account = parts
                .first()
                .map(|part| part.quality.clone())
                .unwrap_or_default();
            if parts.len() > 1 {
                account.used = parts.iter().map(Record::len).sum();
                account.notes.push(format!(
                    "{} stretches without a gap are used together",
                    parts.len()
                ));
            }
            account
        });
        accounts[0].notes.extend(self.split.clone());
        accounts
    }
}

/// Share of a controller's output, below 100 Hz, that its law may leave. Of axes that follow it 0.02 is left at most, with a feed-forward of
/// the speed that the law lacks 7, with a position that is logged 2 ms late 0.4.
const LAW_LEFT: f64 = 0.2;

/// A feed axis whose control law is not known: its force by inertia, friction and what predicts the rest.
///
/// # Errors
/// [`RunError::Split`] without a force.
fn axis_by_balance(declared: &Axis, front: Front, told: &mut Told) -> Result<Done, RunError> {
    let front = front.in_windows();
    let accounts = front.joined();
    let mut sides = [Vec::new(), Vec::new()];
    for (side, stretches) in sides.iter_mut().zip(front.stretches) {
        for record in stretches {
            let file = record.quality.file.clone();
            let balance = feed_axis::balance_record(record, declared.lead_m).ok_or_else(|| {
                RunError::Split(format!(
                    "{file}: it has no force: expected `force_n`, or `output_v` with the constant `force_per_volt_n`"
                ))
            })?;
            side.push(balance);
        }
    }
    told("tracing the residual", None);
    let [fit, check] = &sides;
    let study = motor::Study::of_stretches([fit, check], None);
    Ok(Done {
        report: report::axis_by_balance(&study, declared, accounts),
        split: front.split,
        replay: None,
    })
}

/// All stretches of several records that have the rate of the longest one, within a hundredth.
fn stretches(records: Vec<Record>) -> Vec<Record> {
    let mut pieces: Vec<Record> = records.into_iter().flat_map(Record::pieces).collect();
    let longest = pieces.iter().max_by_key(|piece| piece.len());
    let rate = longest.map_or(1.0, |piece| piece.rate);
    pieces.retain(|piece| (piece.rate / rate - 1.0).abs() < 0.01);
    pieces
}

/// The longest stretch of several records; what is not used is said.
fn longest(records: Vec<Record>) -> Option<Record> {
    let (files, rows) = (
        records.len(),
        records.iter().map(Record::len).sum::<usize>(),
    );
    let pieces = records.into_iter().flat_map(Record::pieces);
    let mut longest = pieces.max_by_key(Record::len)?;
    if longest.len() < rows {
        let quality = &mut longest.quality;
        quality.cut = rows - longest.time.len();
        quality.notes.push(format!(
            "of {files} files with {rows} rows in all the longest stretch without a gap is used, {} rows",
            longest.time.len()
        ));
    }
    Some(longest)
}

/// Progress of one file.
fn reading<'a>(name: &'a str, told: &'a mut Told) -> impl FnMut(f64) + 'a {
    let what = format!("reading the {name}");
    move |share| told(&what, Some(share))
}

/// A recording in which the q current stands for its reference where a log has none.
fn referred(mut recording: Recording, model: &Model) -> Recording {
    for (axis, own) in plant::Axis::ALL.into_iter().zip(&mut recording.axes) {
        if own.iq_ref_a.is_empty() {
            let pole_pairs = f64::from(model.motor(axis).pole_pairs);
            let phases = own.ia_a.iter().zip(&own.ib_a);
            let q = |((a, b), angle): ((&f64, &f64), &f64)| {
                let (sin, cos) = (pole_pairs * angle).sin_cos();
                park(clarke(*a, *b), (cos, sin)).1
            };
            own.iq_ref_a = phases.zip(&own.angle_rad).map(q).collect();
        }
    }
    recording
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Currents of 0.3 A along d and 1.2 A along q, by the inverse of Clarke and Park in closed form: phase a is `sqrt(2/3)` times what
    /// the vector has along it, phase b the same a third of a turn on.
    #[test]
    fn the_measured_q_current_stands_for_a_reference_that_is_missing() {
        let model = Model::paper();
        let (mut recording, turns) = (Recording::default(), [0.1, 1.7, -3.2, 40.0]);
        for (axis, own) in plant::Axis::ALL.into_iter().zip(&mut recording.axes) {
            own.angle_rad = turns.to_vec();
            let phase = |behind: f64| {
                let pole_pairs = f64::from(model.motor(axis).pole_pairs);
                let along = |angle: &f64| {
                    let at = pole_pairs * angle - behind;
                    (2.0_f64 / 3.0).sqrt() * (0.3 * at.cos() - 1.2 * at.sin())
                };
                turns.iter().map(along).collect()
            };
            own.ia_a = phase(0.0);
            own.ib_a = phase(std::f64::consts::TAU / 3.0);
        }
        let had = Recording {
            axes: recording.axes.clone().map(|axis| AxisRecord {
                iq_ref_a: vec![0.7; turns.len()],
                ..axis
            }),
            ..Recording::default()
        };
        assert_eq!(referred(had.clone(), &model), had);
        for own in referred(recording, &model).axes {
            assert_eq!(own.iq_ref_a.len(), turns.len());
            assert!(
                own.iq_ref_a.iter().all(|q| (q - 1.2).abs() < 1e-9),
                "{:?}",
                own.iq_ref_a
            );
        }
    }
}
