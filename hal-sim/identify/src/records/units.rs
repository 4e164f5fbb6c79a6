//! Units that a log may have, and what makes them SI.

/// What some units need beside their name.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Context {
    /// Encoder counts per mechanical turn.
    pub(super) counts_per_turn: Option<f64>,
    /// Pole pairs.
    pub(super) pole_pairs: Option<f64>,
}

/// Names of a unit, the SI unit that it is one of, and its factor.
type Unit = (&'static [&'static str], &'static str, f64);

const TURN: f64 = std::f64::consts::TAU;

/// Those that need nothing.
const UNITS: [Unit; 43] = [
    (&["s", "sec", "second", "seconds"], "s", 1.0),
    (&["ms", "msec", "millisecond", "milliseconds"], "s", 1e-3),
    (
        &["us", "\u{b5}s", "\u{3bc}s", "usec", "microseconds"],
        "s",
        1e-6,
    ),
    (&["ns"], "s", 1e-9),
    (&["min"], "s", 60.0),
    (&["rad", "radian", "radians"], "rad", 1.0),
    (&["mrad"], "rad", 1e-3),
    (&["deg", "degree", "degrees", "\u{b0}"], "rad", TURN / 360.0),
    (
        &[
            "turn",
            "turns",
            "rev",
            "revs",
            "revolution",
            "revolutions",
            "rot",
        ],
        "rad",
        TURN,
    ),
    (&["rad/s", "rad/sec"], "rad/s", 1.0),
    (&["deg/s", "\u{b0}/s", "degrees/s"], "rad/s", TURN / 360.0),
    (
        &["rpm", "1/min", "min-1", "U/min", "rev/min", "r/min"],
        "rad/s",
        TURN / 60.0,
    ),
    (
        &["rev/s", "turn/s", "turns/s", "revs/s", "Hz", "rps"],
        "rad/s",
        TURN,
    ),
    (&["m", "meter", "metre"], "m", 1.0),
    (&["mm"], "m", 1e-3),
    (&["um", "\u{b5}m", "\u{3bc}m", "micron"], "m", 1e-6),
    (&["nm", "nanometre"], "m", 1e-9),
    (&["in", "inch"], "m", 0.0254),
    (&["m/s"], "m/s", 1.0),
    (&["mm/s"], "m/s", 1e-3),
    (&["mm/min"], "m/s", 1e-3 / 60.0),
    (&["m/min"], "m/s", 1.0 / 60.0),
    (&["A", "amp", "amps", "ampere"], "A", 1.0),
    (&["mA", "milliamps"], "A", 1e-3),
    (&["uA", "\u{b5}A", "\u{3bc}A"], "A", 1e-6),
    (&["kA"], "A", 1e3),
    (&["Arms", "A rms"], "A", std::f64::consts::SQRT_2),
    (&["V", "volt", "volts"], "V", 1.0),
    (&["mV"], "V", 1e-3),
    (&["uV", "\u{b5}V", "\u{3bc}V"], "V", 1e-6),
    (&["kV"], "V", 1e3),
    (&["N", "newton"], "N", 1.0),
    (&["kN"], "N", 1e3),
    (&["mN"], "N", 1e-3),
    (&["Nm", "N m", "N*m"], "N m", 1.0),
    (&["mNm"], "N m", 1e-3),
    (&["1", "ratio"], "1", 1.0),
    (&["%", "percent"], "1", 1e-2),
    (&["permille", "\u{2030}"], "1", 1e-3),
    (&["kHz"], "rad/s", 1e3 * TURN),
    (&["km/h"], "m/s", 1.0 / 3.6),
    (&["cm"], "m", 1e-2),
    (&["cm/s"], "m/s", 1e-2),
];

/// The factor from `unit` to the SI unit `si` of a channel.
///
/// # Errors
/// A sentence for a unit that is unknown or of something else.
pub(super) fn factor(unit: &str, si: &str, context: Context) -> Result<f64, String> {
    let unit = unit.trim();
    let counts = || {
        context.counts_per_turn.map(|c| TURN / c).ok_or_else(|| {
            format!("the unit `{unit}` needs counts_per_turn, which the mapping does not give")
        })
    };
    let poles = || {
        context.pole_pairs.map(|p| 1.0 / p).ok_or_else(|| {
            format!("the unit `{unit}` needs pole_pairs, which the mapping does not give")
        })
    };
    match (unit, si) {
        ("count" | "counts" | "tick" | "ticks", "rad")
        | ("count/s" | "counts/s" | "ticks/s", "rad/s") => return counts(),
        ("electrical rad/s", "rad/s") => return poles(),
        ("erpm" | "eRPM" | "ERPM", "rad/s") => return Ok(poles()? * TURN / 60.0),
        _ => {}
    }
    let exact = UNITS.iter().filter(|(names, _, _)| names.contains(&unit));
    // "M" is not "m": other cases count only where no unit has the name as it stands.
    let loose = UNITS
        .iter()
        .filter(|(names, _, _)| names.iter().any(|name| name.eq_ignore_ascii_case(unit)));
    let found: Vec<&Unit> = exact.chain(loose).collect();
    match found.iter().find(|(_, of, _)| *of == si) {
        Some((_, _, factor)) => Ok(*factor),
        None => Err(match found.first() {
            Some((_, of, _)) => format!("the unit `{unit}` is one of {of}, expected one of {si}"),
            None => format!(
                "the unit `{unit}` is unknown; expected one of {}",
                names(si).join(", ")
            ),
        }),
    }
}

/// The units of an SI unit, the first name of each.
pub fn names(si: &str) -> Vec<&'static str> {
    let own = UNITS
        .iter()
        .filter(|(_, of, _)| *of == si)
        .map(|(names, _, _)| names[0]);
    let more: &[&str] = match si {
        "rad" => &["count"],
        "rad/s" => &["count/s", "erpm", "electrical rad/s"],
        _ => &[],
    };
    own.chain(more.iter().copied()).collect()
}

/// The unit in a text such as `Current [mA]`, `(V)`, `speed / rpm` or `mA`, and the text without it; `None` where it
/// has none.
pub(super) fn of_text(text: &str) -> Option<(&str, &str)> {
    let text = text.trim();
    for (open, close) in [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')] {
        if let Some(rest) = text.strip_suffix(close)
            && let Some(at) = rest.rfind(open)
        {
            let unit = rest[at + open.len_utf8()..].trim();
            return known(unit).then_some((rest[..at].trim(), unit));
        }
    }
    if let Some((name, unit)) = text.rsplit_once(" / ") {
        return known(unit).then_some((name.trim(), unit.trim()));
    }
    known(text).then_some(("", text))
}

/// Whether a text names a unit.
pub(super) fn known(unit: &str) -> bool {
    let unit = unit.trim();
    ["count", "counts", "tick", "ticks", "erpm", "counts/s"].contains(&unit)
        || UNITS
            .iter()
            .any(|(names, _, _)| names.iter().any(|name| name.eq_ignore_ascii_case(unit)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_the_same_letters_are_told_by_what_they_measure() {
        let none = Context::default();
        assert_eq!(factor("mA", "A", none), Ok(1e-3));
        assert_eq!(factor("rpm", "rad/s", none), Ok(TURN / 60.0));
        assert!((factor("deg", "rad", none).unwrap() * 180.0 - TURN / 2.0).abs() < 1e-12);
        assert!(factor("mm", "A", none).unwrap_err().contains("one of m"));
        assert!(factor("furlong", "m", none).unwrap_err().contains("mm"));
        assert!(
            factor("count", "rad", none)
                .unwrap_err()
                .contains("counts_per_turn")
        );
        let seven = Context {
            counts_per_turn: Some(8192.0),
            pole_pairs: Some(7.0),
        };
        assert_eq!(factor("count", "rad", seven), Ok(TURN / 8192.0));
        let got = factor("erpm", "rad/s", seven).unwrap();
        let expected = TURN / 60.0 / 7.0;
        assert!(
            (got / expected - 1.0).abs() < 1e-15,
            "7 pole pairs at 1 erpm: {got} rad/s, expected {expected}"
        );
    }

    #[test]
    fn a_unit_is_read_off_a_header() {
        assert_eq!(of_text("Current [mA]"), Some(("Current", "mA")));
        assert_eq!(of_text("(V)"), Some(("", "V")));
        assert_eq!(of_text("n / rpm"), Some(("n", "rpm")));
        assert_eq!(of_text("Position (estimated)"), None);
        assert_eq!(of_text("Iq"), None);
        assert_eq!(of_text(""), None);
    }
}
