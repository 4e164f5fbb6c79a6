//! The drive behind the link: what a host sees of it is what it would see of a board.
//!
//! [`SimulatedDrive`] hosts the [`application`] on the simulated board and machine; [`Serving`] joins it to lines of bytes,
//! millisecond by millisecond, in one thread: the same bytes in the same milliseconds give the same bytes back.
//!
//! The machine has a brake that carries the load, as an axis needs whose load can drive the screw back: the one that the settings
//! say, with its times, or else an ideal one that holds while the motors do not drive the table.

mod injection;
mod lines;
mod within;
mod world;

pub use lines::{LineId, Serving};
pub use within::Within;

use crate::drive::Drive;
use crate::experiment::Setup;
use crate::flash::SimulatedFlash;
use crate::start::{Start, settle};
use crate::supervision::periods_per_ms;
use application::burst::Burst;
use application::configured::{CommandWords, Configured};
use application::drive::LinesParts;
use application::exchange::{DriveExchange, TelemetryExchange};
use application::keep::{Found, Keeper};
use application::lines::Ports;
use application::orders::Orders;
use application::server::{NotSet, Server};
use application::speed::SpeedStep;
use application::start::log_start;
use application::supervise::{MillisecondIn, Supervise, SuperviseParts};
use control::format::Misfit;
use control::interlock::Inputs;
use control::journal::Journal;
use control::plate::{BoardPlate, DrivePlate};
use control::power_stage::StageLook;
use control::supervisor::Demand;
use injection::Possible;
use link::codes::ResetReason;
use link::message::{Injected, Injection, Refusal};
use link::settings::store::PAGES;
use link::settings::{Settings, Unfit, Value};
use link::telemetry::Header;
use link::view::DriveView;
use plant::Axis;
use plant::machine::Coupling;
use std::sync::atomic::Ordering::Relaxed;
use world::{Around, World};

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

/// What RAM holds of the application: gone in a reset.
#[derive(Debug)]
struct Application {
    configured: Configured,
    words: DriveExchange,
    telemetry: TelemetryExchange,
    burst: Burst,
    view: DriveView,
    speed: SpeedStep,
    supervise: Supervise,
    orders: Orders,
    lines: application::lines::Lines<Vec<Server>>,
}

impl Application {
    /// On these settings, with a server for each of so many lines.
    fn new(
        plate: DrivePlate,
        setup: &Setup,
        lines: usize,
        reason: ResetReason,
    ) -> Result<Self, Misfit> {
        let configured = configured(plate, setup)?;
        let view = DriveView::new();
        view.reset_reason.store(reason.word(), Relaxed);
        Ok(Self {
            words: DriveExchange::new(),
            telemetry: TelemetryExchange::new(),
            burst: Burst::new(),
            view,
            speed: SpeedStep::new(),
            supervise: Supervise::new(&configured),
            orders: Orders::new(&plate),
            lines: application::lines::Lines::new(vec![Server::new(); lines]),
            configured,
        })
    }
}

/// A simulated drive that a host may command.
#[derive(Debug)]
pub struct SimulatedDrive {
    drive: Drive,
    begin: Begin,
    /// Periods before it last restarted.
    before: u64,
    world: World,
    board: BoardPlate,
    /// Its own settings, without a store.
    own: Settings,
    keeper: Keeper<SimulatedFlash>,
    setup: Setup,
    application: Application,
    journal: Journal,
    /// PWM periods since the last look of the supervision.
    periods: u32,
}

impl SimulatedDrive {
    /// The machine and board of `setup`, at rest, with its rotors aligned.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn new(setup: &Setup) -> Result<Self, Misfit> {
        Self::of(setup.clone(), &setup.plate(), Begin::Aligned)
    }

    /// The same, told what `plate` says.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn with_plate(setup: &Setup, plate: &DrivePlate) -> Result<Self, Misfit> {
        Self::of(setup.clone(), plate, Begin::Aligned)
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
            shipped: None,
            electronics: None,
        };
        let mut drive = Self::of(setup, &start.plate, Begin::Cold)?;
        // Something carries the load while the drive is off, else the table would lie at an end.
        let machine = &mut drive.drive.board.machine;
        machine.set_load_force(0.0);
        settle(&mut drive.drive.board, start.angles);
        Ok(drive)
    }

    fn of(setup: Setup, made: &DrivePlate, begin: Begin) -> Result<Self, Misfit> {
        let own = tidy(Settings::of_plate(made));
        // As it will be after a restart with the same settings.
        let plate = own.plate(&made.board);
        let mut simulated = Self {
            begin,
            world: World::new(&plate, &setup)?,
            drive: begin.drive(&setup, &plate)?,
            before: 0,
            board: made.board,
            own,
            keeper: keeper(SimulatedFlash::new(PAGES, 0), own, &made.board),
            application: Application::new(plate, &setup, 0, ResetReason::Power)?,
            setup,
            journal: Journal::new(),
            periods: 0,
        };
        simulated.log_start(ResetReason::Power);
        Ok(simulated)
    }

    /// With what its flash holds, in place of an erased one: it restarts.
    ///
    /// # Errors
    /// [`Misfit`] if a gain does not fit its format.
    pub fn put_flash(&mut self, flash: SimulatedFlash) -> Result<(), Misfit> {
        self.keeper = keeper(flash, self.own, &self.board);
        self.restart()
    }

    /// Stores settings, and restarts with them.
    ///
    /// # Errors
    /// [`NotSet`] if they do not fit; nothing is changed then.
    pub fn configure(&mut self, settings: &Settings) -> Result<(), NotSet> {
        fits(settings, self.keeper.settings(), &self.board)?;
        self.keeper.store(settings)?;
        let flash = self.keeper.flash().clone();
        self.put_flash(flash)
            .map_err(|misfit| Unfit {
                setting: None,
                misfit,
            })
            .map_err(NotSet::from)
    }

    /// The settings that hold.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        self.keeper.settings()
    }

    /// What it runs on.
    #[must_use]
    pub fn configured(&self) -> &Configured {
        &self.application.configured
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

    /// The drive itself, for what no host sees.
    #[must_use]
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Enable switch and end switches, as the drive reads them.
    #[must_use]
    pub fn contacts(&self) -> Inputs {
        self.world.contacts()
    }

    /// The brake carries the load.
    #[must_use]
    pub fn braked(&self) -> bool {
        self.world.braked
    }

    /// The table's travel since it was switched on in the middle of its range, m.
    #[must_use]
    pub fn travel_from_start_m(&self) -> f64 {
        self.world.travel_from_start_m()
    }

    /// The words that a debugger would see.
    #[must_use]
    pub fn view(&self) -> &DriveView {
        &self.application.view
    }

    /// Restarts, on the board and machine that are there.
    fn restart(&mut self) -> Result<(), Misfit> {
        let plate = self.keeper.settings().plate(&self.board);
        let mut drive = self.begin.drive(&self.setup, &plate)?;
        let lines = self.application.lines.servers().len();
        let reason = ResetReason::Software;
        let application = Application::new(plate, &self.setup, lines, reason)?;
        std::mem::swap(&mut drive.board, &mut self.drive.board);
        match self.begin {
            Begin::Aligned => drive.take_observers(&mut self.drive),
            // A reset of the chip puts its counters to zero.
            Begin::Cold => drive.board.wake_encoders(),
        }
        self.before += self.drive.periods();
        (self.drive, self.application, self.periods) = (drive, application, 0);
        self.world.releases = false;
        self.journal.take_up();
        self.log_start(reason);
        Ok(())
    }

    fn log_start(&mut self, reason: ResetReason) {
        let (found, plate) = (self.keeper.found(), &self.application.configured.plate);
        // `serve` prints the warnings once, from the settings.
        let _ = log_start(&mut self.journal, reason, found, plate);
    }

    /// A look at the lines.
    fn serve(&mut self, ports: &mut impl Ports) {
        let mut host = Host {
            board: &self.board,
            injections: Vec::new(),
            changed: false,
        };
        // A number that is another with each start of a session.
        let seed = (self.before + self.drive.periods()) as u32;
        let Application {
            configured,
            words,
            telemetry,
            burst,
            view,
            orders,
            lines,
            ..
        } = &mut self.application;
        let starts_anew = lines.step(
            || seed,
            ports,
            &mut LinesParts {
                configured,
                words,
                telemetry,
                burst,
                view,
                motors: Axis::ALL.map(|axis| self.drive.exchange(axis)),
                keeper: &mut self.keeper,
                orders: &mut &mut *orders,
                journal: &mut &mut self.journal,
                world: &mut host,
            },
        );
        let Host {
            injections,
            changed,
            ..
        } = host;
        if changed {
            self.take_up();
        }
        for injection in injections {
            injection.put(&mut self.drive, &mut self.world, &self.setup);
        }
        if starts_anew {
            let flash = self.keeper.flash().clone();
            // They were tried before they were stored.
            let _ = self.put_flash(flash);
        }
    }

    /// The settings that hold, in the running drive.
    fn take_up(&mut self) {
        let plate = self.keeper.settings().plate(&self.board);
        // They were tried before.
        if let Ok(configured) = configured(plate, &self.setup) {
            self.drive.configure(configured.drive);
            self.application.configured = configured;
        }
    }

    /// A line to a host that is new, in the place of an older one or not.
    fn open_line(&mut self, line: usize) {
        let Application {
            lines, telemetry, ..
        } = &mut self.application;
        if line < lines.servers().len() {
            lines.hang_up(line, telemetry);
        } else {
            lines.servers().resize(line + 1, Server::new());
        }
    }

    /// One PWM period.
    pub fn period(&mut self) {
        let period_s = self.setup.board.pwm_period_s();
        let brake = &self.application.configured.plate.brake;
        // An alignment leaves the brake closed too.
        let driven = self.drive.state().is_driven()
            && Axis::ALL
                .iter()
                .all(|axis| self.drive.compare(*axis).enable);
        self.world.hold(brake, driven, period_s);
        let Application {
            words,
            telemetry,
            burst,
            view,
            speed,
            ..
        } = &mut self.application;
        self.drive.period_through(&mut Around {
            world: &mut self.world,
            step: speed,
            words,
            telemetry,
            burst,
            view,
        });
        for (index, axis) in self.world.index.iter_mut().zip(Axis::ALL) {
            *index |= self.drive.board.take_index_passed(axis);
        }
        self.periods += 1;
        if self.periods == periods_per_ms(&self.board) {
            self.periods = 0;
            self.supervise();
        }
    }

    fn supervise(&mut self) {
        let Application {
            configured,
            words,
            view,
            supervise,
            orders,
            ..
        } = &mut self.application;
        let contacts = self.world.contacts();
        let past = orders.step(configured, words, view, contacts);
        let (drive, bus) = (&self.drive, self.world.watches.bus());
        let input = MillisecondIn {
            late: false,
            contacts,
            bus,
            supply: drive.board.supply(),
            temperatures: self.world.temperatures,
            index: std::mem::take(&mut self.world.index),
            transition_error: [false; 2],
            stages: Axis::ALL.map(|axis| StageLook {
                current: drive.sample(axis).current,
                bus: bus[axis.index()],
            }),
            asleep: [false; 2],
        };
        let parts = SuperviseParts {
            configured,
            words,
            view,
            motors: Axis::ALL.map(|axis| drive.exchange(axis)),
        };
        supervise.step(parts, &input, past, &mut self.journal);
    }

    /// PWM periods since the first start.
    pub(crate) fn periods(&self) -> u64 {
        self.before + self.drive.periods()
    }

    /// PWM periods from the first start to that millisecond.
    fn periods_until(&self, ms: u64) -> u64 {
        (ms as f64 * 1e-3 / self.setup.board.pwm_period_s()).round() as u64
    }
}

/// The simulated machine, as the application asks it.
struct Host<'a> {
    board: &'a BoardPlate,
    injections: Vec<Possible>,
    /// The settings have changed.
    changed: bool,
}

impl application::drive::World for Host<'_> {
    const SIMULATED: bool = true;

    fn fits(&mut self, settings: &Settings, before: &Settings) -> Result<(), NotSet> {
        Ok(fits(settings, before, self.board)?)
    }

    fn take_up(&mut self) {
        self.changed = true;
    }

    fn inject(&mut self, fault: Injected, injection: &Injection) -> Result<(), Refusal> {
        self.injections.push(Possible::new(fault, injection)?);
        Ok(())
    }
}

/// All that a drive with this plate is configured with.
fn configured(plate: DrivePlate, setup: &Setup) -> Result<Configured, Misfit> {
    Ok(Configured {
        drive: plate.config()?,
        guard: world::guards(&plate, setup.board.bus_v).config()?,
        header: Header::of_plate(&plate),
        travel: plate.travel_config(),
        words: CommandWords::new(&plate),
        plate,
    })
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
            && let Ok(tidy) = format!("{x:.14e}").parse()
        {
            // A value at an end of its range stays as it is.
            let _ = settings.set(setting.id, Value::Real(tidy));
        }
    }
    settings
}
