//! The drive behind the link: what a host sees of it is what it would see of a board.
//!
//! [`SimulatedDrive`] does what is asked ([`Served`]); [`Serving`] joins it to lines of bytes, millisecond by millisecond, in
//! one thread: the same bytes in the same milliseconds give the same bytes back.
//!
//! The machine has a brake that carries the load, as an axis needs whose load can drive the screw back: the one that the settings
//! say, with its times, or else an ideal one that holds while the motors do not drive the table.

mod lines;
mod within;
mod world;

pub use lines::{LineId, Serving};
pub use within::Within;

use crate::drive::Drive;
use crate::experiment::Setup;
use crate::flash::SimulatedFlash;
use crate::smooth::learned;
use crate::start::{Start, settle};
use control::coordinator::CommandError;
use control::format::{Current, Misfit, TableVelocity};
use control::guard::Look;
use control::homing::HomePlan;
use control::interlock::Inputs;
use control::journal::{Journal, Kind, Recorder};
use control::plate::{BoardPlate, DrivePlate};
use control::rates::STEPS_PER_LOOK;
use control::supervisor::State;
use control::table_move::{MoveError, MovePlan};
use control::travel::{Travel, TravelConfig, TravelLook};
use link::codes::Demand;
use link::codes::ResetReason;
use link::message::{Aligned, Injected, Injection, MotorStatus, Refusal, Status};
use link::motion::{Motion, Seen};
use link::scale;
use link::server::{NotSet, Served};
use link::settings::keep::{Found, Keeper};
use link::settings::plate::Unfit;
use link::settings::store::PAGES;
use link::settings::{Settings, Value};
use link::telemetry::{self, Frame, Header, MotorSample, Real, Request, Sample};
use plant::Axis;
use plant::machine::Coupling;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use world::World;

/// Telemetry that waits for its line, frames: a second at the full rate.
const WAITING: usize = 5000;

/// What a drive knows of its rotors when it starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Begin {
    /// Where they stand: it has started before.
    Aligned,
    /// Nothing.
    Cold,
}

impl Begin {
    fn drive(self, setup: &Setup, plate: &DrivePlate) -> Result<Drive, Misfit> {
        let make = match self {
            Self::Aligned => Drive::aligned,
            Self::Cold => Drive::new,
        };
        let mut drive = make(&setup.model, setup.coupling, setup.board, plate)?;
        drive.request.demand = Demand::Rest;
        drive.attended = false;
        Ok(drive)
    }
}

/// A stream of telemetry.
#[derive(Clone, Copy, Debug)]
struct Stream {
    request: Request,
    /// The period of its first sample.
    start: u64,
    /// Steps of the speed task to the next sample.
    left: u8,
}

/// A simulated drive that a host may command.
#[derive(Debug)]
pub struct SimulatedDrive {
    drive: Drive,
    begin: Begin,
    /// Periods before it last started anew.
    before: u64,
    world: World,
    board: BoardPlate,
    /// Its own settings, without a store.
    own: Settings,
    keeper: Keeper<SimulatedFlash>,
    plate: DrivePlate,
    setup: Setup,
    motion: Motion,
    travel: Travel,
    travel_limits: TravelConfig,
    /// The table velocity that is asked.
    asked: TableVelocity,
    stream: Option<Stream>,
    waiting: VecDeque<Frame>,
    dropped: u32,
    /// Streams that were asked.
    records: u32,
    /// The scale as last read, counts.
    scale: i32,
    journal: Journal,
    recorder: Recorder,
}

impl SimulatedDrive {
    /// The machine and board of `setup`, at rest, with its rotors aligned.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn new(setup: &Setup) -> Result<Self, Misfit> {
        Self::of(setup.clone(), &setup.plate(), Begin::Aligned)
    }

    /// A drive that knows of its machine what its plate says, and has to find its rotors each time it starts.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn cold(start: &Start) -> Result<Self, Misfit> {
        let setup = Setup {
            model: start.model.clone(),
            coupling: Coupling::Coupled,
            board: start.board,
            tuning: start.plate.tuning,
        };
        let mut drive = Self::of(setup, &start.plate, Begin::Cold)?;
        // The brake carries the load while the drive is off.
        let machine = &mut drive.drive.board.machine;
        machine.set_load_force(0.0);
        settle(&mut drive.drive.board, start.angles);
        Ok(drive)
    }

    fn of(setup: Setup, made: &DrivePlate, begin: Begin) -> Result<Self, Misfit> {
        let own = tidy(Settings::of_plate(made, setup.board.sensors.scale_count_m));
        // As it will be after a restart with the same settings.
        let plate = own.plate(&made.board);
        let drive = begin.drive(&setup, &plate)?;
        let mut simulated = Self {
            begin,
            world: World::new(&plate.board, setup.board.bus_v, setup.model.feed.load_n)?,
            drive,
            before: 0,
            board: made.board,
            own,
            keeper: keeper(SimulatedFlash::new(PAGES, 0), own, &made.board),
            plate,
            setup,
            motion: motion(&plate),
            travel: Travel::new(),
            travel_limits: plate.travel_config(own.scale_count_m()),
            asked: TableVelocity::ZERO,
            stream: None,
            waiting: VecDeque::new(),
            dropped: 0,
            records: 0,
            scale: 0,
            journal: Journal::new(),
            recorder: Recorder::new(),
        };
        simulated.has_started(ResetReason::Power);
        Ok(simulated)
    }

    /// With what its flash holds, in place of an erased one: it starts anew.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn put_flash(&mut self, flash: SimulatedFlash) -> Result<(), Misfit> {
        self.keeper = keeper(flash, self.own, &self.board);
        let plate = self.keeper.settings().plate(&self.board);
        self.go_on(self.begin.drive(&self.setup, &plate)?, plate);
        Ok(())
    }

    /// What it found in its flash when it started.
    #[must_use]
    pub fn found(&self) -> Found {
        self.keeper.found()
    }

    /// What its flash holds.
    pub fn flash(&mut self) -> &SimulatedFlash {
        self.keeper.flash()
    }

    /// Starts anew as `drive`, on the board and machine that are there.
    fn go_on(&mut self, mut drive: Drive, plate: DrivePlate) {
        // An encoder that is read as before has not lost its rotor: its counter went on.
        for axis in Axis::ALL {
            let k = axis.index();
            let [before, now] = [&self.plate, &plate].map(|plate| &plate.motors[k]);
            if before.encoder == now.encoder && before.pole_pairs == now.pole_pairs {
                drive.keep_alignment(axis, &self.drive);
            }
        }
        std::mem::swap(&mut drive.board, &mut self.drive.board);
        self.before += self.drive.periods();
        self.drive = drive;
        self.plate = plate;
        (self.motion, self.stream) = (motion(&plate), None);
        self.travel = Travel::new();
        self.travel_limits = plate.travel_config(self.keeper.settings().scale_count_m());
        self.asked = TableVelocity::ZERO;
        self.has_started(ResetReason::Software);
    }

    fn has_started(&mut self, reason: ResetReason) {
        let (uptime_ms, found) = (self.uptime_ms(), self.keeper.found());
        self.recorder = Recorder::new();
        self.journal
            .add(uptime_ms, Kind::Start, reason.word(), [0; 2]);
        let values = [found.unfit.into(), 0];
        self.journal
            .add(uptime_ms, Kind::Settings, found.origin.word(), values);
        if let Some(warning) = self.keeper.settings().warning() {
            self.journal
                .add(uptime_ms, Kind::Warning, warning.word(), [0; 2]);
        }
    }

    /// One PWM period.
    pub fn period(&mut self) {
        let divider = u64::from(self.plate.board.speed_divider);
        let speed_ran = self.drive.periods().is_multiple_of(divider);
        if self.plate.brake.fitted {
            let released = self.drive.releases_brake();
            self.world
                .brake
                .step(released, self.setup.board.pwm_period_s());
            self.world.braked = self.world.brake.holds(&self.plate.brake);
        } else {
            // An ideal brake: an alignment leaves it closed too.
            self.world.braked = !self.drive.state().is_driven()
                || Axis::ALL
                    .iter()
                    .any(|axis| !self.drive.compare(*axis).enable);
        }
        self.drive.period_through(&mut self.world);
        let (drive, temperatures) = (&self.drive, self.world.temperatures);
        let enabled = self.world.inputs.enabled;
        self.world.supervision.period(|| Look {
            supply: drive.board.supply(),
            running: self.drive.bridges_on(),
            enabled,
            temperatures,
            theta: Axis::ALL.map(|axis| drive.estimate(axis).theta.0),
            ..Look::default()
        });
        let (state, latched) = (self.drive.state(), self.drive.latched());
        let (uptime_ms, supervision) = (self.uptime_ms(), &self.world.supervision);
        self.recorder
            .look(&mut self.journal, uptime_ms, state, latched, |fault| {
                supervision.values(fault)
            });
        if speed_ran {
            // Counts wrap, as those of the chip's timer do.
            self.scale = self.drive.board.scale_counts() as i32;
            self.move_on();
            self.sample();
        }
    }

    /// PWM periods since the start.
    pub(crate) fn periods(&self) -> u64 {
        self.before + self.drive.periods()
    }

    /// Time since the start, ms.
    #[must_use]
    pub fn uptime_ms(&self) -> u32 {
        (self.periods() as f64 * self.setup.board.pwm_period_s() * 1e3) as u32
    }

    /// PWM periods from the start to that millisecond.
    fn periods_until(&self, ms: u64) -> u64 {
        (ms as f64 * 1e-3 / self.setup.board.pwm_period_s()).round() as u64
    }

    /// The settings that hold.
    #[must_use]
    pub fn held_settings(&self) -> &Settings {
        self.keeper.settings()
    }

    /// The drive itself, for what no host sees.
    #[must_use]
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The next frame of telemetry that waits.
    pub(crate) fn take_telemetry(&mut self) -> Option<Frame> {
        self.waiting.pop_front()
    }

    /// How many streams were asked.
    pub(crate) fn records(&self) -> u32 {
        self.records
    }

    /// After a step of the speed task: what it is asked next.
    fn move_on(&mut self) {
        let drive = &mut self.drive;
        let seen = Seen {
            state: drive.state(),
            latched: drive.latched(),
            scale: self.scale,
            arrived: drive.arrived(),
            ends_open: self.world.ends_open(),
        };
        let asked = self.motion.step(&seen);
        drive.request.demand = asked.demand;
        if let Some([velocity, base]) = asked.speeds {
            // The plan's velocity was tried when it was made.
            let _ = self.ask(velocity, base);
        }
        let look = TravelLook {
            scale: self.scale,
            origin: self.motion.origin(),
            driven: seen.state.is_driven(),
            reference: self.drive.planned(),
            asked: self.asked,
        };
        let travel = self.travel.step(&self.travel_limits, &look);
        self.world.travel(travel, asked.homing);
    }

    /// Asks the drive for speeds in the link's words.
    fn ask(&mut self, velocity: i32, base: i32) -> Result<(), Refusal> {
        let asked = TableVelocity::from_bits(velocity);
        let base = scale::value(base, scale::BASE_SPEED);
        self.drive
            .command(asked.to_num(), base)
            .map_err(|refused| match refused {
                CommandError::Velocity { .. } => Refusal::Velocity,
                CommandError::Speed { .. } => Refusal::MotorSpeed,
            })?;
        self.asked = asked;
        Ok(())
    }

    /// After a step of the speed task: a sample, if one is due.
    fn sample(&mut self) {
        let Some(stream) = &mut self.stream else {
            return;
        };
        if let Some(left) = stream.left.checked_sub(1) {
            stream.left = left;
            return;
        }
        stream.left = stream.request.divider.saturating_sub(1);
        if self.waiting.len() >= WAITING {
            self.dropped = self.dropped.saturating_add(1);
            return;
        }
        let period = (self.drive.periods() - 1).saturating_sub(stream.start) as u32;
        let motors = Axis::ALL.map(|axis| self.motor_sample(axis));
        self.waiting.push_back(Frame::Sample(Sample {
            period,
            motors,
            scale: self.scale,
        }));
    }

    /// As the firmware's telemetry makes it of a current loop's words.
    fn motor_sample(&self, axis: Axis) -> MotorSample {
        let (drive, k) = (&self.drive, axis.index());
        let estimate = drive.estimate(axis);
        let voltage = drive.ended_voltage(axis);
        let encoder = &self.plate.motors[k].encoder;
        let current = |word: i32| telemetry::rounded(word, scale::SAMPLE_CURRENT_DROPS);
        let volts = |word: i32| telemetry::rounded(word, scale::SAMPLE_VOLTAGE_DROPS);
        let [a, b, _] = estimate.phases;
        MotorSample {
            encoder: encoder
                .interface
                .counts(drive.sample(axis).encoder)
                .unwrap_or_default(),
            phases: [a, b].map(|amps| current(amps.to_bits())),
            voltage: [voltage.d, voltage.q].map(|volt| volts(volt.to_bits())),
            i_q_ref: current(drive.speed().current[k].i_q.to_bits()),
            speed_ref: drive.speed().speed[k].omega_e.to_bits(),
        }
    }
}

/// What a drive of `board` finds in its flash.
fn keeper(flash: SimulatedFlash, own: Settings, board: &BoardPlate) -> Keeper<SimulatedFlash> {
    let mut keeper = Keeper::new(flash, own);
    keeper.take_up(
        || own,
        |settings| fits(settings, &own, board).map_err(NotSet::from),
    );
    keeper
}

/// Whether settings may take the place of those `before`, which fit.
fn fits(settings: &Settings, before: &Settings, board: &BoardPlate) -> Result<(), Unfit> {
    let config = before.plate(board).config();
    let mut config = config.map_err(|misfit| Unfit {
        setting: None,
        misfit,
    })?;
    settings.fits(before, board, &mut config)
}

/// To 15 digits, so that a conversion's last bit is not shown to a person: 11.8 and not 11.799999999999999.
fn tidy(mut settings: Settings) -> Settings {
    for setting in Settings::all() {
        if let Some(Value::Real(x)) = settings.get(setting.id)
            && let Ok(tidy) = format!("{:.14e}", x.get()).parse()
        {
            // A value at an end of its range stays as it is.
            let _ = settings.set(setting.id, Value::Real(Real::new(tidy)));
        }
    }
    settings
}

/// What is asked of the motion of a drive of that plate, in each step of its speed task.
fn motion(plate: &DrivePlate) -> Motion {
    let step = plate.speed_step();
    Motion::new(step, 2.0 * f64::from(STEPS_PER_LOOK) * step)
}

impl Served for SimulatedDrive {
    fn status(&self) -> Status {
        let state = self.drive.state();
        let board = &self.setup.board;
        let motors = Axis::ALL.map(|axis| {
            let (estimate, sample) = (self.drive.estimate(axis), self.drive.sample(axis));
            let turns = f64::from(estimate.status.theta_step) / 2f64.powi(32);
            let speed = turns * TAU / board.pwm_period_s();
            let volts =
                (f64::from(sample.bus) - board.sensors.bus.zero) * board.sensors.bus.per_count;
            MotorStatus {
                current: [estimate.current.d, estimate.current.q].map(|amps| amps.to_bits()),
                speed: scale::word(speed, scale::BASE_SPEED).unwrap_or_default(),
                encoder: self.plate.motors[axis.index()]
                    .encoder
                    .interface
                    .counts(sample.encoder)
                    .unwrap_or_default(),
                alignment: match self.drive.exchange(axis).alignment() {
                    None => Aligned::Unknown,
                    Some(held) if held.reversed => Aligned::Backwards {
                        zero: held.theta_e_at_zero.0,
                    },
                    Some(held) => Aligned::Forwards {
                        zero: held.theta_e_at_zero.0,
                    },
                },
                bus_mv: (volts * 1e3).max(0.0) as u32,
            }
        });
        Status {
            uptime_ms: self.uptime_ms(),
            state: state.word(),
            fault: state.fault_word(),
            misalignment: self
                .drive
                .misalignment()
                .map_or(0, |failed| failed.reason.word()),
            tables: self.drive.compensation().tables().0,
            latched: self.drive.latched().words(),
            limits: self.drive.limits().word(),
            travel: self.motion.progress().word(),
            motors,
            scale: self.scale,
            origin: self.motion.origin(),
            runs_on: self.keeper.found().origin.word(),
            unfit: self.keeper.found().unfit,
            dropped: self.dropped,
            ..Status::default()
        }
    }

    fn state(&self) -> State {
        self.drive.state()
    }

    fn journal(&mut self, look: impl FnOnce(&Journal)) {
        look(&self.journal);
    }

    fn rates(&self) -> (u32, u32) {
        let board = &self.plate.board;
        (board.pwm_hz.round() as u32, board.speed_divider)
    }

    fn simulated(&self) -> bool {
        true
    }

    fn command(&mut self, velocity: i32, base: i32) -> Result<(), Refusal> {
        self.ask(velocity, base)?;
        self.motion.follow();
        Ok(())
    }

    fn travel(&mut self, distance_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal> {
        let plan = MovePlan::new(
            &self.plate.feed,
            self.keeper.settings().scale_count_m(),
            self.plate.tuning.speed_rad_s,
            self.plate.speed_step(),
            distance_nm as f64 * 1e-9,
            scale::value(velocity, scale::TABLE_VELOCITY),
        )
        .map_err(|error| match error {
            MoveError::Distance => Refusal::Distance,
            MoveError::Velocity => Refusal::Velocity,
        })?;
        let origin = self.motion.origin();
        if !self.travel_limits.allows(self.scale, origin, distance_nm) {
            return Err(Refusal::SoftLimit);
        }
        // Whether the screw may turn as fast as the way takes, and then the base speed alone.
        let forwards = if distance_nm < 0 { -velocity } else { velocity };
        self.ask(forwards, base)?;
        self.ask(0, base)?;
        self.motion.travel(plan, self.scale, base);
        Ok(())
    }

    fn home(&mut self, base: i32) -> Result<(), Refusal> {
        let (plate, count_m) = (&self.plate, self.keeper.settings().scale_count_m());
        let plan = HomePlan::new(&plate.feed, &plate.travel.home, count_m, plate.speed_step());
        for velocity in plan.velocities() {
            self.ask(velocity.to_bits(), base)?;
        }
        self.ask(0, base)?;
        self.motion.home(plan, base);
        Ok(())
    }

    fn direct_current(&mut self, motor: u8, current: i32) -> Result<(), Refusal> {
        let axis = Axis::ALL.get(usize::from(motor)).ok_or(Refusal::Current)?;
        self.drive
            .ask_d(*axis, Current::from_bits(current))
            .map_err(|_| Refusal::Current)
    }

    fn angle(&mut self, motor: u8, behind: i32) -> Result<(), Refusal> {
        let axis = *Axis::ALL.get(usize::from(motor)).ok_or(Refusal::Angle)?;
        if self.drive.exchange(axis).alignment().is_none() {
            return Err(Refusal::Angle);
        }
        self.drive.misalign(axis, f64::from(behind) / 2f64.powi(32));
        Ok(())
    }

    fn demand(&mut self, demand: Demand) {
        self.motion.demand(demand);
        if matches!(demand, Demand::Rest | Demand::Reset) {
            self.drive.request.demand = Demand::Rest;
        }
    }

    fn renew(&mut self) {
        let heartbeat = &mut self.drive.request.heartbeat;
        *heartbeat = heartbeat.wrapping_add(1);
    }

    fn settings(&self) -> &Settings {
        self.keeper.settings()
    }

    fn learned(&self) -> Settings {
        let orders = learned(&self.drive, self.plate.compensation);
        self.keeper.settings().with_orders(&orders)
    }

    fn configure(&mut self, settings: &Settings) -> Result<(), NotSet> {
        fits(settings, self.keeper.settings(), &self.board)?;
        self.keeper.store(settings)?;
        let flash = self.keeper.flash().clone();
        self.put_flash(flash).map_err(|misfit| Unfit {
            setting: None,
            misfit,
        })?;
        Ok(())
    }

    fn record(&mut self, request: u32) {
        self.records = self.records.wrapping_add(1);
        self.waiting.clear();
        let header = Header {
            request,
            ..Header::of_plate(&self.plate, self.keeper.settings().scale_count_m())
        };
        self.waiting.push_back(Frame::Header(header));
        let request = Request::of_word(request);
        let divider = u64::from(self.plate.board.speed_divider);
        self.stream = (request.divider != 0).then_some(Stream {
            request,
            start: self.drive.periods().next_multiple_of(divider),
            left: 0,
        });
    }

    fn inject(&mut self, injection: Injection) -> Result<(), Refusal> {
        let fault = Injected::of_word(injection.fault).ok_or(Refusal::Injection)?;
        let axis = *Axis::ALL
            .get(usize::from(injection.motor))
            .ok_or(Refusal::Injection)?;
        let (k, amount) = (axis.index(), injection.amount.get());
        let within = |least: f64, most: f64| {
            (least..=most)
                .contains(&amount)
                .then_some(())
                .ok_or(Refusal::Injection)
        };
        let Self {
            drive,
            world,
            setup,
            ..
        } = self;
        match fault {
            Injected::Clear => {
                world.inputs = Inputs::CLEAR;
                (world.frozen, world.offset_a) = ([None; 2], [0.0; 2]);
                world.load_n = setup.model.feed.load_n;
                drive.board.set_bus_voltage(setup.board.bus_v);
                for axis in Axis::ALL {
                    drive.board.machine.set_open_phase(axis, None);
                }
            }
            Injected::EncoderFrozen => world.frozen[k] = Some(drive.sample(axis).encoder),
            Injected::EncoderSlip => {
                within(-360.0, 360.0)?;
                drive.misalign(axis, amount / 360.0);
            }
            Injected::DriverFault => drive.board.trip_break(axis),
            Injected::OpenPhase => {
                within(1.0, 3.0)?;
                let phase = amount as usize - 1;
                drive.board.machine.set_open_phase(axis, Some(phase));
            }
            Injected::Bus => {
                within(0.0, 1000.0)?;
                drive.board.set_bus_voltage(amount);
            }
            Injected::Load => {
                within(-1e5, 1e5)?;
                world.load_n = amount;
            }
            Injected::EnableOpen => world.inputs.enabled = [false; 2],
            Injected::EndForward => world.inputs.end_forward = true,
            Injected::EndBackward => world.inputs.end_backward = true,
            Injected::CurrentOffset => {
                within(-100.0, 100.0)?;
                world.offset_a[k] = amount;
            }
        }
        Ok(())
    }
}
