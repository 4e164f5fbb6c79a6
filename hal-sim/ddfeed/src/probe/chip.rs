//! Is it the chip that the firmware is for, and does it let a debugger in?

use anyhow::{Error, Result, anyhow, bail};
use link::host::Memory;
use std::fmt::Display;
use std::time::Duration;

/// CPUID (PM0214 4.4.1): part number in bits 4 to 15.
const CPUID: u32 = 0xE000_ED00;
const CORTEX_M4: u32 = 0xC24;
/// DBGMCU_IDCODE (RM0440 47.6.1): device in the lowest 12 bits. DBGMCU_CR follows it.
const IDCODE: u32 = 0xE004_2000;
const DEBUG_CONTROL: u32 = IDCODE + 4;
/// DBG_SLEEP, DBG_STOP, DBG_STANDBY: memory can be read while the core sleeps.
const DEBUG_IN_SLEEP: u32 = 7;
/// STM32G471, 473, 474, 483 and 484.
const DEVICE: u32 = 0x469;
/// Other devices of ST with a Cortex-M4 that a drive's board is likely to have.
const OTHERS: [(u32, &str); 7] = [
    (0x468, "an STM32G431 or G441"),
    (0x479, "an STM32G491 or G4A1"),
    (0x413, "an STM32F405, F407, F415 or F417"),
    (0x421, "an STM32F446"),
    (0x422, "an STM32F302 or F303"),
    (0x438, "an STM32F303, F328 or F334"),
    (0x415, "an STM32L475 or L476"),
];
/// FLASH_OPTR (RM0440 5.7.8): the level of read-out protection in the lowest 8 bits.
const OPTIONS: u32 = 0x4002_2020;
const UNLOCKED: u32 = 0xAA;
/// Size of the flash, KiB, in the lower half (RM0440 48.2).
const FLASH_SIZE: u32 = 0x1FFF_75E0;
const FLASH_KIB: u32 = 512;

/// Checks the chip, and lets it be read while it sleeps. Nothing is halted.
///
/// # Errors
/// It is another chip, or a locked one.
pub fn check(memory: &mut impl Memory) -> Result<()> {
    let [cpuid] = memory.words(CPUID)?;
    let part = cpuid >> 4 & 0xFFF;
    if part != CORTEX_M4 {
        bail!(
            "the chip's core is no Cortex-M4 (CPUID {cpuid:#010x}), so it is not the STM32G474RE that the firmware is for: \
             is the probe on the right board?"
        );
    }
    let [idcode] = memory.words(IDCODE)?;
    let device = idcode & 0xFFF;
    if device != DEVICE {
        let name = OTHERS
            .iter()
            .find(|(other, _)| *other == device)
            .map_or("another device", |(_, name)| name);
        bail!(
            "the chip is {name} (device {device:#05x}) and not the STM32G474RE that the firmware is for: is the probe on \
             the right board?"
        );
    }
    let [options] = memory.words(OPTIONS)?;
    if options & 0xFF != UNLOCKED {
        bail!(
            "the chip is locked (read-out protection, option byte {:#04x}): unlock it with STM32CubeProgrammer, `-ob \
             RDP=0xAA`, which erases it, and power the board off and on",
            options & 0xFF
        );
    }
    let [size] = memory.words(FLASH_SIZE)?;
    if size & 0xFFFF != FLASH_KIB {
        bail!(
            "the chip has {} KiB of flash and not the STM32G474RE's {FLASH_KIB}: is the probe on the right board?",
            size & 0xFFFF
        );
    }
    let [control] = memory.words(DEBUG_CONTROL)?;
    memory.write(DEBUG_CONTROL, control | DEBUG_IN_SLEEP)
}

/// What may keep a probe from a chip, and what to do.
const REMEDY: &str = "Is the board powered, and is the probe's cable on it? A chip that was locked for good (read-out protection level \
                      2) can never be debugged again: then only another chip helps. Else unplug the probe and plug it in again";

/// What to say when the probe does not get through to the chip.
pub fn unreachable(probe: &impl Display, error: &dyn std::error::Error) -> Error {
    let mut reasons = vec![error.to_string()];
    let mut source = error.source();
    while let Some(inner) = source {
        reasons.push(inner.to_string());
        source = inner.source();
    }
    anyhow!(
        "the probe {probe} does not reach the chip: {}. {REMEDY}",
        reasons.join(": ")
    )
}

/// What to say when the chip has not answered for so long, and never has.
pub fn silent(probe: &impl Display, patience: Duration) -> Error {
    anyhow!(
        "the probe {probe} does not reach the chip: no answer within {:.1} s. {REMEDY}",
        patience.as_secs_f64()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    struct Fake(HashMap<u32, u32>);

    impl Memory for Fake {
        fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
            let word = self
                .0
                .get(&address)
                .ok_or_else(|| anyhow!("no memory at {address:#x}"))?;
            bytes.copy_from_slice(&word.to_le_bytes());
            Ok(())
        }

        fn write(&mut self, address: u32, word: u32) -> Result<()> {
            self.0.insert(address, word);
            Ok(())
        }
    }

    /// As an STM32G474RE of revision Y has them.
    fn healthy() -> Fake {
        Fake(HashMap::from([
            (0xE000_ED00, 0x410F_C241),
            (0xE004_2000, 0x2003_6469),
            (0xE004_2004, 0x20),
            (0x4002_2020, 0xFFEF_F8AA),
            (0x1FFF_75E0, 0xFFFF_0200),
        ]))
    }

    #[test]
    fn the_right_chip_is_let_through_and_can_be_read_asleep() {
        let mut chip = healthy();
        check(&mut chip).unwrap();
        assert_eq!(chip.0[&0xE004_2004], 0x27);
    }

    #[test]
    fn a_wrong_or_locked_chip_is_said_in_a_sentence() {
        for (address, word, expected) in [
            (0xE000_ED00, 0x410C_C601, "no Cortex-M4"),
            (
                0xE004_2000,
                0x2003_6468,
                "an STM32G431 or G441 (device 0x468)",
            ),
            (0xE004_2000, 0x0000_0123, "another device (device 0x123)"),
            (0x4002_2020, 0xFFEF_F8BB, "the chip is locked"),
            (0x1FFF_75E0, 0x0000_0080, "128 KiB"),
        ] {
            let mut chip = healthy();
            chip.0.insert(address, word);
            let error = check(&mut chip).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
            assert_eq!(chip.0[&0xE004_2004], 0x20, "it is left as it was");
        }
    }
}
