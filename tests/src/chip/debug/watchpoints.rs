//! The four comparators of the data watchpoint and trace unit (ARMv7-M, C1.8). The cycle counter is the core's:
//! [`crate::chip::nvic`].

const COMP: u32 = 0xE000_1020;
const UNITS: usize = 4;
/// Bytes of a unit's registers, of which the last four are none.
const UNIT: u32 = 16;

const MATCHED: u32 = 1 << 24;

/// How memory is accessed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// A load.
    Read,
    /// A store.
    Write,
}

/// DWT_FUNCTION: what a unit halts on.
const INSTRUCTION: u32 = 4;
const READ: u32 = 5;
const WRITE: u32 = 6;
const EITHER: u32 = 7;

#[derive(Clone, Copy, Debug, Default)]
struct Unit {
    address: u32,
    /// So many of the address's lowest bits are not looked at.
    mask: u32,
    function: u32,
    matched: bool,
}

/// The comparators.
#[derive(Clone, Debug, Default)]
pub struct Watchpoints([Unit; UNITS]);

/// `address` is one of its registers.
#[must_use]
pub fn has(address: u32) -> bool {
    (COMP..COMP + UNITS as u32 * UNIT).contains(&address)
}

impl Watchpoints {
    /// Ranges of data that are watched: first and last byte.
    pub fn data(&self) -> impl Iterator<Item = (u32, u32)> {
        let watched = self
            .0
            .iter()
            .filter(|unit| (READ..=EITHER).contains(&unit.function));
        watched.map(|unit| {
            let size = 1 << unit.mask;
            let first = unit.address & !(size - 1);
            (first, first + (size - 1))
        })
    }

    /// Addresses of instructions that are watched.
    pub fn instructions(&self) -> impl Iterator<Item = u32> {
        let watched = self.0.iter().filter(|unit| unit.function == INSTRUCTION);
        watched.map(|unit| unit.address & !1)
    }

    /// The core accesses `size` bytes at `address`. `true`: a unit halts it once it has.
    pub fn accesses(&mut self, address: u32, size: u32, access: Access) -> bool {
        let wanted = match access {
            Access::Read => READ,
            Access::Write => WRITE,
        };
        let mut any = false;
        for unit in &mut self.0 {
            let range = 1 << unit.mask;
            let first = unit.address & !(range - 1);
            let meets = u64::from(address) < u64::from(first) + u64::from(range)
                && u64::from(first) < u64::from(address) + u64::from(size);
            if (unit.function == wanted || unit.function == EITHER) && meets {
                unit.matched = true;
                any = true;
            }
        }
        any
    }

    /// The core is about to execute what is at `address`. `true`: a unit halts it.
    pub fn executes(&mut self, address: u32) -> bool {
        let mut any = false;
        for unit in &mut self.0 {
            if unit.function == INSTRUCTION && unit.address & !1 == address {
                unit.matched = true;
                any = true;
            }
        }
        any
    }

    /// Reads a register. A debugger's look at a function clears that it has matched.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&mut self, address: u32, clears: bool) -> Result<u32, String> {
        let (unit, register) = self.unit(address)?;
        Ok(match register {
            0 => unit.address,
            4 => unit.mask,
            _ => {
                let matched = unit.matched;
                unit.matched &= !clears;
                unit.function | if matched { MATCHED } else { 0 }
            }
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or not what is written.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), String> {
        let (unit, register) = self.unit(address)?;
        match register {
            0 => unit.address = value,
            4 if value > 15 => return Err(format!("DWT_MASK {value} is more than 15")),
            4 => unit.mask = value,
            _ => match value & !MATCHED {
                0 | INSTRUCTION..=EITHER => unit.function = value & !MATCHED,
                other => {
                    return Err(format!(
                        "this model's watchpoints halt on instructions and accesses, not by DWT_FUNCTION {other:#x}"
                    ));
                }
            },
        }
        Ok(())
    }

    fn unit(&mut self, address: u32) -> Result<(&mut Unit, u32), String> {
        let (k, register) = ((address - COMP) / UNIT, (address - COMP) % UNIT);
        if register == 12 {
            return Err("DWT has no register here".into());
        }
        Ok((&mut self.0[k as usize], register))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_halts_on_what_touches_its_range_in_its_way() {
        let mut units = Watchpoints::default();
        units.write(COMP, 0x2000_0104).unwrap();
        units.write(COMP + 4, 2).unwrap();
        units.write(COMP + 8, WRITE).unwrap();
        assert!(!units.accesses(0x2000_0104, 4, Access::Read));
        assert!(!units.accesses(0x2000_0100, 4, Access::Write));
        assert!(!units.accesses(0x2000_0108, 4, Access::Write));
        assert_eq!(units.read(COMP + 8, true), Ok(WRITE));
        assert!(units.accesses(0x2000_0106, 1, Access::Write));
        assert_eq!(units.read(COMP + 8, true), Ok(WRITE | MATCHED));
        assert_eq!(units.read(COMP + 8, true), Ok(WRITE), "a look clears it");
        let error = units.write(COMP + 8, 0xB).unwrap_err();
        assert!(error.contains("DWT_FUNCTION"), "{error}");
    }
}
