//! The firmware as it is flashed finds its rotors on the emulated chip, wherever they stand, as the host does, bit for bit;
//! and a reset takes it back to where it must find them again.

use bench::alignment::margin_nm;
use control::fault::Fault;
use control::supervisor::{Demand, State};
use hal_sim::drive::Drive;
use hal_sim::start::{Start, settle};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{
    Bench, READY, RUNNING, aligning_firmware_of, board_config, machine_of, plate_of,
};
use tests::chip::wiring::Wiring;
use tests::same::{assert_period, by_motor};

/// Longest that an alignment may take, s.
const LONGEST_S: f64 = 8.0;
/// Longest step of the speed task, core cycles: half of the time until the next.
const LONGEST_STEP: u32 = 17_000;
/// Where the rotors stand, rad: screw, nut.
const ANGLES: [f64; 2] = [1.1, 4.0];

/// A load that guideway and ball pair hold also while a rotor turns, and motors whose torque over the angle at rest friction holds:
/// with the paper's a rotor stands where it pleases, and one start in twenty is refused.
fn model() -> Model {
    let mut model = Model::coupled();
    model.feed.load_n = 20.0;
    for axis in Axis::ALL {
        for harmonic in &mut model.motor_mut(axis).torque_harmonics {
            harmonic.amplitude_nm *= 0.25;
        }
    }
    model
}

fn bench(board: Wiring) -> Result<Bench, String> {
    let start = Start {
        model: machine_of(board, &model(), Coupling::Coupled),
        board: board_config(board),
        plate: plate_of(board),
        angles: ANGLES,
    };
    assert!(
        margin_nm(&start) > 0.0,
        "{board:?}: friction does not hold it"
    );
    let elf = aligning_firmware_of(board)?;
    let bench = Bench::with(&elf, board, &model(), Coupling::Coupled)?;
    settle(&mut bench.joint.borrow_mut().board, ANGLES);
    Ok(bench)
}

#[test]
fn the_flashed_firmware_aligns_as_the_host_does() -> Result<(), String> {
    // Two incremental encoders; an absolute one, and one with an index, which is passed on the way.
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = bench(board)?;
        bench.emulator.chip().tops = Some(Vec::new());
        bench.wait_for(State::Unaligned.word(), 0.5)?;
        bench.demand(Demand::Align)?;
        // The step that begins to align, by the count of the screw's tops.
        let begun = bench.wait_for_step(|view| view.state() == Some(State::Aligning))?;
        bench
            .wait_for(READY, LONGEST_S)
            .map_err(|error| format!("{board:?}: {error}"))?;
        let view = bench.look()?;
        let words = view.words();
        let longest = words.speed_cycles_max;
        println!("{board:?}: the longest step of the speed task took {longest} cycles");
        assert!(
            longest < LONGEST_STEP && words.speed_missed == 0,
            "{board:?}: {longest} cycles, expected less than {LONGEST_STEP}; late {} times",
            words.speed_missed
        );
        let tops = bench.emulator.chip().tops.take().unwrap_or_default();
        let streams = by_motor(&tops);

        let (machine, plate) = (
            machine_of(board, &model(), Coupling::Coupled),
            plate_of(board),
        );
        // The emulated scale has no noise, and draws none from the generator that all sensors share.
        let mut config = board_config(board);
        config.sensors.scale_noise_m = 0.0;
        let mut drive = Drive::new(&machine, Coupling::Coupled, config, &plate)
            .map_err(|misfit| misfit.to_string())?;
        settle(&mut drive.board, ANGLES);
        let (mut closed, mut aligning) = (0, 0);
        for period in 0..streams[1].len() - 1 {
            if period as u64 == begun {
                drive.request.demand = Demand::Align;
            }
            drive.period();
            aligning += usize::from(drive.state() == State::Aligning);
            assert_period(&format!("{board:?}"), period, &streams, &drive);
            let next = Axis::ALL.map(|axis| drive.compare(axis).enable);
            closed += next.into_iter().filter(|enable| *enable).count();
        }
        // The chip was seen ready by a step of its speed task, in the period after the last whole one.
        drive.period();
        assert_eq!(drive.state(), State::Ready, "{board:?}: the host's drive");
        assert!(
            aligning > 2000 && closed > 2000,
            "{board:?}: aligned in {aligning} periods, of which bridges were closed in {closed}"
        );
    }
    Ok(())
}

#[test]
fn a_watchdog_reset_ends_in_a_drive_that_aligns_again() -> Result<(), String> {
    let mut bench = bench(Wiring::Nucleo)?;
    bench.align(LONGEST_S)?;
    bench.start(2.5e-3, 30.0)?;
    bench.wait_for(RUNNING, 0.1)?;
    bench.pass(0.1)?;
    bench.hang("FMAC")?;
    bench.pass(50e-3)?;
    // The counters begin at zero again, wherever the rotors have come to rest. Nothing moves before it is demanded.
    bench.wait_for(State::Unaligned.word(), 1.0)?;
    bench.pass(0.5)?;
    let speeds = Axis::ALL.map(|axis| bench.joint.borrow().board.machine.motor(axis).omega);
    assert!(
        speeds.iter().all(|speed| speed.abs() < 1e-3),
        "{speeds:?} rad/s"
    );
    bench.align(LONGEST_S)?;
    bench.start(2.5e-3, 30.0)?;
    bench.pass(0.5)?;
    let status = bench.status()?;
    assert_eq!(status.state, RUNNING, "{:?}", Fault::of_word(status.fault));
    let before = bench.joint.borrow().board.machine.table_position();
    bench.pass(0.4)?;
    let moved = bench.joint.borrow().board.machine.table_position() - before;
    assert!(
        (moved - 1e-3).abs() < 0.05e-3,
        "the table moved by {:.3} mm in 0.4 s, not by 1 mm",
        1e3 * moved
    );
    Ok(())
}
