//! Wrong data is recognised before it is explained.
//!
//! Columns are looked at by themselves (one twice, held, cut off, frozen), fit record against check record (the same
//! rows), and channels against each other by the physics that no effect breaks: an angle turns as its reference asks, a
//! current vector turns with the rotor, a motor's voltage is resistance, inductance and flux, a table moves by the lead.
//! Each finding has its statistic, the threshold that it passed, and a sentence: what was read, what was expected, what to
//! do. [`Limits`] has all thresholds with their reasons.

mod columns;
mod feed_axis;
mod limits;
mod motor;
mod regress;
mod resolution;

pub use limits::Limits;

use super::{Machine, Record};
use columns::Seen;
use motor::{Motor, made_by};
use plant::model::{Model, MotorModel};
use regress::{Fit, fit, rms};
use serde::Serialize;
use std::borrow::Cow;

/// Something that is wrong with the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Which check.
    pub code: &'static str,
    /// The file.
    pub file: String,
    /// Its channels.
    pub channels: Vec<String>,
    /// What was measured.
    pub statistic: f64,
    /// What it was compared with.
    pub threshold: f64,
    /// What was read, what was expected, what to do.
    pub sentence: String,
}

impl Finding {
    fn new(
        code: &'static str,
        channels: &[&str],
        [statistic, threshold]: [f64; 2],
        sentence: String,
    ) -> Self {
        Finding {
            code,
            file: String::new(),
            channels: channels.iter().map(|c| (*c).to_owned()).collect(),
            statistic,
            threshold,
            sentence,
        }
    }
}

/// What is declared of the machine.
#[derive(Debug, Clone, Copy)]
pub enum Plate<'a> {
    /// A double drive.
    DoubleDrive(&'a Model),
    /// A permanent-magnet motor with its electrical side.
    Pmsm(&'a MotorModel),
    /// A motor of which little is known.
    Motor,
    /// A feed axis: moving mass, kg.
    FeedAxis {
        /// Moving mass, kg.
        mass_kg: f64,
    },
}

/// What is wrong with the data; nothing where all is well.
pub fn wrong_data(fit: &[Record], check: &[Record], plate: Plate) -> Vec<Finding> {
    let limits = Limits::default();
    // Rows that were put together of two records are wrong in much else: one sentence is enough.
    let shared = fit.iter().flat_map(|a| check.iter().map(move |b| (a, b)));
    let mut found: Vec<Finding> = shared
        .filter_map(|(a, b)| shared_rows(a, b, &limits))
        .collect();
    if !found.is_empty() {
        return found;
    }
    for record in fit.iter().chain(check) {
        let from = found.len();
        of_record(record, plate, &limits, &mut found);
        for finding in &mut found[from..] {
            finding.file.clone_from(&record.quality.file);
        }
    }
    found
}

/// Rows that stand in fit and check record.
fn shared_rows(a: &Record, b: &Record, limits: &Limits) -> Option<Finding> {
    let measured = |record: &Record| -> Vec<&'static str> {
        let measured = record
            .channels
            .iter()
            .filter(|c| c.origin == super::Origin::Measured);
        measured.map(|c| c.name).collect()
    };
    let names = measured(a);
    if names.is_empty() || names != measured(b) {
        return None;
    }
    let columns = |record| -> Vec<&[f64]> {
        names
            .iter()
            .map(|name| Record::channel(record, name))
            .collect()
    };
    let (first, row, count) = columns::same_rows(&columns(a), &columns(b), limits)?;
    let mut finding = Finding::new(
        "same_rows",
        &[],
        [count as f64, limits.same_rows as f64],
        format!(
            "{count} rows of the check record, from row {} on, are those of the fit record ({}) from row {} on, expected a record \
             of its own: what is fitted would confirm itself; give another record, or leave out --check",
            row + 1,
            a.quality.file,
            first + 1
        ),
    );
    finding.file.clone_from(&b.quality.file);
    Some(finding)
}

fn of_record(record: &Record, plate: Plate, limits: &Limits, found: &mut Vec<Finding>) {
    let measured = |name: &str| {
        !(name.contains("_ref")
            || name.contains("reference")
            || name == "output_v"
            || name == "pulses_v")
    };
    let seen: Vec<Seen> = record
        .channels
        .iter()
        .filter(|c| c.origin == super::Origin::Measured)
        .map(|channel| Seen {
            name: channel.name,
            values: &channel.values,
            measured: measured(channel.name),
        })
        .collect();
    let before = found.len();
    if seen
        .iter()
        .all(|c| c.values.windows(2).all(|w| w[0] == w[1]))
    {
        found.push(Finding::new(
            "all_frozen",
            &[],
            [0.0, 0.0],
            "no channel changes in any row, expected a machine that moves; was the recorder running, and are these its columns?".into(),
        ));
        return;
    }
    columns::twice(&seen, limits, found);
    columns::held(&seen, limits, found);
    columns::clipped(&seen, limits, found);
    // What is the same column twice is wrong in what follows from it too: one sentence is enough.
    if found.len() > before {
        return;
    }
    match plate {
        Plate::DoubleDrive(model) => double_drive(record, model, limits, found),
        Plate::Pmsm(model) => {
            let motor = pmsm(record, model);
            one_motor(record, &motor, None, limits, found);
            if found.is_empty() {
                motor.inertia(0.0, limits, found);
            }
        }
        Plate::Motor => still(record, &["position_rad", "current_a"], limits, found),
        Plate::FeedAxis { mass_kg } => {
            debug_assert_eq!(record.machine, Machine::FeedAxis);
            still(record, &["position_m"], limits, found);
            feed_axis::check(record, mass_kg, limits, found);
        }
    }
}

/// Channels that stand in most of a record although they are those of a machine that moves.
fn still(record: &Record, names: &[&'static str], limits: &Limits, found: &mut Vec<Finding>) {
    let least = (limits.frozen_s * record.rate) as usize;
    for name in names {
        let Some(values) = record.get(name) else {
            continue;
        };
        let longest = columns::standing(values, least)
            .into_iter()
            .map(|(from, to)| to - from)
            .max()
            .unwrap_or(0);
        let others_move = record
            .channels
            .iter()
            .any(|c| c.name != *name && c.values.windows(2).any(|w| w[0] != w[1]));
        if 2 * longest > values.len() && others_move {
            found.push(Finding::new(
                "frozen",
                &[name],
                [longest as f64 / record.rate, limits.frozen_s],
                format!(
                    "`{name}` holds {} for {:.2} s, more than half of the record, expected it to change as the others do; is it frozen, \
                     or the wrong column?",
                    values[0],
                    longest as f64 / record.rate
                ),
            ));
        }
    }
}

fn channel<'a>(record: &'a Record, name: &str) -> Cow<'a, [f64]> {
    Cow::Borrowed(record.channel(name))
}

fn drive_motor<'a>(record: &'a Record, prefix: &'static str, model: &'a Model) -> Motor<'a> {
    let of = |name: &str| channel(record, &format!("{prefix}{name}"));
    let axis = match prefix {
        "screw_" => plant::Axis::Screw,
        _ => plant::Axis::Nut,
    };
    let sensing = &model.sensing;
    Motor {
        prefix,
        rate: record.rate,
        segments: &record.segments,
        angle: of("angle_rad"),
        phases: Some([of("ia_a"), of("ib_a")]),
        dq: None,
        voltages: Some([of("ud_v"), of("uq_v")]),
        iq_ref: (record.get(&format!("{prefix}iq_ref_a"))).map(Cow::Borrowed),
        id_ref: None,
        speed_ref: Some(of("speed_ref_rad_s")),
        plate: model.motor(axis),
        bus_v: model.installation.bus_v,
        current_noise: sensing
            .current_noise_a
            .hypot(sensing.current_lsb_a / 12f64.sqrt()),
    }
}

fn pmsm<'a>(record: &'a Record, plate: &'a MotorModel) -> Motor<'a> {
    let pair = |a: &str, b: &str| {
        let both = (record.get(a).is_some(), record.get(b).is_some());
        (both == (true, true)).then(|| [channel(record, a), channel(record, b)])
    };
    let measured = |name: &str| {
        let channel = record.channels.iter().find(|c| c.name == name);
        channel.is_some_and(|c| c.origin == super::Origin::Measured)
    };
    let phases = pair("ia_a", "ib_a");
    Motor {
        prefix: "",
        rate: record.rate,
        segments: &record.segments,
        angle: channel(record, "angle_rad"),
        dq: pair("id_a", "iq_a").filter(|_| phases.is_none() || measured("iq_a")),
        voltages: pair("ud_v", "uq_v"),
        iq_ref: record.get("iq_ref_a").map(Cow::Borrowed),
        id_ref: record.get("id_ref_a").map(Cow::Borrowed),
        speed_ref: record.get("speed_ref_rad_s").map(Cow::Borrowed),
        plate,
        bus_v: 0.0,
        current_noise: 0.0,
        phases,
    }
}

/// The checks of one motor, in the order in which one error makes the next.
fn one_motor(
    record: &Record,
    motor: &Motor,
    other: Option<&Motor>,
    limits: &Limits,
    found: &mut Vec<Finding>,
) {
    let before = found.len();
    frozen(record, motor, limits, found);
    if found.len() > before
        || !motor.speed(other, limits, found)
        || !motor.current(other, limits, found)
        || !motor.lag(limits, found)
    {
        return;
    }
    motor.voltage(other, limits, found);
}

/// A motor's channel that holds a value where it cannot.
fn frozen(record: &Record, motor: &Motor, limits: &Limits, found: &mut Vec<Finding>) {
    let rate = record.rate;
    let least = (limits.frozen_s * rate) as usize;
    let pole_pairs = f64::from(motor.plate.pole_pairs);
    let mut say = |name: String, from: usize, to: usize, while_what: String| {
        found.push(Finding::new(
            "frozen",
            &[&name],
            [(to - from) as f64 / rate, limits.frozen_s],
            format!(
                "`{name}` holds one value from row {} to row {to}, {:.2} s, while {while_what}, expected it to change; is it frozen, or \
                 the wrong column?",
                from + 1,
                (to - from) as f64 / rate
            ),
        ));
    };
    let name = |channel: &str| format!("{}{channel}", motor.prefix);
    if let Some(reference) = &motor.speed_ref {
        let stands = columns::standing(&motor.angle, least)
            .into_iter()
            .find(|(from, to)| {
                let asked: f64 = reference[*from..*to].iter().map(|w| w.abs() / rate).sum();
                asked > 1.0
            });
        if let Some((from, to)) = stands {
            say(
                name("angle_rad"),
                from,
                to,
                "its speed reference asks for a radian and more".into(),
            );
        }
    }
    let turns = |from: usize, to: usize| {
        let step = ((0.005 * rate) as usize).max(1);
        let way: f64 = (from..to.saturating_sub(step))
            .step_by(step)
            .map(|k| (motor.angle[k + step] - motor.angle[k]).abs())
            .sum();
        way * pole_pairs / std::f64::consts::TAU
    };
    if let (Some(phases), Some(reference)) = (&motor.phases, &motor.iq_ref) {
        for (phase, channel) in phases.iter().zip(["ia_a", "ib_a"]) {
            let stands = columns::standing(phase, least)
                .into_iter()
                .find(|(from, to)| {
                    turns(*from, *to) > limits.frozen_turns
                        && rms(&reference[*from..*to]) > 10.0 * motor.current_noise.max(1e-3)
                });
            if let Some((from, to)) = stands {
                say(
                    name(channel),
                    from,
                    to,
                    format!("the field turns more than {} times", limits.frozen_turns),
                );
            }
        }
    }
    if let Some(voltages) = &motor.voltages {
        for (voltage, channel) in voltages.iter().zip(["ud_v", "uq_v"]) {
            let stands = columns::standing(voltage, 5 * least)
                .into_iter()
                .find(|(from, to)| turns(*from, *to) > 10.0 * limits.frozen_turns);
            if let Some((from, to)) = stands {
                say(name(channel), from, to, "the motor turns".into());
            }
        }
    }
}

fn double_drive(record: &Record, model: &Model, limits: &Limits, found: &mut Vec<Finding>) {
    let [screw, nut] = ["screw_", "nut_"].map(|prefix| drive_motor(record, prefix, model));
    let r = model.feed.travel_per_radian();
    let coupled = model.feed.table_mass_kg * r * r;
    let before = found.len();
    one_motor(record, &screw, Some(&nut), limits, found);
    one_motor(record, &nut, Some(&screw), limits, found);
    if found.len() == before {
        table(record, model, &screw, &nut, limits, found);
    }
    if found.len() == before {
        counts(model, [&screw, &nut], limits, found);
    }
    // The table's part of the inertia is by the lead.
    if found.len() == before {
        screw.inertia(coupled, limits, found);
        nut.inertia(coupled, limits, found);
    }
}

/// The steps of both angles against the counts of their encoders.
fn counts(model: &Model, motors: [&Motor; 2], limits: &Limits, found: &mut Vec<Finding>) {
    let sensing = &model.sensing;
    let own = match sensing.nut_encoder_counts_per_turn {
        Some(_) => "sensing.nut_encoder_counts_per_turn",
        None => "sensing.encoder_counts_per_turn",
    };
    let settings = ["sensing.encoder_counts_per_turn", own];
    for ((motor, setting), axis) in motors.into_iter().zip(settings).zip(plant::Axis::ALL) {
        let name = format!("{}angle_rad", motor.prefix);
        let declared = (setting, sensing.counts_per_turn(axis));
        resolution::check((&name, &motor.angle), declared, limits, found);
    }
}

/// The table against the angles of screw and nut.
fn table(
    record: &Record,
    model: &Model,
    screw: &Motor,
    nut: &Motor,
    limits: &Limits,
    found: &mut Vec<Finding>,
) {
    let r = model.feed.travel_per_radian();
    let position = record.channel("table_position_m");
    let step = ((5e-3 * record.rate) as usize).max(1);
    let rows: Vec<usize> = (0..record.len()).step_by(step).collect();
    let centred = |value: &dyn Fn(usize) -> f64| {
        let values: Vec<f64> = rows.iter().map(|k| value(*k)).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.into_iter().map(|v| v - mean).collect::<Vec<f64>>()
    };
    let expected = centred(&|k| r * (screw.angle[k] - nut.angle[k]));
    let moved = centred(&|k| position[k]);
    let noise = model.sensing.table_noise_m.max(1e-7);
    if rms(&expected) < 100.0 * noise {
        // Screw and nut turn alike: only a table that moves all the same is wrong.
        if rms(&moved) > 1e4 * rms(&expected).max(100.0 * noise) {
            found.push(Finding::new(
                "table",
                &["table_position_m"],
                [rms(&moved), 1e6 * noise],
                format!(
                    "`table_position_m` moves by {:.4} m rms while screw and nut turn alike, expected it to stand; is it the right \
                     column, and in m?",
                    rms(&moved)
                ),
            ));
        }
        return;
    }
    let Some(own) = fit(std::slice::from_ref(&expected), &moved) else {
        return;
    };
    let ratio = own.values[0];
    if own.explained > limits.travel_explained && limits.travel_ratio.contains(&ratio) {
        return;
    }
    let sentence = wrong_table(
        [rms(&moved), rms(&expected)],
        &own,
        model.feed.lead_m,
        limits,
    );
    found.push(Finding::new(
        "table",
        &["table_position_m"],
        [ratio, *limits.travel_ratio.end()],
        sentence,
    ));
}

/// How a table does not follow screw and nut, in words; both ways are rms, m.
fn wrong_table([moved, expected]: [f64; 2], fit: &Fit, lead_m: f64, limits: &Limits) -> String {
    let ratio = fit.values[0];
    if moved < 0.01 * expected && fit.explained < limits.travel_explained {
        format!(
            "`table_position_m` moves by {:.6} m rms, expected {:.6} m by lead and angles; is it frozen, in another unit, or the wrong \
             column?",
            moved, expected
        )
    } else if fit.explained < limits.travel_explained {
        format!(
            "`table_position_m` does not follow the angle of screw against nut ({:.0} % explained, expected more than {:.0} %); is it \
             the right column, and is lead_m right?",
            100.0 * fit.explained.max(0.0),
            100.0 * limits.travel_explained
        )
    } else if ratio < 0.0 {
        format!(
            "`table_position_m` moves {ratio:.4} times as far as lead and angle of screw against nut say, expected once: the columns \
             of screw and nut are exchanged, or the sign of the table or of lead_m is reversed{}",
            if (ratio + 1.0).abs() < 0.05 {
                String::new()
            } else {
                made_by(ratio)
            }
        )
    } else {
        format!(
            "`table_position_m` moves {ratio:.4} times as far as lead_m = {} and the angles say, expected once{}: correct lead_m in the \
             model, or give the table's unit in a mapping file",
            lead_m,
            power_of_ten(ratio)
        )
    }
}

/// A factor that is a power of ten, in words.
fn power_of_ten(ratio: f64) -> String {
    let power = ratio.log10().round();
    match power != 0.0 && (ratio / 10f64.powf(power) - 1.0).abs() < 0.05 {
        true => format!(", a power of ten: mm for m, or a lead that is wrong by 1e{power}"),
        false => made_by(ratio),
    }
}
