//! The emulated chip and the boards against what others know of the chip: `stm32-metapac`, which is made of ST's own
//! database (pins, alternate functions, requests, vectors, clocks, registers), and the SVD-made `stm32g4` (reset values,
//! which the first has not).

use plant::machine::Coupling;
use plant::model::Model;
use std::collections::BTreeSet;
use stm32_metapac::metadata::ir::{Block, BlockItemInner, IR};
use stm32_metapac::metadata::{METADATA, Peripheral};
use tests::bench::{Bench, READY};
use tests::chip::adc::{Adc, REFERENCE};
use tests::chip::analog::Dac;
use tests::chip::basic_timer::BasicTimer;
use tests::chip::clocks::GATED;
use tests::chip::encoder::EncoderTimer;
use tests::chip::pwm::PwmTimer;
use tests::chip::registers::Registers;
use tests::chip::serial::{self, Serial};
use tests::chip::system::System;
use tests::chip::wiring::Wiring;
use tests::chip::{ADC_REQUESTS, Chip, SPI1_RECEIVED, TIMER_REQUESTS, nvic};
use tests::cost::INTERRUPTS;

fn peripheral(name: &str) -> &'static Peripheral {
    METADATA
        .peripherals
        .iter()
        .find(|peripheral| peripheral.name == name)
        .unwrap_or_else(|| panic!("ST's database has no peripheral {name}"))
}

fn block(ir: &'static IR, name: &str) -> &'static Block {
    let same = |block: &&Block| {
        block.name.eq_ignore_ascii_case(&name.replace('_', ""))
            || block.name.eq_ignore_ascii_case(name)
    };
    ir.blocks
        .iter()
        .find(same)
        .unwrap_or_else(|| panic!("no block {name}"))
}

/// Name and offset of each register of a block, with those of the blocks that it extends; an array's one by one.
fn layout(ir: &'static IR, name: &str) -> Vec<(String, u32)> {
    let block = block(ir, name);
    let mut all = block.extends.map_or(Vec::new(), |base| layout(ir, base));
    for item in block.items {
        if !matches!(item.inner, BlockItemInner::Register(_)) {
            continue;
        }
        use stm32_metapac::metadata::ir::Array;
        let offsets: Vec<u32> = match &item.array {
            None => vec![0],
            Some(Array::Regular(array)) => (0..array.len).map(|k| k * array.stride).collect(),
            Some(Array::Cursed(array)) => array.offsets.to_vec(),
        };
        for offset in offsets {
            all.push((item.name.to_owned(), item.byte_offset + offset));
        }
    }
    all
}

/// Letters of a register's name: an array's has no number, and ST's `CCMR1` is `ccmr_input` there.
fn letters(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphabetic)
        .map(|letter| letter.to_ascii_lowercase())
        .collect()
}

fn emulated() -> Vec<Registers> {
    let mut all: Vec<Registers> = System::new().registers().cloned().collect();
    all.extend(["TIM1", "TIM8"].map(|name| PwmTimer::new(name).registers().clone()));
    all.extend(
        [("TIM2", u32::MAX), ("TIM5", u32::MAX), ("TIM4", 0xFFFF)]
            .map(|(name, reload)| EncoderTimer::new(name, reload).registers().clone()),
    );
    all.push(BasicTimer::new().registers().clone());
    all.extend([1, 2, 3, 4].map(|number| Adc::new(number).registers().clone()));
    all.push(Serial::new().registers().clone());
    all.extend(["DAC3", "DAC4"].map(|name| Dac::new(name).registers().clone()));
    all
}

#[test]
fn registers_have_their_names_and_places() {
    let mut held = 0;
    for registers in emulated() {
        let (name, table) = registers.layout();
        let known = peripheral(name)
            .registers
            .as_ref()
            .unwrap_or_else(|| panic!("{name} has no registers there"));
        let layout = layout(known.ir, known.block);
        for (register, offset, _) in table {
            let mut here = layout.iter().filter(|(_, at)| *at == offset).peekable();
            assert!(
                here.peek().is_some(),
                "{name} has nothing at {offset:#x}, where the emulator has {register}"
            );
            let names: Vec<&String> = here.map(|(name, _)| name).collect();
            let ours = letters(register);
            assert!(
                names.iter().any(|theirs| {
                    let theirs = letters(theirs);
                    theirs.starts_with(&ours) || ours.starts_with(&theirs)
                }),
                "{name} at {offset:#x} has {names:?}, the emulator {register}"
            );
            held += 1;
        }
    }
    println!("{held} registers");
    assert!(held > 120, "{held} registers are not all of them");
}

#[test]
fn peripherals_are_where_they_are_and_have_their_clocks() {
    let rcc = peripheral("RCC")
        .registers
        .as_ref()
        .expect("it has registers");
    for gated in GATED {
        let known = peripheral(gated.name);
        assert_eq!(u64::from(gated.start), known.address, "{}", gated.name);
        let enable = known.rcc.as_ref().and_then(|rcc| rcc.enable.as_ref());
        let enable = enable.unwrap_or_else(|| panic!("{} has no clock there", gated.name));
        let (_, offset) = layout(rcc.ir, rcc.block)
            .into_iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(enable.register))
            .unwrap_or_else(|| panic!("RCC has no {}", enable.register));
        let fields = rcc
            .ir
            .fieldsets
            .iter()
            .find(|set| set.name.eq_ignore_ascii_case(enable.register))
            .unwrap_or_else(|| panic!("no fields of {}", enable.register))
            .fields;
        let field = fields
            .iter()
            .find(|field| field.name.eq_ignore_ascii_case(enable.field))
            .unwrap_or_else(|| panic!("no field {}", enable.field));
        use stm32_metapac::metadata::ir::BitOffset;
        let BitOffset::Regular(bit) = &field.bit_offset else {
            panic!("{} is in pieces", enable.field);
        };
        assert_eq!(
            (gated.register, gated.bit),
            (offset, bit.offset),
            "clock of {}",
            gated.name
        );
    }
}

#[test]
fn vectors_and_requests_are_those_of_the_chip() {
    let number = |name: &str| {
        METADATA
            .interrupts
            .iter()
            .find(|interrupt| interrupt.name == name)
            .unwrap_or_else(|| panic!("no interrupt {name}"))
            .number as usize
    };
    for (name, line) in [
        ("ADC1_2", nvic::ADC1_2),
        ("ADC3", nvic::ADC3),
        ("ADC4", nvic::ADC4),
    ] {
        assert_eq!(number(name), line, "{name}");
    }
    let shared = |start: &str| {
        let found = METADATA
            .interrupts
            .iter()
            .find(|i| i.name.starts_with(start));
        found.map(|interrupt| interrupt.number as usize)
    };
    assert_eq!(shared("TIM7"), Some(nvic::TIM7));
    for interrupt in INTERRUPTS {
        assert_eq!(
            number(interrupt.handler),
            interrupt.line,
            "{}",
            interrupt.name
        );
    }

    let request = |name: &str, signal: &str| {
        let channels = peripheral(name).dma_channels;
        let known = channels.iter().find(|channel| channel.signal == signal);
        known
            .and_then(|channel| channel.request)
            .unwrap_or_else(|| panic!("{name} has no request {signal}"))
    };
    for (index, name) in ["ADC1", "ADC2", "ADC3", "ADC4"].into_iter().enumerate() {
        assert_eq!(request(name, name), ADC_REQUESTS[index], "{name}");
    }
    for (index, name) in ["TIM2", "TIM5"].into_iter().enumerate() {
        for channel in 1..=4 {
            let known = request(name, &format!("CH{channel}"));
            assert_eq!(
                known,
                TIMER_REQUESTS[index] + channel - 1,
                "{name} channel {channel}"
            );
        }
    }
    assert_eq!(request("SPI1", "RX"), SPI1_RECEIVED);
    assert_eq!(request("LPUART1", "RX"), serial::RECEIVED);
    assert_eq!(request("LPUART1", "TX"), serial::SENDS);
}

/// Each reset value that is not zero, and that of each register whose value matters at the start.
#[test]
fn reset_values_are_those_of_the_svd() {
    use stm32g4::stm32g474 as svd;
    let mut held = BTreeSet::new();
    let all = emulated();
    let mut check = |name: &'static str, register: &'static str, reset: u64| {
        let (_, table) = all
            .iter()
            .map(Registers::layout)
            .find(|(peripheral, _)| *peripheral == name)
            .unwrap_or_else(|| panic!("the emulator has no {name}"));
        let (_, _, ours) = table
            .iter()
            .find(|(known, ..)| *known == register)
            .unwrap_or_else(|| panic!("the emulator has no {name}_{register}"));
        assert_eq!(
            u64::from(*ours),
            reset,
            "{name}_{register}: {ours:#x}, the SVD says {reset:#x}"
        );
        held.insert((name, register));
    };
    macro_rules! resets {
        ($($name:literal $register:literal: $($path:ident)::+;)*) => {
            $(check($name, $register, u64::from(<svd::$($path)::+ as svd_generic::Resettable>::RESET_VALUE));)*
        };
    }
    use stm32g4 as svd_generic;
    resets! {
        "RCC" "CR": rcc::cr::CRrs;
        "RCC" "CFGR": rcc::cfgr::CFGRrs;
        "RCC" "PLLCFGR": rcc::pllcfgr::PLLCFGRrs;
        "RCC" "AHB1ENR": rcc::ahb1enr::AHB1ENRrs;
        "RCC" "AHB2ENR": rcc::ahb2enr::AHB2ENRrs;
        "RCC" "APB1ENR1": rcc::apb1enr1::APB1ENR1rs;
        "RCC" "APB2ENR": rcc::apb2enr::APB2ENRrs;
        "PWR" "CR1": pwr::cr1::CR1rs;
        "PWR" "CR2": pwr::cr2::CR2rs;
        "PWR" "CR3": pwr::cr3::CR3rs;
        "PWR" "CR5": pwr::cr5::CR5rs;
        "SYSCFG" "CFGR2": syscfg::cfgr2::CFGR2rs;
        "GPIOA" "MODER": gpioa::moder::MODERrs;
        "GPIOA" "OSPEEDR": gpioa::ospeedr::OSPEEDRrs;
        "GPIOA" "PUPDR": gpioa::pupdr::PUPDRrs;
        "GPIOB" "MODER": gpiob::moder::MODERrs;
        "GPIOB" "PUPDR": gpiob::pupdr::PUPDRrs;
        "GPIOC" "MODER": gpioc::moder::MODERrs;
        "GPIOD" "MODER": gpioc::moder::MODERrs;
        "GPIOE" "MODER": gpioc::moder::MODERrs;
        "GPIOF" "MODER": gpioc::moder::MODERrs;
        "TIM1" "ARR": tim1::arr::ARRrs;
        "TIM8" "ARR": tim1::arr::ARRrs;
        "TIM1" "BDTR": tim1::bdtr::BDTRrs;
        "TIM2" "ARR": tim2::arr::ARRrs;
        "TIM5" "ARR": tim2::arr::ARRrs;
        "ADC1" "CFGR": adc1::cfgr::CFGRrs;
        "ADC1" "TR1": adc1::tr1::TR1rs;
        "ADC1" "TR2": adc1::tr2::TR2rs;
        "ADC2" "CFGR": adc1::cfgr::CFGRrs;
        "ADC2" "TR1": adc1::tr1::TR1rs;
        "ADC2" "TR2": adc1::tr2::TR2rs;
        "ADC3" "CFGR": adc1::cfgr::CFGRrs;
        "ADC3" "TR1": adc1::tr1::TR1rs;
        "ADC3" "TR2": adc1::tr2::TR2rs;
        "ADC4" "CFGR": adc1::cfgr::CFGRrs;
        "ADC4" "TR1": adc1::tr1::TR1rs;
        "ADC4" "TR2": adc1::tr2::TR2rs;
    }
    // The option bytes are what a person has programmed, and the chip's revision is what was delivered; TIM4 and TIM7 count 16 bits, which the SVD's shared type does not
    // say; the SVD leaves out FLASH_ACR's bit 18 (RM0440 3.7.1: 0x0004_0600; memory) and TIMx_AF1's BKINE (RM0440 29.6.26:
    // 0x0000_0001; memory), and nothing here depends on them: the firmware writes both registers.
    let apart = [
        ("FLASH", "OPTR"),
        ("DBGMCU", "IDCODE"),
        ("FLASH", "ACR"),
        ("TIM1", "AF1"),
        ("TIM8", "AF1"),
        ("TIM4", "ARR"),
        ("TIM7", "ARR"),
    ];
    for registers in &all {
        let (name, table) = registers.layout();
        for (register, _, value) in table {
            let known = held.contains(&(name, register)) || apart.contains(&(name, register));
            assert!(
                value == 0 || known,
                "{name}_{register} starts at {value:#x}, which nothing is held against"
            );
        }
    }
}

/// What a pin is in the database: `PA8`.
fn pin_name(port: usize, pin: u32) -> String {
    format!("P{}{pin}", char::from(b'A' + port as u8))
}

/// The pins as the firmware has set them up when it is ready: what each alternate function is, and that every signal that
/// the drive needs is there once.
#[test]
fn the_boards_pins_carry_what_they_must() -> Result<(), String> {
    const BRIDGE: [&str; 7] = ["CH1", "CH2", "CH3", "CH1N", "CH2N", "CH3N", "BKIN"];
    let bridges = ["TIM1", "TIM8"]
        .into_iter()
        .flat_map(|timer| BRIDGE.map(|signal| (timer, signal)));
    let both = [
        ("TIM4", "CH1"),
        ("TIM4", "CH2"),
        ("LPUART1", "TX"),
        ("LPUART1", "RX"),
    ];
    for (board, encoders) in [
        (
            Wiring::Nucleo,
            vec![
                ("TIM2", "CH1"),
                ("TIM2", "CH2"),
                ("TIM5", "CH1"),
                ("TIM5", "CH2"),
            ],
        ),
        (
            Wiring::Mains,
            vec![
                ("SPI1", "SCK"),
                ("SPI1", "MISO"),
                ("SPI1", "MOSI"),
                ("TIM2", "CH1"),
                ("TIM5", "CH1"),
                ("TIM5", "CH2"),
                ("TIM5", "ETR"),
            ],
        ),
    ] {
        let needed: Vec<(&str, &str)> = bridges.clone().chain(both).chain(encoders).collect();
        let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
        bench.wait_for(READY, 0.2)?;
        let chip = bench.emulator.chip();
        let mut carried: Vec<(&str, &str)> = Vec::new();
        for port in 0..4 {
            for pin in 0..16 {
                let (mode, function) = chip.system.pin_function(port, pin);
                const ALTERNATE: u32 = 2;
                let name = pin_name(port, pin);
                // The debugger's, from reset on.
                let debug = ["PA13", "PA14", "PA15", "PB3", "PB4"].contains(&name.as_str());
                if mode != ALTERNATE || debug && function == 0 {
                    continue;
                }
                let signal = needed.iter().find(|(peripheral_name, signal)| {
                    peripheral(peripheral_name).pins.iter().any(|known| {
                        known.pin == name
                            && known.signal == *signal
                            && known.af.map(u32::from) == Some(function)
                    })
                });
                let signal = signal.unwrap_or_else(|| {
                    panic!("{board:?}: {name} is in alternate function {function}, which is nothing that the drive needs")
                });
                carried.push(*signal);
                // 10.6 MHz, 4 Mbaud, and a bridge's edges.
                let fast = match *signal {
                    ("SPI1", "SCK" | "MOSI") => 2,
                    ("LPUART1", "TX") => 1,
                    ("TIM1" | "TIM8", signal) if signal != "BKIN" => 1,
                    _ => 0,
                };
                assert!(
                    chip.system.pin_speed(port, pin) >= fast,
                    "{board:?}: {name}, {signal:?}, is too slow"
                );
            }
        }
        let once: BTreeSet<(&str, &str)> = carried.iter().copied().collect();
        assert_eq!(once.len(), carried.len(), "{board:?}: twice: {carried:?}");
        assert_eq!(once, needed.iter().copied().collect(), "{board:?}");
        converted_pins_are_analog(board, chip)?;
    }
    Ok(())
}

/// What the ADCs convert is on a pin that is analog.
fn converted_pins_are_analog(board: Wiring, chip: &Chip) -> Result<(), String> {
    for (index, adc) in ["ADC1", "ADC2", "ADC3", "ADC4"].into_iter().enumerate() {
        for channel in chip.adcs[index].channels() {
            // On no pin.
            if (index, channel) == REFERENCE {
                continue;
            }
            let signal = format!("IN{channel}");
            let pin = peripheral(adc)
                .pins
                .iter()
                .find(|known| known.signal == signal)
                .unwrap_or_else(|| panic!("{board:?}: {adc} has no {signal}"));
            let (port, number) = pin.pin.split_at(2);
            let port = usize::from(port.as_bytes()[1] - b'A');
            let number: u32 = number.parse().map_err(|_| "a pin's number")?;
            const ANALOG: u32 = 3;
            assert_eq!(
                chip.system.pin_function(port, number).0,
                ANALOG,
                "{board:?}: {adc} {signal} is {}, which is not analog",
                pin.pin
            );
        }
    }
    Ok(())
}
