//! The words between the parts of the application. Each word has one writer; none needs a lock.

use crate::rows::Rows;
use control::compensation::line::Phasor;
use control::compensation::{LINES, TORQUES};
use control::fault::Fault;
use control::format::{Current, MechanicalSpeed, Speed, TableVelocity};
use control::interlock;
use control::plate::CompensationPlate;
use control::torque::TorqueCommand;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};
use link::codes::{Demand, State};
use link::settings::Settings;
use link::view::DriveView;

/// What commands and supervision tell the speed task, and the other way.
#[derive(Debug)]
pub struct DriveExchange {
    /// Table velocity, 2^-28 m/s.
    pub(crate) velocity: AtomicI32,
    /// Common speed, 2^-18 rad/s, mechanical.
    pub(crate) base: AtomicI32,
    /// The motor that follows a torque, 1 is the screw's, 2 the nut's, 0: none.
    pub(crate) torque_motor: AtomicU32,
    /// Its current along q, 2^-20 A, and its speed limit, 2^-18 rad/s, mechanical.
    pub(crate) torque: [AtomicI32; 2],
    /// Counts new commands: the speed task takes the words above with each.
    pub(crate) sequence: AtomicU32,
    /// A [`Demand`]'s word.
    pub(crate) demand: AtomicU32,
    /// Changes while the commander is there.
    pub(crate) heartbeat: AtomicU32,
    /// The references are at the command.
    pub(crate) arrived: AtomicBool,
    /// The table's reference and its change a step, as planned.
    pub(crate) planned: [AtomicI32; 2],
    /// The table may not go forwards, backwards; an end switch is sought forwards, backwards.
    pub(crate) way: [[AtomicBool; 2]; 2],
    /// A [`Travel`](link::message::Travel)'s word.
    pub(crate) travel: AtomicU32,
    /// See [`interlock::Inputs::table_step`], with its sign bit turned; 0: nobody knows.
    pub(crate) table_step: AtomicI32,
    /// Word of the fault that the supervision has found; 0: none.
    pub(crate) found: AtomicU32,
}

/// What the speed task tells the lines.
#[derive(Debug)]
#[repr(C)]
pub struct TelemetryExchange {
    /// Word of the telemetry request that the speed task serves; 0: none.
    pub(crate) served: AtomicU32,
    /// All lines of the compensation have been shown since the start.
    pub(crate) all_learned: AtomicBool,
    /// What each line of the compensation has learned, re and im.
    pub(crate) learned: [[AtomicI32; 2]; LINES],
    /// How what the torques' lines have learned changes with the load, re and im.
    pub(crate) slopes: [[AtomicI32; 2]; 2 * TORQUES],
    /// Rows of telemetry.
    pub(crate) rows: Rows,
}

impl TelemetryExchange {
    /// Of a drive that has not begun.
    #[must_use]
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self {
            served: AtomicU32::new(0),
            all_learned: AtomicBool::new(false),
            learned: [const { [const { AtomicI32::new(0) }; 2] }; LINES],
            slopes: [const { [const { AtomicI32::new(0) }; 2] }; 2 * TORQUES],
            rows: Rows::new(),
        }
    }

    /// Puts what was learned into settings, in place of the `orders` that the drive has started with.
    #[inline(never)]
    pub(crate) fn put_learned(&self, settings: &mut Settings, orders: &CompensationPlate) {
        let mut orders = *orders;
        let phasor = |parts: &[AtomicI32; 2]| {
            let [re, im] = parts.each_ref().map(|part| part.load(Relaxed));
            Phasor { re, im }
        };
        for (line, learned) in self.learned.iter().enumerate() {
            orders.keep(line, phasor(learned));
        }
        for (line, per_load) in self.slopes.iter().enumerate() {
            orders.keep_slope(line, phasor(per_load));
        }
        settings.put_orders(&orders);
    }

    /// The speed task, above this code, adds no row from here on.
    pub(crate) fn end_stream(&self) {
        self.served.store(0, Relaxed);
        self.rows.clear();
    }
}

impl DriveExchange {
    /// Of a drive that has not begun.
    #[must_use]
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self {
            velocity: AtomicI32::new(0),
            base: AtomicI32::new(0),
            torque_motor: AtomicU32::new(0),
            torque: [const { AtomicI32::new(0) }; 2],
            sequence: AtomicU32::new(0),
            demand: AtomicU32::new(Demand::Rest.word()),
            heartbeat: AtomicU32::new(0),
            arrived: AtomicBool::new(false),
            planned: [const { AtomicI32::new(0) }; 2],
            way: [const { [const { AtomicBool::new(false) }; 2] }; 2],
            travel: AtomicU32::new(0),
            table_step: AtomicI32::new(0),
            found: AtomicU32::new(0),
        }
    }

    /// A reset is demanded.
    #[must_use]
    pub fn is_reset(&self) -> bool {
        self.demand.load(Relaxed) == Demand::Reset.word()
    }

    /// The commander is there.
    pub(crate) fn renew(&self) {
        count(&self.heartbeat);
    }

    pub(crate) fn ask(&self, demand: Demand) {
        self.demand.store(demand.word(), Relaxed);
    }

    pub(crate) fn ask_speeds(&self, velocity: i32, base: i32) {
        self.torque_motor.store(0, Relaxed);
        self.velocity.store(velocity, Relaxed);
        self.base.store(base, Relaxed);
        count(&self.sequence);
    }

    pub(crate) fn ask_torque(&self, torque: TorqueCommand, base: i32) {
        let values = [torque.i_q.to_bits(), torque.speed_max.to_bits()];
        for (word, value) in self.torque.iter().zip(values) {
            word.store(value, Relaxed);
        }
        self.velocity.store(0, Relaxed);
        self.base.store(base, Relaxed);
        let motor = if torque.motor == 0 { 1 } else { 2 };
        self.torque_motor.store(motor, Relaxed);
        count(&self.sequence);
    }

    /// The torque that is asked.
    pub(crate) fn torque(&self) -> Option<TorqueCommand> {
        let motor = self.torque_motor.load(Relaxed).checked_sub(1)?;
        let [i_q, speed] = self.torque.each_ref().map(|word| word.load(Relaxed));
        Some(TorqueCommand {
            motor: usize::from(motor != 0),
            i_q: Current::from_bits(i_q),
            speed_max: MechanicalSpeed::from_bits(speed),
        })
    }

    /// Which way the table is asked to go; `relative` is what the screw turns against the nut, mechanical rad/s.
    pub(crate) fn heading(&self, relative: Speed) -> TableVelocity {
        match self.torque() {
            None => TableVelocity::from_bits(self.velocity.load(Relaxed)),
            Some(torque) => torque.heading(relative),
        }
    }

    pub(crate) fn tell_table(&self, step: Option<i32>) {
        let word = step.map_or(0, |step| step ^ i32::MIN);
        self.table_step.store(word, Relaxed);
    }

    /// What the contacts say, with what the supervision says of the table's travel.
    #[inline(always)]
    pub(crate) fn with_way(&self, contacts: interlock::Inputs) -> interlock::Inputs {
        let [blocked, homing] = self
            .way
            .each_ref()
            .map(|both| both.each_ref().map(|way| way.load(Relaxed)));
        interlock::Inputs {
            blocked,
            homing,
            table_step: Some(self.table_step.load(Relaxed) ^ i32::MIN)
                .filter(|step| *step != i32::MIN),
            ..contacts
        }
    }

    /// What the supervision has found.
    #[inline(always)]
    pub(crate) fn found(&self) -> Option<Fault> {
        Fault::of_word(self.found.load(Relaxed))
    }
}

/// What the view says that the drive is doing.
#[must_use]
pub fn state(view: &DriveView) -> State {
    let look = || State::of_words(view.state.load(Relaxed), view.fault.load(Relaxed));
    // A fault may go between the two words.
    look().or_else(look).unwrap_or_default()
}

/// Says in the view what the drive is doing.
#[inline(always)]
pub fn show(view: &DriveView, state: State) {
    view.state.store(state.word(), Relaxed);
    view.fault.store(state.fault_word(), Relaxed);
}

/// Counts a word up. Only the word's one writer may call it.
#[inline(always)]
pub fn count(word: &AtomicU32) -> u32 {
    let next = word.load(Relaxed).wrapping_add(1);
    word.store(next, Relaxed);
    next
}
