//! The check record's profile, driven again by the fixed-point drive on the declared and on the new model.

use anyhow::Result;
use hal_sim::experiment::{RPM, Setup};
use hal_sim::replay::{Compared, compare};
use identify::effects::stick_slip::FreeDrive;
use identify::report::{Hold, Simulation};
use identify::run::Replay;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;

/// Highest frequency of the spectra, Hz: beyond it the mean over 1 ms leaves nothing.
const HIGHEST_HZ: f64 = 500.0;
/// Points of a spectrum; of neighbouring lines the greatest.
const POINTS: usize = 400;

/// The fixed-point drive.
pub(super) struct FixedPoint;

impl FreeDrive for FixedPoint {
    fn ripple(&self, model: &Model, record: &Recording) -> Option<Vec<[f64; 2]>> {
        let setup = Setup::declared(model.clone(), Coupling::Coupled);
        let compared = compare(&setup, record).ok()?;
        let ripple = |c: &Compared| [c.recorded_percent, c.simulated_percent];
        Some(compared.iter().map(ripple).collect())
    }
}

/// Simulates; `None` if no stretch of the record is held long enough.
pub(super) fn simulation(replay: &Replay) -> Result<Option<Simulation>> {
    let run = |model: &Model| {
        let setup = Setup::declared(model.clone(), Coupling::Coupled);
        compare(&setup, &replay.check)
    };
    let (declared, new) = (run(&replay.declared)?, run(&replay.new)?);
    let time = &replay.check.time_s;
    let holds: Vec<Hold> = declared
        .iter()
        .zip(&new)
        .map(|(declared, new)| hold(time, declared, new))
        .collect();
    let rms = |off: &dyn Fn(&Hold) -> f64| {
        (holds.iter().map(|hold| off(hold).powi(2)).sum::<f64>() / holds.len() as f64).sqrt()
    };
    if holds.is_empty() {
        return Ok(None);
    }
    Ok(Some(Simulation {
        declared_rms_points: rms(&|h| h.declared_vrf_percent - h.measured_vrf_percent),
        new_rms_points: rms(&|h| h.new_vrf_percent - h.measured_vrf_percent),
        holds,
    }))
}

fn hold(time: &[f64], declared: &Compared, new: &Compared) -> Hold {
    let hold = declared.hold;
    Hold {
        start_s: time[hold.first],
        seconds: time[hold.first + hold.rows - 1] - time[hold.first],
        table_mm_s: hold.point.velocity * 1e3,
        nut_rpm: hold.point.base / RPM,
        measured_vrf_percent: declared.recorded_percent,
        declared_vrf_percent: declared.simulated_percent,
        new_vrf_percent: new.simulated_percent,
        spectra: [
            shown(&declared.recorded_spectrum),
            shown(&declared.simulated_spectrum),
            shown(&new.simulated_spectrum),
        ],
    }
}

/// What of a spectrum is drawn, in mm/s.
fn shown(spectrum: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let lines: Vec<_> = spectrum
        .iter()
        .filter(|line| line.0 <= HIGHEST_HZ)
        .collect();
    lines
        .chunks((lines.len() / POINTS).max(1))
        .filter_map(|group| group.iter().max_by(|a, b| a.1.total_cmp(&b.1)))
        .map(|(hz, amplitude)| (*hz, 1e3 * amplitude))
        .collect()
}
