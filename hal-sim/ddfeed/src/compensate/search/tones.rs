//! What an order takes of the holds' signals: each with its own coefficient, and all with one.

use fft::Complex64;

/// A whole order is taken unless another takes so much more of the signal.
const NOT_WHOLE: f64 = 2.0;
/// How often an order that is not whole is looked for ten times as closely.
const FINER: usize = 2;
/// What a hold has of an order may differ by this part from what the other holds foretell. Near a resonance it differs. Our choice.
const FORETOLD: f64 = 0.7;
/// Of the loads' sum of squares, the part about their mean from which a line over the load is drawn.
const LOADS_DIFFER: f64 = 1e-4;
/// How often a spectrum's lines are padded.
const PADDED: usize = 4;

/// What an order has in a hold.
pub(super) struct Tone {
    pub(super) hold: usize,
    /// Signal per coefficient.
    pub(super) gain: Complex64,
    /// Of the signal times the order's turned-back angle.
    pub(super) sum: Complex64,
    pub(super) rows: f64,
    pub(super) load: f64,
}

impl Tone {
    /// Fall of the hold's sum of squares by a coefficient of its own.
    pub(super) fn fall(&self) -> f64 {
        2.0 * self.sum.norm_sqr() / self.rows
    }
}

/// Fall of the sum of squares by an order that has another coefficient in each hold.
pub(super) struct Apart {
    pub(super) fall: f64,
    holds: usize,
}

impl Apart {
    pub(super) fn of(tones: &[Tone]) -> Self {
        Self {
            fall: tones.iter().map(Tone::fall).sum(),
            holds: tones.len(),
        }
    }

    /// What noise alone takes with one coefficient for all holds.
    pub(super) fn noise(&self) -> f64 {
        self.fall / self.holds.max(1) as f64
    }
}

/// The coefficient that holds share, or the straight line over the load that they share: least squares.
struct Shared {
    /// Sums of weights, and of weights times the load's distance from its mean, squared.
    square: f64,
    spread: f64,
    /// Mean load.
    load: f64,
    /// Sums of what the holds have of the coefficient, and of that times that distance.
    sum: Complex64,
    sloped: Complex64,
}

impl Shared {
    /// `None` where no hold shows the order.
    fn of<'a>(tones: impl Iterator<Item = &'a Tone>) -> Option<Self> {
        let (mut square, mut moment, mut moments) = (0.0, 0.0, 0.0);
        let (mut sum, mut loaded) = (Complex64::default(), Complex64::default());
        for tone in tones {
            let weight = tone.gain.norm_sqr() * tone.rows;
            let share = tone.gain.conj() * tone.sum;
            square += weight;
            moment += weight * tone.load;
            moments += weight * tone.load * tone.load;
            sum += share;
            loaded += share * tone.load;
        }
        if square <= 0.0 {
            return None;
        }
        let load = moment / square;
        let spread = moments - moment * load;
        // Loads that hardly differ say nothing of what scales with them.
        let differ = spread > LOADS_DIFFER * moments;
        Some(Self {
            square,
            spread: if differ { spread } else { f64::INFINITY },
            load,
            sum,
            sloped: loaded - sum * load,
        })
    }

    /// Fall of the sum of squares.
    fn fall(&self) -> f64 {
        2.0 * (self.sum.norm_sqr() / self.square + self.sloped.norm_sqr() / self.spread)
    }

    /// The coefficient at a load.
    fn coefficient(&self, load: f64) -> Complex64 {
        self.sum / self.square + self.sloped * ((load - self.load) / self.spread)
    }
}

/// Fall of the sum of squares by an order whose coefficient all holds share, or the line over the load that they share.
pub(super) fn together(tones: &[Tone]) -> f64 {
    Shared::of(tones.iter()).map_or(0.0, |shared| shared.fall())
}

/// That the other holds foretell the hold that shows the most. Otherwise something repeats there that is no order.
pub(super) fn is_foretold(tones: &[Tone]) -> bool {
    let most = tones.iter().max_by(|a, b| a.fall().total_cmp(&b.fall()));
    most.is_some_and(|most| {
        let others = tones.iter().filter(|tone| tone.hold != most.hold);
        Shared::of(others).is_some_and(|others| {
            let foretold = most.gain * others.coefficient(most.load) * most.rows;
            (foretold - most.sum).norm() < FORETOLD * most.sum.norm()
        })
    })
}

/// The most that `fall` has within `spacing` of `order`, and where. A whole order is taken if it takes about as much.
pub(super) fn scanned(
    order: f64,
    spacing: f64,
    step: f64,
    fall: impl Fn(f64) -> f64,
) -> (f64, f64) {
    let steps = (spacing / step).ceil() as i64;
    let around = (-steps..=steps).map(|k| order + k as f64 * step);
    let of = |order: f64| (fall(order), order);
    let best = around
        .map(of)
        .fold((0.0, order), |a, b| if b.0 > a.0 { b } else { a });
    let whole = order.round().max(1.0);
    if (whole - order).abs() <= 2.0 * spacing && best.0 < NOT_WHOLE * fall(whole) {
        return (fall(whole), whole);
    }
    best
}

/// The order within `step` of `order` at which `fall` is the largest; a whole one as it is.
pub(super) fn refined(order: f64, step: f64, fall: impl Fn(f64) -> f64) -> f64 {
    if order.fract() == 0.0 {
        return order;
    }
    let (mut best, mut step) = ((fall(order), order), 0.1 * step);
    for _ in 0..FINER {
        let around = (-10..=10).map(|k| best.1 + step * f64::from(k));
        let falls = around.map(|order| (fall(order), order));
        best = falls.fold(best, |a, b| if b.0 > a.0 { b } else { a });
        step *= 0.1;
    }
    best.1
}

pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    let middle = sorted.len() / 2;
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The spectrum of a signal, padded with zeros.
pub(super) fn padded(signal: &[f64]) -> Vec<Complex64> {
    let mut spectrum: Vec<Complex64> = signal.iter().map(|&value| value.into()).collect();
    spectrum.resize(
        (PADDED * signal.len()).next_power_of_two(),
        Complex64::default(),
    );
    fft::forward(&mut spectrum);
    spectrum
}
