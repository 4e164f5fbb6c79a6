//! Crystal, supply and core voltage that fail: the bridges open, whatever the code is doing.

use link::codes::{Demand, Fault, ResetReason, State};
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, FAULT, READY, RUNNING};
use tests::chip::Reset;
use tests::chip::system::Checked;
use tests::log::NOT_SET_UP;

fn running() -> Result<Bench, String> {
    Bench::new(&Model::coupled(), Coupling::Coupled)?.running(0.1)
}

fn enabled(bench: &mut Bench) -> [bool; 2] {
    let pwm = &bench.emulator.chip().pwm;
    [pwm[0].bridge().enabled, pwm[1].bridge().enabled]
}

fn says(bench: &mut Bench, sentence: &str) -> Result<(), String> {
    let log = bench.log()?;
    assert!(
        log.iter().any(|line| line.contains(sentence)),
        "`{sentence}` is not in the log: {log:#?}"
    );
    Ok(())
}

#[test]
fn a_crystal_that_stops_opens_the_bridges_and_keeps_them_open() -> Result<(), String> {
    let mut bench = running()?;
    bench.log()?;
    bench.emulator.chip().stop_crystal();
    // The clock security system breaks the timers, and the NMI resets.
    assert_eq!(enabled(&mut bench), [false; 2], "with no instruction");
    // At the internal clock the start copies its data and code for some milliseconds.
    bench.pass(8e-3)?;
    assert_eq!(bench.emulator.resets, [Reset::Software]);
    says(&mut bench, "the crystal stopped")?;
    // It does not start without a crystal, and each try reports it. A try ends in a reset, which clears the log.
    let mut said = false;
    for _ in 0..60 {
        bench.pass(5e-3)?;
        assert_eq!(enabled(&mut bench), [false; 2]);
        let log = match bench.log() {
            // A try has just begun.
            Err(error) if error == NOT_SET_UP => continue,
            log => log?,
        };
        said |= log
            .iter()
            .any(|line| line.contains("the crystal does not start"));
    }
    assert!(said, "it does not say that the crystal does not start");
    // The crystal is back.
    bench.emulator.chip().system.crystal = true;
    bench.wait_for(READY, 0.5)
}

/// What the clock security system is there for: without it the pins stay as they are until the watchdog, whose clock is
/// its own, ends it.
#[test]
fn without_the_clock_security_system_the_bridges_would_stand() -> Result<(), String> {
    let mut bench = running()?;
    bench.emulator.chip().system.security_off = true;
    bench.emulator.chip().stop_crystal();
    bench.pass(10e-3)?;
    assert_eq!(enabled(&mut bench), [true; 2], "10 ms later");
    bench.pass(20e-3)?;
    assert_eq!(bench.emulator.resets.first(), Some(&Reset::Watchdog));
    Ok(())
}

/// Flash is checked always, RAM where the option byte has parity on, as the wiring page asks.
#[test]
fn wrong_bits_open_the_bridges_and_reset_the_chip() -> Result<(), String> {
    for memory in [Checked::Flash, Checked::Ram] {
        let mut bench = running()?;
        bench.log()?;
        bench.emulator.chip().read_wrong_bits(memory);
        assert_eq!(
            enabled(&mut bench),
            [false; 2],
            "{memory:?}, with no instruction"
        );
        bench.pass(1e-3)?;
        assert_eq!(bench.emulator.resets, [Reset::Software], "{memory:?}");
        bench.wait_for(READY, 0.5)?;
        says(&mut bench, "flash or RAM has a wrong bit")?;
    }
    Ok(())
}

/// Bits of a store's page that a power cut left are forgiven while they are read. The same bank has code.
#[test]
fn wrong_bits_of_the_second_banks_code_are_not_taken_for_the_stores() -> Result<(), String> {
    let mut bench = running()?;
    bench.log()?;
    let chip = bench.emulator.chip();
    chip.flash.tear(0x0804_0000);
    chip.read_wrong_bits(Checked::Flash);
    bench.pass(1e-3)?;
    assert_eq!(bench.emulator.resets, [Reset::Software]);
    Ok(())
}

#[test]
fn a_supply_that_sags_opens_the_bridges_and_below_its_limit_resets_the_chip() -> Result<(), String>
{
    let mut bench = running()?;
    // Above the PVD's 2.9 V; no instruction runs until the next.
    bench.emulator.chip().set_supply(2.95);
    assert_eq!(enabled(&mut bench), [true; 2]);
    bench.emulator.chip().set_supply(2.85);
    assert_eq!(enabled(&mut bench), [false; 2], "with no instruction");
    bench.pass(1e-3)?;
    let status = bench.status()?;
    assert_eq!(
        (status.state, status.fault),
        (FAULT, Fault::ControllerSupply.word())
    );
    // Nothing closes them while it lasts.
    bench.demand(Demand::Reset)?;
    bench.pass(1e-3)?;
    assert_eq!(bench.status()?.state, FAULT);
    bench.emulator.chip().set_supply(3.3);
    bench.wait_for(READY, 0.2)?;
    bench.demand(Demand::Run)?;
    bench.pass(20e-3)?;
    assert_eq!(enabled(&mut bench), [true; 2]);
    // Brown-out level 4.
    bench.emulator.chip().set_supply(2.7);
    bench.pass(1e-3)?;
    assert_eq!(bench.emulator.resets, [Reset::BrownOut]);
    assert_eq!(enabled(&mut bench), [false; 2]);
    bench.wait_for(READY, 0.2)?;
    assert_eq!(bench.look()?.reset_reason(), Some(ResetReason::Power));
    Ok(())
}

/// What the internal reference shows is found while the drive can still stop: both motors come to rest, and only then the bridges open.
#[test]
fn a_supply_that_falls_slowly_stops_the_drive_before_it_breaks() -> Result<(), String> {
    let mut bench = running()?;
    bench.emulator.chip().set_supply(3.15);
    bench.pass(0.1)?;
    assert_eq!(bench.status()?.state, RUNNING, "4.5 % low is a regulator's");
    let millivolts = f64::from(bench.look()?.words().supply);
    assert!((millivolts / 3150.0 - 1.0).abs() < 1e-3, "{millivolts} mV");
    bench.emulator.chip().set_supply(3.05);
    bench.pass(4e-3)?;
    let status = bench.status()?;
    assert_eq!(
        (status.state, enabled(&mut bench)),
        (State::Stopping.word(), [true; 2]),
        "it stops, and both bridges drive"
    );
    bench.wait_for(FAULT, 1.0)?;
    assert_eq!(bench.status()?.fault, Fault::ControllerSupply.word());
    Ok(())
}

#[test]
fn a_drive_without_boost_mode_does_not_start_and_says_why() -> Result<(), String> {
    let mut bench = Bench::new(&Model::coupled(), Coupling::Coupled)?;
    bench.emulator.chip().system.no_boost = true;
    bench.pass(0.1)?;
    assert!(
        !bench.emulator.resets.is_empty(),
        "it refuses, and tries again"
    );
    assert_eq!(enabled(&mut bench), [false; 2]);
    // It starts again and again, and has no log before it has set one up.
    let logs = |bench: &mut Bench| {
        Ok(bench
            .log()
            .is_ok_and(|log| log.join(" ").contains("not in boost mode")))
    };
    bench.until("`not in boost mode` in the log", 0.1, 100e-6, logs)?;
    bench.emulator.chip().system.no_boost = false;
    bench.wait_for(READY, 0.2)
}

#[test]
fn option_bytes_that_leave_the_brown_out_low_are_told() -> Result<(), String> {
    let mut bench = Bench::new(&Model::coupled(), Coupling::Coupled)?;
    // As a chip comes from the factory (RM0440 3.4.1): brown-out level 0, PB8 picks what boots.
    bench.emulator.chip().system.set_option_bytes(0xFFEF_F8AA);
    bench.wait_for(READY, 0.2)?;
    let log = bench.log()?.join("\n");
    for sentence in [
        "-ob BOR_LEV=4",
        "-ob SRAM_PE=0",
        "-ob nSWBOOT0=0",
        "silicon revision 0x2003",
    ] {
        assert!(
            log.contains(sentence),
            "`{sentence}` is not in the log: {log}"
        );
    }
    Ok(())
}

/// RAM holds anything after a power-on, and parity finds that wrong when it is read. A later reset keeps what was written.
#[test]
fn a_start_reads_no_memory_that_parity_finds_wrong() -> Result<(), String> {
    let mut bench = Bench::new(&Model::coupled(), Coupling::Coupled)?;
    bench.emulator.enforce_parity()?;
    bench.wait_for(READY, 0.2)?;
    assert_eq!(bench.emulator.resets, [], "a wrong bit resets the chip");
    bench.emulator.chip().reset = Some(Reset::Software);
    bench.pass(1e-3)?;
    bench.wait_for(READY, 0.2)?;
    assert_eq!(bench.emulator.resets, [Reset::Software]);
    Ok(())
}

/// LSI, the watchdog's clock, is 29.5 to 34 kHz (DS12288): a drive that works is not reset, and one that hangs is.
#[test]
fn the_watchdog_bites_in_time_over_the_range_of_its_clock() -> Result<(), String> {
    for lsi_hz in [29.5e3, 34e3] {
        let mut bench = Bench::new(&Model::coupled(), Coupling::Coupled)?;
        bench.emulator.chip().faults.lsi_hz = lsi_hz;
        bench = bench.running(0.2)?;
        assert_eq!(bench.emulator.resets, [], "{lsi_hz} Hz");
        bench.hang("FMAC")?;
        bench.pass(24e-3)?;
        assert_eq!(bench.emulator.resets, [Reset::Watchdog], "{lsi_hz} Hz");
    }
    Ok(())
}

/// A NUCLEO-G474RE was delivered with an STM32G474RB: 128 KB.
#[test]
fn a_chip_without_room_for_the_settings_is_told() -> Result<(), String> {
    let mut bench = Bench::new(&Model::coupled(), Coupling::Coupled)?;
    bench.emulator.set_flash_size(128)?;
    bench.wait_for(READY, 0.2)?;
    let log = bench.log()?.join("\n");
    assert!(log.contains("the flash has 128 KB in one bank"), "{log}");
    Ok(())
}
