//! A table that sticks and slips: friction that is higher at rest, from the ripple of a drive that runs free.
//!
//! While the table stands its friction is whatever holds it, and when it breaks loose it runs at many times the speed of the
//! screw: no balance of sliding friction holds, and a regression on one is biased by all of it. The residual is the
//! simulation-error method (Ljung, *System Identification*, 2nd ed., section 5.4): the drive is simulated over the record's
//! speeds, free of what was measured, and the friction is that with which its ripple is the record's. The stretch of the
//! screw between standing and slipping gives the size to start from: a table on a spring swings to twice the difference of
//! friction at rest and in motion (Armstrong-Helouvry, *Control of Machines with Friction*, 1991, chapter 3).

use crate::analysis::{Found, Outcome, given};
use crate::effects::family::Family;
use crate::effects::hypothesis::Hypothesis;
use crate::regression::sandwich::NORMAL_95;
use crate::search::selection::{LEAST_HOLDS, RIPPLE_LEFT};
use nalgebra::{Matrix2, Vector2};
use plant::Axis;
use plant::effects::Place;
use plant::model::Model;
use plant::recording::Recording;
use std::ops::Range;

/// A drive that runs free on a model.
pub trait FreeDrive {
    /// Ripple of the table's velocity in each hold of a record, as recorded and as the drive has it on `model`, %; `None`
    /// if it cannot run.
    fn ripple(&self, model: &Model, record: &Recording) -> Option<Vec<[f64; 2]>>;
}

/// Shortest hold, and what of its beginning belongs to the way to it, s.
const SHORTEST_S: f64 = 0.4;
const SETTLE_S: f64 = 0.15;
/// Of each hold so much is simulated, s: several periods of sticking and slipping.
const SIMULATED_S: f64 = 0.6;
/// Time over which a standing table is distinguished from a moving one, s: on a stiff screw it sticks for a few milliseconds.
const STANDING_S: f64 = 1e-3;
/// Share of the reference below which it stands, and share of a hold over which it does where it sticks.
const STANDING: f64 = 0.1;
const STICKING: f64 = 0.02;
/// Speeds over which friction falls that are tried first, as shares of the slowest reference at which the table sticks.
const FIRST_SPEEDS: [f64; 4] = [0.15, 0.3, 0.6, 1.2];
/// And sizes, as shares of what the screw's swing tells, which damping has made smaller.
const FIRST_SIZES: [f64; 3] = [1.0, 1.4, 2.0];
/// Starts that are followed, and simulations that each may take: of what takes longer the best until then is taken.
const FOLLOWED: usize = 3;
const RUNS_FOLLOWED: usize = 20;
/// Damping of the first step, the longest step, and one that is the last, in the logarithms of size and speed.
const FIRST_DAMPING: f64 = 0.01;
const LONGEST_STEP: f64 = 0.7;
const LAST_STEP: f64 = 0.01;
/// Steps of the logarithms by which the ripple's slopes are taken.
const SLOPE_STEP: f64 = 0.1;

/// Stretches of constant references in which the table is to move, and its speed there, m/s.
fn holds(record: &Recording, model: &Model) -> Vec<(Range<usize>, f64)> {
    let [screw, nut] = Axis::ALL.map(|axis| &record.axis(axis).speed_ref_rad_s);
    let rate = model.sensing.sample_hz;
    let mut holds = Vec::new();
    let mut first = 0;
    for row in 1..=record.len() {
        if row < record.len() && screw[row] == screw[first] && nut[row] == nut[first] {
            continue;
        }
        let speed = model.feed.travel_per_radian() * (screw[first] - nut[first]);
        if (row - first) as f64 > SHORTEST_S * rate && speed.abs() > 1e-6 {
            holds.push((first..row, speed));
        }
        first = row;
    }
    holds
}

/// Rows of a hold after the way to it.
fn settled(hold: &Range<usize>, rate: f64) -> Range<usize> {
    hold.start + (SETTLE_S * rate) as usize..hold.end
}

/// Share of a hold over which the table stands.
fn standing(table: &[f64], speed: f64, rate: f64) -> f64 {
    let rows = ((STANDING_S * rate) as usize).max(1);
    let windows = table.len().saturating_sub(rows);
    let least = STANDING * speed.abs() * rows as f64 / rate;
    let stands = (0..windows).filter(|&row| (table[row + rows] - table[row]).abs() < least);
    stands.count() as f64 / windows.max(1) as f64
}

/// The slowest speed at which the table sticks, m/s, and half the swing of the screw's force there, N.
fn sticking(record: &Recording, model: &Model) -> Option<[f64; 2]> {
    let rate = model.sensing.sample_hz;
    let feed = &model.feed;
    let [screw, nut] = Axis::ALL.map(|axis| &record.axis(axis).angle_rad);
    let stretch = |row: usize| {
        feed.travel_per_radian() * (screw[row] - nut[row]) - record.table_position_m[row]
    };
    let mut slowest = f64::INFINITY;
    let mut swings = Vec::new();
    for (hold, speed) in holds(record, model) {
        let rows = settled(&hold, rate);
        if standing(&record.table_position_m[rows.clone()], speed, rate) < STICKING {
            continue;
        }
        let (low, high) = rows
            .map(stretch)
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        slowest = slowest.min(speed.abs());
        swings.push(0.5 * feed.axial_stiffness_n_per_m * (high - low));
    }
    swings.sort_by(f64::total_cmp);
    let median = swings.get(swings.len() / 2)?;
    Some([slowest, *median])
}

/// The beginnings of a record's holds, one after the other.
fn shortened(record: &Recording, model: &Model) -> Recording {
    let rate = model.sensing.sample_hz;
    let rows = (SIMULATED_S * rate) as usize;
    let kept: Vec<usize> = holds(record, model)
        .into_iter()
        .flat_map(|(hold, _)| hold.start..hold.end.min(hold.start + rows))
        .collect();
    let pick = |column: &[f64]| kept.iter().map(|&row| column[row]).collect::<Vec<f64>>();
    let axis = |axis: Axis| {
        let own = record.axis(axis);
        plant::recording::AxisRecord {
            angle_rad: pick(&own.angle_rad),
            ia_a: pick(&own.ia_a),
            ib_a: pick(&own.ib_a),
            ud_v: pick(&own.ud_v),
            uq_v: pick(&own.uq_v),
            iq_ref_a: pick(&own.iq_ref_a),
            speed_ref_rad_s: pick(&own.speed_ref_rad_s),
        }
    };
    Recording {
        time_s: (0..kept.len()).map(|row| row as f64 / rate).collect(),
        axes: Axis::ALL.map(axis),
        table_position_m: pick(&record.table_position_m),
    }
}

/// Friction at a size (N) and a speed (m/s), as logarithms.
type Point = Vector2<f64>;

/// The ripple that a friction gives over a record, less the record's own, in points.
struct Study<'a> {
    declared: &'a Model,
    record: &'a Recording,
    drive: &'a dyn FreeDrive,
    runs: usize,
    most_runs: usize,
}

fn hypothesis(speed: f64) -> Hypothesis {
    Hypothesis::new(Family::StribeckFriction, Place::Feed, speed)
}

/// A declared model with more friction at rest.
fn with(declared: &Model, at: &Point) -> Model {
    let mut model = declared.clone();
    let effect = hypothesis(at[1].exp()).effect(declared, 1.0, &[at[0].exp()]);
    model.effects.extend(effect);
    model
}

/// Mean square.
fn power(off: &[f64]) -> f64 {
    off.iter().map(|x| x * x).sum::<f64>() / off.len().max(1) as f64
}

impl Study<'_> {
    fn off(&mut self, model: &Model) -> Option<Vec<f64>> {
        self.runs += 1;
        let ripple = self.drive.ripple(model, self.record)?;
        Some(
            ripple
                .iter()
                .map(|[recorded, driven]| driven - recorded)
                .collect(),
        )
    }

    fn at(&mut self, at: &Point) -> Option<Vec<f64>> {
        self.off(&with(self.declared, at))
    }

    /// Where the mean square is smallest, from the slowest speed at which the table sticks and a size. The ripple of a table that sticks
    /// is rough over size and speed: the best few of a grid are each followed, and the best end counts.
    fn least(&mut self, [slowest, size]: [f64; 2]) -> Option<(Point, Vec<f64>)> {
        let mut starts = Vec::new();
        for (share, of_size) in FIRST_SPEEDS
            .into_iter()
            .flat_map(|v| FIRST_SIZES.map(|s| (v, s)))
        {
            let at = Vector2::new((of_size * size).ln(), (share * slowest).ln());
            starts.push((at, self.at(&at)?));
        }
        starts.sort_by(|a, b| power(&a.1).total_cmp(&power(&b.1)));
        let mut ends = Vec::new();
        for start in starts.into_iter().take(FOLLOWED) {
            self.most_runs = self.runs + RUNS_FOLLOWED;
            ends.push(self.followed(start)?);
        }
        ends.into_iter()
            .min_by(|a, b| power(&a.1).total_cmp(&power(&b.1)))
    }

    /// Where Levenberg and Marquardt's steps lead from a start.
    fn followed(&mut self, (mut at, mut left): (Point, Vec<f64>)) -> Option<(Point, Vec<f64>)> {
        let mut damping = FIRST_DAMPING;
        while self.runs + 2 < self.most_runs {
            let slopes = self.slopes(&at, &left)?;
            let gram = products(&slopes);
            let pull = Vector2::from_fn(|k, _| crate::regression::column::dot(&slopes[k], &left));
            loop {
                let damped = gram + Matrix2::from_diagonal(&gram.diagonal()) * damping;
                let step = -(damped.try_inverse()? * pull);
                if step.norm() < LAST_STEP || self.runs >= self.most_runs {
                    return Some((at, left));
                }
                let next = at + step * (LONGEST_STEP / step.norm()).min(1.0);
                let off = self.at(&next)?;
                if power(&off) < power(&left) {
                    (at, left) = (next, off);
                    damping *= 0.1;
                    break;
                }
                damping *= 10.0;
            }
        }
        Some((at, left))
    }

    /// Derivatives of the ripples by the logarithms of size and speed.
    fn slopes(&mut self, at: &Point, here: &[f64]) -> Option<[Vec<f64>; 2]> {
        let mut slope = |axis: usize| {
            let mut step = Vector2::zeros();
            step[axis] = SLOPE_STEP;
            let there = self.at(&(at + step))?;
            let pairs = there.iter().zip(here);
            Some(pairs.map(|(a, b)| (a - b) / SLOPE_STEP).collect())
        };
        Some([slope(0)?, slope(1)?])
    }

    /// Covariance of size and speed, relative, from the slopes of the ripples and the residual of them.
    fn covariance(&mut self, at: &Point, left: &[f64]) -> Option<Matrix2<f64>> {
        let gram = products(&self.slopes(at, left)?);
        let freedom = left.len().checked_sub(2).filter(|n| *n > 0)?;
        let variance = power(left) * left.len() as f64 / freedom as f64;
        Some(gram.try_inverse()? * variance)
    }
}

/// Products of slopes.
fn products(slopes: &[Vec<f64>; 2]) -> Matrix2<f64> {
    Matrix2::from_fn(|j, k| crate::regression::column::dot(&slopes[j], &slopes[k]))
}

/// The friction of a table that sticks and slips in `fit`, if there is one and `check` bears it out: there, where nothing
/// was fitted, the simulated ripple must come nearer to the recorded one by most of its error.
pub(crate) fn traced(
    declared: &Model,
    fit: &Recording,
    check: &Recording,
    drive: &dyn FreeDrive,
) -> Option<Outcome> {
    let start = sticking(fit, declared)?;
    sticking(check, declared)?;
    let short = shortened(fit, declared);
    let mut study = Study {
        declared,
        record: &short,
        drive,
        runs: 0,
        most_runs: 0,
    };
    let (at, left) = study.least(start)?;
    if left.len() < LEAST_HOLDS {
        return None;
    }
    let covariance = study.covariance(&at, &left)?;
    // A size whose interval holds 0 is no name.
    if NORMAL_95 * covariance[(0, 0)].max(0.0).sqrt() > 1.0 {
        return None;
    }
    let short = shortened(check, declared);
    let mut witness = Study {
        declared,
        record: &short,
        drive,
        runs: 0,
        most_runs: 0,
    };
    let (before, after) = (witness.off(declared)?, witness.at(&at)?);
    if power(&after) > RIPPLE_LEFT * RIPPLE_LEFT * power(&before) {
        return None;
    }
    let (size, speed) = (at[0].exp(), at[1].exp());
    let found = |found: Found| Found {
        values: vec![size],
        covariance: vec![size * size * covariance[(0, 0)]],
        shape_sigma: speed * covariance[(1, 1)].max(0.0).sqrt(),
        effect: hypothesis(speed)
            .effect(declared, 1.0, &[size])
            .expect("a friction of the feed"),
        ..found
    };
    Some(given(declared, fit, check, hypothesis(speed), found))
}
