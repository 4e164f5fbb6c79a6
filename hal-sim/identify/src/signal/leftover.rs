//! What of a residual no hypothesis explains, and what it looks like: over which coordinate it has a shape, at which
//! order, how large. It names no cause.

use crate::regression::column::counted;
use crate::signal::scan::{OrderSpectrum, Stretch};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Pieces of a curve over a coordinate.
const PIECES: usize = 40;
/// Share of an interval at which the golden section divides it, and how often: an order is then known to a hundredth of what tells two apart.
const GOLDEN: f64 = 0.618_033_988_749_895;
const SECTIONS: usize = 9;
/// Rows that a piece needs to count.
const LEAST_ROWS: f64 = 8.0;

/// What a shape is looked for over.
pub struct Over<'a> {
    /// Value at each row; an angle in rad.
    pub values: &'a [f64],
    /// What kind of shape.
    pub form: Form,
    /// What a shape is multiplied with in each row, if with something.
    pub factors: Option<&'a [f64]>,
}

impl<'a> Over<'a> {
    /// What repeats with an angle.
    pub fn angle(values: &'a [f64], orders: Range<f64>) -> Self {
        Over {
            values,
            form: Form::Repeats(orders),
            factors: None,
        }
    }

    fn factor(&self, row: usize) -> f64 {
        self.factors.map_or(1.0, |factors| factors[row])
    }
}

/// Kind of a shape.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// A harmonic over an angle, of an order per turn within a range. Of `TAU` times a time the order is a frequency.
    Repeats(Range<f64>),
    /// A mean that differs from place to place.
    Curve,
}

/// A residual, even in time.
#[derive(Clone, Copy)]
pub struct Residual<'a> {
    /// Its rows; 0 where they do not count.
    pub values: &'a [f64],
    /// Which rows count.
    pub open: &'a [bool],
    /// Rows a second.
    pub rate: f64,
}

/// The shape that a residual has over a coordinate.
#[derive(Debug, Clone)]
pub struct Shape {
    /// By how much the residual's sum of squares falls without it.
    pub fall: f64,
    /// Order per turn, of what repeats.
    pub order: Option<f64>,
    /// Its mean from place to place, of a curve.
    curve: Option<Curve>,
}

#[derive(Debug, Clone)]
struct Curve {
    low: f64,
    width: f64,
    means: Vec<f64>,
}

impl Curve {
    fn piece(&self, value: f64) -> Option<usize> {
        let piece = ((value - self.low) / self.width).floor();
        (piece >= 0.0 && piece < self.means.len() as f64).then_some(piece as usize)
    }
}

impl Residual<'_> {
    /// Rows that count, with a coordinate's value, the factor and theirs.
    fn rows(&self, over: &Over) -> impl Iterator<Item = (f64, f64, f64)> {
        let rows = (0..self.values.len()).filter(|row| self.open[*row]);
        rows.map(|row| (over.values[row], over.factor(row), self.values[row]))
    }

    /// The shape over a coordinate that explains most; `None` where the coordinate does not move.
    pub fn shape(&self, over: &Over) -> Option<Shape> {
        match &over.form {
            Form::Repeats(orders) => self.harmonic(over, orders.clone()),
            Form::Curve => self.curve(over),
        }
    }

    /// What repeats with an angle, at every order at once.
    pub fn orders(&self, over: &Over, orders: Range<f64>) -> OrderSpectrum {
        let stretches = stretches(over.values, self.rate);
        let squares = |s: &Stretch| {
            let open = s.rows.clone().filter(|row| self.open[*row]);
            open.map(|row| over.factor(row).powi(2)).sum()
        };
        let squares: Vec<f64> = stretches.iter().map(squares).collect();
        let weight = |stretch: usize, _: f64| squares[stretch];
        let score = self.values.iter().enumerate();
        let score: Vec<f64> = score.map(|(row, x)| over.factor(row) * x).collect();
        let nyquist = 0.5 * self.rate;
        OrderSpectrum::new(&score, over.values, &stretches, &weight, nyquist, orders)
    }

    fn harmonic(&self, over: &Over, orders: Range<f64>) -> Option<Shape> {
        let spectrum = self.orders(over, orders);
        let order = *spectrum.peaks(1, 0.0).first()?;
        Some(Shape {
            fall: self.power(over, order),
            order: Some(order),
            curve: None,
        })
    }

    /// Fall of the sum of squares that a harmonic of one order brings.
    fn power(&self, over: &Over, order: f64) -> f64 {
        let (c, s, n) = self.sums(over, order);
        2.0 * (c * c + s * s) / f64::max(n, f64::MIN_POSITIVE)
    }

    /// Products with cosine and sine of an order, and the factors' sum of squares.
    fn sums(&self, over: &Over, order: f64) -> (f64, f64, f64) {
        let rows = (0..self.values.len()).filter(|&row| self.open[row] && shown(over, order, row));
        rows.fold((0.0, 0.0, 0.0), |(c, s, n), row| {
            let (sin, cos) = (order * over.values[row]).sin_cos();
            let factor = over.factor(row);
            let x = factor * self.values[row];
            (c + x * cos, s + x * sin, n + factor * factor)
        })
    }

    fn curve(&self, over: &Over) -> Option<Shape> {
        let (low, high) = self
            .rows(over)
            .fold((f64::MAX, f64::MIN), |(a, b), (at, ..)| {
                (a.min(at), b.max(at))
            });
        if low >= high {
            return None;
        }
        let mut curve = Curve {
            low,
            // The greatest value belongs to the last piece.
            width: (high - low) * (1.0 + 1e-9) / PIECES as f64,
            means: vec![0.0; PIECES],
        };
        let mut squares = vec![0.0; PIECES];
        for (at, factor, value) in self.rows(over) {
            if let Some(piece) = curve.piece(at) {
                curve.means[piece] += factor * value;
                squares[piece] += factor * factor;
            }
        }
        // Rows count by the factor's square in its mean.
        let least = LEAST_ROWS * squares.iter().sum::<f64>() / counted(self.open) as f64;
        let mut fall = 0.0;
        for (mean, square) in curve.means.iter_mut().zip(squares) {
            *mean = match square > 0.0 && square >= least {
                true => *mean / square,
                false => 0.0,
            };
            fall += square * *mean * *mean;
        }
        Some(Shape {
            fall,
            order: None,
            curve: Some(curve),
        })
    }

    /// Fall of this residual's sum of squares by a shape that another one has: a curve as it is there, a harmonic of that
    /// order with whatever phase.
    pub fn bears_out(&self, over: &Over, shape: &Shape) -> f64 {
        match (&shape.curve, shape.order) {
            (Some(curve), _) => self
                .rows(over)
                .filter_map(|(at, factor, value)| {
                    Some((factor * curve.means[curve.piece(at)?], value))
                })
                .map(|(shape, value)| shape * (2.0 * value - shape))
                .sum(),
            (None, Some(order)) => self.power(over, order),
            (None, None) => 0.0,
        }
    }

    /// The shape with its order between two of the spectrum's, where it explains most.
    pub fn sharpened(&self, over: &Over, shape: Shape) -> Shape {
        let Some(order) = shape.order.map(|order| self.sharpest(over, order)) else {
            return shape;
        };
        Shape {
            fall: self.power(over, order),
            order: Some(order),
            ..shape
        }
    }

    /// The order about one of the spectrum's at which a harmonic explains most.
    pub fn sharpest(&self, over: &Over, order: f64) -> f64 {
        let (low, high) = (over.values.iter()).fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(*x), high.max(*x))
        });
        // Half the distance at which two orders are distinguished: within it there is one peak.
        let reach = 0.25 * TAU / (high - low);
        // By the golden section: of the two orders inside one serves again.
        let at = |from: f64, to: f64| from + GOLDEN * (to - from);
        let (mut from, mut to) = (order - reach, order + reach);
        let [mut low, mut high] = [at(to, from), at(from, to)].map(|x| (self.power(over, x), x));
        for _ in 0..SECTIONS {
            if low.0 < high.0 {
                (from, low) = (low.1, high);
                high = (self.power(over, at(from, to)), at(from, to));
            } else {
                (to, high) = (high.1, low);
                low = (self.power(over, at(to, from)), at(to, from));
            }
        }
        0.5 * (from + to)
    }

    /// The residual without a shape: a curve as the shape has it, a harmonic with this residual's own phase.
    pub fn without(&self, over: &Over, shape: &Shape) -> Vec<f64> {
        let mut left = self.values.to_vec();
        let open = (0..left.len()).filter(|row| self.open[*row]);
        if let Some(curve) = &shape.curve {
            for row in open {
                let piece = curve.piece(over.values[row]);
                left[row] -= piece.map_or(0.0, |piece| over.factor(row) * curve.means[piece]);
            }
        } else if let Some(order) = shape.order {
            let (c, s, n) = self.sums(over, order);
            for row in open.filter(|row| shown(over, order, *row)) {
                let (sin, cos) = (order * over.values[row]).sin_cos();
                left[row] -= 2.0 / n * over.factor(row) * (c * cos + s * sin);
            }
        }
        left
    }

    /// Rms of a shape of the given order, or of the curve, in this residual.
    pub fn size(&self, over: &Over, shape: &Shape) -> f64 {
        let fall = match shape.order {
            Some(order) => self.power(over, order),
            None => self.curve(over).map_or(0.0, |own| own.fall),
        };
        let rows = counted(self.open);
        (fall / rows.max(1) as f64).sqrt()
    }
}

/// Whether a row is slow enough to show an order: above half a period from row to row it would show a lower one.
fn shown(over: &Over, order: f64, row: usize) -> bool {
    let from = row.min(over.values.len().saturating_sub(2));
    let step = over.values[from + 1] - over.values[from];
    order * step.abs() < PI
}

/// Rows of about one speed of an angle, its upper end given: faster ones show high orders mirrored.
fn stretches(angle: &[f64], rate: f64) -> Vec<Stretch> {
    const BLOCK: usize = 64;
    let mut list: Vec<Stretch> = Vec::new();
    for start in (0..angle.len()).step_by(BLOCK) {
        let end = (start + BLOCK).min(angle.len());
        let fastest = angle[start..end].windows(2).fold(1e-3, |most: f64, pair| {
            most.max((pair[1] - pair[0]).abs() * rate)
        });
        // Four steps an octave: stretches of one step share a transform.
        let speed = ((4.0 * fastest.log2()).ceil() / 4.0).exp2();
        match list.last_mut() {
            Some(stretch) if stretch.speed == speed => stretch.rows.end = end,
            _ => list.push(Stretch {
                rows: start..end,
                speed,
            }),
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const ROWS: usize = 8000;
    const RATE: f64 = 1000.0;

    fn noise(seed: u64) -> Vec<f64> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        // Of variance 1.
        (0..ROWS)
            .map(|_| 12f64.sqrt() * (rng.random::<f64>() - 0.5))
            .collect()
    }

    /// An angle that goes at two speeds, and a position that goes forth and back.
    fn coordinates() -> (Vec<f64>, Vec<f64>) {
        let mut angle = vec![0.3];
        for row in 1..ROWS {
            let speed = if row < ROWS / 2 { 30.0 } else { 170.0 };
            angle.push(angle[row - 1] + speed / RATE);
        }
        let position = (0..ROWS).map(|row| (row as f64 * 1e-3).sin()).collect();
        (angle, position)
    }

    fn looked(values: &[f64], check: &[f64]) -> Vec<(Shape, f64, f64)> {
        let open = vec![true; ROWS];
        let of = |values| Residual {
            values,
            open: &open,
            rate: RATE,
        };
        let (angle, position) = coordinates();
        let over = [
            Over {
                values: &angle,
                form: Form::Repeats(0.3..60.0),
                factors: None,
            },
            Over {
                values: &position,
                form: Form::Curve,
                factors: None,
            },
        ];
        over.iter()
            .map(|over| {
                let shape = of(values).shape(over).expect("it moves");
                let check = of(check).bears_out(over, &shape);
                let size = of(values).size(over, &shape);
                (shape, check, size)
            })
            .collect()
    }

    #[test]
    fn a_wave_over_an_angle_is_told_by_its_order() {
        let (angle, _) = coordinates();
        let with = |seed| -> Vec<f64> {
            let wave = angle.iter().map(|a| 0.3 * (17.3 * a + 0.2).cos());
            wave.zip(noise(seed)).map(|(w, n)| w + n).collect()
        };
        let looks = looked(&with(1), &with(2));
        let (shape, check, size) = &looks[0];
        assert!((shape.order.unwrap() - 17.3).abs() < 0.01, "{shape:?}");
        let expected = ROWS as f64 * 0.3 * 0.3 / 2.0;
        assert!((shape.fall / expected - 1.0).abs() < 0.3);
        assert!((check / expected - 1.0).abs() < 0.3);
        assert!((size / (0.3 / 2f64.sqrt()) - 1.0).abs() < 0.2);
        assert!(looks[1].0.fall < 0.3 * shape.fall);
    }

    #[test]
    fn a_bump_over_a_position_is_told_by_the_position() {
        let (_, position) = coordinates();
        let with = |seed| -> Vec<f64> {
            let bump = position
                .iter()
                .map(|x| 2.0 * f64::from((0.4..0.5).contains(x)));
            bump.zip(noise(seed)).map(|(b, n)| b + n).collect()
        };
        let looks = looked(&with(3), &with(4));
        assert!(looks[1].0.fall > 3.0 * looks[0].0.fall && looks[1].0.order.is_none());
        assert!(looks[1].1 > 0.7 * looks[1].0.fall);
    }

    #[test]
    fn noise_has_no_shape_that_another_record_bears_out() {
        for (shape, check, _) in looked(&noise(5), &noise(6)) {
            // The greatest of thousands of exponentially distributed powers, and forty means.
            assert!(shape.fall < 70.0 && check < 20.0, "{shape:?} {check}");
        }
    }
}
