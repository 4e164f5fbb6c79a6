//! What an analysis tells.

use crate::conclusion::channels::{ChannelRest, TableForce};
use crate::conclusion::correction::Correction;
use crate::conclusion::curves::Learned;
use crate::conclusion::recalibrated::{Released, corrected};
use crate::conclusion::verdict::{CheckChannel, Floor, Judged, Tally, Verdict, judge};
use crate::digits::three;
use crate::effects::hypothesis::Hypothesis;
use crate::effects::refusals::Refusal;
use crate::machines::Machine;
use crate::predict::basis::At;
use crate::predict::excitation::Excitation;
use crate::search::select::Trial;
use crate::signal::channel::Channel;
use crate::signal::signals::Signals;
use plant::Axis;
use plant::effects::EffectModel;
use plant::model::Model;

/// An effect that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it was traced to.
    pub hypothesis: Hypothesis,
    /// The channel in which it shows most.
    pub shows: Channel,
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
    /// Of a drift: by how much more a step at some time lowers both records' sums of squares than a ramp does.
    pub step_beyond_ramp: Option<f64>,
    /// By how much more the plate values that are at the ends of their tolerances lower both records' sums of squares without the effect, if
    /// nothing is known of them. `None` where none is at an end.
    pub plate_beyond: Option<[f64; 2]>,
    /// Fall on each operating point of the fit record.
    pub fall_at: Vec<f64>,
    /// The same when fitted on the others.
    pub held_back: Vec<f64>,
    /// The hypotheses that lost against it, the best first.
    pub rivals: Vec<Trial>,
    /// Those of them that the record does not tell from it, at their best: what explains all but a trace as much.
    pub inseparable: Vec<Rival>,
}

/// Another hypothesis in the place of an effect that was found.
#[derive(Debug, Clone)]
pub struct Rival {
    /// What it says.
    pub hypothesis: Hypothesis,
    /// The effect as a model file would have it, if its place makes sense.
    pub effect: Option<EffectModel>,
    /// By how much the sum of squares of the fit record falls less than with the effect that was named; half of it is
    /// the difference of the log-likelihoods.
    pub behind: f64,
    /// The same on the check record, with each one's parameters of the fit record.
    pub check_behind: f64,
}

/// Something that no hypothesis explains.
#[derive(Debug, Clone)]
pub struct Unexplained {
    /// Where it shows.
    pub channel: Channel,
    /// What it is a shape over; `none` for what has no shape.
    pub coordinate: &'static str,
    /// Order per turn of an angle.
    pub order: Option<f64>,
    /// Frequency over time, Hz.
    pub hz: Option<f64>,
    /// Rms in the channel's unit, on the fit record.
    pub size: f64,
    /// Its sum of squares there, whitened.
    pub fall: f64,
    /// Why it was not named.
    pub reason: String,
}

/// All that was found.
pub struct Outcome {
    /// The kind of machine.
    pub machine: &'static dyn Machine,
    /// Effects, the greatest first.
    pub effects: Vec<Found>,
    /// The machine's channels.
    pub channels: Vec<ChannelRest>,
    /// What follows from the torques, where there is a table.
    pub table_force: Option<TableForce>,
    /// What is left.
    pub unexplained: Vec<Unexplained>,
    /// What curves without a name explain of channels that they do not act on, by way of plate values: falls of sums of squares.
    pub(crate) by_plate: [f64; Channel::COUNT],
    /// What has no name and predicts the check record, as measured effects; the model has them.
    pub curves: Vec<Learned>,
    /// How much of each curve that was asked about the fit record has.
    pub(crate) curve_shares: Vec<f64>,
    /// Trials of the last step, in which nothing more was found.
    pub last: Vec<Trial>,
    /// What was significant and is not named, and why.
    pub doubts: Vec<(Hypothesis, &'static str)>,
    /// Hypotheses tried.
    pub tried: usize,
    /// Fall that an effect had to bring.
    pub threshold: f64,
    /// Recalibrated model with the effects.
    pub model: Model,
    /// Recalibrated parameters: name, relative change, standard deviation.
    pub calibration: Vec<(String, f64, f64)>,
    /// Plate values that the fit record has at an end of their tolerance.
    pub at_ends: Vec<String>,
    /// What they are where their tolerance does not hold them: few of them, then more. None where nothing is left.
    pub(crate) released: Vec<Vec<Released>>,
    /// Plate values with which the record has a better verdict.
    pub correction: Option<Correction>,
    /// Constant load that a motor alone is taken to have, N m.
    pub load_nm: Option<f64>,
    /// Electrical angles by which the zeros of encoders are taken to be off, rad.
    pub angle_zeros: Vec<(Axis, f64)>,
    /// Coordinates of the residuals' rows.
    pub coordinates: Coordinates,
    /// Hypotheses that were not tried without excitation, or that physics forbids.
    pub refused: Vec<Refusal>,
    /// How derivatives were taken.
    pub bandwidth: Bandwidth,
}

/// Bandwidths of the derivatives and filters, which are zero-phase over the whole record.
#[derive(Debug, Clone, Copy)]
pub struct Bandwidth {
    /// Up to which the balances, and so the accelerations in them, are compared, Hz: above it the encoders' quantisation
    /// leaves nothing of an acceleration.
    pub balance_hz: f64,
    /// Up to which the table's position is compared, Hz: nearer to its resonance the encoders' quantisation is amplified.
    pub table_hz: f64,
    /// Of speeds in friction and back-EMF, Hz.
    pub speed_hz: f64,
    /// Frequency from which the encoders' quantisation outweighs the current sensors' noise in a torque balance, Hz, for
    /// screw and nut: below it the weights are even, above it they fall with the fourth power.
    pub even_hz: [f64; 2],
}

/// What residuals are looked at over, at the decimated rate.
pub struct Coordinates {
    /// Time, s.
    pub time: Vec<f64>,
    /// Mechanical angles of screw and nut, rad.
    pub angle: [Vec<f64>; 2],
    /// Angle of screw against nut, rad.
    pub relative: Vec<f64>,
    /// Speeds of screw and nut, rad/s.
    pub speed: [Vec<f64>; 2],
    /// Speed of screw against nut, rad/s.
    pub relative_speed: Vec<f64>,
    /// Position of the table, m.
    pub table: Vec<f64>,
}

impl Coordinates {
    /// Of a record's signals, every `step`-th row.
    pub(crate) fn new(signals: &Signals, step: usize) -> Self {
        let every = |column: &[f64]| column.iter().step_by(step).copied().collect::<Vec<f64>>();
        Coordinates {
            time: every(&signals.time),
            angle: [0, 1].map(|k: usize| every(&signals.motors[k].theta)),
            relative: every(&signals.relative),
            speed: [0, 1].map(|k: usize| every(&signals.motors[k].omega)),
            relative_speed: every(&signals.relative_speed),
            table: every(&signals.table),
        }
    }
}

impl Outcome {
    /// What may be said of the machine.
    pub fn judged(&self) -> Judged {
        let channels = self.channels.iter().map(|rest| CheckChannel {
            name: self.machine.name(rest.channel),
            unit: self.machine.unit(rest.channel),
            levels: rest.levels,
            rms: [rest.figures.check_before, rest.figures.check_after],
            floor: rest.figures.noise_floor,
        });
        let found = Tally {
            names: self.effects.len(),
            curves: self.curves.len(),
            left: self.unexplained.len(),
        };
        let shafts = self.excitation();
        let channels: Vec<CheckChannel> = channels.collect();
        let mut judged = judge(&channels, found, Floor::Sensors).excited(&shafts);
        self.add_what_is_allowed_for(&mut judged);
        match self.machine.has_feed() {
            true => judged.commanded(&shafts),
            false => judged,
        }
    }

    /// Says what the regression takes of the machine without a word of the model file.
    fn add_what_is_allowed_for(&self, judged: &mut Judged) {
        let channels = self.channels.iter();
        let torque = channels.filter(|rest| matches!(rest.channel, Channel::Torque(_)));
        let shows = torque.map(|rest| rest.figures.check_after);
        let least = shows.fold(0.0, f64::max);
        if let Some(load) = self.load_nm.filter(|load| load.abs() > least) {
            let why = &mut judged.said.why;
            *why += &format!(" A constant load of {} N m is allowed for.", three(load));
        }
        for (axis, angle) in &self.angle_zeros {
            let of = match self.machine.has_feed() {
                true => format!("{}'s ", axis.name()),
                false => String::new(),
            };
            judged.said.why += &format!(
                " The {of}encoder's zero is taken to be {} electrical degrees off. Under a constant load an inductance that is off shows the \
                 same.",
                three(angle.to_degrees())
            );
        }
        if let Some(correction) = &self.correction {
            let left = judged.said.left.get_or_insert_default();
            *left += &correction.sentence();
        } else if judged.verdict.leaves_something() && !self.at_ends.is_empty() {
            let names: Vec<String> = self
                .at_ends
                .iter()
                .map(|name| format!("`{name}`"))
                .collect();
            let left = judged.said.left.get_or_insert_default();
            *left += &format!(
                " At an end of the tolerance of plate values: {}. Is what is declared right?",
                names.join(", ")
            );
        }
    }

    /// Shapes without a name that raise the check record's excess describe the residual, and are no part of what is said of it.
    pub(crate) fn or_names(self, names: Outcome, excess: impl Fn(&Outcome) -> f64) -> Self {
        match excess(&names) < excess(&self) {
            true => Outcome {
                unexplained: self.unexplained,
                doubts: self.doubts,
                ..names
            },
            false => self,
        }
    }

    /// With curves that were learnt beside the same names: figures before are those without them, and what was left without a
    /// cause still is.
    pub(crate) fn of_curves(
        mut self,
        names: Outcome,
        told: Outcome,
        mut curves: Vec<Learned>,
    ) -> Outcome {
        for (own, before) in self.channels.iter_mut().zip(names.channels) {
            own.figures.fit_before = before.figures.fit_before;
            own.figures.check_before = before.figures.check_before;
            own.levels[0] = before.levels[0];
            let [residual, _] = before.residual;
            own.residual[0] = residual;
        }
        if let (Some(own), Some(before)) = (&mut self.table_force, names.table_force) {
            own.figures.fit_before = before.figures.fit_before;
            own.figures.check_before = before.figures.check_before;
            let [residual, _] = before.residual;
            own.residual[0] = residual;
        }
        for (curve, share) in curves.iter_mut().zip(&self.curve_shares) {
            curve.scale(*share);
        }
        let effects = curves.iter().map(|curve| curve.effect.clone());
        self.model.effects.extend(effects);
        Outcome {
            curves,
            unexplained: told.unexplained,
            doubts: told.doubts,
            ..self
        }
    }

    /// Whether something is left, and plate values at an end of their tolerance may be why.
    pub(crate) fn may_have_a_wrong_plate(&self) -> bool {
        !self.at_ends.is_empty() && self.judged().verdict.leaves_something()
    }

    /// With a correction of the plate, where the records are better explained under corrected values. `again` draws the conclusion under
    /// another model.
    pub(crate) fn or_corrected(self, model: &Model, again: impl Fn(&Model) -> Outcome) -> Self {
        let correction = self.released.iter().find_map(|released| {
            let with = again(&corrected(model, released));
            let verdict = with.judged().verdict;
            let better = [Verdict::NothingMissing, Verdict::Explained].contains(&verdict);
            better.then(|| Correction::new(released, &with.calibration, verdict.name()))
        });
        Outcome { correction, ..self }
    }

    /// What the fit record excites of each motor, with its name.
    fn excitation(&self) -> Vec<(Excitation, &'static str)> {
        let own = &self.coordinates;
        let rate = match own.time[..] {
            [first, .., last] if last > first => (own.time.len() - 1) as f64 / (last - first),
            _ => 1.0,
        };
        let of = |axis: &Axis| {
            let k = axis.index();
            let rows = own.angle[k]
                .iter()
                .zip(&own.speed[k])
                .map(|(angle, speed)| At {
                    angle: *angle,
                    speed: *speed,
                    ..At::default()
                });
            let name = match (self.machine.has_feed(), axis) {
                (false, _) => "motor",
                (true, Axis::Screw) => "screw's motor",
                (true, Axis::Nut) => "nut's motor",
            };
            (Excitation::new(&rows.collect::<Vec<_>>(), rate), name)
        };
        self.machine.axes().iter().map(of).collect()
    }

    /// See [`Outcome::judged`].
    pub fn verdict(&self) -> &'static str {
        self.judged().verdict.name()
    }
}
