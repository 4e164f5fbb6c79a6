//! The lines to hosts, served by the lowest code there is: the serial port and RTT's link channels.
//!
//! What a host may ask, and what comes of it, is [`link::server`]'s; here it is done. Nothing above waits for it: what it
//! shares with the supervision is locked against that alone.

use crate::config::{self, Configured, PLATE, config, configured};
use crate::debug_view::{DRIVE_VIEW, count};
use crate::hw::cycles;
use crate::hw::flash::SettingsPages;
use crate::hw::serial::Serial;
use crate::motor_loop::MOTORS;
use crate::orders::{COMMANDED, Orders};
use crate::speed::{ALL_LEARNED, LEARNED};
use crate::telemetry::LinkStream;
use control::compensation::line::Phasor;
use control::coordinator::{Command, CommandError, Coordinator};
use control::format::{Angle, Current, MechanicalSpeed, TableVelocity};
use control::homing::HomePlan;
use control::journal::Journal;
use control::observer::EncoderAlignment;
use control::plate::DriveConfig;
use control::table_move::{MoveError, MovePlan};
use core::mem::MaybeUninit;
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::SCB;
use link::codes::{Demand, State};
use link::frame::{FRAME_MAX, encode};
use link::message::{Aligned, DriveFrame, Injected, Injection, MotorStatus, Refusal, Status};
use link::scale;
use link::server::{Commander, NotSet, Served, Server};
use link::settings::Settings;
use link::settings::keep::Keeper;
use rtic::Mutex;
use rtt_target::{ChannelMode, DownChannel, UpChannel};

/// Bytes of the link's RTT channels: to the host, telemetry for 80 ms at 5 kHz; from the host, a few commands.
pub(crate) const RTT_UP_BYTES: usize = 20 * 1024;
pub(crate) const RTT_DOWN_BYTES: usize = 512;

/// How long an answer may take to reach its host before the drive starts anew, ms.
const RESTART_MS: u32 = 50;

/// Bytes of a line that are looked at before its other work goes on.
const BYTES_AT_ONCE: usize = 64;

/// RTT's link channels.
struct Rtt {
    up: UpChannel,
    down: DownChannel,
}

/// A line of bytes.
trait Line {
    /// The next byte that has come.
    fn take(&mut self) -> Option<u8>;
    /// An answer will find room.
    fn has_room(&self) -> bool;
    /// Sends a frame, whole; `false` if there is no room.
    fn put(&mut self, bytes: &[u8]) -> bool;
}

impl Line for Serial {
    fn take(&mut self) -> Option<u8> {
        Serial::take(self)
    }

    fn has_room(&self) -> bool {
        Serial::has_room(self)
    }

    /// Telemetry leaves room for an answer.
    fn put(&mut self, bytes: &[u8]) -> bool {
        Serial::put(self, bytes)
    }
}

impl Line for Rtt {
    fn take(&mut self) -> Option<u8> {
        let mut byte = [0];
        (self.down.read(&mut byte) == 1).then_some(byte[0])
    }

    /// Whether there is room shows when it is written. A host that reads nothing gets no answer.
    fn has_room(&self) -> bool {
        true
    }

    fn put(&mut self, bytes: &[u8]) -> bool {
        // A debugger may have told the channel to wait for room.
        self.up.set_mode(ChannelMode::NoBlockSkip);
        self.up.write(bytes) == bytes.len()
    }
}

/// All lines, and the one drive.
pub struct Lines {
    /// Once they are started, and the settings that the drive runs on.
    ports: Option<(Serial, Rtt, &'static mut Keeper<SettingsPages>)>,
    servers: [Server; 2],
    commander: Commander,
    held: Held,
    stream: LinkStream,
    /// The line that the telemetry goes to.
    recorded_by: usize,
    /// When the commander last looked, ms.
    looked: u32,
}

/// What the drive keeps for its hosts.
struct Held {
    /// A stream that was asked and has not begun.
    record: Option<u32>,
    /// Since when it is to start anew, ms: settings were stored.
    restart: Option<u32>,
    /// Where settings are tried.
    tried: MaybeUninit<DriveConfig>,
}

impl Lines {
    /// Without a port.
    pub(crate) const fn new() -> Self {
        Self {
            ports: None,
            servers: [const { Server::new() }; 2],
            commander: Commander::new(0),
            held: Held {
                record: None,
                restart: None,
                tried: MaybeUninit::uninit(),
            },
            stream: LinkStream::new(),
            recorded_by: 0,
            looked: 0,
        }
    }

    /// Serves these ports from now on.
    #[inline(never)]
    pub(crate) fn start(
        &mut self,
        serial: Serial,
        up: UpChannel,
        down: DownChannel,
        keeper: &'static mut Keeper<SettingsPages>,
    ) {
        self.ports = Some((serial, Rtt { up, down }, keeper));
    }

    /// A look at all lines: what came is answered, and what waits goes.
    pub(crate) fn step(
        &mut self,
        orders: &mut impl Mutex<T = Orders>,
        journal: &mut impl Mutex<T = &'static mut Journal>,
    ) {
        let Self {
            ports: Some((serial, rtt, keeper)),
            servers: [serial_server, rtt_server],
            commander,
            held,
            stream,
            recorded_by,
            looked,
        } = self
        else {
            return;
        };
        let now_ms = DRIVE_VIEW.uptime_ms.load(Relaxed);
        if let Some(since) = held.restart {
            // What is asked meanwhile is asked again.
            if now_ms.wrapping_sub(since) > RESTART_MS && !state().has_bridges_on() {
                SCB::sys_reset();
            }
            serial.go_on();
            return;
        }
        let mut drive = Drive {
            held,
            keeper,
            orders,
            journal,
        };
        answer(serial, serial_server, commander, &mut drive);
        if let Some(request) = drive.held.record.take() {
            *recorded_by = 0;
            stream.start(request);
        }
        answer(rtt, rtt_server, commander, &mut drive);
        if let Some(request) = drive.held.record.take() {
            *recorded_by = 1;
            stream.start(request);
        }
        if now_ms != *looked {
            *looked = now_ms;
            if let Some(event) = commander.look(state(), now_ms) {
                let mut buffer = [0; FRAME_MAX];
                if let Some(bytes) = encode(&DriveFrame::Event(event), &mut buffer) {
                    if serial_server.has_session() {
                        serial.put(bytes);
                    }
                    if rtt_server.has_session() {
                        rtt.put(bytes);
                    }
                }
            }
        }
        stream.step(|bytes| match recorded_by {
            0 => serial.room() >= bytes.len() + FRAME_MAX && serial.put(bytes),
            _ => rtt.put(bytes),
        });
        serial.go_on();
    }
}

/// Answers what came on a line.
fn answer(
    line: &mut impl Line,
    server: &mut Server,
    commander: &mut Commander,
    drive: &mut impl Served,
) {
    for _ in 0..BYTES_AT_ONCE {
        if !line.has_room() {
            return;
        }
        let Some(byte) = line.take() else { return };
        commander.stir(cycles::now());
        let now_ms = DRIVE_VIEW.uptime_ms.load(Relaxed);
        server.take(byte, now_ms, commander, drive, |bytes| {
            line.put(bytes);
        });
    }
}

/// What the drive says that it is doing.
fn state() -> State {
    let view = &DRIVE_VIEW;
    let look = || State::of_words(view.state.load(Relaxed), view.fault.load(Relaxed));
    // A fault may go between the two words.
    look().or_else(look).unwrap_or_default()
}

/// The drive as the link commands it.
struct Drive<'a, O, J> {
    held: &'a mut Held,
    keeper: &'a mut Keeper<SettingsPages>,
    orders: &'a mut O,
    journal: &'a mut J,
}

/// Bus voltage of an ADC count, uV.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const BUS_UV: u32 = (PLATE.board.bus_volts_per_count * 1e6 + 0.5) as u32;

fn motor(k: usize) -> MotorStatus {
    let (view, shared) = (&DRIVE_VIEW.motors[k], &MOTORS[k]);
    let [d, q] = &view.current;
    MotorStatus {
        current: [d.load(Relaxed), q.load(Relaxed)],
        // From 2^-16 to 2^-18 rad/s.
        speed: view.speed.load(Relaxed).saturating_mul(4),
        encoder: shared.exchange.encoder(),
        alignment: match shared.exchange.alignment() {
            None => Aligned::Unknown,
            Some(held) if held.reversed => Aligned::Backwards {
                zero: held.theta_e_at_zero.0,
            },
            Some(held) => Aligned::Forwards {
                zero: held.theta_e_at_zero.0,
            },
        },
        bus_mv: u32::from(shared.exchange.bus()) * (BUS_UV / 10) / 100,
    }
}

/// Whether feed and motors may move that fast.
fn allowed(velocity: i32, base: i32) -> Result<(), Refusal> {
    let command = Command {
        velocity: TableVelocity::from_bits(velocity),
        base: MechanicalSpeed::from_bits(base),
    };
    Coordinator::new()
        .command(&config().coordinator, command)
        .map_err(|refused| match refused {
            CommandError::Velocity { .. } => Refusal::Velocity,
            CommandError::Speed { .. } => Refusal::MotorSpeed,
        })
}

/// The scale's count at position zero; `None`: the drive is not homed.
fn origin() -> Option<i32> {
    let view = &DRIVE_VIEW;
    (view.homed.load(Relaxed) != 0).then(|| view.origin.load(Relaxed))
}

impl<O, J> Served for Drive<'_, O, J>
where
    O: Mutex<T = Orders>,
    J: Mutex<T = &'static mut Journal>,
{
    fn status(&self) -> Status {
        let view = &DRIVE_VIEW;
        Status {
            uptime_ms: view.uptime_ms.load(Relaxed),
            state: view.state.load(Relaxed),
            fault: view.fault.load(Relaxed),
            misalignment: view.misalignment.load(Relaxed),
            tables: view.tables.load(Relaxed),
            latched: view.latched.each_ref().map(|word| word.load(Relaxed)),
            limits: view.limits.load(Relaxed),
            travel: crate::orders::TRAVEL.load(Relaxed),
            motors: [motor(0), motor(1)],
            scale: view.scale.load(Relaxed),
            origin: origin(),
            runs_on: self.keeper.found().origin.word(),
            unfit: self.keeper.found().unfit,
            dropped: view.telemetry_dropped.load(Relaxed),
            ..Status::default()
        }
    }

    fn state(&self) -> State {
        state()
    }

    fn journal(&mut self, look: impl FnOnce(&Journal)) {
        self.journal.lock(|journal| look(journal));
    }

    fn rates(&self) -> (u32, u32) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        const PWM_HZ: u32 = (PLATE.board.pwm_hz + 0.5) as u32;
        (PWM_HZ, PLATE.board.speed_divider)
    }

    fn simulated(&self) -> bool {
        false
    }

    fn command(&mut self, velocity: i32, base: i32) -> Result<(), Refusal> {
        allowed(velocity, base)?;
        self.orders.lock(|orders| orders.follow(velocity, base));
        Ok(())
    }

    fn travel(&mut self, distance_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal> {
        let Configured {
            plate,
            scale_count_m,
            ..
        } = configured();
        let plan = MovePlan::new(
            &plate.feed,
            *scale_count_m,
            plate.tuning.speed_rad_s,
            crate::orders::STEP_S,
            distance_nm as f64 * 1e-9,
            f64::from(velocity) / f64::from(1 << scale::TABLE_VELOCITY),
        )
        .map_err(|error| match error {
            MoveError::Distance => Refusal::Distance,
            MoveError::Velocity => Refusal::Velocity,
        })?;
        // Whether the screw may turn as fast as the way takes.
        allowed(if distance_nm < 0 { -velocity } else { velocity }, base)?;
        let scale = DRIVE_VIEW.scale.load(Relaxed);
        if !configured().travel.allows(scale, origin(), distance_nm) {
            return Err(Refusal::SoftLimit);
        }
        self.orders.lock(|orders| orders.travel(plan, base));
        Ok(())
    }

    fn home(&mut self, base: i32) -> Result<(), Refusal> {
        let Configured {
            plate,
            scale_count_m,
            ..
        } = configured();
        let (home, step_s) = (&plate.travel.home, crate::orders::STEP_S);
        let plan = HomePlan::new(&plate.feed, home, *scale_count_m, step_s);
        for velocity in plan.velocities() {
            allowed(velocity.to_bits(), base)?;
        }
        self.orders.lock(|orders| orders.home(plan, base));
        Ok(())
    }

    fn direct_current(&mut self, motor: u8, current: i32) -> Result<(), Refusal> {
        let k = usize::from(motor);
        let (Some(limit), Some(config), Some(shared)) = (
            config().speed_loops.get(k),
            config().current_loops.get(k),
            MOTORS.get(k),
        ) else {
            return Err(Refusal::Current);
        };
        let current = Current::from_bits(current);
        if current.saturating_abs() > limit.i_max {
            return Err(Refusal::Current);
        }
        shared.exchange.ask_d(current, config);
        Ok(())
    }

    fn angle(&mut self, motor: u8, behind: i32) -> Result<(), Refusal> {
        let shared = MOTORS.get(usize::from(motor)).ok_or(Refusal::Angle)?;
        let held = shared.exchange.alignment().ok_or(Refusal::Angle)?;
        let right = EncoderAlignment {
            theta_e_at_zero: held.theta_e_at_zero.plus(Angle(behind.cast_unsigned())),
            ..held
        };
        shared.exchange.align(Some(held), Some(right));
        Ok(())
    }

    fn demand(&mut self, demand: Demand) {
        self.orders.lock(|orders| orders.demand(demand));
    }

    fn renew(&mut self) {
        count(&COMMANDED.heartbeat);
    }

    fn settings(&self) -> &Settings {
        self.keeper.settings()
    }

    fn learned(&self) -> Settings {
        let Configured { plate, drive, .. } = configured();
        let settings = self.keeper.settings();
        if !drive.compensation.active || !ALL_LEARNED.load(Relaxed) {
            return *settings;
        }
        let mut orders = plate.compensation;
        for (line, learned) in LEARNED.iter().enumerate() {
            let [re, im] = learned.each_ref().map(|part| part.load(Relaxed));
            orders.keep(line, Phasor { re, im });
        }
        settings.with_orders(&orders)
    }

    fn configure(&mut self, settings: &Settings) -> Result<(), NotSet> {
        let tried = self.held.tried.write(*config());
        config::fits(settings, self.keeper.settings(), tried)?;
        self.keeper.store(settings)?;
        self.held.restart = Some(DRIVE_VIEW.uptime_ms.load(Relaxed));
        Ok(())
    }

    fn record(&mut self, request: u32) {
        self.held.record = Some(request);
    }

    fn inject(&mut self, injection: Injection) -> Result<(), Refusal> {
        match Injected::of_word(injection.fault) {
            Some(_) => Err(Refusal::Real),
            None => Err(Refusal::Injection),
        }
    }
}
