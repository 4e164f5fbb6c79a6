//! The control code on the board, in the interrupts' order.
//!
//! A PWM period: the screw's counter turns and its current loop runs; every few periods the speed task runs after it,
//! below it in priority; half a period later the nut's counter turns and its current loop runs.

use crate::board::{Board, BoardConfig};
use crate::seam::{Disturbed, Seam, SpeedCall, SpeedSeen, Straight};
use control::active_limit::ActiveLimits;
use control::alignment::Misalignment;
use control::compensation::Compensation;
use control::coordinator::{Command, CommandError};
use control::current_loop::{CurrentLoop, CurrentLoopConfig, MotorSample, PwmCommand};
use control::exchange::{MotorExchange, MotorStatus};
use control::fault::FaultSet;
use control::format::{
    Angle, Current, MechanicalSpeed, Misfit, Speed, SpeedChange, TableVelocity, Voltage,
};
use control::motor_io::{MotorIo, Sensing};
use control::observer::EncoderAlignment;
use control::plate::{DriveConfig, DrivePlate};
use control::runaway::sum_events;
use control::speed_task::{SpeedTask, SpeedTaskOutput};
use control::standing_watch::asked_torque;
use control::supervisor::{Demand, Request, State};
use control::transform::DirectQuadrature;
use plant::Axis;
use plant::machine::{Coupling, Machine};
use plant::model::Model;

/// What a current loop knew after a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorEstimate {
    /// Mechanical angle of the shaft.
    pub theta: Angle,
    /// Measured phase currents, A.
    pub phases: [Current; 3],
    /// Measured current, A.
    pub current: DirectQuadrature<Current>,
    /// Commanded voltage, V.
    pub voltage: DirectQuadrature<Voltage>,
    /// What it tells the speed task.
    pub status: MotorStatus,
}

/// The board's registers of one motor in one period.
struct Registers<'a> {
    board: &'a mut Board,
    axis: Axis,
    sample: MotorSample,
    command: PwmCommand,
    config: &'a CurrentLoopConfig,
}

impl MotorIo for Registers<'_> {
    fn acknowledge(&mut self) -> bool {
        self.sample.broken
    }

    fn encoder(&mut self) -> u32 {
        self.sample.encoder
    }

    fn sensing(&self) -> Sensing {
        self.config.sensing()
    }

    fn current(&mut self) -> [u16; 3] {
        self.sample.current
    }

    fn bus(&mut self) -> u32 {
        self.sample.bus.into()
    }

    fn write(&mut self, compare: [u16; 3]) {
        self.command.compare = compare;
    }

    fn close(&mut self) {
        self.command.enable = true;
    }

    fn open(&mut self) {
        self.command.enable = false;
        self.board.open(self.axis);
    }

    fn clear_break(&mut self) {
        self.board.clear_break(self.axis);
    }

    fn in_time(&mut self) -> bool {
        true
    }
}

/// What the chip's code knows: gone in a reset.
#[derive(Debug)]
struct Code {
    config: DriveConfig,
    current_loops: [CurrentLoop; 2],
    speed_task: SpeedTask,
    exchanges: [MotorExchange; 2],
    compares: [PwmCommand; 2],
    samples: [MotorSample; 2],
    speed: SpeedTaskOutput,
}

impl Code {
    fn new(config: DriveConfig) -> Self {
        let loops = config.current_loops.each_ref();
        Self {
            current_loops: loops.map(CurrentLoop::new),
            speed_task: SpeedTask::new(&config),
            exchanges: loops.map(|motor| MotorExchange::new(motor, config.speed_divider)),
            compares: [PwmCommand::default(); 2],
            samples: [MotorSample::default(); 2],
            speed: SpeedTaskOutput::default(),
            config,
        }
    }
}

/// The whole drive: control code, board, machine.
#[derive(Debug)]
pub struct Drive {
    /// The peripherals and the machine.
    pub board: Board,
    /// What the drive is asked.
    pub request: Request,
    /// Someone commands, and reports it at each step of the speed task.
    pub attended: bool,
    code: Code,
    pole_pairs: [u32; 2],
    periods: u64,
}

impl Drive {
    /// A drive at rest whose rotors are aligned, with run demanded: as after a start and an alignment.
    ///
    /// # Errors
    /// [`Misfit`] if a gain of `plate` does not fit its format.
    pub fn aligned(
        model: &Model,
        coupling: Coupling,
        board: BoardConfig,
        plate: &DrivePlate,
    ) -> Result<Self, Misfit> {
        let config = plate.config()?.aligned(plate);
        let mut drive = Self::with(model, coupling, board, plate, config);
        drive.request.demand = Demand::Run;
        Ok(drive)
    }

    /// A drive that has just been switched on. It does not know its rotor angles, and nothing is demanded.
    ///
    /// # Errors
    /// [`Misfit`] if a gain of `plate` does not fit its format.
    pub fn new(
        model: &Model,
        coupling: Coupling,
        board: BoardConfig,
        plate: &DrivePlate,
    ) -> Result<Self, Misfit> {
        Ok(Self::with(model, coupling, board, plate, plate.config()?))
    }

    fn with(
        model: &Model,
        coupling: Coupling,
        board: BoardConfig,
        plate: &DrivePlate,
        config: DriveConfig,
    ) -> Self {
        Self {
            board: Board::new(model, coupling, board),
            request: Request::default(),
            attended: true,
            code: Code::new(config),
            pole_pairs: plate.motors.map(|motor| motor.pole_pairs),
            periods: 0,
        }
    }

    /// The chip is reset: its code begins again, with nothing known and nothing asked; the machine goes on as it was.
    ///
    /// # Errors
    /// [`Misfit`] if a gain of `plate` does not fit its format.
    pub fn reset(&mut self, plate: &DrivePlate) -> Result<(), Misfit> {
        self.code = Code::new(plate.config()?);
        self.request = Request::default();
        self.board.reset();
        Ok(())
    }

    /// Takes over the current loops of the aligned drive that had this board before, with their observers: the encoders
    /// count on from the index that they have passed.
    pub fn take_observers(&mut self, before: &mut Self) {
        std::mem::swap(&mut self.code.current_loops, &mut before.code.current_loops);
        for (state, config) in
            (self.code.current_loops.iter_mut()).zip(&self.code.config.current_loops)
        {
            state.take_alignment(config.alignment);
        }
    }

    /// Configures it while it goes on. The current loops keep theirs, in which a drive that began aligned has its angles.
    pub fn configure(&mut self, config: DriveConfig) {
        let before = self.code.config.current_loops;
        self.code.config = DriveConfig {
            current_loops: before,
            ..config
        };
    }

    /// One PWM period in which the chip does nothing: its outputs are off.
    pub fn period_in_reset(&mut self, seam: &mut impl Seam) {
        for half in 0..2 {
            seam.machine(&mut self.board.machine, half);
            self.board.advance();
        }
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
        self.code.speed_task.command(&self.code.config, command)
    }

    /// Asks the motor of `axis`, while it runs, for a current along d, A: it makes no torque, and ends with the run.
    ///
    /// # Errors
    /// The largest, A, if more is asked.
    pub fn ask_d(&self, axis: Axis, amps: Current) -> Result<(), Current> {
        let most = self.code.config.speed_loops[axis.index()].i_max;
        if amps.saturating_abs() > most {
            return Err(most);
        }
        self.exchange(axis)
            .ask_d(amps, &self.code.config.current_loops[axis.index()]);
        Ok(())
    }

    /// One PWM period.
    pub fn period(&mut self) {
        self.period_through(&mut Straight);
    }

    /// One PWM period with `disturb` called before each half of it (0, 1) passes on the machine.
    pub fn period_with(&mut self, disturb: impl FnMut(&mut Machine, u32)) {
        self.period_through(&mut Disturbed(disturb));
    }

    /// One PWM period with `seam` between board and control.
    pub fn period_through(&mut self, seam: &mut impl Seam) {
        self.current_interrupt(Axis::Screw, seam);
        if self
            .periods
            .is_multiple_of(u64::from(self.code.config.speed_divider))
        {
            self.speed_interrupt(seam);
        }
        seam.machine(&mut self.board.machine, 0);
        self.board.advance();
        self.current_interrupt(Axis::Nut, seam);
        seam.machine(&mut self.board.machine, 1);
        self.board.advance();
        self.periods += 1;
    }

    /// What the table's share turns the screw by against the nut by its plan, and the change of that a step.
    #[must_use]
    pub fn planned(&self) -> (Speed, SpeedChange) {
        self.code.speed_task.planned()
    }

    /// The brake is commanded to open.
    #[must_use]
    pub fn releases_brake(&self) -> bool {
        self.code.speed_task.releases_brake()
    }

    /// The references are at the commanded targets.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.code.speed_task.arrived()
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

    /// Why the last alignment failed; `None` if it did not.
    #[must_use]
    pub fn misalignment(&self) -> Option<Misalignment> {
        self.code.speed_task.misalignment()
    }

    /// What was found since it last left a fault.
    #[must_use]
    pub fn latched(&self) -> FaultSet {
        self.code.speed_task.latched()
    }

    /// What limits it.
    #[must_use]
    pub fn limits(&self) -> ActiveLimits {
        self.code
            .speed_task
            .limits(&self.code.config, self.code.exchanges.each_ref())
    }

    /// What it compensates, with what it has learned.
    #[must_use]
    pub fn compensation(&self) -> &Compensation {
        self.code.speed_task.compensation()
    }

    /// What the drive is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.code.speed.state
    }

    /// The bridges of screw and nut are on, as the supervision takes them to be.
    #[must_use]
    pub fn bridges_on(&self) -> [bool; 2] {
        let on = self.state().has_bridges_on();
        self.code
            .exchanges
            .each_ref()
            .map(|exchange| on || exchange.is_closed())
    }

    /// What the current loop of `axis` knew after its last step.
    #[must_use]
    pub fn estimate(&self, axis: Axis) -> MotorEstimate {
        let (exchange, sense) = (
            &self.code.exchanges[axis.index()],
            &self.code.config.current_loops[axis.index()].sense,
        );
        let current = exchange.current();
        MotorEstimate {
            theta: self.code.current_loops[axis.index()].shaft().0,
            phases: sense.phases(exchange.codes()),
            current: DirectQuadrature {
                d: sense.scale.current(current.d),
                q: sense.scale.current(current.q),
            },
            voltage: exchange.voltage(exchange.periods()),
            status: exchange.status(),
        }
    }

    /// Puts the electrical angle of `axis` wrong by `turns` from now on, as a slipped rotor or encoder does.
    pub fn misalign(&mut self, axis: Axis, turns: f64) {
        let exchange = &self.code.exchanges[axis.index()];
        let alignment = exchange.alignment().map(|alignment| EncoderAlignment {
            theta_e_at_zero: alignment.theta_e_at_zero.plus(Angle::from_turns(turns)),
            ..alignment
        });
        exchange.align(exchange.alignment(), alignment);
        self.code.current_loops[axis.index()].take_alignment(alignment);
    }

    /// How far the three currents of each motor are from adding up to nothing: see [`sum_events`].
    #[must_use]
    pub fn current_sums(&self) -> [u32; 2] {
        Axis::ALL.map(|axis| {
            let (k, config) = (axis.index(), &self.code.config);
            let codes = self.code.exchanges[k].codes_of_one_period();
            sum_events(&config.runaway[k], &config.current_loops[k].sense, codes)
        })
    }

    /// The torque that is asked of each motor: see [`asked_torque`].
    #[must_use]
    pub fn asked_torques(&self) -> [i32; 2] {
        Axis::ALL.map(|axis| {
            let (k, config) = (axis.index(), &self.code.config);
            asked_torque(
                &self.code.exchanges[k],
                &config.current_loops[k],
                &config.speed_loops[k],
            )
        })
    }

    /// The words between the current loop of `axis` and the speed task.
    #[must_use]
    pub fn exchange(&self, axis: Axis) -> &MotorExchange {
        &self.code.exchanges[axis.index()]
    }

    /// What the board last read for `axis`.
    #[must_use]
    pub fn sample(&self, axis: Axis) -> &MotorSample {
        &self.code.samples[axis.index()]
    }

    /// Voltage that was commanded for the control period of `axis` that ended with its last sample.
    #[must_use]
    pub fn ended_voltage(&self, axis: Axis) -> DirectQuadrature<Voltage> {
        let exchange = &self.code.exchanges[axis.index()];
        exchange.voltage(exchange.periods().wrapping_sub(2))
    }

    /// What the current loop of `axis` last wrote to its timer.
    #[must_use]
    pub fn compare(&self, axis: Axis) -> PwmCommand {
        self.code.compares[axis.index()]
    }

    /// What the speed task last decided.
    #[must_use]
    pub fn speed(&self) -> &SpeedTaskOutput {
        &self.code.speed
    }

    fn current_interrupt(&mut self, axis: Axis, seam: &mut impl Seam) {
        let k = axis.index();
        let mut sample = self
            .board
            .turn_through(axis, |amps| seam.currents(axis, amps));
        seam.sample(axis, &mut sample);
        let mut registers = Registers {
            board: &mut self.board,
            axis,
            sample,
            command: self.code.compares[k],
            config: &self.code.config.current_loops[k],
        };
        self.code.current_loops[k].period(
            &self.code.config.current_loops[k],
            &mut registers,
            &self.code.exchanges[k],
            || (),
        );
        // By its parts: a load of the whole would wait for the stores of them.
        let PwmCommand { compare, enable } = registers.command;
        let command = PwmCommand { compare, enable };
        self.code.compares[k] = command;
        self.board.write(axis, command);
        self.code.samples[k] = sample;
        seam.looped(axis, &self.code.exchanges[k]);
    }

    /// What another controller adds to the references of a drive that runs.
    fn add_currents(&mut self, seam: &mut impl Seam) {
        for axis in Axis::ALL {
            let k = axis.index();
            let (config, exchange) = (&self.code.config.current_loops[k], &self.code.exchanges[k]);
            let i_q = self.code.speed.current[k].i_q;
            let omega_e = config
                .observer
                .omega_e(exchange.theta_step())
                .to_num::<f64>();
            let seen = SpeedSeen {
                turn: f64::from(exchange.encoder())
                    / f64::from(config.observer.encoder.counts_per_turn),
                omega_e,
                error: self.code.speed.speed[k].omega_e.to_num::<f64>() - omega_e,
                i_q: i_q.to_num(),
            };
            if let Some(more) = seam.current(axis, &seen) {
                let i_max = self.code.config.speed_loops[k].i_max;
                let asked = i_q
                    .saturating_add(Current::saturating_from_num(more))
                    .clamp(-i_max, i_max);
                exchange.ask_on(asked, config);
                self.code.speed.current[k].i_q = asked;
            }
        }
    }

    fn speed_interrupt(&mut self, seam: &mut impl Seam) {
        let code = &mut self.code;
        let stepped = seam.speed(SpeedCall {
            task: &mut code.speed_task,
            config: &code.config,
            motors: code.exchanges.each_ref(),
            board: &mut self.board,
        });
        match stepped {
            Some(output) => self.code.speed = output,
            None => self.step_by_request(seam),
        }
        if self.code.speed.state.is_driven() {
            self.add_currents(seam);
        }
    }

    fn step_by_request(&mut self, seam: &mut impl Seam) {
        if self.attended {
            self.request.heartbeat = self.request.heartbeat.wrapping_add(1);
        }
        let mut request = self.request;
        let aligning = self.code.speed.state == State::Aligning;
        if aligning || self.code.config.compensation.scale.is_some() {
            // The counter's own width, which the control knows to wrap.
            request.scale = Some(self.board.scale_counts() as u32);
        }
        seam.request(&mut request);
        let before = self.code.speed.state;
        self.code.speed = self.code.speed_task.step(
            &self.code.config,
            request,
            self.code.exchanges.each_ref(),
            seam.found(),
        );
        if before.fault().is_none() && self.code.speed.state.fault().is_some() {
            self.code.speed.state = self
                .code
                .speed_task
                .tell_lines(self.board.fault_lines(), self.board.broken_by_system());
        }
    }
}
