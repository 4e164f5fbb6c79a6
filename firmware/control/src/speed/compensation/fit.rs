//! Whether a table that was learned before still fits the machine.
//!
//! A table belongs to the angle that its encoder counted then. Encoders that are homed elsewhere, exchanged or mounted again turn
//! each order's coefficient by the order times that angle, so most of them are wrong at once. The drive therefore compares what
//! it learns with what it started from, order by order: an order has moved if it is further from its start than 0.7 of it, which is
//! 41 degrees of phase or a size that is 70 % off. A table does not fit if most of its orders have moved: a single one does so
//! where its cause changes, as dead time's does with speed.

use super::line::{Line, Phasor};
use super::slope::LoadSlope;
use super::{Compensation, CompensationConfig, LineConfig, SPEED_PART_MAX, TORQUES};
use crate::codes;

codes! {
    /// What the drive has found of a table that it started with.
    TableFit {
        None = 0, "none", "Nothing that was learned before is set.";
        Unchecked = 1, "unchecked", "A saved table is used. Whether it fits shows once its shaft has turned at a steady speed for twice the learning time.";
        Fits = 2, "fits", "What is learned is what was saved.";
        Discarded = 3, "does not fit", "The saved table did not fit and is not used any more: the drive learns from zero. Was the encoder homed elsewhere, turned or exchanged? `settings learned --save` keeps the new table.";
        Drifted = 4, "drifted", "The saved table did fit, and most of its orders have moved since: the drive goes on with what it learns. `settings learned --save` keeps it.";
        Forgotten = 5, "not used", "The rotor was found anew, in one of as many places as it has pole pairs. No saved order repeats in each of them, so none is used: the drive learns from zero.";
    }
}

/// Tables: torque of screw and nut, encoder of screw and nut, lead.
pub const TABLES: usize = 5;

/// All tables' states in a word, four bits each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableFits(pub u32);

impl TableFits {
    /// What a table is part of.
    pub const NAMES: [&'static str; TABLES] = [
        "screw torque",
        "nut torque",
        "screw encoder",
        "nut encoder",
        "lead",
    ];

    /// A table's state; `None` if the word holds no such state.
    #[must_use]
    pub const fn of(self, table: usize) -> Option<TableFit> {
        TableFit::of_word(self.0 >> Self::shift(table) & 15)
    }

    const fn with(self, table: usize, fit: TableFit) -> Self {
        let shift = Self::shift(table);
        Self(self.0 & !(15 << shift) | fit.word() << shift)
    }

    const fn shift(table: usize) -> u32 {
        (table as u32 & 7).wrapping_mul(4)
    }
}

/// Of the tables, what was found and how long each was learned.
#[derive(Clone, Copy, Debug)]
pub(super) struct TableChecks {
    fits: TableFits,
    /// Checks at the full learning rate that each has had, 2^-15.
    learned: [u32; TABLES],
    /// The same since speeds and loads are steady.
    settled: [u32; TABLES],
    /// Lines of each whose start is not used, one bit a line.
    forgotten: [u8; TABLES],
    /// Lines of each torque that a second load has divided: their start says nothing of them any more.
    divided: [u8; 2],
    next: u8,
}

impl TableChecks {
    pub(super) const fn new() -> Self {
        Self {
            fits: TableFits(0),
            learned: [0; TABLES],
            settled: [0; TABLES],
            forgotten: [0; TABLES],
            divided: [0; 2],
            next: 0,
        }
    }

    /// Speed or load have changed. `true`: what a motor's torque repeats had been learned before.
    pub(super) fn unsettle(&mut self, config: &CompensationConfig) -> bool {
        let settled = self.is_settled(config);
        self.settled = [0; TABLES];
        settled
    }

    /// A second load has divided a line of a motor's torque into what scales with it and what does not.
    pub(super) fn divide(&mut self, motor: usize, line: usize) {
        if let Some(divided) = self.divided.get_mut(motor) {
            *divided |= 1u8.wrapping_shl(line as u32);
        }
    }

    /// What a motor's torque repeats has been learned since speeds and loads are steady.
    pub(super) fn is_settled(&self, config: &CompensationConfig) -> bool {
        self.halved(config, 0) | self.halved(config, 1) != 0
    }

    /// How often the learning of a table has been halved since speeds and loads are steady: after four of its time constants and after each
    /// twice as many, [`HALVED_MOST`] times at most. So noise that is no ripple averages out (Robbins and Monro, "A stochastic
    /// approximation method", Ann. Math. Statist. 22, 1951: steps that fall as one over their number).
    #[inline(always)]
    pub(super) fn halved(&self, config: &CompensationConfig, table: usize) -> u32 {
        let slower = if table < 2 { 1 } else { SPEED_SLOWER };
        let settled = self.settled.get(table).copied().unwrap_or(0);
        let twos = settled.checked_div(config.checked.wrapping_mul(slower));
        let halved = twos.and_then(u32::checked_ilog2).unwrap_or(0);
        halved.min(HALVED_MOST)
    }
}

/// See [`TableChecks::halved`].
const HALVED_MOST: u32 = 3;

/// What the lines of a table say of it.
struct Found {
    /// Orders with a start that is more than noise.
    saved: u32,
    /// Those of them that learn at the present speed.
    learning: u32,
    /// Those of these that have moved.
    moved: u32,
}

impl Found {
    fn of(lines: &[Line], configs: &[LineConfig], floor: i32, mut left_out: u8) -> Self {
        let mut found = Self {
            saved: 0,
            learning: 0,
            moved: 0,
        };
        let least = square(Phasor { re: floor, im: 0 });
        for (line, config) in lines.iter().zip(configs) {
            let start = square(config.start);
            let is_left_out = left_out & 1 != 0;
            left_out >>= 1;
            if start < least || is_left_out {
                continue;
            }
            found.saved = found.saved.saturating_add(1);
            if line.learns() {
                found.learning = found.learning.saturating_add(1);
                let away = square(line.coefficient().minus(config.start));
                if away > start >> 1 {
                    found.moved = found.moved.saturating_add(1);
                }
            }
        }
        found
    }

    /// Most of the orders that learn have moved.
    fn most_moved(&self) -> bool {
        self.moved > self.learning >> 1
    }
}

/// Square of the length, of parts within 2^29.
fn square(x: Phasor) -> u64 {
    let one = |x: i32| u64::from(x.unsigned_abs()).wrapping_mul(x.unsigned_abs().into());
    one(x.re).wrapping_add(one(x.im))
}

impl Compensation {
    /// What was found of each table.
    #[must_use]
    #[inline(always)]
    pub const fn tables(&self) -> TableFits {
        self.checks.fits
    }

    /// Checks one table, of shafts that turn by `theta_steps`: as often as a line is tuned.
    #[inline(never)]
    pub(super) fn check(&mut self, config: &CompensationConfig, theta_steps: [i32; 2]) {
        let table = self.checks.next;
        self.checks.next = match table {
            0..LAST => table.saturating_add(1),
            _ => 0,
        };
        let learns = self.learns();
        let [screw, nut] = theta_steps;
        let relative = screw.wrapping_sub(nut).unsigned_abs();
        let [screw, nut] = [screw, nut].map(i32::unsigned_abs);
        let [screw_torque, nut_torque] = &mut self.torque;
        let [screw_angle, nut_angle] = &mut self.angle;
        let [screw_start, nut_start] = &config.torque;
        let [screw_angle_start, nut_angle_start] = &config.angle;
        // Once a turn of an encoder and once of the lead are the same where the other motor stands.
        let apart = screw.min(nut).min(relative);
        let (lines, starts, speed): (&mut [Line], &[LineConfig], u32) = match table {
            0 => (screw_torque, screw_start, screw),
            1 => (nut_torque, nut_start, nut),
            2 => (screw_angle, screw_angle_start, apart),
            3 => (nut_angle, nut_angle_start, apart),
            _ => (&mut self.travel, &config.travel, apart),
        };
        let (floor, slower) = if table < 2 {
            (config.torque_max >> 8, 1)
        } else {
            (SPEED_PART_MAX >> 12, SPEED_SLOWER)
        };
        let table = usize::from(table);
        let forgotten = self.checks.forgotten.get(table).copied().unwrap_or(0);
        let divided = self.checks.divided.get(table).copied().unwrap_or(0);
        let found = Found::of(lines, starts, floor, forgotten | divided);
        let Some(learned) = self.checks.learned.get_mut(table) else {
            return;
        };
        let part = config.part(speed).unsigned_abs() >> 16;
        let tells = learns && found.learning != 0 && part >= LEAST_PART;
        if tells {
            *learned = learned.saturating_add(part);
        }
        if learns && let Some(settled) = self.checks.settled.get_mut(table) {
            *settled = settled.saturating_add(part);
        }
        let enough = config.checked.saturating_mul(slower);
        let moved = tells && *learned >= enough >> 2 && found.most_moved();
        let fit = match self.checks.fits.of(table) {
            _ if found.saved == 0 && divided != 0 => return,
            _ if found.saved == 0 && forgotten != 0 => TableFit::Forgotten,
            _ if found.saved == 0 => TableFit::None,
            Some(TableFit::Discarded) => return,
            Some(TableFit::Fits | TableFit::Drifted) if !tells => return,
            Some(TableFit::Fits | TableFit::Drifted) if moved => TableFit::Drifted,
            Some(TableFit::Fits | TableFit::Drifted) => TableFit::Fits,
            _ if moved => {
                lines.iter_mut().for_each(Line::restart);
                if let Some(slopes) = self.slopes.get_mut(table) {
                    *slopes = [LoadSlope::NONE; TORQUES];
                }
                TableFit::Discarded
            }
            _ if *learned < enough => TableFit::Unchecked,
            _ => TableFit::Fits,
        };
        self.checks.fits = self.checks.fits.with(table, fit);
    }
}

/// Orders of a table that are not the same in each of `places` of a turn of both shafts that it counts from: they start at zero. A bit for
/// each that had a start.
#[inline(never)]
fn forget(
    lines: &mut [Line],
    slopes: &mut [LoadSlope],
    configs: &[LineConfig],
    places: [u32; 2],
) -> u8 {
    let mut forgotten = 0;
    for (k, (line, config)) in lines.iter_mut().zip(configs).enumerate() {
        let repeats = |places: u32| line.order().0.checked_rem(places.wrapping_shl(16)) == Some(0);
        if !places.into_iter().all(repeats) {
            line.restart();
            if let Some(slope) = slopes.get_mut(k) {
                *slope = LoadSlope::NONE;
            }
            if config.start != Phasor::ZERO {
                forgotten |= 1u8.wrapping_shl(k as u32);
            }
        }
    }
    forgotten
}

impl Compensation {
    /// The rotors were found again by their currents. Orders that differ between the places where a rotor may stand are learned from zero. The
    /// lead's angle is between both shafts, so its orders must be the same in the places of both.
    #[cold]
    #[inline(never)]
    pub(crate) fn forget(&mut self, config: &CompensationConfig) {
        let [screw, nut] = config.places;
        let [screw_torque, nut_torque] = &mut self.torque;
        let [screw_slopes, nut_slopes] = &mut self.slopes;
        let [screw_angle, nut_angle] = &mut self.angle;
        let [screw_start, nut_start] = &config.torque;
        let [screw_angle_start, nut_angle_start] = &config.angle;
        self.checks = TableChecks {
            forgotten: [
                forget(screw_torque, screw_slopes, screw_start, [screw; 2]),
                forget(nut_torque, nut_slopes, nut_start, [nut; 2]),
                forget(screw_angle, &mut [], screw_angle_start, [screw; 2]),
                forget(nut_angle, &mut [], nut_angle_start, [nut; 2]),
                forget(&mut self.travel, &mut [], &config.travel, config.places),
            ],
            ..TableChecks::new()
        };
    }
}

/// The table that is checked last.
const LAST: u8 = TABLES as u8 - 1;
/// A shaft that learns at less of the full rate, 2^-15, tells nothing: a sixty-fourth, 1 rpm at half a second of learning. A motor
/// that is held still turns less.
const LEAST_PART: u32 = 1 << 9;
/// How much slower the errors of encoders and lead are learned than torque, at most.
const SPEED_SLOWER: u32 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::encoder::Interface;
    use crate::plate::{CompensationPlate, OrderPlate, TorqueOrderPlate, test_plate};

    #[test]
    fn a_divided_line_is_its_motors() {
        let mut checks = TableChecks::new();
        checks.divide(1, 2);
        checks.divide(1, 0);
        // There are two motors.
        checks.divide(2, 0);
        assert_eq!(checks.divided, [0, 0b101]);
    }

    #[test]
    fn a_rotor_found_anew_keeps_the_orders_that_repeat_with_its_poles() {
        let order = |order: f64| TorqueOrderPlate {
            re: 0.1,
            im: -0.1,
            ..TorqueOrderPlate::unknown(order)
        };
        let mut plate = test_plate();
        // Five pole pairs: orders 30 and 5 are the same in each of five places, 1 and 7.5 are not.
        let mut known = CompensationPlate::NONE;
        known.learning_s = 0.5;
        known.torque[0][0] = order(30.0);
        known.torque[0][1] = order(7.5);
        known.torque[0][2] = order(5.0);
        known.angle[1][0] = OrderPlate {
            order: 1.0,
            re: 1e-3,
            im: 0.0,
        };
        plate.compensation = known;
        let config = plate.config().unwrap().compensation;
        let mut compensation = Compensation::new(&config);
        compensation.forget(&config);
        let given = |line: usize| compensation.coefficient(line) != Phasor::ZERO;
        assert_eq!([given(0), given(1), given(2)], [true, false, true]);
        for table in 0..TABLES {
            compensation.check(&config, [0; 2]);
            let fit = compensation.tables().of(table);
            let expected = match table {
                0 => TableFit::Unchecked,
                3 => TableFit::Forgotten,
                _ => TableFit::None,
            };
            assert_eq!(fit, Some(expected), "{}", TableFits::NAMES[table]);
        }
    }

    /// Index on both: the angle between the shafts is known within a turn. With one incremental encoder of five pole pairs, it is one of five.
    #[test]
    fn the_lead_keeps_orders_that_both_shafts_repeat() {
        for (interfaces, kept) in [
            ([Interface::IncrementalWithIndex; 2], [true, true, false]),
            (
                [Interface::Mt6835, Interface::IncrementalWithIndex],
                [true, true, false],
            ),
            (
                [Interface::Incremental, Interface::IncrementalWithIndex],
                [false, true, false],
            ),
            ([Interface::Incremental; 2], [false, true, false]),
        ] {
            let mut plate = test_plate();
            for (motor, interface) in plate.motors.iter_mut().zip(interfaces) {
                motor.encoder.interface = interface;
                motor.encoder.counts_per_turn = 1 << 21;
            }
            plate.compensation.learning_s = 0.5;
            for (line, order) in [2.0, 5.0, 7.5].into_iter().enumerate() {
                plate.compensation.travel[line] = OrderPlate {
                    order,
                    re: 1e-3,
                    im: 1e-3,
                };
            }
            let config = plate.config().unwrap().compensation;
            let mut compensation = Compensation::new(&config);
            compensation.forget(&config);
            let given = [0, 1, 2].map(|k| compensation.travel[k].coefficient() != Phasor::ZERO);
            assert_eq!(given, kept, "{interfaces:?}");
        }
    }

    #[test]
    fn an_encoder_that_knows_its_turn_keeps_whole_orders() {
        for (interface, kept) in [
            (Interface::Incremental, [false, false]),
            (Interface::IncrementalWithIndex, [true, false]),
            (Interface::Mt6835, [true, false]),
        ] {
            let mut plate = test_plate();
            plate.motors[0].encoder.interface = interface;
            plate.motors[0].encoder.counts_per_turn = 1 << 21;
            plate.compensation.learning_s = 0.5;
            for (line, order) in [36.0, 7.5].into_iter().enumerate() {
                plate.compensation.torque[0][line] = TorqueOrderPlate {
                    re: 0.1,
                    im: -0.1,
                    ..TorqueOrderPlate::unknown(order)
                };
            }
            let config = plate.config().unwrap().compensation;
            let mut compensation = Compensation::new(&config);
            compensation.forget(&config);
            let given = |line: usize| compensation.coefficient(line) != Phasor::ZERO;
            assert_eq!([given(0), given(1)], kept, "{interface:?}");
        }
    }
}
