//! Orders that a recording shows, listed or not, whole or not.
//!
//! The torque that a motor's current does not make changes its momentum: `J w / K - integral of i_q`, by what repeats with its turn.
//! Encoders against the table's scale show the errors of encoders and lead. Both are linear in the drive's coefficients, which are the same
//! at all speeds. So orders are taken one after the other, the one first that explains the most of all holds together, and all are fitted
//! together after each (orthogonal matching pursuit; Pati, Rezaiifar and Krishnaprasad, Asilomar 1993).

mod settled;

use self::settled::Settled;
use control::compensation::TORQUES;
use control::plate::{CompensationPlate, OrderPlate, TorqueOrderPlate};
use fft::Complex64;
use nalgebra::{DMatrix, DVector};
use plant::Axis;
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;

/// The lowest order that is looked for. Below it a load that changes slowly looks like one.
const ORDER_MIN: f64 = 1.0;
/// A whole order is taken unless another takes so much more of the signal.
const NOT_WHOLE: f64 = 1.2;
/// Repetitions that a hold must have of an order.
const LEAST_TURNS: f64 = 3.0;
/// How often an order is looked for ten times as closely.
const FINER: usize = 3;
/// Of the rows' rate, the fastest repetition.
const FASTEST: f64 = 0.35;
/// How often a spectrum's lines are padded.
const PADDED: usize = 4;
/// Candidates to each side of which the median is noise, and how far above it an order is none of it: one of `exp(25 ln 2)` is.
const AROUND: usize = 50;
const ABOVE_NOISE: f64 = 25.0;

/// An order that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Repetitions in a turn.
    pub order: f64,
    /// The drive's coefficient at the mean load of the recording.
    pub coefficient: Complex64,
    /// Part of it that scales with the load; `None` where the recording has one load.
    pub scales: Option<f64>,
    /// Its parts: without a load, and an ampere of load. Where the recording has one load, nothing scales.
    pub parts: Parts,
}

/// What a recording shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Orders {
    /// Torque of screw and nut, A.
    pub torque: [Vec<Found>; 2],
    /// Errors of their encoders, of the speed.
    pub angle: [Vec<Found>; 2],
    /// Errors of the lead.
    pub travel: Vec<Found>,
}

impl Orders {
    /// As orders of a drive. The phase of one that is not whole is lost with the turns at a restart: the drive learns it.
    #[must_use]
    pub fn plate(&self) -> CompensationPlate {
        let [screw, nut] = &self.torque;
        let [screw_angle, nut_angle] = &self.angle;
        CompensationPlate {
            torque: [torque_plates(screw), torque_plates(nut)],
            angle: [plates(screw_angle), plates(nut_angle)],
            travel: plates(&self.travel),
            ..CompensationPlate::NONE
        }
    }
}

fn torque_plates(found: &[Found]) -> [TorqueOrderPlate; TORQUES] {
    let mut plates = [TorqueOrderPlate::NONE; TORQUES];
    for (plate, found) in plates.iter_mut().zip(found) {
        *plate = TorqueOrderPlate::unknown(found.order);
        if found.order.fract() == 0.0 {
            let [fixed, per_ampere] = found.parts;
            (plate.re, plate.im) = (fixed.re, fixed.im);
            (plate.re_per_a, plate.im_per_a) = (per_ampere.re, per_ampere.im);
        }
    }
    plates
}

fn plates<const N: usize>(found: &[Found]) -> [OrderPlate; N] {
    let mut plates = [OrderPlate::NONE; N];
    for (plate, found) in plates.iter_mut().zip(found) {
        *plate = match found.order.fract() == 0.0 {
            true => OrderPlate {
                order: found.order,
                re: found.coefficient.re,
                im: found.coefficient.im,
            },
            false => OrderPlate::unknown(found.order),
        };
    }
    plates
}

/// How a line's coefficient shows in a signal.
#[derive(Clone, Copy)]
enum Shows {
    /// As a momentum: `c / (j order speed)`, with the other sign.
    Momentum,
    /// As a speed: `c speed`, with this sign.
    Speed(f64),
}

/// An angle that something may repeat with.
struct Coordinate {
    /// Over each hold, rad.
    angles: Vec<Vec<f64>>,
    /// Mean speed in each, rad/s.
    speeds: Vec<f64>,
    shows: Shows,
    /// Lines that a drive has room for, and the highest order.
    room: usize,
    order_max: f64,
}

impl Coordinate {
    fn new(
        angles: Vec<Vec<f64>>,
        interval_s: f64,
        shows: Shows,
        (room, order_max): (usize, f64),
    ) -> Self {
        let speed = |angle: &Vec<f64>| {
            let turned = angle[angle.len() - 1] - angle[0];
            turned / (interval_s * (angle.len() - 1) as f64)
        };
        Self {
            speeds: angles.iter().map(speed).collect(),
            angles,
            shows,
            room,
            order_max,
        }
    }

    /// Signal per coefficient in a hold; `None` where it does not show.
    fn gain(&self, hold: usize, order: f64, interval_s: f64) -> Option<Complex64> {
        let speed = self.speeds[hold];
        let turns = order * speed.abs() / TAU;
        let seconds = interval_s * self.angles[hold].len() as f64;
        let shows = turns * seconds >= LEAST_TURNS && turns * interval_s <= FASTEST;
        shows.then(|| match self.shows {
            Shows::Momentum => Complex64::i() / (order * speed),
            Shows::Speed(sign) => Complex64::from(sign * speed),
        })
    }

    /// Turns of the longest hold: orders closer than one over that are one.
    fn turns(&self) -> f64 {
        let turns = |angle: &Vec<f64>| (angle[angle.len() - 1] - angle[0]).abs() / TAU;
        self.angles.iter().map(turns).fold(0.0, f64::max)
    }
}

/// A line of a coordinate.
#[derive(Clone, Copy)]
struct Line {
    coordinate: usize,
    order: f64,
}

/// A signal in each hold, and what it may repeat with.
struct Search {
    signals: Vec<Vec<f64>>,
    coordinates: Vec<Coordinate>,
    interval_s: f64,
    /// Of the holds, where they differ.
    loads: Option<Vec<f64>>,
}

/// A line's coefficient: fixed, and per load.
pub type Parts = [Complex64; 2];

impl Search {
    /// The lines, the strongest first, with their coefficients.
    fn lines(&self) -> Vec<(Line, Parts)> {
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
            let coordinate = &self.coordinates[line.coordinate];
            for (hold, signal) in rest.iter_mut().enumerate() {
                let Some(gain) = coordinate.gain(hold, line.order, self.interval_s) else {
                    continue;
                };
                let shown = gain * (fixed + per_load * self.load(hold));
                for (value, angle) in signal.iter_mut().zip(&coordinate.angles[hold]) {
                    *value -= (shown * Complex64::cis(line.order * angle)).re;
                }
            }
        }
        rest
    }

    /// The line that takes the most of `rest`, if one is above the noise around it.
    fn strongest(&self, rest: &[Vec<f64>], known: &[Line]) -> Option<Line> {
        let spectra: Vec<Vec<Complex64>> = rest.iter().map(|signal| padded(signal)).collect();
        let mut best: Option<(f64, Line)> = None;
        for (k, coordinate) in self.coordinates.iter().enumerate() {
            let own = known.iter().filter(|line| line.coordinate == k);
            let turns = coordinate.turns();
            if own.clone().count() >= coordinate.room || turns * coordinate.order_max < LEAST_TURNS
            {
                continue;
            }
            let spacing = 0.5 / turns;
            let count = (coordinate.order_max / spacing) as usize;
            let falls: Vec<f64> = (1..=count)
                .map(|at| self.fall(coordinate, &spectra, at as f64 * spacing))
                .collect();
            for (at, &fall) in falls.iter().enumerate() {
                let order = (at + 1) as f64 * spacing;
                let taken = |line: &Line| (line.order - order).abs() < 1.5 / turns;
                let beaten = best.is_some_and(|(most, _)| most >= fall);
                if order < ORDER_MIN - spacing || beaten || own.clone().any(taken) {
                    continue;
                }
                let around = at.saturating_sub(AROUND)..(at + AROUND + 1).min(count);
                if fall > ABOVE_NOISE * median(&falls[around]) {
                    let order = self.refined(coordinate, rest, order, spacing);
                    let coordinate = k;
                    best = Some((fall, Line { coordinate, order }));
                }
            }
        }
        best.map(|(_, line)| line)
    }

    /// Fall of the sum of squares by an order, from the holds' spectra.
    fn fall(&self, coordinate: &Coordinate, spectra: &[Vec<Complex64>], order: f64) -> f64 {
        let (mut sum, mut weight) = (Complex64::default(), 0.0);
        for (hold, spectrum) in spectra.iter().enumerate() {
            let Some(gain) = coordinate.gain(hold, order, self.interval_s) else {
                continue;
            };
            let angle = &coordinate.angles[hold];
            let cycles = order * coordinate.speeds[hold] * self.interval_s / TAU;
            let bin = (cycles * spectrum.len() as f64).round() as i64;
            let line = spectrum[bin.rem_euclid(spectrum.len() as i64) as usize];
            sum += gain.conj() * line * Complex64::cis(-order * angle[0]);
            weight += gain.norm_sqr() * angle.len() as f64;
        }
        if weight > 0.0 {
            2.0 * sum.norm_sqr() / weight
        } else {
            0.0
        }
    }

    /// The order within `spacing` of `order` that takes the most; a whole one where that takes about as much.
    fn refined(&self, coordinate: &Coordinate, rest: &[Vec<f64>], order: f64, spacing: f64) -> f64 {
        let fall = |order: f64| {
            let (mut sum, mut weight) = (Complex64::default(), 0.0);
            for (hold, signal) in rest.iter().enumerate() {
                let Some(gain) = coordinate.gain(hold, order, self.interval_s) else {
                    continue;
                };
                let angles = &coordinate.angles[hold];
                for (value, angle) in signal.iter().zip(angles) {
                    sum += gain.conj() * *value * Complex64::cis(-order * angle);
                }
                weight += gain.norm_sqr() * angles.len() as f64;
            }
            sum.norm_sqr() / weight.max(f64::MIN_POSITIVE)
        };
        let (mut best, mut step) = ((fall(order), order), 0.1 * spacing);
        for _ in 0..FINER {
            let around = (-10..=10).map(|k| best.1 + step * f64::from(k));
            let falls = around.map(|order| (fall(order), order));
            best = falls.fold(best, |a, b| if b.0 > a.0 { b } else { a });
            step *= 0.1;
        }
        let whole = best.1.round().max(1.0);
        if (best.1 - whole).abs() < 2.0 * spacing && best.0 < NOT_WHOLE * fall(whole) {
            return whole;
        }
        best.1
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
            let gain = |line: &Line| {
                self.coordinates[line.coordinate].gain(hold, line.order, self.interval_s)
            };
            let gains: Vec<Option<Complex64>> = lines.iter().map(gain).collect();
            let weights = [1.0, self.load(hold)];
            let mut row = vec![0.0; columns];
            for (at, value) in signal.iter().enumerate() {
                let cells = row.chunks_exact_mut(2 * parts);
                for (cells, (line, gain)) in cells.zip(lines.iter().zip(&gains)) {
                    let Some(gain) = gain else {
                        continue;
                    };
                    let angle = self.coordinates[line.coordinate].angles[hold][at];
                    let shown = gain * Complex64::cis(line.order * angle);
                    for (pair, weight) in cells.chunks_exact_mut(2).zip(weights) {
                        (pair[0], pair[1]) = (weight * shown.re, -weight * shown.im);
                    }
                }
                for i in 0..columns {
                    right[i] += row[i] * value;
                    for j in 0..=i {
                        normal[(i, j)] += row[i] * row[j];
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

/// The orders of a recording that was made without a compensation. `model` gives inertia, flux, lead and pole pairs.
#[must_use]
pub fn orders(recording: &Recording, model: &Model) -> Orders {
    let settled = Settled::of(recording, model);
    let torque = Axis::ALL.map(|axis| {
        let search = settled.torque_search(axis);
        of_coordinate(&search, &search.lines(), 0)
    });
    let search = settled.scale_search();
    let lines = search.lines();
    let of = |k: usize| of_coordinate(&search, &lines, k);
    Orders {
        torque,
        angle: [of(0), of(1)],
        travel: of(2),
    }
}

/// The lines of one coordinate, distinguished by what of them scales with the holds' loads where these differ.
fn of_coordinate(search: &Search, lines: &[(Line, Parts)], coordinate: usize) -> Vec<Found> {
    let own = lines
        .iter()
        .filter(|(line, _)| line.coordinate == coordinate);
    let found = |(line, [fixed, per_load]): &(Line, Parts)| {
        let mean = search.loads.as_deref().map_or(0.0, mean);
        let scales = search.loads.as_ref().map(|loads| {
            let most = loads
                .iter()
                .fold(0.0, |most: f64, load| most.max(load.abs()));
            let scaled = per_load.norm() * most;
            scaled / (scaled + fixed.norm())
        });
        Found {
            order: line.order,
            coefficient: fixed + per_load * mean,
            scales,
            parts: [*fixed, *per_load],
        }
    };
    own.map(found).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The spectrum of a signal, padded with zeros.
fn padded(signal: &[f64]) -> Vec<Complex64> {
    let mut spectrum: Vec<Complex64> = signal.iter().map(|&value| value.into()).collect();
    spectrum.resize(
        (PADDED * signal.len()).next_power_of_two(),
        Complex64::default(),
    );
    fft::forward(&mut spectrum);
    spectrum
}
