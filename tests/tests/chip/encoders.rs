//! Encoders that do not say the truth: an absolute one's frames, an incremental one's counts and index.

use control::encoder::Interface;
use hal_sim::experiment::RPM;
use link::codes::Demand;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, FAULT, READY, RUNNING, plate_of, scale_count_m};
use tests::chip::CORE_HZ;
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

const PERIOD_S: f64 = 50e-6;
/// A bit of the angle, and its neighbour.
const ERROR: u32 = 3 << 20;

/// The mains board's drive at 300 rpm with the table moving.
fn running() -> Result<Bench, String> {
    let mut bench = Bench::on(Wiring::Mains, &Model::coupled(), Coupling::Coupled)?.running(0.4)?;
    assert_eq!(encoder_wrong(&mut bench)?, [0; 2]);
    Ok(bench)
}

/// Readings of the motor encoders that the drive took for wrong: screw, nut.
fn encoder_wrong(bench: &mut Bench) -> Result<[u32; 2], String> {
    Ok(bench.look()?.words().encoder_wrong)
}

fn enabled(bench: &mut Bench, motor: Motor) -> bool {
    bench.emulator.chip().pwm[motor as usize].bridge().enabled
}

/// Lets the screw's frames of `periods` periods arrive wrong.
fn wrong_frames(bench: &mut Bench, periods: u32) -> Result<(), String> {
    bench.settle_untold()?;
    // Past the next top, which the frame under way is for.
    bench.pass(PERIOD_S / 2.0)?;
    bench.emulator.chip().provoked.frame_errors[0] = ERROR;
    bench.pass(f64::from(periods) * PERIOD_S)?;
    bench.emulator.chip().provoked.frame_errors[0] = 0;
    Ok(())
}

fn screw_speed(bench: &Bench) -> f64 {
    bench.joint.borrow().board.machine.motor(Axis::Screw).omega
}

#[test]
fn a_frame_is_in_memory_before_the_interrupt_begins() -> Result<(), String> {
    let mut bench = running()?;
    for _ in 0..20 {
        bench.settle_untold()?;
        bench.pass(PERIOD_S / 2.0)?;
        let chip = bench.emulator.chip();
        let next = chip.pwm[0].next_top().ok_or("the timers run")?;
        let top = next - chip.pwm[0].period();
        // Half a microsecond for the DMA; after the top it is 0.9 us more.
        assert!(chip.spi.last + 85 < top, "{} before {top}", chip.spi.last);
        assert!(chip.spi.last + 935 > top, "the frame of this top");
    }
    // It costs a load and its check: the nut's loop, whose encoder is a timer, does the rest as well.
    let [screw, nut] = bench.look()?.words().motors.map(|motor| motor.cycles);
    println!("screw {screw} cycles, nut {nut}");
    assert!(screw < nut + 60, "{screw} against {nut} cycles");
    Ok(())
}

#[test]
fn wrong_frames_are_counted_and_ridden_through() -> Result<(), String> {
    let mut bench = running()?;
    let mut expected = 0;
    for periods in [1, 8, 3] {
        wrong_frames(&mut bench, periods)?;
        expected += periods;
        bench.pass(10e-3)?;
        assert_eq!(encoder_wrong(&mut bench)?, [expected, 0]);
        assert_eq!(bench.status()?.state, RUNNING);
    }
    // One in twenty over a tenth of a second: the screw keeps its speed as it does without.
    let speeds = |bench: &mut Bench, wrong: bool| -> Result<(f64, f64), String> {
        let (mut least, mut most) = (f64::MAX, f64::MIN);
        for _ in 0..100 {
            if wrong {
                wrong_frames(bench, 1)?;
            }
            bench.pass(19.0 * PERIOD_S)?;
            let speed = screw_speed(bench);
            (least, most) = (least.min(speed), most.max(speed));
        }
        Ok((least, most))
    };
    let (least, most) = speeds(&mut bench, false)?;
    let (least_wrong, most_wrong) = speeds(&mut bench, true)?;
    assert_eq!(encoder_wrong(&mut bench)?, [expected + 100, 0]);
    assert_eq!(bench.status()?.state, RUNNING);
    println!(
        "screw {least:.3} to {most:.3} rad/s, with wrong frames {least_wrong:.3} to {most_wrong:.3}"
    );
    let ripple = most - least;
    assert!(
        (most_wrong - least_wrong) < 1.5 * ripple,
        "{least_wrong} to {most_wrong}, against {least} to {most} rad/s"
    );
    Ok(())
}

#[test]
fn past_the_limit_wrong_frames_open_the_bridge() -> Result<(), String> {
    let mut bench = running()?;
    wrong_frames(&mut bench, 9)?;
    // The ninth is sampled at the top in half a period; what its step writes acts from the next top on.
    bench.pass(2.0 * PERIOD_S)?;
    assert!(!enabled(&mut bench, Motor::Screw));
    bench.pass(1e-3)?;
    // It brings the table to rest.
    assert!(enabled(&mut bench, Motor::Nut));
    const SCREW_ENCODER: u32 = 5;
    let status = bench.status()?;
    assert_eq!((status.state, status.fault), (FAULT, SCREW_ENCODER));
    assert_eq!(encoder_wrong(&mut bench)?, [9, 0]);
    // The frames are well again: after a while a reset leaves the fault, and the drive runs.
    bench.demand(Demand::Reset)?;
    bench.wait_for(READY, 20e-3)?;
    bench.demand(Demand::Run)?;
    bench.pass(20e-3)?;
    assert_eq!(bench.status()?.state, RUNNING);
    assert_eq!(encoder_wrong(&mut bench)?, [9, 0]);
    Ok(())
}

#[test]
fn a_sensor_that_is_not_there_keeps_the_drive_off() -> Result<(), String> {
    let mut bench = Bench::on(Wiring::Mains, &Model::coupled(), Coupling::Coupled)?;
    // The line is pulled up.
    bench.emulator.chip().provoked.stuck_encoder[0] = Some(u32::MAX);
    bench.wait_for(FAULT, 0.2)?;
    // The view follows in the next step of the supervision.
    bench.pass(2e-3)?;
    let (wrong, status) = (encoder_wrong(&mut bench)?[0], bench.status()?);
    assert!(wrong > 8, "{wrong} wrong frames, and {status:?}");
    Ok(())
}

/// Neither the loss of counts nor the index that puts them right is a speed, wherever in the turn it comes.
#[test]
fn the_index_corrects_lost_counts() -> Result<(), String> {
    for place in 0..6 {
        let seconds = 0.4 + 17.1e-3 * f64::from(place);
        let mut bench =
            Bench::on(Wiring::Mains, &Model::coupled(), Coupling::Coupled)?.running(seconds)?;
        let turn = plate_of(Wiring::Mains).motors[1].encoder.counts_per_turn;
        // Off by 1.8 degrees, 9 electrical.
        let lost = turn / 200;
        bench.emulator.chip().provoked.lost_counts[1] = lost;
        let off = |bench: &mut Bench| -> Result<u32, String> {
            bench.settle_untold()?;
            let chip = bench.emulator.chip();
            let true_count = chip.last_count(Motor::Nut);
            let count = chip.encoders[1].read(0x24)?;
            Ok((true_count + turn - count) % turn)
        };
        bench.pass(2.0 * PERIOD_S)?;
        assert_eq!(off(&mut bench)?, lost);
        // A turn at 300 rpm takes 0.2 s.
        for _ in 0..220 {
            bench.pass(1e-3)?;
            let nut = bench.joint.borrow().board.machine.motor(Axis::Nut).omega / RPM;
            assert!(
                (nut - 300.0).abs() < 10.0,
                "{nut} rpm, {seconds} s after the start"
            );
        }
        assert_eq!(off(&mut bench)?, 0, "after the index");
        assert_eq!(
            encoder_wrong(&mut bench)?,
            [0, 2],
            "a jump there and one back"
        );
        assert_eq!(bench.status()?.state, RUNNING);
    }
    Ok(())
}

/// Lengths of the timers' input filters by code, from code 1: so many samples at the clock divided by so much (RM0440, IC1F).
const FILTERS: [(u32, u32); 15] = [
    (2, 1),
    (4, 1),
    (8, 1),
    (6, 2),
    (8, 2),
    (6, 4),
    (8, 4),
    (6, 8),
    (8, 8),
    (5, 16),
    (6, 16),
    (8, 16),
    (5, 32),
    (6, 32),
    (8, 32),
];

/// Two edges come within a third of a count's time at a quadrature error of 60 electrical degrees: a filter is as long as
/// that allows, and no longer.
#[test]
fn encoder_inputs_are_filtered_up_to_their_closest_edges() -> Result<(), String> {
    const CCMR1: u32 = 0x18;
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = Bench::on(board, &Model::coupled(), Coupling::Coupled)?;
        bench.wait_for(READY, 0.2)?;
        let plate = plate_of(board);
        let mut rates = Vec::new();
        for (timer, motor) in plate.motors.iter().enumerate() {
            if motor.encoder.interface != Interface::Mt6835 {
                let turns = motor.speed_max_rpm / 60.0;
                rates.push((timer, turns * f64::from(motor.encoder.counts_per_turn)));
            }
        }
        rates.push((2, plate.feed.velocity_max / scale_count_m(board)));
        for (timer, counts_per_s) in rates {
            let gap = CORE_HZ as f64 / counts_per_s / 3.0;
            let inputs = bench.emulator.chip().encoders[timer].read(CCMR1)?;
            let codes = [inputs >> 4 & 15, inputs >> 12 & 15];
            let [length, longer] = [0, 1].map(|more| {
                let (samples, divider) = FILTERS[codes[0] as usize - 1 + more];
                f64::from(samples * divider)
            });
            assert!(
                codes[0] == codes[1] && length <= gap && longer > gap,
                "{board:?}, encoder {timer}: filters {codes:?} of {length} cycles where edges are {gap} apart"
            );
        }
    }
    Ok(())
}
