//! Halt, registers, memory, breakpoints, steps, watchpoints, reset and faults.

use crate::emulated::{Emulated, PATIENCE};
use crate::figures::keep;
use crate::source;
use plant::machine::Coupling;
use plant::model::Model;
use probe_rs::{
    BreakpointCause, Core, CoreStatus, HaltReason, MemoryInterface, RegisterId,
    VectorCatchCondition,
};
use std::time::Instant;
use tests::bench::{Bench, READY};
use tests::chip::{CORE_HZ, Reset};
use tests::emulator::{Emulator, HaltedTime};

/// xPSR is the register after the sixteen that programs name; MSP and PSP follow it.
const REGISTERS: u16 = 18;
const PC: RegisterId = RegisterId(15);

fn running() -> Result<Bench, String> {
    Bench::new(&Model::paper(), Coupling::Lumped)?.running(20e-3)
}

fn frozen() -> Emulated {
    Emulated::start(HaltedTime::Frozen, running)
}

#[test]
fn registers_stack_and_statics_are_the_chips() {
    let chip = frozen();
    let began = Instant::now();
    let mut session = chip.attach().unwrap();
    keep("attach_s", began.elapsed().as_secs_f64());
    let mut core = session.core(0).unwrap();
    core.halt(PATIENCE).unwrap();
    let halted = CoreStatus::Halted(HaltReason::Request);
    assert_eq!(core.status().unwrap(), halted);
    for number in 0..=REGISTERS {
        let value: u32 = core.read_core_reg(RegisterId(number)).unwrap();
        let truth = chip.ask(move |bench| bench.emulator.core_register(number.into()));
        assert_eq!(Ok(value), truth, "register {number}");
    }
    let stack: u32 = core.read_core_reg(RegisterId(13)).unwrap();
    let view = chip
        .ask(|bench| bench.image.symbol(link::VIEW_SYMBOL))
        .unwrap();
    for (what, start, size) in [("stack", stack, 256), ("view", view, 128)] {
        let mut bytes = vec![0; size];
        core.read(start.into(), &mut bytes).unwrap();
        let truth = chip.ask(move |bench| bench.emulator.bytes(start, size));
        assert_eq!(Ok(bytes), truth, "{what}");
    }
    // What a debugger writes, the program has.
    core.write_core_reg(RegisterId(3), 0x1234_5678_u32).unwrap();
    core.write_word_32((stack - 4).into(), 0x8765_4321).unwrap();
    let (register, word) = chip.ask(move |bench| {
        let emulator = &bench.emulator;
        (emulator.core_register(3), emulator.word(stack - 4))
    });
    assert_eq!((register, word), (Ok(0x1234_5678), Ok(0x8765_4321)));
}

#[test]
fn a_register_that_the_model_lacks_is_an_error_that_names_it() {
    let chip = frozen();
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    // DWT_CPICNT, and a timer that the firmware does not use.
    for address in [0xE000_1008, 0x4000_0400] {
        assert!(core.read_word_32(address).is_err(), "{address:#x}");
        let refused = chip.ask_all(|served| std::mem::take(&mut served.server.refused));
        let name = format!("{address:#010x}");
        assert!(
            refused.iter().any(|text| text.contains(&name)),
            "{refused:?}"
        );
    }
    // The session and the program go on.
    core.halt(PATIENCE).unwrap();
    core.run().unwrap();
    assert_eq!(chip.ask(|bench| bench.pass(1e-3)), Ok(()));
}

#[test]
fn a_breakpoint_in_the_current_loop_hits_every_period_and_changes_nothing() {
    const HITS: usize = 60;
    let keeping = || {
        let mut bench = running()?;
        bench.emulator.chip().tops = Some(Vec::new());
        Ok(bench)
    };
    let chip = Emulated::start(HaltedTime::Frozen, keeping);
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    core.halt(PATIENCE).unwrap();
    let elf = chip.ask(|bench| bench.image.file.clone());
    let places = source::inlined(&elf, "period", "CurrentLoop").unwrap();
    assert_eq!(places.len(), 2, "the screw's and the nut's: {places:x?}");
    for &place in &places {
        core.set_hw_breakpoint(place).unwrap();
    }
    let mut hits = Vec::new();
    for _ in 0..HITS {
        core.run().unwrap();
        core.wait_for_core_halted(PATIENCE).unwrap();
        let broken = CoreStatus::Halted(HaltReason::Breakpoint(BreakpointCause::Unknown));
        assert_eq!(core.status().unwrap(), broken);
        let place: u32 = core.read_core_reg(PC).unwrap();
        hits.push((u64::from(place), chip.ask(|bench| bench.emulator.time())));
    }
    // Each motor's in turn, half a period apart but for what the core has to do first.
    let half = chip.ask(|bench| bench.emulator.chip().pwm[0].period()) / 2;
    for pair in hits.windows(2) {
        let [(one, before), (other, then)] = [pair[0], pair[1]];
        assert!(
            one != other && places.contains(&one),
            "{one:#x}, {other:#x}"
        );
        let apart = then - before;
        assert!(
            apart.abs_diff(half) < half / 4,
            "{apart} cycles, half a period is {half}"
        );
    }
    for &place in &places {
        core.clear_hw_breakpoint(place).unwrap();
    }
    core.run().unwrap();
    let debugged = chip.ask(|bench| {
        bench
            .pass(1e-3)
            .map(|()| bench.emulator.chip().tops.take().unwrap_or_default())
    });
    // The same without a debugger.
    let mut alone = keeping().unwrap();
    let ended = chip.ask(|bench| bench.emulator.time());
    let seconds = (ended - alone.emulator.time()) as f64 / CORE_HZ as f64;
    alone.pass(seconds).unwrap();
    let undisturbed = alone.emulator.chip().tops.take().unwrap();
    let debugged = debugged.unwrap();
    assert!(debugged.len() > HITS, "{} tops", debugged.len());
    assert_eq!(debugged[..], undisturbed[..debugged.len()]);
    keep("breakpoints_hit", hits.len());
}

/// The second chip stands where and when a debugger has halted the first: before a period of the screw.
fn twin(place: u32, time: u64) -> Bench {
    /// What of the way is gone without a breakpoint; the rest is less than a period.
    const LEFT: u64 = 4000;
    let mut bench = running().unwrap();
    let seconds = (time - LEFT - bench.emulator.time()) as f64 / CORE_HZ as f64;
    bench.pass(seconds).unwrap();
    let emulator = &mut bench.emulator;
    emulator.halted_time = HaltedTime::Frozen;
    let comparator = place & !3 | if place & 2 == 0 { 1 << 30 } else { 2 << 30 } | 1;
    write(emulator, 0xE000_EDF0, 0xA05F_0001);
    write(emulator, 0xE000_2008, comparator);
    write(emulator, 0xE000_2000, 3);
    emulator.run_until(time + LEFT).unwrap();
    assert_eq!(
        (emulator.core_register(15), emulator.time()),
        (Ok(place), time)
    );
    // It does not break there again.
    write(emulator, 0xE000_2000, 2);
    bench
}

fn write(emulator: &mut Emulator, register: u32, word: u32) {
    emulator
        .debugger_writes(register, &word.to_le_bytes())
        .unwrap();
}

/// Halts a running chip before the screw's current loop: where, and when.
///
/// A halt wakes a core that sleeps (ARMv7-M B1.5.19), and the program goes once more through its idle loop. That ends within the periods
/// that are passed: then the program is where it would be without the halt.
fn at_the_screws_loop(core: &mut Core<'_>, chip: &Emulated) -> (u32, u64) {
    const PERIODS: u32 = 40;
    core.halt(PATIENCE).unwrap();
    let place = chip.ask(|bench| bench.image.symbol("ADC1_2")).unwrap() & !1;
    core.set_hw_breakpoint(place.into()).unwrap();
    for _ in 0..PERIODS {
        core.run().unwrap();
        core.wait_for_core_halted(PATIENCE).unwrap();
        assert_eq!(core.read_core_reg::<u32>(PC).unwrap(), place);
    }
    core.clear_hw_breakpoint(place.into()).unwrap();
    (place, chip.ask(|bench| bench.emulator.time()))
}

#[test]
fn a_thousand_steps_go_where_the_program_goes_without_them() {
    const STEPS: usize = 1000;
    let chip = frozen();
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    let (place, time) = at_the_screws_loop(&mut core, &chip);
    let mut steps = vec![place];
    for _ in 1..STEPS {
        #[allow(clippy::cast_possible_truncation)]
        steps.push(core.step().unwrap().pc as u32);
    }
    // It runs on with interrupts masked, as they are in a step.
    let mut twin = twin(place, time);
    twin.emulator.trace().unwrap();
    write(&mut twin.emulator, 0xE000_EDF0, 0xA05F_000B);
    write(&mut twin.emulator, 0xE000_EDF0, 0xA05F_0009);
    let limit = twin.emulator.time() + 20 * STEPS as u64;
    twin.emulator.run_until(limit).unwrap();
    let traced = without_it_blocks(&twin);
    assert!(traced.len() >= STEPS, "{} instructions", traced.len());
    let apart = (0..STEPS).find(|&k| steps[k] != traced[k]);
    assert_eq!(apart, None, "the first step that differs");
    keep("steps_equal", steps.len());
    let different: std::collections::BTreeSet<_> = steps.iter().collect();
    assert!(different.len() > 300, "{} addresses", different.len());
}

/// What was traced, with each IT block as one instruction: as the engine steps it.
fn without_it_blocks(bench: &Bench) -> Vec<u32> {
    let mut end = 0;
    let mut start = 0;
    let mut list = Vec::new();
    for &at in bench.emulator.traced() {
        if (start..end).contains(&at) {
            continue;
        }
        list.push(at);
        let code = bench.emulator.bytes(at, 2).unwrap();
        let opcode = u16::from_le_bytes([code[0], code[1]]);
        // 1011 1111 cond mask, mask not zero: the lowest one says how many follow.
        if opcode & 0xFF00 == 0xBF00 && opcode & 0xF != 0 {
            let follow = 4 - (opcode & 0xF).trailing_zeros();
            (start, end) = (at + 2, at + 2);
            for _ in 0..follow {
                let code = bench.emulator.bytes(end, 2).unwrap();
                end += if code[1] >> 3 >= 0b11101 { 4 } else { 2 };
            }
        }
    }
    list
}

#[test]
fn a_watchpoint_on_a_compare_register_halts_after_the_store() {
    const CCR1: u32 = 0x4001_2C34;
    /// What the firmware does not write.
    const OTHER: u32 = 7;
    let chip = frozen();
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    let (place, time) = at_the_screws_loop(&mut core, &chip);
    core.write_word_32(CCR1.into(), OTHER).unwrap();
    let unit: u64 = 0xE000_1020;
    // DEMCR.TRCENA is the firmware's already; writes to one word.
    for (register, value) in [(unit, CCR1), (unit + 4, 2), (unit + 8, 6)] {
        core.write_word_32(register, value).unwrap();
    }
    core.run().unwrap();
    core.wait_for_core_halted(PATIENCE).unwrap();
    assert_eq!(
        core.status().unwrap(),
        CoreStatus::Halted(HaltReason::Watchpoint)
    );
    assert_eq!(
        core.read_word_32(unit + 8).unwrap(),
        6 | 1 << 24,
        "it has matched"
    );
    let after = core.read_word_32(CCR1.into()).unwrap();
    assert_ne!(after, OTHER, "the store has not been made");
    let halted: u32 = core.read_core_reg(PC).unwrap();
    // The twin steps until the register changes.
    let mut twin = twin(place, time);
    write(&mut twin.emulator, CCR1, OTHER);
    let mut word = OTHER.to_le_bytes();
    let mut steps = 0;
    while u32::from_le_bytes(word) == OTHER {
        write(&mut twin.emulator, 0xE000_EDF0, 0xA05F_000D);
        twin.emulator.debugger_reads(CCR1, &mut word).unwrap();
        steps += 1;
        assert!(steps < 2000, "the register does not change");
    }
    assert_eq!(
        twin.emulator.core_register(15),
        Ok(halted),
        "after {steps} steps"
    );
}

#[test]
fn a_reset_halts_at_the_first_instruction_and_the_drive_starts_anew() {
    let chip = frozen();
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    let pc = core.reset_and_halt(PATIENCE).unwrap().pc;
    let entry = chip.ask(|bench| bench.emulator.word(0x0800_0004)).unwrap();
    assert_eq!(pc, u64::from(entry & !1));
    let stack: u32 = core.read_core_reg(RegisterId(13)).unwrap();
    assert_eq!(
        Ok(stack),
        chip.ask(|bench| bench.emulator.word(0x0800_0000))
    );
    assert_eq!(
        chip.ask(|bench| bench.emulator.resets.clone()),
        [Reset::Software]
    );
    core.run().unwrap();
    assert_eq!(chip.ask(|bench| bench.wait_for(READY, 0.2)), Ok(()));
    // Without the catch it runs at once.
    core.reset().unwrap();
    assert_eq!(chip.ask(|bench| bench.wait_for(READY, 0.2)), Ok(()));
    assert_eq!(chip.ask(|bench| bench.emulator.resets.len()), 2);
}

#[test]
fn a_hard_fault_is_caught_where_it_happens() {
    const UNDEFINED: u16 = 0xDE00;
    let chip = frozen();
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    at_the_screws_loop(&mut core, &chip);
    let place = chip.ask(|bench| bench.image.symbol("ADC4")).unwrap() & !1;
    core.enable_vector_catch(VectorCatchCondition::HardFault)
        .unwrap();
    core.write_16(place.into(), &[UNDEFINED]).unwrap();
    core.run().unwrap();
    core.wait_for_core_halted(PATIENCE).unwrap();
    assert_eq!(
        core.status().unwrap(),
        CoreStatus::Halted(HaltReason::Exception)
    );
    let handler = chip.ask(|bench| bench.emulator.word(0x0800_000C)).unwrap();
    assert_eq!(core.read_core_reg::<u32>(PC).unwrap(), handler & !1);
    let stack: u32 = core.read_core_reg(RegisterId(13)).unwrap();
    let stacked = core.read_word_32(u64::from(stack) + 24).unwrap();
    assert_eq!(stacked, place, "where it happened");
    // An undefined instruction, escalated.
    assert_eq!(core.read_word_32(0xE000_ED28).unwrap(), 1 << 16);
    assert_eq!(core.read_word_32(0xE000_ED2C).unwrap(), 1 << 30);
}
