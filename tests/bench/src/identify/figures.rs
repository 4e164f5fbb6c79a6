//! The figures that the tool is held to, on the data beside the project.

use super::judge::right;
use cpu_time::ThreadTime;
use identify::analysis::{Outcome, analyse};
use identify::machines::feed_axis::{self, Axis};
use identify::machines::motor::{self, MotorModel};
use identify::paper;
use identify::records::{How, LoadError, Mapping, OnFault, load};
use plant::model::Model;
use plant::recording::Recording;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;

/// Machines of the shared recordings.
const MACHINES: u32 = 10;

/// A motor's records under a plain least-squares fit's errors: what was reached on the check record.
#[derive(Debug, Serialize)]
pub struct MeasuredPair {
    /// File that was fitted.
    pub fit: String,
    /// File that was not.
    pub check: String,
    /// Error of inertia and friction alone, % of the check record's rms.
    pub before_percent: f64,
    /// With what is named.
    pub after_percent: f64,
    /// Effects that are named.
    pub names: usize,
}

/// Everything that is measured. What is not there is skipped and named on standard error.
pub struct Figures {
    /// Machines of the shared recordings that are identified right, of how many; `None` without their answers.
    pub open: Option<(u32, u32)>,
    /// What was found on each of them, in words.
    pub found: Vec<String>,
    /// The feed axis.
    pub axis: Option<feed_axis::Study>,
    /// The motor: records and study.
    pub motor: Option<MotorFigures>,
    /// Motors that other people measured: an ODrive's, and LAAS's driven by current steps.
    pub odrive: Vec<MeasuredPair>,
    /// The paper.
    pub paper: paper::Study,
    /// Mean CPU time of one recording with its check, both loaded, on the one thread that it runs on, s: other load on
    /// the machine does not count.
    pub seconds_per_recording: Option<f64>,
}

/// A motor's study and how it depends on what was chosen.
pub struct MotorFigures {
    /// First half fitted, second half checked, filtered.
    pub study: motor::Study,
    /// The halves swapped: before and after, %.
    pub swapped_percent: [f64; 2],
    /// What is known of the motor.
    pub model: MotorModel,
}

impl Figures {
    /// Measures everything in `folder`. `answers` judges the shared recordings.
    pub fn measure(folder: &Path, answers: Option<&Value>) -> Self {
        let recordings = Recordings::measure(folder, answers);
        Figures {
            open: answers.map(|_| (recordings.right, recordings.of)),
            found: recordings.found,
            axis: axis(&folder.join("measured/emps")),
            motor: motor_figures(&folder.join("measured/laas")),
            odrive: measured_pairs(&folder.join("measured")),
            paper: paper::Study::new(&Model::paper()),
            seconds_per_recording: (recordings.of > 0)
                .then(|| recordings.seconds / f64::from(recordings.of)),
        }
    }

    /// The figures as they are printed for a program.
    pub fn json(&self) -> Value {
        let errors = |errors: &feed_axis::Errors| {
            json!({
                "force_percent": errors.force_percent,
                "velocity_percent": errors.velocity_percent,
                "position_um": errors.position_um,
            })
        };
        json!({
            "open": {
                "right": self.open.map(|(right, _)| right),
                "of": self.open.map(|(_, of)| of),
            },
            "emps": self.axis.as_ref().map(|study| json!({
                "published": errors(&study.first().test),
                "ours": errors(&study.best().test),
                "ours_homed": errors(&study.best().homed),
                "fitted_to_test": errors(&study.fitted_to_test),
                "ours_check_friction": study.own_friction.as_ref().map(|own| errors(&own.errors)),
            })),
            "laas": self.motor.as_ref().map(|motor| json!({
                "before_percent": motor.study.before_percent(),
                "after_percent": motor.study.curved_percent(),
            })),
            "odrive": self.odrive,
            "seconds_per_recording": self.seconds_per_recording,
        })
    }
}

#[derive(Default)]
struct Recordings {
    right: u32,
    of: u32,
    seconds: f64,
    found: Vec<String>,
}

impl Recordings {
    fn measure(folder: &Path, answers: Option<&Value>) -> Self {
        let mut all = Recordings::default();
        for k in 1..=MACHINES {
            let name = format!("open-{k:02}");
            let at = folder.join("recordings").join(&name);
            let (Ok(model), Ok(fit), Ok(check)) = (
                Model::load(&at.join("model.toml")),
                Recording::load(&at.join("fit.csv.gz")),
                Recording::load(&at.join("check.csv.gz")),
            ) else {
                eprintln!("skipped: {} is not there", at.display());
                continue;
            };
            let start = ThreadTime::now();
            let outcome = analyse(&model, &fit, &check);
            all.seconds += start.elapsed().as_secs_f64();
            all.of += 1;
            if let Some(answers) = answers {
                match right(answers, &name, &outcome) {
                    Some(right) => all.right += u32::from(right),
                    None => eprintln!("the answers have no entry that says what {name} has"),
                }
            }
            all.found.push(format!("{name}: {}", in_words(&outcome)));
        }
        all
    }
}

fn in_words(outcome: &Outcome) -> String {
    let names: Vec<String> = outcome
        .effects
        .iter()
        .map(|f| {
            format!(
                "{} at {}",
                f.effect.effect().kind(),
                f.effect.place().name()
            )
        })
        .collect();
    match names.is_empty() {
        true => outcome.verdict().into(),
        false => names.join(", "),
    }
}

fn axis(folder: &Path) -> Option<feed_axis::Study> {
    let load = |name: &str| feed_axis::Record::emps(&folder.join(name));
    match (load("DATA_EMPS.mat"), load("DATA_EMPS_PULSES.mat")) {
        (Ok(estimate), Ok(test)) => {
            Some(feed_axis::Study::new(&Axis::published(), &estimate, &test))
        }
        (Err(error), _) | (_, Err(error)) => {
            eprintln!("skipped: {error}");
            None
        }
    }
}

fn motor_figures(folder: &Path) -> Option<MotorFigures> {
    let (record, map) = match motor::Record::laas(folder) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("skipped: {error}");
            return None;
        }
    };
    let [first, second] = record.halves();
    let study = motor::Study::new(&first, &second, Some(&map));
    let swapped = motor::Study::new(&second, &first, Some(&map));
    Some(MotorFigures {
        swapped_percent: [swapped.before_percent(), swapped.after_percent()],
        study,
        model: MotorModel::laas(),
    })
}

/// Fits and checks on the records in `folder`, an ODrive's and LAAS's; what is not there is skipped and named.
pub fn measured_pairs(folder: &Path) -> Vec<MeasuredPair> {
    let (drive, map, laas) = (
        include_str!("../../../../hal-sim/identify/mappings/odrive.toml"),
        include_str!("../../../../hal-sim/identify/mappings/odrive-map.toml"),
        include_str!("../../../../hal-sim/identify/mappings/laas-acc.toml"),
    );
    let pairs = [
        (
            drive,
            "odrive/slow_nocomp_1.npy",
            "odrive/slow_nocomp_2.npy",
        ),
        (
            drive,
            "odrive/slower_nocomp_0.npy",
            "odrive/slow_nocomp_2.npy",
        ),
        (
            map,
            "odrive/cogging_map_a_16.npy",
            "odrive/cogging_map_b_16.npy",
        ),
        (laas, "laas/acc_current.txt", "laas/acc_current.txt"),
    ];
    let of = |(mapping, fit, check): (&str, &str, &str)| -> Result<MeasuredPair, LoadError> {
        let mapping = Mapping::parse(mapping, "the project's own mapping")?;
        let how = How {
            mapping: &mapping,
            on_fault: OnFault::Skip,
            declared_hz: None,
        };
        let read = |name: &str| -> Result<motor::Record, LoadError> {
            Ok(motor::Record::new(load(
                &folder.join(name),
                how,
                &mut |_| (),
            )?))
        };
        let [first, second] = match fit == check {
            true => read(fit)?.halves(),
            false => [read(fit)?, read(check)?],
        };
        let study = motor::Study::new(&first, &second, None);
        Ok(MeasuredPair {
            fit: fit.into(),
            check: check.into(),
            before_percent: study.before_percent(),
            after_percent: study.curved_percent(),
            names: study.orders.len()
                + usize::from(study.lag.as_ref().is_some_and(|lag| lag.is_named)),
        })
    };
    let told = |pair| {
        of(pair)
            .inspect_err(|error| eprintln!("skipped: {error}"))
            .ok()
    };
    pairs.into_iter().filter_map(told).collect()
}
