//! The host's end of a bring-up: the request, the wait, the report, the stream, and the drive afterwards.

use super::rtt::Channel;
use super::{Drive, Memory, View};
use crate::bringup::{
    BringupReport, BringupRequest, REPORT_MAGIC, REPORT_SYMBOL, REQUEST_MAGIC, REQUEST_SYMBOL,
    ReportWords, Stage, stream_byte,
};
use crate::view::Words;
use crate::{CRASH_SYMBOL, CRASH_TEXT, LAYOUT, LINK_UP_CHANNEL};
use anyhow::{Context, Result, bail, ensure};
use std::mem::{offset_of, size_of};

const REPORT_WORDS: usize = size_of::<BringupReport>() / 4;
/// AIRCR (PM0214 4.4.5): a reset of the system, with the key that the register asks for.
const AIRCR: (u32, u32) = (0xE000_ED0C, 0x05FA_0004);

/// In the firmware's crash record: the text's length, and after it the text.
const CRASH_LENGTH: u32 = 4;

/// How long a chip has to start and take the request, s.
const START_S: f64 = 1.0;
/// How long an item may take beside listening to the encoders, s.
const ITEM_S: f64 = 3.0;
/// How often the report is looked at, s.
const LOOK_S: f64 = 5e-3;

/// A chip that a bring-up talks to: its memory, and its time.
pub trait Bench: Memory {
    /// Time passes, s.
    ///
    /// # Errors
    /// The chip is lost.
    fn wait(&mut self, seconds: f64) -> Result<()>;

    /// Time since some start, s.
    fn now(&self) -> f64;
}

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How long to listen to the encoders, s.
    pub listen_s: f64,
    /// How long to read the stream, s.
    pub stream_s: f64,
    /// The second stage, at so many volts on the bus by the user's meter; `None`: the first.
    pub meter_v: Option<f64>,
    /// How long the drive runs afterwards, with its bridges off, s: its zeros take 51 ms.
    pub drive_s: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            listen_s: 0.1,
            stream_s: 1.0,
            meter_v: None,
            drive_s: 0.5,
        }
    }
}

/// How the stream went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stream {
    /// Bytes that came.
    pub bytes: u32,
    /// In so many seconds.
    pub seconds: f64,
    /// Bytes that were not those that are due.
    pub wrong: u32,
}

/// All that was read.
#[derive(Clone, Debug)]
pub struct Readings {
    /// The firmware's report.
    pub report: ReportWords,
    /// The bus by the user's meter, V, in the second stage.
    pub meter_v: Option<f64>,
    /// RTT's stream; `None` if it did not come to that.
    pub stream: Option<Stream>,
    /// The drive as it runs afterwards, with its bridges off; `None` if it did not come to that.
    pub drive: Option<View>,
    /// What the firmware said when it gave up on the way.
    pub crash: Option<String>,
}

impl Readings {
    /// How far the firmware came.
    #[must_use]
    pub fn stage(&self) -> Option<Stage> {
        Stage::of_word(self.report.stage)
    }
}

/// Where a firmware has what a bring-up needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bringup {
    request: u32,
    report: u32,
    crash: u32,
    drive: Drive,
}

impl Bringup {
    /// Asks `symbol` for the addresses of the firmware's symbols.
    ///
    /// # Errors
    /// A symbol is missing.
    pub fn locate<E>(mut symbol: impl FnMut(&str) -> Result<u32, E>) -> Result<Self, E> {
        Ok(Self {
            request: symbol(REQUEST_SYMBOL)?,
            report: symbol(REPORT_SYMBOL)?,
            crash: symbol(CRASH_SYMBOL)?,
            drive: Drive::locate(symbol)?,
        })
    }

    /// Does it all, and leaves the chip in a drive that has started afresh. `progress` hears of each stage.
    ///
    /// # Errors
    /// The chip is lost, or does not take the request.
    pub fn run(
        &self,
        bench: &mut impl Bench,
        options: &Options,
        mut progress: impl FnMut(Stage),
    ) -> Result<Readings> {
        self.ask(bench, options)?;
        let last = self.follow(bench, options, &mut progress)?;
        let mut stream = None;
        if last == Stage::Stream {
            stream = Some(self.stream(bench, options.stream_s)?);
            bench.write(self.request_field(offset_of!(BringupRequest, stream)), 0)?;
            self.follow(bench, options, &mut progress)?;
        }
        let report = self.look(bench)?;
        let crash = self.crashed(bench)?;
        let finished =
            options.meter_v.is_none() && Stage::of_word(report.stage) == Some(Stage::Done);
        // What did not end by itself hangs; either way the chip is left in its drive.
        reset(bench);
        let drive = match finished {
            true => {
                bench.wait(options.drive_s)?;
                Some(self.drive.look(bench)?)
            }
            false => None,
        };
        Ok(Readings {
            report,
            meter_v: options.meter_v,
            stream,
            drive,
            crash,
        })
    }

    /// What the firmware said when it gave up since the request.
    fn crashed(&self, bench: &mut impl Bench) -> Result<Option<String>> {
        let [length] = bench.words(self.crash + CRASH_LENGTH)?;
        let length = length as usize;
        if length == 0 || length > CRASH_TEXT {
            return Ok(None);
        }
        let mut text = vec![0; length];
        bench.read(self.crash + CRASH_LENGTH + 4, &mut text)?;
        Ok(Some(String::from_utf8_lossy(&text).into_owned()))
    }

    fn ask(&self, bench: &mut impl Bench, options: &Options) -> Result<()> {
        ensure!(
            (0.0..=600.0).contains(&options.listen_s),
            "{} s of listening to the encoders are not possible: 0 to 600 s are",
            options.listen_s
        );
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let listen_ms = (options.listen_s * 1e3).round() as u32;
        // The report and the crash that are looked for are those to come.
        bench.write(self.crash + CRASH_LENGTH, 0)?;
        bench.write(self.report + offset(offset_of!(BringupReport, magic)), 0)?;
        for (field, word) in [
            (offset_of!(BringupRequest, listen_ms), listen_ms),
            (offset_of!(BringupRequest, stream), 1),
            (
                offset_of!(BringupRequest, powered),
                options.meter_v.is_some().into(),
            ),
            (offset_of!(BringupRequest, magic), REQUEST_MAGIC),
            (offset_of!(BringupRequest, complement), !REQUEST_MAGIC),
        ] {
            bench.write(self.request_field(field), word)?;
        }
        reset(bench);
        Ok(())
    }

    /// Waits for the stage at which the firmware waits for the host, or at which it goes no further.
    fn follow(
        &self,
        bench: &mut impl Bench,
        options: &Options,
        progress: &mut impl FnMut(Stage),
    ) -> Result<Stage> {
        let mut before: Option<Stage> = None;
        let mut since = bench.now();
        loop {
            bench.wait(LOOK_S)?;
            // While the chip starts, the probe may not reach it.
            let stage = match self.stage(bench) {
                Ok(stage) => stage,
                Err(_) if bench.now() - since < START_S => None,
                Err(error) => return Err(error),
            };
            let now = bench.now();
            if let Some(stage) = stage
                && before != Some(stage)
            {
                progress(stage);
                (before, since) = (Some(stage), now);
            }
            match before {
                Some(stage @ (Stage::Stream | Stage::Done | Stage::Refused))
                    if stage != Stage::Stream || self.streams(bench)? =>
                {
                    return Ok(stage);
                }
                Some(stage) if self.crashed(bench)?.is_some() => return Ok(stage),
                Some(stage) if now - since > ITEM_S + options.listen_s => return Ok(stage),
                None if now - since > START_S => bail!(
                    "the chip does not take the request for a bring-up within {START_S} s of its reset: flash this firmware \
                     first with `cargo xtask flash`"
                ),
                _ => {}
            }
        }
    }

    /// The host has not ended the stream.
    fn streams(&self, bench: &mut impl Bench) -> Result<bool> {
        let at = self.request_field(offset_of!(BringupRequest, stream));
        let [stream] = bench.words(at)?;
        Ok(stream == 1)
    }

    /// How far the firmware is; `None` before it has begun.
    fn stage(&self, bench: &mut impl Bench) -> Result<Option<Stage>> {
        let [magic, layout, stage] = bench.words(self.report)?;
        if magic != REPORT_MAGIC {
            return Ok(None);
        }
        ensure!(
            layout == LAYOUT,
            "the chip's bring-up has layout {layout}, and not {LAYOUT} of this host: flash it first with `cargo xtask flash`"
        );
        let stage = Stage::of_word(stage)
            .with_context(|| format!("the chip's bring-up is at an unknown stage {stage}"))?;
        Ok(Some(stage))
    }

    fn look(&self, bench: &mut impl Bench) -> Result<ReportWords> {
        let mut words = bench.words::<REPORT_WORDS>(self.report)?.into_iter();
        Ok(ReportWords::take(&mut || words.next().unwrap_or_default()))
    }

    fn stream(&self, bench: &mut impl Bench, seconds: f64) -> Result<Stream> {
        let channel = Channel::find(bench, self.drive.rtt, LINK_UP_CHANNEL)?
            .context("the chip has not set RTT up")?;
        let mut stream = Stream::default();
        let (mut due, mut bytes) = (0u32, Vec::new());
        // What is in the channel when the clock starts was not sent while it ran.
        let mut timed = None;
        while stream.seconds < seconds {
            bytes.clear();
            channel.drain(bench, &mut bytes)?;
            for byte in &bytes {
                if *byte != stream_byte(due) {
                    stream.wrong += 1;
                }
                due = due.wrapping_add(1);
            }
            let now = bench.now();
            match timed {
                None => timed = Some(now),
                Some(start) => {
                    stream.bytes += u32::try_from(bytes.len())?;
                    stream.seconds = now - start;
                }
            }
            bench.wait(1e-3)?;
        }
        Ok(stream)
    }

    fn request_field(&self, field: usize) -> u32 {
        self.request + offset(field)
    }
}

/// An offset in a structure of a few words.
#[allow(clippy::cast_possible_truncation)]
fn offset(field: usize) -> u32 {
    field as u32
}

/// Resets the chip. The probe may lose its answer with it: what follows finds out.
fn reset(bench: &mut impl Bench) {
    let _ = bench.write(AIRCR.0, AIRCR.1);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{DriveView, MAGIC};
    use anyhow::anyhow;

    const REQUEST: u32 = 0;
    const REPORT: u32 = 0x100;
    const VIEW: u32 = 0x2000;
    const RTT: u32 = 0x3000;
    const BUFFER: u32 = 0x3800;
    const CRASH: u32 = 0x2C00;

    /// A chip whose firmware is at the stages of `script`, one a look.
    struct Fake {
        ram: Vec<u8>,
        now: f64,
        script: Vec<u32>,
        resets: u32,
        sent: u32,
        wrong_at: Option<u32>,
        gives_up: bool,
    }

    impl Fake {
        fn new(script: &[Stage]) -> Self {
            Self {
                ram: vec![0; 0x4000],
                now: 0.0,
                script: script.iter().rev().map(|stage| stage.word()).collect(),
                resets: 0,
                sent: 0,
                wrong_at: None,
                gives_up: false,
            }
        }

        fn put(&mut self, address: u32, words: &[u32]) {
            for (k, word) in words.iter().enumerate() {
                let at = address as usize + 4 * k;
                self.ram[at..at + 4].copy_from_slice(&word.to_le_bytes());
            }
        }

        fn get(&self, address: u32) -> u32 {
            let at = address as usize;
            u32::from_le_bytes(self.ram[at..at + 4].try_into().unwrap())
        }
    }

    impl Memory for Fake {
        fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
            let at = address as usize;
            let there = self
                .ram
                .get(at..at + bytes.len())
                .ok_or_else(|| anyhow!("no memory at {address:#x}"))?;
            bytes.copy_from_slice(there);
            Ok(())
        }

        fn write(&mut self, address: u32, word: u32) -> Result<()> {
            if address == AIRCR.0 {
                self.resets += 1;
                let asked =
                    self.get(REQUEST) == REQUEST_MAGIC && self.get(REQUEST + 4) == !REQUEST_MAGIC;
                if asked && !self.script.is_empty() {
                    self.put(REQUEST, &[0, 0]);
                    self.put(REPORT, &[REPORT_MAGIC, LAYOUT, Stage::Start.word()]);
                    self.ram[RTT as usize..RTT as usize + 10].copy_from_slice(b"SEGGER RTT");
                    self.put(RTT + 16, &[2, 0]);
                    self.put(RTT + 48, &[0, BUFFER, 512, 0, 0, 0]);
                } else {
                    self.put(VIEW, &[MAGIC, LAYOUT]);
                    let cycles = VIEW + offset(offset_of!(DriveView, uptime_ms));
                    self.put(cycles, &[77]);
                }
                return Ok(());
            }
            self.put(address, &[word]);
            Ok(())
        }
    }

    impl Bench for Fake {
        fn wait(&mut self, seconds: f64) -> Result<()> {
            self.now += seconds;
            if self.get(REPORT) != REPORT_MAGIC {
                return Ok(());
            }
            let streaming = self.get(REPORT + 8) == Stage::Stream.word();
            if streaming && self.get(REQUEST + 12) == 1 {
                // 100 bytes a look.
                for _ in 0..100 {
                    let at = self.get(RTT + 48 + 12);
                    let mut byte = stream_byte(self.sent);
                    if self.wrong_at == Some(self.sent) {
                        byte ^= 0x10;
                    }
                    self.ram[(BUFFER + at) as usize] = byte;
                    self.put(RTT + 48 + 12, &[(at + 1) % 512]);
                    self.sent += 1;
                }
            } else if self.gives_up {
                self.put(CRASH + 4, &[10]);
            } else if let Some(stage) = self.script.pop() {
                self.put(REPORT + 8, &[stage]);
            }
            Ok(())
        }

        fn now(&self) -> f64 {
            self.now
        }
    }

    fn bringup() -> Bringup {
        Bringup::locate(|name| -> Result<u32> {
            Ok(match name {
                REQUEST_SYMBOL => REQUEST,
                REPORT_SYMBOL => REPORT,
                crate::VIEW_SYMBOL => VIEW,
                crate::RTT_SYMBOL => RTT,
                CRASH_SYMBOL => CRASH,
                _ => 0x2800,
            })
        })
        .unwrap()
    }

    #[test]
    fn a_bring_up_goes_through_its_stages_and_leaves_the_drive_running() {
        use Stage::{Clock, Done, Pins, Start, Stream};
        let mut chip = Fake::new(&[Start, Clock, Pins, Stream, Done]);
        let mut heard = Vec::new();
        let readings = bringup()
            .run(&mut chip, &Options::default(), |stage| heard.push(stage))
            .unwrap();
        assert_eq!(heard, [Start, Clock, Pins, Stream, Done]);
        assert_eq!(chip.resets, 2);
        assert_eq!(readings.stage(), Some(Done));
        assert_eq!(readings.drive.unwrap().words().uptime_ms, 77);
        let stream = readings.stream.unwrap();
        let rate = f64::from(stream.bytes) / stream.seconds;
        assert!((rate / 100e3 - 1.0).abs() < 0.01, "{rate} bytes a second");
        assert_eq!(stream.wrong, 0);
    }

    #[test]
    fn a_byte_that_arrives_wrong_is_counted() {
        let mut chip = Fake::new(&[Stage::Stream, Stage::Done]);
        chip.wrong_at = Some(250);
        let readings = bringup()
            .run(&mut chip, &Options::default(), |_| ())
            .unwrap();
        assert_eq!(readings.stream.unwrap().wrong, 1);
    }

    #[test]
    fn a_firmware_that_hangs_or_refuses_says_where_and_the_drive_is_started() {
        for last in [Stage::Clock, Stage::Refused] {
            let mut chip = Fake::new(&[Stage::Start, last]);
            let readings = bringup()
                .run(&mut chip, &Options::default(), |_| ())
                .unwrap();
            assert_eq!(readings.stage(), Some(last));
            assert!(readings.drive.is_none() && readings.stream.is_none());
            assert_eq!(chip.resets, 2);
        }
    }

    #[test]
    fn what_a_firmware_says_when_it_gives_up_is_passed_on_at_once() {
        let mut chip = Fake::new(&[Stage::Clock]);
        chip.put(CRASH, &[7, 0]);
        chip.ram[CRASH as usize + 8..][..10].copy_from_slice(b"no crystal");
        chip.gives_up = true;
        let readings = bringup()
            .run(&mut chip, &Options::default(), |_| ())
            .unwrap();
        assert_eq!(readings.crash.as_deref(), Some("no crystal"));
        assert!(chip.now < 1.0, "after {} s", chip.now);
    }

    #[test]
    fn a_chip_that_does_not_take_the_request_is_told_in_a_sentence() {
        let mut chip = Fake::new(&[]);
        let error = bringup()
            .run(&mut chip, &Options::default(), |_| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains("flash this firmware first"), "{error}");
        assert!(chip.now < 2.0 * START_S, "given up after {} s", chip.now);
    }
}
