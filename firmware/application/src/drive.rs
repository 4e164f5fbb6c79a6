//! The drive as the link commands it.

use crate::burst::{Burst, Motor};
use crate::configured::Configured;
use crate::exchange::{DriveExchange, TelemetryExchange, state};
use crate::keep::Keeper;
use crate::orders::Orders;
use crate::server::{NotSet, Served};
use control::coordinator::{Command, CommandError, Coordinator};
use control::exchange::MotorExchange;
use control::format::{Angle, Current, MechanicalSpeed, TableVelocity};
use control::journal::Journal;
use control::observer::EncoderAlignment;
use control::stream::{DELAY_MS, Followed, SetPoint};
use control::table_move::{MoveError, MovePlan};
use control::torque::TorqueCommand;
use core::ops::RangeInclusive;
use core::sync::atomic::Ordering::Relaxed;
use embedded_storage::nor_flash::NorFlash;
use heapless::Vec;
use link::burst::{BurstRequest, BurstSample, BurstStatus, SAMPLES_A_FRAME};
use link::codes::{Demand, State};
use link::message::{Aligned, Injected, Injection, MotorStatus, Refusal, Status};
use link::settings::{Effect, Settings};
use link::view::DriveView;

/// How long a set-point of a stream may wait, ms.
const DELAYS: RangeInclusive<u16> = {
    let [least, most] = DELAY_MS;
    least..=most
};

/// The board, or the simulated machine: what only it knows.
pub trait World {
    /// It is a simulated machine.
    const SIMULATED: bool;
    /// Whether the drive can be configured with these settings, in the place of `before`.
    ///
    /// # Errors
    /// [`NotSet`].
    fn fits(&mut self, settings: &Settings, before: &Settings) -> Result<(), NotSet>;
    /// The settings that [fitted](World::fits) last hold from the next step on. They leave the current loops and the compensation's orders
    /// as they are.
    fn take_up(&mut self);
    /// Puts a fault in, which is no [`Injected`] of a real drive.
    ///
    /// # Errors
    /// [`Refusal::Real`] or [`Refusal::Injection`].
    fn inject(&mut self, fault: Injected, injection: &Injection) -> Result<(), Refusal> {
        let _ = (fault, injection);
        Err(Refusal::Real)
    }
}

/// Something that other tasks use too.
pub trait Access<T> {
    /// Alone with it.
    fn with<R>(&mut self, look: impl FnOnce(&mut T) -> R) -> R;
}

impl<T> Access<T> for &mut T {
    fn with<R>(&mut self, look: impl FnOnce(&mut T) -> R) -> R {
        look(self)
    }
}

/// What the lines work on beside their own state.
#[derive(Debug)]
pub struct LinesParts<'a, F, O, J, W> {
    /// What the drive runs on.
    pub configured: &'a Configured,
    /// The words between the parts.
    pub words: &'a DriveExchange,
    /// What the speed task tells.
    pub telemetry: &'a TelemetryExchange,
    /// What the current loops' periods are kept in.
    pub burst: &'a Burst,
    /// The debug view.
    pub view: &'a DriveView,
    /// Screw, nut.
    pub motors: [&'a MotorExchange; 2],
    /// The settings.
    pub keeper: &'a mut Keeper<F>,
    /// The motion.
    pub orders: &'a mut O,
    /// The journal.
    pub journal: &'a mut J,
    /// The board or the simulated machine.
    pub world: &'a mut W,
}

/// What hosts have asked that is yet to be done.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    /// A stream that has not begun.
    pub(crate) record: Option<u32>,
    /// Since when the drive is to restart, ms: settings were stored.
    pub(crate) restart: Option<u32>,
    /// Another configuration holds than this step began with.
    pub(crate) changed: bool,
}

impl Asked {
    pub(crate) const fn new() -> Self {
        Self {
            record: None,
            restart: None,
            changed: false,
        }
    }
}

/// See the module.
pub(crate) struct Commanded<'a, 'b, F, O, J, W> {
    pub(crate) asked: &'a mut Asked,
    pub(crate) parts: &'a mut LinesParts<'b, F, O, J, W>,
}

impl<F, O, J, W> Commanded<'_, '_, F, O, J, W> {
    /// Whether feed and motors may move that fast.
    fn allowed(&self, velocity: i32, base: i32) -> Result<(), Refusal> {
        let command = Command {
            velocity: TableVelocity::from_bits(velocity),
            base: MechanicalSpeed::from_bits(base),
        };
        Coordinator::new()
            .command(&self.parts.configured.drive.coordinator, command)
            .map_err(refusal)
    }

    /// The scale's count at position zero; `None`: the drive is not homed.
    fn origin(&self) -> Option<i32> {
        let view = self.parts.view;
        (view.homed.load(Relaxed) != 0).then(|| view.origin.load(Relaxed))
    }

    fn motor(&self, k: usize) -> MotorStatus {
        let (view, exchange) = (&self.parts.view.motors[k], self.parts.motors[k]);
        let [d, q] = &view.current;
        MotorStatus {
            current: [d.load(Relaxed), q.load(Relaxed)],
            // From 2^-16 to 2^-18 rad/s.
            speed: view.speed.load(Relaxed).saturating_mul(4),
            encoder: exchange.encoder(),
            alignment: match exchange.alignment() {
                None => Aligned::Unknown,
                Some(held) if held.reversed => Aligned::Backwards {
                    zero: held.theta_e_at_zero.0,
                },
                Some(held) => Aligned::Forwards {
                    zero: held.theta_e_at_zero.0,
                },
            },
            bus_mv: u32::from(exchange.bus()) * (self.parts.configured.words.bus_uv / 10) / 100,
        }
    }

    fn exchange(&self, motor: u8) -> Option<&MotorExchange> {
        self.parts.motors.get(usize::from(motor)).copied()
    }
}

/// Why the link refuses what the control does not allow.
const fn refusal(error: CommandError) -> Refusal {
    match error {
        CommandError::Velocity { .. } | CommandError::Relative { .. } => Refusal::Velocity,
        CommandError::Current { .. } => Refusal::Current,
        CommandError::Speed { .. } => Refusal::MotorSpeed,
    }
}

impl<F, O, J, W> Served for Commanded<'_, '_, F, O, J, W>
where
    F: NorFlash,
    O: Access<Orders>,
    J: Access<Journal>,
    W: World,
{
    fn status(&self) -> Status {
        let view = self.parts.view;
        let found = self.parts.keeper.found();
        Status {
            uptime_ms: view.uptime_ms.load(Relaxed),
            state: view.state.load(Relaxed),
            fault: view.fault.load(Relaxed),
            misalignment: view.misalignment.load(Relaxed),
            tables: view.tables.load(Relaxed),
            latched: view.latched.each_ref().map(|word| word.load(Relaxed)),
            limits: view.limits.load(Relaxed),
            travel: self.parts.words.travel.load(Relaxed),
            motors: [self.motor(0), self.motor(1)],
            scale: view.scale.load(Relaxed),
            origin: self.origin(),
            runs_on: found.origin.word(),
            unfit: found.unfit,
            dropped: view.telemetry_dropped.load(Relaxed),
            ..Status::default()
        }
    }

    fn state(&self) -> State {
        state(self.parts.view)
    }

    fn journal(&mut self, look: impl FnOnce(&Journal)) {
        self.parts.journal.with(|journal| look(journal));
    }

    fn rates(&self) -> (u32, u32) {
        let configured = self.parts.configured;
        (configured.words.pwm_hz, configured.drive.speed_divider)
    }

    fn simulated(&self) -> bool {
        W::SIMULATED
    }

    fn command(&mut self, velocity: i32, base: i32) -> Result<(), Refusal> {
        self.allowed(velocity, base)?;
        let words = self.parts.words;
        self.parts
            .orders
            .with(|orders| orders.follow(words, velocity, base));
        Ok(())
    }

    fn travel(&mut self, distance_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal> {
        let configured = self.parts.configured;
        let most = TableVelocity::from_bits(velocity);
        let plan =
            MovePlan::new(&configured.words.moves, distance_nm, most).map_err(
                |error| match error {
                    MoveError::Distance => Refusal::Distance,
                    MoveError::Velocity => Refusal::Velocity,
                },
            )?;
        // Whether the screw may turn as fast as the way takes, and as the common speed alone asks.
        self.allowed(if distance_nm < 0 { -velocity } else { velocity }, base)?;
        self.allowed(0, base)?;
        let scale = self.parts.view.scale.load(Relaxed);
        if !configured.travel.allows(scale, self.origin(), distance_nm) {
            return Err(Refusal::SoftLimit);
        }
        let words = self.parts.words;
        self.parts
            .orders
            .with(|orders| orders.travel(words, plan, scale, base));
        Ok(())
    }

    fn travel_to(&mut self, position_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal> {
        let origin = self.origin().ok_or(Refusal::NotHomed)?;
        let scale = self.parts.view.scale.load(Relaxed);
        let here_nm = self.parts.configured.travel.position_nm(scale, origin);
        self.travel(position_nm.saturating_sub(here_nm), velocity, base)
    }

    fn home(&mut self, base: i32) -> Result<(), Refusal> {
        let plan = self.parts.configured.words.home;
        for velocity in plan.velocities() {
            self.allowed(velocity.to_bits(), base)?;
        }
        self.allowed(0, base)?;
        let words = self.parts.words;
        self.parts
            .orders
            .with(|orders| orders.home(words, plan, base));
        Ok(())
    }

    fn torque(&mut self, motor: u8, current: i32, speed: i32, base: i32) -> Result<(), Refusal> {
        self.exchange(motor).ok_or(Refusal::Current)?;
        let config = &self.parts.configured.drive;
        let torque = TorqueCommand {
            motor: motor.into(),
            i_q: Current::from_bits(current),
            speed_max: MechanicalSpeed::from_bits(speed),
        };
        torque
            .allowed(
                &config.coordinator,
                &config.speed_loops,
                MechanicalSpeed::from_bits(base),
            )
            .map_err(refusal)?;
        self.allowed(0, base)?;
        let words = self.parts.words;
        self.parts
            .orders
            .with(|orders| orders.push(words, torque, base));
        Ok(())
    }

    fn stream(&mut self, delay_ms: u16, homed: bool, base: i32) -> Result<(), Refusal> {
        if !DELAYS.contains(&delay_ms) {
            return Err(Refusal::Delay);
        }
        self.allowed(0, base)?;
        let zero = if homed {
            self.origin().ok_or(Refusal::NotHomed)?
        } else {
            self.parts.view.scale.load(Relaxed)
        };
        let (words, config) = (self.parts.words, self.parts.configured.words.stream);
        self.parts
            .orders
            .with(|orders| orders.stream(words, config, zero, delay_ms, base));
        Ok(())
    }

    fn set_point(
        &mut self,
        at_us: u32,
        position_nm: i64,
        velocity: Option<i32>,
    ) -> Result<Followed, Refusal> {
        let configured = self.parts.configured;
        let (scale, origin) = (self.parts.view.scale.load(Relaxed), self.origin());
        let point = SetPoint {
            at_us,
            position_nm,
            velocity: velocity.map(TableVelocity::from_bits),
        };
        self.parts.orders.with(|orders| {
            orders.set_point(&configured.words.stream, point, scale, |zero| {
                configured.travel.allows(zero, origin, position_nm)
            })
        })
    }

    fn direct_current(&mut self, motor: u8, current: i32) -> Result<(), Refusal> {
        let config = &self.parts.configured.drive;
        let k = usize::from(motor);
        let (Some(limit), Some(config), Some(exchange)) = (
            config.speed_loops.get(k),
            config.current_loops.get(k),
            self.exchange(motor),
        ) else {
            return Err(Refusal::Current);
        };
        let current = Current::from_bits(current);
        if current.saturating_abs() > limit.i_max {
            return Err(Refusal::Current);
        }
        exchange.ask_d(current, config);
        Ok(())
    }

    fn angle(&mut self, motor: u8, behind: i32) -> Result<(), Refusal> {
        let exchange = self.exchange(motor).ok_or(Refusal::Angle)?;
        let held = exchange.alignment().ok_or(Refusal::Angle)?;
        let right = EncoderAlignment {
            theta_e_at_zero: held.theta_e_at_zero.plus(Angle(behind.cast_unsigned())),
            ..held
        };
        exchange.align(Some(held), Some(right));
        Ok(())
    }

    fn demand(&mut self, demand: Demand) {
        let words = self.parts.words;
        self.parts
            .orders
            .with(|orders| orders.demand(words, demand));
    }

    fn renew(&mut self) {
        self.parts.words.renew();
    }

    fn base_for(&self, velocity: i32) -> i32 {
        self.parts.configured.words.bases.base_for(velocity)
    }

    fn home_velocity(&self) -> i32 {
        let [towards, _] = self.parts.configured.words.home.velocities();
        towards.to_bits()
    }

    fn settings(&self) -> &Settings {
        self.parts.keeper.settings()
    }

    fn learned(&self) -> Settings {
        let (configured, telemetry) = (self.parts.configured, self.parts.telemetry);
        let mut settings = *self.parts.keeper.settings();
        if configured.drive.compensation.active && telemetry.all_learned.load(Relaxed) {
            telemetry.put_learned(&mut settings, &configured.plate.compensation);
        }
        settings
    }

    fn configure(&mut self, settings: &Settings) -> Result<Effect, NotSet> {
        let parts = &mut *self.parts;
        let before = parts.keeper.settings();
        let effect = before.effect(settings);
        parts.world.fits(settings, before)?;
        if effect == Effect::Restart {
            parts.keeper.store(settings)?;
            self.asked.restart = Some(parts.view.uptime_ms.load(Relaxed));
        } else {
            parts.keeper.change(settings);
            parts.world.take_up();
            self.asked.changed = true;
        }
        Ok(effect)
    }

    fn store(&mut self) -> Result<(), NotSet> {
        let keeper = &mut self.parts.keeper;
        let settings = *keeper.settings();
        keeper.store(&settings)
    }

    fn record(&mut self, request: u32) {
        self.asked.record = Some(request);
    }

    fn arm_burst(&mut self, request: BurstRequest) -> Result<(), Refusal> {
        let parts = &*self.parts;
        let loops = &parts.configured.drive.current_loops;
        let config = loops
            .get(usize::from(request.motor))
            .ok_or(Refusal::Burst)?;
        let motor = Motor {
            config,
            pwm_hz: parts.configured.words.pwm_hz,
        };
        parts.burst.arm(request, parts.motors, motor, parts.view)
    }

    fn end_burst(&mut self) {
        self.parts.burst.end(self.parts.motors);
    }

    fn burst(&self) -> BurstStatus {
        self.parts.burst.status(self.parts.motors)
    }

    fn burst_samples(&self, from: u16) -> Result<Vec<BurstSample, SAMPLES_A_FRAME>, Refusal> {
        let loops = &self.parts.configured.drive.current_loops;
        self.parts.burst.samples(from, loops)
    }

    fn inject(&mut self, injection: Injection) -> Result<(), Refusal> {
        let fault = Injected::of_word(injection.fault).ok_or(Refusal::Injection)?;
        self.parts.world.inject(fault, &injection)
    }
}
