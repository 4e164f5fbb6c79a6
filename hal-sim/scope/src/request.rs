//! A command as JSON, in the units of a person.

use anyhow::{Context, Error, Result, bail, ensure};
use link::host::burst::Wanted;
use link::host::command::{SpeedNames, speeds};
use link::host::settings::of_words;
use link::message::{Command, Injected, Injection};
use link::telemetry::Real;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::f64::consts::TAU;

/// How the page names its inputs.
const NAMES: SpeedNames = SpeedNames {
    velocity: "the table speed",
    base: "the common speed",
};

/// A command of the page. The field `command` has its name. Its other fields are in the same object.
///
/// Serde's internal tag would read the same text.
/// It cannot read numbers where another crate enables serde_json's `arbitrary_precision`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// Opens a session.
    Hello {},
    /// The page is still there.
    Heartbeat {},
    /// The drive's status.
    Status {},
    /// The last faults.
    Faults {},
    /// Events of the journal.
    Journal {
        /// How many of the latest are left out.
        after: u8,
    },
    /// Lets the drive move.
    Arm {},
    /// Runs at these speeds.
    Run {
        /// Table velocity, mm/s.
        velocity_mm_s: f64,
        /// Nut speed, rpm; `None`: that of the drive's table.
        common_speed_rpm: Option<f64>,
    },
    /// Moves the table by a distance.
    Move {
        /// Distance, mm.
        distance_mm: f64,
        /// Highest velocity, mm/s.
        velocity_mm_s: f64,
        /// Nut speed, rpm; `None`: that of the drive's table.
        common_speed_rpm: Option<f64>,
    },
    /// Finds the end switch.
    Home {
        /// Nut speed, rpm; `None`: that of the drive's table.
        common_speed_rpm: Option<f64>,
    },
    /// Comes to rest.
    Stop {},
    /// Leaves a fault.
    Reset {},
    /// Starts telemetry.
    Record {
        /// Steps of the speed task from row to row; 0 ends it.
        divider: u8,
    },
    /// Settings that hold.
    Settings {
        /// First number.
        from: u16,
    },
    /// Settings with the learned orders.
    Learned {
        /// First number.
        from: u16,
    },
    /// Changes a setting in the draft.
    Draft {
        /// Its name, as `feed.lead_mm`.
        name: String,
        /// Its value, as a person writes it.
        value: String,
    },
    /// Forgets the draft.
    Discard {},
    /// Makes the draft hold.
    Commit {},
    /// Writes the settings to the flash.
    Store {},
    /// Keeps every PWM period of a motor around a trigger.
    Burst {
        /// 0 is the screw, 1 the nut.
        motor: u8,
        /// See [`Wanted`].
        trigger: String,
        /// Part of the burst before the trigger, %.
        before_percent: f64,
        /// Each how manieth period is kept.
        divider: u8,
    },
    /// Forgets the burst.
    EndBurst {},
    /// How the burst is going.
    BurstStatus {},
    /// Its samples.
    BurstSamples {
        /// The first.
        from: u16,
    },
    /// Puts a fault into a simulated drive.
    Inject {
        /// Name of the fault.
        fault: String,
        /// 0 is the screw, 1 the nut.
        motor: u8,
        /// Its amount in the fault's unit.
        amount: f64,
    },
}

impl Request {
    /// Reads a request.
    ///
    /// # Errors
    /// The text is no JSON object, or no command has this name and these fields.
    pub fn of_json(json: &str) -> Result<Self> {
        let read = || -> Result<Self> {
            let mut fields: Map<String, Value> = serde_json::from_str(json)?;
            let name = fields.remove("command");
            let Some(Value::String(name)) = name else {
                bail!("the field `command` is missing, or is no text");
            };
            let mut command = Map::new();
            command.insert(name, fields.into());
            Ok(serde_json::from_value(command.into())?)
        };
        read().with_context(|| format!("{json} is no request"))
    }

    /// The command of the link. `stream` is the number of the next telemetry stream.
    ///
    /// # Errors
    /// A value is out of its range, or a name is unknown.
    pub fn command(self, stream: u32) -> Result<Command> {
        Ok(match self {
            Self::Hello {} => Command::Hello,
            Self::Heartbeat {} => Command::Heartbeat,
            Self::Status {} => Command::Status,
            Self::Faults {} => Command::Faults,
            Self::Journal { after } => Command::Journal { after },
            Self::Arm {} => Command::Arm,
            Self::Run {
                velocity_mm_s,
                common_speed_rpm,
            } => {
                let (velocity, base) = words(velocity_mm_s, common_speed_rpm)?;
                Command::Run { velocity, base }
            }
            Self::Move {
                distance_mm,
                velocity_mm_s,
                common_speed_rpm,
            } => {
                ensure!(distance_mm.is_finite(), "the distance is no number");
                let (velocity, base) = words(velocity_mm_s, common_speed_rpm)?;
                #[allow(clippy::cast_possible_truncation)]
                let distance_nm = (distance_mm * 1e6).round() as i64;
                Command::Move {
                    distance_nm,
                    velocity,
                    base,
                }
            }
            Self::Home { common_speed_rpm } => Command::Home {
                base: words(0.0, common_speed_rpm)?.1,
            },
            Self::Stop {} => Command::Stop,
            Self::Reset {} => Command::Reset,
            Self::Record { divider } => {
                Command::Record(link::telemetry::Request { divider, stream }.word())
            }
            Self::Settings { from } => Command::Settings { from },
            Self::Learned { from } => Command::Learned { from },
            Self::Draft { name, value } => {
                let (setting, value) = of_words(&name, &value)?;
                Command::Draft {
                    id: setting.id,
                    value: value.into(),
                }
            }
            Self::Discard {} => Command::Discard,
            Self::Commit {} => Command::Commit,
            Self::Store {} => Command::Store,
            Self::Burst {
                motor,
                trigger,
                before_percent,
                divider,
            } => {
                let wanted: Wanted = trigger.parse().map_err(Error::msg)?;
                Command::Burst(wanted.request(motor, before_percent, divider)?)
            }
            Self::EndBurst {} => Command::EndBurst,
            Self::BurstStatus {} => Command::BurstStatus,
            Self::BurstSamples { from } => Command::BurstSamples { from },
            Self::Inject {
                fault,
                motor,
                amount,
            } => Command::Inject(injection(&fault, motor, amount)?),
        })
    }
}

/// Table velocity and common speed as the link has them.
fn words(velocity_mm_s: f64, common_speed_rpm: Option<f64>) -> Result<(i32, Option<i32>)> {
    speeds(
        1e-3 * velocity_mm_s,
        common_speed_rpm.map(|rpm| rpm * TAU / 60.0),
        &NAMES,
    )
}

fn injection(name: &str, motor: u8, amount: f64) -> Result<Injection> {
    let mut all = Injected::ALL.iter();
    let fault = all
        .find(|fault| fault.name() == name)
        .with_context(|| format!("the fault is `{name}`, but there is no such fault"))?;
    if let Some([low, high]) = fault.range() {
        ensure!(
            (low..=high).contains(&amount),
            "the amount is {amount}, but {name} takes {low} to {high} {}",
            fault.unit().unwrap_or_default()
        );
    }
    Ok(Injection {
        fault: fault.word(),
        motor,
        amount: Real::new(amount),
    })
}
