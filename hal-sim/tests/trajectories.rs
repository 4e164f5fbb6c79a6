//! What the drive does on its simulated machines stays the same, bit for bit.
//!
//! `trajectories.txt` has a line for each stage of a script: what a person can read of it, and a digest of all that the drive read and wrote
//! each millisecond until then. A change that is meant to change nothing changes no line. After another one run
//! `UPDATE_TRAJECTORIES=1 cargo test -p hal-sim --test trajectories`, read what differs, and commit the file with the change.

mod commands;
mod digest;

use commands::{base, inject, open, speeds, velocity};
use control::supervisor::State;
use digest::Digest;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::parallel::on_all_cores;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use hal_sim::start::Start;
use link::codes::{ActiveLimits, Misalignment};
use link::host::client::Client;
use link::message::{Command, Injected};
use link::scale;
use link::settings::{Settings, Switch};
use link::telemetry::{FRAME_MAX, Frame, Request};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::fmt::{Debug, Write};
use std::rc::Rc;
use std::time::Duration;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/trajectories.txt");

/// A drive and its commander; what is seen of it adds up in a digest.
struct Session {
    script: &'static str,
    serving: Rc<RefCell<Serving>>,
    client: Client<Within>,
    begun_m: f64,
    digest: Digest,
    lines: String,
}

impl Session {
    fn new(script: &'static str, drive: SimulatedDrive) -> Self {
        let serving = Rc::new(RefCell::new(Serving::new(drive)));
        let client = open(&serving);
        let mut session = Self {
            script,
            serving,
            client,
            begun_m: 0.0,
            digest: Digest::EMPTY,
            lines: String::new(),
        };
        session.begun_m = session.table_m();
        session
    }

    /// A board as it ships, switched on with its rotors anywhere.
    fn cold(script: &'static str, board: BoardKind, change: impl FnOnce(&mut Start)) -> Self {
        Self::of_seed(script, board, 1, change)
    }

    fn of_seed(
        script: &'static str,
        board: BoardKind,
        seed: u64,
        change: impl FnOnce(&mut Start),
    ) -> Self {
        let mut setup = Setup::shipped(board, &Model::coupled(), Coupling::Coupled);
        setup.board.seed = seed;
        let mut start = Start::anywhere(&setup);
        change(&mut start);
        Self::new(script, SimulatedDrive::cold(&start).unwrap())
    }

    /// The paper's motors with a good drive's sensors, aligned, under 400 N.
    fn aligned(script: &'static str) -> Self {
        let setup = Setup::real(Model::coupled(), Coupling::Coupled);
        let mut session = Self::new(script, SimulatedDrive::new(&setup).unwrap());
        session.until(State::Ready, 1000);
        session
    }

    fn table_m(&self) -> f64 {
        let serving = self.serving.borrow();
        serving.drive().drive().board.machine.table_position()
    }

    fn add(&mut self, word: u64) {
        self.digest.add(word.to_le_bytes());
    }

    fn add_text(&mut self, text: &str) {
        text.bytes().for_each(|byte| self.add(byte.into()));
    }

    /// The sentence of an error only: its backtrace is the build's.
    fn add_answer(&mut self, answer: anyhow::Result<impl Debug>) {
        let text = answer.map_or_else(|error| error.to_string(), |said| format!("{said:?}"));
        self.add_text(&text);
    }

    fn millisecond(&mut self) {
        self.client.listen(Duration::ZERO).unwrap();
        let mut bytes = [0; FRAME_MAX];
        while let Some(frame) = self.client.take_telemetry() {
            let frame: &Frame = &frame;
            for byte in frame.encode(&mut bytes).unwrap() {
                self.add((*byte).into());
            }
        }
        let serving = Rc::clone(&self.serving);
        let serving = serving.borrow();
        let drive = serving.drive().drive();
        for axis in Axis::ALL {
            let written = drive.compare(axis);
            for compare in written.compare {
                self.add(compare.into());
            }
            self.add(written.enable.into());
            self.add(drive.sample(axis).encoder.into());
        }
        let (speed, change) = drive.planned();
        self.add(u64::from(speed.to_bits().cast_unsigned()));
        self.add(u64::from(change.to_bits().cast_unsigned()));
        self.add(serving.drive().braked().into());
    }

    fn state(&self) -> State {
        self.serving.borrow().drive().drive().state()
    }

    /// Passes time as a commander who is there.
    fn pass(&mut self, ms: u32) {
        for k in 0..ms {
            if k % 100 == 0 {
                self.client.beat().unwrap();
            }
            self.millisecond();
        }
    }

    fn until(&mut self, state: State, ms: u32) {
        for _ in 0..ms {
            if self.state() == state {
                return;
            }
            self.pass(1);
        }
    }

    /// A refusal counts too.
    fn tell(&mut self, command: Command) {
        let said = self.client.tell(command);
        self.add_answer(said);
    }

    /// Aligns it where it is not; its telemetry counts from then on.
    fn arm(&mut self) {
        for _ in 0..1000 {
            if matches!(self.state(), State::Unaligned | State::Ready) {
                break;
            }
            self.pass(1);
        }
        let request = Request {
            divider: 10,
            stream: 1,
        };
        self.tell(Command::Record(request.word()));
        let said = self.client.arm(|_| true);
        self.add_answer(said);
        self.pass(1);
    }

    fn run(&mut self, mm_s: f64, rpm: f64, ms: u32) {
        self.tell(speeds(mm_s, rpm));
        self.pass(ms);
    }

    fn stop(&mut self) {
        self.tell(Command::Stop);
        self.until(State::Ready, 2000);
        self.pass(100);
    }

    fn inject(&mut self, fault: Injected, motor: u8, amount: f64) {
        self.tell(inject(fault, motor, amount));
    }

    /// The settings with a change, after a restart where it needs one.
    fn set(&mut self, change: impl FnOnce(&mut Settings)) {
        let mut settings = self.client.settings().unwrap();
        change(&mut settings);
        let said = self.client.configure(&settings);
        self.add_answer(said);
        self.pass(500);
    }

    /// Ends a stage: a line of what it did.
    fn stage(&mut self, name: &str) {
        let status = self.client.status().unwrap();
        let text = format!("{status:?}");
        self.add_text(&text);
        let limits = ActiveLimits::of_word(status.limits);
        let limits: Vec<_> = [None, Some(0), Some(1)]
            .into_iter()
            .flat_map(|motor| limits.iter(motor))
            .collect();
        let rpm = |axis: Axis| {
            let serving = self.serving.borrow();
            let machine = &serving.drive().drive().board.machine;
            machine.motor(axis).omega * 60.0 / TAU
        };
        let _ = writeln!(
            self.lines,
            "{}, {name}: {:?}, {:?}, {limits:?}; {} ms; table {:.4} mm; screw {:.1} rpm, nut {:.1} rpm; {:016x}",
            self.script,
            self.state(),
            Misalignment::of_word(status.misalignment),
            status.uptime_ms,
            (self.table_m() - self.begun_m) * 1e3,
            rpm(Axis::Screw),
            rpm(Axis::Nut),
            self.digest.0,
        );
    }

    /// The last stage has what the drive has learned and kept of the run.
    fn end(mut self) -> String {
        let learned = format!("{:?}", self.client.learned().unwrap());
        self.add_text(&learned);
        let journal = format!("{:?}", self.client.journal().unwrap());
        self.add_text(&journal);
        self.stage("end");
        self.lines
    }
}

/// A board from cold: it is aligned, creeps in both drives, moves and rests.
fn from_cold(script: &'static str, board: BoardKind) -> String {
    let mut session = Session::cold(script, board, |_| ());
    session.arm();
    session.stage("aligned");
    session.run(2.5, 0.0, 1000);
    session.stage("single drive");
    session.run(2.5, 600.0, 1500);
    session.stage("double drive");
    session.run(-7.0, -300.0, 1000);
    session.stage("back");
    session.stop();
    session.arm();
    session.tell(Command::Move {
        distance_nm: 1_500_000,
        velocity: velocity(4.0),
        base: None,
    });
    session.pass(1500);
    session.stage("moved");
    session.stop();
    session.end()
}

/// Compensation, disturbance observer and a base speed that wanders, under a load that comes and goes.
fn compensated(script: &'static str, board: BoardKind) -> String {
    let mut session = Session::cold(script, board, |_| ());
    session.set(|settings| {
        *settings = settings.smooth();
        settings.rejection.disturbance_rad_s = 60.0;
    });
    session.arm();
    session.run(2.5, 0.0, 2500);
    session.stage("learned, single drive");
    session.run(2.5, 700.0, 3000);
    session.stage("learned, double drive");
    session.inject(Injected::Load, 0, 60.0);
    session.pass(5000);
    session.stage("loaded");
    session.inject(Injected::Load, 0, 0.0);
    session.pass(1000);
    session.run(-1.0, 200.0, 1500);
    session.stage("back");
    session.stop();
    let learned = session.client.learned().unwrap();
    session.set(|settings| *settings = learned);
    session.arm();
    session.run(2.5, 700.0, 1500);
    session.stage("restarted");
    session.end()
}

/// Home, limits, positions, streams and torques.
fn travels(script: &'static str) -> String {
    let mut session = Session::aligned(script);
    session.set(|settings| {
        let travel = &mut settings.travel;
        (travel.home.velocity_mm_s, travel.home.leaving_mm_s) = (80.0, 2.0);
        travel.home.position_mm = 5.0;
        (travel.soft_least_mm, travel.soft_most_mm) = (10.0, 60.0);
        let brake = &mut settings.brake;
        (brake.fitted, brake.closing_ms, brake.opening_ms) = (Switch::On, 60.0, 80.0);
    });
    session.arm();
    session.tell(Command::Home { base: None });
    session.pass(9000);
    session.stage("homed");
    session.stop();
    session.arm();
    session.tell(Command::MoveTo {
        position_nm: 40_000_000,
        velocity: velocity(30.0),
        base: Some(base(300.0)),
    });
    session.pass(2500);
    session.stage("at 40 mm");
    session.run(50.0, 0.0, 1000);
    session.stage("before its limit");
    session.stop();
    session.arm();
    session.tell(Command::Stream {
        delay_ms: 20,
        homed: false,
        base: 0,
    });
    for ms in 0..1500 {
        if ms % 5 == 0 {
            let position = -1e6 * (1.0 - (TAU * 0.8e-3 * f64::from(ms)).cos());
            let point = Command::SetPoint {
                at_us: ms * 1000,
                position_nm: position.round() as i64,
                velocity: None,
            };
            let _ = session.client.post(point);
        }
        session.millisecond();
    }
    session.stage("streamed");
    session.stop();
    session.arm();
    session.tell(Command::Torque {
        motor: 0,
        current: scale::word(-1.5, scale::CURRENT).unwrap(),
        speed: base(400.0),
        base: base(100.0),
    });
    session.pass(400);
    session.stage("torque");
    session.stop();
    session.end()
}

/// Each fault, injected while the table moves at `mm_s` and the nut at `rpm`; it is cleared, and the drive goes on.
fn faults(script: &'static str, board: BoardKind, [mm_s, rpm]: [f64; 2]) -> String {
    let mut session = Session::cold(script, board, |_| ());
    // There and back, as the travel has ends.
    let mut way = 1.0;
    for (name, fault, motor, amount) in [
        ("driver of the screw", Injected::DriverFault, 0, 0.0),
        ("driver of the nut", Injected::DriverFault, 1, 0.0),
        (
            "encoder of the screw frozen",
            Injected::EncoderFrozen,
            0,
            0.0,
        ),
        ("encoder of the nut frozen", Injected::EncoderFrozen, 1, 0.0),
        ("encoder of the screw slips", Injected::EncoderSlip, 0, 90.0),
        ("encoder of the nut slips", Injected::EncoderSlip, 1, -60.0),
        ("phase a of the screw open", Injected::OpenPhase, 0, 1.0),
        ("phase b of the nut open", Injected::OpenPhase, 1, 2.0),
        ("bus low", Injected::Bus, 0, 5.0),
        ("bus high", Injected::Bus, 0, 1000.0),
        ("load", Injected::Load, 0, 3000.0),
        ("load the other way", Injected::Load, 0, -3000.0),
        ("enable", Injected::EnableOpen, 0, 0.0),
        ("end", Injected::EndForward, 0, 0.0),
        ("other end", Injected::EndBackward, 0, 0.0),
        ("current of the screw", Injected::CurrentOffset, 0, 0.3),
        ("current of the nut", Injected::CurrentOffset, 1, 30.0),
    ] {
        session.arm();
        session.run(way * mm_s, rpm, 700);
        way = -way;
        session.inject(fault, motor, amount);
        session.pass(800);
        session.stage(name);
        session.inject(Injected::Clear, 0, 0.0);
        session.pass(300);
        session.tell(Command::Reset);
        session.pass(500);
    }
    // A commander who is gone.
    session.arm();
    session.run(mm_s, rpm, 500);
    for _ in 0..1500 {
        session.millisecond();
    }
    session.stage("alone");
    session.end()
}

/// Wrong wiring and plates: how arming ends.
fn wirings(script: &'static str, board: BoardKind) -> String {
    type Change = fn(&mut Start);
    let declared: Change = |start| {
        for motor in &mut start.plate.motors {
            motor.encoder.reversed = None;
        }
    };
    let changes: [(&str, Change); 8] = [
        ("directions unknown", |_| ()),
        ("screw's encoder counts down", |start| {
            start.board.wiring.motors[0].encoder_reversed = true;
        }),
        ("nut's legs exchanged", |start| {
            start.board.wiring.motors[1].legs = [1, 0, 2];
        }),
        ("sign of a channel", |start| {
            start.board.wiring.motors[0].signs = [-1.0, 1.0, 1.0];
        }),
        ("channels exchanged", |start| {
            start.board.wiring.motors[1].channels = [1, 0, 2];
        }),
        ("phase open", |start| {
            start.board.wiring.motors[0].open = Some(2);
        }),
        ("encoders exchanged", |start| {
            start.board.wiring.encoders_exchanged = true;
        }),
        ("pole pairs", |start| {
            start.plate.motors[0].pole_pairs += 1;
        }),
    ];
    let mut lines = String::new();
    for (name, change) in changes {
        let mut session = Session::cold(script, board, |start| {
            declared(start);
            change(start);
        });
        session.arm();
        session.stage(name);
        lines += &session.lines;
    }
    lines
}

/// Motors that bear little current for long, and braking against a full bus.
fn limits(script: &'static str) -> String {
    let mut session = Session::cold(script, BoardKind::Mains, |_| ());
    session.set(|settings| {
        for motor in [&mut settings.screw, &mut settings.nut] {
            motor.thermal.rated_current_a_rms = 0.6;
            motor.thermal.thermal_time_s = 2.0;
        }
    });
    session.arm();
    session.run(3.0, 1500.0, 1500);
    session.stage("fast");
    session.inject(Injected::Bus, 0, 379.0);
    session.run(-3.0, -1500.0, 1500);
    session.stage("braked against a full bus");
    session.inject(Injected::Bus, 0, 310.0);
    session.tell(Command::DirectCurrent {
        motor: 0,
        current: scale::word(0.5, scale::CURRENT).unwrap(),
    });
    session.pass(300);
    session.stage("current along d");
    session.inject(Injected::Load, 0, 700.0);
    session.pass(3000);
    session.stage("hot");
    session.pass(4000);
    session.end()
}

#[test]
fn the_drive_does_what_it_did() {
    use BoardKind::{Mains, Nucleo, Nucleo40kHz};
    type Script = (&'static str, fn(&'static str) -> String);
    let scripts: [Script; 13] = [
        ("NUCLEO cold", |name| from_cold(name, Nucleo)),
        ("NUCLEO at 40 kHz cold", |name| from_cold(name, Nucleo40kHz)),
        ("mains cold", |name| from_cold(name, Mains)),
        ("NUCLEO compensated", |name| compensated(name, Nucleo)),
        ("mains compensated", |name| compensated(name, Mains)),
        ("travels", travels),
        ("NUCLEO faults, double", |name| {
            faults(name, Nucleo, [3.0, 500.0])
        }),
        ("mains faults, double", |name| {
            faults(name, Mains, [3.0, 500.0])
        }),
        ("NUCLEO faults, single", |name| {
            faults(name, Nucleo, [40.0, 0.0])
        }),
        ("mains faults, single", |name| {
            faults(name, Mains, [-30.0, 0.0])
        }),
        ("NUCLEO wirings", |name| wirings(name, Nucleo)),
        ("mains wirings", |name| wirings(name, Mains)),
        ("limits", limits),
    ];
    let lines: String = on_all_cores(&scripts, |(name, script)| script(name)).concat();
    if std::env::var_os("UPDATE_TRAJECTORIES").is_some() {
        std::fs::write(FILE, &lines).unwrap();
    }
    let kept = std::fs::read_to_string(FILE).unwrap();
    let mut pairs = kept.lines().zip(lines.lines());
    let differs = pairs.find(|(kept, now)| kept != now);
    assert!(
        differs.is_none() && kept.lines().count() == lines.lines().count(),
        "the first stage that differs, as kept and now: {differs:#?}"
    );
}

/// Both shafts coast after a fault, and creep together from one place where they cog to the next. One of these re-alignments each was refused
/// as a load that moves by itself: the probes began while the shafts coasted, and waited a second at most.
#[test]
fn a_board_aligns_again_soon_after_each_fault() {
    let seeds = [3, 6, 16, 18, 22, 23, 39, 50];
    let states = on_all_cores(&seeds, |&seed| {
        let mut session = Session::of_seed("again", BoardKind::Mains, seed, |_| ());
        session.arm();
        let faults = [
            (Injected::EncoderFrozen, 0),
            (Injected::OpenPhase, 0),
            (Injected::EncoderFrozen, 1),
            (Injected::OpenPhase, 1),
        ];
        let mut states = vec![session.state()];
        for (k, (fault, motor)) in faults.into_iter().enumerate() {
            let way = if k % 2 == 0 { 1.0 } else { -1.0 };
            session.run(3.0 * way, 500.0, 700);
            session.inject(fault, motor, 1.0);
            session.pass(800);
            session.inject(Injected::Clear, 0, 0.0);
            session.pass(300);
            session.tell(Command::Reset);
            session.pass(20 + 120 * (seed % 5) as u32);
            session.arm();
            states.push(session.state());
        }
        states
    });
    for (seed, states) in seeds.iter().zip(&states) {
        assert_eq!(states, &[State::Ready; 5], "seed {seed}");
    }
}
