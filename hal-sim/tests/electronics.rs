//! A machine of one's own on the electronics of a board.

use hal_sim::boards::BoardKind;
use hal_sim::experiment::{OperatingPoint, RPM, Setup, ripple_percent};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// A motor of 0.27 N m with 4,000 counts, in place of the board's own.
fn own() -> Model {
    let mut model = BoardKind::Nucleo.machine(&Model::coupled(), Coupling::Coupled);
    for axis in Axis::ALL {
        let motor = model.motor_mut(axis);
        motor.resistance_ohm = 0.36;
        motor.inductance_h = 0.2e-3;
        motor.pole_pairs = 4;
        motor.flux_wb = 0.0078;
        motor.inertia_kg_m2 = 3e-5;
        motor.torque_harmonics.clear();
    }
    model.feed.load_n = 20.0;
    model.sensing.encoder_counts_per_turn = 4000;
    model.sensing.nut_encoder_counts_per_turn = None;
    model.installation.bus_v = 36.0;
    model
}

#[test]
fn a_machine_of_ones_own_has_the_bridges_of_the_board_and_its_own_motors() {
    let kind = BoardKind::Nucleo;
    let setup = Setup::on_electronics(kind, own(), Coupling::Coupled);
    let (plate, shipped) = (setup.plate(), kind.plate());
    assert_eq!(plate.bridge, shipped.bridge);
    assert_eq!(plate.board, shipped.board);
    assert_eq!(setup.board.dead_time_s, shipped.bridge.dead_time_s);
    assert_eq!(setup.board.leg_f, kind.config().leg_f);
    for motor in &plate.motors {
        assert_eq!(motor.encoder.counts_per_turn, 4000);
        let amps = motor.torque_max_nm / (4.0 * 0.0078);
        let most = 1.5f64.sqrt() * plate.bridge.over_current_a;
        assert!(
            amps < most,
            "its torque takes {amps:.1} A, expected less than the bridge's {most:.1} A"
        );
    }
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 800.0 * RPM,
    };
    let ripple = ripple_percent(&setup, point).unwrap();
    // The encoders' counts alone: 4000 of them.
    assert!(ripple < 20.0, "{ripple:.1} %, expected less than 20 %");
}
