//! `cargo xtask drive`: a drive commanded over its link, behind the feature `drive`.

#[cfg(feature = "drive")]
mod commission;
#[cfg(feature = "drive")]
pub mod connect;
#[cfg(feature = "drive")]
pub mod motion;
mod options;
#[cfg(feature = "drive")]
mod record;
#[cfg(feature = "drive")]
mod settings;
#[cfg(feature = "drive")]
mod status;
#[cfg(feature = "drive")]
mod tune;

pub use options::DriveOptions;

use anyhow::Result;
use std::process::ExitCode;

/// Does what is asked.
#[cfg(feature = "drive")]
pub fn run(options: &DriveOptions) -> Result<()> {
    use options::Task;
    options.check()?;
    #[cfg(not(feature = "probe"))]
    if options.line.probe.is_some() {
        return crate::with::With::DriveByProbe.take_over();
    }
    let mut client = connect::open(&options.line, options.baud)?;
    match &options.task {
        Task::Status { json } => status::status(&mut client, *json),
        Task::Faults { json } => status::faults(&mut client, *json),
        Task::Arm => motion::arm(&mut client),
        Task::Jog(jog) => motion::jog(&mut client, jog),
        Task::Move(travel) => motion::travel(&mut client, travel),
        Task::Home(home) => motion::home(&mut client, home),
        Task::Stop => motion::stop(&mut client),
        Task::Reset => motion::reset(&mut client),
        Task::Inject(injection) => motion::inject(&mut client, injection),
        Task::Settings { what } => settings::run(&mut client, what),
        Task::Commission(options) => commission::run(client, options),
        Task::Tune(options) => tune::run(&mut client, options),
        Task::Record(record) => record::record(&mut client, record),
    }
}

/// Hands over to an xtask with the link.
#[cfg(not(feature = "drive"))]
pub fn run(options: &DriveOptions) -> Result<()> {
    options.check()?;
    match options.line.probe {
        Some(_) => crate::with::With::DriveByProbe,
        None => crate::with::With::Drive,
    }
    .take_over()
}

/// 3: the drive refuses. 4: a fault has stopped it. 5: it does not answer. 1: anything else.
pub fn exit_code(error: &anyhow::Error) -> ExitCode {
    #[cfg(feature = "drive")]
    {
        use link::host::client::{Lost, Refused};
        if error.is::<Refused>() {
            return ExitCode::from(3);
        }
        if error.is::<motion::Stopped>() {
            return ExitCode::from(4);
        }
        if error.is::<Lost>() {
            return ExitCode::from(5);
        }
    }
    let _ = error;
    ExitCode::FAILURE
}
