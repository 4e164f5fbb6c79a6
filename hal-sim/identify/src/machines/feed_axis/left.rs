//! The residual of an axis' force when all effects are in, and what it looks like.

use super::axis::{Axis, Term};
use super::fit::MARGIN;
use super::record::Record;
use super::stage::Stage;
use crate::conclusion::rest::{ABOVE, Place, Remnant, Rest, TIME};
use crate::search::selection::{ANOTHER_LAW, LACK_OF_FIT, MODEST, NOT_BORNE_OUT, TOO_MODEST};
use crate::signal::filter::butterworth_100;
use crate::signal::fourier::slope;
use crate::signal::leftover::Form;
use std::f64::consts::TAU;

/// Orders of the screw that are looked for: from those that a travel of a few turns has to what 100 Hz show of a slow
/// stroke.
const ORDERS: std::ops::Range<f64> = 0.3..60.0;
/// Frequencies, Hz: what is slower is a shape of the programme, what is faster the filter takes away.
const HZ: std::ops::Range<f64> = 0.5..100.0;

/// Coordinates of the residual.
const SCREW: &str = "angle of the screw";
const VELOCITY: &str = "velocity";
const POSITION: &str = "position";
const GUIDEWAY: &str = "position, against the motion";
/// Distance of two orders that are one whose amplitude varies.
const SAME_ORDER: f64 = 0.05;

/// Rows in which the reference's speed changes by more than a twentieth of its fastest change.
fn changes(record: &Record) -> Vec<bool> {
    let speed = slope(
        &butterworth_100(&record.reference, record.rate),
        record.rate,
    );
    let change = slope(&speed, record.rate);
    let most = change.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    change.iter().map(|x| x.abs() > 0.05 * most).collect()
}

/// Velocity of the carriage, m/s.
fn velocity_of(record: &Record) -> Vec<f64> {
    slope(&butterworth_100(&record.position, record.rate), record.rate)
}

/// What `axes` leave of fit and check record, whose noise is `floor` (not a number where it is not known).
pub(super) fn remnants(axes: [&Axis; 2], records: [&Record; 2], floor: f64) -> Vec<Remnant> {
    let inside = |record: &Record| {
        (0..record.len())
            .map(|row| (MARGIN..record.len() - MARGIN).contains(&row))
            .collect()
    };
    let both = |of: &dyn Fn(&Record) -> Vec<f64>| records.map(of);
    let place = |name, form, of: &dyn Fn(&Record) -> Vec<f64>| Place::plain(name, both(of), form);
    let way = |record: &Record| velocity_of(record).iter().map(|v| v.signum()).collect();
    let lead = axes[0].lead_m;
    let position = |record: &Record| record.position.clone();
    let turns = |record: &Record| record.position.iter().map(|x| TAU * x / lead).collect();
    let clock = |record: &Record| {
        let turn = TAU / record.rate;
        (0..record.len()).map(|row| turn * row as f64).collect()
    };
    let places = [
        place(SCREW, Form::Repeats(ORDERS), &turns),
        place(VELOCITY, Form::Curve, &velocity_of),
        place(POSITION, Form::Curve, &position),
        Place {
            factors: Some(both(&way)),
            ..place(GUIDEWAY, Form::Curve, &position)
        },
        place(TIME, Form::Repeats(HZ), &clock),
        place(TIME, Form::Curve, &clock),
    ];
    let rest = Rest {
        values: [axes[0].left(records[0]), axes[1].left(records[1])],
        open: records.map(inside),
        rate: records[0].rate,
        during: vec![("the reference's speed changes", changes(records[0]))],
        floor: floor.is_finite().then_some([floor; 2]),
        above: ABOVE,
    };
    rest.remnants(&places.each_ref())
}

/// The coordinate that a term is a law over.
fn along(term: Term) -> &'static str {
    match term {
        Term::Periodic(_) => SCREW,
        Term::PositionFriction => GUIDEWAY,
        Term::PositionLoad => POSITION,
        _ => VELOCITY,
    }
}

/// Of the terms that were added stage by stage the first that the check record does not confirm, that explains little beside the residual
/// above the noise, or beside which another law is left over its own coordinate: a tenth of what it explains; as much at another order; 20
/// times beside a slope over the position, which is the first term of any law there.
pub(super) fn unsound(
    stages: &[Stage],
    left: &[Remnant],
    floor: f64,
) -> Option<(usize, &'static str)> {
    let square = |stage: &Stage| stage.estimate.force_n.powi(2);
    let remains = square(stages.last()?) - floor * floor;
    stages.windows(2).enumerate().find_map(|(k, pair)| {
        let [before, after] = pair else { return None };
        let fall = square(before) - square(after);
        let (term, _) = *after.axis.terms.last()?;
        let share = |left: &Remnant| match (term, left.order) {
            (Term::PositionFriction | Term::PositionLoad, _) => MODEST.recip(),
            (Term::Periodic(own), Some(order)) if (own - order).abs() > SAME_ORDER => 1.0,
            _ => LACK_OF_FIT,
        };
        let mut own = left.iter().filter(|left| left.coordinate == along(term));
        let reason = if after.homed.force_n >= before.homed.force_n {
            NOT_BORNE_OUT
        } else if fall < MODEST * remains {
            TOO_MODEST
        } else if own.any(|left| left.size.powi(2) > share(left) * fall) {
            ANOTHER_LAW
        } else {
            return None;
        };
        Some((k, reason))
    })
}

#[cfg(test)]
mod tests {
    use super::super::fit::tests::record;
    use super::super::record::Law;
    use super::*;
    use crate::regression::sandwich::tests::coloured;

    /// Force noise, N.
    const NOISE: f64 = 1.0;

    /// The residual of an axis that is known, in whose force there is noise and something more over its position.
    fn left(more: impl Fn(f64) -> f64) -> Vec<Remnant> {
        let axis = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        let clean = record(&axis, [2.0, -3.0, 3.0, -2.0]);
        let noisy = |seed, share: f64| {
            let noise = coloured(seed, clean.len(), 0.0);
            clean.with_force(|row| NOISE * noise[row] + share * more(clean.position[row]))
        };
        let alone = axis.left(&noisy(1, 0.0));
        let floor = (alone.iter().map(|x| x * x).sum::<f64>() / alone.len() as f64).sqrt();
        remnants([&axis, &axis], [&noisy(2, 1.0), &noisy(3, 1.0)], floor)
    }

    #[test]
    fn noise_alone_leaves_nothing() {
        let left = left(|_| 0.0);
        assert!(left.is_empty(), "{left:?}");
    }

    #[test]
    fn a_wave_over_the_screw_is_told_by_its_order_and_size() {
        let lead = Axis::published().lead_m;
        let left = left(|x| 1.4 * (7.3 * TAU * x / lead + 0.4).cos());
        let [wave] = &left[..] else {
            panic!("{left:?}")
        };
        assert_eq!(wave.coordinate, "angle of the screw");
        assert!((wave.order.unwrap() - 7.3).abs() < 0.03, "{wave:?}");
        assert!(
            (wave.size / (1.4 / 2f64.sqrt()) - 1.0).abs() < 0.15,
            "{wave:?}"
        );
        assert!(wave.hz.is_none());
    }

    #[test]
    fn a_bump_over_position_is_told_by_the_position() {
        let lead = Axis::published().lead_m;
        let left = left(|x| 4.0 * f64::from((0.9..1.2).contains(&(x / lead))));
        assert_eq!(left[0].coordinate, "position", "{left:?}");
        assert_eq!((left[0].order, left[0].hz), (None, None));
        assert!((0.8..2.0).contains(&left[0].size), "{left:?}");
    }
}
