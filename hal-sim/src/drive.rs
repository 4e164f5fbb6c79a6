//! The control code on the board, in the interrupts' order.
//!
//! A PWM period: the screw's counter turns and its current loop runs; every few periods the speed task runs after it,
//! below it in priority; half a period later the nut's counter turns and its current loop runs.

use crate::board::{Board, BoardConfig};
use control::coordinator::{Command, CommandError};
use control::current_loop::{
    CurrentLoop, CurrentReference, Mode, MotorEstimate, MotorSample, PwmCommand, Rested,
};
use control::exchange::MotorExchange;
use control::format::{MechanicalSpeed, Misfit, TableVelocity, Voltage};
use control::plate::{DriveConfig, DrivePlate};
use control::speed_task::{SpeedTask, SpeedTaskOutput};
use control::supervisor::{Request, State};
use control::transform::DirectQuadrature;
use plant::Axis;
use plant::machine::{Coupling, Machine};
use plant::model::Model;

/// The whole drive: control code, board, machine.
#[derive(Debug)]
pub struct Drive {
    /// The peripherals and the machine.
    pub board: Board,
    /// What the drive is asked.
    pub request: Request,
    config: DriveConfig,
    current_loops: [CurrentLoop; 2],
    speed_task: SpeedTask,
    exchanges: [MotorExchange; 2],
    estimates: [MotorEstimate; 2],
    compares: [PwmCommand; 2],
    samples: [MotorSample; 2],
    /// Voltages computed one and two periods ago: the second acted in the period that ends now.
    voltages: [[DirectQuadrature<Voltage>; 2]; 2],
    speed: SpeedTaskOutput,
    pole_pairs: [u32; 2],
    periods: u64,
}

impl Drive {
    /// A drive at rest, asked to run.
    ///
    /// # Errors
    /// [`Misfit`] if a gain of `plate` does not fit its format.
    pub fn new(
        model: &Model,
        coupling: Coupling,
        board: BoardConfig,
        plate: &DrivePlate,
    ) -> Result<Self, Misfit> {
        let config: DriveConfig = plate.config()?;
        Ok(Self {
            board: Board::new(model, coupling, board),
            request: Request {
                run: true,
                reset: false,
            },
            current_loops: config.current_loops.each_ref().map(CurrentLoop::new),
            speed_task: SpeedTask::new(),
            exchanges: [(); 2].map(|()| MotorExchange::new(config.speed_divider)),
            estimates: [MotorEstimate::default(); 2],
            compares: [PwmCommand::default(); 2],
            samples: [MotorSample::default(); 2],
            voltages: [[DirectQuadrature::default(); 2]; 2],
            speed: SpeedTaskOutput::default(),
            config,
            pole_pairs: plate.motors.map(|motor| motor.pole_pairs),
            periods: 0,
        })
    }

    /// Asks for a table velocity, m/s, and a base speed, mechanical rad/s.
    ///
    /// # Errors
    /// [`CommandError`] if the feed or a motor may not move that fast; the old command stays.
    pub fn command(&mut self, velocity: f64, base: f64) -> Result<(), CommandError> {
        let command = Command {
            velocity: TableVelocity::saturating_from_num(velocity),
            base: MechanicalSpeed::saturating_from_num(base),
        };
        self.speed_task.command(&self.config, command)
    }

    /// One PWM period.
    pub fn period(&mut self) {
        self.period_with(|_, _| ());
    }

    /// One PWM period with `disturb` called before each half of it (0, 1) passes on the machine.
    pub fn period_with(&mut self, mut disturb: impl FnMut(&mut Machine, u32)) {
        self.current_interrupt(Axis::Screw);
        if self
            .periods
            .is_multiple_of(u64::from(self.config.speed_divider))
        {
            self.speed_interrupt();
        }
        disturb(&mut self.board.machine, 0);
        self.board.advance();
        self.current_interrupt(Axis::Nut);
        disturb(&mut self.board.machine, 1);
        self.board.advance();
        self.periods += 1;
    }

    /// The references are at the commanded targets.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.speed_task.arrived()
    }

    /// Electrical turns a mechanical turn of `axis`.
    #[must_use]
    pub fn pole_pairs(&self, axis: Axis) -> u32 {
        self.pole_pairs[axis.index()]
    }

    /// PWM periods since the start.
    #[must_use]
    pub fn periods(&self) -> u64 {
        self.periods
    }

    /// What the drive is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.speed.state
    }

    /// What the current loop of `axis` knew after its last step.
    #[must_use]
    pub fn estimate(&self, axis: Axis) -> &MotorEstimate {
        &self.estimates[axis.index()]
    }

    /// What the board last read for `axis`.
    #[must_use]
    pub fn sample(&self, axis: Axis) -> &MotorSample {
        &self.samples[axis.index()]
    }

    /// Voltage that was commanded for the control period of `axis` that ended with its last sample.
    #[must_use]
    pub fn ended_voltage(&self, axis: Axis) -> DirectQuadrature<Voltage> {
        self.voltages[axis.index()][1]
    }

    /// What the current loop of `axis` last wrote to its timer.
    #[must_use]
    pub fn compare(&self, axis: Axis) -> PwmCommand {
        self.compares[axis.index()]
    }

    /// What the speed task last decided.
    #[must_use]
    pub fn speed(&self) -> &SpeedTaskOutput {
        &self.speed
    }

    fn current_interrupt(&mut self, axis: Axis) {
        let k = axis.index();
        let sample = self.board.turn(axis);
        let (config, exchange) = (&self.config.current_loops[k], &self.exchanges[k]);
        let drive = exchange.asked_to_drive();
        let asked = exchange.asked_to_rest();
        let reference = CurrentReference {
            mode: if drive { Mode::Drive } else { asked.mode },
            i_q: config.sense.scale.current(exchange.i_q()),
        };
        let (command, estimate) =
            self.current_loops[k].step(config, &sample, reference, exchange.bus_scale());
        exchange.publish_speed(estimate.motion.theta_step);
        exchange.publish_bus(sample.bus);
        if estimate.voltage_limited {
            exchange.publish_limited();
        }
        if !command.enable {
            let rested = Rested {
                calibration: estimate.calibration,
                broken: estimate.broken,
                encoder_stuck: estimate.encoder_stuck,
            };
            exchange.publish_rest(rested, asked.stale);
        }
        self.board.write(axis, command);
        self.voltages[k] = [self.estimates[k].voltage, self.voltages[k][0]];
        self.samples[k] = sample;
        self.estimates[k] = estimate;
        self.compares[k] = command;
    }

    fn speed_interrupt(&mut self) {
        let status = [self.exchanges[0].status(), self.exchanges[1].status()];
        self.speed = self
            .speed_task
            .step(&self.config, self.request, status, None);
        for (k, exchange) in self.exchanges.iter().enumerate() {
            exchange.ask(self.speed.current[k], &self.config.current_loops[k]);
        }
    }
}
