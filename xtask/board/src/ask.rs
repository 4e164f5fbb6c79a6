//! `bringup`: the board asked through the probe.

use crate::session::BringupOptions;
use anyhow::Result;
use board::bringup::{Verdict, judge, page};
use ddfeed::output::Folder;
use ddfeed::probe::Image;
use ddfeed::probe::memory::{Target, with_chip};
use link::bringup::Stage;
use link::host::Memory;
use link::host::bringup::{Bench, Bringup, Options};
use probe_rs::probe::DebugProbeInfo;
use std::thread;
use std::time::{Duration, Instant};

/// The chip behind the probe, and the host's own time.
struct Live<'a, 'm> {
    target: Target<'m>,
    begun: Instant,
    /// The session ends if nothing is said for long.
    alive: &'a dyn Fn(Said),
}

/// What the thread at the probe says.
enum Said {
    Alive,
    At(Stage),
}

impl Memory for Live<'_, '_> {
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
        self.target.read(address, bytes)
    }

    fn write(&mut self, address: u32, word: u32) -> Result<()> {
        self.target.write(address, word)
    }
}

impl Bench for Live<'_, '_> {
    fn wait(&mut self, seconds: f64) -> Result<()> {
        (self.alive)(Said::Alive);
        thread::sleep(Duration::from_secs_f64(seconds));
        Ok(())
    }

    fn now(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }
}

/// Asks the board, and says what it found: in words or as JSON, and as a page.
///
/// # Errors
/// The chip is lost, or does not take the request.
pub fn bringup(probe: DebugProbeInfo, image: &Image, options: &BringupOptions) -> Result<()> {
    let folder = Folder::open(&options.out)?;
    let place = Bringup::locate(|name| image.symbol(name))?;
    let asked = Options {
        listen_s: options.turn.unwrap_or(Options::default().listen_s),
        meter_v: options.bus_volts,
        ..Options::default()
    };
    let turning = options.turn;
    let readings = with_chip(
        probe,
        move |target, say: &dyn Fn(Said)| {
            let mut live = Live {
                target,
                begun: Instant::now(),
                alive: say,
            };
            place.run(&mut live, &asked, |stage| say(Said::At(stage)))
        },
        |said| {
            if let Said::At(stage) = said {
                eprintln!("{}: {}", stage.name(), stage.sentence());
                if let (Stage::Encoders, Some(seconds)) = (stage, turning) {
                    eprintln!(
                        "Turn both shafts by hand now, a turn and more each way: {seconds} s"
                    );
                }
            }
            Ok(())
        },
    )?;
    let report = judge(&readings);
    folder.put_text("bringup.html", &page(&report))?;
    let json = serde_json::to_string_pretty(&report)?;
    folder.put_text("bringup.json", &json)?;
    if options.json {
        println!("{json}");
    } else {
        println!("{}", report.text());
        println!("{}", folder.path("bringup.html").display());
    }
    let findings = report.of(Verdict::Finding).count();
    anyhow::ensure!(
        findings == 0,
        "the board is not ready for the next step: {}",
        report.result
    );
    Ok(())
}
