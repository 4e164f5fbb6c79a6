//! The strongest lines of a spectrum, and the orders that they are of.

use hal_sim::experiment::OperatingPoint;
use std::f64::consts::TAU;

/// Lines that are named.
const MOST: usize = 8;
/// Lines within so many bins of a stronger one are its window's.
const APART: usize = 4;
/// A line is reported where it has this multiple of the median amplitude.
const ABOVE_MEDIAN: f64 = 6.0;
/// A line's frequency is known to this part of the spectrum's resolution, between its bins. An order is reported where that is less than
/// a quarter of it.
const KNOWN: f64 = 0.15;
const TOLD: f64 = 0.25;
/// An order is whole within this at least: the speed is not exact.
const WHOLE: f64 = 0.02;
/// Highest whole order that is reported.
const HIGHEST: f64 = 200.0;

/// A line of a spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Frequency, Hz.
    pub hz: f64,
    /// Amplitude, mm/s.
    pub mm_s: f64,
    /// What it may repeat with: `order 12 of the screw`. Several where the speeds do not tell them apart.
    pub orders: Vec<String>,
}

/// The turns that something may repeat with, and how often a second each turns.
pub fn turns(point: OperatingPoint, travel_per_radian: f64) -> [(&'static str, f64); 3] {
    let relative = point.velocity / travel_per_radian / TAU;
    let nut = point.base / TAU;
    [
        ("the screw", (nut + relative).abs()),
        ("the nut", nut.abs()),
        ("screw against nut", relative.abs()),
    ]
}

/// The strongest lines of `spectrum`, strongest first.
pub fn lines(spectrum: &[(f64, f64)], turns: &[(&'static str, f64); 3]) -> Vec<Line> {
    let mut sorted: Vec<f64> = spectrum.iter().map(|line| line.1).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(median) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    let resolution = spectrum.get(1).map_or(0.0, |line| line.0 - spectrum[0].0);
    let mut strongest: Vec<usize> = (0..spectrum.len()).collect();
    strongest.sort_by(|a, b| spectrum[*b].1.total_cmp(&spectrum[*a].1));
    let mut taken: Vec<usize> = Vec::new();
    for k in strongest {
        let is_line = spectrum[k].1 > ABOVE_MEDIAN * median;
        if !is_line || taken.len() == MOST {
            break;
        }
        if taken.iter().all(|other| other.abs_diff(k) > APART) {
            taken.push(k);
        }
    }
    taken
        .into_iter()
        .map(|k| {
            let hz = spectrum[k].0 + resolution * between_bins(spectrum, k);
            Line {
                hz,
                mm_s: spectrum[k].1,
                orders: orders(hz, resolution, turns),
            }
        })
        .collect()
}

/// How far a tone is from its strongest bin, bins: by the ratio `r` of the larger neighbour, `(2 r - 1) / (r + 1)` for Hann's window
/// (Grandke 1983, IEEE Trans. Instrum. Meas. 32, 350).
fn between_bins(spectrum: &[(f64, f64)], k: usize) -> f64 {
    let at = |k: Option<usize>| k.and_then(|k| spectrum.get(k)).map_or(0.0, |line| line.1);
    let [below, here, above] = [at(k.checked_sub(1)), spectrum[k].1, at(Some(k + 1))];
    let r = below.max(above) / here;
    let off = ((2.0 * r - 1.0) / (r + 1.0)).clamp(0.0, 0.5);
    if above > below { off } else { -off }
}

/// The whole orders that have their frequency within a line's width.
fn orders(hz: f64, resolution: f64, turns: &[(&'static str, f64); 3]) -> Vec<String> {
    let mut named: Vec<String> = Vec::new();
    for (k, (of, turn_hz)) in turns.iter().enumerate() {
        let same = turns[..k]
            .iter()
            .any(|(_, other)| (other - turn_hz).abs() < 1e-9);
        // A line of a turn that is too slow for the record may be of any order.
        let unsure = KNOWN * resolution / turn_hz;
        if unsure >= TOLD || !unsure.is_finite() || same {
            continue;
        }
        let order = hz / turn_hz;
        let whole = order.round();
        let off = (order - whole).abs();
        if (1.0..=HIGHEST).contains(&whole) && off < unsure.max(WHOLE) {
            named.push(format!("order {whole} of {of}"));
        }
    }
    named
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tone at 12 times the screw's turn is order 12 of it; noise has no line.
    #[test]
    fn a_tone_is_named_by_its_order() {
        let point = OperatingPoint {
            velocity: 5e-3,
            base: 5.0 * TAU,
        };
        let turns = turns(point, 5e-3 / TAU);
        assert!((turns[0].1 - 6.0).abs() < 1e-9, "{turns:?}");
        let mut spectrum: Vec<(f64, f64)> = (1..1000)
            .map(|k| {
                (
                    0.5 * f64::from(k),
                    1e-3 * (1.0 + 0.5 * f64::from(k % 7) / 7.0),
                )
            })
            .collect();
        assert_eq!(lines(&spectrum, &turns), []);
        // A tone between two bins, as Hann's window shows it.
        for (bin, mm_s) in [(142, 0.3), (143, 1.0), (144, 0.7), (145, 0.1)] {
            spectrum[bin].1 = mm_s;
        }
        let found = lines(&spectrum, &turns);
        assert_eq!(found.len(), 1, "{found:?}");
        let expected = 72.0 + 0.5 * (2.0 * 0.7 - 1.0) / (0.7 + 1.0);
        assert!((found[0].hz - expected).abs() < 1e-9, "{found:?}");
        assert!(
            found[0]
                .orders
                .contains(&"order 12 of the screw".to_owned()),
            "{found:?}"
        );
    }
}
