//! The current loop of one motor on a plant of your own: a winding with a locked rotor, stepped once a PWM period.
//!
//! `cargo run -p control --example own_plant` prints the step response of the torque current, from 0 to 1 A.

use control::current_loop::{CurrentLoop, CurrentReference, Frame, Mode};
use control::exchange::MotorExchange;
use control::format::Current;
use control::motor_io::{MotorIo, Sensing};

#[path = "../../src/board/mains_plate.rs"]
#[allow(dead_code, reason = "the firmware uses the rest")]
mod mains_plate;
#[path = "../../src/board/paper_machine.rs"]
mod paper_machine;

const BUS_V: f64 = 310.0;

/// Phase currents, A, and the compare values that act now and from the next period on.
struct Winding {
    sensing: Sensing,
    amps: [f64; 3],
    acting: [u16; 3],
    written: [u16; 3],
    closed: bool,
}

impl Winding {
    /// One PWM period: L di/dt = v - R i in each phase, against the star point.
    fn period(&mut self) {
        let (board, motor) = (&mains_plate::PLATE.board, &mains_plate::PLATE.motors[1]);
        let top = board.timer_hz / (2.0 * board.pwm_hz);
        let volts = self.acting.map(|counts| BUS_V * f64::from(counts) / top);
        let star = volts.iter().sum::<f64>() / 3.0;
        for (amps, volts) in self.amps.iter_mut().zip(volts) {
            let driven = if self.closed { volts - star } else { 0.0 };
            *amps += (driven - motor.resistance_ohm * *amps) / motor.inductance_h / board.pwm_hz;
        }
        self.acting = self.written;
    }
}

impl MotorIo for Winding {
    fn acknowledge(&mut self) -> bool {
        false
    }
    fn encoder(&mut self) -> u32 {
        0
    }
    fn sensing(&self) -> Sensing {
        self.sensing
    }
    fn current(&mut self) -> [u16; 3] {
        let board = &mains_plate::PLATE.board;
        let counts = |amps: f64| (board.zero_counts + amps / board.amps_per_count).round() as u16;
        self.amps.map(counts)
    }
    fn bus(&mut self) -> u32 {
        (BUS_V / mains_plate::PLATE.board.bus_volts_per_count) as u32
    }
    fn write(&mut self, compare: [u16; 3]) {
        self.written = compare;
    }
    fn close(&mut self) {
        self.closed = true;
    }
    fn open(&mut self) {
        self.closed = false;
    }
    fn clear_break(&mut self) {}
    fn in_time(&mut self) -> bool {
        true
    }
}

/// The torque current of each period, A, after a step of its reference to 1 A.
fn step_response(periods: usize) -> Vec<f64> {
    let mut plate = mains_plate::PLATE;
    // This plant's bridge has no dead time that the drive would have to compensate.
    plate.bridge.dead_time_s = 0.0;
    let config = plate
        .config()
        .expect("the board's plate fits")
        .aligned(&plate);
    let config = &config.current_loops[1];
    let (mut current_loop, exchange) = (CurrentLoop::new(config), MotorExchange::new(config, 4));
    let mut winding = Winding {
        sensing: config.sensing(),
        amps: [0.0; 3],
        acting: [0; 3],
        written: [0; 3],
        closed: false,
    };
    exchange.publish_bus(winding.bus() as u16);
    exchange.expect_bus(config);
    let mut period = |mode| {
        let i_q = Current::ONE;
        let frame = Frame::Rotor;
        exchange.ask(
            CurrentReference {
                mode,
                frame,
                i_d: Current::ZERO,
                i_q,
            },
            config,
        );
        current_loop.period(config, &mut winding, &exchange, || ());
        winding.period();
        config.sense.scale.current(exchange.current().q).to_num()
    };
    period(Mode::Off);
    (0..periods).map(|_| period(Mode::Drive)).collect()
}

fn main() {
    for (period, amps) in step_response(40).iter().enumerate() {
        println!("{period:3}  {amps:+.3} A");
    }
}

/// Ten time constants of the poles (Eq 9: damping times bandwidth) after its first voltage the current is there. The zero of the PI
/// regulator and the delay of a period make the overshoot.
#[test]
fn the_torque_current_follows_its_reference() {
    let plate = &mains_plate::PLATE;
    let amps = step_response(300);
    let first = amps.iter().position(|&amps| amps > 0.05).unwrap();
    let constant_s = 1.0 / (plate.tuning.damping * plate.tuning.current_rad_s);
    let settled = first + (10.0 * constant_s * plate.board.pwm_hz) as usize;
    for late in &amps[settled..] {
        assert!((late - 1.0).abs() < 0.02, "{late} A, expected 1 A");
    }
    let most = amps.iter().copied().fold(0.0, f64::max);
    assert!(
        (1.1..1.4).contains(&most),
        "{most} A at most, expected 1.1 to 1.4 A"
    );
}
