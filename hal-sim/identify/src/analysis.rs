//! The whole way: a fit record and a check record under a declared model, and what they have beyond it.

use crate::channel::Channel;
use crate::design::{Normal, Solution, Whitener, dot};
use crate::hypothesis::{Family, Hypothesis};
use crate::noise::Noise;
use crate::record::{Base, Record};
use crate::select::{Search, Trial};
use plant::effects::EffectModel;
use plant::model::Model;

/// What an effect must explain at least, as a share of what noise leaves: smaller than a sixteenth of the noise's rms,
/// simplifications of the balances explain as much.
pub const MATERIAL: f64 = 0.004;
/// Share of that which the check record must confirm, with the parameters of the fit.
const CONFIRMED: f64 = 0.25;
/// What a further effect must explain at least of what the first of its channel did: below it, it may be a remainder.
const REMAINDER: f64 = 2e-3;
/// Effects of one machine at most.
const MOST_EFFECTS: usize = 4;

/// An effect that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it was traced to.
    pub hypothesis: Hypothesis,
    /// Linear parameters.
    pub values: Vec<f64>,
    /// Their covariance, row by row.
    pub covariance: Vec<f64>,
    /// Standard deviation of the shape.
    pub shape_sigma: f64,
    /// The effect as a model file has it.
    pub effect: EffectModel,
    /// Share of what the fit record has beyond noise.
    pub explained: f64,
    /// Fall of the sum of squares on the fit record.
    pub fall: f64,
    /// The same on the check record with the fit's parameters.
    pub check_fall: f64,
    /// Fall on each operating point of the fit record when fitted on the others.
    pub held_back: Vec<f64>,
    /// The hypotheses that lost against it, the best first.
    pub rivals: Vec<Trial>,
}

/// Rms of one channel, in its unit.
#[derive(Debug, Clone, Copy)]
pub struct ChannelFigures {
    /// Which.
    pub channel: Channel,
    /// Fit record, declared parameters recalibrated.
    pub fit_before: f64,
    /// Fit record with the effects.
    pub fit_after: f64,
    /// Check record, parameters of the fit record.
    pub check_before: f64,
    /// Check record with the effects.
    pub check_after: f64,
    /// What sensors alone leave.
    pub noise_floor: f64,
    /// Whitened rms with the effects on the fit record; 1 is noise.
    pub whitened: f64,
    /// Share of the residual's lags of up to 0.1 s whose correlation is within the 95 % band of white noise.
    pub whiteness: f64,
}

/// Something that no hypothesis explains.
#[derive(Debug, Clone)]
pub struct Unexplained {
    /// Where it shows.
    pub channel: String,
    /// What it repeats with.
    pub coordinate: String,
    /// Order or frequency there.
    pub order: f64,
    /// Size.
    pub size: f64,
    /// Why it was not named.
    pub reason: String,
}

/// All that was found.
pub struct Outcome {
    /// Effects, the greatest first.
    pub effects: Vec<Found>,
    /// Channels.
    pub channels: Vec<ChannelFigures>,
    /// What is left.
    pub unexplained: Vec<Unexplained>,
    /// Trials of the last step, in which nothing more was found.
    pub last: Vec<Trial>,
    /// Hypotheses tried.
    pub tried: usize,
    /// Fall that an effect had to bring.
    pub threshold: f64,
    /// Recalibrated model with the effects.
    pub model: Model,
    /// Recalibrated parameters: name, relative change, standard deviation.
    pub calibration: Vec<(String, f64, f64)>,
    /// Residuals of the fit record before and after, by channel, at the decimated rate.
    pub residuals: Vec<(Channel, Vec<f64>, Vec<f64>)>,
    /// Time of their rows, s.
    pub time: Vec<f64>,
}

impl Outcome {
    /// `nothing missing`, `explained` or `unexplained`.
    pub fn verdict(&self) -> &'static str {
        if !self.unexplained.is_empty() {
            "unexplained"
        } else if self.effects.is_empty() {
            "nothing missing"
        } else {
            "explained"
        }
    }
}

/// A regression with its effects, under a noise that fits what it leaves.
struct Stage {
    noise: Noise,
    found: Vec<Hypothesis>,
}

fn left_noise(noise: &Noise, declared: &Noise, base: &Base, found: &[Hypothesis], record: &Record, search: impl Fn(&Whitener, Normal) -> Normal) -> Noise {
    let whitener = Whitener::new(&record.signals, &record.fourier, noise);
    let normal = search(&whitener, base.normal(&whitener));
    let _ = found;
    let solution = normal.solve(None);
    noise.corrected(declared, &normal.residual(&solution.values).parts, &record.fourier)
}
