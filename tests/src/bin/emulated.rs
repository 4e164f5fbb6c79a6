//! The flashed ELF on the emulated chip behind a TCP port: `ddfeed drive --sim ADDRESS` commands it as it would a board. The
//! bytes go over the wires of its serial port, or with `--rtt` through RTT in its memory. Its time passes slower than real.

use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::ExitCode;
use std::rc::Rc;
use std::time::Duration;
use tests::bench::{Bench, READY};
use tests::wire::{RttLine, Wires};

use link::host::client::Line;

/// Time of the chip between two looks at the connection.
const SLICE: Duration = Duration::from_micros(500);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(unknown) = arguments.iter().find(|argument| *argument != "--rtt") {
        eprintln!("error: `{unknown}` is not known; `--rtt` takes RTT in place of the serial port");
        return ExitCode::FAILURE;
    }
    match serve(!arguments.is_empty()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn serve(rtt: bool) -> anyhow::Result<()> {
    // Without a load, which would drive the screw back while the bridges are open.
    let mut model = Model::paper();
    model.feed.load_n = 0.0;
    let mut bench = Bench::new(&model, Coupling::Lumped).map_err(|error| anyhow::anyhow!(error))?;
    bench.attended = false;
    bench
        .wait_for(READY, 0.2)
        .map_err(|error| anyhow::anyhow!(error))?;
    let bench = Rc::new(RefCell::new(bench));
    let mut line: Box<dyn Line> = if rtt {
        Box::new(RttLine::new(&bench)?)
    } else {
        Box::new(Wires::new(&bench))
    };
    let listener = TcpListener::bind("127.0.0.1:0")?;
    listener.set_nonblocking(true)?;
    println!(
        "`ddfeed drive --sim {} status` asks the emulated drive; Ctrl-C ends it",
        listener.local_addr()?
    );
    let mut connection: Option<TcpStream> = None;
    let mut bytes = [0; 4096];
    loop {
        if let Ok((stream, _)) = listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            connection = Some(stream);
        }
        let mut gone = false;
        if let Some(stream) = &mut connection {
            match stream.read(&mut bytes) {
                Ok(0) => gone = true,
                Ok(count) => line.send(&bytes[..count])?,
                Err(error) => gone = error.kind() != ErrorKind::WouldBlock,
            }
        }
        let count = line.receive(&mut bytes, SLICE)?;
        if let Some(stream) = &mut connection
            && count > 0
        {
            stream.set_nonblocking(false)?;
            gone |= stream.write_all(&bytes[..count]).is_err();
            stream.set_nonblocking(true)?;
        }
        if gone {
            connection = None;
        }
    }
}
