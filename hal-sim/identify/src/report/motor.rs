//! The report of a machine with one balance: a bare motor's current, or a feed axis' force whose control law is not known.

use super::{
    Calibrated, Channel, Coordinate, Effect, Left, Measured, Report, Residual, Selection, Tried,
};
use crate::conclusion::remains::whiteness;
use crate::conclusion::rest;
use crate::conclusion::verdict::{CheckChannel, Floor, Tally};
use crate::effects::refusals::Refusal;
use crate::machines::feed_axis::Axis;
use crate::machines::motor::{Base, Fit, Lag, MotorModel, Order, Study};
use crate::predict::curve::Curve;
use crate::records::DataQuality;
use crate::regression::column::counted;
use crate::regression::sandwich::{Wave, interval};

/// What a report of one balance is of.
#[derive(Clone, Copy)]
struct Subject {
    /// The drive quantity and its unit.
    channel: (&'static str, &'static str),
    /// What turns, and the place of its effects.
    shaft: &'static str,
    place: &'static str,
    /// Pole pairs, where they are known.
    pole_pairs: Option<u32>,
}

/// Of what was found with a motor, from the records `accounts`.
pub fn motor(study: &Study, model: MotorModel, accounts: [DataQuality; 2]) -> Report {
    let subject = Subject {
        channel: ("current", "A"),
        shaft: "motor",
        place: "motor",
        pole_pairs: Some(model.pole_pairs),
    };
    let mut report = of_balance(study, subject, accounts);
    report.model =
        format!("[motor]\npole_pairs = {}\n", model.pole_pairs) + &effects_toml(&report.effects);
    report
}

/// Of what was found with a feed axis by its balance of forces alone: its control law is not known.
pub fn axis_by_balance(study: &Study, declared: &Axis, accounts: [DataQuality; 2]) -> Report {
    let subject = Subject {
        channel: ("force", "N"),
        shaft: "screw",
        place: "feed",
        pole_pairs: None,
    };
    let mut report = of_balance(study, subject, accounts);
    report.model = study.refined(declared).to_toml();
    report
}

fn of_balance(study: &Study, subject: Subject, accounts: [DataQuality; 2]) -> Report {
    let (name, unit) = subject.channel;
    let mut effects: Vec<Effect> = (0..study.orders.len())
        .map(|k| effect(study, subject, k))
        .collect();
    let lag = study.lag.as_ref().filter(|lag| lag.is_named);
    effects.extend(lag.map(late));
    effects.extend(
        study
            .curves
            .iter()
            .map(|curve| measured(study, subject, curve)),
    );
    let time: Vec<f64> = (0..study.position[0].len())
        .map(|k| k as f64 / study.rate)
        .collect();
    let unexplained: Vec<Left> = study
        .remnants
        .iter()
        .map(|remnant| Left::of(remnant, name, unit))
        .collect();
    let found = Tally {
        names: effects.len() - study.curves.len(),
        curves: study.curves.len(),
        left: unexplained.len(),
    };
    let judged = CheckChannel::of_rows(
        subject.channel,
        [&study.before.left[1], &study.curved.left[1]],
        &study.open[1],
        [study.rate, study.band_hz],
        study.noise,
    )
    .judged(found, Floor::Spectrum)
    .predicted(
        study.does_not_carry,
        study.is_judged,
        study.curved_percent() / 100.0,
    )
    .excited(&[(study.excitation.clone(), subject.shaft)]);
    let mut said = judged.said;
    said.why += &allowed_for(study);
    Report {
        demo_seed: None,
        verdict: judged.verdict.name(),
        summary: said.sentence(),
        said,
        refused: refused(study, subject),
        residual: vec![residual(study, subject)],
        unexplained,
        calibration: calibration(study),
        correction: None,
        derivatives: format!(
            "The acceleration is the second derivative of the angle as read; it, friction, orders and current pass the same \
             {:.0} Hz zero-phase Butterworth filter. It is narrower than 100 Hz where the angle's noise would be most of the \
             residual.",
            study.band_hz
        ),
        selection: selection(study, subject),
        simulation: None,
        stages: Vec::new(),
        records: accounts.into(),
        channels: vec![channel(study, subject, &effects, &time)],
        time,
        model: String::new(),
        effects,
    }
}

/// The drive quantity's residual for the charts.
fn channel(study: &Study, subject: Subject, effects: &[Effect], time: &[f64]) -> Channel {
    let coordinate = |title: &str, folded, values: &[f64]| Coordinate {
        title: title.into(),
        folded,
        values: values.to_vec(),
    };
    let marks = study.orders.iter().zip(effects);
    Channel {
        name: subject.channel.0.into(),
        unit: subject.channel.1.into(),
        residual: [study.before.left[0].clone(), study.curved.left[0].clone()],
        open: study.open[0].clone(),
        turn: coordinate(
            &format!("Angle of the {}, turns", subject.shaft),
            true,
            &study.position[0],
        ),
        marks: marks
            // More labels cover each other.
            .take(4)
            .map(|(order, effect)| (f64::from(order.order), effect.kind.replace('_', " ")))
            .collect(),
        over: vec![
            coordinate("Speed, rad/s", false, &study.velocity[0]),
            coordinate("Time, s", false, time),
        ],
    }
}

/// The drive quantity's residual in figures.
fn residual(study: &Study, subject: Subject) -> Residual {
    let left = |fit: &Fit, k: usize| study.left_rms(fit, k);
    // A band is white at twice its width in values a second only.
    let step = ((0.5 * study.rate / study.band_hz) as usize).max(1);
    let every: Vec<f64> = study.curved.left[0].iter().copied().step_by(step).collect();
    Residual {
        channel: subject.channel.0.into(),
        unit: subject.channel.1.into(),
        fit_before: left(&study.before, 0),
        fit_after: left(&study.curved, 0),
        check_before: left(&study.before, 1),
        check_after: left(&study.curved, 1),
        check_signal: Some(study.signal_rms(1)),
        noise_floor: study.noise,
        whiteness: whiteness(&every),
    }
}

/// How orders and curves were chosen.
fn selection(study: &Study, subject: Subject) -> Selection {
    let (name, _) = subject.channel;
    let found = study.orders.iter().map(|order| Tried {
        hypothesis: ORDER.into(),
        place: subject.place.into(),
        shape: Some(f64::from(order.order)),
        fall: order.amplitude_a,
        outcome: format!("found; {}", order.suggests(subject.pole_pairs)),
    });
    let lost = study.lost.iter().map(|lost| Tried {
        hypothesis: "order of the turn".into(),
        place: "motor".into(),
        shape: Some(f64::from(lost.order)),
        fall: lost.share,
        outcome: lost.reason.into(),
    });
    Selection {
        rule: format!(
            "An order is taken that explains most of the fit record, more than chance makes of a residual of that colour \
             (Newey and West), and that the check record bears out: regressed there on the order as the fit record has it, \
             the coefficient is near 1 and more than three standard deviations from 0. What predicts the rest, trained on the \
             fit record and tested on the check record, is added as a curve without a name. The {name} passes a {:.0} Hz \
             zero-phase filter; its error on the record that was not fitted falls from {:.1} to {:.2} % of its rms; {:.0} % of \
             its rows, whose speed and acceleration are outside of what the fit record has, do not count. At one speed an order and a frequency are one; a record at another speed tells them apart. One order can have \
             several causes, which a record of the current alone cannot tell apart. {}",
            study.band_hz,
            study.before_percent(),
            study.curved_percent(),
            100.0 * (1.0 - counted(&study.open[1]) as f64 / study.open[1].len().max(1) as f64),
            rest::rule()
        ),
        tried: study.tried,
        threshold: 0.0,
        measure: "amplitude, A; of what was not taken its share of the fit record's square",
        trials: found.chain(lost).collect(),
    }
}

/// What was not fitted or not tried.
fn refused(study: &Study, subject: Subject) -> Vec<Refusal> {
    let of = |name: &str, reason, trials| Refusal {
        hypothesis: name.into(),
        place: subject.place.into(),
        reason,
        trials,
    };
    let base = study.not_told_apart.iter();
    let (orders, reason) = study.not_tried;
    base.map(|(base, reason)| of(base.name().0, reason, 1))
        .chain((orders > 0).then(|| of("order of the turn", reason, orders)))
        .collect()
}

/// A nuisance of time that the fit allows for, as a sentence.
fn allowed_for(study: &Study) -> String {
    let nuisance = study.lag.as_ref().filter(|lag| !lag.is_named);
    nuisance.map_or_else(String::new, |lag| {
        let [value, _] = lag.value_s;
        let kind = if value < 0.0 { "delay" } else { "lag" };
        format!(
            " A {kind} of {:.2} ms between motion and drive quantity is allowed for.",
            1e3 * value.abs()
        )
    })
}

/// Inertia and friction as the record has them, and the nuisances: nothing is declared of them.
fn calibration(study: &Study) -> Vec<Calibrated> {
    let of = |parameter: &str, value, sigma, unit| Calibrated {
        parameter: parameter.into(),
        relative_change: f64::NAN,
        sigma,
        value: Some(value),
        unit: Some(unit),
    };
    let named = study.base.iter().enumerate().map(|(k, base)| {
        let (name, unit) = base.name();
        let sigma = study.after.covariance[(k, k)].max(0.0).sqrt();
        of(name, study.after.values[k], sigma, unit)
    });
    let lag = study.lag.iter().filter(|lag| !lag.is_named).map(|lag| {
        let (name, value) = match lag.value_s[0] < 0.0 {
            true => ("delay of the drive quantity, a nuisance", -lag.value_s[0]),
            false => ("lag of the drive quantity, a nuisance", lag.value_s[0]),
        };
        of(name, value, lag.value_s[1], "s")
    });
    let width = study.base.contains(&Base::Coulomb).then(|| {
        of(
            "speed over which friction changes its sign, a nuisance",
            study.width_rad_s,
            f64::NAN,
            "rad/s",
        )
    });
    named.chain(lag).chain(width).collect()
}

/// A current that is reported late: an effect of the measurement and not of the motor.
fn late(lag: &Lag) -> Effect {
    let [value, sigma] = lag.value_s;
    let parameter = ("value", [value, sigma * sigma], "s");
    Effect::fitted("reported_current_lag", "motor", lag.explained, [parameter])
}

/// Kind of an order of the turn. A record of the current alone does not tell its cause.
const ORDER: &str = "angle_periodic";

fn effect(study: &Study, subject: Subject, k: usize) -> Effect {
    let order = study.orders[k];
    let at = study.base.len() + 2 * k;
    let covariance = &study.after.covariance;
    let wave = Wave::new(
        [study.after.values[at], study.after.values[at + 1]],
        [covariance[(at, at)], covariance[(at + 1, at + 1)]],
        covariance[(at, at + 1)],
    );
    // What is fixed to the motor's angle repeats with its turn: the order is a whole number, amplitude and phase are those
    // of it. What the record says of the order where that is not used shows whether it is so.
    let estimates = [
        ("order", study.freed[k], "per turn"),
        ("amplitude", wave.amplitude, subject.channel.1),
        ("phase", wave.phase, "rad"),
    ];
    Effect {
        order: Some(f64::from(order.order)),
        suggests: Some(order.suggests(subject.pole_pairs)),
        ..Effect::fitted(ORDER, subject.place, study.explained[k], estimates)
    }
}

/// A curve without a name.
fn measured(study: &Study, subject: Subject, curve: &Curve) -> Effect {
    let before = study.left_rms(&study.before, 1);
    let share = (curve.size / before.max(1e-300)).powi(2).clamp(0.0, 1.0);
    let mean = curve.sigmas.iter().map(|s| s * s).sum::<f64>() / curve.sigmas.len().max(1) as f64;
    Effect {
        order: curve.order,
        curve: Some(Measured {
            coordinate: curve.along.clone(),
            range: curve.range,
            at: curve.at.clone(),
            value: curve.values.clone(),
            interval: curve
                .values
                .iter()
                .zip(&curve.sigmas)
                .map(|(v, s)| interval(*v, s * s))
                .collect(),
        }),
        suggests: Some(match curve.order {
            Some(order) if curve.is_order && order.fract() == 0.0 => Order {
                order: order as u32,
                amplitude_a: curve.size,
            }
            .suggests(subject.pole_pairs),
            Some(order) if curve.is_order => {
                format!(
                    "order {order:.3} is not whole; candidates: balls or rollers that pass, a gear, a belt"
                )
            }
            _ => format!("no cause is named; a curve over {}", curve.along),
        }),
        ..Effect::fitted(
            "measured",
            subject.place,
            share,
            [("rms", [curve.size, mean], subject.channel.1)],
        )
    }
}

fn effects_toml(effects: &[Effect]) -> String {
    let mut text = String::new();
    for effect in effects {
        text += &format!(
            "\n[[effects]]\nkind = \"{}\"\nwhere = \"motor\"\n",
            effect.kind
        );
        let fitted = effect
            .parameters
            .iter()
            .filter(|(name, _)| *name != "order");
        let order = effect.order.iter().map(|order| ("order", order));
        for (name, value) in order.chain(fitted.map(|(name, value)| (name.as_str(), value))) {
            text += &format!("{name} = {value:?}\n");
        }
        if let Some(curve) = &effect.curve {
            text += &format!(
                "coordinate = {:?}\nat = {:?}\nvalue = {:?}\n",
                curve.coordinate, curve.at, curve.value
            );
        }
    }
    text
}
