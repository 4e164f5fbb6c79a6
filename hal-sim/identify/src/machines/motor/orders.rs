//! Orders of a motor's turn, and what they suggest.

/// Highest order that is looked for.
pub(super) const HIGHEST: u32 = 220;
/// An order stands out whose amplitude is so many times the median of all.
const OUTSTANDING: f64 = 6.0;

/// An order of the motor's turn.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// Periods per mechanical turn.
    pub order: u32,
    /// Amplitude in the slow turn, A.
    pub amplitude_a: f64,
}

impl Order {
    /// Candidates for the cause of a torque of this order. A record of the current alone cannot tell them apart: a coupling and
    /// a rotor off its axis both make order 1, magnets and sensors the orders of the pole pairs.
    pub fn suggests(self, pole_pairs: Option<u32>) -> String {
        let Order { order, .. } = self;
        let mechanics: &[&str] = match order {
            1 => &[
                "unbalance or eccentric load",
                "eccentric rotor",
                "misaligned coupling",
                "eccentric encoder",
            ],
            2 => &[
                "misaligned coupling or universal joint",
                "oval bearing seat",
                "encoder disc that is bent",
            ],
            _ => &[
                "cogging of the slots",
                "bearing, belt, gear or balls that pass",
            ],
        };
        let mut candidates: Vec<String> = mechanics.iter().map(|text| (*text).to_owned()).collect();
        let electrical = pole_pairs
            .filter(|pairs| *pairs > 0 && order.is_multiple_of(*pairs))
            .map(|pairs| (order / pairs, pairs));
        if let Some((share, pairs)) = electrical {
            candidates.extend(match share {
                1 => vec!["offset of a current sensor".to_owned()],
                2 => vec![
                    "gains of the current sensors that differ".to_owned(),
                    format!("cogging of the {} poles", 2 * pairs),
                ],
                n if n.is_multiple_of(6) => {
                    vec!["flux harmonics".to_owned(), "dead time".to_owned()]
                }
                n if n.is_multiple_of(2) => {
                    vec!["cogging of the poles".to_owned(), "saturation".to_owned()]
                }
                _ => vec!["magnets or phases that differ".to_owned()],
            });
        }
        let separates = match electrical {
            Some(_) => {
                "the same turn with the current off (driven or coasting) separates cogging and mechanics from sensors and flux"
            }
            None => "another load, and the shaft uncoupled, separate them",
        };
        format!(
            "torque of order {order}; candidates: {}; {separates}",
            candidates.join(", ")
        )
    }
}

/// Amplitude of an order in one way of a slow turn: cosine and sine.
fn line(position: &[f64], current: &[f64], order: u32) -> (f64, f64) {
    let n = position.len().max(1) as f64;
    let mean = current.iter().sum::<f64>() / n;
    position
        .iter()
        .zip(current)
        .fold((0.0, 0.0), |(c, s), (p, i)| {
            let (sin, cos) = (f64::from(order) * p).sin_cos();
            (c + (i - mean) * cos / n, s + (i - mean) * sin / n)
        })
}

/// Orders of a slow turn forth and back whose amplitude stands out of its spectrum, the strongest first. Friction, which
/// changes sign with the direction, drops out of the mean of both ways.
pub(super) fn of_map(position: &[f64], current: &[f64]) -> Vec<Order> {
    let turn = position
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .map_or(0, |(k, _)| k);
    let ways = [0..turn, turn..position.len()];
    outstanding(|order| {
        let (c, s) = ways
            .iter()
            .map(|way| line(&position[way.clone()], &current[way.clone()], order))
            .fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        f64::hypot(c, s)
    })
}

fn outstanding(amplitude: impl Fn(u32) -> f64) -> Vec<Order> {
    let mut orders: Vec<Order> = (1..=HIGHEST)
        .map(|order| Order {
            order,
            amplitude_a: amplitude(order),
        })
        .collect();
    orders.sort_by(|a, b| b.amplitude_a.total_cmp(&a.amplitude_a));
    let median = orders[orders.len() / 2].amplitude_a;
    orders.retain(|order| order.amplitude_a > OUTSTANDING * median);
    orders
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_orders_of_a_turn_are_found_and_friction_is_not() {
        let there = (0..4000).map(|k| TAU * f64::from(k) / 4000.0);
        let position: Vec<f64> = there.clone().chain(there.rev()).collect();
        // White: what repeats in it would be orders.
        let noise = |k: usize| {
            let mut z = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (z >> 40) as f64 / (1u64 << 24) as f64 * 0.01
        };
        let current: Vec<f64> = (0..8000)
            .map(|k| {
                let way = if k < 4000 { 0.3 } else { -0.3 };
                way + 0.2 * (36.0 * position[k]).cos() + 0.05 * (7.0 * position[k]).sin() + noise(k)
            })
            .collect();
        let found = of_map(&position, &current);
        assert_eq!(found.iter().map(|o| o.order).collect::<Vec<_>>(), [36, 7]);
        assert!((found[0].amplitude_a - 0.2).abs() < 0.01);
    }

    #[test]
    fn an_order_has_candidates_and_no_single_cause() {
        let suggests = |order, pole_pairs| {
            Order {
                order,
                amplitude_a: 1.0,
            }
            .suggests(pole_pairs)
        };
        for (text, candidates) in [
            (
                suggests(12, Some(12)),
                ["offset of a current sensor", "cogging"],
            ),
            (suggests(72, Some(12)), ["flux harmonics", "cogging"]),
            (suggests(1, None), ["coupling", "eccentric rotor"]),
        ] {
            assert!(
                candidates.iter().all(|name| text.contains(name)),
                "{text}: expected {candidates:?}"
            );
        }
        assert!(!suggests(18, Some(12)).contains("flux"));
    }
}
