//! The report of a bare motor.

use super::{Calibrated, Channel, Coordinate, Effect, Left, Report, Residual, Selection, Tried};
use crate::conclusion::remains::whiteness;
use crate::conclusion::rest;
use crate::conclusion::verdict::{CheckChannel, Floor};
use crate::effects::refusals::Refusal;
use crate::machines::motor::{Fit, Lag, MotorModel, Study};
use crate::records::DataQuality;
use crate::regression::column::counted;
use crate::regression::sandwich::Wave;

/// Of what was found with a motor, from the records `accounts`.
pub fn motor(study: &Study, model: MotorModel, accounts: [DataQuality; 2]) -> Report {
    let mut effects: Vec<Effect> = (0..study.orders.len())
        .map(|k| effect(study, model, k))
        .collect();
    effects.extend(study.lag.as_ref().map(late));
    let names: Vec<String> = effects.iter().map(|e| e.kind.replace('_', " ")).collect();
    let marks = study
        .orders
        .iter()
        .zip(names)
        // More labels cover each other.
        .take(4)
        .map(|(order, name)| (f64::from(order.order), name))
        .collect();
    let rate = study.rate;
    let rows = study.position[0].len();
    let time: Vec<f64> = (0..rows).map(|k| k as f64 / rate).collect();
    let speed = crate::signal::fourier::slope(&study.position[0], rate);
    let coordinate = |title: &str, folded, values: Vec<f64>| Coordinate {
        title: title.into(),
        folded,
        values,
    };
    let channel = Channel {
        name: "current".into(),
        unit: "A".into(),
        residual: [study.before.left[0].clone(), study.after.left[0].clone()],
        open: study.open[0].clone(),
        turn: coordinate("Angle of the motor, turns", true, study.position[0].clone()),
        marks,
        over: vec![
            coordinate("Speed, rad/s", false, speed),
            coordinate("Time, s", false, time.clone()),
        ],
    };
    // A band of 100 Hz is white at 200 values a second only.
    let step = ((rate / 200.0) as usize).max(1);
    let every: Vec<f64> = study.after.left[0].iter().copied().step_by(step).collect();
    let left = |fit: &Fit, k: usize| study.left_rms(fit, k);
    let unexplained: Vec<Left> = study
        .remnants
        .iter()
        .map(|remnant| Left::of(remnant, "current", "A"))
        .collect();
    // By the check record's current error against the current's own noise above the dynamics.
    let judged = CheckChannel::of_rms(
        ("current", "A"),
        [left(&study.before, 1), left(&study.after, 1)],
        study.noise,
    )
    .judged(effects.len(), unexplained.len(), Floor::Spectrum);
    Report {
        verdict: judged.verdict.name(),
        summary: judged.sentence,
        refused: refused(study),
        residual: vec![Residual {
            channel: "current".into(),
            unit: "A".into(),
            fit_before: left(&study.before, 0),
            fit_after: left(&study.after, 0),
            check_before: left(&study.before, 1),
            check_after: left(&study.after, 1),
            noise_floor: study.noise,
            whiteness: whiteness(&every),
        }],
        unexplained,
        calibration: calibration(study),
        derivatives: "The acceleration is the second derivative of the angle as read; it, friction, orders and current pass the \
                      same 100 Hz zero-phase Butterworth filter."
            .into(),
        selection: Selection {
            rule: format!(
                "An order is taken that explains most of the fit record, more than chance makes of a residual of that colour \
                 (Newey and West), and that the check record bears out: regressed there on the order as the fit record has it, \
                 the coefficient is near 1 and more than three standard deviations from 0. The current passes a 100 Hz \
                 zero-phase filter; its error on the record that was not fitted falls from {:.1} to {:.2} % of its rms; {:.0} % of \
                 its rows, whose speed and acceleration are outside of what the fit record has, do not count. At one speed an order and a frequency are one; a record at another speed tells them apart. One order can have \
                 several causes, which a record of the current alone cannot tell apart. {}",
                study.before_percent(),
                study.after_percent(),
                100.0 * (1.0 - counted(&study.open[1]) as f64 / study.open[1].len().max(1) as f64),
                rest::rule()
            ),
            tried: study.tried,
            threshold: 0.0,
            measure: "amplitude, A; of what was not taken its share of the fit record's square",
            trials: study
                .orders
                .iter()
                .map(|order| Tried {
                    hypothesis: order.kind(model.pole_pairs).into(),
                    place: "motor".into(),
                    shape: Some(f64::from(order.order)),
                    fall: order.amplitude_a,
                    outcome: format!("found; {}", order.suggests(model.pole_pairs)),
                })
                .chain(study.lost.iter().map(|lost| Tried {
                    hypothesis: "order of the turn".into(),
                    place: "motor".into(),
                    shape: Some(f64::from(lost.order)),
                    fall: lost.share,
                    outcome: lost.reason.into(),
                }))
                .collect(),
        },
        simulation: None,
        stages: Vec::new(),
        records: accounts.into(),
        channels: vec![channel],
        time,
        model: model_toml(model, &effects),
        effects,
    }
}

/// What was not fitted or not tried.
fn refused(study: &Study) -> Vec<Refusal> {
    let of = |name: &str, reason, trials| Refusal {
        hypothesis: name.into(),
        place: "motor".into(),
        reason,
        trials,
    };
    let base = study.not_told_apart.iter();
    let (orders, reason) = study.not_tried;
    base.map(|(base, reason)| of(base.name().0, reason, 1))
        .chain((orders > 0).then(|| of("order of the turn", reason, orders)))
        .collect()
}

/// Inertia and friction as the record has them: nothing is declared of them.
fn calibration(study: &Study) -> Vec<Calibrated> {
    let named = study.base.iter().enumerate();
    named
        .map(|(k, base)| {
            let (name, unit) = base.name();
            Calibrated {
                parameter: name.into(),
                relative_change: f64::NAN,
                sigma: study.after.covariance[(k, k)].max(0.0).sqrt(),
                value: Some(study.after.values[k]),
                unit: Some(unit),
            }
        })
        .collect()
}

/// A current that is reported late: an effect of the measurement and not of the motor.
fn late(lag: &Lag) -> Effect {
    let [value, sigma] = lag.value_s;
    let parameter = ("value", [value, sigma * sigma], "s");
    Effect::fitted("reported_current_lag", "motor", lag.explained, [parameter])
}

fn effect(study: &Study, model: MotorModel, k: usize) -> Effect {
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
        ("amplitude", wave.amplitude, "A"),
        ("phase", wave.phase, "rad"),
    ];
    let kind = order.kind(model.pole_pairs);
    Effect {
        order: Some(f64::from(order.order)),
        suggests: Some(order.suggests(model.pole_pairs)),
        ..Effect::fitted(kind, "motor", study.explained[k], estimates)
    }
}

fn model_toml(model: MotorModel, effects: &[Effect]) -> String {
    let mut text = format!("[motor]\npole_pairs = {}\n", model.pole_pairs);
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
    }
    text
}
