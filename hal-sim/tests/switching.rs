//! Bridges that switch, beside closed forms and beside bridges of mean voltages.

use control::current_loop::PwmCommand;
use hal_sim::board::{Board, BoardConfig};
use hal_sim::boards::BoardKind;
use hal_sim::sensors::Adc;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::leg::{DeadTime, Period, lost_part};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

const BOARDS: [BoardKind; 2] = [BoardKind::Mains, BoardKind::Nucleo];

/// Board and model whose motors stand: heavy rotors.
fn standing(kind: BoardKind, config: BoardConfig) -> (Board, Model) {
    let mut model = kind.machine(&Model::paper(), Coupling::Lumped);
    for axis in Axis::ALL {
        model.motor_mut(axis).inertia_kg_m2 *= 1e6;
        model.motor_mut(axis).torque_harmonics.clear();
    }
    model.feed.load_n = 0.0;
    (Board::new(&model, Coupling::Lumped, config), model)
}

/// Passes `periods` with compare values on the screw. Phase currents at each end of half a period, A.
fn driven(board: &mut Board, compare: [u16; 3], periods: u32) -> Vec<[f64; 3]> {
    let mut currents = Vec::new();
    for _ in 0..periods {
        board.write(
            Axis::Screw,
            PwmCommand {
                compare,
                enable: true,
            },
        );
        board.turn(Axis::Screw);
        for _ in 0..2 {
            board.advance();
            currents.push(board.machine.phase_currents(Axis::Screw));
        }
    }
    currents
}

fn switched(kind: BoardKind) -> BoardConfig {
    BoardConfig {
        switching: Some(Switching {
            diode_v: 0.0,
            ..Switching::usual()
        }),
        ..kind.config()
    }
}

/// Duties `d`, `1 - d`, `1 - d` put two thirds of the bus on phase a for two pulses of `(2 d - 1) T / 2` each. They lie between zero
/// vectors of equal lengths. So at the top and at the bottom the current is its mean.
#[test]
fn samples_at_the_top_are_the_mean_of_a_rippling_current() {
    for kind in BOARDS {
        let config = BoardConfig {
            dead_time_s: 0.0,
            ..switched(kind)
        };
        let (mut board, model) = standing(kind, config);
        let top = config.period();
        for duty in [0.501, 0.503, 0.506] {
            let compare =
                [duty, 1.0 - duty, 1.0 - duty].map(|duty| (duty * f64::from(top)).round());
            let [a, b, _] = compare.map(|counts| counts / f64::from(top));
            let motor = model.motor(Axis::Screw);
            let expected = 2.0 / 3.0 * config.bus_v * (a - b) / motor.resistance_ohm;
            let seconds = 20.0 * motor.inductance_h / motor.resistance_ohm;
            let periods = (seconds / config.pwm_period_s()) as u32;
            let currents = driven(&mut board, compare.map(|counts| counts as u16), periods);
            for [amps, ..] in &currents[currents.len() - 2..] {
                assert!(
                    (amps / expected - 1.0).abs() < 2e-3,
                    "{kind:?}, duty {duty}: {amps:.4} A at top and bottom, expected {expected:.4} A"
                );
            }
        }
    }
}

/// A leg loses by its dead time what the closed form of its charge says, at currents of both signs and below the turning current. The mean
/// bridge is that closed form. A bridge that switches is as far from it as a dead time moves the currents.
#[test]
fn a_leg_that_switches_loses_what_the_mean_one_loses() {
    const SMALL: f64 = 1e-3;
    for kind in BOARDS {
        for (name, config) in [("edges", switched(kind)), ("mean", kind.config())] {
            let (mut board, model) = standing(kind, config);
            let standing = Standing::of(&model, &config);
            let motor = model.motor(Axis::Screw);
            let seconds = 20.0 * motor.inductance_h / motor.resistance_ohm;
            let periods = (seconds / config.pwm_period_s()) as u32;
            for more in [1e-3, 3e-3, 6e-3, 1e-2, 1.5e-2] {
                for more in [more, -more] {
                    let top = f64::from(config.period());
                    let compare =
                        [0.5 + more, 0.5 - more, 0.5 - more].map(|duty| (duty * top).round());
                    let currents = driven(&mut board, compare.map(|counts| counts as u16), periods);
                    let amps = currents[currents.len() - 1];
                    let duties = compare.map(|counts| counts / top);
                    let found = standing.measured(duties, amps);
                    let off = match config.switching {
                        Some(_) => standing.moved_a(duties, amps),
                        None => 0.0,
                    };
                    let [least, most] = standing.expected(duties, amps, off);
                    let case = format!("{kind:?}, {name}, {:.4} A", amps[0]);
                    println!("{case}: {found:.4}, expected {least:.4} to {most:.4}");
                    assert!(
                        found > least - SMALL && found < most + SMALL,
                        "{case}: {found:.4} of a dead time, expected {least:.4} to {most:.4}"
                    );
                }
            }
        }
    }
}

/// What the screw's phase a loses while it stands.
struct Standing {
    dead_time: DeadTime,
    /// Voltage of a current, of the bus, 1/A.
    resistance_part: f64,
}

impl Standing {
    fn of(model: &Model, config: &BoardConfig) -> Self {
        let motor = model.motor(Axis::Screw);
        Self {
            dead_time: DeadTime {
                part: config.dead_time_s / config.pwm_period_s(),
                turning_a: config.turning_a(),
                bus_a: config.bus_v * config.pwm_period_s() / motor.inductance_h,
            },
            resistance_part: motor.resistance_ohm / config.bus_v,
        }
    }

    /// What the currents lack of what the duties ask, of a dead time.
    fn measured(&self, duties: [f64; 3], amps: [f64; 3]) -> f64 {
        (of_phase_a(duties) - self.resistance_part * amps[0]) / self.dead_time.part
    }

    /// Minimum and maximum of the closed form where the currents at the edges are off by up to `off`, A.
    fn expected(&self, duties: [f64; 3], amps: [f64; 3], off: f64) -> [f64; 2] {
        [-off, off].map(|off| {
            let [a, b, c] = amps;
            of_phase_a(self.dead_time.lost_parts(&Period {
                duties,
                amps: [a + off, b - off, c - off],
                balance: amps.map(|amps| self.resistance_part * amps),
            }))
        })
    }

    /// How far the closed form may be from the currents that turn the legs, A. It takes those at the commands of the edges.
    ///
    /// All legs are held on the same side of an edge, for a dead time `t` at most. A held leg gives its own phase up to `2/3 V t`. The two
    /// others take up to `1/3 V t` each. So a current is off by up to `2/3 V t / L`.
    ///
    /// Only differences between legs move a current. Commands differ by a time `s`. Times for which legs are held differ by what the largest
    /// current loses, `p t`. Both give a phase up to `2/3 V (s + p t)`. The closed form has up to `2/3 V s` of it at an edge.
    fn moved_a(&self, duties: [f64; 3], amps: [f64; 3]) -> f64 {
        let DeadTime {
            part,
            turning_a,
            bus_a,
        } = self.dead_time;
        let apart = 0.5 * (duties[0] - duties[1]).abs();
        let held = part * lost_part(amps[0].abs() / turning_a);
        2.0 / 3.0 * bus_a * (2.0 * apart + held).min(part)
    }
}

/// Phase a's part of what three legs have.
fn of_phase_a([a, b, c]: [f64; 3]) -> f64 {
    (2.0 * a - b - c) / 3.0
}

/// The voltage of a turning motor makes the current of a small inductance ripple. Near zero the edges before and after a sample then
/// lose differently. Both kinds of bridge must need the same duties for the same current.
#[test]
fn bridges_of_both_kinds_agree_where_currents_ripple() {
    for kind in BOARDS {
        for electrical_s in [0.7e-3, 8e-3] {
            for emf_part in [0.1, 0.25] {
                let bound = (2.0 / 3.0 + 0.5 * emf_part) * moved_part(kind, electrical_s);
                let worst = [-1.5, -0.5, -0.2, 0.0, 0.2, 0.5, 1.5].map(|amps| {
                    let [edges, mean] = [switched(kind), kind.config()]
                        .map(|config| needed(kind, config, electrical_s, emf_part, amps));
                    let each = [0, 1, 2].map(|k| (edges[k] - mean[k]).abs());
                    each.into_iter().fold(0.0, f64::max)
                });
                let case = format!("{kind:?}, {electrical_s} s, {emf_part} of the bus");
                println!("{case}: {worst:.3?}");
                assert!(
                    worst.iter().all(|worst| *worst < bound),
                    "{case}: {worst:.3?} of a dead time's voltage, expected less than {bound:.3}"
                );
            }
        }
    }
}

/// By what a dead time moves a current, of the current that turns a leg. The mean leaves that out. It is at most 2/3 of it at each edge
/// ([`Standing::moved_a`]), and half of what the rotor's voltage moves. Half of the dead time is lost over a turning current, at two edges.
fn moved_part(kind: BoardKind, electrical_s: f64) -> f64 {
    let config = kind.config();
    let (_, model) = standing(kind, config);
    let inductance_h = electrical_s * model.motor(Axis::Screw).resistance_ohm;
    config.bus_v * config.dead_time_s / inductance_h / config.turning_a()
}

/// Phase voltages by the duties, of what a dead time takes, that hold a current. The winding has a time constant. Its rotor turns, and makes
/// a part of the bus. The current is of those that turn a leg.
fn needed(
    kind: BoardKind,
    config: BoardConfig,
    electrical_s: f64,
    emf_part: f64,
    amps: f64,
) -> [f64; 3] {
    const ANGLE: f64 = -1.3;
    const PERIODS: u32 = 2000;
    let (mut board, inductance_h) = turning(kind, config, electrical_s, emf_part, ANGLE);
    let (top, period_s) = (f64::from(config.period()), config.pwm_period_s());
    let shape = [0.0, 1.0, 2.0].map(|k| -(ANGLE - k * TAU / 3.0).sin());
    let gain = 0.2 * inductance_h / period_s;
    let mut held = shape.map(|shape| shape * emf_part * config.bus_v);
    let mut sums = [0.0; 3];
    for period in 0..PERIODS {
        let currents = board.machine.phase_currents(Axis::Screw);
        let volts = [0, 1, 2].map(|k| {
            let more = gain * (shape[k] * amps * config.turning_a() - currents[k]);
            held[k] += more * period_s / electrical_s;
            held[k] + more
        });
        let [low, high] = [f64::min, f64::max].map(|of| volts.into_iter().fold(volts[0], of));
        let duties = volts.map(|volts| 0.5 + (volts - 0.5 * (low + high)) / config.bus_v);
        let compare = duties.map(|duty| (duty * top).round() as u16);
        driven(&mut board, compare, 1);
        if 2 * period >= PERIODS {
            let mean = compare.iter().copied().map(f64::from).sum::<f64>() / 3.0;
            for (sum, counts) in sums.iter_mut().zip(compare) {
                *sum += f64::from(counts) - mean;
            }
        }
    }
    let dead = config.dead_time_s / period_s * top;
    sums.map(|sum| sum / (f64::from(PERIODS / 2) * dead))
}

/// A screw that turns so slowly that it stays at an electrical angle, with so much flux that it makes a part of the bus; and its inductance, H.
fn turning(
    kind: BoardKind,
    config: BoardConfig,
    electrical_s: f64,
    emf_part: f64,
    angle: f64,
) -> (Board, f64) {
    const SLOW: f64 = 1e4;
    let (_, mut model) = standing(kind, config);
    let motor = model.motor_mut(Axis::Screw);
    motor.inductance_h = electrical_s * motor.resistance_ohm;
    motor.flux_wb *= SLOW;
    motor.inertia_kg_m2 *= SLOW * SLOW;
    let inductance_h = motor.inductance_h;
    let pole_pairs = f64::from(motor.pole_pairs);
    // Power invariant: a vector is sqrt(3/2) times the amplitude of a phase.
    let omega = 1.5f64.sqrt() * emf_part * config.bus_v / (motor.flux_wb * pole_pairs);
    let torque = motor.inertia_kg_m2 * omega / (0.5 * config.pwm_period_s());
    let mut board = Board::new(&model, Coupling::Lumped, config);
    let start = angle / pole_pairs;
    board.machine.set_motor_angle(Axis::Screw, start);
    board.machine.set_disturbance_torque(Axis::Screw, torque);
    board.advance();
    board.machine.set_disturbance_torque(Axis::Screw, 0.0);
    (board, inductance_h)
}

/// In the zero vector around the top a steady current falls by its mean voltage over the inductance. An ADC that samples 8 us late reads so
/// much less.
#[test]
fn a_late_sample_reads_the_ripple() {
    let late_s = 8e-6;
    for kind in BOARDS {
        let mut config = BoardConfig {
            dead_time_s: 0.0,
            switching: Some(Switching {
                diode_v: 0.0,
                amplifier_s: 1e-9,
                sampled_s: [late_s; 3],
            }),
            ..kind.config()
        };
        let current = Adc::bipolar(16, 2.0, 0.0);
        config.sensors.current = current;
        let (mut board, model) = standing(kind, config);
        let (motor, top) = (model.motor(Axis::Screw), f64::from(config.period()));
        let compare = [0.506, 0.494, 0.494].map(|duty| (duty * top).round());
        let volts = 2.0 / 3.0 * config.bus_v * (compare[0] - compare[1]) / top;
        let seconds = 20.0 * motor.inductance_h / motor.resistance_ohm;
        let periods = (seconds / config.pwm_period_s()) as u32;
        driven(&mut board, compare.map(|counts| counts as u16), periods);
        let [amps, ..] = board.machine.phase_currents(Axis::Screw);
        let [read, ..] = board.turn(Axis::Screw).current;
        let less = amps - (f64::from(read) - current.zero) * current.per_count;
        let expected = volts / motor.inductance_h * late_s;
        println!("{kind:?}: {less:.4} A less, expected {expected:.4} A");
        assert!(
            (less / expected - 1.0).abs() < 0.1,
            "{kind:?}: {less:.4} A less than the current, expected {expected:.4} A"
        );
    }
}
