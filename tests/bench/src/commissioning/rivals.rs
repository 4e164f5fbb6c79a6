//! How two other drives measure a winding, on the same machines.
//!
//! | drive | resistance | inductance |
//! | --- | --- | --- |
//! | ODrive 0.5 (`Motor::measure_phase_resistance`, `measure_phase_inductance`) | an integrator of 10 V/s per A takes the current along phase a to the calibration current in 3 s; the voltage over it | the voltage alternates at the control rate; its half swing over the current's change |
//! | VESC (`mcpwm_foc_measure_resistance`) | a current at a held angle by the current loop, after it has settled; mean voltage over mean current | another procedure, of pulses: not here |
//!
//! ODrive compensates no dead time. VESC compensates it by the current's sign, as this drive does; here with the right dead time.

use control::current_loop::PwmCommand;
use hal_sim::board::Board;
use hal_sim::start::{Start, settle};
use plant::Axis;
use plant::machine::Coupling;

/// What was measured of a motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rivals {
    /// ODrive's resistance, inductance and VESC's resistance, % off.
    pub odrive_r_percent: f64,
    /// See above.
    pub odrive_l_percent: f64,
    /// See above.
    pub vesc_r_percent: f64,
}

/// V/s per A.
const ODRIVE_GAIN: f64 = 10.0;
const ODRIVE_R_S: f64 = 3.0;
/// Control periods of a period of its voltage: it measures and applies once in a period of 125 us; here in two of the PWM.
const ODRIVE_HOLD: u32 = 2;
const ODRIVE_CYCLES: u32 = 1000;
/// VESC waits, and then takes its means.
const VESC_SETTLE_S: f64 = 1.0;
const VESC_MEAN_S: f64 = 0.1;
/// Test current, of the rated one.
const OF_RATED: f64 = 0.9;

/// One motor driven by voltages along phase a.
struct Bench {
    board: Board,
    axis: Axis,
    bus_v: f64,
    period: f64,
    seconds: f64,
    per_count: f64,
    zero: f64,
}

impl Bench {
    fn new(start: &Start, axis: Axis) -> Self {
        let mut config = start.board;
        config.wiring = hal_sim::wiring::Wiring::right();
        let mut board = Board::new(&start.model, Coupling::Coupled, config);
        settle(&mut board, start.angles);
        Self {
            board,
            axis,
            bus_v: config.bus_v,
            period: f64::from(config.period()),
            seconds: config.pwm_period_s(),
            per_count: config.sensors.current.per_count,
            zero: config.sensors.current.zero,
        }
    }

    /// A PWM period under `volts` along phase a: the current along it at its beginning, A.
    fn period(&mut self, volts: f64) -> f64 {
        let mut current = 0.0;
        for axis in Axis::ALL {
            let sample = self.board.turn(axis);
            if axis == self.axis {
                current = (f64::from(sample.current[0]) - self.zero) * self.per_count;
                // Phases b and c take half of it each.
                let duty = |part: f64| {
                    let duty = 0.5 + part * volts / self.bus_v;
                    (duty.clamp(0.02, 0.98) * self.period).round() as u16
                };
                let compare = [duty(2.0 / 3.0), duty(-1.0 / 3.0), duty(-1.0 / 3.0)];
                self.board.write(
                    axis,
                    PwmCommand {
                        compare,
                        enable: true,
                    },
                );
            }
            self.board.advance();
        }
        current
    }
}

/// What the others measure of the motor of `axis`. `volts` along phase a between it and the others joined are those of
/// one and a half phases.
#[must_use]
pub fn rivals(start: &Start, axis: Axis) -> Rivals {
    let truth = start.model.motor(axis);
    let rated = start.plate.motors[axis.index()].thermal.rated_rms_a;
    let amps = OF_RATED * 2f64.sqrt() * rated;
    // The voltage of phase a against the star's point is two thirds of what lies between a and the others.
    let phase = 2.0 / 3.0;
    let mut bench = Bench::new(start, axis);
    let mut volts = 0.0;
    for _ in 0..(ODRIVE_R_S / bench.seconds) as u32 {
        let current = bench.period(volts);
        volts += ODRIVE_GAIN * bench.seconds * (amps - current) / phase;
    }
    let odrive_r = volts * phase / amps;

    let mut bench = Bench::new(start, axis);
    let test = odrive_r * amps / phase;
    let mut sums = [0.0; 2];
    for _ in 0..ODRIVE_CYCLES {
        for (sum, sign) in sums.iter_mut().zip([-1.0, 1.0]) {
            // A compare value acts a period after it was written: by then the voltage before has acted for its whole hold.
            for _ in 1..ODRIVE_HOLD {
                bench.period(sign * test);
            }
            *sum += bench.period(sign * test);
        }
    }
    let change = (sums[1] - sums[0]) / f64::from(ODRIVE_CYCLES);
    let held = f64::from(ODRIVE_HOLD) * bench.seconds;
    let odrive_l = test * phase / (change.abs() / held);

    let mut bench = Bench::new(start, axis);
    let dead_v = start.board.dead_time_s / bench.seconds * bench.bus_v;
    let (mut integral, mut sum_v, mut sum_i, mut count) = (0.0, 0.0, 0.0, 0.0);
    let (settle, all) = (
        (VESC_SETTLE_S / bench.seconds) as u32,
        ((VESC_SETTLE_S + VESC_MEAN_S) / bench.seconds) as u32,
    );
    let mut asked = 0.0;
    for k in 0..all {
        // All three phases lose it: a by the sign of its current, b and c by the other.
        let lost = if k == 0 { 0.0 } else { dead_v * 2.0 };
        let current = bench.period(asked / phase + lost);
        let error = amps * (f64::from(k) / f64::from(settle / 2)).min(1.0) - current;
        integral += 200.0 * truth.resistance_ohm * error * bench.seconds;
        asked = integral + 0.5 * truth.resistance_ohm * error;
        if k >= settle {
            (sum_v, sum_i, count) = (sum_v + asked, sum_i + current, count + 1.0);
        }
    }
    let vesc_r = (sum_v / count) / (sum_i / count);
    let percent = |measured: f64, truth: f64| 100.0 * (measured / truth - 1.0);
    Rivals {
        odrive_r_percent: percent(odrive_r, truth.resistance_ohm),
        odrive_l_percent: percent(odrive_l, truth.inductance_h),
        vesc_r_percent: percent(vesc_r, truth.resistance_ohm),
    }
}
