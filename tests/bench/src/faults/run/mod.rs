//! A cell, run: the drive brought into the situation, the fault injected, and what comes of it.

mod watched;

pub(super) use watched::run;

use super::bench::Bench;
use super::cell::{Defect, Input, Situation};
use super::controller::{Change, Controller, Doing};
use super::spoiled::Spoiled;
use crate::alignment::held_load_n;
use control::format::TableVelocity;
use control::guard::Look;
use control::plate::DrivePlate;
use control::supervisor::{Demand, State};
use control::travel::TravelLook;
use hal_sim::board::{BoardConfig, Comparators};
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM};
use hal_sim::start::settle;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// CDFS: the nut held, the table slow.
const CDFS: OperatingPoint = OperatingPoint {
    velocity: 2.5e-3,
    base: 0.0,
};
/// DDFS at the paper's fastest nut.
const DDFS: OperatingPoint = OperatingPoint {
    velocity: 20e-3,
    base: 800.0 * RPM,
};

/// Part of the load that friction holds.
const LOAD: f64 = 0.5;
/// Longest that a start may take, s.
const START_S: f64 = 12.0;
/// How long a drive with a fault is watched in its situation, s.
const WATCHED_S: f64 = 1.2;
/// Longest that a machine may take to rest after the reaction, s.
const REST_S: f64 = 4.0;
/// A machine is at rest below that for 50 ms: table m/s, shafts rad/s.
const AT_REST: (f64, f64) = (1e-4, 0.2);
/// Furthest that the middle of the ends is from the table where no end is to be reached, m.
const FAR_M: f64 = 30e-3;
/// How far ahead the switch is where it is to be reached, m.
const NEAR_M: f64 = 1e-3;
/// How far behind a switch the table's soft limit is, m: as far as a stop from 20 mm/s takes, and half as much again, so that the switch
/// is what a healthy drive stops for.
const SOFT_M: f64 = 1.6e-3;
/// The enable switch is opened, or a driver finds a fault, so long after the drive was asked, s.
const OPENED_S: f64 = 0.1;

/// What happens beside the fault: a healthy drive has it too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Event {
    None,
    /// The table comes to the end of its way.
    End,
    /// Somebody opens the enable switch.
    Opened,
    /// A motor's gate driver finds a fault of its stage: it opens the bridge by itself, and pulls its line down.
    DriverFault(Axis),
}

impl Event {
    pub(super) fn of(faults: &[(Input, Defect)]) -> Self {
        let any = |which: fn(&Input) -> bool| faults.iter().any(|(input, _)| which(input));
        if any(|input| matches!(input, Input::EndForward | Input::EndBackward)) {
            Self::End
        } else if any(|input| matches!(input, Input::Enable(_))) {
            Self::Opened
        } else {
            let driver = faults.iter().find_map(|(input, _)| match input {
                Input::DriverFault(axis) => Some(Self::DriverFault(*axis)),
                _ => None,
            });
            driver.unwrap_or(Self::None)
        }
    }
}

/// What a healthy drive does in the same situation with the same event.
#[derive(Clone, Debug, Default)]
pub(super) struct Healthy {
    /// Where its table goes, m, period by period, from when it was last asked something.
    path: Vec<f64>,
    /// When it comes to rest for the event, s after the fault of the others.
    reacted_s: Option<f64>,
}

/// The way of a regular stop from a velocity, m.
pub(super) fn stop_m(plate: &DrivePlate, velocity: f64) -> f64 {
    let (v, a, j) = (
        velocity.abs(),
        plate.feed.acceleration_max,
        plate.feed.jerk_max,
    );
    if v * j > a * a {
        0.5 * v * v / a + 0.5 * v * a / j
    } else {
        // The acceleration does not reach its limit.
        v * (v / j).sqrt()
    }
}

/// A drive in a situation.
pub(super) struct Run {
    pub(super) drive: Drive,
    pub(super) bench: Bench,
    pub(super) period_s: f64,
    pub(super) controller: Controller,
    /// It was reset.
    was_reset: bool,
    /// An index was seen since the supervision's last look.
    index: [bool; 2],
    /// The gate driver that has found a fault of its stage.
    failed_driver: Option<Axis>,
    /// Energy that has gone into the bus, J.
    returned_j: f64,
    /// The table velocity that was last asked.
    asked: TableVelocity,
}

/// Part of the paper's torque ripple, 6 and 2 % of rated, that is there without a current: cogging. What flux harmonics make of
/// it appears only with one (IEEE 1574770). So friction holds both boards' rotors at every angle, as it must where bridges open.
const COGGING: f64 = 0.25;

/// The machine on a board.
fn model(board: BoardKind) -> Model {
    let mut template = Model::coupled();
    template.feed.load_n = LOAD * held_load_n(&template);
    let mut model = board.machine(&template, Coupling::Coupled);
    for axis in Axis::ALL {
        for harmonic in &mut model.motor_mut(axis).torque_harmonics {
            harmonic.amplitude_nm *= COGGING;
        }
    }
    model
}

impl Run {
    /// The drive in its situation on what `config` has of a bus and bridges, the faults not there yet.
    pub(super) fn on(
        board: BoardKind,
        plate: &DrivePlate,
        situation: Situation,
        faults: &[(Input, Defect)],
        seed: u64,
        config: BoardConfig,
    ) -> Result<Self, ExperimentError> {
        let model = model(board);
        let config = BoardConfig {
            comparators: Comparators::Amplifiers,
            ..config
        };
        let starts = matches!(
            situation,
            Situation::Boot | Situation::Unaligned | Situation::Aligning
        );
        let mut drive = if starts {
            Drive::new(&model, Coupling::Coupled, config, plate)?
        } else {
            Drive::aligned(&model, Coupling::Coupled, config, plate)?
        };
        drive.request.demand = match situation {
            Situation::Boot | Situation::Aligning => Demand::Align,
            _ => Demand::Rest,
        };
        if starts {
            settle(&mut drive.board, [1.0, 4.0]);
        }
        let spoiled = faults.iter().zip(0..);
        let spoiled = spoiled.map(|((input, defect), k)| Spoiled::new(*input, *defect, seed + k));
        let feed = &model.feed;
        let mut bench = Bench::new(
            board,
            *plate,
            feed.load_n,
            feed.table_mass_kg,
            spoiled.collect(),
        )?;
        bench.position = drive.board.machine.table_position();
        let mut run = Self {
            period_s: config.pwm_period_s(),
            drive,
            bench,
            controller: Controller::default(),
            was_reset: false,
            index: [false; 2],
            failed_driver: None,
            returned_j: 0.0,
            asked: TableVelocity::ZERO,
        };
        run.prepare(situation)?;
        Ok(run)
    }

    fn prepare(&mut self, situation: Situation) -> Result<(), ExperimentError> {
        const RAMPED_S: f64 = 0.6;
        match situation {
            Situation::Boot => Ok(()),
            Situation::Unaligned => {
                self.until(State::Unaligned)?;
                self.pass(0.1);
                Ok(())
            }
            Situation::Aligning => {
                self.until(State::Aligning)?;
                self.pass(1.0);
                Ok(())
            }
            Situation::Ready => {
                self.until(State::Ready)?;
                self.pass(0.1);
                Ok(())
            }
            Situation::Cdfs => {
                self.until(State::Ready)?;
                self.ask(CDFS)?;
                self.pass(RAMPED_S);
                Ok(())
            }
            Situation::Ddfs | Situation::Reversing | Situation::Stopping => {
                self.until(State::Ready)?;
                self.ask(DDFS)?;
                self.pass(RAMPED_S);
                self.until(State::Running)?;
                if situation == Situation::Reversing {
                    self.ask(OperatingPoint {
                        velocity: -DDFS.velocity,
                        base: -DDFS.base,
                    })?;
                    self.pass(0.04);
                } else if situation == Situation::Stopping {
                    self.drive.request.demand = Demand::Rest;
                    self.pass(0.05);
                }
                Ok(())
            }
        }
    }

    pub(super) fn ask(&mut self, point: OperatingPoint) -> Result<(), ExperimentError> {
        self.drive.command(point.velocity, point.base)?;
        self.asked = TableVelocity::saturating_from_num(point.velocity);
        self.drive.request.demand = Demand::Run;
        Ok(())
    }

    pub(super) fn pass(&mut self, seconds: f64) {
        for _ in 0..(seconds / self.period_s) as u64 {
            self.period();
        }
    }

    pub(super) fn until(&mut self, state: State) -> Result<(), ExperimentError> {
        let longest = (START_S / self.period_s) as u64;
        for _ in 0..longest {
            if self.drive.state() == state {
                return Ok(());
            }
            self.period();
        }
        Err(ExperimentError::NotSteady {
            seconds: START_S,
            velocity_mm_s: 0.0,
            base_rpm: 0.0,
            state: self.drive.state(),
        })
    }

    /// What the drivers do to their bridges, and their lines to the timers' breaks.
    fn drivers(&mut self) {
        let fails = Axis::ALL.map(|axis| self.failed_driver == Some(axis));
        let mut pulled = fails;
        for one in self.bench.spoiled.iter_mut().filter(|one| one.on) {
            let Input::DriverFault(axis) = one.input else {
                continue;
            };
            let k = axis.index();
            match one.defect {
                // Pulled up, it says that all is well.
                Defect::Missing => pulled[k] = false,
                Defect::StuckLow => pulled[k] = true,
                // Some spikes a second are longer than the break's filter.
                Defect::Noisy => pulled[k] |= one.random().abs() < 5.0 * self.period_s,
                Defect::Swapped => pulled = [fails[1], fails[0]],
                _ => {}
            }
        }
        for axis in Axis::ALL {
            let k = axis.index();
            self.drive.board.hold_open(axis, fails[k]);
            if pulled[k] {
                self.drive.board.trip_break(axis);
            }
        }
    }

    /// The chip's part of a period: it does not run in this one.
    fn stands(&mut self) -> bool {
        let before = self.controller.stands();
        let seconds = self.drive.board.period_s();
        match self.controller.period(&mut self.bench.spoiled, seconds) {
            Doing::Stands => {
                if !before {
                    self.was_reset = true;
                    self.begin_anew();
                }
                self.drive.period_in_reset(&mut self.bench);
                return true;
            }
            Doing::Runs {
                slow,
                supply,
                change,
            } => {
                self.drive.board.set_clock(slow);
                self.drive.board.set_reference(supply);
                match change {
                    Some(Change::Starts) => self.begin_anew(),
                    Some(Change::Breaks) => self.drive.board.break_system(),
                    None => {}
                }
            }
        }
        false
    }

    /// Nothing that the chip knew is left, and nothing is asked.
    fn begin_anew(&mut self) {
        let (plate, bench) = (self.bench.plate, &mut self.bench);
        let fits = self.drive.reset(&plate).is_ok() && bench.restart_supervision().is_ok();
        assert!(fits, "the plate fitted before");
        self.asked = TableVelocity::ZERO;
    }

    pub(super) fn period(&mut self) {
        if self.stands() {
            return;
        }
        self.drivers();
        self.drive.period_through(&mut self.bench);
        for axis in Axis::ALL {
            let passed = self.drive.board.take_index_passed(axis);
            if passed {
                self.bench.pass_index(axis);
            }
            self.index[axis.index()] |= self.bench.index_seen(axis, passed);
        }
        let power: f64 = Axis::ALL
            .map(|axis| self.drive.board.power_w(axis))
            .iter()
            .sum();
        self.returned_j += (-power).max(0.0) * self.period_s;
        let running = self.drive.bridges_on();
        let driven = self.drive.state().is_driven();
        let stopped_by = self.drive.state().fault();
        let temperatures = self.bench.temperatures();
        let scale = self.bench.scale_counts();
        let (enabled, ends_open) = (self.bench.enabled, self.bench.ends_open);
        let reference = self.drive.planned();
        let each_ms = (1e-3 / self.period_s).round() as u64;
        if let Some(soft) = &mut self.bench.soft
            && self.drive.periods().is_multiple_of(each_ms)
        {
            soft.look(TravelLook {
                scale: scale.cast_signed(),
                driven,
                reference,
                asked: self.asked,
                ..TravelLook::default()
            });
        }
        let (drive, index) = (&self.drive, &mut self.index);
        self.bench.supervision.period(|| Look {
            supply: drive.board.supply(),
            running,
            driven,
            stopped_by,
            temperatures,
            enabled,
            ends_open,
            scale,
            current_sum: drive.current_sums(),
            theta: Axis::ALL.map(|axis| drive.estimate(axis).theta.0),
            torque: drive.asked_torques(),
            index: std::mem::take(index),
            ..Look::default()
        });
    }

    pub(super) fn at_rest(&self) -> bool {
        let machine = &self.drive.board.machine;
        let still = |axis| machine.motor(axis).omega.abs() < AT_REST.1;
        machine.table_velocity().abs() < AT_REST.0 && Axis::ALL.into_iter().all(still)
    }

    /// The drive comes to rest although run is asked.
    pub(super) fn reacts(&self) -> bool {
        match self.drive.state() {
            State::Fault(_) => true,
            State::Stopping => self.bench.demand == Demand::Run,
            _ => self.was_reset,
        }
    }

    /// What a host asks whose command is wrong in this way.
    fn spoil_command(&mut self, periods: usize) {
        let most = self.bench.plate.feed.velocity_max * 0.999;
        for one in &mut self.bench.spoiled {
            if one.input != Input::Command || !one.on {
                continue;
            }
            let base = if self.drive.speed().speed[1].omega_e >= 0 {
                1.0
            } else {
                -1.0
            };
            let velocity = match one.defect {
                Defect::StuckLow => -most,
                Defect::StuckHigh => most,
                Defect::Offset => DDFS.velocity + 10e-3,
                Defect::WrongSign => -DDFS.velocity,
                Defect::Noisy if periods.is_multiple_of(400) => most * one.random(),
                _ => continue,
            };
            // What is refused leaves the command as it was.
            let _ = self.drive.command(velocity, base * DDFS.base);
        }
    }
}

/// The seed of the noise of a cell of that name.
pub(super) fn seed(name: &str) -> u64 {
    // FNV-1a, 64 bits.
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}
