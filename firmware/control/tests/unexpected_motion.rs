//! No motion begins and no bridge closes without a command, and none stays closed past a stop: a random walk over demands, contacts, end switches,
//! heartbeats and faults, through both current loops and the speed task.
//!
//! ISO 14118 and IEC 60204-1 (5.4, 9.2) ask for protection against unexpected start-up.
#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::unwrap_used
)]

use control::coordinator::Command;
use control::current_loop::{CurrentLoop, CurrentLoopConfig};
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::format::{MechanicalSpeed, TableVelocity};
use control::interlock::Inputs;
use control::motor_io::{MotorIo, Sensing};
use control::plate::DriveConfig;
use control::rates::STEPS_PER_LOOK;
use control::speed_task::SpeedTask;
use control::supervisor::{Demand, Request, State};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::collections::BTreeMap;

#[path = "../../src/board/nucleo_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod nucleo_plate;
#[path = "../../src/board/paper_machine.rs"]
#[allow(dead_code, reason = "the board's file uses it")]
mod paper_machine;

/// Steps of the speed task in all walks together.
const STEPS: u32 = 2_400_000;
/// Steps in which a stop of the commanded speeds ends: 1 s. From 20 rad/s it takes a fifth of that.
const STOP_STEPS: u32 = 5000;
/// Steps from a violated condition to its effect on a start: two looks, the look's own time and the current loops' periods.
const LATE_STEPS: u32 = 4 * STEPS_PER_LOOK;

/// Bus voltage, V.
const BUS_V: f64 = 36.0;

/// The registers of a motor whose shaft stands, and its windings: so an alignment finds them well and takes its time.
struct Registers {
    sensing: Sensing,
    zero_counts: f64,
    amps_per_count: f64,
    bus: u32,
    /// Compare value of an output that is always on.
    top: f64,
    ohm: f64,
    /// How much a volt changes the current in a period, A.
    amps_per_volt: f64,
    /// Of the next period.
    duty: [f64; 3],
    amps: [f64; 3],
    closed: bool,
}

impl Registers {
    fn of(motor: &CurrentLoopConfig) -> Self {
        let (plate, board) = (&nucleo_plate::PLATE.motors[0], &nucleo_plate::PLATE.board);
        Self {
            sensing: motor.sensing(),
            zero_counts: board.zero_counts,
            amps_per_count: board.amps_per_count,
            bus: (BUS_V / board.bus_volts_per_count) as u32,
            top: f64::from(motor.modulation.period),
            ohm: plate.resistance_ohm,
            amps_per_volt: 1.0 / (board.pwm_hz * plate.inductance_h),
            duty: [0.0; 3],
            amps: [0.0; 3],
            closed: false,
        }
    }

    /// A period of the bridge passes. The windings' star point is at the mean of the phases.
    fn pass(&mut self) {
        let mean = self.duty.iter().sum::<f64>() / 3.0;
        for (amps, duty) in self.amps.iter_mut().zip(self.duty) {
            let volts = BUS_V * (duty - mean) - self.ohm * *amps;
            *amps = if self.closed {
                *amps + self.amps_per_volt * volts
            } else {
                0.0
            };
        }
    }
}

impl MotorIo for Registers {
    fn acknowledge(&mut self) -> bool {
        false
    }
    fn encoder(&mut self) -> u32 {
        0
    }
    fn sensing(&self) -> Sensing {
        self.sensing
    }
    fn current(&mut self) -> [u16; 3] {
        self.amps
            .map(|amps| (self.zero_counts + amps / self.amps_per_count).round() as u16)
    }
    fn bus(&mut self) -> u32 {
        self.bus
    }
    fn write(&mut self, compare: [u16; 3]) {
        self.duty = compare.map(|counts| f64::from(counts) / self.top);
    }
    fn close(&mut self) {
        self.closed = true;
    }
    fn open(&mut self) {
        self.closed = false;
    }
    fn clear_break(&mut self) {}
    fn in_time(&mut self) -> bool {
        true
    }
}

/// Conditions of motion as a walk varies them: each changes now and then.
struct World {
    random: Xoshiro256PlusPlus,
    demand: Demand,
    contacts: [bool; 2],
    ends_open: [bool; 2],
    beats: bool,
    heartbeat: u32,
    /// Steps since the heartbeat last changed.
    silent: u32,
}

impl World {
    fn step(&mut self) -> (Request, Option<Fault>) {
        let random = &mut self.random;
        if random.random_ratio(1, 300) {
            self.demand = match random.random_range(0..10) {
                0 => Demand::Rest,
                1..4 => Demand::Reset,
                4..6 => Demand::Align,
                _ => Demand::Run,
            };
        }
        for contact in &mut self.contacts {
            let odds = if *contact { 3000 } else { 100 };
            *contact ^= random.random_ratio(1, odds);
        }
        for open in &mut self.ends_open {
            let odds = if *open { 100 } else { 3000 };
            *open ^= random.random_ratio(1, odds);
        }
        let odds = if self.beats { 10_000 } else { 4000 };
        self.beats ^= random.random_ratio(1, odds);
        self.silent += 1;
        if self.beats {
            self.heartbeat = self.heartbeat.wrapping_add(1);
            self.silent = 0;
        }
        let fault = random
            .random_ratio(1, 5000)
            .then(|| Fault::ALL[random.random_range(0..Fault::ALL.len())]);
        let [end_forward, end_backward] = self.ends_open;
        let request = Request {
            demand: self.demand,
            heartbeat: self.heartbeat,
            inputs: Inputs {
                enabled: self.contacts,
                end_forward,
                end_backward,
                ..Inputs::CLEAR
            },
            scale: None,
        };
        (request, fault)
    }

    /// Which conditions hold: motion is demanded, both contacts are closed, somebody is there.
    fn conditions(&self, config: &DriveConfig) -> [bool; 3] {
        [
            matches!(self.demand, Demand::Align | Demand::Run),
            self.contacts == [true; 2],
            self.silent <= (config.heartbeat_looks + 1) * STEPS_PER_LOOK,
        ]
    }
}

/// Steps for which the windings of an interrupted alignment are shorted, until rotors that stand are seen to.
fn shorted_steps(config: &DriveConfig) -> u32 {
    u32::from(config.alignment.probes.rest_steps)
}

/// How often each state was entered, by its name.
type Visits = BTreeMap<&'static str, u32>;

fn walk(config: &DriveConfig, seed: u64, steps: u32, visits: &mut Visits) {
    let mut task = SpeedTask::new(config);
    let mut loops = config.current_loops.each_ref().map(CurrentLoop::new);
    let exchanges = config
        .current_loops
        .each_ref()
        .map(|motor| MotorExchange::new(motor, config.speed_divider));
    let mut registers = config.current_loops.each_ref().map(Registers::of);
    let mut world = World {
        random: Xoshiro256PlusPlus::seed_from_u64(seed),
        demand: Demand::Rest,
        contacts: [true; 2],
        ends_open: [false; 2],
        beats: true,
        heartbeat: 0,
        silent: 0,
    };
    let mut state = State::Boot;
    // Steps since each condition held.
    let mut since = [u32::MAX; 3];
    for step in 0..steps {
        let (request, fault) = world.step();
        for (since, holds) in since.iter_mut().zip(world.conditions(config)) {
            *since = if holds { 0 } else { since.saturating_add(1) };
        }
        if world.random.random_ratio(1, 1000) {
            // A motor that stands is found to be stalled where it is to turn: rest keeps it running.
            let moves = f64::from(u8::from(world.random.random_ratio(1, 4)));
            let command = Command {
                velocity: TableVelocity::from_num(moves * world.random.random_range(-0.02..0.02)),
                base: MechanicalSpeed::from_num(moves * world.random.random_range(-20.0..20.0)),
            };
            task.command(config, command).unwrap();
        }
        let next = task
            .step(config, request, exchanges.each_ref(), fault)
            .state;
        if next != state {
            *visits.entry(next.name()).or_default() += 1;
        }
        let begins = next.has_bridges_on() && !state.has_bridges_on();
        assert!(
            !begins || since.iter().all(|since| *since <= LATE_STEPS),
            "seed {seed}, step {step}: {state:?} becomes {next:?}; steps since motion was demanded, the contacts were closed and \
             somebody was there: {since:?}, {LATE_STEPS} at most"
        );
        state = next;
        let (mut closed, mut closes) = (false, false);
        for _ in 0..config.speed_divider {
            for k in 0..2 {
                let (motor, exchange) = (&config.current_loops[k], &exchanges[k]);
                let before = registers[k].closed;
                loops[k].period(motor, &mut registers[k], exchange, || ());
                registers[k].pass();
                closed |= registers[k].closed;
                closes |= registers[k].closed && !before;
            }
        }
        let within = match state {
            _ if closes => LATE_STEPS,
            State::Aligning => LATE_STEPS + shorted_steps(config),
            _ => STOP_STEPS,
        };
        assert!(
            !closed || since.iter().all(|since| *since <= within),
            "seed {seed}, step {step}: a bridge is closed in {state:?}; steps since motion was demanded, the contacts were closed \
             and somebody was there: {since:?}, {within} at most"
        );
    }
}

#[test]
fn no_bridge_closes_without_a_command_or_with_an_open_enable_contact() {
    let plate = &nucleo_plate::PLATE;
    let config = plate.config().unwrap();
    let mut visits = Visits::new();
    let walks = 24;
    for seed in 0..walks {
        let steps = STEPS / walks as u32;
        if seed % 2 == 0 {
            walk(&config, seed, steps, &mut visits);
        } else {
            walk(&config.aligned(plate), seed, steps, &mut visits);
        }
    }
    println!("{visits:?}");
    for (name, least) in [
        ("unaligned", 50),
        ("aligning", 50),
        ("ready", 50),
        ("running", 50),
        ("holding", 20),
        ("stopping", 20),
        ("fault", 100),
    ] {
        let count = visits.get(name).copied().unwrap_or_default();
        assert!(
            count >= least,
            "{name} was entered {count} times: {visits:?}"
        );
    }
}

/// A drive that was switched on waits with open bridges for as long as nothing is demanded.
#[test]
fn a_drive_that_is_switched_on_waits_for_a_demand() {
    let plate = &nucleo_plate::PLATE;
    for (config, waits) in [
        (plate.config().unwrap(), State::Unaligned),
        (plate.config().unwrap().aligned(plate), State::Ready),
    ] {
        let mut task = SpeedTask::new(&config);
        let mut loops = config.current_loops.each_ref().map(CurrentLoop::new);
        let exchanges = config
            .current_loops
            .each_ref()
            .map(|motor| MotorExchange::new(motor, config.speed_divider));
        let mut state = State::Boot;
        for heartbeat in 0..50_000 {
            let request = Request {
                heartbeat,
                ..Request::default()
            };
            state = task
                .step(&config, request, exchanges.each_ref(), None)
                .state;
            for k in 0..2 {
                let motor = &config.current_loops[k];
                let mut registers = Registers::of(motor);
                for _ in 0..config.speed_divider {
                    loops[k].period(motor, &mut registers, &exchanges[k], || ());
                    assert!(!registers.closed, "{state:?}");
                }
            }
        }
        assert_eq!(state, waits);
    }
}
