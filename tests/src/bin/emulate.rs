//! `cargo xtask emulate`: the firmware on the emulated chip, its machine at the pins, behind network addresses: its debug port
//! for a debugger, its serial port for `ddfeed drive --sim`. Its time passes slower than real.

use anyhow::{Context, Error, Result};
use clap::{Parser, ValueEnum};
use plant::machine::Coupling;
use plant::model::Model;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::ExitCode;
use tests::bench::{Bench, aligning_firmware_of};
use tests::chip::wiring::Wiring;
use tests::emulator::HaltedTime;
use tests::probe::served::Served;
use tests::probe::server::Server;
use xtask::firmware::{Board, Build};

/// Run the firmware on an emulated chip that a debugger and a host reach.
#[derive(Parser)]
#[command(name = "cargo xtask emulate", bin_name = "cargo xtask emulate")]
struct Arguments {
    /// Where a debugger finds the chip's debug port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:2331")]
    probe: SocketAddr,
    /// Where a host finds the chip's serial port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:2332")]
    link: SocketAddr,
    /// The machine at the pins; without it the paper's, without a load.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The firmware, and with it the board that the chip is on.
    #[command(flatten)]
    build: Build,
    /// What time does while a debugger halts the core: it goes on as on a board, or waits.
    #[arg(long, value_enum, default_value_t = Halt::Running)]
    halt: Halt,
}

/// How the pins of a firmware's chip are wired.
fn wiring(build: Build) -> Result<Wiring> {
    build.features()?;
    Ok(match (build.board, build.pwm_khz) {
        (Board::Mains, _) => Wiring::Mains,
        (Board::Nucleo, 40) => Wiring::Nucleo40kHz,
        (Board::Nucleo, _) => Wiring::Nucleo,
    })
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Halt {
    Running,
    Frozen,
}

/// The serial port's end of the network.
struct Link {
    listener: TcpListener,
    host: Option<TcpStream>,
}

impl Link {
    fn new(address: SocketAddr) -> Result<Self> {
        let listener = TcpListener::bind(address).with_context(|| taken("link", address))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            host: None,
        })
    }

    /// Carries bytes both ways.
    fn carry(&mut self, bench: &mut Bench) -> Result<()> {
        let mut bytes = [0; 4096];
        if let Ok((stream, _)) = self.listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            self.host = Some(stream);
        }
        let chip = bench.emulator.chip();
        let said = chip.host_takes();
        let Some(stream) = &mut self.host else {
            return Ok(());
        };
        let came = match stream.read(&mut bytes) {
            Ok(0) => None,
            Ok(count) => Some(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Some(0),
            Err(_) => None,
        };
        if let Some(count) = came.filter(|count| *count > 0) {
            chip.host_sends(&bytes[..count]);
        }
        stream.set_nonblocking(false)?;
        let written = stream.write_all(&said);
        stream.set_nonblocking(true)?;
        if came.is_none() || written.is_err() {
            self.host = None;
        }
        Ok(())
    }
}

fn taken(option: &str, address: SocketAddr) -> String {
    format!(
        "--{option} is {address}, which cannot be listened at: is another program there? Name another port"
    )
}

fn serve(arguments: &Arguments) -> Result<()> {
    let server = Server::new(arguments.probe).with_context(|| taken("probe", arguments.probe))?;
    let mut link = Link::new(arguments.link)?;
    let model = match &arguments.model {
        Some(path) => {
            Model::load(path).with_context(|| format!("--model is {}", path.display()))?
        }
        None => {
            // A load would drive the screw back while the bridges are open.
            let mut model = Model::paper();
            model.feed.load_n = 0.0;
            model
        }
    };
    let board = wiring(arguments.build)?;
    let elf = aligning_firmware_of(board).map_err(Error::msg)?;
    let mut bench = Bench::with(&elf, board, &model, Coupling::Lumped).map_err(Error::msg)?;
    bench.attended = false;
    bench.emulator.halted_time = match arguments.halt {
        Halt::Running => HaltedTime::Running,
        Halt::Frozen => HaltedTime::Frozen,
    };
    let (probe, serial) = (server.address()?, link.listener.local_addr()?);
    println!("The firmware is {}", elf.display());
    println!("It is reached by, with Ctrl-C for the end:");
    println!("  cargo xtask attach --probe {probe}");
    println!("  cargo xtask run --probe {probe}");
    println!("  cargo ddfeed-full drive --probe={probe} status");
    println!("  cargo ddfeed drive --sim {serial} status");
    println!("  probe-rs gdb --chip STM32G474RETx --protocol swd --probe 1d50:6018:{probe}");
    let mut served = Served::new(bench, server);
    loop {
        served.turn().map_err(Error::msg)?;
        link.carry(&mut served.bench)?;
        for refused in served.server.refused.drain(..) {
            eprintln!("refused: {refused}");
        }
    }
}

fn main() -> ExitCode {
    match serve(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
