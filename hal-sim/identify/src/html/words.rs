//! An effect, a size and a place in words.

use crate::records::DataQuality;
use crate::report::{Effect, Left, Residual};
use plant::effects::{AnyEffect, Kind};

/// Four significant digits, in powers of ten where that is shorter.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "\u{2013}".into();
    }
    let size = value.abs();
    let text = if size == 0.0 {
        "0".into()
    } else if !(1e-3..1e5).contains(&size) {
        let power = size.log10().floor();
        let digits = value / 10f64.powf(power);
        // At once, as a minus of the power is raised too.
        return format!("{digits:.2}\u{B7}10").replace('-', "\u{2212}") + &raised(power as i32);
    } else {
        let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.decimals$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').into(),
            false => text,
        }
    };
    text.replace('-', "\u{2212}")
}

/// A power as it stands above a line.
fn raised(power: i32) -> String {
    const DIGITS: [char; 10] = [
        '\u{2070}', '\u{B9}', '\u{B2}', '\u{B3}', '\u{2074}', '\u{2075}', '\u{2076}', '\u{2077}',
        '\u{2078}', '\u{2079}',
    ];
    power
        .to_string()
        .chars()
        .map(|c| c.to_digit(10).map_or('\u{207B}', |d| DIGITS[d as usize]))
        .collect()
}

/// An effect's kind and where it is.
pub(super) fn title(kind: &str, place: &str) -> String {
    format!("{} ({place})", kind.replace('_', " "))
}

/// What became of a record's rows.
pub(super) fn faults(account: &DataQuality) -> String {
    let mut faults: Vec<String> = account
        .skipped
        .iter()
        .map(|s| {
            format!(
                "{} rows left out ({}, column {}, first in row {})",
                s.rows, s.rule, s.column, s.first_row
            )
        })
        .collect();
    if account.bridged > 0 {
        faults.push(format!("{} rows bridged over short gaps", account.bridged));
    }
    if account.cut > 0 {
        faults.push(format!("{} rows beyond a long gap not used", account.cut));
    }
    match faults.is_empty() {
        true => "no faults".into(),
        false => faults.join("; "),
    }
}

/// The ends of an interval, to two digits of its width.
pub(super) fn interval([low, high]: [f64; 2]) -> String {
    let width = high - low;
    let size = low.abs().max(high.abs());
    if width.is_nan() || width <= 0.0 || width > 0.01 * size || !(1e-3..1e5).contains(&size) {
        return format!("{} to {}", number(low), number(high));
    }
    let decimals = (1 - width.log10().floor() as i32).max(0) as usize;
    format!("{low:.decimals$} to {high:.decimals$}").replace('-', "\u{2212}")
}

/// A unit's prefix so that `size` is read easily: factor and name.
pub(super) fn prefix(size: f64, unit: &str) -> (f64, String) {
    let takes = matches!(unit, "N m" | "V" | "A" | "m" | "rad" | "N" | "s");
    let (factor, sign) = match size.abs() {
        _ if !takes => (1.0, ""),
        s if s >= 0.1 || s == 0.0 => (1.0, ""),
        s if s >= 1e-4 => (1e3, "m"),
        s if s >= 1e-7 => (1e6, "\u{B5}"),
        _ => (1e9, "n"),
    };
    (factor, format!("{sign}{unit}"))
}

/// A size with its unit.
pub(super) fn size(value: f64, unit: &str) -> String {
    let (factor, unit) = prefix(value, unit);
    let scaled = value * factor;
    let decimals = match scaled.abs() {
        s if s >= 100.0 || s == 0.0 => 0,
        s if s >= 10.0 => 1,
        _ => 2,
    };
    format!("{scaled:.decimals$}\u{A0}{unit}")
        .trim_end()
        .replace('-', "\u{2212}")
}

/// Who has it.
fn owner(place: &str) -> &'static str {
    match place {
        "screw" => "The screw\u{2019}s motor",
        "nut" => "The nut\u{2019}s motor",
        "both" => "Each motor",
        "motor" => "The motor",
        _ => "The feed",
    }
}

/// `3 times`, `once`.
fn times(order: f64) -> String {
    match order {
        1.0 => "once".into(),
        2.0 => "twice".into(),
        _ => format!("{} times", number((1000.0 * order).round() / 1000.0)),
    }
}

/// What a unit is of.
fn unit_word(unit: &str) -> &'static str {
    match unit {
        "N" => "force",
        "N m" => "torque",
        "V" => "voltage",
        "A" => "current",
        _ => "share",
    }
}

/// An effect whose figures are put into words.
struct Figures<'e>(&'e Effect);

impl Figures<'_> {
    fn value(&self, name: &str) -> f64 {
        self.0.parameters.get(name).copied().unwrap_or(f64::NAN)
    }

    fn unit(&self, name: &str) -> &str {
        self.0.unit.get(name).map_or("", String::as_str)
    }

    /// A parameter with its unit.
    fn size(&self, name: &str) -> String {
        size(self.value(name), self.unit(name))
    }

    fn percent(&self, name: &str) -> String {
        format!("{:.2}\u{A0}%", 100.0 * self.value(name)).replace('-', "\u{2212}")
    }

    /// How often the effect repeats.
    fn often(&self) -> String {
        times(self.0.order.unwrap_or(f64::NAN))
    }
}

/// What an effect is, as a sentence.
pub(super) fn sentence(effect: &Effect) -> String {
    let of = Figures(effect);
    if effect.kind == "angle_periodic" && of.unit("amplitude") == "N" {
        return format!(
            "A force of {} repeats {} a turn of the screw.",
            of.size("amplitude"),
            of.often()
        );
    }
    let what = electrical(&of)
        .or_else(|| periodic(&of))
        .or_else(|| mechanical(&of))
        .unwrap_or_else(|| linear(&of));
    match &effect.suggests {
        Some(cause) => format!("{} {what} ({cause}).", owner(&effect.place)),
        None => format!("{} {what}.", owner(&effect.place)),
    }
}

/// Describes an effect of the sensors, the bridge or the windings.
fn electrical(of: &Figures) -> Option<String> {
    Some(match of.0.kind.as_str() {
        "current_offset" => format!(
            "reads its current wrong by {} in phase a and {} in phase b: a torque once per electrical turn",
            of.size("off_a"),
            of.size("off_b")
        ),
        "current_gain" => format!(
            "reads its current wrong by {} of it in phase a and {} in phase b: a torque twice per electrical turn",
            of.percent("gain_a"),
            of.percent("gain_b")
        ),
        "encoder_eccentricity" => format!(
            "has an encoder that errs by {}, {} a turn",
            of.size("amplitude"),
            of.often()
        ),
        "dead_time" => format!(
            "loses {} of each phase\u{2019}s voltage against the sign of its current",
            of.size("value")
        ),
        "resistance_drift" => format!(
            "changes its resistance by {} over the run",
            of.percent("value")
        ),
        "flux_drift" => format!("changes its flux by {} over the run", of.percent("value")),
        "reported_current_lag" => format!(
            "has a current that is reported through a filter with a time constant of {}: an effect of the measurement",
            of.size("value")
        ),
        _ => return None,
    })
}

/// Describes a torque that repeats.
fn periodic(of: &Figures) -> Option<String> {
    Some(match of.0.kind.as_str() {
        "torque_harmonic" => format!(
            "has a torque ripple of {}, {} {}",
            of.size("amplitude"),
            of.often(),
            of.unit("order")
        ),
        "flux_harmonic" => format!(
            "has a flux harmonic of {}, {} per electrical turn",
            of.percent("amplitude"),
            of.often()
        ),
        "cogging" => format!("cogs {} a turn, by {}", of.often(), of.size("amplitude")),
        "coupling_misalignment" => {
            format!(
                "has a torque of {}, {} a turn",
                of.size("amplitude"),
                of.often()
            )
        }
        "angle_periodic" => format!(
            "has a ripple of {}, {} a turn{}",
            of.size("amplitude"),
            of.often(),
            match of.0.suggests {
                Some(_) => "",
                None => ": no order of its poles, so a belt, a bearing or the like",
            }
        ),
        "time_periodic" => format!(
            "feels a torque of {} at {} Hz, whatever its speed",
            of.size("amplitude"),
            number(of.value("hz"))
        ),
        _ => return None,
    })
}

/// Describes an effect of friction or the feed, or a curve without a name.
fn mechanical(of: &Figures) -> Option<String> {
    Some(match of.0.kind.as_str() {
        "stribeck_friction" if of.value("amplitude") < 0.0 => format!(
            "slides easier when slow: friction is {} lower near rest than when it moves",
            size(-of.value("amplitude"), of.unit("amplitude"))
        ),
        "stribeck_friction" => format!(
            "sticks: friction is {} higher at rest than when it moves",
            of.size("amplitude")
        ),
        "lead_error" => format!(
            "has a lead that errs by {}, {} per turn of screw against nut",
            of.size("amplitude"),
            of.often()
        ),
        "ball_passage" => format!(
            "has balls that pass {} per turn of screw against nut, with {}",
            of.often(),
            of.size("amplitude")
        ),
        "axial_compliance" => format!(
            "has a table that swings on the screw at {} Hz",
            number(of.value("hz"))
        ),
        "backlash" => format!("loses {} at each reversal: backlash", of.size("value")),
        "measured" => format!(
            "has a {} of {} rms that no name explains",
            unit_word(of.unit("rms")),
            of.size("rms")
        ),
        "force_lag" => format!("has a force that follows {} late", of.size("value")),
        "viscous_saturation" => "has a viscous friction that grows less than the speed".into(),
        "viscous_asymmetry" => "has a viscous friction that differs by direction".into(),
        "presliding" => "gives like a spring before it slides".into(),
        "position_friction" => "has a friction that grows with position".into(),
        _ => return None,
    })
}

/// Describes an effect with one number. Its kind has the words.
fn linear(of: &Figures) -> String {
    let kind = of.0.kind.as_str();
    match AnyEffect::kind_named(kind).and_then(Kind::linear) {
        Some(linear) => {
            let number = match linear.unit {
                "" => of.percent(linear.number),
                unit => size(of.value(linear.number), unit),
            };
            linear.says.replace("{}", &number)
        }
        None => format!("has {}", kind.replace('_', " ")),
    }
}

/// Its kind and place.
fn named(kind: &str, place: &str) -> String {
    format!("{} ({place})", capital(&kind.replace('_', " ")))
}

/// How an effect holds on operating points that it was not fitted to.
pub(super) fn held_back(effect: &Effect) -> Option<String> {
    let (low, high) = effect
        .held_back
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    (low <= high).then(|| {
        let percent = |share: f64| format!("{:.0}\u{A0}%", 100.0 * share).replace('-', "\u{2212}");
        format!(
            "{}: fitted without an operating point it explains there {} to {} of what it explains when fitted with it \
             ({} points that show it).",
            named(&effect.kind, &effect.place),
            percent(low),
            percent(high),
            effect.held_back.len()
        )
    })
}

/// What the record does not tell from an effect.
pub(super) fn not_separable(effect: &Effect) -> Option<String> {
    if effect.not_separable.is_empty() {
        return None;
    }
    let rivals: Vec<String> = effect
        .not_separable
        .iter()
        .map(|alias| {
            let at = |name: &str| alias.parameters.get(name);
            let often = match (at("order"), at("hz")) {
                (Some(order), _) => format!(", {} a turn", times(*order)),
                (_, Some(hz)) => format!(", {} Hz", number(*hz)),
                _ => String::new(),
            };
            format!(
                "{}{often}: behind by {:.1} in log-likelihood on the fit record, {:.1} on the check record",
                named(&alias.kind, &alias.place),
                alias.behind,
                alias.check_behind
            )
        })
        .collect();
    Some(format!(
        "{} is not separable from {}.",
        named(&effect.kind, &effect.place),
        rivals.join("; from ")
    ))
}

/// What something looks like that nothing explains.
pub(super) fn left(left: &Left) -> String {
    let often = match (left.order, left.hz) {
        (Some(order), _) => format!(", {} a turn", times(order)),
        (_, Some(hz)) => format!(", at {} Hz", number(hz)),
        _ => String::new(),
    };
    let over = match left.coordinate.as_str() {
        "none" => String::new(),
        coordinate => format!(" over the {coordinate}{often}"),
    };
    let size = size(left.size, &left.unit);
    let channel = capital(&left.channel);
    format!("{channel}: {size} rms{over}; {}.", left.reason)
}

/// How a channel's residual fell, and what noise alone is.
pub(super) fn fall(figures: &Residual) -> (String, String) {
    let (factor, unit) = prefix(figures.check_before, &figures.unit);
    let digits = |value: f64| {
        let scaled = value * factor;
        match scaled.abs() {
            s if s >= 100.0 => format!("{scaled:.0}"),
            s if s >= 10.0 => format!("{scaled:.1}"),
            s if s >= 1.0 => format!("{scaled:.2}"),
            _ => format!("{scaled:.3}"),
        }
    };
    let floor = match figures.noise_floor.is_finite() {
        true => format!("noise alone is {}", digits(figures.noise_floor)),
        false => String::new(),
    };
    let fall = format!(
        "{} \u{2192} {}\u{A0}{unit}",
        digits(figures.check_before),
        digits(figures.check_after)
    );
    (fall, floor)
}

/// With a capital letter.
pub(super) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}
