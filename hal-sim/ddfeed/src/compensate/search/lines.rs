//! The lines of a signal: the strongest is taken, all are fitted together, and the next is looked for in the rest.

use super::coordinate::{Coordinate, LEAST_TURNS};
use super::tones::{Apart, Tone, is_foretold, median, padded, refined, scanned, together};
use fft::Complex64;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// The lowest order that is looked for. Below it a load that changes slowly looks like one.
const ORDER_MIN: f64 = 1.0;
/// Candidates to each side of which the median is noise, and how far above it an order is none of it: one of `exp(25 ln 2)` is.
const AROUND: usize = 50;
const ABOVE_NOISE: f64 = 25.0;
/// What repeats with an angle has one coefficient in all holds. An order must take that part of what it takes with one for each. A line off
/// the middle of its cell takes 0.81 there (`sinc(1/4)^2`). Our choice lies below.
const TOGETHER: f64 = 0.7;
/// A line that changes within a hold leaks to its sides: over so many of the hold's frequencies, and of its own fall so much. Our choices.
const BESIDE: f64 = 10.0;
const LEAKS: f64 = 0.01;
/// Of what an order takes, the part that must not lie beside a stronger line.
const BY_ITSELF: f64 = 0.3;
/// Of the table's speed: what moves it less needs no order. Our choice, a tenth of the smallest ripple of the boards.
const MOVES: f64 = 2e-4;

/// A line of a coordinate.
pub(super) struct Line {
    pub(super) coordinate: usize,
    pub(super) order: f64,
    /// Fall of the sum of squares when it was found.
    fall: f64,
    /// Signal per coefficient at each row of each hold; empty where it does not show.
    shapes: Vec<Vec<Complex64>>,
}

/// A signal in each hold, and what it may repeat with.
pub(super) struct Search {
    pub(super) signals: Vec<Vec<f64>>,
    pub(super) coordinates: Vec<Coordinate>,
    pub(super) interval_s: f64,
    /// Of the holds, where they differ.
    pub(super) loads: Option<Vec<f64>>,
    /// The signal of a speed of 1 rad/s.
    pub(super) per_speed: f64,
    /// Speed of the screw against the nut in each hold, rad/s.
    pub(super) table: Vec<f64>,
}

/// A line's coefficient: fixed, and per load.
pub type Parts = [Complex64; 2];

impl Search {
    /// The lines that move the table, the strongest first, with their coefficients.
    pub(super) fn lines(&self) -> Vec<(Line, Parts)> {
        let mut lines = self.all_lines();
        let before = lines.len();
        lines.retain(|(line, parts)| self.moves(line, parts));
        if lines.len() == before {
            return lines;
        }
        let kept: Vec<Line> = lines.into_iter().map(|(line, _)| line).collect();
        let fitted = self.fit(&kept).unwrap_or_default();
        kept.into_iter().zip(fitted).collect()
    }

    /// That a line is of the table's speed at least [`MOVES`] in a hold. One that is not whole must be more than the encoder's rounding.
    fn moves(&self, line: &Line, [fixed, per_load]: &Parts) -> bool {
        let coordinate = &self.coordinates[line.coordinate];
        self.table.iter().enumerate().any(|(hold, table)| {
            let gain = coordinate.gain(hold, line.order, self.interval_s);
            gain.is_some_and(|gain| {
                let shown = (gain * (fixed + per_load * self.load(hold))).norm();
                let speed = shown / self.per_speed;
                let rounded = line.order.fract() != 0.0
                    && !coordinate.is_above_rounding(hold, line.order, speed);
                speed > MOVES * table.abs() && !rounded
            })
        })
    }

    fn all_lines(&self) -> Vec<(Line, Parts)> {
        let mut lines: Vec<Line> = Vec::new();
        let mut coefficients = Vec::new();
        let room: usize = self.coordinates.iter().map(|one| one.room).sum();
        while lines.len() < room {
            let rest = self.rest(&lines, &coefficients);
            let Some(line) = self.strongest(&rest, &lines) else {
                break;
            };
            lines.push(line);
            let Some(fitted) = self.fit(&lines) else {
                lines.pop();
                break;
            };
            coefficients = fitted;
        }
        lines.into_iter().zip(coefficients).collect()
    }

    /// What the lines leave.
    fn rest(&self, lines: &[Line], coefficients: &[Parts]) -> Vec<Vec<f64>> {
        let mut rest = self.signals.clone();
        for (line, [fixed, per_load]) in lines.iter().zip(coefficients) {
            for (hold, signal) in rest.iter_mut().enumerate() {
                let coefficient = fixed + per_load * self.load(hold);
                for (value, shape) in signal.iter_mut().zip(&line.shapes[hold]) {
                    *value -= coefficient.re * shape.re - coefficient.im * shape.im;
                }
            }
        }
        rest
    }

    /// The line that takes the most of `rest`, if one is above the noise around it.
    fn strongest(&self, rest: &[Vec<f64>], known: &[Line]) -> Option<Line> {
        let spectra: Vec<Vec<Complex64>> = rest.iter().map(|signal| padded(signal)).collect();
        let mut best: Option<(f64, usize, f64)> = None;
        for (k, coordinate) in self.coordinates.iter().enumerate() {
            let own: Vec<&Line> = known.iter().filter(|line| line.coordinate == k).collect();
            let turns = coordinate.turns();
            if own.len() >= coordinate.room || turns * coordinate.order_max < LEAST_TURNS {
                continue;
            }
            let spacing = 0.5 / turns;
            let count = (coordinate.order_max / spacing) as usize;
            let tones = |order| self.tones(coordinate, &spectra, order);
            let apart: Vec<Apart> = (1..=count)
                .map(|at| Apart::of(&tones(at as f64 * spacing)))
                .collect();
            let mut cells: Vec<usize> = (0..count).collect();
            cells.sort_by(|&a, &b| apart[b].fall.total_cmp(&apart[a].fall));
            for at in cells {
                // Together the holds never take more than each by itself.
                if best.is_some_and(|(most, ..)| most >= apart[at].fall) {
                    break;
                }
                let order = (at + 1) as f64 * spacing;
                let taken = |own: &&Line| (own.order - order).abs() < 1.5 / turns;
                if order < ORDER_MIN - spacing || own.iter().any(taken) {
                    continue;
                }
                let around = at.saturating_sub(AROUND)..(at + AROUND + 1).min(count);
                let noise = median(apart[around].iter().map(Apart::noise));
                let least = (ABOVE_NOISE * noise).max(TOGETHER * apart[at].fall);
                let fall = |order| together(&tones(order));
                let (most, order) = scanned(order, spacing, coordinate.finest(), fall);
                if most <= least || best.is_some_and(|(before, ..)| most <= before) {
                    continue;
                }
                let tones = tones(order);
                if is_foretold(&tones) && !self.leaks(coordinate, &tones, order, most, known) {
                    best = Some((most, k, order));
                }
            }
        }
        best.map(|(fall, k, order)| self.line(rest, k, order, fall))
    }

    /// That an order which takes `fall` is what stronger lines leave beside them.
    fn leaks(
        &self,
        coordinate: &Coordinate,
        tones: &[Tone],
        order: f64,
        fall: f64,
        known: &[Line],
    ) -> bool {
        let beside = |tone: &Tone| {
            let seconds = tone.rows * self.interval_s;
            known.iter().any(|line| {
                let speed = self.coordinates[line.coordinate].speeds[tone.hold];
                let apart = order * coordinate.speeds[tone.hold].abs() - line.order * speed.abs();
                apart.abs() / TAU * seconds < BESIDE && fall < LEAKS * line.fall
            })
        };
        let of = |tones: &mut dyn Iterator<Item = &Tone>| tones.map(Tone::fall).sum::<f64>();
        let by_itself = of(&mut tones.iter().filter(|tone| !beside(tone)));
        by_itself < BY_ITSELF * of(&mut tones.iter())
    }

    /// The line near `order`, at which the rows themselves have the most.
    fn line(&self, rest: &[Vec<f64>], k: usize, order: f64, fall: f64) -> Line {
        let coordinate = &self.coordinates[k];
        let exact = |order| together(&self.exact_tones(coordinate, rest, order));
        let order = refined(order, coordinate.finest(), exact);
        let shape = |(hold, angles): (usize, &Vec<f64>)| {
            let gain = coordinate.gain(hold, order, self.interval_s);
            let of = |gain: Complex64| {
                let shapes = angles
                    .iter()
                    .map(|angle| gain * Complex64::cis(order * angle));
                shapes.collect()
            };
            gain.map(of).unwrap_or_default()
        };
        Line {
            coordinate: k,
            order,
            fall,
            shapes: coordinate.angles.iter().enumerate().map(shape).collect(),
        }
    }

    /// What an order has in each hold, from the holds' spectra.
    fn tones(&self, coordinate: &Coordinate, spectra: &[Vec<Complex64>], order: f64) -> Vec<Tone> {
        let one = |(hold, spectrum): (usize, &Vec<Complex64>)| {
            let gain = coordinate.gain(hold, order, self.interval_s)?;
            let angle = &coordinate.angles[hold];
            let length = spectrum.len() as f64;
            let bins = order * coordinate.speeds[hold] * self.interval_s / TAU * length;
            let bin = bins.round();
            let line = spectrum[(bin as i64).rem_euclid(spectrum.len() as i64) as usize];
            // The nearest bin has the phase of the hold's middle.
            let middle = 0.5 * angle.len() as f64 * TAU * (bins - bin) / length;
            Some(Tone {
                hold,
                gain,
                sum: line * Complex64::cis(-order * angle[0] - middle),
                rows: angle.len() as f64,
                load: self.load(hold),
            })
        };
        spectra.iter().enumerate().filter_map(one).collect()
    }

    /// The same from the rows' angles.
    fn exact_tones(&self, coordinate: &Coordinate, rest: &[Vec<f64>], order: f64) -> Vec<Tone> {
        let one = |(hold, signal): (usize, &Vec<f64>)| {
            let gain = coordinate.gain(hold, order, self.interval_s)?;
            let angles = &coordinate.angles[hold];
            let shares = signal.iter().zip(angles);
            Some(Tone {
                hold,
                gain,
                sum: shares
                    .map(|(value, angle)| *value * Complex64::cis(-order * angle))
                    .sum(),
                rows: angles.len() as f64,
                load: self.load(hold),
            })
        };
        rest.iter().enumerate().filter_map(one).collect()
    }

    /// The load of a hold; 0 where all have the same.
    fn load(&self, hold: usize) -> f64 {
        self.loads.as_ref().map_or(0.0, |loads| loads[hold])
    }

    /// All lines together by least squares.
    fn fit(&self, lines: &[Line]) -> Option<Vec<Parts>> {
        let parts = if self.loads.is_some() { 2 } else { 1 };
        let columns = 2 * parts * lines.len();
        let mut normal = DMatrix::<f64>::zeros(columns, columns);
        let mut right = DVector::<f64>::zeros(columns);
        for (hold, signal) in self.signals.iter().enumerate() {
            let weights = [1.0, self.load(hold)];
            for (i, line) in lines.iter().enumerate() {
                let own = products(&line.shapes[hold], signal.iter().map(|&value| value.into()));
                for (a, weight) in weights.iter().enumerate().take(parts) {
                    let row = 2 * (parts * i + a);
                    right[row] += weight * own[0][0];
                    right[row + 1] += weight * own[1][0];
                }
                for (j, other) in lines.iter().enumerate().take(i + 1) {
                    let both = products(&line.shapes[hold], other.shapes[hold].iter().copied());
                    for (a, b) in (0..parts).flat_map(|a| (0..parts).map(move |b| (a, b))) {
                        let (row, column) = (2 * (parts * i + a), 2 * (parts * j + b));
                        for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                            normal[(row + r, column + c)] += weights[a] * weights[b] * both[r][c];
                        }
                    }
                }
            }
        }
        let solved = normal.cholesky()?.solve(&right);
        let of_line = |cells: &[f64]| {
            let mut pairs = cells.chunks_exact(2);
            let mut next = || {
                pairs
                    .next()
                    .map_or(Complex64::default(), |x| Complex64::new(x[0], x[1]))
            };
            [next(), next()]
        };
        Some(
            solved
                .as_slice()
                .chunks_exact(2 * parts)
                .map(of_line)
                .collect(),
        )
    }
}

/// Sums of products of two shapes' columns over a hold: the real part, and the imaginary one with the other sign.
fn products(one: &[Complex64], other: impl Iterator<Item = Complex64>) -> [[f64; 2]; 2] {
    let mut sums = [[0.0; 2]; 2];
    for (a, b) in one.iter().zip(other) {
        sums[0][0] += a.re * b.re;
        sums[0][1] -= a.re * b.im;
        sums[1][0] -= a.im * b.re;
        sums[1][1] += a.im * b.im;
    }
    sums
}
