//! What the ADCs read is what their pins are at: each channel is sampled until it has settled, whatever was converted
//! before it.

use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, READY, counts_at, plate_of};
use tests::chip::adc;
use tests::chip::pwm::PwmTimer;
use tests::chip::wiring::Wiring;
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
                Some(counts) => counts,
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

/// Standard deviation of what the ADCs read less what their pins are at, counts, over all currents, while everything converts.
fn noise(bench: &mut Bench, board: Wiring) -> Result<f64, String> {
    let (mut squares, mut n) = (0.0, 0.0);
    for _ in 0..100 {
        for (_, read, pin) in read_and_true(bench, board)? {
            squares += (f64::from(read) - f64::from(pin)).powi(2);
            n += 1.0;
        }
        bench.pass(200e-6)?;
    }
    Ok(f64::sqrt(squares / n))
}

/// ES0430 2.7.9 or 2.7.11: ADCs whose clocks are divided and not in step disturb each other. The drive's are not divided; by the bus
/// clock divided by four, the noise would be past what is allowed.
#[test]
fn conversions_at_the_same_time_do_not_disturb_each_other() -> Result<(), String> {
    /// CKMODE 3 of a pair, with the internal reference.
    const BUS_BY_4: u32 = 3 << 16 | 1 << 22;
    for board in [Wiring::Nucleo, Wiring::Nucleo40kHz, Wiring::Mains] {
        let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
        bench.emulator.chip().tops = Some(Vec::new());
        bench.wait_for(READY, 0.2)?;
        let alone = noise(&mut bench, board)?;
        assert!(alone <= 0.5, "{board:?}: {alone} counts more than the pins");
        let chip = bench.emulator.chip();
        let now = chip.now;
        for pair in [0x5000_0308, 0x5000_0708] {
            adc::write(&mut chip.adcs, pair, BUS_BY_4, now)?;
        }
        let disturbed = noise(&mut bench, board)?;
        println!("{board:?}: {alone:.2} counts, by the divided clock {disturbed:.2}");
        assert!(disturbed > 0.5, "the test sees {disturbed} counts only");
    }
    Ok(())
}

/// Half ADC clocks of a conversion's approximation, and of its sampling by the code of SMPRx (RM0440 21.4.12).
const APPROXIMATION: u64 = 25;
const SAMPLING: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];

/// When an ADC has taken its first so many injected samples, core cycles after its trigger.
fn sampled_at(bench: &mut Bench, adc: usize, channels: u32) -> Vec<u64> {
    let registers = bench.emulator.chip().adcs[adc].registers();
    let (mut time, mut all) = (0, Vec::new());
    for rank in 0..channels {
        let channel = registers.get("JSQR") >> (9 + 6 * rank) & 31;
        let (name, at) = if channel < 10 {
            ("SMPR1", channel)
        } else {
            ("SMPR2", channel - 10)
        };
        let sampling = SAMPLING[(registers.get(name) >> (3 * at) & 7) as usize];
        // Two core cycles are half an ADC clock of 42.5 MHz.
        all.push(2 * (time + sampling));
        time += sampling + APPROXIMATION;
    }
    all
}

/// The dead time that a timer adds, core cycles (RM0440, TIMx_BDTR.DTG).
fn dead_time(bdtr: u32) -> i64 {
    let code = i64::from(bdtr & 0xFF);
    match code {
        0x00..=0x7F => code,
        0x80..=0xBF => 2 * (64 + (code & 0x3F)),
        0xC0..=0xDF => 8 * (32 + (code & 0x1F)),
        _ => 16 * (32 + (code & 0x1F)),
    }
}

/// Either motor is sampled around the bottom of the other's timer, the middle of that bridge's high-side pulses. With a compare
/// value `c` that bridge has its edges `c` before and after it, or a dead time later, by the current's sign. Where one of them
/// lies before a current's sample by less than its amplifier settles in, it is in the sample. How much of its voltage the other
/// bridge can use until then is what the wiring pages say.
#[test]
fn samples_are_clear_of_the_other_bridge_s_edges_up_to_what_the_pages_say() -> Result<(), String> {
    for (board, settling_s, page) in [
        // The amplifiers' settling at a gain of 10 V/V, from the wiring page.
        (Wiring::Nucleo, 300e-9, 0.92),
        (Wiring::Nucleo40kHz, 300e-9, 0.83),
        // The same is asked of the mains board's.
        (Wiring::Mains, 300e-9, 0.93),
    ] {
        let plate = plate_of(board);
        let config = plate.config().map_err(|misfit| misfit.to_string())?;
        let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
        bench.wait_for(READY, 0.2)?;
        // The second channel of ADC2 and ADC3 is phase c; that of the others is the bus.
        for (own, adcs) in [(0, [(0, 1), (1, 2)]), (1, [(3, 1), (2, 2)])] {
            let mut samples = Vec::new();
            for (adc, channels) in adcs {
                samples.extend(sampled_at(&mut bench, adc, channels));
            }
            let chip = bench.emulator.chip();
            let (timer, other) = (&chip.pwm[own], &chip.pwm[1 - own]);
            let period = timer.period();
            assert_eq!(period, other.period(), "{board:?}: the timers' periods");
            let tops = [timer, other].map(PwmTimer::next_top);
            let [Some(top), Some(other_top)] = tops else {
                return Err(format!("{board:?}: a timer stands: {tops:?}"));
            };
            // From the other's bottom to this one's top.
            let late = (top + period + period / 2 - other_top) % period;
            let late = late.cast_signed()
                - if late > period / 2 {
                    period.cast_signed()
                } else {
                    0
                };
            // The screw's counter starts one count ahead.
            assert!(
                late.abs() <= 1,
                "{board:?}: the timers are {late} counts off half a period, expected one at most"
            );
            let dead = dead_time(other.registers().get("BDTR"));
            let settling = (settling_s * plate.board.timer_hz).ceil() as i64;
            let clear = |compare: u16| {
                let compare = i64::from(compare);
                samples.iter().all(|&sample| {
                    let sample = sample.cast_signed();
                    let edges = [-compare, dead - compare, compare, compare + dead];
                    let mut each = edges.into_iter().map(|edge| edge - late);
                    each.all(|edge| edge > sample || edge + settling <= sample)
                })
            };
            let most = config.current_loops[1 - own].modulation.compare_max;
            let in_sample = (0..=most).rev().find(|&compare| !clear(compare));
            // Voltage zero is the middle of the permitted range.
            let centre = f64::from(most) / 2.0;
            let used = in_sample.map_or(1.0, |last| 1.0 - f64::from(last + 1) / centre);
            println!(
                "{board:?}, motor {own}: sampled {samples:?} cycles after its top; clear up to {used:.3} of the other's voltage"
            );
            assert!(
                (used - page).abs() < 0.006,
                "{board:?}, motor {own}: edges of the other bridge are in its samples from {used:.3} of that one's voltage on, \
                 expected from {page} on, as its page says, within 0.006"
            );
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
