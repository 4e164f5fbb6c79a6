//! The log that a probe would show, from the emulated chip's memory.

use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, READY};

#[test]
fn the_log_names_the_reason_of_each_reset() -> Result<(), String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    assert_eq!(
        bench.log()?,
        ["started after a reset by power", "silicon revision 0x2003"]
    );
    assert_eq!(bench.log()?, [""; 0], "a line is read once");
    bench.hang("FMAC")?;
    bench.pass(40e-3)?;
    // The supervision is below the speed task and cannot speak while that one hangs.
    assert_eq!(
        bench.log()?,
        [
            "started after a reset by watchdog",
            "silicon revision 0x2003"
        ]
    );
    Ok(())
}

#[test]
fn a_hung_task_is_named_before_the_watchdog_bites() -> Result<(), String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    bench.log()?;
    // The nut's current loop no longer runs, for its interrupt is masked; all others do.
    bench.emulator.chip().write(0xE000_E184, 4, 1 << (61 - 32));
    bench.pass(5e-3)?;
    let log = bench.log()?;
    assert!(
        !log.is_empty()
            && log
                .iter()
                .all(|line| line == "no progress in a millisecond: nut current loop"),
        "{log:?}"
    );
    Ok(())
}
