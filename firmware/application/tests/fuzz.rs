//! Any bytes on a line, any value of a setting, any page of flash: nothing panics, nothing that is not armed runs, and each answer is
//! one that a host can read. `FUZZ_EXECUTIONS` sets how many frames, values or pairs of pages each test takes, `FUZZ_SEED` which.

use application::server::{Commander, NotSet, Served, Server};
use control::stream::Followed;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use link::burst::{BurstRequest, BurstSample, BurstStatus, SAMPLES_A_FRAME};
use link::codes::{Demand, State};
use link::frame::{Decoder, FRAME_MAX, encode};
use link::message::{Command, DriveFrame, HostFrame, Injection, Refusal, Reply, Status};
use link::settings::store::{PAGE, SLOT, Store};
use link::settings::{Effect, Settings, WireValue};
use link::telemetry::Real;
use serde::ser::{Serialize, SerializeTuple, Serializer};

/// Xorshift (Marsaglia 2003), with a multiplication at the end.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() >> 33) as usize % end.max(1)
    }

    /// Small, at an end, or any.
    fn number(&mut self) -> u64 {
        match self.below(4) {
            0 => self.next() & 0xF,
            1 => u64::MAX - (self.next() & 0xF),
            2 => 1 << self.below(64),
            _ => self.next(),
        }
    }

    fn value(&mut self) -> WireValue {
        match self.below(3) {
            0 => WireValue::Real(Real::new(match self.below(4) {
                0 => f64::from_bits(self.number()),
                1 => f64::INFINITY,
                2 => (self.below(2000) as f64 - 1000.0) / 8.0,
                _ => f64::NAN,
            })),
            1 => WireValue::Whole(self.number() as u32),
            _ => WireValue::Choice(self.number() as u8),
        }
    }

    fn command(&mut self) -> Command {
        let [a, b] = [self.number(), self.number()];
        match self.below(26) {
            0 => Command::Heartbeat,
            1 => Command::Status,
            2 => Command::Faults,
            3 => Command::Arm,
            4 => Command::Stop,
            5 => Command::Reset,
            6 => Command::Discard,
            7 => Command::Commit,
            8 => Command::Record(a as u32),
            9 => Command::Settings { from: a as u16 },
            10 => Command::Learned { from: a as u16 },
            11 => Command::Draft {
                id: a as u16 & 0x1FFF,
                value: self.value(),
            },
            12 => Command::DirectCurrent {
                motor: a as u8,
                current: b as i32,
            },
            13 => Command::Angle {
                motor: a as u8,
                behind: b as i32,
            },
            14 => Command::Move {
                distance_nm: a as i64,
                velocity: b as i32,
                base: None,
            },
            17 => Command::MoveTo {
                position_nm: a as i64,
                velocity: b as i32,
                base: None,
            },
            18 => Command::Torque {
                motor: a as u8,
                current: b as i32,
                speed: self.number() as i32,
                base: self.number() as i32,
            },
            19 => Command::Stream {
                delay_ms: a as u16,
                homed: b & 1 == 0,
                base: self.number() as i32,
            },
            20 => Command::SetPoint {
                at_us: a as u32,
                position_nm: b as i64,
                velocity: None,
            },
            15 => Command::Journal { after: a as u8 },
            16 => Command::Inject(Injection {
                fault: a as u32,
                motor: b as u8,
                amount: Real::new(f64::from_bits(self.number())),
            }),
            21 => Command::Burst(BurstRequest {
                motor: a as u8 & 3,
                trigger: a as u32 >> 2 & 7,
                signal: a as u32 >> 5 & 7,
                level: b as i32,
                before: (a >> 8) as u16,
                divider: (b >> 32) as u8,
            }),
            22 => Command::EndBurst,
            23 => Command::BurstStatus,
            24 => Command::BurstSamples { from: a as u16 },
            _ => Command::Run {
                velocity: a as i32,
                base: Some(b as i32),
            },
        }
    }
}

/// A message that is these bytes.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}

struct Fake {
    state: State,
    settings: Settings,
    runs: u64,
}

impl Served for Fake {
    fn base_for(&self, _: i32) -> i32 {
        0
    }
    fn home_velocity(&self) -> i32 {
        0
    }
    fn status(&self) -> Status {
        Status::default()
    }
    fn state(&self) -> State {
        self.state
    }
    fn rates(&self) -> (u32, u32) {
        (20_000, 4)
    }
    fn simulated(&self) -> bool {
        true
    }
    fn command(&mut self, _: i32, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn travel(&mut self, _: i64, _: i32, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn travel_to(&mut self, _: i64, _: i32, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn home(&mut self, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn torque(&mut self, _: u8, _: i32, _: i32, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn stream(&mut self, _: u16, _: bool, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn set_point(&mut self, _: u32, _: i64, _: Option<i32>) -> Result<Followed, Refusal> {
        Ok(Followed::default())
    }
    fn direct_current(&mut self, _: u8, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn angle(&mut self, _: u8, _: i32) -> Result<(), Refusal> {
        Ok(())
    }
    fn demand(&mut self, demand: Demand) {
        match demand {
            Demand::Run | Demand::Align => {
                self.runs += 1;
                self.state = State::Running;
            }
            _ => self.state = State::Ready,
        }
    }
    fn renew(&mut self) {}
    fn settings(&self) -> &Settings {
        &self.settings
    }
    fn learned(&self) -> Settings {
        self.settings
    }
    fn configure(&mut self, settings: &Settings) -> Result<Effect, NotSet> {
        let effect = self.settings.effect(settings);
        self.settings = *settings;
        Ok(effect)
    }
    fn store(&mut self) -> Result<(), NotSet> {
        Ok(())
    }
    fn record(&mut self, _: u32) {}
    fn arm_burst(&mut self, _: BurstRequest) -> Result<(), Refusal> {
        Ok(())
    }
    fn end_burst(&mut self) {}
    fn burst(&self) -> BurstStatus {
        BurstStatus::default()
    }
    fn burst_samples(
        &self,
        _: u16,
    ) -> Result<heapless::Vec<BurstSample, SAMPLES_A_FRAME>, Refusal> {
        Err(Refusal::NoBurst)
    }
    fn inject(&mut self, _: Injection) -> Result<(), Refusal> {
        Ok(())
    }
}

/// Two pages of any bytes.
struct Pages(Vec<u8>);

impl ErrorType for Pages {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Pages {
    const READ_SIZE: usize = 1;
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let from = offset as usize;
        let there = self
            .0
            .get(from..from + bytes.len())
            .ok_or(NorFlashErrorKind::OutOfBounds)?;
        bytes.copy_from_slice(there);
        Ok(())
    }
    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Pages {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE;
    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let from = offset as usize;
        self.0[from..from + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

/// A frame of any kind: right, with a right check around any bytes, or damaged.
fn frame(random: &mut Random, session: u32, sequence: u32) -> Vec<u8> {
    let mut buffer = [0; FRAME_MAX];
    let mut bytes = if random.below(3) == 0 {
        let raw: Vec<u8> = (0..random.below(40))
            .map(|_| random.number() as u8)
            .collect();
        encode(&Raw(&raw), &mut buffer).unwrap().to_vec()
    } else {
        let command = match random.below(50) {
            0 => Command::Hello,
            _ => random.command(),
        };
        let host = HostFrame {
            session: match random.below(20) {
                0 => random.number() as u32,
                _ => session,
            },
            sequence: match random.below(10) {
                0 => random.number() as u32,
                _ => sequence,
            },
            command,
        };
        encode(&host, &mut buffer).unwrap().to_vec()
    };
    if random.below(3) == 0 {
        for _ in 0..=random.below(4) {
            let at = random.below(bytes.len());
            match random.below(5) {
                0 => bytes.truncate(at + 1),
                1 => bytes.insert(at, random.next() as u8),
                2 => bytes[at] = random.number() as u8,
                3 => bytes[at] ^= 1 << random.below(8),
                _ => bytes.extend_from_within(at..),
            }
        }
    }
    bytes
}

/// A number that the environment sets.
fn asked(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |number| {
        number
            .parse()
            .unwrap_or_else(|_| panic!("{name} is {number}, expected a number"))
    })
}

/// How many executions, and the random numbers of a test with this number.
fn begin(usual: u64, test: u64) -> (u64, u64, Random) {
    let seed = asked("FUZZ_SEED", 1);
    let state = (seed << 8 | test).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (asked("FUZZ_EXECUTIONS", usual), seed, Random(state))
}

#[test]
fn any_bytes_on_a_line() {
    let (count, seed, mut random) = begin(60_000, 1);
    let (mut server, mut commander) = (Server::new(), Commander::new(7));
    let mut host = Decoder::new();
    let mut drive = Fake {
        state: State::Ready,
        settings: Settings::DEFAULT,
        runs: 0,
    };
    let (mut session, mut sequence, mut now, mut answers) = (0, 0, 0u32, 0u64);
    for execution in 0..count {
        sequence += 1;
        now = now.wrapping_add(random.below(50) as u32);
        let bytes = frame(&mut random, session, sequence);
        let mut replies = Vec::new();
        for &byte in &bytes {
            let (armed, runs) = (commander.is_armed(), drive.runs);
            server.take(byte, now, &mut commander, &mut drive, |answer| {
                replies.push(answer.to_vec());
            });
            assert!(
                armed || drive.runs == runs,
                "seed {seed}, execution {execution}: a drive that is not armed runs after {bytes:?}"
            );
        }
        let ends = bytes.iter().filter(|byte| **byte == 0).count();
        assert!(
            replies.len() <= ends,
            "seed {seed}, execution {execution}: {} answers to {ends} frames",
            replies.len()
        );
        for reply in replies {
            let read = reply.iter().find_map(|&byte| host.take::<DriveFrame>(byte));
            answers += 1;
            match read {
                Some(DriveFrame::Reply(_, Reply::Hello { session: new, .. })) => {
                    (session, sequence) = (new, 0);
                }
                Some(DriveFrame::Reply(..)) => {}
                other => panic!("seed {seed}, execution {execution}: the answer reads {other:?}"),
            }
        }
        commander.look(drive.state, now);
        // Where nobody has a session that is known, one is opened.
        if execution % 50 == 0 {
            session = 0;
            let hello = HostFrame {
                session,
                sequence: 0,
                command: Command::Hello,
            };
            let mut buffer = [0; FRAME_MAX];
            let bytes = [&[0], encode(&hello, &mut buffer).unwrap()].concat();
            let mut answer = Vec::new();
            for byte in bytes {
                server.take(byte, now, &mut commander, &mut drive, |bytes| {
                    answer = bytes.to_vec();
                });
            }
            let read = answer
                .iter()
                .find_map(|&byte| host.take::<DriveFrame>(byte));
            if let Some(DriveFrame::Reply(_, Reply::Hello { session: new, .. })) = read {
                (session, sequence) = (new, 0);
            }
        }
    }
    println!("{count} frames, {answers} answers, {} runs", drive.runs);
    assert!(
        answers > count / 4 && drive.runs > 0,
        "{answers} answers and {} runs in {count} frames: most were damaged before they were tried",
        drive.runs
    );
}

#[test]
fn any_value_of_a_setting() {
    let (count, seed, mut random) = begin(60_000, 2);
    let ids: Vec<u16> = Settings::all().map(|setting| setting.id).collect();
    let mut settings = Settings::DEFAULT;
    let mut taken = 0u64;
    for execution in 0..count {
        let id = match random.below(20) {
            0 => random.number() as u16,
            _ => ids[random.below(ids.len())],
        };
        let (before, value) = (settings, random.value());
        match settings.set(id, value.into()) {
            Ok(()) => {
                taken += 1;
                assert_eq!(
                    settings.get(id),
                    Some(value.into()),
                    "seed {seed}, execution {execution}: setting {id:#x}"
                );
            }
            Err(_) => assert!(
                settings == before,
                "seed {seed}, execution {execution}: {id:#x}, refused, changed something"
            ),
        }
    }
    println!("{count} values, {taken} taken");
    assert!(taken > count / 100, "{taken} of {count} values were taken");
}

/// Where a slot's settings begin, and the place of its check before them (`link::settings::store`).
const HEADER: usize = 16;
const CHECK: std::ops::Range<usize> = 12..HEADER;

/// Makes the check of the first slot right, whatever it says and is long, if it has room for its settings.
fn sealed(bytes: &mut [u8]) -> bool {
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let end = HEADER + length;
    if end > SLOT {
        return false;
    }
    let mut digest = SEAL.digest();
    digest.update(&bytes[4..CHECK.start]);
    digest.update(&bytes[HEADER..end]);
    bytes[CHECK].copy_from_slice(&digest.finalize().to_le_bytes());
    true
}

static SEAL: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

#[test]
fn any_page_of_flash() {
    let (count, seed, mut random) = begin(1200, 3);
    // What a store has written, and then anything.
    let mut store = Store::open(Pages(vec![0xFF; 2 * SLOT]));
    store.save(&Settings::DEFAULT).unwrap();
    let written = store.release().0;
    let end = HEADER + usize::from(u16::from_le_bytes([written[8], written[9]]));
    let (mut whole, mut read) = (0u64, 0u64);
    for execution in 0..count {
        let mut bytes = written.clone();
        for _ in 0..random.below(4) {
            let at = random.below(bytes.len());
            match random.below(3) {
                0 => bytes[at] ^= 1 << random.below(8),
                1 => bytes[at..].fill(0xFF),
                _ => bytes[at] = random.number() as u8,
            }
        }
        match random.below(4) {
            0 => {
                for piece in bytes.chunks_exact_mut(8) {
                    piece.copy_from_slice(&random.next().to_le_bytes());
                }
            }
            // Settings that are none, as firmware of another day may have stored them.
            1 => {
                for _ in 0..=random.below(8) {
                    let at = HEADER + random.below(end - HEADER);
                    match random.below(4) {
                        0 => bytes[at..end].rotate_left(1),
                        1 => bytes[8..10].copy_from_slice(&(random.number() as u16).to_le_bytes()),
                        _ => bytes[at] = random.number() as u8,
                    }
                }
            }
            _ => {}
        }
        let is_sealed = random.below(3) == 0 && sealed(&mut bytes);
        let mut settings = Settings::DEFAULT;
        let loaded = Store::open(Pages(bytes)).load(&mut settings);
        if let Some(loaded) = loaded {
            assert_eq!(
                loaded.refused > 0,
                loaded.first_refused > 0,
                "seed {seed}, execution {execution}: {loaded:?}"
            );
        }
        if loaded.is_none() {
            assert!(
                settings == Settings::DEFAULT || is_sealed,
                "seed {seed}, execution {execution}: pages that hold nothing set something"
            );
        } else if is_sealed {
            read += u64::from(settings != Settings::DEFAULT);
            for (setting, value, _) in settings.differences(&Settings::DEFAULT) {
                assert!(
                    { Settings::DEFAULT }.set(setting.id, value).is_ok(),
                    "seed {seed}, execution {execution}: {setting} is {value:?}, which a drive refuses"
                );
            }
        } else {
            whole += 1;
            assert!(
                settings == Settings::DEFAULT,
                "seed {seed}, execution {execution}: a page that is not whole was believed"
            );
        }
    }
    println!(
        "{count} pairs of pages, {whole} whole, {read} with other settings under a right check"
    );
    assert!(
        0 < whole && whole < count && read > count / 100,
        "{whole} whole and {read} with other settings of {count}"
    );
}
