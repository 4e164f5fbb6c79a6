//! Where the power of an encoder's rounding lies over frequency.
//!
//! A shaft that turns at `w` rad/s crosses `N w / 2 pi` counts a second. The rounding of its angle is a saw tooth of that
//! frequency. Its harmonic `k` holds the power `lsb^2 / (2 pi^2 k^2)` (Fourier series of the saw tooth). A record folds each
//! harmonic at half its rate. At an even speed the rounding is thus a few lines, and white noise only where the speed
//! spreads them (Widrow and Kollar, *Quantization Noise*, 2008). A speed that waves puts side lines around them, as frequency
//! modulation does. Counting the smooth motion once more shows those. It cannot show a line that is slow enough to be part of
//! the smooth motion, which the speeds show.

use crate::signal::fourier::{EDGE, Fourier};
use crate::signal::quantile::quantile_of_sizes;
use crate::signal::recount::{PHASES, saw_tooth};
use std::f64::consts::{PI, TAU};

/// Harmonics of the saw tooth that are followed: they hold 93 % of its power. The rest counts as white.
const HARMONICS: usize = 8;
/// Half the width of a line of an even speed in a hold of half a second, Hz: a hold of `T` seconds leaks as a Lorentzian of the half width
/// `1 / (2 pi T)` does.
const LINE_HZ: f64 = 0.3;
/// Width of a cell of the sum over rows, Hz.
const CELL_HZ: f64 = 0.25;
/// How far a line's skirt is followed, half widths: beyond it 1 % of its power is left.
const SKIRT: f64 = 60.0;

/// Bandwidth of the speeds that say where a line is, Hz.
const EVEN_HZ: f64 = 20.0;
/// Bandwidths of speeds without a line, Hz: a line that is among them would smear itself. They are close together, as a speed's ripple that
/// is left out moves the line. The last says where the line is, beside [`WINDOWS_S`].
const BELOW_HZ: [f64; 16] = [
    200.0, 140.0, 100.0, 70.0, 50.0, 35.0, 26.0, EVEN_HZ, 14.0, 10.0, 7.0, 5.0, 3.5, 2.5, 1.7, 1.2,
];
/// Widths of the windows whose mean speeds also say where a line is, s: the slowest speeds of a hold know those before and after it.
const WINDOWS_S: [f64; 2] = [0.2, 0.8];
/// Harmonics of the saw tooth that are kept out of the speeds: the next has a fiftieth of its power.
const KEPT_OUT: usize = 4;

/// Density of the angle's rounding over the bins of a spectrum, rad^2: the variance of white noise at that level.
/// `omega` is the smooth speed in every row, rad/s; `rate` the rows per second; `counts` those of one turn.
pub(crate) fn density(omega: &[f64], rate: f64, counts: u32, fourier: &Fourier) -> Vec<f64> {
    let [smooth, even] = without_lines(omega, rate, counts, fourier);
    let ripple = smooth.iter().zip(&even).map(|(w, e)| w - e);
    let half_width = LINE_HZ + f64::from(counts) * quantile_of_sizes(ripple, 0.5) / TAU;
    let by_speed = by_speed(&even, rate, counts, fourier, half_width);
    let counted = counted_again(&smooth, rate, counts, fourier);
    let pairs = by_speed.iter().zip(&counted);
    pairs.map(|(speed, counted)| speed.max(*counted)).collect()
}

/// The speeds, and those to [`EVEN_HZ`], each to a bandwidth in each row that the lines of the rounding are above.
fn without_lines(omega: &[f64], rate: f64, counts: u32, fourier: &Fourier) -> [Vec<f64>; 2] {
    let spectrum = fourier.spectrum(omega);
    let below = BELOW_HZ.map(|hz| fourier.low_pass_of(&spectrum, hz));
    let slowest = BELOW_HZ.len() - 1;
    let even = BELOW_HZ.iter().position(|hz| *hz == EVEN_HZ);
    let even = even.unwrap_or(slowest);
    let means = WINDOWS_S.map(|seconds| means(omega, (seconds * rate) as usize));
    let rows = below[slowest].iter().enumerate().map(|(row, slow)| {
        let speeds = means.iter().map(|means| means[row]).chain([*slow]);
        let lines = speeds.flat_map(|speed| {
            let crossed = f64::from(counts) * speed.abs() / TAU;
            (1..=KEPT_OUT).map(move |k| folded(k as f64 * crossed, rate))
        });
        let line = lines.fold(f64::INFINITY, f64::min);
        let is_below = |hz: &f64| EDGE * hz < line;
        let own = BELOW_HZ.iter().position(is_below).unwrap_or(slowest);
        (below[own][row], below[even.max(own)][row])
    });
    let (smooth, even) = rows.unzip();
    [smooth, even]
}

/// Mean over as many rows as lie around each row, fewer at the ends.
fn means(values: &[f64], rows: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(values.iter().map(|value| {
            sum += value;
            sum
        }))
        .collect();
    let around = |row: usize| {
        let from = row.saturating_sub(rows / 2);
        let to = (row + rows / 2 + 1).min(values.len());
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..values.len()).map(around).collect()
}

/// Where a record of a rate has a wave of a frequency, Hz.
fn folded(hz: f64, rate: f64) -> f64 {
    let turned = hz % rate;
    turned.min(rate - turned)
}

/// The density by the rounding of a motion that is counted once more.
fn counted_again(omega: &[f64], rate: f64, counts: u32, fourier: &Fourier) -> Vec<f64> {
    let lsb = TAU / f64::from(counts);
    let rows = omega.len().max(1) as f64;
    let cells = (fourier.hz(fourier.bins()) / CELL_HZ).ceil() as usize;
    let (mut power, mut bins) = (vec![0.0; cells], vec![0.0; cells]);
    let cell = |bin: usize| ((fourier.hz(bin) / CELL_HZ) as usize).min(cells - 1);
    for phase in PHASES {
        let mut turned = phase;
        let error = omega.iter().map(|speed| {
            turned += speed / (rate * lsb);
            lsb * saw_tooth(turned)
        });
        let mut error: Vec<f64> = error.collect();
        let mean = error.iter().sum::<f64>() / rows;
        error.iter_mut().for_each(|x| *x -= mean);
        let spectrum = fourier.spectrum(&error);
        for (bin, value) in spectrum.iter().enumerate() {
            power[cell(bin)] += value.norm_sqr() / rows / PHASES.len() as f64;
            bins[cell(bin)] += 1.0 / PHASES.len() as f64;
        }
    }
    let density: Vec<f64> = power
        .iter()
        .zip(&bins)
        .map(|(p, n): (&f64, &f64)| p / n.max(1.0))
        .collect();
    (0..fourier.bins()).map(|bin| density[cell(bin)]).collect()
}

/// The density by the speeds. The ripple of a speed spreads a line over `half_width`, Hz.
fn by_speed(omega: &[f64], rate: f64, counts: u32, fourier: &Fourier, half_width: f64) -> Vec<f64> {
    let cell_hz = (0.8 * half_width).min(0.01 * rate).max(CELL_HZ);
    let lsb = TAU / f64::from(counts);
    let variance = lsb * lsb / 12.0;
    let cells = (0.5 * rate / cell_hz).ceil() as usize;
    let mut power = vec![0.0; cells];
    let mut white = omega.len() as f64 * variance;
    let of_harmonic: [f64; HARMONICS] =
        std::array::from_fn(|k| lsb * lsb / (2.0 * PI * PI * ((k + 1) as f64).powi(2)));
    for speed in omega {
        let crossed = f64::from(counts) * speed.abs() / TAU;
        // A shaft that rests, or crosses less than a count in a line's width, has no line.
        if crossed < LINE_HZ {
            continue;
        }
        for (k, held) in of_harmonic.iter().enumerate() {
            let cell = (folded((k + 1) as f64 * crossed, rate) / cell_hz) as usize;
            power[cell.min(cells - 1)] += held;
            white -= held;
        }
    }
    let rows = omega.len().max(1) as f64;
    // White noise of variance 1 has 1 / cells of it in each.
    let scale = cells as f64 / rows;
    let lines = spread(&power, half_width / cell_hz);
    (0..fourier.bins())
        .map(|bin| {
            let cell = (fourier.hz(bin) / cell_hz) as usize;
            white / rows + scale * lines[cell.min(cells - 1)]
        })
        .collect()
}

/// Power over cells, each spread over its neighbours as a Lorentzian of a half width in cells; what reaches past an end folds back.
fn spread(power: &[f64], half_width: f64) -> Vec<f64> {
    let last = power.len() as isize - 1;
    let skirt = ((SKIRT * half_width) as isize).max(1).min(last);
    let shape = |cell: isize| 1.0 / (1.0 + (cell as f64 / half_width).powi(2));
    let whole: f64 = (-skirt..=skirt).map(shape).sum();
    let mut spread = vec![0.0; power.len()];
    for (cell, held) in power.iter().enumerate().filter(|(_, held)| **held > 0.0) {
        for away in -skirt..=skirt {
            let at = (cell as isize + away).abs();
            let at = if at > last { 2 * last - at } else { at };
            spread[at.clamp(0, last) as usize] += held * shape(away) / whole;
        }
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fourier::slope;

    const RATE: f64 = 5000.0;
    const ROWS: usize = 30_000;
    const BAND_HZ: f64 = 20.0;

    /// Power of the rounding in bands of [`BAND_HZ`] by the density, and that of angles that are counted, rad^2.
    fn bands(speed: impl Fn(f64) -> f64, counts: u32) -> Vec<[f64; 2]> {
        let fourier = Fourier::new(ROWS, RATE, 1, 0);
        let omega: Vec<f64> = (0..ROWS).map(|k| speed(k as f64 / RATE)).collect();
        let lsb = TAU / f64::from(counts);
        let mut angle = 0.1234;
        let travel: Vec<f64> = omega
            .iter()
            .map(|w| {
                angle += w / RATE;
                angle
            })
            .collect();
        let error: Vec<f64> = travel
            .iter()
            .map(|angle| (angle / lsb).floor() * lsb + 0.5 * lsb - angle)
            .collect();
        let spectrum = fourier.spectrum(&error);
        let density = {
            let counted: Vec<f64> = travel.iter().zip(&error).map(|(a, e)| a + e).collect();
            let measured = fourier.low_pass(&slope(&counted, RATE), 200.0);
            density(&measured, RATE, counts, &fourier)
        };
        let width = (BAND_HZ / fourier.hz(1)) as usize;
        spectrum
            .chunks(width)
            .zip(density.chunks(width))
            .map(|(measured, told)| {
                let measured: f64 = measured.iter().map(|c| c.norm_sqr()).sum();
                [
                    told.iter().sum::<f64>() / (0.5 * ROWS as f64),
                    2.0 * measured / (ROWS as f64).powi(2),
                ]
            })
            .collect()
    }

    /// Of a record that is slow, or short, too: a rate below the width of all lines is white.
    #[test]
    fn any_rate_has_a_density() {
        for (rate, rows) in [(0.1, 3), (5.0, 40), (24.0, 200), (1e5, 4)] {
            let fourier = Fourier::new(rows, rate, 1, 0);
            let omega: Vec<f64> = (0..rows).map(|k| 0.3 * k as f64).collect();
            let density = density(&omega, rate, 4000, &fourier);
            assert_eq!(density.len(), fourier.bins());
            assert!(
                density.iter().all(|d| d.is_finite() && *d >= 0.0),
                "{rate} Hz: {density:?}"
            );
        }
    }

    /// Shafts at an even speed, at one that folds to 0 Hz, and at one that waves. The density holds the power of counted angles where it
    /// is. In each band with a fifth of that it is within a factor of three. Over all bands it is at most 2.1 times it.
    #[test]
    fn the_density_is_where_counted_angles_have_their_power() {
        type Speed = fn(f64) -> f64;
        let cases: [(&str, u32, Speed); 8] = [
            ("even", 131_072, |_| 54.66),
            ("slow", 4000, |_| 0.37),
            ("waves", 131_072, |t| 40.0 + 0.02 * (TAU * 7.0 * t).sin()),
            ("ramp", 4000, |t| 3.0 + 2.0 * t),
            ("a line at 98 Hz", 4096, |_| 6.0196 * RATE * TAU / 4096.0),
            ("a line at 27 Hz", 4096, |_| 31.9946 * RATE * TAU / 4096.0),
            ("a line at 8 Hz", 4096, |_| 18.0016 * RATE * TAU / 4096.0),
            ("a line at 88 Hz in short holds", 4096, |t| {
                let moves = (TAU * t / 1.5).sin() - 0.5;
                8.0176 * RATE * TAU / 4096.0 + 200.0 * moves.max(0.0)
            }),
        ];
        for (name, counts, speed) in cases {
            let bands = bands(speed, counts);
            let sums: [f64; 2] = [0, 1].map(|k| bands.iter().map(|band| band[k]).sum());
            assert!(
                (0.9..2.1).contains(&(sums[0] / sums[1])),
                "{name}: {sums:?} rad^2 in all"
            );
            for (k, [told, measured]) in bands.iter().enumerate() {
                if told.max(*measured) > 0.2 * sums[1] {
                    assert!(
                        (0.33..3.0).contains(&(told / measured)),
                        "{name} at {} Hz: {told:e} for {measured:e} rad^2",
                        BAND_HZ * k as f64
                    );
                }
            }
        }
    }
}
