//! The bring-up on the emulated chip: a healthy board has no finding, and each fault that is injected is named, alone.

use board::bringup::{Report, Verdict, judge};
use embedded_storage::nor_flash::NorFlash;
use hal_sim::flash::PAGE;
use link::bringup::Stage;
use link::codes::Demand;
use link::host::bringup::{Bringup, Options, Readings};
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, READY};
use tests::chip::flash::SIZE;
use tests::chip::outside::Circuit;
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

const BOTH: [Motor; 2] = [Motor::Screw, Motor::Nut];

const OPTIONS: Options = Options {
    listen_s: 20e-3,
    stream_s: 20e-3,
    meter_v: None,
    drive_s: 0.12,
};
/// The second stage.
const POWERED: Options = Options {
    meter_v: Some(12.1),
    ..OPTIONS
};

fn bench(board: Wiring) -> Result<Bench, String> {
    let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
    bench.joint.borrow_mut().board.set_bus_voltage(0.0);
    if board == Wiring::Mains {
        // Anywhere but at zero, where a frame is all zeros as that of a shorted line is.
        bench.emulator.chip().provoked.stuck_encoder[0] = Some(hal_sim::mt6835::frame(300_000, 0));
    }
    Ok(bench)
}

fn ask(bench: &mut Bench, options: &Options) -> Result<(Readings, Report), String> {
    let said = |error: anyhow::Error| format!("{error:#}");
    let place = Bringup::locate(|name| bench.image.symbol(name))?;
    let readings = place
        .run(&mut bench.emulator, options, |_| ())
        .map_err(said)?;
    let report = judge(&readings);
    Ok((readings, report))
}

/// Writes the page where `DDFEED_BRINGUP_PAGE` says, for a look at it.
fn keep_page(report: &Report, name: &str) -> Result<(), String> {
    let Ok(folder) = std::env::var("DDFEED_BRINGUP_PAGE") else {
        return Ok(());
    };
    let path = std::path::Path::new(&folder).join(format!("{name}.html"));
    std::fs::write(&path, board::bringup::page(report))
        .map_err(|error| format!("cannot write {}: {error}", path.display()))
}

/// Puts `fault` in, and expects the findings `ids` and no other, and `says` among their words.
fn finds(
    board: Wiring,
    fault: impl FnOnce(&mut Bench),
    ids: &[&str],
    says: &str,
) -> Result<Report, String> {
    finds_in(&OPTIONS, board, fault, ids, says)
}

/// The same in a stage.
fn finds_in(
    options: &Options,
    board: Wiring,
    fault: impl FnOnce(&mut Bench),
    ids: &[&str],
    says: &str,
) -> Result<Report, String> {
    let mut bench = bench(board)?;
    let volts = options.meter_v.unwrap_or(0.0);
    bench.joint.borrow_mut().board.set_bus_voltage(volts);
    fault(&mut bench);
    let (_, report) = ask(&mut bench, options)?;
    keep_page(&report, ids.last().unwrap_or(&"open"))?;
    let mut found: Vec<_> = report
        .of(Verdict::Finding)
        .map(|item| item.id.as_str())
        .collect();
    found.sort_unstable();
    assert_eq!(found, ids, "`{says}` was to be found:\n{}", report.text());
    assert!(
        report.text().contains(says),
        "`{says}` is not said:\n{}",
        report.text()
    );
    Ok(report)
}

#[test]
fn a_healthy_board_has_no_finding_and_its_drive_starts() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = bench(board)?;
        // Amplifiers that sleep without supply.
        let supplied = !board.amplifiers_sleep();
        for motor in BOTH {
            let chip = bench.emulator.chip();
            chip.change_stage(motor, |stage| stage.supplied = supplied);
        }
        let began = std::time::Instant::now();
        let (readings, report) = ask(&mut bench, &OPTIONS)?;
        println!("{board:?}: {:?}\n{}", began.elapsed(), report.text());
        keep_page(&report, &format!("{board:?}"))?;
        assert_eq!(readings.stage(), Some(Stage::Done));
        assert_eq!(report.findings, 0, "{}", report.text());
        assert!(
            report.items.len() > 40,
            "{} readings of {board:?}",
            report.items.len()
        );
        let asleep = report.text().matches("asleep, as expected").count();
        assert_eq!(asleep, if supplied { 0 } else { 6 }, "{}", report.text());
        // The request held for one start.
        if !supplied {
            for motor in BOTH {
                let chip = bench.emulator.chip();
                chip.change_stage(motor, |stage| stage.supplied = true);
            }
            bench.pass(20e-3)?;
            bench.demand(Demand::Reset)?;
        }
        bench.wait_for(READY, 0.2)?;
        assert_eq!(bench.emulator.resets.len(), 2);
    }
    Ok(())
}

#[test]
fn a_power_up_and_a_reset_without_a_request_start_the_drive() -> Result<(), String> {
    let mut bench = bench(Wiring::Nucleo)?;
    bench.wait_for(READY, 0.2)?;
    Ok(())
}

#[test]
fn with_a_voltage_on_the_bus_it_refuses_before_it_touches_a_pin() -> Result<(), String> {
    let mut bench = bench(Wiring::Nucleo)?;
    bench.joint.borrow_mut().board.set_bus_voltage(24.0);
    let (readings, report) = ask(&mut bench, &OPTIONS)?;
    assert_eq!(readings.stage(), Some(Stage::Refused));
    let ids: Vec<_> = report.of(Verdict::Finding).map(|item| &item.id).collect();
    assert_eq!(ids, ["bus.screwbus", "bus.nutbus"], "{}", report.text());
    assert!(report.text().contains("There is 24 V on the bus"));
    assert!(
        readings.report.pins.iter().all(|pin| pin.function == 0),
        "no pin was pulled"
    );
    Ok(())
}

#[test]
fn clock_and_power() -> Result<(), String> {
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().faults.crystal_hz = 8e6,
        &["clock.crystal"],
        "It looks like one of 8 MHz",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().faults.lsi_hz = 26e3,
        &["clock.lsi"],
        "The watchdog's 20 ms are 25 ms",
    )?;
    // The firmware does not start on these two, and says why.
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().system.no_boost = true,
        &["stage"],
        "not in boost mode",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().system.crystal = false,
        &["stage"],
        "the crystal does not start",
    )?;
    Ok(())
}

#[test]
fn analog_channels() -> Result<(), String> {
    // The bus divider of the default board without its capacitor.
    let report = finds(
        Wiring::Nucleo,
        |bench| {
            let faults = &mut bench.emulator.chip().faults;
            faults.source_ohm.push(((1, 6), 50e3));
        },
        &["settling.screwbus"],
        "does not reach the pin's voltage",
    )?;
    let said = report.of(Verdict::Finding).next().map(|item| &item.means);
    let ohms: f64 = said
        .and_then(|means| means.split("about ").nth(1))
        .and_then(|rest| rest.split(' ').next())
        .and_then(|number| number.parse().ok())
        .ok_or("the source's resistance is not said")?;
    assert!(
        (ohms / 50.0 - 1.0).abs() < 0.1,
        "50 kohm were put in, {ohms} kohm are said"
    );
    // Above what the voltage detector opens both bridges by.
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().set_supply(3.0),
        &["drive.state", "supply.controller"],
        "not 3.3 V",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| {
            let faults = &mut bench.emulator.chip().faults;
            faults.stuck_channel.push(((1, 7), 4095));
        },
        // The drive that starts afterwards stops by it.
        &["drive.state", "temperature.screwheatsink"],
        "torn off",
    )?;
    Ok(())
}

#[test]
fn comparators_and_breaks() -> Result<(), String> {
    finds(
        Wiring::Mains,
        |bench| bench.emulator.chip().faults.dead_comparators = 1 << 1,
        &["comparator.1"],
        "always low",
    )?;
    finds(
        Wiring::Mains,
        |bench| bench.emulator.chip().faults.dead_dacs[0] = true,
        &["dac.dac3-channel-1", "dac.dac3-channel-2"],
        "these comparators stop nothing",
    )?;
    finds(
        Wiring::Mains,
        |bench| bench.emulator.chip().faults.unwired_breaks = 1 << 4,
        &["break.nut.comparator4"],
        "not wired to the timer's break",
    )?;
    Ok(())
}

#[test]
fn pins() -> Result<(), String> {
    let outside = |change: fn(&mut tests::chip::outside::Outside)| {
        move |bench: &mut Bench| change(&mut bench.emulator.chip().outside)
    };
    // PA8 and PA9 are the screw's high sides a and b; of the second board PC0 is the screw's high side a, PA5 and PB5 the
    // SPI's clock and data out.
    finds(
        Wiring::Nucleo,
        outside(|outside| {
            outside.shorts.insert((0, 8), true);
        }),
        &["pin.PA8"],
        "shorted to the supply",
    )?;
    finds(
        Wiring::Mains,
        outside(|outside| {
            outside.circuits.remove(&(2, 0));
        }),
        &["pin.PC0"],
        "its pull-down is missing",
    )?;
    finds(
        Wiring::Mains,
        outside(|outside| {
            outside.shorts.insert((0, 5), false);
        }),
        &["pin.PA5"],
        "shorted to ground",
    )?;
    // Two gates, whose pull-downs are the drivers' own, weak ones; and two open pins.
    finds(
        Wiring::Nucleo,
        outside(|outside| outside.bridges.push([(0, 8), (0, 9)])),
        &["pin.PA8", "pin.PA9"],
        "the two are connected",
    )?;
    finds(
        Wiring::Mains,
        outside(|outside| outside.bridges.push([(0, 5), (1, 5)])),
        &["pin.PA5", "pin.PB5"],
        "the two are connected",
    )?;
    finds(
        Wiring::Nucleo,
        outside(|outside| {
            outside.circuits.remove(&(0, 15));
        }),
        &["pin.PA15"],
        "encoder is not connected",
    )?;
    // The fault line never comes to the timer: something holds it at the supply, whatever the driver does.
    finds(
        Wiring::Nucleo,
        outside(|outside| {
            outside.circuits.insert((1, 10), Circuit::Driven(true));
        }),
        &[],
        "holds it",
    )?;
    Ok(())
}

#[test]
fn encoders_flash_and_probe() -> Result<(), String> {
    finds(
        Wiring::Mains,
        |bench| {
            let chip = bench.emulator.chip();
            chip.provoked.stuck_encoder[0] = Some(u32::MAX);
        },
        // The drive that starts afterwards reports it too.
        &["drive.state", "encoder.screw"],
        "The sensor does not answer",
    )?;
    finds(
        Wiring::Mains,
        |bench| {
            let chip = bench.emulator.chip();
            chip.provoked.stuck_encoder[0] = Some(0);
        },
        &["encoder.screw"],
        "All bits are zero, always",
    )?;
    finds(
        Wiring::Mains,
        |bench| bench.emulator.chip().provoked.frame_errors[0] = 1 << 20,
        // The drive that starts afterwards reports it too.
        &["drive.state", "encoder.screw"],
        "Frames arrive damaged",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| bench.emulator.chip().faults.worn.stuck = true,
        &["flash.page"],
        "do not read back as written",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| {
            let chip = bench.emulator.chip();
            chip.faults.worn.protected = true;
            // What an earlier test has left.
            let at = (SIZE - PAGE) as u32;
            let word = [0xE0, 0xC3, 0x17, 0x5A, 0x1F, 0x3C, 0xE8, 0xA5];
            chip.flash.memory.write(at, &word).expect("an erased word");
        },
        &["flash.page"],
        "write-protected",
    )?;
    finds(
        Wiring::Nucleo,
        |bench| {
            let memory = &mut bench.emulator.chip().flash.memory;
            let word = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x12];
            memory
                .write((SIZE - 8) as u32, &word)
                .expect("an erased word");
        },
        &["flash.page"],
        "something else keeps data there",
    )?;
    Ok(())
}

#[test]
fn a_healthy_board_passes_the_second_stage() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let report = finds_in(&POWERED, board, |_| (), &[], "No finding.")?;
        println!("{board:?}\n{}", report.text());
        let open: Vec<_> = report.of(Verdict::Open).collect();
        assert!(open.is_empty(), "{open:?}");
        for id in ["zero.screwa", "noise.nutc", "comparator.5", "silicon"] {
            assert!(report.items.iter().any(|item| item.id == id), "{id}");
        }
    }
    Ok(())
}

#[test]
fn the_second_stage_refuses_a_bus_that_is_not_its_own() -> Result<(), String> {
    for (volts, says) in [(40.0, "Set the bus to 12 V, and"), (6.0, "check the wire")] {
        finds_in(
            &POWERED,
            Wiring::Nucleo,
            |bench| bench.joint.borrow_mut().board.set_bus_voltage(volts),
            &["bus.nutbus", "bus.screwbus"],
            says,
        )?;
    }
    Ok(())
}

#[test]
fn each_defect_of_the_second_stage_is_named() -> Result<(), String> {
    type Defect = (fn(&mut Bench), &'static [&'static str], &'static str);
    let defects: [Defect; 7] = [
        (
            |bench| bench.emulator.chip().faults.zero_off[0][1] = -400,
            &["zero.screwb"],
            "zero is not where",
        ),
        (
            |bench| bench.emulator.chip().faults.noise.push(((4, 4), 12.0)),
            &["noise.nuta"],
            "noisier",
        ),
        (
            |bench| {
                let chip = bench.emulator.chip();
                chip.change_stage(Motor::Nut, |stage| stage.enable_cut = true);
            },
            &["enable.nut"],
            "ENABLE does not reach",
        ),
        (
            |bench| {
                // The chip's own pull-up is all that holds the pin.
                let circuits = &mut bench.emulator.chip().outside.circuits;
                circuits.insert((1, 10), Circuit::PullUp(1e9));
            },
            &["nfault.screw"],
            "wire is torn",
        ),
        (
            |bench| bench.emulator.chip().faults.divider[1] = 0.9,
            &["bus.nutbus"],
            "0.9",
        ),
        (
            |bench| bench.emulator.chip().system.set_option_bytes(0xFFEF_F8AA),
            &["options.boot", "options.bor", "options.parity"],
            "-ob BOR_LEV=4",
        ),
        (
            |bench| bench.emulator.chip().faults.dead_comparators = 1 << 1,
            &["comparator.1"],
            "It stops nothing",
        ),
    ];
    for board in [Wiring::Nucleo, Wiring::Mains] {
        for (defect, ids, says) in defects {
            finds_in(&POWERED, board, defect, ids, says)?;
        }
    }
    Ok(())
}
