//! Bursts of the simulated drive: its words period for period, faults without a host, and tones above the telemetry's rate.

use application::burst::{Burst, Motor};
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::supervisor::State;
use hal_sim::drive::Drive;
use hal_sim::experiment::Setup;
use hal_sim::seam::Seam;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use hal_sim::vrf::spectrum;
use link::burst::{BurstRequest, BurstSample, BurstState, SAMPLES, Signal, Trigger};
use link::host::burst::{COLUMNS, Wanted};
use link::host::client::Client;
use link::host::refused::Refused;
use link::message::{Command, Injected, Injection, Refusal, Reply};
use link::scale::{self, SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use link::telemetry::{Real, rounded};
use link::view::DriveView;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::time::Duration;

struct Bench {
    serving: Rc<RefCell<Serving>>,
    client: Client<Within>,
}

impl Bench {
    /// A drive that runs at 2.5 mm/s and 300 rpm.
    fn running() -> Self {
        let setup = Setup::real(Model::coupled(), Coupling::Coupled);
        let serving = Serving::new(SimulatedDrive::new(&setup).unwrap());
        let serving = Rc::new(RefCell::new(serving));
        let client = Client::open(Within::open(&serving)).unwrap();
        let mut bench = Self { serving, client };
        bench.pass(200);
        bench.client.tell(Command::Arm).unwrap();
        bench
            .client
            .tell(Command::Run {
                velocity: scale::word(2.5e-3, scale::TABLE_VELOCITY).unwrap(),
                base: scale::word(300.0 * TAU / 60.0, scale::BASE_SPEED),
            })
            .unwrap();
        bench.pass(500);
        assert_eq!(bench.state(), State::Running);
        bench
    }

    fn state(&self) -> State {
        self.serving.borrow().drive().drive().state()
    }

    /// Passes time with a heartbeat each 50 ms.
    fn pass(&mut self, ms: u32) {
        for k in 0..ms {
            if k % 50 == 0 {
                self.client.tell(Command::Heartbeat).unwrap();
            }
            self.client.listen(Duration::ZERO).unwrap();
        }
    }

    fn going(&mut self) -> BurstState {
        BurstState::of_word(self.client.burst().unwrap().state).unwrap()
    }

    fn arm(&mut self, motor: u8, what: &str, before_percent: f64) {
        let wanted: Wanted = what.parse().unwrap();
        let request = wanted.request(motor, before_percent, 1).unwrap();
        self.client.tell(Command::Burst(request)).unwrap();
    }

    fn samples(&mut self) -> Vec<BurstSample> {
        let mut all = Vec::new();
        while all.len() < SAMPLES {
            let from = u16::try_from(all.len()).unwrap();
            match self.client.ask(Command::BurstSamples { from }).unwrap() {
                Reply::BurstSamples(some) => all.extend(some),
                other => panic!("{other:?}"),
            }
        }
        all
    }
}

/// What the current loop of `axis` knows now, as a sample has it.
fn truth(drive: &SimulatedDrive, axis: Axis) -> BurstSample {
    let exchange = drive.drive().exchange(axis);
    let sense = &drive.configured().drive.current_loops[axis.index()].sense;
    let current = |i: i32| rounded(i, SAMPLE_CURRENT_DROPS);
    // The upper halves of the loop's words are kept.
    let upper = |word: i32| word & !0xFFFF;
    let [a, b, _] = sense.phases(exchange.codes().map(upper));
    let scaled = |mut i: control::format::ScaledCurrent| {
        i.0 = upper(i.0);
        current(sense.scale.current(i).to_bits())
    };
    let voltage = drive.drive().ended_voltage(axis);
    BurstSample {
        encoder: exchange.encoder(),
        phases: [a, b].map(|i| current(i.to_bits())),
        i_q: scaled(exchange.current().q),
        i_q_ref: scaled(exchange.reference().q),
        // In 2^-6 V.
        voltage: [voltage.d, voltage.q].map(|u| u.to_bits() >> 12 << 12 >> SAMPLE_VOLTAGE_DROPS),
    }
}

#[test]
fn a_burst_is_what_the_current_loop_knew_period_for_period() {
    for axis in Axis::ALL {
        let mut bench = Bench::running();
        bench.arm(axis.index() as u8, "ia_a>0", 40.0);
        let mut all = Vec::new();
        {
            let mut serving = bench.serving.borrow_mut();
            let drive = serving.drive_mut();
            let mut asked = truth(drive, axis).i_q_ref;
            for _ in 0..1500 {
                drive.period();
                let period = drive.drive().exchange(axis).periods();
                let mut now = truth(drive, axis);
                if axis == Axis::Screw {
                    // The speed task follows the screw's loop, which had the reference before.
                    std::mem::swap(&mut now.i_q_ref, &mut asked);
                }
                all.push((period, now));
            }
        }
        bench.pass(100);
        let status = bench.client.burst().unwrap();
        assert_eq!(status.state, BurstState::Complete.word());
        assert!(status.before > 0, "{status:?}");
        // The first periods went by while the answer to the arming came.
        let first = status.period - u32::from(status.before);
        let samples = bench.samples();
        let mut compared = 0;
        for (period, truth) in &all {
            if let Some(sample) = samples.get(period.wrapping_sub(first) as usize) {
                assert_eq!(sample, truth, "{axis:?}, period {period}");
                compared += 1;
            }
        }
        assert!(compared > SAMPLES - 100, "{compared} samples compared");
        // The current of phase a rises through zero at the trigger, and alternates.
        let a: Vec<i32> = samples.iter().map(|sample| sample.phases[0]).collect();
        let trigger = usize::from(status.before);
        assert!(
            a[trigger - 1] < 0 && a[trigger] >= 0,
            "{:?}",
            &a[trigger - 1..=trigger]
        );
        assert!(a.iter().any(|a| *a < -100) && a.iter().any(|a| *a > 100));
        let moved = samples
            .windows(2)
            .filter(|pair| pair[0].encoder != pair[1].encoder);
        assert!(moved.count() > SAMPLES / 2);

        // The host's columns are the same in units.
        let settings = bench.client.settings().unwrap();
        let burst = bench.client.read_burst(&settings).unwrap();
        assert_eq!((burst.before, burst.interval_s), (trigger, 50e-6));
        let amps = scale::value(a[7], scale::CURRENT - SAMPLE_CURRENT_DROPS);
        assert_eq!(burst.rows[7][1], amps);
        let speed = COLUMNS
            .iter()
            .position(|name| *name == Signal::Speed.name());
        let speeds = burst.column(speed.unwrap());
        let mean = speeds.iter().sum::<f64>() / SAMPLES as f64;
        let asked = if axis == Axis::Nut { 300.0 } else { 330.0 };
        assert!((mean - asked).abs() < 15.0, "{axis:?} turns at {mean} rpm");
    }
}

/// Armed by a host that then goes: the fault comes with nobody there, and another host reads what led to it.
#[test]
fn a_fault_s_burst_takes_no_host() {
    let mut bench = Bench::running();
    bench.arm(1, "fault", 90.0);
    let gone = std::mem::replace(
        &mut bench.client,
        Client::open(Within::open(&bench.serving)).unwrap(),
    );
    // Its line closes, and nobody sends heartbeats: the drive stops by a fault.
    drop(gone);
    for _ in 0..2000 {
        bench.serving.borrow_mut().millisecond();
    }
    assert_eq!(bench.state(), State::Fault(Fault::CommandLost));
    let mut later = Client::open(Within::open(&bench.serving)).unwrap();
    let status = later.burst().unwrap();
    assert_eq!(
        BurstState::of_word(status.state),
        Some(BurstState::Complete)
    );
    let settings = later.settings().unwrap();
    let burst = later.read_burst(&settings).unwrap();
    assert_eq!((burst.rows.len(), burst.before), (SAMPLES, 460));
    let reference = |row: &[f64; COLUMNS.len()]| row[4].abs();
    let before = burst.rows[..400].iter().map(reference).fold(0.0, f64::max);
    assert!(before > 0.05, "the motor was driven before: {before} A");
}

#[test]
fn a_burst_is_refused_with_a_sentence_and_outlives_its_session() {
    let mut bench = Bench::running();
    let refused = |result: anyhow::Error| result.downcast::<Refused>().unwrap();
    let settings = bench.client.settings().unwrap();
    let none = bench.client.read_burst(&settings).unwrap_err();
    assert_eq!(refused(none), Refused::For(Refusal::NoBurst));
    let level: Wanted = "iq_a>8".parse().unwrap();
    let request = level.request(0, 50.0, 1).unwrap();
    bench.client.tell(Command::Burst(request)).unwrap();
    let mut other = Client::open(Within::open(&bench.serving)).unwrap();
    let second = other.tell(Command::Burst(request)).unwrap_err();
    assert_eq!(refused(second), Refused::For(Refusal::BurstWaits));
    let early = other.read_burst(&settings).unwrap_err();
    assert!(
        early.to_string().contains("There is no complete burst"),
        "{early:#}"
    );
    assert_eq!(bench.going(), BurstState::Waiting);
    // Arming a burst moved nothing and stopped nothing.
    assert_eq!(bench.state(), State::Running);
    // A change of the drive's state is what another waits for.
    other.tell(Command::EndBurst).unwrap();
    bench.arm(0, "state", 50.0);
    bench.client.tell(Command::Stop).unwrap();
    bench.pass(100);
    assert_eq!(bench.going(), BurstState::Complete);
    let wrong = BurstRequest {
        motor: 2,
        ..request
    };
    let wrong = bench.client.tell(Command::Burst(wrong)).unwrap_err();
    assert_eq!(refused(wrong), Refused::For(Refusal::Burst));
    assert_eq!(bench.going(), BurstState::Complete);
}

/// An injected step of a current's offset is passed by the level in the period in which the drive measures it.
#[test]
fn an_injected_step_of_current_triggers() {
    let mut bench = Bench::running();
    bench.client.tell(Command::Stop).unwrap();
    bench.pass(800);
    assert_eq!(bench.state(), State::Ready);
    bench.arm(0, "ia_a>1", 25.0);
    bench.pass(60);
    assert_eq!(bench.going(), BurstState::Waiting);
    bench
        .client
        .tell(Command::Inject(Injection {
            fault: Injected::CurrentOffset.word(),
            motor: 0,
            amount: Real::new(2.0),
        }))
        .unwrap();
    bench.pass(60);
    let settings = bench.client.settings().unwrap();
    let burst = bench.client.read_burst(&settings).unwrap();
    let a = burst.column(1);
    assert_eq!(burst.before, 128);
    assert!(a[..128].iter().all(|a| a.abs() < 0.2), "{:?}", &a[..128]);
    assert!((a[128] - 2.0).abs() < 0.2, "{} A", a[128]);
}

/// A tone on the current of phase a, and the burst of the screw.
struct Tone<'a> {
    hz: f64,
    amps: f64,
    passed: f64,
    burst: &'a Burst,
    view: &'a DriveView,
}

impl Seam for Tone<'_> {
    fn currents(&mut self, axis: Axis, amps: &mut [f64; 3]) {
        if axis == Axis::Screw {
            amps[0] += self.amps * (TAU * self.hz * self.passed).sin();
            self.passed += 50e-6;
        }
    }

    fn looped(&mut self, _: Axis, exchange: &MotorExchange) {
        self.burst.after_period(exchange, self.view);
    }
}

/// The telemetry of 5 kHz would show it at another frequency, or not at all.
#[test]
fn a_tone_above_the_telemetry_s_rate_stands_at_its_frequency() {
    let setup = Setup::real(Model::coupled(), Coupling::Coupled);
    let plate = setup.plate();
    let config = plate.config().unwrap();
    for hz in [2200.0, 3200.0, 8100.0] {
        let (burst, view) = (Burst::new(), DriveView::new());
        let mut drive = Drive::new(&setup.model, setup.coupling, setup.board, &plate).unwrap();
        let mut tone = Tone {
            hz,
            amps: 0.5,
            passed: 0.0,
            burst: &burst,
            view: &view,
        };
        (0..400).for_each(|_| drive.period_through(&mut tone));
        let motor = Motor {
            config: &config.current_loops[0],
            pwm_hz: 20_000,
        };
        let request = BurstRequest {
            trigger: Trigger::Now.word(),
            divider: 1,
            ..BurstRequest::default()
        };
        let both = Axis::ALL.map(|axis| drive.exchange(axis));
        burst.arm(request, both, motor, &view).unwrap();
        (0..SAMPLES).for_each(|_| drive.period_through(&mut tone));
        let mut amps = Vec::new();
        while amps.len() < SAMPLES {
            let from = u16::try_from(amps.len()).unwrap();
            let some = burst.samples(from, &config.current_loops).unwrap();
            amps.extend(some.iter().map(|sample| {
                scale::value(sample.phases[0], scale::CURRENT - SAMPLE_CURRENT_DROPS)
            }));
        }
        let lines = spectrum(&amps, 20e3);
        let (at, amplitude) = lines
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!((at - hz).abs() < 20.0, "{at} Hz, expected {hz}");
        assert!((amplitude - 0.5).abs() < 0.1, "{amplitude} A");
    }
}
