//! The dead-time compensation near zero current, where the charge of a leg's switches takes a part of the dead time.

use control::plate::DrivePlate;
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

const BOARDS: [BoardKind; 2] = [BoardKind::Mains, BoardKind::Nucleo];
/// Capacitance of a switch, pF.
const SWITCHES_PF: [f64; 4] = [0.0, 100.0, 200.0, 300.0];

/// What a drive without a load does at rest: rms of the screw's phase currents, A, and the fastest table, m/s. Nothing has friction on the
/// lumped machine.
fn held(
    kind: BoardKind,
    coupling: Coupling,
    plate: &DrivePlate,
    config: BoardConfig,
) -> (f64, f64) {
    let template = match coupling {
        Coupling::Lumped => Model::paper(),
        Coupling::Coupled => Model::coupled(),
    };
    let mut model = kind.machine(&template, coupling);
    model.feed.load_n = 0.0;
    let mut drive = Drive::aligned(&model, coupling, config, plate).unwrap();
    drive.command(0.0, 0.0).unwrap();
    (0..20_000).for_each(|_| drive.period());
    let (mut squares, mut fastest) = (0.0, 0.0f64);
    let periods = 20_000;
    for _ in 0..periods {
        drive.period();
        let [a, b, c] = drive.board.machine.phase_currents(Axis::Screw);
        squares += (a * a + b * b + c * c) / 3.0;
        fastest = fastest.max(drive.board.machine.table_velocity().abs());
    }
    ((squares / f64::from(periods)).sqrt(), fastest)
}

fn with_switches(kind: BoardKind, pf: f64) -> BoardConfig {
    BoardConfig {
        leg_f: pf * 1e-12,
        ..kind.config()
    }
}

/// Without a dead time noise and counts of the sensors are left, by which a machine without friction swings.
#[test]
fn a_drive_without_load_is_still_at_rest() {
    for kind in BOARDS {
        let mut plate = kind.plate();
        plate.bridge.dead_time_s = 0.0;
        let config = BoardConfig {
            dead_time_s: 0.0,
            ..kind.config()
        };
        let (noise_a, noise) = held(kind, Coupling::Lumped, &plate, config);
        let cases = SWITCHES_PF.map(|pf| (with_switches(kind, pf), kind.plate()));
        // As commissioning sets it for the board's own switches.
        let (config, mut plate) = (kind.config(), kind.plate());
        plate.bridge.dead_time_fade_a = 2.0 * config.turning_a();
        let switching = BoardConfig {
            switching: Some(Switching::usual()),
            ..config
        };
        let own = [(config, plate), (switching, plate)];
        for (config, plate) in cases.into_iter().chain(own) {
            let pf = 1e12 * config.leg_f;
            let fade = plate.bridge.dead_time_fade_a;
            let (amps, _) = held(kind, Coupling::Coupled, &plate, config);
            let (swings_a, fastest) = held(kind, Coupling::Lumped, &plate, config);
            let bridges = match config.switching {
                Some(_) => "switching",
                None => "mean voltages",
            };
            let case = format!("{kind:?}, {bridges}, {pf:.0} pF, full at {fade:.3} A");
            println!(
                "{case}: {amps:.4} A; without friction {swings_a:.4} A, {:.1} um/s, of sensors {noise_a:.4} A, {:.1} um/s",
                fastest * 1e6,
                noise * 1e6
            );
            assert!(
                amps < 0.02,
                "{case}: {amps:.4} A rms, expected less than 0.02 A"
            );
            assert!(
                fastest < 1.3 * noise,
                "{case}: the table swings by {fastest:e} m/s, expected less than 1.3 times {noise:e} m/s"
            );
        }
    }
}

/// A compensation that is full at a fifth of what turns a leg is a negative resistance: the drive hums, as it once did.
#[test]
fn a_compensation_steeper_than_the_legs_oscillates() {
    let kind = BoardKind::Mains;
    let config = with_switches(kind, 300.0);
    let mut plate = kind.plate();
    plate.bridge.dead_time_fade_a = 0.2 * config.turning_a();
    let (amps, _) = held(kind, Coupling::Coupled, &plate, config);
    assert!(amps > 0.1, "{amps:.4} A rms, expected more than 0.1 A");
}

/// Around zero a leg loses half of its dead time over `2 C V / t`, and the compensation gives no more.
#[test]
fn the_compensation_is_no_steeper_than_the_legs() {
    for kind in BOARDS {
        let fade = kind.plate().bridge.dead_time_fade_a;
        let turning = with_switches(kind, 300.0).turning_a();
        assert!(
            fade >= 1.999 * turning,
            "{kind:?}: full at {fade:.3} A, expected at least {:.3} A",
            2.0 * turning
        );
    }
}
