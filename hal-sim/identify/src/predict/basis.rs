//! Smooth functions of a machine's coordinates, in groups of one coordinate or of a product of two.

use std::f64::consts::TAU;

/// Cubic B-splines of a speed, of a position.
const SPEED_SPLINES: usize = 10;
const POSITION_SPLINES: usize = 12;
/// Share of the top speed below which the splines of the speed are as dense as they get.
const SLOW: f64 = 0.03;
/// Share of the rows that a range leaves out at each end.
const OUTER: f64 = 0.002;
/// Highest order of the turn.
pub(crate) const ORDERS: u32 = 24;
/// Highest order whose size goes with the speed.
const ORDERS_BY_SPEED: u32 = 6;
/// Lengths over which a force since the last reversal decays, turns: those of presliding and of a belt or soft screw.
const DECAYS_TURNS: [f64; 3] = [0.003, 0.02, 0.1];
/// Travel that is one, turns: on a motor that only turns on, no position comes twice.
const MOST_TURNS: f64 = 200.0;

/// What a group is a function of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Along {
    /// Speed.
    Speed,
    /// Way since the last reversal, with the sign of the motion.
    SinceReversal,
    /// Position over the travel.
    Position,
    /// The same, against the motion.
    PositionByDirection,
    /// An order of the turn, whole or not: balls and rollers pass at orders that are not.
    Order(f64),
    /// An order of the turn whose size goes with the speed.
    OrderBySpeed(u32),
}

impl Along {
    /// For a reader.
    pub(crate) fn name(self) -> String {
        match self {
            Along::Speed => "speed".into(),
            Along::SinceReversal => "way since reversal".into(),
            Along::Position => "position".into(),
            Along::PositionByDirection => "position x direction".into(),
            Along::Order(order) => format!("angle, order {}", (1e3 * order).round() / 1e3),
            Along::OrderBySpeed(order) => format!("angle, order {order} x speed"),
        }
    }

    /// The order of the turn.
    pub(crate) fn order(self) -> Option<f64> {
        match self {
            Along::Order(order) => Some(order),
            Along::OrderBySpeed(order) => Some(order.into()),
            _ => None,
        }
    }
}

/// Where a machine is in one row.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct At {
    /// Angle of the turning part, rad, not wrapped.
    pub(crate) angle: f64,
    /// Position over the travel, as an angle of the turning part, rad.
    pub(crate) position: f64,
    /// Its speed, rad/s.
    pub(crate) speed: f64,
    /// Smooth sign of the speed.
    pub(crate) way: f64,
    /// Way since the last reversal, rad.
    pub(crate) since: f64,
}

/// A group of functions.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    /// What they are functions of.
    pub(crate) along: Along,
    /// The range of the coordinate that the fit record has.
    pub(crate) range: [f64; 2],
    scale: f64,
}

/// The range that all but a few values have.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1);
    let outer = (OUTER * last as f64) as usize;
    match sorted.is_empty() {
        true => [0.0; 2],
        false => [sorted[outer], sorted[last - outer]],
    }
}

/// Cubic B-spline number `k` of `count` over 0 to 1 (de Boor, *A Practical Guide to Splines*), equal knots.
fn spline(x: f64, k: usize, count: usize) -> f64 {
    let step = 1.0 / (count - 3) as f64;
    let t = (x / step - (k as f64 - 3.0)).clamp(0.0, 4.0);
    let cubic = |x: f64| x.max(0.0).powi(3) / 6.0;
    (cubic(t) - 4.0 * cubic(t - 1.0) + 6.0 * cubic(t - 2.0) - 4.0 * cubic(t - 3.0)).max(0.0)
}

impl Group {
    /// The groups that a fit record, row by row, can show. Orders above `highest_order` are not among them; `further` ones
    /// are beside the lowest whole ones.
    pub(crate) fn all(rows: &[At], highest_order: u32, further: &[f64]) -> Vec<Self> {
        let speeds = range(rows.iter().map(|at| at.speed));
        let angles = range(rows.iter().map(|at| at.angle));
        let top = speeds[0].abs().max(speeds[1].abs());
        let turns = (angles[1] - angles[0]) / TAU;
        let positions = range(rows.iter().map(|at| at.position));
        let moves = top > 0.0 && turns > 0.0;
        if !moves {
            return Vec::new();
        }
        let group = |along, range, scale| Group {
            along,
            range,
            scale,
        };
        let mut all = vec![group(Along::Speed, speeds, SLOW * top)];
        if speeds[0] < 0.0 && speeds[1] > 0.0 {
            all.push(group(Along::SinceReversal, [0.0, f64::INFINITY], 1.0));
        }
        if turns < MOST_TURNS {
            all.push(group(Along::Position, positions, 1.0));
            if speeds[0] < 0.0 && speeds[1] > 0.0 {
                all.push(group(Along::PositionByDirection, positions, 1.0));
            }
        }
        if turns >= 1.0 {
            let whole = [f64::NEG_INFINITY, f64::INFINITY];
            let orders = (1..=ORDERS.min(highest_order)).map(f64::from);
            let orders = orders.chain(further.iter().copied()).map(Along::Order);
            all.extend(orders.map(|along| group(along, whole, 1.0)));
            let by_speed = (1..=ORDERS_BY_SPEED.min(highest_order)).map(Along::OrderBySpeed);
            all.extend(by_speed.map(|along| group(along, speeds, top)));
        }
        all
    }

    /// Whether its functions stand side by side along the coordinate.
    pub(crate) fn is_smooth(&self) -> bool {
        matches!(
            self.along,
            Along::Speed | Along::Position | Along::PositionByDirection
        )
    }

    /// How many functions it has.
    pub(crate) fn len(&self) -> usize {
        match self.along {
            Along::Speed => SPEED_SPLINES,
            Along::SinceReversal => DECAYS_TURNS.len(),
            Along::Position | Along::PositionByDirection => POSITION_SPLINES,
            Along::Order(_) | Along::OrderBySpeed(_) => 2,
        }
    }

    /// The coordinate that its range is of.
    pub(crate) fn coordinate(&self, at: &At) -> f64 {
        match self.along {
            Along::Speed | Along::OrderBySpeed(_) => at.speed,
            Along::SinceReversal => at.since,
            Along::Position | Along::PositionByDirection => at.position,
            Along::Order(_) => at.angle,
        }
    }

    /// Whether a row is outside of what the fit record has; what is smaller than the range's ends by rounding is not.
    pub(crate) fn is_outside(&self, at: &At) -> bool {
        let [low, high] = self.range;
        let margin = match (high - low).is_finite() {
            true => 0.02 * (high - low),
            false => 0.0,
        };
        let x = self.coordinate(at);
        x < low - margin || x > high + margin
    }

    /// Where a coordinate is in its range, 0 to 1; a speed's small values take more of it.
    fn share(&self, x: f64) -> f64 {
        let bent = |x: f64| match self.along {
            Along::Speed => (x / self.scale).asinh(),
            _ => x,
        };
        let [low, high] = self.range.map(bent);
        ((bent(x.clamp(self.range[0], self.range[1])) - low) / (high - low).max(1e-300))
            .clamp(0.0, 1.0)
    }

    /// Function number `k` at a row.
    pub(crate) fn value(&self, k: usize, at: &At) -> f64 {
        let wave = |order: f64| {
            let (sin, cos) = (order * at.angle).sin_cos();
            [cos, sin][k]
        };
        match self.along {
            Along::Speed => spline(self.share(at.speed), k, SPEED_SPLINES),
            Along::SinceReversal => at.way * (-at.since / (TAU * DECAYS_TURNS[k])).exp(),
            Along::Position => spline(self.share(at.position), k, POSITION_SPLINES),
            Along::PositionByDirection => {
                at.way * spline(self.share(at.position), k, POSITION_SPLINES)
            }
            Along::Order(order) => wave(order),
            Along::OrderBySpeed(order) => wave(order.into()) * at.speed / self.scale,
        }
    }

    /// Rows at which a reader sees the group's function whole.
    pub(crate) fn shown(&self) -> Vec<At> {
        const POINTS: usize = 41;
        let over = |low: f64, high: f64| {
            (0..POINTS).map(move |k| low + (high - low) * k as f64 / (POINTS - 1) as f64)
        };
        let [low, high] = self.range;
        let one = At {
            way: 1.0,
            ..At::default()
        };
        match self.along {
            Along::Speed => over(low, high)
                .map(|speed| At {
                    speed,
                    way: speed.signum(),
                    ..one
                })
                .collect(),
            Along::SinceReversal => {
                let most = 3.0 * TAU * DECAYS_TURNS[DECAYS_TURNS.len() - 1];
                over(0.0, most).map(|since| At { since, ..one }).collect()
            }
            Along::Position | Along::PositionByDirection => over(low, high)
                .map(|position| At { position, ..one })
                .collect(),
            Along::Order(order) if order.fract() != 0.0 => over(0.0, TAU / order)
                .map(|angle| At { angle, ..one })
                .collect(),
            Along::Order(_) => over(0.0, TAU).map(|angle| At { angle, ..one }).collect(),
            Along::OrderBySpeed(_) => over(0.0, TAU)
                .map(|angle| At {
                    angle,
                    speed: self.scale,
                    ..one
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one() {
        for x in [0.0, 0.013, 0.5, 0.77, 1.0] {
            let sum: f64 = (0..SPEED_SPLINES)
                .map(|k| spline(x, k, SPEED_SPLINES))
                .sum();
            assert!((sum - 1.0).abs() < 1e-9, "{sum} at {x}, expected 1");
        }
    }

    #[test]
    fn a_record_that_stands_has_no_group() {
        assert!(Group::all(&[At::default(); 50], 24, &[]).is_empty());
        assert!(Group::all(&[], 24, &[]).is_empty());
    }
}
