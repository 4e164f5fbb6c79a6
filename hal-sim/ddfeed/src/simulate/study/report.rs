//! What a simulation found, as `report.json` holds it.

use page::document::short;
use serde::Serialize;

/// A whole report.
#[derive(Debug, Serialize)]
pub struct Report {
    /// What was simulated.
    pub setup: SetupReport,
    /// One run for each nut speed, in the order asked.
    pub runs: Vec<RunReport>,
    /// The sensitivity of the screw's motor to torque.
    pub sensitivity: SensitivityReport,
    /// Ripple against nut speed.
    pub curve: CurveReport,
}

impl Report {
    /// The CDFS run, if one was made.
    pub fn cdfs(&self) -> Option<&RunReport> {
        self.runs.iter().find(|run| run.nut_rpm == 0.0)
    }
}

/// What was simulated.
#[derive(Debug, Serialize)]
pub struct SetupReport {
    /// `paper` (lumped), `coupled`, or the model file's path.
    pub machine: String,
    /// `ideal`, `real`, `declared`, or those of a board.
    pub sensors: String,
    /// Table velocity, mm/s.
    pub table_mm_s: f64,
    /// Load, as a person reads it.
    pub load: String,
    /// Length of each record, s.
    pub record_s: f64,
    /// Rate of the velocity records, Hz.
    pub record_hz: f64,
    /// Seed of all noise.
    pub seed: u64,
    /// The run has the paper's machine and table velocity, so that its measured figures can be compared.
    pub is_paper: bool,
}

/// One operating point.
#[derive(Debug, Serialize)]
pub struct RunReport {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Velocity ripple factor (Eq 19) of the simulated drive, %.
    pub vrf_percent: f64,
    /// The same of a shipped board's drive that has learned at this point, %.
    pub learned_percent: Option<f64>,
    /// The same by `S(s)` of Appendix A, %. It knows the torque harmonics and nothing else.
    pub analytic_percent: f64,
    /// What the paper measured, %, where it did.
    pub measured_percent: Option<f64>,
    /// Mean table velocity, mm/s.
    pub mean_mm_s: f64,
    /// True table velocities from the record's start, mm/s, at `record_hz`: the first part only.
    pub velocity_mm_s: Vec<f64>,
    /// Amplitude spectrum of the whole record up to 1 kHz: (Hz, mm/s).
    pub spectrum: Vec<(f64, f64)>,
}

impl RunReport {
    /// How it is called.
    pub fn name(&self) -> String {
        match self.nut_rpm == 0.0 {
            true => "CDFS, nut at rest".into(),
            false => format!("DDFS, nut at {} rpm", short(self.nut_rpm)),
        }
    }
}

/// `|S|`, electrical rad/s per N m, against rad/s.
#[derive(Debug, Serialize)]
pub struct SensitivityReport {
    /// Appendix A.
    pub analytic: Vec<(f64, f64)>,
    /// Measured on the simulated drive with an injected sine torque, with ideal sensors.
    pub ideal: Vec<(f64, f64)>,
    /// The same with the run's own sensors, where they are not ideal.
    pub measured: Vec<(f64, f64)>,
    /// Where the torque harmonics of the runs lie, named as in the paper's Fig 3.
    pub marks: Vec<Mark>,
}

/// A torque harmonic on the plot of `S`.
#[derive(Debug, Serialize)]
pub struct Mark {
    /// Letter of the run (A is the first) and order: `A6`.
    pub name: String,
    /// Angular frequency of the screw's harmonic, rad/s.
    pub omega: f64,
    /// `|S|` there by Appendix A.
    pub gain: f64,
}

/// Ripple against nut speed.
#[derive(Debug, Serialize)]
pub struct CurveReport {
    /// By Appendix A: (nut rpm, %).
    pub analytic: Vec<(f64, f64)>,
    /// The paper's measurements at 2.5 mm/s: (nut rpm, %).
    pub measured: Vec<(f64, f64)>,
}
