//! Orders of the turn that a residual has.

use super::basis::ORDERS;
use super::side::Side;
use crate::signal::leftover::{Over, Residual};

/// Orders without a name at most beside the lowest whole ones, the highest of them, and how near to a whole one they are that.
const FURTHER: usize = 12;
const HIGHEST_FURTHER: u32 = 60;
const WHOLE: f64 = 0.015;

/// Orders of the turn, whole or not, that are loudest in the residual of the fit record, one after the other.
pub(crate) fn loudest_orders(side: &Side, highest: u32) -> Vec<f64> {
    let angle: Vec<f64> = side.at.iter().map(|at| at.angle).collect();
    let range = 0.3..f64::from(highest.min(HIGHEST_FURTHER));
    let over = Over::angle(&angle, range.clone());
    let mut left = side.left.clone();
    let mut orders: Vec<f64> = Vec::new();
    for _ in 0..FURTHER {
        let residual = Residual {
            values: &left,
            open: &side.open,
            rate: side.rate,
        };
        let Some(shape) = residual.shape(&over).filter(|_| range.end > range.start) else {
            break;
        };
        let shape = residual.sharpened(&over, shape);
        left = residual.without(&over, &shape);
        orders.extend(shape.order);
    }
    let is_whole = |order: &f64| order.fract() == 0.0 && *order <= ORDERS.into();
    let whole = orders
        .into_iter()
        .map(|order| match (order - order.round()).abs() < WHOLE {
            true => order.round(),
            false => order,
        });
    let mut orders: Vec<f64> = whole
        .filter(|order| *order > 0.0 && !is_whole(order))
        .collect();
    orders.dedup();
    orders
}
