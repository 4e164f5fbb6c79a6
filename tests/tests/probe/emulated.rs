//! The emulated chip in a thread of its own, behind its probe's address; and the debugger's library at that address.

use probe_rs::probe::list::Lister;
use probe_rs::probe::{DebugProbeSelector, WireProtocol};
use probe_rs::{Permissions, Session};
use std::net::SocketAddr;
use std::process::Command;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use tests::bench::Bench;
use tests::emulator::HaltedTime;
use tests::probe::served::Served;
use tests::probe::server::Server;

/// The chip that the target description is of.
pub const CHIP: &str = "STM32G474RETx";
/// How long a halt may take.
pub const PATIENCE: Duration = Duration::from_secs(2);

type Job = Box<dyn FnOnce(&mut Served) + Send>;

/// The chip's thread.
pub struct Emulated {
    /// Where its probe is.
    pub address: SocketAddr,
    jobs: Sender<Job>,
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Emulated {
    /// Starts a bench behind a probe.
    pub fn start(
        halted: HaltedTime,
        make: impl FnOnce() -> Result<Bench, String> + Send + 'static,
    ) -> Self {
        let server = Server::new("127.0.0.1:0").unwrap();
        let address = server.address().unwrap();
        let (jobs, todo) = channel();
        let thread = thread::spawn(move || {
            let mut bench = make()?;
            bench.emulator.halted_time = halted;
            run(Served::new(bench, server), &todo)
        });
        let chip = Self {
            address,
            jobs,
            thread: Some(thread),
        };
        // It answers from now on.
        chip.ask(|_| ());
        chip
    }

    /// Asks the chip's own side, which a debugger does not see.
    pub fn ask<T: Send + 'static>(
        &self,
        question: impl FnOnce(&mut Bench) -> T + Send + 'static,
    ) -> T {
        self.ask_all(|served| question(&mut served.bench))
    }

    /// The same, of the probe's side too.
    pub fn ask_all<T: Send + 'static>(
        &self,
        question: impl FnOnce(&mut Served) -> T + Send + 'static,
    ) -> T {
        let (to, from) = channel();
        let job = Box::new(move |served: &mut Served| {
            let _ = to.send(question(served));
        });
        self.jobs.send(job).expect("the chip's thread has ended");
        from.recv().expect("the chip's thread has ended")
    }

    /// A command of a program, at this chip's probe.
    pub fn command(&self, mut program: Command, name: &str) -> Command {
        program.arg(name).arg(format!("--probe={}", self.address));
        program
    }

    /// A debugger's session.
    pub fn attach(&self) -> Result<Session, probe_rs::Error> {
        let mut probe = Lister::new().open(self.selector())?;
        probe.select_protocol(WireProtocol::Swd)?;
        probe.attach(CHIP, Permissions::default())
    }

    /// The probe, as its library names it.
    pub fn selector(&self) -> DebugProbeSelector {
        let text = format!("1d50:6018:{}", self.address);
        text.parse().unwrap()
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let (jobs, _) = channel();
        drop(std::mem::replace(&mut self.jobs, jobs));
        let ended = self.thread.take().map(JoinHandle::join);
        match thread::panicking() {
            true => eprintln!("the chip's thread has ended: {ended:?}"),
            false => assert_eq!(ended.unwrap().expect("the chip's thread"), Ok(())),
        }
    }
}

/// Until nobody asks any more.
fn run(mut served: Served, todo: &Receiver<Job>) -> Result<(), String> {
    loop {
        match todo.try_recv() {
            Ok(job) => job(&mut served),
            Err(TryRecvError::Disconnected) => return Ok(()),
            Err(TryRecvError::Empty) => {}
        }
        served.turn()?;
    }
}
