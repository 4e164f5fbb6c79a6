//! Any raw input in any order in any state, through the whole of the control: both current loops, the speed task, the guard.
//! A debug build panics where a sum would leave its word; beside that the duty must be legal and the voltage in its circle.
#![allow(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::unwrap_used
)]

use control::controller_supply::SupplyReading;
use control::coordinator::Command;
use control::current_loop::{CurrentLoop, PwmCommand};
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::format::{MechanicalSpeed, TableVelocity};
use control::guard::{Guard, GuardConfig, GuardPlate, Look};
use control::interlock::Inputs;
use control::motor_io::{MotorIo, Sensing};
use control::plate::{CompensationPlate, DriveConfig, DrivePlate};
use control::speed_task::SpeedTask;
use control::standing_watch::asked_torque;
use control::supervisor::{Demand, Request, State};
use proptest::prelude::*;

#[path = "../../src/board/mains_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod mains_plate;
#[path = "../../src/board/nucleo_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod nucleo_plate;
#[path = "../../src/board/paper_machine.rs"]
mod paper_machine;

/// The registers of one motor.
#[derive(Clone, Copy, Debug)]
struct Registers {
    sensing: Sensing,
    current: [u16; 3],
    bus: u16,
    encoder: u32,
    broken: bool,
    in_time: bool,
    command: PwmCommand,
}

impl MotorIo for Registers {
    fn acknowledge(&mut self) -> bool {
        self.broken
    }
    fn encoder(&mut self) -> u32 {
        self.encoder
    }
    fn sensing(&self) -> Sensing {
        self.sensing
    }
    fn current(&mut self) -> [u16; 3] {
        self.current
    }
    fn bus(&mut self) -> u32 {
        self.bus.into()
    }
    fn write(&mut self, compare: [u16; 3]) {
        self.command.compare = compare;
    }
    fn close(&mut self) {
        self.command.enable = true;
    }
    fn open(&mut self) {
        self.command.enable = false;
    }
    fn clear_break(&mut self) {}
    fn in_time(&mut self) -> bool {
        self.in_time
    }
}

/// What a motor's registers hold for a while: a value, and by how much it changes each period.
#[derive(Clone, Copy, Debug)]
struct MotorWords {
    current: [u16; 3],
    bus: u16,
    encoder: u32,
    turns: u32,
    broken: bool,
    in_time: bool,
}

/// A stretch of periods.
#[derive(Clone, Debug)]
struct Stretch {
    periods: u16,
    motors: [MotorWords; 2],
    noise: u16,
    request: Request,
    velocity: i32,
    base: i32,
    found: u32,
    temperatures: [u16; 2],
    missed: [u32; 4],
}

fn counts() -> impl Strategy<Value = u16> {
    // What the zeros are like, the ends, anything.
    prop_oneof![2000..2100u16, Just(0), Just(4095), 0..4096u16]
}

fn motor() -> impl Strategy<Value = MotorWords> {
    let turns = prop_oneof![Just(0), 0..200u32, any::<u32>()];
    (
        prop::array::uniform3(counts()),
        counts(),
        any::<u32>(),
        turns,
        prop::bool::weighted(0.1),
        prop::bool::weighted(0.95),
    )
        .prop_map(
            |(current, bus, encoder, turns, broken, in_time)| MotorWords {
                current,
                bus,
                encoder,
                turns,
                broken,
                in_time,
            },
        )
}

fn stretch() -> impl Strategy<Value = Stretch> {
    let request = (
        prop_oneof![1 => Just(Demand::Rest), 2 => Just(Demand::Align), 6 => Just(Demand::Run), 2 => Just(Demand::Reset)],
        any::<u32>(),
        prop::array::uniform6(prop::bool::weighted(0.1)),
    )
        .prop_map(
            |(demand, heartbeat, [off, forward, backward, no_way, no_way_back, homing])| {
                Request {
                    demand,
                    heartbeat,
                    inputs: Inputs {
                        enabled: [!off, !off || homing],
                        end_forward: forward,
                        end_backward: backward,
                        blocked: [no_way, no_way_back],
                        homing: [homing, !homing],
                        table_step: (!no_way).then_some(heartbeat.cast_signed()),
                    },
                    scale: heartbeat.is_multiple_of(3).then_some(heartbeat),
                }
            },
        );
    (
        1..1500u16,
        prop::array::uniform2(motor()),
        prop_oneof![Just(0), Just(3), Just(u16::MAX)],
        request,
        any::<[i32; 2]>(),
        prop_oneof![9 => Just(0), 1 => 0..48u32],
        prop::array::uniform2(counts()),
        prop::array::uniform4(prop_oneof![9 => Just(0), 1 => any::<u32>()]),
    )
        .prop_map(
            |(periods, motors, noise, request, [velocity, base], found, temperatures, missed)| {
                Stretch {
                    periods,
                    motors,
                    noise,
                    request,
                    velocity,
                    base,
                    found,
                    temperatures,
                    missed,
                }
            },
        )
}

/// The whole of the control, and what its registers hold.
struct Controlled<'a> {
    plate: &'a DrivePlate,
    config: DriveConfig,
    limits: GuardConfig,
    loops: [CurrentLoop; 2],
    task: SpeedTask,
    guard: Guard,
    exchanges: [MotorExchange; 2],
    registers: [Registers; 2],
    /// What the drive was seen to be, and what the guard has found.
    states: Vec<State>,
    found: Option<Fault>,
    random: u32,
}

impl<'a> Controlled<'a> {
    fn new(plate: &'a DrivePlate, guards: &GuardPlate, aligned: bool) -> Self {
        let config = plate.config().unwrap();
        let config = if aligned {
            config.aligned(plate)
        } else {
            config
        };
        let motors = config.current_loops.each_ref();
        Self {
            plate,
            limits: guards.config().unwrap(),
            loops: motors.map(CurrentLoop::new),
            task: SpeedTask::new(&config),
            guard: Guard::new(),
            exchanges: motors.map(|motor| MotorExchange::new(motor, config.speed_divider)),
            registers: motors.map(|config| Registers {
                sensing: config.sensing(),
                current: [0; 3],
                bus: 0,
                encoder: 0,
                broken: false,
                in_time: false,
                command: PwmCommand::default(),
            }),
            states: Vec::new(),
            found: None,
            random: 1,
            config,
        }
    }

    fn run(&mut self, stretch: &Stretch) -> Result<(), TestCaseError> {
        // What may be asked is asked; a refusal is one.
        let _ = self.task.command(
            &self.config,
            Command {
                velocity: TableVelocity::from_bits(stretch.velocity),
                base: MechanicalSpeed::from_bits(stretch.base),
            },
        );
        for period in 0..u32::from(stretch.periods) {
            for k in 0..2 {
                self.fill_registers(k, stretch, period);
                self.loops[k].period(
                    &self.config.current_loops[k],
                    &mut self.registers[k],
                    &self.exchanges[k],
                    || (),
                );
                self.is_legal(k)?;
                if k == 0 && period.is_multiple_of(self.config.speed_divider) {
                    self.speed_step(stretch, period);
                }
            }
            if period.is_multiple_of(20) {
                let look = self.look(stretch, period);
                self.found = self.guard.step(&self.limits, &look);
            }
        }
        Ok(())
    }

    fn fill_registers(&mut self, k: usize, stretch: &Stretch, period: u32) {
        let words = &stretch.motors[k];
        let per_turn = self.plate.motors[k].encoder.counts_per_turn;
        self.random = self
            .random
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        let random = self.random;
        let noisy = |n: u16, shift: u32| {
            (u32::from(n) + (random >> shift) % (u32::from(stretch.noise) + 1)) as u16 % 4096
        };
        self.registers[k] = Registers {
            current: [
                noisy(words.current[0], 0),
                noisy(words.current[1], 8),
                noisy(words.current[2], 16),
            ],
            bus: noisy(words.bus, 4),
            // A timer counts within a turn; a frame may be anything.
            encoder: if self.config.current_loops[k].encoder.is_absolute() {
                words.encoder.wrapping_add(period.wrapping_mul(words.turns))
            } else {
                words.encoder.wrapping_add(period.wrapping_mul(words.turns)) % per_turn
            },
            broken: words.broken,
            in_time: words.in_time,
            ..self.registers[k]
        };
    }

    /// The duty is below the counter's top, and the voltage within its circle.
    fn is_legal(&self, k: usize) -> Result<(), TestCaseError> {
        let command = self.registers[k].command;
        let top = self.plate.board.period();
        prop_assert!(
            command.compare.iter().all(|compare| *compare <= top),
            "{command:?} past {top}"
        );
        let circle = self.config.current_loops[k]
            .modulation
            .circle(self.registers[k].bus.into());
        let voltage = self.exchanges[k].voltage(self.exchanges[k].periods());
        let length = voltage.d.to_num::<f64>().hypot(voltage.q.to_num());
        let radius = circle.radius.to_num::<f64>();
        prop_assert!(
            length <= radius * 1.001 + 0.01,
            "{length} V in a circle of {radius} V"
        );
        Ok(())
    }

    fn speed_step(&mut self, stretch: &Stretch, period: u32) {
        let request = Request {
            heartbeat: stretch.request.heartbeat.wrapping_mul(period),
            ..stretch.request
        };
        let told = Fault::of_word(stretch.found).or(self.found);
        let exchanges = self.exchanges.each_ref();
        let output = self.task.step(&self.config, request, exchanges, told);
        // What the gate drivers' lines say where a fault begins.
        let begins = self.states.last().is_none_or(|last| last.fault().is_none());
        let state = match output.state {
            State::Fault(_) if begins => self.task.tell_lines(
                [stretch.found % 3 == 1, stretch.found % 5 == 1],
                stretch.found % 7 == 1,
            ),
            state => state,
        };
        if self.states.last() != Some(&state) {
            self.states.push(state);
        }
    }

    fn look(&self, stretch: &Stretch, period: u32) -> Look {
        let running = matches!(self.states.last(), Some(State::Running));
        let inputs = &stretch.request.inputs;
        Look {
            supply: SupplyReading {
                // One in four is anything; a supply that is wrong ends all else.
                reference: if stretch.request.heartbeat.is_multiple_of(4) {
                    stretch.motors[0].bus
                } else {
                    1504
                },
                calibrated: 1655,
            },
            running: [running; 2],
            driven: running,
            stopped_by: self.states.last().and_then(|state| state.fault()),
            enabled: inputs.enabled,
            ends_open: [inputs.end_forward, inputs.end_backward],
            scale: period.wrapping_mul(stretch.request.heartbeat),
            current_sum: [period % 3, stretch.found % 4],
            missed: stretch.missed,
            bus: self.registers.map(|motor| motor.bus),
            temperatures: stretch.temperatures,
            theta: self.loops.each_ref().map(|one| one.shaft().0.0),
            torque: core::array::from_fn(|k| {
                let motor = &self.config.current_loops[k];
                asked_torque(&self.exchanges[k], motor, &self.config.speed_loops[k])
            }),
            index: [period.is_multiple_of(60), false],
            transition_error: [false, period.is_multiple_of(1000)],
        }
    }
}

/// What the drive was seen to be.
fn through(
    plate: &DrivePlate,
    guards: &GuardPlate,
    aligned: bool,
    stretches: &[Stretch],
) -> Result<Vec<State>, TestCaseError> {
    let mut controlled = Controlled::new(plate, guards, aligned);
    for stretch in stretches {
        controlled.run(stretch)?;
    }
    Ok(controlled.states)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn nothing_overflows_and_every_duty_is_legal(
        stretches in prop::collection::vec(stretch(), 1..8),
        aligned in any::<bool>(),
    ) {
        let mut smooth = nucleo_plate::PLATE;
        smooth.compensation = CompensationPlate::usual([1, 7], 0.05, 1e-7);
        for (plate, guards) in [
            (&nucleo_plate::PLATE, &nucleo_plate::GUARDS),
            (&mains_plate::PLATE, &mains_plate::GUARDS),
            (&smooth, &nucleo_plate::GUARDS),
        ] {
            through(plate, guards, aligned, &stretches)?;
        }
    }
}

/// What the property goes through: a drive that is healthy for a while runs, one that is not stops.
#[test]
fn the_property_sees_a_drive_that_runs_and_one_that_stops() {
    let plate = &nucleo_plate::PLATE;
    let zero = plate.board.zero_counts as u16;
    let motor = MotorWords {
        current: [zero; 3],
        bus: (36.0 / plate.board.bus_volts_per_count) as u16,
        encoder: 0,
        turns: 0,
        broken: false,
        in_time: true,
    };
    let healthy = Stretch {
        periods: 1500,
        motors: [motor; 2],
        noise: 0,
        request: Request {
            demand: Demand::Run,
            heartbeat: 1,
            ..Request::default()
        },
        velocity: 0,
        base: 0,
        found: 0,
        temperatures: nucleo_plate::GUARDS
            .temperatures
            .map(|sink| sink.counts(40.0, plate.board.adc_counts) as u16),
        missed: [0; 4],
    };
    let broken = Stretch {
        motors: [
            MotorWords {
                broken: true,
                ..motor
            },
            motor,
        ],
        ..healthy.clone()
    };
    let states = through(plate, &nucleo_plate::GUARDS, true, &[healthy, broken]).unwrap();
    let (last, before) = (states.len() - 1, states.len() - 2);
    assert_eq!(
        [states[before], states[last]],
        [State::Holding, State::Fault(Fault::ScrewBreak)],
        "{states:?}"
    );
}
