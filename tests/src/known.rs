//! What the control code knows after each step of its speed task: by the same code on the host, beside the rows of a recording.

use crate::bench::{board_config, machine_of, plate, scale_count_m};
use crate::chip::wiring::Wiring;
use hal_sim::drive::Drive;
use link::codes::Demand;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;
use std::ops::Range;

/// What it knows of a motor after a step of its current loop.
#[derive(Clone, Copy, Default)]
struct Known {
    encoder: u32,
    phases: [f64; 2],
    voltage: [f64; 2],
}

/// What it knows after a step of the speed task, when the screw's loop has had its step and the nut's has not.
pub struct Row {
    motors: [Known; 2],
    i_q_ref: [f64; 2],
    speed_ref: [f64; 2],
    table: f64,
}

/// A row for each step of the speed task of the default board on the paper's machine, from power-up on. In period `asked` the drive
/// is asked to run at a table velocity, m/s, and a nut speed, rad/s.
///
/// # Errors
/// The machine or the speeds do not fit the drive.
pub fn by_the_host(
    asked: u64,
    [velocity, base]: [f64; 2],
    seconds: f64,
) -> Result<Vec<Row>, String> {
    let plate = plate();
    let board = board_config(Wiring::Nucleo);
    let machine = machine_of(Wiring::Nucleo, &Model::paper(), Coupling::Lumped);
    let mut drive = Drive::aligned(&machine, Coupling::Lumped, board, &plate)
        .map_err(|misfit| misfit.to_string())?;
    drive.request.demand = Demand::Rest;
    let known = |drive: &Drive, axis: Axis| {
        let (estimate, voltage) = (drive.estimate(axis), drive.ended_voltage(axis));
        let [a, b, _] = estimate.phases.map(|i| i.to_num());
        Known {
            encoder: drive.sample(axis).encoder,
            phases: [a, b],
            voltage: [voltage.d.to_num(), voltage.q.to_num()],
        }
    };
    let mut rows = Vec::new();
    let mut nut = Known::default();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    for period in 0..(seconds * board.pwm_hz) as u64 {
        if period == asked {
            drive
                .command(velocity, base)
                .map_err(|error| error.to_string())?;
            drive.request.demand = Demand::Run;
        }
        let table = drive.board.machine.table_position();
        drive.period();
        if period.is_multiple_of(u64::from(plate.board.speed_divider)) {
            let speed = drive.speed();
            rows.push(Row {
                motors: [known(&drive, Axis::Screw), nut],
                i_q_ref: speed.current.map(|c| c.i_q.to_num()),
                speed_ref: [0, 1].map(|k: usize| {
                    speed.speed[k].omega_e.to_num::<f64>() / f64::from(plate.motors[k].pole_pairs)
                }),
                table,
            });
        }
        nut = known(&drive, Axis::Nut);
    }
    Ok(rows)
}

/// Which of `expected` the first row of a whole recording is, where each of its rows is the one expected then. It is looked for in
/// `firsts`.
///
/// # Errors
/// The first value that differs, of the first row that comes nearest to that.
pub fn same_from(
    rows: &Recording,
    expected: &[Row],
    firsts: Range<usize>,
) -> Result<usize, String> {
    let mut apart = (0, "the control code did not run as long".to_owned());
    for first in firsts {
        let Some(there) = expected.get(first..first + rows.len()) else {
            break;
        };
        match (0..rows.len()).try_for_each(|row| same(rows, row, &there[row])) {
            Ok(()) => return Ok(first),
            Err(later) if later.0 >= apart.0 => apart = later,
            Err(_) => {}
        }
    }
    Err(apart.1)
}

/// Row `row` is the one that is expected; else its number, and what differs.
fn same(rows: &Recording, row: usize, expected: &Row) -> Result<(), (usize, String)> {
    let close = |what: &str, got: f64, expected: f64, by: f64| match (got - expected).abs() <= by {
        true => Ok(()),
        false => Err((
            row,
            format!("{what} of row {row} is {got}, and {expected} in the control code"),
        )),
    };
    // Half a count of the scale, and half of the file's last digit.
    let metres = 0.5 * scale_count_m(Wiring::Nucleo) + 0.6e-9;
    close("time", rows.time_s[row], row as f64 / 5000.0, 1e-9)?;
    close("table", rows.table_position_m[row], expected.table, metres)?;
    for (axis, (k, motor)) in rows.axes.iter().zip(expected.motors.iter().enumerate()) {
        let encoder = f64::from(motor.encoder);
        close("angle", f64::from(count(axis.angle_rad[row])), encoder, 0.0)?;
        // Half a step of what is sent, and half of the file's last digit.
        let [amps, volts] = [0.5 / 4096.0 + 0.6e-4, 0.5 / 8192.0 + 0.6e-3];
        close("i_a", axis.ia_a[row], motor.phases[0], amps)?;
        close("i_b", axis.ib_a[row], motor.phases[1], amps)?;
        close("u_d", axis.ud_v[row], motor.voltage[0], volts)?;
        close("u_q", axis.uq_v[row], motor.voltage[1], volts)?;
        close("i_q_ref", axis.iq_ref_a[row], expected.i_q_ref[k], amps)?;
        let speed = axis.speed_ref_rad_s[row];
        close("speed", speed, expected.speed_ref[k], 0.6e-4)?;
    }
    Ok(())
}

/// The count within the turn that an angle stands for.
#[must_use]
pub fn count(angle_rad: f64) -> u32 {
    let per_turn = plate().motors[0].encoder.counts_per_turn;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = (angle_rad / TAU * f64::from(per_turn))
        .round()
        .rem_euclid(f64::from(per_turn)) as u32;
    count
}
