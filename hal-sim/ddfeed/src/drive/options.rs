//! What a person may ask of a drive. Quantities have the flags that they have in `simulate` and `record`.

use crate::hold::Hold;
use crate::session::FULL_RATE;
use anyhow::{Context, Result, anyhow, ensure};
use clap::{Args, Subcommand, ValueEnum};
use link::burst::BurstRequest;
use link::host::burst::Wanted;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the drive is, and what it is asked.
#[derive(Args, Debug)]
pub struct DriveOptions {
    /// Where the drive is.
    #[command(flatten)]
    pub line: LineOptions,
    /// Bits a second of the serial port. [default: 4000000, the firmware's]
    #[arg(long, requires = "serial")]
    pub baud: Option<u32>,
    /// What it is asked.
    #[command(subcommand)]
    pub task: Task,
}

/// A recording by itself.
#[derive(Args, Debug)]
pub struct RecordCommand {
    /// The drive.
    #[command(flatten)]
    pub line: LineOptions,
    /// Bits a second of the serial port. [default: 4000000, the firmware's]
    #[arg(long, requires = "serial")]
    pub baud: Option<u32>,
    /// The recording.
    #[command(flatten)]
    pub record: RecordOptions,
}

impl From<RecordCommand> for DriveOptions {
    fn from(command: RecordCommand) -> Self {
        Self {
            line: command.line,
            baud: command.baud,
            task: Task::Record(command.record),
        }
    }
}

/// Where the drive is.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
pub struct LineOptions {
    /// A drive that `ddfeed serve` simulates, at this address: 127.0.0.1:7474.
    #[arg(long, value_name = "ADDRESS")]
    pub sim: Option<String>,
    /// A drive at this serial port: /dev/ttyACM0.
    #[arg(long, value_name = "PORT")]
    pub serial: Option<String>,
    /// A drive at a debug probe: the only one, or the one with this in its line.
    #[arg(long, value_name = "SELECTOR", num_args = 0..=1, require_equals = true)]
    pub probe: Option<Option<String>>,
}

/// What it is asked.
#[derive(Subcommand, Debug)]
pub enum Task {
    /// Its state, faults and limits: of the drive, both motors and the table.
    Status {
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// The fault that has stopped it, and the last ones.
    Faults {
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// Let it be moved, until it stops, has a fault, or has not been moved for ten minutes. A drive that does not know its rotor angles
    /// is aligned first: both motors move.
    Arm,
    /// Run at a table velocity and a nut speed until Ctrl-C, which brings it to rest.
    Jog(JogOptions),
    /// Move the table by a distance or to a homed position, within acceleration and jerk, and bring it to rest. Ctrl-C ends it on its
    /// way.
    Move(MoveOptions),
    /// Turn one motor while the other rests, until Ctrl-C; or the screw by an angle. Turning either moves the table.
    Turn(TurnOptions),
    /// The table follows positions of a file or of the standard input, and comes to rest at their end. Ctrl-C ends it on its way.
    Follow(FollowOptions),
    /// One motor follows a torque until Ctrl-C, which brings it to rest; the other holds a speed.
    Torque(TorqueOptions),
    /// Find the table's place: to its end switch and off it again, as the settings `travel` say, and come to rest. Soft limits act
    /// from then on. Ctrl-C ends it on its way.
    Home(HomeOptions),
    /// Come to rest, switch the bridges off, and be armed no longer.
    Stop,
    /// Leave a fault whose cause is gone.
    Reset,
    /// Put a fault into a simulated drive.
    Inject(InjectOptions),
    /// What it is set to.
    Settings {
        #[command(subcommand)]
        /// Which settings, and what with them.
        what: SettingsTask,
    },
    /// Record it into a folder that `ddfeed identify` reads.
    Record(RecordOptions),
    /// Keep every PWM period of a motor around a trigger, and write it as CSV. The drive need not be armed, and nothing moves.
    Burst(BurstOptions),
    /// Measure its motors and feed, set what was found, and tune its loops: both motors turn, and the table moves to and fro.
    Commission(CommissionOptions),
    /// Propose gains for a bandwidth and a phase margin, computed from the settings that hold; nothing turns. `commission` does the
    /// same at its end.
    Tune(TuneOptions),
}

/// What is wanted of the loops.
#[derive(Args, Debug)]
pub struct LoopOptions {
    /// Cutoff of the speed loops, rad/s: `commission` takes a lower one where this has not the margin, `tune` refuses it. [default:
    /// at most the setting tuning.speed_rad_s]
    #[arg(long, value_name = "RAD_S")]
    pub speed_loop: Option<f64>,
    /// Smallest phase margin of all loops, degrees.
    #[arg(long, value_name = "DEG", default_value_t = 45.0)]
    pub margin: f64,
}

impl LoopOptions {
    pub(super) fn check(&self) -> Result<()> {
        ensure!(
            (20.0..=80.0).contains(&self.margin),
            "--margin is {} degrees, but 20 to 80 are possible",
            self.margin
        );
        let speed_loop = self.speed_loop.unwrap_or(1.0);
        ensure!(
            (1.0..=10_000.0).contains(&speed_loop),
            "--speed-loop is {speed_loop} rad/s, but 1 to 10000 rad/s are possible"
        );
        Ok(())
    }
}

/// A tuning.
#[derive(Args, Debug)]
pub struct TuneOptions {
    #[command(flatten)]
    pub loops: LoopOptions,
    /// Make it hold: the drive, which must be at rest, restarts with it. Without this it is proposed only.
    #[arg(long)]
    pub set: bool,
    #[command(flatten)]
    pub restart: Restart,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// A commissioning.
#[derive(Args, Debug)]
pub struct CommissionOptions {
    /// Folder for report.md, report.json and model.toml; an interrupted commissioning goes on from there.
    #[arg(long, default_value = "out/commission")]
    pub out: PathBuf,
    /// Furthest that the table may move to each side, mm: put it where it has that way.
    #[arg(long, value_name = "MM", default_value_t = 10.0)]
    pub travel: f64,
    #[command(flatten)]
    pub loops: LoopOptions,
    /// Measure again what is in the folder already.
    #[arg(long)]
    pub again: bool,
    /// Let it be moved: without this nothing is done.
    #[arg(long)]
    pub arm: bool,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Speeds.
#[derive(Args, Debug)]
pub struct JogOptions {
    /// Table velocity, mm/s.
    #[arg(long, value_name = "MM_S", default_value_t = 0.0)]
    pub table_speed: f64,
    #[command(flatten)]
    pub lead: LeadOptions,
    /// For so long, s, instead of until Ctrl-C.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
}

/// A distance.
#[derive(Args, Debug)]
pub struct MoveOptions {
    /// How far, mm.
    #[arg(
        value_name = "MM",
        required_unless_present = "to",
        conflicts_with = "to"
    )]
    pub distance: Option<f64>,
    /// To this homed position, mm, instead of by a distance. The drive must be homed.
    #[arg(long, value_name = "MM")]
    pub to: Option<f64>,
    /// Largest table velocity on the way, mm/s.
    #[arg(long, value_name = "MM_S", default_value_t = 10.0)]
    pub table_speed: f64,
    #[command(flatten)]
    pub lead: LeadOptions,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// A motor that turns.
#[derive(Args, Debug)]
pub struct TurnOptions {
    /// The motor.
    #[arg(long, value_enum, default_value_t = Motor::Screw)]
    pub motor: Motor,
    /// Its speed, rpm. With --angle it is the largest on the way.
    #[arg(long, value_name = "RPM", default_value_t = 60.0)]
    pub rpm: f64,
    /// By so many degrees, by the table's scale and the lead, instead of until Ctrl-C: the screw only.
    #[arg(long, value_name = "DEG", conflicts_with = "duration")]
    pub angle: Option<f64>,
    /// For so long, s, instead of until Ctrl-C.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Arm it first, as `arm` does.
    #[arg(long)]
    pub arm: bool,
}

/// A stream of positions.
#[derive(Args, Debug)]
pub struct FollowOptions {
    /// A file with the columns time_s and position_mm, and velocity_mm_s if it is known; - is the standard input. Times are 1 to 50 ms
    /// apart.
    #[arg(value_name = "FILE.csv")]
    pub file: PathBuf,
    /// Positions are homed ones, and the table stands at the first; else they count from where the table stands.
    #[arg(long)]
    pub homed: bool,
    /// How long a set-point waits for its turn, ms: so much later it may come. Where one is missing at its turn, the table comes to rest.
    #[arg(long, value_name = "MS", default_value_t = 50)]
    pub delay_ms: u16,
    #[command(flatten)]
    pub lead: LeadOptions,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// A torque.
#[derive(Args, Debug)]
pub struct TorqueOptions {
    /// The motor that has it.
    #[arg(long, value_enum, default_value_t = Motor::Screw)]
    pub motor: Motor,
    /// Torque, N m: a positive one turns the motor forwards.
    #[arg(
        long,
        value_name = "NM",
        required_unless_present = "table_force",
        conflicts_with = "table_force"
    )]
    pub nm: Option<f64>,
    /// Force on the table, N, in place of a torque: the motor's torque is this force times lead / 2 pi. What friction of ball pair,
    /// guideway and bearings takes is not added.
    #[arg(long, value_name = "N")]
    pub table_force: Option<f64>,
    /// Fastest that the motor turns by it, rpm. [default: what the motor and the feed allow]
    #[arg(long, value_name = "RPM")]
    pub rpm_max: Option<f64>,
    /// Speed of the other motor, rpm.
    #[arg(long, value_name = "RPM", default_value_t = 0.0)]
    pub other_rpm: f64,
    /// For so long, s, instead of until Ctrl-C.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Arm it first, as `arm` does.
    #[arg(long)]
    pub arm: bool,
}

/// A homing.
#[derive(Args, Debug)]
pub struct HomeOptions {
    #[command(flatten)]
    pub lead: LeadOptions,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// What every motion is asked with.
#[derive(Args, Debug)]
pub struct LeadOptions {
    /// Nut speed, rpm; 0 is the single drive (CDFS). Left out, it is that of the drive's own table (the settings `base`), which is
    /// 0 until one is set.
    #[arg(long, value_name = "RPM")]
    pub nut_rpm: Option<f64>,
    /// Arm it first, as `arm` does.
    #[arg(long)]
    pub arm: bool,
}

/// A fault.
#[derive(Args, Debug)]
pub struct InjectOptions {
    /// Which; `clear` takes all of them out, and `list` prints them with their amounts.
    pub fault: String,
    /// Whose it is.
    #[arg(long, value_enum, default_value_t = Motor::Screw)]
    pub motor: Motor,
    /// How much, in the fault's unit.
    #[arg(long)]
    pub amount: Option<f64>,
}

/// A motor.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motor {
    /// The motor that turns the screw.
    Screw,
    /// The motor that turns the nut.
    Nut,
}

/// The settings of any drive.
#[derive(Args, Debug)]
pub struct ReferenceOptions {
    /// As a TOML file with the defaults, for `drive settings import`.
    #[arg(long)]
    pub template: bool,
}

/// Whether the drive may restart.
#[derive(Args, Clone, Copy, Debug)]
pub struct Restart {
    /// Restart the drive without a question, where a setting needs it.
    #[arg(long)]
    pub yes: bool,
}

/// What to do with settings.
#[derive(Subcommand, Debug)]
pub enum SettingsTask {
    /// Print settings with unit and meaning: all, or those whose names begin with one of these.
    Get {
        /// Names or their beginnings: nut.pole_pairs, feed.
        names: Vec<String>,
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// Set some, all or none: feed.lead_mm=10 screw.torque_constant_nm_per_a_rms=1.2. What needs no restart holds until the drive is
    /// switched off: `store` keeps it.
    Set {
        /// Names and values.
        #[arg(required = true, value_name = "NAME=VALUE")]
        settings: Vec<String>,
        #[command(flatten)]
        restart: Restart,
    },
    /// Keep the settings that hold: they are written to the drive's flash. The drive must rest.
    Store,
    /// Write all into a TOML file.
    Export {
        /// The file.
        file: PathBuf,
    },
    /// Set and store what stands in a TOML file, all or nothing.
    Import {
        /// The file.
        file: PathBuf,
        #[command(flatten)]
        restart: Restart,
    },
    /// What the drive has learned of its ripple, beside what is set.
    Learned {
        /// Set it, so that the next start begins with it; the drive must be at rest.
        #[arg(long)]
        save: bool,
        #[command(flatten)]
        restart: Restart,
    },
    /// What a TOML file would change.
    Diff {
        /// The file.
        file: PathBuf,
    },
    /// Write the model.toml that `identify` and `simulate` take of a machine with these settings.
    Model {
        /// The file.
        file: PathBuf,
    },
}

/// How long to record from a trigger on, if nothing is said, s.
const AFTER_TRIGGER_S: f64 = 1.0;

/// Writes a recording's file, the first, into an MCAP file, the second, with facts about it.
pub type WriteMcap = fn(&Path, &Path, BTreeMap<String, String>) -> Result<()>;

/// A recording.
#[derive(Args, Debug)]
pub struct RecordOptions {
    /// The folder.
    pub dir: PathBuf,
    /// The recording's name in it: `fit` and `check` are what `identify` is usually given.
    #[arg(long, default_value = "record")]
    pub name: String,
    /// Write it as NAME.mcap too, which PlotJuggler and Foxglove show.
    #[arg(long)]
    pub mcap: bool,
    /// Replace a recording of that name.
    #[arg(long)]
    pub replace: bool,
    /// Samples a second: 5000, or that divided by a whole number.
    #[arg(long, default_value_t = FULL_RATE)]
    pub rate: u32,
    /// How long, s; by default as long as the holds, and with a trigger 1 s from it on.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Run at table mm/s, nut rpm for seconds, and then the next; and come to rest at the end. For example 2.5,300,3.
    #[arg(long, value_name = "MM_S,RPM,S", allow_hyphen_values = true)]
    pub hold: Vec<Hold>,
    /// Begin when the drive has a fault (`fault`), or when a column of the recording is above or below a level: screw_ia_a>3. Then
    /// `--duration` counts from there; until then it waits, at most as long as the holds.
    #[arg(long, value_name = "WHAT")]
    pub trigger: Option<String>,
    /// How much to keep of what came before the trigger, s.
    #[arg(long, value_name = "S", default_value_t = 0.5, requires = "trigger")]
    pub past: f64,
    /// Arm it first, as `arm` does.
    #[arg(long)]
    pub arm: bool,
}

impl RecordOptions {
    /// How long its holds take, s.
    pub fn holds_s(&self) -> f64 {
        self.hold.iter().map(|hold| hold.seconds).sum()
    }

    /// How long to record, s; from the trigger on if it has one.
    pub fn seconds(&self) -> f64 {
        let otherwise = match self.trigger {
            Some(_) => AFTER_TRIGGER_S,
            None => self.holds_s(),
        };
        self.duration.unwrap_or(otherwise)
    }

    /// What writes the MCAP file, if one is asked for.
    ///
    /// # Errors
    /// This program was built without the feature.
    pub fn mcap_writer(&self) -> Result<Option<WriteMcap>> {
        if !self.mcap {
            return Ok(None);
        }
        #[cfg(feature = "mcap")]
        return Ok(Some(crate::mcap_file::write));
        #[cfg(not(feature = "mcap"))]
        Err(crate::missing_feature("--mcap", "mcap"))
    }
}

/// A burst.
#[derive(Args, Debug)]
pub struct BurstOptions {
    /// Whose periods are kept.
    #[arg(long, value_enum, default_value_t = Motor::Screw)]
    pub motor: Motor,
    /// Begin at once (`now`), when a fault stops the drive (`fault`), when its state becomes another (`state`), or when a signal rises
    /// (>) or falls (<) through a level, as in ia_a>3. Signals: ia_a, ib_a, iq_a, iq_ref_a, ud_v, uq_v, speed_rpm.
    #[arg(long, value_name = "WHAT", default_value = "now")]
    pub trigger: String,
    /// Part of the burst that comes before the trigger, %.
    #[arg(long, value_name = "PERCENT", default_value_t = 25.0)]
    pub before: f64,
    /// Keep each so manieth PWM period: a longer burst of a lower rate. What is faster than half of that rate then shows at a wrong
    /// frequency.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub every: u8,
    /// The CSV file.
    #[arg(long, value_name = "FILE", default_value = "out/burst.csv")]
    pub out: PathBuf,
    /// Replace a file of that name.
    #[arg(long)]
    pub replace: bool,
    /// Arm it, and leave: `--read` reads it later. No program needs to be connected when the trigger comes.
    #[arg(long, conflicts_with_all = ["read", "end"])]
    pub leave: bool,
    /// Wait for the burst that was armed before, and read it.
    #[arg(long, conflicts_with_all = ["end", "motor", "trigger", "before", "every"])]
    pub read: bool,
    /// End the burst that waits, or forget the one that is kept.
    #[arg(long, conflicts_with_all = ["motor", "trigger", "before", "every"])]
    pub end: bool,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

impl BurstOptions {
    /// What can be said against it before the drive is looked for.
    pub fn check(&self) -> Result<()> {
        ensure!(
            (0.0..=100.0).contains(&self.before),
            "--before is {} %, but 0 to 100 % are possible",
            self.before
        );
        ensure!(
            self.every > 0,
            "--every is 0, but each 1st to 255th period can be kept"
        );
        self.request()?;
        ensure!(
            self.leave || self.end || self.replace || !self.out.exists(),
            "{} is there already: give another --out, or --replace",
            self.out.display()
        );
        Ok(())
    }

    /// What is asked of the drive.
    ///
    /// # Errors
    /// The trigger is none.
    pub fn request(&self) -> Result<BurstRequest> {
        let wanted: Result<Wanted, String> = self.trigger.parse();
        let wanted = wanted.map_err(|error| anyhow!("--trigger: {error}"))?;
        let motor = u8::from(self.motor == Motor::Nut);
        wanted
            .request(motor, self.before, self.every)
            .context("--trigger")
    }
}
