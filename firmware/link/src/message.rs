//! What host and drive say to each other in [`frame`](crate::frame)s.
//!
//! A host opens a session with [`Command::Hello`]; the drive answers with the session's number, which is in each frame that
//! follows. Sequence numbers rise with each frame, so that one that comes again does nothing. What moves the machine takes
//! an armed drive and a [`Command::Heartbeat`] within the drive's `command.heartbeat_ms`.

use crate::burst::{BurstRequest, BurstSample, BurstStatus, SAMPLES_A_FRAME};
use crate::frame::FrameCount;
use crate::settings::WireValue;
use crate::telemetry::{Frame, Real};
use control::codes;
use control::journal;
use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

/// How long a drive stays armed while it does not move, ms.
pub const ARMED_MS: u32 = 600_000;

/// A frame from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostFrame {
    /// The session's number; 0 before there is one.
    pub session: u32,
    /// Rises from frame to frame.
    pub sequence: u32,
    /// What is asked.
    pub command: Command,
}

/// What a host asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command {
    /// Opens a session: answered by [`Reply::Hello`].
    Hello,
    /// The host is still there: answered by [`Reply::Done`].
    Heartbeat,
    /// What the drive is doing: answered by [`Reply::Status`].
    Status,
    /// The last faults: answered by [`Reply::Faults`].
    Faults,
    /// Its journal, which outlives a reset: answered by [`Reply::Events`], the latest first.
    Journal {
        /// So many of the latest are left out.
        after: u8,
    },
    /// Lets the drive be moved, until it stops, has a fault, or is not moved for [`ARMED_MS`]. A drive in
    /// [`State::Unaligned`](crate::codes::State::Unaligned) begins to align: both motors move, and the session must send heartbeats.
    Arm,
    /// Follow these speeds.
    Run {
        /// Table velocity, 2^-28 m/s.
        velocity: i32,
        /// Base speed, mechanical, 2^-18 rad/s; `None`: what the drive's table has for that velocity.
        base: Option<i32>,
    },
    /// Move the table by a distance and hold it there.
    Move {
        /// How far, nm.
        distance_nm: i64,
        /// Fastest on the way, 2^-28 m/s, above 0.
        velocity: i32,
        /// Base speed, mechanical, 2^-18 rad/s; `None`: what the drive's table has for that velocity.
        base: Option<i32>,
    },
    /// Move the table to a homed position and hold it there.
    MoveTo {
        /// Where, nm.
        position_nm: i64,
        /// Fastest on the way, 2^-28 m/s, above 0.
        velocity: i32,
        /// Base speed, mechanical, 2^-18 rad/s; `None`: what the drive's table has for that velocity.
        base: Option<i32>,
    },
    /// One motor follows a torque, and its table the motor; the other holds a speed. A soft limit ahead ends it: the table is held there.
    Torque {
        /// 0 is the screw, 1 the nut.
        motor: u8,
        /// The torque as a current along q, 2^-20 A: at most that of the largest torque.
        current: i32,
        /// Fastest that the motor turns by it, mechanical, 2^-18 rad/s, above 0.
        speed: i32,
        /// Speed of the other motor, mechanical, 2^-18 rad/s.
        base: i32,
    },
    /// A current along d for a motor of a drive that runs, until the next one or until it comes to rest. It makes no torque.
    DirectCurrent {
        /// 0 is the screw, 1 the nut.
        motor: u8,
        /// The current, 2^-20 A: at most that of the largest torque.
        current: i32,
    },
    /// The angle of a motor of a drive that rests was found to be behind its rotor: it is put right until the drive aligns
    /// again.
    Angle {
        /// 0 is the screw, 1 the nut.
        motor: u8,
        /// By how much, electrical, 2^-32 turn: a twelfth of a turn at most.
        behind: i32,
    },
    /// Come to rest, switch the bridges off, and be armed no longer.
    Stop,
    /// Leave a fault whose cause is gone.
    Reset,
    /// Start or end the telemetry: a [`Request`](crate::telemetry::Request)'s word.
    Record(u32),
    /// The settings from this number on: answered by [`Reply::Settings`], as many as go into a frame.
    Settings {
        /// The first number.
        from: u16,
    },
    /// The same with the orders that a drive that compensates has learned.
    Learned {
        /// The first number.
        from: u16,
    },
    /// Sets one in the session's draft, which begins as what holds.
    Draft {
        /// The setting's number.
        id: u16,
        /// Its value.
        value: WireValue,
    },
    /// Forgets the draft.
    Discard,
    /// Makes the draft hold, all of it or nothing: see [`Effect`](crate::settings::Effect). A draft that takes effect after a restart is
    /// stored, and the drive restarts, which ends all sessions. Another is not stored.
    Commit,
    /// Puts a fault into a simulated drive.
    Inject(Injection),
    /// Moves the table to its end switch and off it again, which gives its scale the zero: see the settings `travel`.
    Home {
        /// Base speed, mechanical, 2^-18 rad/s; `None`: what the drive's table has for the homing velocity.
        base: Option<i32>,
    },
    /// Writes the settings that hold to the flash. The drive must rest.
    Store,
    /// Keeps every PWM period of a motor around a trigger, until the burst is complete. It moves nothing, takes no armed drive, and
    /// outlives its session.
    Burst(BurstRequest),
    /// Forgets the burst that waits or is kept.
    EndBurst,
    /// How the burst is going: answered by [`Reply::Burst`].
    BurstStatus,
    /// The samples of a complete burst from this one on: answered by [`Reply::BurstSamples`], as many as go into a frame.
    BurstSamples {
        /// The first, of [`SAMPLES`](crate::burst::SAMPLES).
        from: u16,
    },
    /// Follow positions that stream in as [`Command::SetPoint`]. The first begins it; where one is missing at its turn, the drive comes
    /// to rest.
    Stream {
        /// How long a set-point waits for its turn, ms: 5 to 200. It hides how late set-points come, up to so much.
        delay_ms: u16,
        /// Positions are homed ones; else they count from where the table stands.
        homed: bool,
        /// Base speed, mechanical, 2^-18 rad/s.
        base: i32,
    },
    /// A set-point of the stream: answered by [`Reply::Followed`], and as good as a heartbeat.
    SetPoint {
        /// Time in the stream, us, which wraps: 1 to 50 ms behind the last one's.
        at_us: u32,
        /// Position, nm.
        position_nm: i64,
        /// Velocity there, 2^-28 m/s; `None`: that of its neighbours.
        velocity: Option<i32>,
    },
}

/// What is done to a simulated drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Injection {
    /// An [`Injected`].
    pub fault: u32,
    /// 0 is the screw, 1 the nut; of no meaning where a fault is no motor's.
    pub motor: u8,
    /// How much, in the fault's unit.
    pub amount: Real,
}

codes! {
    /// A fault of a simulated drive, with the unit of its amount.
    Injected {
        Clear = 0, "clear", "All that was put in is taken out.";
        EncoderFrozen = 1, "encoder-frozen", "The motor's encoder keeps its count.";
        EncoderSlip = 2, "encoder-slip", "The motor's encoder slips on its shaft by so many electrical degrees.";
        DriverFault = 3, "driver-fault", "The gate driver of the motor's bridge stops it.";
        OpenPhase = 4, "open-phase", "The lead of the motor's phase a (1), b (2) or c (3) is off.";
        Bus = 5, "bus", "The supply holds so many volts.";
        Load = 6, "load", "So many newtons push against positive travel.";
        EnableOpen = 7, "enable-open", "The enable contact is open.";
        EndForward = 8, "end-forward", "The end switch ahead of positive velocity is open.";
        EndBackward = 9, "end-backward", "The end switch ahead of negative velocity is open.";
        CurrentOffset = 10, "current-offset", "The motor's current channel a reads so many amperes too much.";
    }
}

impl Injected {
    /// Whether it is one motor's.
    #[must_use]
    pub const fn has_motor(self) -> bool {
        matches!(
            self,
            Self::EncoderFrozen
                | Self::EncoderSlip
                | Self::DriverFault
                | Self::OpenPhase
                | Self::CurrentOffset
        )
    }

    /// The unit of its amount; `None` where it has none.
    #[must_use]
    pub const fn unit(self) -> Option<&'static str> {
        match self {
            Self::EncoderSlip => Some("electrical degrees"),
            Self::OpenPhase => Some("phase"),
            Self::Bus => Some("V"),
            Self::Load => Some("N"),
            Self::CurrentOffset => Some("A"),
            _ => None,
        }
    }

    /// The smallest and the largest amount, in its unit; `None` where it has none.
    #[must_use]
    pub const fn range(self) -> Option<[f64; 2]> {
        match self {
            Self::EncoderSlip => Some([-360.0, 360.0]),
            Self::OpenPhase => Some([1.0, 3.0]),
            Self::Bus => Some([0.0, 1000.0]),
            Self::Load => Some([-1e5, 1e5]),
            Self::CurrentOffset => Some([-100.0, 100.0]),
            _ => None,
        }
    }
}

codes! {
    /// Why a command is refused.
    Refusal {
        Session = 1, "no session", "The session is over: the drive has started anew, or another host has spoken to it on this line.";
        NotArmed = 2, "not armed", "The drive is not armed: `arm` lets it be moved.";
        Fault = 3, "fault", "A fault has stopped the drive: `faults` says which, and `reset` leaves it once its cause is gone.";
        NotReady = 4, "not ready", "The drive is starting: try again when `status` says ready.";
        Commanded = 5, "commanded", "Another session moves the drive: wait until it has ended, or `stop` it.";
        Velocity = 6, "velocity", "The feed may not move that fast: see the setting feed.velocity_max_mm_s.";
        MotorSpeed = 7, "motor speed", "A motor may not turn that fast: see the settings screw.speed_max_rpm and nut.speed_max_rpm.";
        Moving = 8, "moving", "The drive is moving: `stop` it first.";
        Distance = 9, "distance", "The drive cannot move by this distance in one move: give at least one count of the scale (setting feed.scale_count_nm), at most 2^31 counts, and a speed above 0.";
        Setting = 10, "setting", "There is no such setting, or it may not have that value.";
        Real = 11, "not simulated", "The drive is no simulated one, and gets its faults from the world.";
        Injection = 12, "injection", "There is no such fault to put in, or it cannot have that amount: `drive inject list` prints all with their ranges.";
        AtRest = 13, "at rest", "Only a drive that runs takes this: move it first.";
        Current = 14, "current", "There is no such motor, or the current or torque is more than that of its largest torque: see the settings screw.torque_max_nm and nut.torque_max_nm.";
        Angle = 15, "angle", "There is no such motor, its angle is not known, or it is further off than an alignment can be: 30 electrical degrees.";
        NotStored = 16, "not stored", "The settings fit, but no page of the flash could be written and read back: it is worn out, locked, or not in two banks (option byte DBANK). What held before still holds.";
        SoftLimit = 17, "soft limit", "The table would end beyond a soft limit: see the settings travel.soft_least_mm and travel.soft_most_mm.";
        Unaligned = 19, "unaligned", "The rotor angles are not known: `arm` aligns the motors first.";
        Burst = 20, "burst", "There is no such burst: the motor is 0 (screw) or 1 (nut), the trigger and the signal are those of this link, the level is within the signal's range, the divider is 1 to 255, and fewer samples come before the trigger than a burst has.";
        BurstWaits = 21, "burst waits", "Another burst waits for its trigger: read it once it is complete (`drive burst --read`), or end it (`drive burst --end`).";
        NoBurst = 22, "no burst", "There is no complete burst: arm one (`drive burst`), and wait until its trigger has come and its last sample is kept.";
        NotHomed = 23, "not homed", "The table's position is not known: `home` finds it first.";
        NoStream = 24, "no stream", "No stream is open: a set-point that was missing at its turn, or a stop, has ended it. Begin another.";
        StreamFull = 25, "stream full", "The drive keeps 64 set-points: send each as its time comes.";
        Spacing = 26, "spacing", "The times of two set-points must be 1 to 50 ms apart.";
        Step = 27, "step", "The set-point is further from the last one than the table goes meanwhile (setting feed.velocity_max_mm_s), or the first one is more than 0.1 mm from the table.";
        Delay = 28, "delay", "A set-point of a stream may wait for 5 to 200 ms.";
        Interface = 18, "encoder interface", "This board's pins read another kind of encoder: leave the settings screw.encoder_interface and nut.encoder_interface as they are.";
    }
}

codes! {
    /// How a move, a homing or a stream is going.
    Travel {
        None = 0, "none", "Nothing was asked to move by a distance, or to be homed.";
        Moving = 1, "moving", "The table is on its way.";
        Settling = 2, "settling", "The table is led to its place by its scale.";
        Done = 3, "done", "The table is in its place and held there.";
        NotSettled = 4, "not settled", "The table did not come to its place in time.";
        Ended = 5, "ended", "A stop or a fault ended the move on its way.";
        Homing = 6, "homing", "The table is on its way to its end switch, or off it.";
        Homed = 7, "homed", "The end switch has given the scale its zero.";
        SwitchNotFound = 8, "switch not found", "The end switch did not open on the way that homing may take: see the settings travel.home_direction and travel.home_furthest_mm, and look whether the switch is closed by a short.";
        SwitchNotLeft = 9, "switch not left", "The end switch did not close again as the table left it: look for a broken wire, or another switch that is open.";
        Awaiting = 11, "awaiting", "The first set-point of the stream is awaited.";
        Following = 12, "following", "The table follows the stream's set-points.";
        StreamEnded = 13, "stream ended", "No set-point came in time: the table came to rest.";
        ScaleStands = 10, "scale stands", "The table's scale counted less than half of the way off the switch: check it and its cable, and the setting feed.scale_count_nm.";
    }
}

/// A frame from the drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum DriveFrame {
    /// The answer to the frame of that sequence number.
    Reply(u32, Reply),
    /// The drive's state has changed.
    Event(Event),
    /// Telemetry.
    Telemetry(Frame),
}

/// A change of state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Time since the drive's start, ms.
    pub uptime_ms: u32,
    /// The [`State`](crate::codes::State)'s word.
    pub state: u32,
    /// The [`Fault`](crate::codes::Fault)'s word; 0 is none.
    pub fault: u32,
}

/// An event of the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Recorded {
    /// Counts up from event to event, also over a reset.
    pub number: u32,
    /// Since the start of that run, ms.
    pub uptime_ms: u32,
    /// An [`EventKind`](crate::codes::EventKind)'s word.
    pub kind: u32,
    /// What its kind says.
    pub code: u32,
    /// A fault's value and its limit, in the fault's unit.
    pub values: [i32; 2],
}

impl From<journal::Event> for Recorded {
    fn from(event: journal::Event) -> Self {
        let journal::Event {
            number,
            uptime_ms,
            kind,
            code,
            values,
        } = event;
        Self {
            number,
            uptime_ms,
            kind,
            code,
            values,
        }
    }
}

/// Text of a fixed length.
pub type Text = String<48>;
/// Settings that go into a frame.
pub const SETTINGS_A_FRAME: usize = 12;
/// Events of the journal that go into a frame.
pub const EVENTS_A_FRAME: usize = 6;
/// Faults that the drive remembers.
pub const FAULTS: usize = 8;

/// An answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reply {
    /// It is done, or has begun.
    Done,
    /// It is not done: a [`Refusal`]'s word.
    Refused(u32),
    /// A session.
    Hello {
        /// Its number.
        session: u32,
        /// The drive is a simulated one.
        simulated: bool,
        /// PWM periods a second.
        pwm_hz: u32,
        /// PWM periods a step of the speed task.
        speed_divider: u32,
    },
    /// What the drive is doing.
    Status(Status),
    /// The last faults, the latest first.
    Faults(Vec<Event, FAULTS>),
    /// Events of the journal, the latest first; none if there are no more.
    Events(Vec<Recorded, EVENTS_A_FRAME>),
    /// Settings in the order of their numbers; none if there are none from there on.
    Settings(Vec<(u16, WireValue), SETTINGS_A_FRAME>),
    /// How the burst is going.
    Burst(BurstStatus),
    /// Samples of the burst in the order of time; none if there are none from there on.
    BurstSamples(Vec<BurstSample, SAMPLES_A_FRAME>),
    /// A set-point was taken.
    Followed {
        /// How long before its turn it has come, us.
        ahead_us: i32,
        /// What the table was behind the stream's position in the last millisecond, nm.
        error_nm: i32,
    },
    /// The draft does not fit the drive's formats.
    Unfit {
        /// The setting without whose change it would fit; 0: none by itself.
        id: u16,
        /// Its value.
        value: Option<WireValue>,
        /// What of the configuration does not fit.
        name: Text,
        /// Its unit.
        unit: Text,
        /// Its value.
        is: Real,
        /// What it must exceed.
        least: Real,
        /// What it must stay below.
        below: Real,
    },
}

/// How an encoder lies to its rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Aligned {
    /// That is not known.
    #[default]
    Unknown,
    /// It counts up while the motor turns electrically forwards.
    Forwards {
        /// Electrical angle at count zero, 2^-32 turn.
        zero: u32,
    },
    /// It counts down.
    Backwards {
        /// The same.
        zero: u32,
    },
}

impl Aligned {
    /// The rotor's mechanical angle, rad, 0 where it is electrically 0, of its encoder's; the encoder's own where it is not
    /// known how that lies.
    #[must_use]
    pub fn rotor_angle(self, encoder_rad: f64, pole_pairs: u32) -> f64 {
        let (direction, zero) = match self {
            Self::Unknown => return encoder_rad,
            Self::Forwards { zero } => (1.0, zero),
            Self::Backwards { zero } => (-1.0, zero),
        };
        // The drive's compensation takes it within half an electrical turn, too.
        let zero_e = f64::from(zero.cast_signed()) / 4_294_967_296.0 * core::f64::consts::TAU;
        direction * encoder_rad + zero_e / f64::from(pole_pairs.max(1))
    }
}

/// One motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotorStatus {
    /// Currents d and q, 2^-20 A.
    pub current: [i32; 2],
    /// Speed, mechanical, 2^-18 rad/s.
    pub speed: i32,
    /// The encoder's count within the turn.
    pub encoder: u32,
    /// How the encoder lies to the rotor.
    pub alignment: Aligned,
    /// Bus voltage at its bridge, mV.
    pub bus_mv: u32,
}

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Time since the drive's start, ms.
    pub uptime_ms: u32,
    /// The [`State`](crate::codes::State)'s word.
    pub state: u32,
    /// The [`Fault`](crate::codes::Fault)'s word; 0 is none.
    pub fault: u32,
    /// Why the last alignment failed: a [`Misalignment`](crate::codes::Misalignment)'s word; 0 is none.
    pub misalignment: u32,
    /// All that was found since the drive last left a fault: a [`FaultSet`](crate::codes::FaultSet).
    pub latched: [u32; 2],
    /// What limits it: [`ActiveLimits`](crate::codes::ActiveLimits).
    pub limits: u32,
    /// What was found of the tables of compensation that were saved: a [`TableFits`](control::compensation::fit::TableFits)' word.
    pub tables: u32,
    /// The drive may be moved.
    pub armed: bool,
    /// A [`Travel`]'s word.
    pub travel: u32,
    /// Screw, nut.
    pub motors: [MotorStatus; 2],
    /// The table's scale, counts.
    pub scale: i32,
    /// Its count at position zero; `None`: the drive is not homed, and soft limits do not act.
    pub origin: Option<i32>,
    /// Which settings it runs on: an [`Origin`](crate::codes::Origin)'s word.
    pub runs_on: u32,
    /// Number of the stored setting that does not fit; 0: none, or none by itself.
    pub unfit: u16,
    /// Telemetry samples that found no room.
    pub dropped: u32,
    /// Frames from this host.
    pub frames: FrameCount,
    /// Frames of this line that came again or late, and did nothing.
    pub repeated: u32,
    /// Commands that were refused.
    pub refused: u32,
}
