//! The flash patch and breakpoint unit, version 1: six comparators on instructions, two on literals (ARMv7-M, C1.11).

const CTRL: u32 = 0xE000_2000;
const REMAP: u32 = 0xE000_2004;
const COMP: u32 = 0xE000_2008;
/// Comparators on instructions.
pub const CODE: usize = 6;
const LITERAL: usize = 2;
const ALL: usize = CODE + LITERAL;

const ENABLE: u32 = 1;
const KEY: u32 = 1 << 1;

/// The unit.
#[derive(Clone, Debug, Default)]
pub struct Breakpoints {
    on: bool,
    comparators: [u32; ALL],
}

/// `address` is one of its registers.
#[must_use]
pub fn has(address: u32) -> bool {
    (CTRL..COMP + 4 * ALL as u32).contains(&address)
}

impl Breakpoints {
    /// Addresses of instructions that a comparator is set to, whether or not the unit is on.
    pub fn addresses(&self) -> impl Iterator<Item = u32> {
        self.comparators[..CODE]
            .iter()
            .filter(|comparator| *comparator & 1 == 1)
            .flat_map(|comparator| {
                let word = comparator & 0x1FFF_FFFC;
                // REPLACE: 1 the lower half word, 2 the upper one, 3 both.
                let half =
                    |bit: u32, offset: u32| (comparator >> 30 & bit != 0).then_some(word + offset);
                [half(1, 0), half(2, 2)].into_iter().flatten()
            })
    }

    /// The core halts before the instruction at `address`.
    #[must_use]
    pub fn breaks_at(&self, address: u32) -> bool {
        self.on && self.addresses().any(|breakpoint| breakpoint == address)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, address: u32) -> Result<u32, String> {
        match address {
            CTRL => Ok((LITERAL << 8 | CODE << 4) as u32 | u32::from(self.on)),
            REMAP => Err("this model remaps nothing (FP_REMAP)".into()),
            _ => Ok(self.comparators[(address - COMP) as usize / 4]),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or not what is written.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), String> {
        match address {
            CTRL if value & KEY == 0 => {}
            CTRL => self.on = value & ENABLE != 0,
            REMAP => return Err("this model remaps nothing (FP_REMAP)".into()),
            _ => {
                let k = (address - COMP) as usize / 4;
                let on = value & ENABLE != 0;
                if on && (k >= CODE || value >> 30 == 0) {
                    return Err(format!(
                        "this model remaps nothing (FP_COMP{k} {value:#010x})"
                    ));
                }
                self.comparators[k] = value;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comparator_breaks_at_its_half_word_while_the_unit_is_on() {
        let mut unit = Breakpoints::default();
        // What the architecture's manual gives for 0x0800_09A4 (C1.11.5), and the upper half word of the same.
        unit.write(COMP, 0x4800_09A5).unwrap();
        unit.write(COMP + 4, 0x8800_09A5).unwrap();
        assert!(!unit.breaks_at(0x0800_09A4), "the unit is off");
        unit.write(CTRL, ENABLE).unwrap();
        assert!(!unit.breaks_at(0x0800_09A4), "without the key");
        unit.write(CTRL, ENABLE | KEY).unwrap();
        assert!(unit.breaks_at(0x0800_09A4) && unit.breaks_at(0x0800_09A6));
        assert!(!unit.breaks_at(0x0800_09A8));
        assert_eq!(unit.read(CTRL), Ok(0x261));
        let remap = unit.write(COMP, 0x0800_09A5).unwrap_err();
        assert!(remap.contains("FP_COMP0"), "{remap}");
    }
}
