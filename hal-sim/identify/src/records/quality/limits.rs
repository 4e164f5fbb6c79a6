//! When data is called wrong: every threshold, with its reason.
//!
//! The thresholds lie where no effect, no tolerance of a plate and no noise of a sensor reaches, so that a sound record of
//! a machine with any effect raises nothing; what is wrong by less is left to the regression, which must leave it
//! unexplained.

use std::ops::RangeInclusive;

/// See the module.
#[derive(Debug, Clone)]
pub struct Limits {
    /// A channel that moves may hold one value for so long, s: longer than a drive's slowest loop takes to react.
    pub frozen_s: f64,
    /// Turns of the field within which a phase current that is not zero must change.
    pub frozen_turns: f64,
    /// Values that differ, below which a column says too little to be called a copy of another.
    pub distinct: usize,
    /// Changes of a column from which on it is looked at whether they come every so many rows only: by chance of 1/2 each
    /// the odds are below 1e-14.
    pub held_changes: usize,
    /// Share of the changes that must fit: a gap or a start may shift some.
    pub held_share: f64,
    /// Share of the rows at a column's extreme value, beyond which it is cut off there. A quantised sine of 20 counts has
    /// 10 %, in pieces of one count's width; see `clipped_ratio`.
    pub clipped_share: f64,
    /// How many times as many rows stand at the extreme as in the next hundredth of the range. A sine has 2.4 (arcsine
    /// law), a trapezoid more, but not in a phase current.
    pub clipped_ratio: f64,
    /// Ratio of an angle's speed to its reference. A speed loop in the mean holds its reference to parts in a thousand.
    pub speed_ratio: RangeInclusive<f64>,
    /// Smallest share of the angle's speed that its reference explains.
    pub speed_explained: f64,
    /// Ratio of the measured q current to its reference. The current loop integrates: in the mean it holds the measured
    /// value to the reference whatever the gain of the sensor; amplitude- for power-invariant is a factor of 1.22.
    pub current_ratio: RangeInclusive<f64>,
    /// Angle between measured current and reference, rad: 25 degrees electrical, where a tenth of the torque is lost and a
    /// drive is hardly usable.
    pub current_angle: f64,
    /// Smallest share of the phase currents that the reference explains in the rotor's frame.
    pub current_explained: f64,
    /// Constant part of a phase current against the rms of the reference. What sensors have is below a hundredth of
    /// their range, and the loop drives it into the motor.
    pub current_offset: f64,
    /// Negative sequence of the phase currents against the positive one: 0.33 where one phase is off by a factor of two;
    /// sensors differ by a few percent.
    pub negative_sequence: f64,
    /// Lag of currents behind the angle, rows. Both are sampled at once.
    pub lag_rows: f64,
    /// Ratio of fitted to declared resistance: copper from -40 to 200 degrees is 0.76 to 1.7, cables and contacts add.
    pub resistance_ratio: RangeInclusive<f64>,
    /// Ratio of fitted to declared flux: ferrite loses 0.2 % a kelvin, plates are 10 % off.
    pub flux_ratio: RangeInclusive<f64>,
    /// Ratio of fitted to declared inductance: saturation halves it, plates give either line or phase.
    pub inductance_ratio: RangeInclusive<f64>,
    /// Ratio of fitted to declared inertia: couplings and loads that were forgotten.
    pub inertia_ratio: RangeInclusive<f64>,
    /// Ratio of fitted to declared moving mass.
    pub mass_ratio: RangeInclusive<f64>,
    /// Smallest share of the voltage that the motor's equation explains with any parameters.
    pub voltage_explained: f64,
    /// Ratio of the table's travel to lead times angle of screw against nut. Leads are good to 1e-3.
    pub travel_ratio: RangeInclusive<f64>,
    /// Smallest share of the table's travel that the angles explain.
    pub travel_explained: f64,
    /// Ratio of a carriage's travel to its reference.
    pub follow_ratio: RangeInclusive<f64>,
    /// Counts of the model's encoder from which on the single step of an angle is that of a coarser one: a single step of the model's
    /// own is one count.
    pub coarser: f64,
    /// Standard deviations by which a ratio must lie outside.
    pub sigmas: f64,
    /// Rows in a row that stand in two records, from which on they are the same rows: with 10 values that differ in each.
    pub same_rows: usize,
    /// How many times less another column must leave unexplained before it is taken to be the right one.
    pub better: f64,
    /// Share of the rows that a fix must explain before it is named as what is wrong.
    pub fixed: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Limits {
            frozen_s: 0.1,
            frozen_turns: 3.0,
            distinct: 20,
            held_changes: 50,
            held_share: 0.98,
            clipped_share: 0.005,
            clipped_ratio: 8.0,
            speed_ratio: 0.8..=1.25,
            speed_explained: 0.5,
            current_ratio: 0.85..=1.18,
            current_angle: 0.44,
            current_explained: 0.5,
            current_offset: 0.5,
            negative_sequence: 0.2,
            lag_rows: 4.0,
            resistance_ratio: 0.4..=2.5,
            flux_ratio: 0.7..=1.36,
            inductance_ratio: 0.25..=4.0,
            inertia_ratio: 0.25..=4.0,
            mass_ratio: 0.33..=3.0,
            voltage_explained: 0.3,
            travel_ratio: 0.95..=1.05,
            travel_explained: 0.9,
            follow_ratio: 0.7..=1.4,
            coarser: 1.5,
            sigmas: 4.0,
            same_rows: 50,
            better: 10.0,
            fixed: 0.9,
        }
    }
}
