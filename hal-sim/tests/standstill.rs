//! A motor at rest whose encoder is coarse: it must not swing between two counts.

use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::parallel::on_all_cores;
use hal_sim::sensors::incremental;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// While the screw alone moves the table: by how much a phase current of the nut swings, A, and rms of the table's speed about its
/// reference, mm/s. The nut's friction is low, and elastic over 2 um of the table, so that it holds the nut badly.
fn single_drive(counts: u32, load_n: f64) -> (f64, f64) {
    let kind = BoardKind::Mains;
    let mut model = kind.machine(&Model::coupled(), Coupling::Coupled);
    model.feed.load_n = load_n;
    model.feed.presliding_m = 2e-6;
    model.nut.coulomb_nm = 0.02;
    let mut plate = kind.plate();
    let encoders = incremental(counts);
    for (motor, encoder) in plate.motors.iter_mut().zip(encoders) {
        motor.encoder = encoder;
    }
    let mut config = kind.config();
    config.sensors.encoders = encoders;
    let mut drive = Drive::aligned(&model, Coupling::Coupled, config, &plate).unwrap();
    drive.command(1e-3, 10.0).unwrap();
    (0..10_000).for_each(|_| drive.period());
    drive.command(1e-3, 0.0).unwrap();
    (0..20_000).for_each(|_| drive.period());
    let periods = 20_000;
    let (mut least, mut most, mut errors) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for _ in 0..periods {
        drive.period();
        let [a, ..] = drive.board.machine.phase_currents(Axis::Nut);
        (least, most) = (a.min(least), a.max(most));
        let error = drive.board.machine.table_velocity() - 1e-3;
        errors += error * error;
    }
    (most - least, 1e3 * (errors / f64::from(periods)).sqrt())
}

/// The answer to a count is 0.3 A for 4096 counts, and 4 mA for 2^20, which need no slack. Without slack the currents swing by 0.50, 0.13 and
/// 0.01 A, and the table's speed by 0.16, 0.077 and 0.070 mm/s.
#[test]
fn a_motor_at_rest_does_not_swing_between_two_counts() {
    let loads: Vec<f64> = (0..16).map(|k| f64::from(k) * 25.0).collect();
    let worst = [4096, 16_384, 1 << 20].map(|counts| {
        let held = on_all_cores(&loads, |&load_n| single_drive(counts, load_n));
        let worst = held
            .into_iter()
            .fold((0.0f64, 0.0f64), |(most, fastest), (amps, speed)| {
                (most.max(amps), fastest.max(speed))
            });
        println!(
            "{counts} counts: nut {:.4} A, table {:.4} mm/s rms",
            worst.0, worst.1
        );
        worst
    });
    let [_, _, (_, fine)] = worst;
    for (amps, speed) in worst {
        assert!(
            amps < 0.11,
            "the nut's current swings by {amps:.3} A, expected less than 0.11 A"
        );
        assert!(
            speed < 1.02 * fine,
            "the table swings by {speed:.4} mm/s rms, expected no more than 1.02 times the {fine:.4} mm/s of a fine encoder"
        );
    }
}
