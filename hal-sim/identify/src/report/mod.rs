//! What was found, whatever the machine: as `report.json`, and for the page.

mod feed_axis;
mod motor;
mod traced;
mod write;

pub use feed_axis::feed_axis;
pub use motor::{axis_by_balance, motor};
pub use traced::traced;
pub use write::{WriteError, write};

use crate::conclusion::correction::Correction;
use crate::conclusion::interval::Estimate;
use crate::conclusion::rest::Remnant;
use crate::conclusion::said::Said;
use crate::effects::refusals::Refusal;
use crate::records::DataQuality;
use crate::regression::sandwich::interval;
use serde::Serialize;
use std::collections::BTreeMap;

/// Ripple by which two simulations differ and are the same, percent of the speed.
const SAME_POINTS: f64 = 0.05;

/// A report. What serde skips is for the page and the other files.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// `nothing missing`, `explained`, `partly explained`, `unexplained`, `not excited` or `wrong data`.
    pub verdict: &'static str,
    /// The verdict in sentences: how much of what the check record has beyond its noise floor is gone.
    pub summary: String,
    /// The same, part by part.
    #[serde(skip)]
    pub said: Said,
    /// Seed of the simulated machine, of a demonstration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub demo_seed: Option<u64>,
    /// What the record has and the model lacks, the greatest first.
    pub effects: Vec<Effect>,
    /// Residual by channel.
    pub residual: Vec<Residual>,
    /// What no hypothesis explains.
    pub unexplained: Vec<Left>,
    /// Hypotheses that were not tried without excitation, or that physics forbids.
    pub refused: Vec<Refusal>,
    /// Plate values that were refined.
    pub calibration: Vec<Calibrated>,
    /// Plate values beyond their tolerance with which the verdict is better.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<Correction>,
    /// How derivatives were taken, and to which bandwidth.
    pub derivatives: String,
    /// How effects were chosen, and what lost.
    pub selection: Selection,
    /// The record's profile, simulated with both models.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulation: Option<Simulation>,
    /// Errors in closed-loop simulation, effect by effect.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stages: Vec<Stage>,
    /// Fit record and check record.
    pub records: Vec<DataQuality>,
    /// Residuals row by row.
    #[serde(skip)]
    pub channels: Vec<Channel>,
    /// Times of their rows, s.
    #[serde(skip)]
    pub time: Vec<f64>,
    /// `model.toml`.
    #[serde(skip)]
    pub model: String,
}

impl Report {
    /// Ripple of the table in simulation, mean square over the holds as an rms, %: with the effects, and without one of
    /// them, by its share of what they explain together.
    pub(crate) fn ripple_without(&self, effect: &Effect) -> Option<[f64; 2]> {
        let holds = &self.simulation.as_ref()?.holds;
        let square = |of: fn(&Hold) -> f64| {
            let sum: f64 = holds.iter().map(|hold| of(hold).powi(2)).sum();
            sum / holds.len().max(1) as f64
        };
        let [declared, new] = [
            square(|hold| hold.declared_vrf_percent),
            square(|hold| hold.new_vrf_percent),
        ];
        let all: f64 = self.effects.iter().map(|effect| effect.explained).sum();
        let share = effect.explained / all.max(1e-300);
        let without = (new - share * (new - declared)).max(0.0);
        (!holds.is_empty()).then(|| [new.sqrt(), without.sqrt()])
    }
}

/// An effect.
#[derive(Debug, Clone, Serialize)]
pub struct Effect {
    /// Kind, as in a model file.
    pub kind: String,
    /// Place, as in a model file.
    #[serde(rename = "where")]
    pub place: String,
    /// Order, where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<f64>,
    /// Frequency, where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hz: Option<f64>,
    /// Parameters by name.
    pub parameters: BTreeMap<String, f64>,
    /// 95 % interval of each.
    pub interval: BTreeMap<String, [f64; 2]>,
    /// Units of the parameters.
    pub unit: BTreeMap<String, String>,
    /// Share of what the check record has beyond its noise floor, with the parameters of the fit record.
    pub explained: f64,
    /// What it explains of each operating point of the fit record when fitted on the others, as a share of what it
    /// explains there when fitted on all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub held_back: Vec<f64>,
    /// Other effects that the record does not tell from it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_separable: Vec<Alias>,
    /// Causes that the record does not tell apart, where there is more than one: effects by their kind, and others in words.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub candidates: &'static [&'static str],
    /// Of an effect without a name: the curve that was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curve: Option<Measured>,
    /// The channel in which it shows, where there is more than one.
    #[serde(skip)]
    pub shows: Option<String>,
    /// What its order suggests, where the record cannot tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suggests: Option<String>,
}

/// A curve without a name, point by point.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// What it is over.
    pub coordinate: String,
    /// Range of the coordinate in which it was learnt; outside of it nothing is added.
    pub range: [f64; 2],
    /// Coordinates.
    pub at: Vec<f64>,
    /// Values there.
    pub value: Vec<f64>,
    /// 95 % interval of each.
    pub interval: Vec<[f64; 2]>,
}

/// An effect that explains all but as much as the one that was named.
#[derive(Debug, Clone, Serialize)]
pub struct Alias {
    /// Kind, as in a model file.
    pub kind: String,
    /// Place, as in a model file.
    #[serde(rename = "where")]
    pub place: String,
    /// Parameters by name.
    pub parameters: BTreeMap<String, f64>,
    /// Log-likelihood of the fit record by which it is behind.
    pub behind: f64,
    /// The same on the check record.
    pub check_behind: f64,
}

/// Rms of one channel, in its unit.
#[derive(Debug, Clone, Serialize)]
pub struct Residual {
    /// Name.
    pub channel: String,
    /// Unit.
    pub unit: String,
    /// Fit record, declared parameters refined.
    pub fit_before: f64,
    /// Fit record with the effects.
    pub fit_after: f64,
    /// Check record, parameters of the fit record.
    pub check_before: f64,
    /// Check record with the effects.
    pub check_after: f64,
    /// Rms of the measured quantity itself on the check record, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub check_signal: Option<f64>,
    /// What sensors alone leave.
    pub noise_floor: f64,
    /// Share of the lags of the residual whose correlation is within the 95 % band of white noise.
    pub whiteness: f64,
}

/// Something that no hypothesis explains: what it looks like.
#[derive(Debug, Clone, Serialize)]
pub struct Left {
    /// Channel in which it shows.
    pub channel: String,
    /// What it is a shape over; `none` for what has no shape.
    pub coordinate: String,
    /// Order per turn of an angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<f64>,
    /// Frequency over time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hz: Option<f64>,
    /// Rms of the shape on the fit record.
    pub size: f64,
    /// Unit of the size.
    pub unit: String,
    /// Why it was not named.
    pub reason: String,
}

/// A plate value that was refined.
#[derive(Debug, Clone, Serialize)]
pub struct Calibrated {
    /// Which.
    pub parameter: String,
    /// Change of the declared value, relative.
    pub relative_change: f64,
    /// Its standard deviation; of a value that is not declared, in its unit.
    pub sigma: f64,
    /// The value itself, of what is not declared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
}

/// How effects were chosen.
#[derive(Debug, Clone, Serialize)]
pub struct Selection {
    /// The rule in words.
    pub rule: String,
    /// Hypotheses tried.
    pub tried: usize,
    /// What an effect had to bring.
    pub threshold: f64,
    /// What `fall` is.
    pub measure: &'static str,
    /// What was tried, in the order of the search: what was taken, and what lost.
    pub trials: Vec<Tried>,
}

/// A hypothesis that was tried.
#[derive(Debug, Clone, Serialize)]
pub struct Tried {
    /// Its name.
    pub hypothesis: String,
    /// Place.
    #[serde(rename = "where")]
    pub place: String,
    /// Order, frequency or speed, where it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<f64>,
    /// What it brought.
    pub fall: f64,
    /// Whether it was taken, and why not.
    pub outcome: String,
}

/// The check record's profile, simulated with both models.
#[derive(Debug, Clone, Serialize)]
pub struct Simulation {
    /// Rms of simulated less measured ripple over the holds, points of %: declared model, new model.
    pub declared_rms_points: f64,
    /// See `declared_rms_points`.
    pub new_rms_points: f64,
    /// Stretches of one speed.
    pub holds: Vec<Hold>,
}

/// A stretch of one speed, measured and simulated.
#[derive(Debug, Clone, Serialize)]
pub struct Hold {
    /// Where it begins in the record, s.
    pub start_s: f64,
    /// Length, s.
    pub seconds: f64,
    /// Table velocity asked for, mm/s.
    pub table_mm_s: f64,
    /// Nut speed asked for, rpm.
    pub nut_rpm: f64,
    /// Velocity ripple factor (Eq 19) as measured, %.
    pub measured_vrf_percent: f64,
    /// Simulated with the declared model, %.
    pub declared_vrf_percent: f64,
    /// Simulated with the new model, %.
    pub new_vrf_percent: f64,
    /// Amplitude spectra of the table velocity, (Hz, mm/s): measured, declared, new.
    #[serde(skip)]
    pub spectra: [Vec<(f64, f64)>; 3],
}

/// A model with one effect more, in closed-loop simulation.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// What was added.
    pub added: String,
    /// On the fit record.
    pub fit: Errors,
    /// On the check record, nothing fitted there; what repeats with the screw is left out, its phase being unknown.
    pub check: Errors,
    /// On the check record from its first quarter on, with the homing taken from that quarter.
    pub check_homed: Errors,
}

/// Errors of a simulation.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Errors {
    /// Force, rms of the error over rms, %.
    pub force_percent: f64,
    /// Velocity, the same, %.
    pub velocity_percent: f64,
    /// Position, rms, um.
    pub position_um: f64,
}

/// A channel's residual row by row.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Before and after.
    pub residual: [Vec<f64>; 2],
    /// Rows that count.
    pub open: Vec<bool>,
    /// The angle that orders are counted in.
    pub turn: Coordinate,
    /// Orders of that angle at which effects were found.
    pub marks: Vec<(f64, String)>,
    /// What else it is looked at over.
    pub over: Vec<Coordinate>,
}

/// Something that a residual is looked at over.
#[derive(Debug, Clone)]
pub struct Coordinate {
    /// Name and unit.
    pub title: String,
    /// An angle, folded to one turn.
    pub folded: bool,
    /// Its values, rad where folded.
    pub values: Vec<f64>,
}

impl Left {
    fn of(remnant: &Remnant, channel: &str, unit: &str) -> Self {
        Left {
            channel: channel.into(),
            coordinate: remnant.coordinate.into(),
            order: remnant.order,
            hz: remnant.hz,
            size: remnant.size,
            unit: unit.into(),
            reason: remnant.reason.clone(),
        }
    }
}

impl Effect {
    /// Of the values and variances of its parameters, with their units.
    fn fitted(
        kind: &str,
        place: &str,
        explained: f64,
        parameters: impl IntoIterator<Item = (&'static str, [f64; 2], &'static str)>,
    ) -> Self {
        let estimates = parameters
            .into_iter()
            .map(|(name, [value, variance], unit)| {
                let (name, interval) = (name.into(), interval(value, variance));
                (
                    Estimate {
                        name,
                        value,
                        interval,
                    },
                    unit,
                )
            });
        Self::new(kind, place, explained, estimates)
    }

    /// Of its parameters with their units; what only some machines tell is empty.
    fn new(
        kind: &str,
        place: &str,
        explained: f64,
        estimates: impl IntoIterator<Item = (Estimate, &'static str)>,
    ) -> Self {
        let mut effect = Effect {
            kind: kind.into(),
            place: place.into(),
            order: None,
            hz: None,
            parameters: BTreeMap::new(),
            interval: BTreeMap::new(),
            unit: BTreeMap::new(),
            explained,
            held_back: Vec::new(),
            not_separable: Vec::new(),
            candidates: &[],
            curve: None,
            shows: None,
            suggests: None,
        };
        for (estimate, unit) in estimates {
            let Estimate {
                name,
                value,
                interval,
            } = estimate;
            effect.parameters.insert(name.clone(), value);
            effect.interval.insert(name.clone(), interval);
            effect.unit.insert(name, unit.into());
        }
        effect
    }
}

impl Report {
    /// The residual of a channel.
    pub fn figures(&self, channel: &str) -> Option<&Residual> {
        self.residual
            .iter()
            .find(|figures| figures.channel == channel)
    }

    /// The stage with all effects; the last but one, behind which stands the same with dq/dt as it is.
    pub fn last_stage(&self) -> Option<&Stage> {
        self.stages.iter().rev().nth(1)
    }

    /// The channel that the first sentence names: of the greatest effect, or of the residual. Without either, the channel whose
    /// residual fell most.
    pub fn lead(&self) -> Option<(&Channel, &Residual)> {
        let all = self.channels.iter();
        let all = all.filter_map(|channel| Some((channel, self.figures(&channel.name)?)));
        let shown = self.effects.first().map(|effect| effect.shows.as_deref());
        let named = shown.unwrap_or(self.said.channel);
        let fall = |figures: &Residual| figures.check_before / figures.check_after.max(1e-300);
        all.clone()
            .find(|(channel, _)| Some(channel.name.as_str()) == named)
            .or_else(|| all.max_by(|a, b| fall(a.1).total_cmp(&fall(b.1))))
    }

    /// Whether the new model's simulated ripple is further from the record's than the declared model's, points: both. Within a tenth
    /// and [`SAME_POINTS`] they are equally far.
    pub fn is_further_off(&self) -> Option<[f64; 2]> {
        let simulation = self.simulation.as_ref()?;
        let both = [simulation.declared_rms_points, simulation.new_rms_points];
        (both[1] > 1.1 * both[0] + SAME_POINTS).then_some(both)
    }
}
