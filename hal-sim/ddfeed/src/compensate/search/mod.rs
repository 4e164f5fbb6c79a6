//! Orders that a recording shows, listed or not, whole or not.
//!
//! The torque that a motor's current does not make changes its momentum: `J w / K - integral of i_q`, by what repeats with its turn.
//! Encoders against the table's scale show the errors of encoders and lead. Both are linear in the drive's coefficients, which are the same
//! at all speeds. So orders are taken one after the other, the one first that explains the most of all holds together, and all are fitted
//! together after each (orthogonal matching pursuit; Pati, Rezaiifar and Krishnaprasad, Asilomar 1993).

mod coordinate;
mod lines;
mod settled;
mod tones;

use self::lines::{Line, Search};
use self::settled::{PAIR, Settled};
use anyhow::Result;
use control::compensation::TORQUES;
use control::plate::{CompensationPlate, OrderPlate, TorqueOrderPlate};
use fft::Complex64;
use plant::Axis;
use plant::model::Model;
use plant::recording::Recording;

pub use lines::Parts;

/// Orders of both motors' searches that differ by less are one.
pub(super) const SAME_ORDER: f64 = 0.05;

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

impl Found {
    /// An order whose coefficient the drive learns.
    fn unknown(order: f64) -> Self {
        Self {
            order,
            coefficient: Complex64::default(),
            scales: None,
            parts: Default::default(),
        }
    }
}

/// What a recording shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Orders {
    /// Torque of screw and nut, A.
    pub torque: [Vec<Found>; 2],
    /// Errors of their encoders, of the speed.
    pub angle: [Vec<Found>; 2],
    /// Errors of the lead, and torques of the ball pair, which move the table alike: the drive learns them from the table's scale.
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

    /// Where there is room, the usual orders too: a recording without a load hardly shows harmonics of the flux.
    fn add_usual(&mut self, model: &Model) {
        let pole_pairs = Axis::ALL.map(|axis| model.motor(axis).pole_pairs);
        let scale_count_m = model.installation.scale_count_m;
        let usual = CompensationPlate::usual(pole_pairs, 0.0, scale_count_m);
        for (found, usual) in self.torque.iter_mut().zip(usual.torque) {
            add_missing(found, usual.iter().map(|plate| plate.order));
        }
        for (found, usual) in self.angle.iter_mut().zip(usual.angle) {
            add_missing(found, usual.iter().map(|plate| plate.order));
        }
        add_missing(
            &mut self.travel,
            usual.travel.iter().map(|plate| plate.order),
        );
    }
}

fn is_among(found: &[Found], order: f64) -> bool {
    found
        .iter()
        .any(|found| (found.order - order).abs() < SAME_ORDER)
}

/// Orders that are not among those that were found, after them. What has no room, the plate leaves out.
fn add_missing(found: &mut Vec<Found>, more: impl Iterator<Item = f64>) {
    for order in more.filter(|order| *order != 0.0) {
        if !is_among(found, order) {
            found.push(Found::unknown(order));
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

/// The orders of a recording that was made without a compensation. `model` gives inertia, flux, lead and pole pairs.
///
/// # Errors
/// A recording whose holds cannot distinguish screw, nut and lead.
pub fn orders(recording: &Recording, model: &Model) -> Result<Orders> {
    let settled = Settled::of(recording, model)?;
    settled.distinguish()?;
    let searched = Axis::ALL.map(|axis| {
        let search = settled.torque_search(axis);
        let lines = search.lines();
        [0, PAIR].map(|coordinate| of_coordinate(&search, &lines, coordinate))
    });
    let [[screw, screw_pair], [nut, nut_pair]] = searched;
    let search = settled.scale_search();
    let lines = search.lines();
    let of = |k: usize| of_coordinate(&search, &lines, k);
    let mut travel = of(2);
    // Screw and nut feel a torque of the pair alike.
    let of_pair = screw_pair.iter().map(|found| found.order);
    add_missing(
        &mut travel,
        of_pair.filter(|&order| is_among(&nut_pair, order)),
    );
    let mut found = Orders {
        torque: [screw, nut],
        angle: [of(0), of(1)],
        travel,
    };
    found.add_usual(model);
    Ok(found)
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
