//! A simulated drive behind the link, from bytes to bytes.

mod commands;

use commands::{base, inject, open, speeds};
use control::fault::Fault;
use control::supervisor::State;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use hal_sim::start::Start;
use link::codes::{ActiveLimits, EventKind, Limit, Origin, Warning};
use link::host::client::Client;
use link::host::refused::Refused;
use link::host::{Decoder, Row};
use link::message::{Command, Injected, Refusal, Reply, Travel};
use link::scale;
use link::settings::{Effect, Setting, Switch, Value};
use link::telemetry::{FRAME_MAX, Frame, Header, Request};
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

struct Bench {
    serving: Rc<RefCell<Serving>>,
    client: Client<Within>,
}

impl Bench {
    fn new() -> Self {
        let setup = Setup::real(Model::coupled(), Coupling::Coupled);
        let serving = Serving::new(SimulatedDrive::new(&setup).unwrap());
        let serving = Rc::new(RefCell::new(serving));
        let client = open(&serving);
        let mut bench = Self { serving, client };
        bench.until(State::Ready, 1000);
        // Longer than a heartbeat may be away, which counts only while somebody commands.
        for _ in 0..700 {
            bench.client.listen(Duration::ZERO).unwrap();
        }
        bench
    }

    fn state(&self) -> State {
        self.serving.borrow().drive().drive().state()
    }

    fn position(&self) -> f64 {
        self.serving
            .borrow()
            .drive()
            .drive()
            .board
            .machine
            .table_position()
    }

    /// Passes time with a heartbeat each 100 ms.
    fn pass(&mut self, ms: u32) {
        for k in 0..ms {
            if k % 100 == 0 {
                self.client.tell(Command::Heartbeat).unwrap();
            }
            self.client.listen(Duration::ZERO).unwrap();
        }
    }

    #[track_caller]
    fn until(&mut self, state: State, ms: u32) {
        for _ in 0..ms {
            if self.state() == state {
                return;
            }
            self.client.listen(Duration::ZERO).unwrap();
        }
        panic!(
            "after {ms} ms the drive is {:?}, expected {state:?}",
            self.state()
        );
    }

    fn run(&mut self, mm_s: f64, rpm: f64) -> anyhow::Result<()> {
        self.client.tell(speeds(mm_s, rpm))
    }
}

fn refusal(result: anyhow::Result<()>) -> Option<Refused> {
    result.unwrap_err().downcast().ok()
}

#[test]
fn an_armed_drive_jogs_and_stops() {
    let mut bench = Bench::new();
    assert_eq!(
        refusal(bench.run(2.5, 300.0)),
        Some(Refused::For(Refusal::NotArmed))
    );
    bench.client.tell(Command::Arm).unwrap();
    assert_eq!(
        refusal(bench.run(101.0, 0.0)),
        Some(Refused::For(Refusal::Velocity))
    );
    assert_eq!(
        refusal(bench.run(1.0, 2999.0)),
        Some(Refused::For(Refusal::MotorSpeed))
    );
    bench.run(2.5, 300.0).unwrap();
    bench.pass(1000);
    let status = bench.client.status().unwrap();
    assert_eq!(status.state, State::Running.word());
    let rpm =
        scale::value(status.motors[1].speed, scale::BASE_SPEED) * 60.0 / std::f64::consts::TAU;
    assert!(
        (rpm - 300.0).abs() < 10.0,
        "measured {rpm} rpm, expected 300 within 10"
    );
    bench.client.tell(Command::Stop).unwrap();
    bench.until(State::Ready, 500);
    let rest = bench.position();
    bench.pass(500);
    // The load of 400 N is the brake's.
    let moved = bench.position() - rest;
    assert!(moved.abs() < 5e-6, "at rest it moved by {moved} m");
    assert!(!bench.client.status().unwrap().armed);
}

#[test]
fn a_move_ends_where_it_should_with_the_nut_standing_or_turning() {
    for (mm, rpm) in [(10.0, 0.0), (-3.0, 500.0), (0.05, 300.0)] {
        let mut bench = Bench::new();
        let start = bench.position();
        bench.client.tell(Command::Arm).unwrap();
        let Command::Run { velocity, base } = speeds(20.0, rpm) else {
            unreachable!()
        };
        bench
            .client
            .tell(Command::Move {
                distance_nm: (mm * 1e6) as i64,
                velocity,
                base,
            })
            .unwrap();
        let mut travel = Travel::Moving.word();
        for _ in 0..60 {
            bench.pass(100);
            travel = bench.client.status().unwrap().travel;
            if travel != Travel::Moving.word() && travel != Travel::Settling.word() {
                break;
            }
        }
        let status = bench.client.status().unwrap();
        assert_eq!(Travel::of_word(travel), Some(Travel::Done), "{status:?}");
        let off = bench.position() - start - mm * 1e-3;
        // Also what the table gave way while the motors took its load of 400 N from the brake.
        assert!(off.abs() < 2e-6, "{mm} mm at {rpm} rpm end {off} m off");
    }
}

#[test]
fn a_host_that_falls_silent_stops_the_machine_within_its_time() {
    let mut bench = Bench::new();
    bench.client.tell(Command::Arm).unwrap();
    bench.run(5.0, 0.0).unwrap();
    bench.pass(300);
    // Its own half second, and the stop.
    for _ in 0..900 {
        bench.serving.borrow_mut().millisecond();
    }
    assert_eq!(bench.state(), State::Fault(Fault::CommandLost));
    // Another one's heartbeat would not have kept it running: see `application::server`. The fault is remembered and left.
    let mut other = open(&bench.serving);
    assert_eq!(other.faults().unwrap()[0].fault, Fault::CommandLost.word());
    other.tell(Command::Reset).unwrap();
    for _ in 0..200 {
        other.listen(Duration::ZERO).unwrap();
    }
    assert_eq!(bench.state(), State::Ready);
}

#[test]
fn faults_put_in_are_found_and_named() {
    for (fault, motor, amount, found) in [
        (Injected::EncoderFrozen, 1, 0.0, Fault::NutEncoder),
        (Injected::EncoderSlip, 0, 60.0, Fault::ScrewAngle),
        (Injected::DriverFault, 1, 0.0, Fault::NutDriver),
        (Injected::Bus, 0, 400.0, Fault::OverVoltage),
        (Injected::Bus, 0, 50.0, Fault::UnderVoltage),
        (Injected::EnableOpen, 0, 0.0, Fault::Disabled),
        (Injected::EndForward, 0, 0.0, Fault::EndForward),
    ] {
        let mut bench = Bench::new();
        bench.client.tell(Command::Arm).unwrap();
        bench.run(5.0, 400.0).unwrap();
        bench.pass(700);
        bench.client.tell(inject(fault, motor, amount)).unwrap();
        bench.pass(900);
        assert_eq!(bench.state(), State::Fault(found), "{}", fault.name());
    }
    // The first cause, its value and limit, and what it led to, in order.
    let mut bench = Bench::new();
    bench.client.tell(inject(Injected::Bus, 0, 400.0)).unwrap();
    bench.until(State::Fault(Fault::OverVoltage), 100);
    bench.pass(5);
    let journal = bench.client.journal().unwrap();
    let kinds: Vec<_> = journal
        .iter()
        .map(|event| (event.kind, event.code))
        .collect();
    let (kind, state) = (EventKind::word, |state: State| {
        (EventKind::State.word(), state.word())
    });
    assert_eq!(
        kinds[..3],
        [
            state(State::Fault(Fault::OverVoltage)),
            (kind(EventKind::Fault), Fault::OverVoltage.word()),
            state(State::Ready),
        ],
        "{journal:#?}"
    );
    let [value, limit] = journal[1].values;
    assert!(value > limit && limit > 0, "{value} counts, limit {limit}");
    assert_eq!(kinds.last().unwrap().0, kind(EventKind::Start));
    let mut bench = Bench::new();
    assert_eq!(
        refusal(bench.client.tell(inject(Injected::Bus, 0, f64::NAN))),
        Some(Refused::For(Refusal::Injection))
    );
}

#[test]
fn a_fault_stays_until_a_reset_after_its_cause() {
    let mut bench = Bench::new();
    let fault = State::Fault(Fault::OverVoltage);
    bench.client.tell(inject(Injected::Bus, 0, 400.0)).unwrap();
    bench.until(fault, 100);
    bench.client.tell(Command::Reset).unwrap();
    bench.pass(300);
    assert_eq!(bench.state(), fault, "while its cause is there");
    bench.client.tell(inject(Injected::Clear, 0, 0.0)).unwrap();
    bench.pass(300);
    assert_eq!(bench.state(), fault, "an old reset leaves it");
    bench.client.tell(Command::Reset).unwrap();
    bench.until(State::Ready, 300);
    // Nor does it leave the next one.
    bench.client.tell(inject(Injected::Bus, 0, 400.0)).unwrap();
    bench.until(fault, 200);
    bench.client.tell(inject(Injected::Clear, 0, 0.0)).unwrap();
    bench.pass(300);
    assert_eq!(bench.state(), fault);
}

#[test]
fn settings_hold_after_a_restart_and_what_does_not_fit_changes_nothing() {
    let mut bench = Bench::new();
    let mut settings = bench.client.settings().unwrap();
    let set = |settings: &mut link::settings::Settings, name: &str, value: f64| {
        let id = Setting::named(name).unwrap().id;
        settings.set(id, Value::Real(value)).unwrap();
    };
    let mut wrong = settings;
    set(&mut wrong, "tuning.damping", 0.8);
    set(&mut wrong, "nut.resistance_line_to_line_ohm", 90.0);
    let error = bench.client.configure(&wrong).unwrap_err().to_string();
    assert!(
        error.starts_with(
            "nut.resistance_line_to_line_ohm = 90 does not fit: current-loop gain Kpc"
        ),
        "{error}"
    );
    assert_eq!(bench.client.settings().unwrap(), settings);

    set(&mut settings, "feed.velocity_max_mm_s", 4.0);
    bench.client.configure(&settings).unwrap();
    assert_eq!(bench.client.settings().unwrap(), settings);
    bench.until(State::Ready, 1000);
    bench.client.tell(Command::Arm).unwrap();
    assert_eq!(
        refusal(bench.run(5.0, 0.0)),
        Some(Refused::For(Refusal::Velocity))
    );
    bench.run(3.0, 0.0).unwrap();
    bench.pass(100);
    assert_eq!(
        refusal(bench.client.configure(&settings)),
        Some(Refused::For(Refusal::Moving))
    );
}

/// What the speed task runs with: the screw's proportional gain.
fn gain(bench: &Bench) -> f64 {
    let serving = bench.serving.borrow();
    serving.drive().configured().drive.speed_loops[0]
        .k_pw
        .to_num()
}

#[test]
fn a_gain_changes_while_the_table_moves() {
    let mut bench = homed();
    bench.client.tell(Command::Stop).unwrap();
    bench.until(State::Ready, 1000);
    bench.client.tell(Command::Arm).unwrap();
    bench.run(2.5, 300.0).unwrap();
    bench.until(State::Running, 100);
    bench.pass(1000);
    let origin = bench.client.status().unwrap().origin;
    let before = gain(&bench);

    let mut settings = bench.client.settings().unwrap();
    settings.tuning.speed_rad_s *= 0.5;
    assert_eq!(bench.client.change(&settings).unwrap(), Effect::AtOnce);
    let after = gain(&bench);
    assert!(
        (after / before - 0.5).abs() < 1e-3,
        "gain {before}, then {after}, expected half"
    );
    bench.pass(1000);
    let status = bench.client.status().unwrap();
    assert_eq!(status.state, State::Running.word());
    assert!(origin.is_some() && status.origin == origin, "{status:?}");
    assert_eq!(status.runs_on, Origin::Changed.word());
    assert_eq!(
        refusal(bench.client.store()),
        Some(Refused::For(Refusal::Moving))
    );

    // What has state in the speed task waits until the drive rests. It restarts nothing.
    settings.rejection.disturbance_rad_s = 40.0;
    let refused = bench.client.change(&settings).map(drop);
    assert_eq!(refusal(refused), Some(Refused::For(Refusal::Moving)));
    bench.client.tell(Command::Stop).unwrap();
    bench.until(State::Ready, 1000);
    assert_eq!(bench.client.change(&settings).unwrap(), Effect::AtRest);
    bench.client.store().unwrap();
    let status = bench.client.status().unwrap();
    assert_eq!(
        (status.origin, status.runs_on),
        (origin, Origin::Stored.word())
    );
    let serving = bench.serving.borrow();
    assert!(serving.drive().configured().drive.disturbance[0].active);
}

/// Peak to peak of the table's velocity over a second at 2.5 mm/s, m/s.
fn ripple(bench: &mut Bench) -> f64 {
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for _ in 0..1000 {
        bench.pass(1);
        let serving = bench.serving.borrow();
        let velocity = serving.drive().drive().board.machine.table_velocity();
        ends = [ends[0].min(velocity), ends[1].max(velocity)];
    }
    ends[1] - ends[0]
}

#[test]
fn a_setting_switches_the_compensation_on() {
    let mut bench = Bench::new();
    let mut settings = bench.client.settings().unwrap();
    let mut ripples = [0.0; 2];
    for (learning_s, ripple_m_s) in [0.0, 1.0].into_iter().zip(&mut ripples) {
        settings.compensation.learning_s = learning_s;
        bench.client.configure(&settings).unwrap();
        bench.until(State::Ready, 1000);
        bench.client.tell(Command::Arm).unwrap();
        bench.run(2.5, 0.0).unwrap();
        bench.pass(8000);
        *ripple_m_s = ripple(&mut bench);
        bench.client.tell(Command::Stop).unwrap();
        bench.until(State::Ready, 500);
    }
    assert!(
        ripples[1] < 0.2 * ripples[0],
        "with it {} m/s, without {}, expected less than a fifth",
        ripples[1],
        ripples[0]
    );
}

/// Tables of compensation and recordings use the rotors' angles. Both would be wrong if an index moved a count later.
#[test]
fn a_drive_that_is_ready_after_a_restart_has_passed_its_indexes() {
    let setup = Setup::shipped(BoardKind::Mains, &Model::coupled(), Coupling::Coupled);
    let drives = [
        SimulatedDrive::new(&setup),
        SimulatedDrive::cold(&Start::anywhere(&setup)),
    ];
    for drive in drives {
        let serving = Rc::new(RefCell::new(Serving::new(drive.unwrap())));
        let client = open(&serving);
        let mut bench = Bench { serving, client };
        // The second start is a restart, which finds the shafts elsewhere.
        for learning_s in [0.0, 0.5] {
            let mut settings = bench.client.settings().unwrap();
            settings.compensation.learning_s = learning_s;
            bench.client.configure(&settings).unwrap();
            bench.pass(2000);
            bench.client.arm(|_| true).unwrap();
            bench.until(State::Ready, 1000);
            let before = bench.client.status().unwrap();
            bench.run(2.5, 500.0).unwrap();
            bench.pass(1000);
            let after = bench.client.status().unwrap();
            assert_eq!(after.state, State::Running.word());
            for (before, after) in before.motors.into_iter().zip(after.motors) {
                assert_eq!(before.alignment, after.alignment);
            }
            bench.client.tell(Command::Stop).unwrap();
            bench.until(State::Ready, 1000);
        }
    }
}

/// Rows of a second, and the bytes of all that came.
fn recorded(seed: u64) -> (Vec<Row>, Vec<u8>) {
    let mut setup = Setup::real(Model::coupled(), Coupling::Coupled);
    setup.board.seed = seed;
    let serving = Rc::new(RefCell::new(Serving::new(
        SimulatedDrive::new(&setup).unwrap(),
    )));
    let client = open(&serving);
    let mut bench = Bench { serving, client };
    bench.until(State::Ready, 1000);
    bench.client.tell(Command::Arm).unwrap();
    bench.run(2.5, 300.0).unwrap();
    let request = Request {
        divider: 1,
        stream: 9,
    };
    bench.client.tell(Command::Record(request.word())).unwrap();
    bench.pass(1000);
    let (mut decoder, mut rows, mut bytes) = (Decoder::new(request), Vec::new(), Vec::new());
    while let Some(frame) = bench.client.take_telemetry() {
        let mut buffer = [0; FRAME_MAX];
        let frame: &Frame = &frame;
        let frame = frame.encode(&mut buffer).unwrap();
        bytes.extend_from_slice(frame);
        decoder
            .take(frame, |_: &Header, row| {
                rows.push(*row);
                Ok::<(), ()>(())
            })
            .unwrap();
    }
    assert_eq!(decoder.count().lost, 0);
    (rows, bytes)
}

#[test]
fn the_same_commands_at_the_same_times_give_the_same_bits() {
    let (rows, bytes) = recorded(3);
    // 5 kHz, but for what the answer to the request took.
    assert!((4990..=5100).contains(&rows.len()), "{} rows", rows.len());
    assert!(rows.last().unwrap().motors[1].angle_rad > 10.0);
    assert_eq!(recorded(3).1, bytes);
    assert_ne!(recorded(4).1, bytes);
}

/// A drive whose table is homed, its switch at 5 mm, with soft limits of 10 and 60 mm.
fn homed() -> Bench {
    let mut bench = Bench::new();
    let mut settings = bench.client.settings().unwrap();
    let travel = &mut settings.travel;
    (travel.home.velocity_mm_s, travel.home.leaving_mm_s) = (80.0, 2.0);
    travel.home.position_mm = 5.0;
    (travel.soft_least_mm, travel.soft_most_mm) = (10.0, 60.0);
    bench.client.configure(&settings).unwrap();
    bench.until(State::Ready, 1000);
    assert_eq!(bench.client.status().unwrap().origin, None);
    bench.client.tell(Command::Arm).unwrap();
    bench.client.tell(Command::Home { base: None }).unwrap();
    let mut travel = Travel::Homing.word();
    for _ in 0..200 {
        bench.pass(100);
        travel = bench.client.status().unwrap().travel;
        if travel != Travel::Homing.word() {
            break;
        }
    }
    assert_eq!(Travel::of_word(travel), Some(Travel::Homed));
    bench
}

impl Bench {
    /// The homed position, mm.
    fn place_mm(&mut self) -> Option<f64> {
        let status = self.client.status().unwrap();
        let count_nm = self.client.settings().unwrap().feed.scale_count_nm;
        let counts = status.scale.wrapping_sub(status.origin?);
        Some(f64::from(counts) * count_nm * 1e-6)
    }
}

#[test]
fn a_homed_table_stands_before_its_soft_limits() {
    let mut bench = homed();
    // The switch is 100 mm behind where the table was switched on, which the machine calls 0.
    let off = bench.position() * 1e3 - (bench.place_mm().unwrap() - 105.0);
    assert!(off.abs() < 5e-3, "homed {off} mm off");
    for (mm_s, rpm, least, most) in [
        // What the latency and the loops' lag leave: 15 ms at each velocity, and 0.1 mm.
        (100.0, 0.0, 58.4, 60.0),
        (-30.0, 800.0, 10.0, 10.6),
        (5.0, 0.0, 59.8, 60.0),
    ] {
        bench.run(mm_s, rpm).unwrap();
        for _ in 0..200 {
            bench.pass(50);
            let at = bench.position() * 1e3 + 105.0;
            assert!(at < 60.0 && (at > 10.0 || mm_s > 0.0), "at {at} mm");
        }
        let at = bench.place_mm().unwrap();
        assert!(
            (least..most).contains(&at),
            "from {mm_s} mm/s it stands at {at} mm"
        );
        let limits = ActiveLimits::of_word(bench.client.status().unwrap().limits);
        assert!(limits.iter(None).any(|limit| limit == Limit::Travel));
        assert!(matches!(bench.state(), State::Running | State::Holding));
    }
    let Command::Run { velocity, base } = speeds(20.0, 0.0) else {
        unreachable!()
    };
    let far = |distance_nm| Command::Move {
        distance_nm,
        velocity,
        base,
    };
    assert_eq!(
        refusal(bench.client.tell(far(1_000_000))),
        Some(Refused::For(Refusal::SoftLimit))
    );
    bench.client.tell(far(-1_000_000)).unwrap();
}

#[test]
fn a_homed_table_goes_to_a_position_and_one_that_is_not_homed_does_not() {
    let to = |position_nm| {
        let Command::Run { velocity, base } = speeds(20.0, 0.0) else {
            unreachable!()
        };
        Command::MoveTo {
            position_nm,
            velocity,
            base,
        }
    };
    let mut bench = Bench::new();
    bench.client.tell(Command::Arm).unwrap();
    assert_eq!(
        refusal(bench.client.tell(to(12_500_000))),
        Some(Refused::For(Refusal::NotHomed))
    );
    bench.pass(100);
    assert_eq!(bench.state(), State::Ready, "nothing moves");

    let mut bench = homed();
    for (mm, nm) in [(32.5, 32_500_000), (12.25, 12_250_000)] {
        bench.client.tell(to(nm)).unwrap();
        bench.pass(3000);
        let status = bench.client.status().unwrap();
        assert_eq!(Travel::of_word(status.travel), Some(Travel::Done));
        let at = bench.place_mm().unwrap();
        assert!((at - mm).abs() < 2e-3, "it stands at {at} mm, not {mm}");
    }
    for (nm, refused) in [
        (61_000_000, Refusal::SoftLimit),
        (9_000_000, Refusal::SoftLimit),
        (i64::MIN, Refusal::Distance),
        (i64::MAX, Refusal::Distance),
    ] {
        let said = refusal(bench.client.tell(to(nm)));
        assert_eq!(said, Some(Refused::For(refused)), "{nm} nm");
    }
}

#[test]
fn a_table_that_is_pushed_past_its_limit_is_a_fault_and_homing_outlives_it_but_no_encoder_s() {
    let mut bench = homed();
    bench.run(20.0, 0.0).unwrap();
    bench.pass(4000);
    // More than both motors hold: 2.6 N m on 5 mm a turn are 3267 N.
    bench
        .client
        .tell(inject(Injected::Load, 0, -3600.0))
        .unwrap();
    bench.pass(400);
    assert_eq!(bench.state(), State::Fault(Fault::TravelForward));
    bench.client.tell(inject(Injected::Clear, 0, 0.0)).unwrap();
    bench.client.tell(Command::Reset).unwrap();
    bench.until(State::Ready, 500);
    let at = bench.place_mm().unwrap();
    assert!(at > 60.0, "at {at} mm");
    bench.client.tell(Command::Arm).unwrap();
    bench.run(-20.0, 0.0).unwrap();
    bench.pass(1000);
    assert_eq!(bench.state(), State::Running, "back it goes");
    bench
        .client
        .tell(inject(Injected::EncoderFrozen, 0, 0.0))
        .unwrap();
    bench.pass(500);
    assert_eq!(bench.state(), State::Fault(Fault::ScrewEncoder));
    assert_eq!(bench.place_mm(), None);
}

#[test]
fn a_switch_that_stays_closed_or_open_is_told_and_the_other_one_stops_it() {
    let mut bench = Bench::new();
    let mut settings = bench.client.settings().unwrap();
    settings.travel.home.furthest_mm = 3.0;
    bench.client.configure(&settings).unwrap();
    bench.until(State::Ready, 1000);
    for (fault, told) in [
        (Injected::Clear, Travel::SwitchNotFound),
        (Injected::EndBackward, Travel::SwitchNotLeft),
    ] {
        bench.client.tell(inject(fault, 0, 0.0)).unwrap();
        bench.client.tell(Command::Arm).unwrap();
        bench.client.tell(Command::Home { base: None }).unwrap();
        bench.pass(4000);
        assert_eq!(
            Travel::of_word(bench.client.status().unwrap().travel),
            Some(told)
        );
        assert_eq!(bench.place_mm(), None);
        bench.client.tell(Command::Stop).unwrap();
        bench.until(State::Ready, 500);
    }
    // Off a switch whose wire is broken the table goes towards the other.
    bench.client.tell(Command::Arm).unwrap();
    bench.client.tell(Command::Home { base: None }).unwrap();
    bench.pass(300);
    bench
        .client
        .tell(inject(Injected::EndForward, 0, 0.0))
        .unwrap();
    bench.pass(500);
    assert_eq!(bench.state(), State::Fault(Fault::EndForward));
}

/// The load of 400 N falls wherever neither motors nor brake hold it.
#[test]
fn a_brake_holds_the_load_until_the_motors_do_and_they_until_it_does() {
    let mut bench = Bench::new();
    let mut settings = bench.client.settings().unwrap();
    let brake = &mut settings.brake;
    brake.load_drives_back = Switch::On;
    bench.client.configure(&settings).unwrap();
    let warned = |bench: &mut Bench| {
        let journal = bench.client.journal().unwrap();
        let warnings = journal
            .iter()
            .filter(|event| event.kind == EventKind::Warning.word());
        warnings.map(|event| event.code).collect::<Vec<_>>()
    };
    assert_eq!(warned(&mut bench), [Warning::NoBrake.word()]);
    let brake = &mut settings.brake;
    (brake.fitted, brake.closing_ms, brake.opening_ms) = (Switch::On, 60.0, 80.0);
    bench.client.configure(&settings).unwrap();
    assert_eq!(warned(&mut bench).len(), 1, "with a brake there is none");
    bench.until(State::Ready, 1000);

    let begun = bench.position();
    bench.client.tell(Command::Arm).unwrap();
    bench.run(5.0, 300.0).unwrap();
    bench.until(State::Holding, 50);
    bench.pass(75);
    assert_eq!(bench.state(), State::Holding, "while the brake lets go");
    bench.until(State::Running, 20);
    let gave_way = bench.position() - begun;
    assert!(
        gave_way.abs() < 60e-6,
        "it gave way by {gave_way} m as the motors took it"
    );
    bench.pass(300);

    bench.client.tell(Command::Stop).unwrap();
    let stands = |bench: &Bench| {
        let serving = bench.serving.borrow();
        let machine = &serving.drive().drive().board.machine;
        machine.motor(plant::Axis::Nut).omega.abs() < 0.5
    };
    let mut held_ms = 0;
    let mut rest = 0.0;
    for _ in 0..1000 {
        bench.client.listen(Duration::ZERO).unwrap();
        if bench.state() == State::Ready {
            break;
        }
        if stands(&bench) {
            if held_ms == 10 {
                rest = bench.position();
            }
            held_ms += 1;
        }
    }
    assert!((55..120).contains(&held_ms), "held for {held_ms} ms");
    bench.pass(300);
    let fell = bench.position() - rest;
    assert!(fell.abs() < 5e-6, "it fell by {fell} m");
}

/// The default machine, just switched on: its load is held, arming aligns it, and it moves.
#[test]
fn a_cold_drive_is_aligned_by_arming_and_keeps_its_table() {
    let setup = Setup::real(Model::coupled(), Coupling::Coupled);
    let start = hal_sim::start::Start::anywhere(&setup);
    let drive = SimulatedDrive::cold(&start).unwrap();
    let serving = Rc::new(RefCell::new(Serving::new(drive)));
    let client = open(&serving);
    let mut bench = Bench { serving, client };
    bench.until(State::Unaligned, 1000);
    let before = bench.position();
    bench.pass(2000);
    assert_eq!(bench.state(), State::Unaligned, "nothing is demanded");
    assert_eq!(
        refusal(bench.run(2.5, 0.0)),
        Some(Refused::For(Refusal::Unaligned))
    );
    let state = bench.client.arm(|_| true).unwrap();
    assert_eq!(state, State::Ready);
    let moved = bench.position() - before;
    assert!(moved.abs() < 50e-6, "the table moved by {moved} m");
    bench.run(2.5, 300.0).unwrap();
    bench.pass(1000);
    assert_eq!(bench.state(), State::Running);
}

/// A torque for a motor, N m, within a speed; the other turns at `other_rpm`.
fn torque(motor: u8, nm: f64, limit_rpm: f64, other_rpm: f64) -> Command {
    // The paper's motors: five pole pairs of 0.11 Wb.
    let current = scale::word(nm / 0.55, scale::CURRENT).unwrap();
    Command::Torque {
        motor,
        current,
        speed: base(limit_rpm),
        base: base(other_rpm),
    }
}

impl Bench {
    /// The load is the table's own friction.
    fn unloaded() -> Self {
        let mut bench = Self::new();
        let none = inject(Injected::Load, 0, 0.0);
        bench.client.tell(none).unwrap();
        bench.client.tell(Command::Arm).unwrap();
        bench
    }

    fn rpm(&self, axis: plant::Axis) -> f64 {
        let serving = self.serving.borrow();
        let machine = &serving.drive().drive().board.machine;
        machine.motor(axis).omega * 60.0 / std::f64::consts::TAU
    }

    fn angle_deg(&self, axis: plant::Axis) -> f64 {
        let serving = self.serving.borrow();
        let machine = &serving.drive().drive().board.machine;
        machine.motor(axis).theta.to_degrees()
    }
}

#[test]
fn a_motor_has_its_torque_up_to_its_speed_while_the_other_stands() {
    use plant::Axis::{Nut, Screw};
    for (motor, way, turns, stands) in [
        (0, 1.0, Screw, Nut),
        (0, -1.0, Screw, Nut),
        (1, 1.0, Nut, Screw),
        (1, -1.0, Nut, Screw),
    ] {
        let mut bench = Bench::unloaded();
        let before = bench.angle_deg(stands);
        let asked = torque(motor, 1.0 * way, 400.0, 0.0);
        bench.client.tell(asked).unwrap();
        bench.until(State::Running, 50);
        bench.pass(8);
        let status = bench.client.status().unwrap();
        let i_q = scale::value(status.motors[usize::from(motor)].current[1], scale::CURRENT);
        let off = i_q - way / 0.55;
        assert!(
            off.abs() < 0.05,
            "{turns:?}: {i_q} A, expected {} A",
            way / 0.55
        );
        let rpm = bench.rpm(turns);
        assert!(
            rpm * way > 20.0 && rpm * way < 390.0,
            "{turns:?} at {rpm} rpm"
        );
        let mut fastest = 0.0f64;
        for _ in 0..600 {
            bench.pass(1);
            fastest = fastest.max(bench.rpm(turns) * way);
        }
        let rpm = bench.rpm(turns);
        assert!((rpm * way - 400.0).abs() < 8.0, "{turns:?} at {rpm} rpm");
        assert!(fastest < 420.0, "{turns:?} was at {fastest} rpm");
        let turned = bench.angle_deg(stands) - before;
        assert!(
            turned.abs() < 3.0,
            "the {stands:?} turned by {turned} degrees"
        );
        assert_eq!(bench.state(), State::Running);

        // A smaller torque the other way brakes it, and turns it back.
        bench
            .client
            .tell(torque(motor, -0.8 * way, 200.0, 0.0))
            .unwrap();
        bench.pass(1000);
        let rpm = bench.rpm(turns);
        assert!((rpm * way + 200.0).abs() < 8.0, "{turns:?} at {rpm} rpm");
        // Less than friction holds.
        bench.client.tell(torque(motor, 0.0, 200.0, 0.0)).unwrap();
        bench.pass(1500);
        let rpm = bench.rpm(turns);
        assert!(rpm.abs() < 20.0, "{turns:?} at {rpm} rpm");
        bench.client.tell(Command::Stop).unwrap();
        bench.until(State::Ready, 1000);
    }
}

#[test]
fn beside_a_torque_the_other_motor_turns_at_its_speed_and_a_run_takes_over() {
    use plant::Axis::{Nut, Screw};
    let mut bench = Bench::unloaded();
    bench.client.tell(torque(0, 0.9, 600.0, 300.0)).unwrap();
    bench.pass(1000);
    let [screw, nut] = [bench.rpm(Screw), bench.rpm(Nut)];
    assert!((screw - 600.0).abs() < 12.0, "the screw at {screw} rpm");
    assert!((nut - 300.0).abs() < 12.0, "the nut at {nut} rpm");
    bench.run(5.0, 300.0).unwrap();
    let mut slowest = f64::MAX;
    for _ in 0..1000 {
        bench.pass(1);
        slowest = slowest.min(bench.rpm(Nut));
    }
    let [screw, nut] = [bench.rpm(Screw), bench.rpm(Nut)];
    assert!((screw - 360.0).abs() < 12.0, "the screw at {screw} rpm");
    assert!((nut - 300.0).abs() < 12.0, "the nut at {nut} rpm");
    assert!(slowest > 280.0, "the nut was at {slowest} rpm");
    assert_eq!(bench.state(), State::Running);
}

#[test]
fn a_torque_that_is_not_allowed_is_refused_and_nothing_moves() {
    let mut bench = Bench::new();
    let begun = bench.position();
    let unarmed = refusal(bench.client.tell(torque(0, 0.5, 100.0, 0.0)));
    assert_eq!(unarmed, Some(Refused::For(Refusal::NotArmed)));
    bench.client.tell(Command::Arm).unwrap();
    for (asked, refused) in [
        (torque(0, 2.7, 100.0, 0.0), Refusal::Current),
        (torque(2, 0.1, 100.0, 0.0), Refusal::Current),
        (torque(1, 0.1, 0.0, 0.0), Refusal::MotorSpeed),
        (torque(1, 0.1, -100.0, 0.0), Refusal::MotorSpeed),
        (torque(0, 0.1, 3100.0, 0.0), Refusal::MotorSpeed),
        // 100 mm/s on a lead of 5 mm are 1200 rpm.
        (torque(0, 0.1, 1000.0, -300.0), Refusal::Velocity),
        (torque(0, 0.1, 100.0, 4000.0), Refusal::Velocity),
    ] {
        let said = refusal(bench.client.tell(asked));
        assert_eq!(said, Some(Refused::For(refused)), "{asked:?}");
    }
    bench.pass(200);
    assert_eq!(bench.state(), State::Ready);
    let moved = bench.position() - begun;
    assert!(moved.abs() < 1e-6, "it moved by {moved} m");
}

#[test]
fn a_torque_does_not_push_the_table_past_a_soft_limit() {
    for (motor, nm, rpm, least, most) in [
        (0, 1.2, 1000.0, 57.0, 60.0),
        (1, 1.0, 600.0, 10.0, 12.0),
        (0, -0.9, 300.0, 10.0, 12.0),
        (1, -1.2, 1000.0, 57.0, 60.0),
    ] {
        let mut bench = homed();
        bench.client.tell(inject(Injected::Load, 0, 0.0)).unwrap();
        let Command::Run { velocity, base } = speeds(50.0, 0.0) else {
            unreachable!()
        };
        let middle = Command::MoveTo {
            position_nm: 35_000_000,
            velocity,
            base,
        };
        bench.client.tell(middle).unwrap();
        bench.pass(2000);
        bench.client.tell(torque(motor, nm, rpm, 0.0)).unwrap();
        for _ in 0..3000 {
            bench.pass(1);
            let at = bench.position() * 1e3 + 105.0;
            assert!(at > 10.0 && at < 60.0, "at {at} mm");
        }
        let at = bench.place_mm().unwrap();
        assert!(
            (least..most).contains(&at),
            "{nm} N m of motor {motor}: it stands at {at} mm"
        );
        let state = bench.state();
        assert!(
            matches!(state, State::Running | State::Holding),
            "{state:?}"
        );
        let limits = ActiveLimits::of_word(bench.client.status().unwrap().limits);
        assert!(limits.iter(None).any(|limit| limit == Limit::Travel));
        // Away from it the torque acts.
        bench.client.tell(torque(motor, -nm, 100.0, 0.0)).unwrap();
        bench.pass(500);
        let now = bench.place_mm().unwrap();
        assert!((now - at).abs() > 1.0, "from {at} mm to {now} mm");
    }
}

#[test]
fn a_motor_with_a_torque_comes_to_rest_when_its_host_is_gone_at_an_end_and_on_a_stop() {
    let pushed = || {
        let mut bench = Bench::unloaded();
        bench.client.tell(torque(0, 1.0, 500.0, 0.0)).unwrap();
        bench.pass(400);
        assert!(bench.rpm(plant::Axis::Screw) > 400.0);
        bench
    };
    let rests = |bench: &Bench| {
        let rpm = bench.rpm(plant::Axis::Screw);
        assert!(rpm.abs() < 5.0, "the bridges opened at {rpm} rpm");
    };
    let bench = pushed();
    for _ in 0..1200 {
        bench.serving.borrow_mut().millisecond();
        if matches!(bench.state(), State::Fault(_)) {
            break;
        }
    }
    assert_eq!(bench.state(), State::Fault(Fault::CommandLost));
    rests(&bench);

    let mut bench = pushed();
    let at_end = inject(Injected::EndForward, 0, 0.0);
    bench.client.tell(at_end).unwrap();
    bench.until(State::Fault(Fault::EndForward), 500);
    rests(&bench);
    bench.client.tell(Command::Reset).unwrap();
    bench.until(State::Ready, 500);
    bench.client.tell(Command::Arm).unwrap();
    bench.client.tell(torque(0, 1.0, 500.0, 0.0)).unwrap();
    bench.pass(100);
    assert_eq!(
        bench.state(),
        State::Fault(Fault::EndForward),
        "asked again"
    );

    let mut bench = pushed();
    let mut other = open(&bench.serving);
    let commanded = refusal(other.tell(torque(0, -1.0, 500.0, 0.0)));
    assert_eq!(commanded, Some(Refused::For(Refusal::Commanded)));
    other.tell(Command::Stop).unwrap();
    bench.until(State::Ready, 1000);
    rests(&bench);
    bench.pass(300);
    assert_eq!(bench.state(), State::Ready, "nothing goes on by itself");
    let unarmed = refusal(bench.client.tell(torque(0, 1.0, 500.0, 0.0)));
    assert_eq!(unarmed, Some(Refused::For(Refusal::NotArmed)));
}

/// A stream of a way, m, by seconds, with a set-point each 5 ms.
struct Streaming {
    bench: Bench,
    begun: f64,
    /// What the drive says that the table was behind, nm, and how early set-points came, us.
    errors_nm: Vec<f64>,
    ahead_us: Vec<f64>,
    refused: Vec<Refusal>,
    /// The table's place each millisecond, m.
    places: Vec<f64>,
}

const SPACING_MS: u32 = 5;

fn set_point(ms: u32, position_m: f64) -> Command {
    Command::SetPoint {
        at_us: ms * 1000,
        position_nm: (position_m * 1e9).round() as i64,
        velocity: None,
    }
}

fn stream(delay_ms: u16, homed: bool) -> Command {
    Command::Stream {
        delay_ms,
        homed,
        base: 0,
    }
}

impl Streaming {
    fn open(mut bench: Bench, delay_ms: u16) -> Self {
        bench.client.tell(Command::Arm).unwrap();
        let begun = bench.position();
        bench.client.tell(stream(delay_ms, false)).unwrap();
        bench.until(State::Holding, 50);
        bench.pass(50);
        Self {
            bench,
            begun,
            errors_nm: Vec::new(),
            ahead_us: Vec::new(),
            refused: Vec::new(),
            places: Vec::new(),
        }
    }

    fn millisecond(&mut self) {
        self.bench.client.listen(Duration::ZERO).unwrap();
        self.places.push(self.bench.position() - self.begun);
        while let Some((_, answer)) = self.bench.client.take_answer() {
            match answer {
                Reply::Followed { ahead_us, error_nm } => {
                    self.errors_nm.push(error_nm.into());
                    self.ahead_us.push(ahead_us.into());
                }
                Reply::Refused(word) => self.refused.extend(Refusal::of_word(word)),
                other => panic!("{other:?}"),
            }
        }
    }

    /// Each set-point comes so much after its time, in their order.
    fn run(&mut self, way: impl Fn(f64) -> f64, ms: u32, mut late_ms: impl FnMut(u32) -> u32) {
        let (mut next, mut due) = (0, 0);
        for now in 0..ms {
            while next <= now {
                due = due.max(next + late_ms(next));
                if due > now {
                    break;
                }
                let point = set_point(next, way(f64::from(next) * 1e-3));
                self.bench.client.post(point).unwrap();
                next += SPACING_MS;
            }
            self.millisecond();
        }
    }
}

/// 1 mm to either side, four seconds a period: up to 1.6 mm/s.
fn creep(seconds: f64) -> f64 {
    1e-3 * (1.0 - (std::f64::consts::TAU * 0.25 * seconds).cos())
}

#[test]
fn a_streamed_sine_is_followed() {
    let mut streaming = Streaming::open(Bench::new(), 20);
    streaming.run(creep, 8000, |_| 0);
    assert_eq!(streaming.refused, []);
    // After what the table gave way as the motors took its load of 400 N from the brake: ripple and encoder errors.
    let errors = streaming.errors_nm.iter().skip(60);
    let worst = errors.fold(0.0f64, |worst, error| worst.max(error.abs()));
    assert!(worst < 4000.0, "{worst} nm behind by the drive");
    assert!(
        streaming
            .ahead_us
            .iter()
            .all(|us| (19e3..=21e3).contains(us))
    );
    // The table by itself, at the time that suits best.
    let behind = |shift_ms: f64| {
        let places = streaming.places.iter().enumerate().skip(300);
        let off = places.map(|(ms, place)| place - creep((ms as f64 - shift_ms) * 1e-3));
        off.fold(0.0f64, |worst, off| worst.max(off.abs()))
    };
    let best = (0..400)
        .map(|k| behind(0.1 * f64::from(k)))
        .fold(f64::MAX, f64::min);
    assert!(best < 4e-6, "{best} m off at the best time");
    println!("drive {worst} nm, table {best} m");
    assert_eq!(streaming.bench.state(), State::Running);
}

/// Up to 10 ms late, so 5 ms to either side of what the first are: no velocity of the table differs.
#[test]
fn a_stream_s_jitter_is_not_in_the_table_s_velocity() {
    let places = |jitter: bool| {
        let mut streaming = Streaming::open(Bench::new(), 20);
        let mut state = 1u32;
        streaming.run(creep, 4000, |ms| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if jitter && ms > 0 {
                (state >> 16) % 11
            } else {
                5
            }
        });
        assert_eq!(streaming.refused, []);
        streaming.places
    };
    let [even, late] = [places(false), places(true)];
    let velocities = |places: &[f64]| -> Vec<f64> {
        places
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) * 1e3)
            .collect()
    };
    let off = velocities(&even).into_iter().zip(velocities(&late));
    let worst = off.fold(0.0f64, |worst, (a, b)| worst.max((a - b).abs()));
    println!("{worst} m/s");
    assert!(worst < 5e-6, "the jitter makes {worst} m/s");
}

#[test]
fn a_stream_that_stalls_comes_to_rest_without_a_fault() {
    for beats in [true, false] {
        let mut streaming = Streaming::open(Bench::new(), 20);
        streaming.run(|seconds| 20e-3 * seconds, 500, |_| 0);
        assert_eq!(streaming.bench.state(), State::Running);
        let mut ms = 0;
        while streaming.bench.state() == State::Running {
            streaming.millisecond();
            ms += 1;
            assert!(ms < 30, "no stop after {ms} ms");
        }
        while streaming.bench.state() != State::Ready {
            streaming.millisecond();
            ms += 1;
            assert!(ms < 200, "{:?} after {ms} ms", streaming.bench.state());
        }
        println!("at rest after {ms} ms");
        let rest = streaming.bench.position();
        for _ in 0..10 {
            if beats {
                streaming.bench.pass(100);
            } else {
                (0..100).for_each(|_| streaming.bench.serving.borrow_mut().millisecond());
            }
            assert_eq!(streaming.bench.state(), State::Ready);
        }
        let moved = streaming.bench.position() - rest;
        assert!(moved.abs() < 5e-6, "at rest it moved by {moved} m");
        let status = streaming.bench.client.status().unwrap();
        assert_eq!(Travel::of_word(status.travel), Some(Travel::StreamEnded));
        assert!(status.armed && status.fault == 0, "{status:?}");
        // What comes now is late, and moves nothing.
        let late = refusal(streaming.bench.client.tell(set_point(505, 10e-3)));
        assert_eq!(late, Some(Refused::For(Refusal::NoStream)));
        // A run is not ended by the stream that was.
        streaming.bench.run(2.5, 0.0).unwrap();
        streaming.bench.pass(500);
        assert_eq!(streaming.bench.state(), State::Running);
    }
}

#[test]
fn a_stream_that_is_not_allowed_is_refused_and_nothing_moves() {
    let mut bench = Bench::new();
    let begun = bench.position();
    let said = |bench: &mut Bench, command: Command| refusal(bench.client.tell(command));
    for (arms, command, refused) in [
        (false, stream(20, false), Refusal::NotArmed),
        (false, set_point(0, 0.0), Refusal::NoStream),
        (true, set_point(0, 0.0), Refusal::NoStream),
        (true, stream(20, true), Refusal::NotHomed),
        (true, stream(4, false), Refusal::Delay),
        (true, stream(201, false), Refusal::Delay),
    ] {
        if arms {
            bench.client.tell(Command::Arm).unwrap();
        }
        assert_eq!(
            said(&mut bench, command),
            Some(Refused::For(refused)),
            "{command:?}"
        );
    }
    bench.client.tell(stream(20, false)).unwrap();
    bench.pass(300);
    assert_eq!(
        said(&mut bench, set_point(0, 1e-3)),
        Some(Refused::For(Refusal::Step))
    );
    // The first is taken, the next are not; it ends in its place.
    assert!(matches!(
        bench.client.ask(set_point(0, 0.0)).unwrap(),
        Reply::Followed { .. }
    ));
    for (point, refused) in [
        (set_point(5, 501e-6), Refusal::Step),
        (set_point(60, 0.0), Refusal::Spacing),
        (set_point(0, 0.0), Refusal::Spacing),
    ] {
        assert_eq!(said(&mut bench, point), Some(Refused::For(refused)));
    }
    let mut other = open(&bench.serving);
    let commanded = refusal(other.tell(set_point(5, 0.0)));
    assert_eq!(commanded, Some(Refused::For(Refusal::Commanded)));
    bench.until(State::Ready, 200);
    let moved = bench.position() - begun;
    assert!(moved.abs() < 60e-6, "it moved by {moved} m");

    let mut bench = homed();
    bench.client.tell(stream(20, true)).unwrap();
    let outside = said(&mut bench, set_point(0, 9e-3));
    assert_eq!(outside, Some(Refused::For(Refusal::SoftLimit)));
}

#[test]
fn a_stream_ends_with_its_host_a_stop_of_any_client_or_a_fault() {
    // Its host goes before the first set-point.
    let streaming = Streaming::open(Bench::new(), 20);
    let place = streaming.bench.position();
    for _ in 0..700 {
        streaming.bench.serving.borrow_mut().millisecond();
    }
    assert_eq!(streaming.bench.state(), State::Fault(Fault::CommandLost));
    let moved = streaming.bench.position() - place;
    assert!(moved.abs() < 5e-6, "it moved by {moved} m");

    let mut streaming = Streaming::open(Bench::new(), 20);
    streaming.run(creep, 600, |_| 0);
    open(&streaming.bench.serving).tell(Command::Stop).unwrap();
    for ms in 600..900 {
        if ms % SPACING_MS == 0 {
            let point = set_point(ms, creep(f64::from(ms) * 1e-3));
            streaming.bench.client.post(point).unwrap();
        }
        streaming.millisecond();
    }
    assert_eq!(streaming.bench.state(), State::Ready);
    let ended = |refusal: &Refusal| matches!(refusal, Refusal::NoStream | Refusal::Commanded);
    assert!(streaming.refused.len() > 50 && streaming.refused.iter().all(ended));

    let mut streaming = Streaming::open(Bench::new(), 20);
    streaming.run(creep, 600, |_| 0);
    let at_end = inject(Injected::EndForward, 0, 0.0);
    streaming.bench.client.tell(at_end).unwrap();
    streaming.bench.until(State::Fault(Fault::EndForward), 300);
    let status = streaming.bench.client.status().unwrap();
    assert_eq!(Travel::of_word(status.travel), Some(Travel::Ended));
}
