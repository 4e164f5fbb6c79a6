//! Power stages that sleep, have no supply, or hold a gate-drive fault: what the drive says of them, and how it leaves that.

use link::codes::{Demand, Fault};
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, FAULT, READY, RUNNING};
use tests::chip::CORE_HZ;
use tests::chip::stage::Stage;
use tests::pins::Motor;

const BOTH: [Motor; 2] = [Motor::Screw, Motor::Nut];

fn change(bench: &mut Bench, motors: &[Motor], change: fn(&mut Stage)) {
    for motor in motors {
        bench.emulator.chip().change_stage(*motor, change);
    }
}

fn starting() -> Result<Bench, String> {
    Bench::new(&Model::coupled(), Coupling::Coupled)
}

fn says(bench: &mut Bench, fault: Fault) -> Result<(), String> {
    let status = bench.status()?;
    assert_eq!(
        (status.state, Fault::of_word(status.fault)),
        (FAULT, Some(fault))
    );
    Ok(())
}

/// A driver's ENABLE pin as the chip drives it.
fn enable(bench: &mut Bench, motor: Motor) -> Option<bool> {
    let (port, pin) = [(0, 4), (2, 5)][motor as usize];
    bench.emulator.chip().system.output(port, pin)
}

/// The logic is on before the bus, as at the first power-up.
#[test]
fn a_stage_without_supply_is_told_and_a_reset_leaves_it_once_the_supply_is_there()
-> Result<(), String> {
    let mut bench = starting()?;
    change(&mut bench, &BOTH, |stage| stage.supplied = false);
    bench.wait_for(FAULT, 0.2)?;
    bench.pass(20e-3)?;
    says(&mut bench, Fault::StageSupply)?;
    // A reset does not leave it while the cause is there.
    bench.demand(Demand::Reset)?;
    bench.pass(20e-3)?;
    says(&mut bench, Fault::StageSupply)?;
    bench.demand(Demand::Rest)?;
    change(&mut bench, &BOTH, |stage| stage.supplied = true);
    bench.pass(20e-3)?;
    says(&mut bench, Fault::StageSupply)?;
    bench.demand(Demand::Reset)?;
    bench.wait_for(READY, 0.2)
}

#[test]
fn an_emergency_stop_is_told_from_an_over_current() -> Result<(), String> {
    for runs in [false, true] {
        let mut bench = starting()?;
        bench.wait_for(READY, 0.2)?;
        if runs {
            bench.start(2.5e-3, 30.0)?;
            bench.pass(0.1)?;
            assert_eq!(bench.status()?.state, RUNNING);
        }
        change(&mut bench, &BOTH, |stage| stage.enable_cut = true);
        bench.pass(4e-3)?;
        says(&mut bench, Fault::EmergencyStop)?;
        bench.demand(Demand::Rest)?;
        bench.pass(20e-3)?;
        change(&mut bench, &BOTH, |stage| stage.enable_cut = false);
        bench.pass(20e-3)?;
        says(&mut bench, Fault::EmergencyStop)?;
        bench.demand(Demand::Reset)?;
        bench.wait_for(READY, 0.2)?;
    }
    Ok(())
}

#[test]
fn a_torn_enable_wire_is_its_stages_fault() -> Result<(), String> {
    for (motor, fault) in [
        (Motor::Screw, Fault::ScrewAsleep),
        (Motor::Nut, Fault::NutAsleep),
    ] {
        let mut bench = starting()?;
        bench.wait_for(READY, 0.2)?;
        change(&mut bench, &[motor], |stage| stage.enable_cut = true);
        bench.pass(20e-3)?;
        says(&mut bench, fault)?;
    }
    Ok(())
}

/// A gate-drive fault stays until ENABLE was low; a reset wakes the driver, and waits for it.
#[test]
fn a_reset_clears_a_latched_gate_drive_fault() -> Result<(), String> {
    for (motor, fault) in [
        (Motor::Screw, Fault::ScrewDriver),
        (Motor::Nut, Fault::NutDriver),
    ] {
        let mut bench = starting()?.running(0.1)?;
        change(&mut bench, &[motor], Stage::latch_gate_fault);
        bench.pass(10e-3)?;
        says(&mut bench, fault)?;
        let both = BOTH.map(|one| enable(&mut bench, one));
        let expected = BOTH.map(|one| Some(one != motor));
        assert_eq!(
            both, expected,
            "the faulty stage sleeps, the other does not"
        );
        bench.pass(0.3)?;
        says(&mut bench, fault)?;
        let asked = bench.emulator.chip().now;
        bench.demand(Demand::Reset)?;
        bench.wait_for(READY, 0.2)?;
        let took = (bench.emulator.chip().now - asked) as f64 / CORE_HZ as f64;
        println!("{motor:?}: ready {:.1} ms after the reset", 1e3 * took);
        bench.demand(Demand::Run)?;
        bench.pass(20e-3)?;
        assert_eq!(bench.status()?.state, RUNNING);
    }
    Ok(())
}
