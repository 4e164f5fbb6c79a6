//! `ddfeed drive`: a drive commanded over its link.

mod burst;
mod check;
mod commission;
pub mod connect;
mod follow;
pub mod motion;
mod options;
mod record;
mod settings;
mod status;
mod torque;
mod tune;
mod turn;

pub use options::{DriveOptions, LineOptions, RecordCommand, ReferenceOptions, Task};
pub use settings::reference;

use anyhow::Result;
use link::host::refused::{Lost, Refused};
use std::process::ExitCode;

/// Does what is asked.
pub fn run(options: &DriveOptions) -> Result<()> {
    options.task.check()?;
    carry_out(connect::open(&options.line, options.baud)?, &options.task)
}

/// Does what is asked of a drive at any line.
pub fn carry_out(mut client: connect::Drive, task: &Task) -> Result<()> {
    match task {
        Task::Status { json } => status::status(&mut client, *json),
        Task::Faults { json } => status::faults(&mut client, *json),
        Task::Arm => motion::arm(&mut client),
        Task::Jog(jog) => motion::jog(&mut client, jog),
        Task::Move(travel) => motion::travel(&mut client, travel),
        Task::Turn(options) => turn::turn(&mut client, options),
        Task::Follow(options) => follow::follow(&mut client, options),
        Task::Torque(options) => torque::torque(&mut client, options),
        Task::Home(home) => motion::home(&mut client, home),
        Task::Stop => motion::stop(&mut client),
        Task::Reset => motion::reset(&mut client),
        Task::Inject(injection) => motion::inject(&mut client, injection),
        Task::Settings { what } => settings::run(&mut client, what),
        Task::Commission(options) => commission::run(client, options),
        Task::Tune(options) => tune::run(&mut client, options),
        Task::Burst(options) => burst::run(&mut client, options),
        Task::Record(record) => record::record(&mut client, record),
    }
}

/// 3: the drive refuses. 4: a fault has stopped it. 5: it does not answer. 1: anything else.
pub fn exit_code(error: &anyhow::Error) -> ExitCode {
    if error.is::<Refused>() {
        return ExitCode::from(3);
    }
    if error.is::<motion::Stopped>() {
        return ExitCode::from(4);
    }
    if error.is::<Lost>() {
        return ExitCode::from(5);
    }
    ExitCode::FAILURE
}
