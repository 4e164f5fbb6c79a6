//! The speed task: supervisor, coordinator and both speed loops in one step.

use crate::coordinator::{Command, CommandError, Coordinator, CoordinatorConfig, Following};
use crate::current_loop::CurrentReference;
use crate::exchange::MotorStatus;
use crate::plate::DriveConfig;
use crate::speed_loop::{SpeedLoop, SpeedLoopConfig, SpeedReference};
use crate::supervisor::{Request, State};

/// What the speed task decided in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedTaskOutput {
    /// For the current loops: screw, nut.
    pub current: [CurrentReference; 2],
    /// What the motors shall do: screw, nut.
    pub speed: [SpeedReference; 2],
    /// What the drive is doing.
    pub state: State,
}

/// The speed task: configuration and state.
#[derive(Clone, Copy, Debug)]
pub struct SpeedTask {
    loops: [SpeedLoopConfig; 2],
    pair: CoordinatorConfig,
    speed_loops: [SpeedLoop; 2],
    coordinator: Coordinator,
    torque_limited: [bool; 2],
    command: Command,
    state: State,
}

impl SpeedTask {
    /// A task at rest.
    #[must_use]
    pub const fn new(config: &DriveConfig) -> Self {
        Self {
            loops: config.speed_loops,
            pair: config.coordinator,
            speed_loops: [SpeedLoop::new(), SpeedLoop::new()],
            coordinator: Coordinator::new(),
            torque_limited: [false; 2],
            command: Command::rest(),
            state: State::Off,
        }
    }

    /// Takes a new command, to be followed while running.
    ///
    /// # Errors
    /// [`CommandError`] if the feed or a motor may not move that fast; the old command stays.
    pub fn command(&mut self, command: Command) -> Result<(), CommandError> {
        Coordinator::new().command(&self.pair, command)?;
        self.command = command;
        Ok(())
    }

    /// The references are at the command.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.coordinator.arrived()
    }

    /// One step.
    pub fn step(&mut self, request: Request, motors: [MotorStatus; 2]) -> SpeedTaskOutput {
        self.state = self.state.next(request, motors, self.coordinator.at_rest());
        let mode = self.state.mode();
        if !matches!(self.state, State::Running | State::Stopping) {
            self.speed_loops = [SpeedLoop::new(), SpeedLoop::new()];
            self.coordinator = Coordinator::new();
            self.torque_limited = [false; 2];
            let current = [CurrentReference {
                mode,
                ..CurrentReference::default()
            }; 2];
            return SpeedTaskOutput {
                current,
                state: self.state,
                ..SpeedTaskOutput::default()
            };
        }

        let target = if self.state == State::Running {
            self.command
        } else {
            Command::rest()
        };
        // Checked when it was given, and rest is always allowed; a refusal would leave the old target.
        let _ = self.coordinator.command(&self.pair, target);
        let [screw, nut] = motors;
        let [screw_torque, nut_torque] = self.torque_limited;
        let speed = self.coordinator.step(
            &self.pair,
            [
                Following {
                    omega_e: screw.omega_e,
                    limited: screw.voltage_limited || screw_torque,
                },
                Following {
                    omega_e: nut.omega_e,
                    limited: nut.voltage_limited || nut_torque,
                },
            ],
        );

        let mut current = [CurrentReference {
            mode,
            ..CurrentReference::default()
        }; 2];
        let motors = self
            .loops
            .iter()
            .zip(&mut self.speed_loops)
            .zip(motors)
            .zip(speed);
        let outputs = current.iter_mut().zip(&mut self.torque_limited);
        for ((((config, speed_loop), motor), reference), (current, torque_limited)) in
            motors.zip(outputs)
        {
            let output = speed_loop.step(config, reference, motor.omega_e, motor.voltage_limited);
            current.i_q = output.i_q;
            *torque_limited = output.limited;
        }
        SpeedTaskOutput {
            current,
            speed,
            state: self.state,
        }
    }
}
