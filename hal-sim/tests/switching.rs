//! Bridges that switch, beside closed forms and beside bridges of mean voltages.

use control::current_loop::PwmCommand;
use hal_sim::board::{Board, BoardConfig};
use hal_sim::boards::BoardKind;
use hal_sim::sensors::Adc;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

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

/// A leg loses by its dead time what the closed form of its charge says, at currents of both signs and below the turning current.
#[test]
fn a_leg_that_switches_loses_what_the_mean_one_loses() {
    for kind in BOARDS {
        let [edges, mean] = [switched(kind), kind.config()].map(|config| {
            let (mut board, model) = standing(kind, config);
            let top = f64::from(config.period());
            let motor = model.motor(Axis::Screw);
            let seconds = 20.0 * motor.inductance_h / motor.resistance_ohm;
            let periods = (seconds / config.pwm_period_s()) as u32;
            [1e-3, 3e-3, 6e-3, 1e-2, 1.5e-2].map(|more: f64| {
                [more, -more].map(|more| {
                    let duties = [0.5 + more, 0.5 - more, 0.5 - more];
                    let compare = duties.map(|duty| (duty * top).round() as u16);
                    let currents = driven(&mut board, compare, periods);
                    currents[currents.len() - 1][0]
                })
            })
        });
        let turning = kind.config().turning_a();
        for (edges, mean) in edges.into_iter().zip(mean) {
            println!(
                "{kind:?}: {edges:.4?} A, by mean voltages {mean:.4?} A (a leg turns at {turning:.3} A)"
            );
            for (edges, mean) in edges.into_iter().zip(mean) {
                assert!(
                    (edges / mean - 1.0).abs() < 0.03,
                    "{kind:?}: {edges:.4} A by edges, expected {mean:.4} A within 3 %"
                );
            }
        }
    }
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
