//! `report.html`: what was found, for a person.

use crate::analysis::{Coordinates, Found, Outcome};
use crate::channel::Channel;
use crate::interval::estimates;
use crate::plot::Chart;
use crate::select::Trial;
use plant::Axis;
use plant::effects::Place;
use realfft::RealFftPlanner;
use std::f64::consts::TAU;

/// Bins over a turn or a range.
const BINS: usize = 90;
/// Highest order of a spectrum's chart.
const ORDERS: f64 = 66.0;

/// The page.
pub fn page(outcome: &Outcome) -> String {
    let body = format!(
        "<h1>What the record has and the model lacks</h1>\n<p class=\"result\">{}</p>\n{}{}{}{}{}",
        result(outcome),
        effects(outcome),
        residuals(outcome),
        charts(outcome),
        hypotheses(outcome),
        foot(outcome),
    );
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>Identify</title>\n\
         <style>\n{}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n",
        include_str!("style.css")
    )
}

/// Four significant digits, in powers of ten where that is shorter.
fn number(value: f64) -> String {
    let size = value.abs();
    let text = if size == 0.0 {
        "0".into()
    } else if !(1e-3..1e5).contains(&size) {
        let power = size.log10().floor();
        format!(
            "{:.3}\u{00B7}10<sup>{power}</sup>",
            value / 10f64.powf(power)
        )
    } else {
        let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
        format!("{value:.decimals$}")
    };
    text.replace('-', "\u{2212}")
}

fn place(found: &Found) -> &'static str {
    match found.effect.place() {
        Place::Screw => "the screw's motor",
        Place::Nut => "the nut's motor",
        Place::Both => "both motors",
        Place::Feed => "the feed",
    }
}

fn result(outcome: &Outcome) -> String {
    let names: Vec<String> = outcome
        .effects
        .iter()
        .map(|f| {
            format!(
                "{} at {}",
                f.effect.effect().kind().replace('_', " "),
                place(f)
            )
        })
        .collect();
    let left = "Something is left that the check record does not bear out; it is given below without a cause.";
    match (names.is_empty(), outcome.unexplained.is_empty()) {
        (true, true) => "Nothing is missing: with its plate values recalibrated, the declared model explains the record to the noise of its sensors.".into(),
        (true, false) => left.into(),
        (false, true) => format!("The record has {}.", names.join(" and ")),
        (false, false) => format!("The record has {}. {left}", names.join(" and ")),
    }
}

fn unit(name: &str, found: &Found) -> &'static str {
    let feed = found.effect.place() == Place::Feed;
    match (found.effect.effect().kind(), name) {
        ("current_offset", _) => "A",
        ("dead_time", _) => "V",
        ("encoder_eccentricity", "amplitude") => "rad",
        ("lead_error" | "backlash", "amplitude" | "value") => "m",
        ("position_load", _) => "N/m",
        ("flux_harmonic", "amplitude") => "of the flux",
        ("stribeck_friction", "amplitude") if feed => "N",
        ("stribeck_friction", "speed") => {
            if feed {
                "m/s"
            } else {
                "rad/s"
            }
        }
        (_, "hz") => "Hz",
        (_, "phase") => "rad",
        (_, "order") => "per turn",
        (_, "amplitude") => "N m",
        _ => "",
    }
}

fn effects(outcome: &Outcome) -> String {
    if outcome.effects.is_empty() {
        return String::new();
    }
    let rows: String = outcome.effects.iter().flat_map(|found| {
        estimates(found).into_iter().enumerate().map(move |(k, estimate)| {
            let name = if k == 0 { format!("{} ({})", found.effect.effect().kind(), found.effect.place().name()) } else { String::new() };
            let share = if k == 0 { format!("{:.1} %", 100.0 * found.explained) } else { String::new() };
            format!(
                "<tr><th>{name}</th><td class=\"text\">{}</td><td>{}</td><td>{} to {}</td><td class=\"text\">{}</td><td>{share}</td></tr>\n",
                estimate.name, number(estimate.value), number(estimate.interval[0]), number(estimate.interval[1]), unit(&estimate.name, found),
            )
        }).collect::<Vec<_>>()
    }).collect();
    format!(
        "<h2>Effects</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>Effect</th><th class=\"text\">Parameter</th><th>Value</th>\
         <th>95 % interval</th><th class=\"text\">Unit</th><th>Explains</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

fn residuals(outcome: &Outcome) -> String {
    let rows: String = outcome.channels.iter().map(|f| format!(
        "<tr><th>{}</th><td class=\"text\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.0} %</td></tr>\n",
        f.channel.name(), f.channel.unit(), number(f.fit_before), number(f.fit_after), number(f.check_before),
        number(f.check_after), number(f.noise_floor), 100.0 * f.whiteness,
    )).collect();
    format!(
        "<h2>Residual before and after</h2>\n<p class=\"note\">Rms within the band that is used, plate values recalibrated within \
         their tolerance. The check record is another run: the parameters are those of the fit record.</p>\n\
         <div class=\"scroll\"><table>\n<thead><tr><th>Channel</th><th class=\"text\">Unit</th><th>Fit before</th><th>Fit after</th>\
         <th>Check before</th><th>Check after</th><th>Noise floor</th><th>White lags after</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
    )
}

/// Mean of a residual over bins of a coordinate.
fn binned(
    coordinate: &[f64],
    residual: &[f64],
    open: &[bool],
    range: (f64, f64),
) -> Vec<(f64, f64)> {
    let mut sums = vec![(0.0, 0.0); BINS];
    let width = (range.1 - range.0) / BINS as f64;
    for ((x, r), _) in coordinate
        .iter()
        .zip(residual)
        .zip(open)
        .filter(|(_, open)| **open)
    {
        let bin = ((x - range.0) / width) as usize;
        if let Some(sum) = sums.get_mut(bin) {
            sum.0 += r;
            sum.1 += 1.0;
        }
    }
    sums.iter()
        .enumerate()
        .filter(|(_, sum)| sum.1 > 3.0)
        .map(|(k, sum)| (range.0 + (k as f64 + 0.5) * width, sum.0 / sum.1))
        .collect()
}

/// Amplitude of a residual over the orders of an angle; of neighbouring orders the greatest.
fn spectrum(angle: &[f64], residual: &[f64], open: &[bool]) -> Vec<(f64, f64)> {
    const PER_TURN: usize = 256;
    const POINTS: usize = 420;
    let low = angle.iter().copied().fold(f64::MAX, f64::min);
    let high = angle.iter().copied().fold(f64::MIN, f64::max);
    let turns = (((high - low) / TAU).max(8.0) as usize + 1).next_power_of_two();
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(turns * PER_TURN);
    let mut bins = transform.make_input_vec();
    let mut used = 0.0;
    for ((x, r), _) in angle
        .iter()
        .zip(residual)
        .zip(open)
        .filter(|(_, open)| **open)
    {
        let bin = ((x - low) / TAU * PER_TURN as f64) as usize;
        bins[bin.min(turns * PER_TURN - 1)] += r;
        used += 1.0;
    }
    let mut lines = transform.make_output_vec();
    if transform.process(&mut bins, &mut lines).is_err() || used == 0.0 {
        return Vec::new();
    }
    let top = ((ORDERS * turns as f64) as usize).min(lines.len());
    let group = (top / POINTS).max(1);
    lines[1..top]
        .chunks(group)
        .enumerate()
        .map(|(k, chunk)| {
            let (at, most) = chunk
                .iter()
                .enumerate()
                .map(|(j, c)| (j, c.norm()))
                .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
            (
                (1 + k * group + at) as f64 / turns as f64,
                2.0 * most / used,
            )
        })
        .collect()
}

/// The coordinates that a channel is looked at over: its own angle and speed, or those of screw against nut.
fn own(channel: Channel, at: &Coordinates) -> (&'static str, &[f64], &[f64]) {
    match channel {
        Channel::Table => (
            "Angle of screw against nut, turns",
            &at.relative,
            &at.relative_speed,
        ),
        Channel::Torque(axis) | Channel::VoltageD(axis) | Channel::VoltageQ(axis) => match axis {
            Axis::Screw => ("Angle of the screw, turns", &at.angle[0], &at.speed[0]),
            Axis::Nut => ("Angle of the nut, turns", &at.angle[1], &at.speed[1]),
        },
    }
}

/// The orders per turn of a channel's own angle at which effects were found.
fn marks(channel: Channel, outcome: &Outcome) -> Vec<(f64, String)> {
    use crate::hypothesis::Family;
    let pole_pairs = |axis: Axis| f64::from(outcome.model.motor(axis).pole_pairs);
    outcome
        .effects
        .iter()
        .filter_map(|found| {
            let hypothesis = &found.hypothesis;
            let order = match (channel, hypothesis.axis()) {
                (Channel::Table, None) => match hypothesis.family {
                    Family::LeadError => hypothesis.shape,
                    _ => return None,
                },
                (
                    Channel::Torque(axis) | Channel::VoltageD(axis) | Channel::VoltageQ(axis),
                    Some(own),
                ) if axis == own => match hypothesis.family {
                    Family::AngleTorque | Family::EncoderEccentricity => hypothesis.shape,
                    Family::FluxHarmonic => hypothesis.shape * pole_pairs(axis),
                    Family::CurrentOffset => pole_pairs(axis),
                    Family::CurrentGain => 2.0 * pole_pairs(axis),
                    Family::DeadTime => 6.0 * pole_pairs(axis),
                    _ => return None,
                },
                _ => return None,
            };
            Some((order, found.effect.effect().kind().to_owned()))
        })
        .collect()
}

fn charts(outcome: &Outcome) -> String {
    // Channels in which an effect shows; where nothing is missing, the three that would show most.
    let shows = |channel: &Channel| {
        let figures = outcome.channels.iter().find(|f| f.channel == *channel);
        figures.is_some_and(|f| f.fit_before > 1.02 * f.fit_after)
    };
    let mut list: Vec<Channel> = Channel::ALL.into_iter().filter(shows).collect();
    if list.is_empty() {
        list = vec![
            Channel::Torque(Axis::Screw),
            Channel::Torque(Axis::Nut),
            Channel::Table,
        ];
    }
    let sections: String = list
        .into_iter()
        .map(|channel| section(channel, outcome))
        .collect();
    format!(
        "<h2>Residual over its coordinates</h2>\n<ul class=\"legend\"><li><i class=\"before\"></i>before</li>\
         <li><i class=\"after\"></i>after</li><li><i class=\"line\"></i>order of an effect that was found</li></ul>\n{sections}"
    )
}

fn section(channel: Channel, outcome: &Outcome) -> String {
    let Some((_, before, after)) = outcome
        .residuals
        .iter()
        .find(|(known, ..)| *known == channel)
    else {
        return String::new();
    };
    let open = &outcome.open[channel.index()];
    let at = &outcome.coordinates;
    let (name, angle, speed) = own(channel, at);
    let folded =
        |angle: &[f64]| -> Vec<f64> { angle.iter().map(|a| (a / TAU).rem_euclid(1.0)).collect() };
    let range = |values: &[f64]| {
        values
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)))
    };
    let mut figures = vec![figure(
        "Order spectrum",
        Chart {
            about: format!("Amplitude of the {} residual over orders", channel.name()),
            x: "Order, per turn",
            y: channel.unit(),
            series: [before, after].map(|r| spectrum(angle, r, open)),
            marks: marks(channel, outcome),
            size: (960, 300),
            logarithmic: true,
        },
        true,
    )];
    let mut over = |caption: &str, x: &str, coordinate: &[f64], range: (f64, f64)| {
        figures.push(figure(
            caption,
            Chart {
                about: format!("Mean {} residual over {x}", channel.name()),
                x,
                y: channel.unit(),
                series: [before, after].map(|r| binned(coordinate, r, open, range)),
                marks: Vec::new(),
                size: (440, 260),
                logarithmic: false,
            },
            false,
        ));
    };
    over("Over a turn", name, &folded(angle), (0.0, 1.0));
    if channel != Channel::Table {
        over(
            "Over a turn of screw against nut",
            "Angle of screw against nut, turns",
            &folded(&at.relative),
            (0.0, 1.0),
        );
    }
    over("Over speed", "Speed, rad/s", speed, range(speed));
    over("Over time", "Time, s", &at.time, range(&at.time));
    format!(
        "<h3>{}</h3>\n<div class=\"charts\">\n{}</div>\n",
        capital(channel.name()),
        figures.concat()
    )
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}

fn figure(caption: &str, chart: Chart, wide: bool) -> String {
    let class = if wide { " class=\"wide\"" } else { "" };
    format!(
        "<figure{class}><figcaption>{caption}</figcaption>\n{}</figure>\n",
        chart.svg()
    )
}

fn row(trial: &Trial, reason: &str) -> String {
    let shape = if trial.hypothesis.shape == 0.0 {
        String::new()
    } else {
        number(trial.hypothesis.shape)
    };
    format!(
        "<tr><th>{}</th><td class=\"text\">{}</td><td>{shape}</td><td>{}</td><td class=\"text\">{reason}</td></tr>\n",
        trial.hypothesis.name(),
        trial.hypothesis.place.name(),
        number(trial.gain.fall.max(0.0)),
    )
}

fn hypotheses(outcome: &Outcome) -> String {
    let mut rows = String::new();
    for found in &outcome.effects {
        let name = found.effect.effect().kind();
        rows += &format!(
            "<tr><th>{name}</th><td class=\"text\">{}</td><td></td><td>{}</td><td class=\"text\">found; {} on the check record</td></tr>\n",
            found.effect.place().name(),
            number(found.fall),
            number(found.check_fall),
        );
        for rival in &found.rivals {
            rows += &row(
                rival,
                &format!("explained less than {name}, and nothing beside it"),
            );
        }
    }
    for trial in outcome.last.iter().take(8) {
        let reason = if trial.gain.fall > outcome.threshold {
            "not borne out by the check record"
        } else {
            "below the threshold"
        };
        rows += &row(trial, reason);
    }
    format!(
        "<h2>Hypotheses</h2>\n<p class=\"note\">Fall of the sum of squares over all channels, in units of the noise. An effect must \
         bring at least {} on the fit record, and a share of it on the check record with the same parameters; {} hypotheses were \
         tried, besides all orders from 0.3 to 126 per turn and all frequencies.</p>\n<div class=\"scroll\"><table>\n\
         <thead><tr><th>Hypothesis</th><th class=\"text\">Where</th><th>Order, Hz or speed</th><th>Fall</th><th class=\"text\">Why not</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n",
        number(outcome.threshold),
        outcome.tried,
    )
}

fn foot(outcome: &Outcome) -> String {
    let rows: String = outcome
        .calibration
        .iter()
        .map(|(name, change, sigma)| {
            format!(
                "<tr><th>{name}</th><td>{:+.2} %</td><td>{:.2} %</td></tr>\n",
                100.0 * change,
                100.0 * sigma
            )
            .replace('-', "\u{2212}")
        })
        .collect();
    let left: String = outcome
        .unexplained
        .iter()
        .map(|u| {
            format!(
                "<p class=\"note\">Left at {}: over {}, {} ({}); {}.</p>\n",
                u.channel,
                u.coordinate,
                number(u.order),
                number(u.size),
                u.reason
            )
        })
        .collect();
    format!(
        "{left}<footer>\n<h2>Recalibrated plate values</h2>\n<p class=\"note\">Calibration is no effect: it stays within the plate's \
         tolerance.</p>\n<div class=\"scroll\"><table>\n<thead><tr><th>Parameter</th><th>Change</th><th>Deviation</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n</footer>\n"
    )
}
