//! A session with the drive that is measured: it is commanded and recorded by its own time.

use crate::Failure;
use anyhow::{Context, Result, bail, ensure};
use link::burst::{BurstRequest, BurstState};
use link::codes::{Fault, Misalignment, State};
use link::host::burst::Burst;
use link::host::dialogue::Dialogue;
use link::host::status::StatusReport;
use link::host::{Decoder, Row};
use link::message::{Aligned, Command, Status};
use link::scale;
use link::settings::Settings;
use link::telemetry::Request;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// How often the drive hears that the host is there, by the time of its telemetry, s, and by the line's clock.
const BEAT_S: f64 = 0.05;
const BEAT: Duration = Duration::from_millis(20);
/// How often its state is looked at, s.
const LOOK_S: f64 = 0.2;
/// How long a drive may take to be ready: it measures zeros and aligns both rotors, ms of its time.
const READY_MS: u32 = 60_000;
/// How often it may try to align its rotors before it is believed.
const ALIGNMENTS: u32 = 3;
/// How long it may take to arrive at a speed, or at rest, s.
const ARRIVE_S: f64 = 20.0;
/// How long a drive that rests is listened to, s.
const NOISE_S: f64 = 0.2;
/// How long a burst's trigger may take, and how often it is asked for, s.
const BURST_S: f64 = 0.5;
const BURST_LOOK_S: f64 = 0.03;
/// Longest without telemetry.
const SILENT: Duration = Duration::from_secs(2);
/// What a reference that has arrived may differ from what was asked: rounding of the words, rad/s.
const ARRIVED_RAD_S: f64 = 1e-2;

/// One motor at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorPoint {
    /// Mechanical angle in the motor's direction, rad, many turns.
    pub angle: f64,
    /// Electrical angle at which the currents were sampled, rad.
    pub electrical: f64,
    /// Currents of phases a and b, A.
    pub phases: [f64; 2],
    /// Currents d and q, A.
    pub current: [f64; 2],
    /// Voltages d and q, V.
    pub voltage: [f64; 2],
    /// Speed reference, mechanical, rad/s.
    pub speed_ref: f64,
    /// Current reference along q, A.
    pub i_q_ref: f64,
}

/// The drive at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Time, s.
    pub time: f64,
    /// Screw, nut.
    pub motors: [MotorPoint; 2],
    /// The table by its scale, m.
    pub table: f64,
}

/// A session.
pub struct Session<D> {
    drive: D,
    settings: Settings,
    decoder: Option<Decoder>,
    /// Electrical angle at count zero, rad, and direction of the encoders.
    aligned: [(f64, f64); 2],
    bus_v: f64,
    pwm_period_s: f64,
    /// The drive's time: since its last start, ms, and what it ran before that, ms.
    uptime_ms: u32,
    earlier_ms: u32,
    /// When the session first saw that time, ms.
    origin_ms: Option<u32>,
    now: f64,
    beaten: (f64, Duration),
    looked: f64,
    heard: Duration,
    repeated: u32,
    noise_a: f64,
    stop: Arc<AtomicBool>,
}

impl<D: Dialogue> Session<D> {
    /// Of a drive that rests; `stop` ends what is under way.
    ///
    /// # Errors
    /// The drive is lost, or has other settings than this program.
    pub async fn open(mut drive: D, stop: Arc<AtomicBool>) -> Result<Self> {
        let settings = drive.settings().await?;
        let pwm_period_s = 1.0 / drive.pwm_hz();
        let clock = drive.now();
        Ok(Self {
            drive,
            settings,
            decoder: None,
            aligned: [(0.0, 1.0); 2],
            bus_v: 0.0,
            pwm_period_s,
            uptime_ms: 0,
            earlier_ms: 0,
            origin_ms: None,
            now: 0.0,
            beaten: (0.0, clock),
            looked: 0.0,
            heard: clock,
            repeated: 0,
            noise_a: 0.0,
            stop,
        })
    }

    /// The line to the drive, for what comes after.
    #[must_use]
    pub fn into_drive(self) -> D {
        self.drive
    }

    /// The settings that hold.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Voltage of the bus when the drive was last ready, V.
    #[must_use]
    pub fn bus_v(&self) -> f64 {
        self.bus_v
    }

    /// Its PWM period, s.
    #[must_use]
    pub fn pwm_period_s(&self) -> f64 {
        self.pwm_period_s
    }

    /// A step of its speed task, s.
    #[must_use]
    pub fn speed_step_s(&self) -> f64 {
        1.0 / self.drive.speed_hz()
    }

    /// Largest standard deviation of a phase's current while it rested, A; 0 before [`Session::noise`].
    #[must_use]
    pub fn noise_a(&self) -> f64 {
        self.noise_a
    }

    /// Mean and standard deviation of the currents of phases a and b of screw and nut while it rests, A.
    ///
    /// # Errors
    /// The drive is lost.
    pub async fn noise(&mut self) -> Result<[[[f64; 2]; 2]; 2]> {
        let mut sums = [[[0.0; 2]; 2]; 2];
        let mut count = 0.0;
        self.hold(NOISE_S, &mut |point| {
            count += 1.0;
            for (sums, motor) in sums.iter_mut().zip(&point.motors) {
                for (sums, amps) in sums.iter_mut().zip(motor.phases) {
                    sums[0] += amps;
                    sums[1] += amps * amps;
                }
            }
        })
        .await?;
        let noise = sums.map(|motor| {
            motor.map(|[sum, squares]| {
                let mean: f64 = sum / count;
                let variance: f64 = squares / count - mean * mean;
                [mean, variance.max(0.0).sqrt()]
            })
        });
        self.noise_a = noise
            .as_flattened()
            .iter()
            .fold(0.0, |most, [_, noise]| f64::max(most, *noise));
        Ok(noise)
    }

    /// The drive's time over its restarts, since the session first saw it, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        let [earlier, now, origin] = [
            self.earlier_ms,
            self.uptime_ms,
            self.origin_ms.unwrap_or(self.uptime_ms),
        ]
        .map(f64::from);
        (earlier + now - origin) * 1e-3
    }

    fn see_time(&mut self, uptime_ms: u32) {
        self.origin_ms.get_or_insert(uptime_ms);
        if uptime_ms < self.uptime_ms {
            // It has started again.
            self.earlier_ms = self.earlier_ms.saturating_add(self.uptime_ms);
        }
        self.uptime_ms = uptime_ms;
    }

    /// How many alignments were tried again.
    #[must_use]
    pub fn repeated_alignments(&self) -> u32 {
        self.repeated
    }

    async fn state(&mut self) -> Result<Option<State>> {
        let status = self.drive.status().await?;
        Ok(State::of_words(status.state, status.fault))
    }

    /// Makes settings hold: the drive restarts, and is ready again.
    ///
    /// # Errors
    /// It does not take them, or is not ready with them.
    pub async fn configure(&mut self, settings: &Settings) -> Result<()> {
        self.rest().await?;
        self.decoder = None;
        self.drive.configure(settings).await?;
        self.settings = *settings;
        self.ready().await
    }

    /// Waits until the drive is ready, and begins to record it.
    ///
    /// # Errors
    /// A fault, which says what the drive found.
    pub async fn ready(&mut self) -> Result<()> {
        let begun = self.drive.status().await?.uptime_ms;
        self.see_time(begun);
        let (mut tries, mut first) = (ALIGNMENTS, None);
        let status = loop {
            let status = self.drive.status().await?;
            self.see_time(status.uptime_ms);
            match State::of_words(status.state, status.fault) {
                Some(State::Ready) => break status,
                Some(State::Unaligned) => {
                    let stop = Arc::clone(&self.stop);
                    self.drive.arm(|_| !stop.load(Relaxed)).await?;
                }
                // The same twice is no chance.
                Some(State::Fault(fault)) if fault.is_misalignment() && tries > 1 => {
                    tries -= 1;
                    self.repeated += 1;
                    first.get_or_insert_with(|| stopped(fault, &status));
                    self.drive.tell(Command::Reset).await?;
                    while matches!(self.state().await?, Some(State::Fault(_))) {
                        self.drive.listen(BEAT).await?;
                    }
                }
                // What it found first is what it found before anything had moved.
                Some(State::Fault(fault)) => {
                    bail!(first.unwrap_or_else(|| stopped(fault, &status)))
                }
                _ if status.uptime_ms.wrapping_sub(begun) > READY_MS => bail!(Failure {
                    measured: format!("the drive is still not ready after {} s", READY_MS / 1000),
                    expected: "zeros and both rotors found by then".to_owned(),
                    check: "the settings of group `alignment`".to_owned(),
                }),
                _ => self.drive.listen(BEAT).await?,
            }
            ensure!(!self.stop.load(Relaxed), "it was stopped");
        };
        for (aligned, motor) in self.aligned.iter_mut().zip(&status.motors) {
            *aligned = encoder_angle(motor.alignment)
                .context("the drive is ready and does not know where its rotors stand")?;
        }
        self.bus_v = StatusReport::of(status).bus_v();
        let request = Request {
            divider: 1,
            stream: self.drive.next_stream(),
        };
        self.decoder = Some(Decoder::new(request));
        (self.now, self.looked, self.heard) = (0.0, 0.0, self.drive.now());
        self.drive.tell(Command::Record(request.word())).await
    }

    /// Lets the drive be moved.
    ///
    /// # Errors
    /// It refuses.
    pub async fn arm(&mut self) -> Result<()> {
        self.drive.tell(Command::Arm).await
    }

    /// Follow a table velocity, m/s, and a base speed, mechanical rad/s, and record until they are reached.
    ///
    /// # Errors
    /// The drive refuses, has a fault, or does not get there.
    pub async fn go(
        &mut self,
        velocity: f64,
        base: f64,
        each: &mut dyn FnMut(&Point),
    ) -> Result<()> {
        let word = |value, bits| {
            scale::word(value, bits)
                .ok_or_else(|| anyhow::anyhow!("a speed of {value} cannot be said"))
        };
        let command = Command::Run {
            velocity: word(velocity, scale::TABLE_VELOCITY)?,
            base: Some(word(base, scale::BASE_SPEED)?),
        };
        self.pass(&mut *each)?;
        self.drive.tell(command).await?;
        let relative = velocity / (self.settings.feed.lead_mm * 1e-3) * TAU;
        let targets = [base + relative, base];
        let until = self.now + ARRIVE_S;
        let mut arrived = 0;
        // For some rows: the command may come a step later.
        while arrived < 10 {
            self.listen(&mut |point| {
                let there = point.motors.iter().zip(targets).all(|(motor, target)| {
                    (motor.speed_ref - target).abs() < ARRIVED_RAD_S + 1e-4 * target.abs()
                });
                arrived = if there { arrived + 1 } else { 0 };
                each(point);
            })
            .await?;
            if self.now > until {
                bail!(Failure {
                    measured: format!(
                        "the drive is not at the speeds that were asked after {ARRIVE_S} s"
                    ),
                    expected: "its references at these speeds".to_owned(),
                    check:
                        "load, torque limits and bus voltage: a motor at its limit is given way to"
                            .to_owned(),
                });
            }
        }
        Ok(())
    }

    /// Goes on for so long, s.
    ///
    /// # Errors
    /// A fault, or the drive is lost.
    pub async fn hold(&mut self, seconds: f64, each: &mut dyn FnMut(&Point)) -> Result<()> {
        let until = self.now + seconds;
        while self.now < until {
            self.listen(each).await?;
        }
        Ok(())
    }

    /// Currents along d of screw and nut, A.
    ///
    /// # Errors
    /// The drive refuses.
    pub async fn direct(&mut self, amps: [f64; 2]) -> Result<()> {
        for (motor, amps) in (0u8..).zip(amps) {
            let Some(current) = scale::word(amps, scale::CURRENT) else {
                bail!("a current of {amps} A cannot be said");
            };
            self.drive
                .tell(Command::DirectCurrent { motor, current })
                .await?;
        }
        Ok(())
    }

    /// Puts the angles of screw and nut right, which are behind their rotors by so many electrical degrees. The drive rests.
    ///
    /// # Errors
    /// The drive refuses.
    pub async fn correct(&mut self, behind_deg: [f64; 2]) -> Result<()> {
        for (k, degrees) in behind_deg.into_iter().enumerate() {
            let Some(behind) = scale::word(degrees / 180.0, 31) else {
                bail!("an angle that is {degrees} degrees behind cannot be said");
            };
            let motor = if k == 0 { 0 } else { 1 };
            self.drive.tell(Command::Angle { motor, behind }).await?;
            self.aligned[k].0 += degrees.to_radians();
        }
        Ok(())
    }

    /// Electrical angle of an encoder's count zero, degrees within half a turn, and whether it counts backwards.
    #[must_use]
    pub fn encoder_zero(&self, motor: usize) -> (f64, bool) {
        let (zero, direction) = self.aligned[motor];
        (zero.sin().atan2(zero.cos()).to_degrees(), direction < 0.0)
    }

    /// Electrical angle of an encoder's count zero, rad, and 1 or -1: it counts with the rotor or against it.
    #[must_use]
    pub fn encoder_angle(&self, motor: usize) -> (f64, f64) {
        self.aligned[motor]
    }

    /// Arms a burst.
    ///
    /// # Errors
    /// The drive has no room for it.
    pub async fn arm_burst(&mut self, request: BurstRequest) -> Result<()> {
        self.drive.tell(Command::Burst(request)).await
    }

    /// Reads the burst that was armed; `None` if its trigger has not come after half a second.
    ///
    /// # Errors
    /// As [`Session::hold`].
    pub async fn take_burst(&mut self) -> Result<Option<Burst>> {
        let until = self.now + BURST_S;
        loop {
            self.hold(BURST_LOOK_S, &mut |_| ()).await?;
            if self.drive.burst().await?.state == BurstState::Complete.word() {
                return Ok(Some(self.drive.read_burst(&self.settings).await?));
            }
            if self.now > until {
                self.drive.tell(Command::EndBurst).await?;
                return Ok(None);
            }
        }
    }

    /// Comes to rest, whatever it does.
    ///
    /// # Errors
    /// It does not, or has a fault.
    pub async fn rest(&mut self) -> Result<()> {
        self.drive.tell(Command::Stop).await?;
        let begun = self.drive.status().await?.uptime_ms;
        loop {
            let status = self.drive.status().await?;
            self.see_time(status.uptime_ms);
            match State::of_words(status.state, status.fault) {
                Some(State::Running | State::Holding | State::Stopping)
                    if f64::from(status.uptime_ms.wrapping_sub(begun)) < ARRIVE_S * 1e3 =>
                {
                    self.drive.listen(BEAT).await?;
                }
                Some(State::Running | State::Holding | State::Stopping) => {
                    bail!("the drive does not come to rest: open its enable contact")
                }
                Some(State::Fault(fault)) => bail!(stopped(fault, &status)),
                _ => return Ok(()),
            }
        }
    }

    async fn listen(&mut self, each: &mut dyn FnMut(&Point)) -> Result<()> {
        ensure!(!self.stop.load(Relaxed), "it was stopped");
        let clock = self.drive.now();
        if self.now - self.beaten.0 >= BEAT_S || clock.saturating_sub(self.beaten.1) >= BEAT {
            self.beaten = (self.now, clock);
            self.drive.beat()?;
        }
        if self.now - self.looked >= LOOK_S {
            self.looked = self.now;
            let status = self.drive.status().await?;
            self.see_time(status.uptime_ms);
            if let Some(State::Fault(fault)) = State::of_words(status.state, status.fault) {
                bail!(stopped(fault, &status));
            }
        }
        self.drive.listen(Duration::from_millis(2)).await?;
        self.pass(each)
    }

    /// Passes on the rows that have come.
    fn pass(&mut self, each: &mut dyn FnMut(&Point)) -> Result<()> {
        let before = self.now;
        while let (Some(frame), Some(decoder)) = (self.drive.take_telemetry(), &mut self.decoder) {
            if let Some(row) = decoder.frame(frame) {
                self.now = row.time_s;
                each(&point(&row, &self.settings, self.aligned));
            }
        }
        if self.now > before {
            self.heard = self.drive.now();
        } else if self.drive.now().saturating_sub(self.heard) > SILENT {
            bail!("the drive sends no telemetry any more");
        }
        Ok(())
    }
}

/// Electrical angle of an encoder's count zero, rad, and 1 or -1: it counts with the rotor or against it.
#[must_use]
pub fn encoder_angle(aligned: Aligned) -> Option<(f64, f64)> {
    let angle = |zero: u32| f64::from(zero) / 2f64.powi(32) * TAU;
    match aligned {
        Aligned::Forwards { zero } => Some((angle(zero), 1.0)),
        Aligned::Backwards { zero } => Some((angle(zero), -1.0)),
        Aligned::Unknown => None,
    }
}

/// A row in the rotors' frames.
fn point(row: &Row, settings: &Settings, aligned: [(f64, f64); 2]) -> Point {
    let mut motors = [MotorPoint::default(); 2];
    let plates = [&settings.screw, &settings.nut];
    for (k, motor) in motors.iter_mut().enumerate() {
        let (row, (zero, direction)) = (&row.motors[k], aligned[k]);
        let pole_pairs = f64::from(plates[k].pole_pairs);
        let angle = direction * row.angle_rad;
        // The currents are newer than the angle.
        let aged = pole_pairs * row.speed_ref_rad_s * plates[k].encoder.age_us * 1e-6;
        let electrical = pole_pairs * angle + zero + aged;
        let (sin, cos) = electrical.sin_cos();
        let [a, b] = row.phases_a;
        // Power invariant: a vector is sqrt(3/2) times as long as the amplitude of a phase.
        let alpha = 1.5f64.sqrt() * a;
        let beta = (a + 2.0 * b) / 2f64.sqrt();
        *motor = MotorPoint {
            angle,
            electrical,
            phases: row.phases_a,
            current: [cos * alpha + sin * beta, cos * beta - sin * alpha],
            voltage: row.voltage_v,
            speed_ref: row.speed_ref_rad_s,
            i_q_ref: row.i_q_ref_a,
        };
    }
    Point {
        time: row.time_s,
        motors,
        table: row.table_m,
    }
}

/// What a fault says of what is measured.
fn stopped(fault: Fault, status: &Status) -> Failure {
    match Misalignment::of_word(status.misalignment) {
        Some(reason) if fault.is_misalignment() => Failure {
            measured: format!("{}: {}", fault.name(), reason.name()),
            expected: "both rotors found".to_owned(),
            check: reason.sentence().to_owned(),
        },
        _ => Failure {
            measured: format!("a fault stopped the drive: {}", fault.name()),
            expected: "no fault".to_owned(),
            check: fault.sentence().to_owned(),
        },
    }
}
