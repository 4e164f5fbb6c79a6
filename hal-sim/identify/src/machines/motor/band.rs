//! The bandwidth in which the records of a motor are compared.
//!
//! The inertia's torque is the second derivative of the angle. So the noise of an angle, as of an encoder that rounds, rises
//! with the square of the frequency. Where that noise is most of the residual, the band of both sides becomes narrower. An
//! acceleration that alone is narrower than the current looks like a lag.

use super::base::Base;
use super::columns::Columns;
use super::fit::{Both, rms};
use super::record::Record;
use super::search::Candidates;
use super::stretch::{LEAST_HZ, NARROWER};
use crate::signal::white::white_noise;

/// Widest band, Hz, and in the rows' rate where that is slow.
const WIDEST_HZ: f64 = 100.0;
const WIDEST_OF_RATE: f64 = 0.4;
/// The angle's noise is below this share of a residual: it adds an eighth to that then.
const MOST_OF_RESIDUAL: f64 = 0.5;
/// Noise that counts as nothing, in the current's rms.
const NOTHING: f64 = 0.001;

/// Inertia over torque constant, A s^2/rad, in a band in which the acceleration is not noise.
fn inertia(records: &[Record], widest: f64) -> f64 {
    let hz = Columns::new(records, widest).quiet().acceleration_hz();
    let columns = Columns::new(records, hz.min(widest));
    let fit = Both::new([&columns, &columns], &Base::ALL, &[], 0.0).fit(Vec::new());
    fit.0.values[0].abs()
}

/// Whether the angle's noise, through this inertia, is little of what friction and low orders leave of a record.
fn is_quiet(columns: &Columns, inertia: f64) -> bool {
    let of_angle = inertia * columns.acceleration_noise();
    let both = [columns, columns];
    let orders = Candidates::new(both, None).lowest;
    let [residual, _] = Both::new(both, &Base::ALL, &orders, 0.0).squares();
    of_angle <= (MOST_OF_RESIDUAL * residual.sqrt()).max(NOTHING * rms(&columns.current()))
}

/// The frequency up to which both records are compared, Hz.
pub(super) fn band_hz(records: [&[Record]; 2]) -> f64 {
    let rate = records[0].first().map_or(1.0, |first| first.rate);
    let widest = WIDEST_HZ.min(WIDEST_OF_RATE * rate);
    let inertia = inertia(records[0], widest);
    let mut hz = widest;
    for record in records {
        while hz * NARROWER >= LEAST_HZ && !is_quiet(&Columns::new(record, hz), inertia) {
            hz *= NARROWER;
        }
    }
    hz
}

/// What the sensors alone leave of the quietest stretch of a record, A: the current's, and the angle's through the inertia,
/// A s^2/rad.
pub(super) fn noise(records: &[Record], columns: &Columns, inertia: f64) -> f64 {
    let of = |record: &Record| {
        white_noise(&record.current) * (2.0 * columns.band_hz() / record.rate).sqrt()
    };
    let of_current = records.iter().map(of).fold(f64::INFINITY, f64::min);
    of_current.hypot(inertia * columns.acceleration_noise())
}
