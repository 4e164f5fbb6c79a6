//! What the ADCs read is what their pins are at: each channel is sampled until it has settled, whatever was converted
//! before it.

use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, READY, counts_at};
use tests::chip::adc;
use tests::chip::wiring::{Input, Wiring};
use tests::pins::Motor;

/// Channels that the ADCs convert at each top: number of the ADC, channel, whose top, and the address of the result.
const INJECTED: u32 = 0x80;

/// What an ADC's injected results are, and what its channels' pins are at, for all ADCs.
fn read_and_true(bench: &mut Bench, board: Wiring) -> Result<Vec<(String, u32, u16)>, String> {
    bench.settle_untold()?;
    let chip = bench.emulator.chip();
    let tops = chip.tops.as_ref().ok_or("the tops are not kept")?;
    let last = |motor| {
        tops.iter()
            .rfind(|top| top.motor == motor)
            .map(|top| top.sensors)
    };
    let sensors = [Motor::Screw, Motor::Nut].map(|motor| last(motor).unwrap_or_default());
    let mut all = Vec::new();
    for index in 0..4 {
        let base = [0x5000_0000, 0x5000_0100, 0x5000_0400, 0x5000_0500][index];
        let sequence = adc::read(&mut chip.adcs, base + 0x4C)?;
        for (rank, shift) in [9, 15].into_iter().enumerate() {
            let channel = sequence >> shift & 31;
            let at =
                base + INJECTED + 4 * u32::try_from(rank).map_err(|error| error.to_string())?;
            let result = adc::read(&mut chip.adcs, at)?;
            let pin = match board.input(index, channel, &sensors) {
                Some(Input::Pin(counts) | Input::Amplifier(_, counts)) => counts,
                None => return Err(format!("nothing is wired to channel {channel}")),
            };
            all.push((format!("ADC{} channel {channel}", index + 1), result, pin));
        }
    }
    Ok(all)
}

#[test]
fn each_channel_settles_within_its_sampling_time() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        // From one end of the range to the other: the largest step that the sampling capacitor can make.
        for (volts, celsius) in [(0.0, -30.0), (0.97, 80.0)] {
            let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
            let bus = tests::bench::board_config(board).sensors.bus;
            let range = bus.per_count * f64::from(bus.counts);
            bench
                .joint
                .borrow_mut()
                .board
                .set_bus_voltage(volts * range);
            bench.joint.borrow_mut().temperatures = counts_at(board, celsius);
            bench.emulator.chip().tops = Some(Vec::new());
            bench.pass(60e-3)?;
            for _ in 0..20 {
                for (name, read, pin) in read_and_true(&mut bench, board)? {
                    assert_eq!(
                        read,
                        u32::from(pin),
                        "{board:?}, bus at {volts} of its range: {name} reads {read} where its pin is at {pin} counts"
                    );
                }
                bench.pass(1e-3)?;
            }
        }
    }
    Ok(())
}

/// The same model with a capacitor missing: the reading depends on the channel before, as on a board.
#[test]
fn without_its_capacitor_a_divider_reads_wrong() -> Result<(), String> {
    let mut bench = Bench::on(Wiring::Nucleo, &Model::paper(), Coupling::Lumped)?;
    // 82 kohm and 4.99 kohm, from the wiring page.
    let ohm = 82e3 * 4.99e3 / (82e3 + 4.99e3);
    bench.emulator.chip().faults.source_ohm.push(((1, 6), ohm));
    bench.emulator.chip().tops = Some(Vec::new());
    bench.wait_for(READY, 0.2)?;
    let all = read_and_true(&mut bench, Wiring::Nucleo)?;
    let (_, read, pin) = all
        .iter()
        .find(|(name, ..)| name == "ADC1 channel 6")
        .ok_or("the bus is not converted")?;
    let off = f64::from(*read) - f64::from(*pin);
    println!("the bus reads {off} counts off its {pin}");
    assert!(
        off.abs() > 20.0,
        "{off} counts off: a source of {ohm:.0} ohm settles within {} ns?",
        153
    );
    Ok(())
}

/// The first conversion after the drivers' millisecond of waking may be anything (ES0430 2.7.7): the drive starts all the
/// same, on all boards, and with no fault.
#[test]
fn a_first_conversion_that_is_wrong_is_not_used() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
        bench.wait_for(READY, 0.2)?;
    }
    Ok(())
}
