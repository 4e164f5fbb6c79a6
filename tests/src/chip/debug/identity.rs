//! What the debug parts say they are: the ROM table, and the identification registers of the table and of each part it lists.
//!
//! Where the parts are is from ARM DDI 0439, table 3-4. What they say is what OpenOCD's `dap info` read of another Cortex-M4 of ST: it
//! is printed in wrongbaud, "Hardware debugging for reverse engineers, part 2" (2020). J-Link and OpenOCD read the same of a GD32F307
//! but for the maker's own table. The device's number in ST's table is RM0440 47.6.1.

const TABLE: u32 = 0xE00F_F000;
/// Parts of the table: where, and part number and revision as PIDR0 to PIDR2 give them, and class as CIDR1 gives it.
const PARTS: [(u32, [u8; 3], u8); 7] = [
    (0xE000_E000, [0x0C, 0xB0, 0x0B], 0xE0),
    (0xE000_1000, [0x02, 0xB0, 0x3B], 0xE0),
    (0xE000_2000, [0x03, 0xB0, 0x2B], 0xE0),
    (0xE000_0000, [0x01, 0xB0, 0x3B], 0xE0),
    (0xE004_0000, [0xA1, 0xB9, 0x0B], 0x90),
    (0xE004_1000, [0x25, 0xB9, 0x0B], 0x90),
    // ST's own: device 0x469.
    (TABLE, [0x69, 0x04, 0x0A], 0x10),
];
/// DEVTYPE: the trace port, and the trace of a processor. Of the table it is MEMTYPE.
const TYPE: u32 = 0xFCC;
const TYPES: [(u32, u32); 2] = [(0xE004_0000, 0x11), (0xE004_1000, 0x13)];
/// ARM's code of JEP 106, its continuation in PIDR4; ST's has none.
const ARM_CONTINUATION: u32 = 4;

/// The word at `address`; `None`: it is none of them.
#[must_use]
pub fn read(address: u32) -> Option<u32> {
    const PRESENT: u32 = 3;
    const IDENTIFICATION: u32 = 0xFD0;
    let block = address & !0xFFF;
    let offset = address & 0xFFF;
    let &(start, [part, designer, revision], class) =
        PARTS.iter().find(|(start, ..)| *start == block)?;
    if offset >= IDENTIFICATION {
        return Some(match offset {
            0xFD0 if start == TABLE => 0,
            0xFD0 => ARM_CONTINUATION,
            0xFE0 => part.into(),
            0xFE4 => designer.into(),
            0xFE8 => revision.into(),
            0xFF0 => 0x0D,
            0xFF4 => class.into(),
            0xFF8 => 0x05,
            0xFFC => 0xB1,
            // PIDR3, and PIDR5 to PIDR7.
            _ => 0,
        });
    }
    // DEVARCH: none of them has one. A register of identity that is not there reads 0 (ARM IHI 0029).
    const ARCHITECTURE: u32 = 0xFBC;
    if offset == ARCHITECTURE {
        return Some(0);
    }
    if start != TABLE {
        let kind = TYPES.iter().find(|(part, _)| *part == start);
        return (offset == TYPE).then(|| kind.map_or(0, |(_, kind)| *kind));
    }
    let entries = PARTS.len() - 1;
    let index = (offset / 4) as usize;
    match index {
        _ if index < entries => Some(PARTS[index].0.wrapping_sub(TABLE) | PRESENT),
        _ if index == entries => Some(0),
        // MEMTYPE: the system's memory can be reached by the same port.
        _ if offset == TYPE => Some(1),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As ARM's manual has the table (ARM DDI 0439, table 3-4).
    #[test]
    fn the_table_lists_the_parts_of_a_cortex_m4() {
        let words: Vec<u32> = (0..7).map(|k| read(TABLE + 4 * k).unwrap()).collect();
        let expected = [
            0xFFF0_F003,
            0xFFF0_2003,
            0xFFF0_3003,
            0xFFF0_1003,
            0xFFF4_1003,
            0xFFF4_2003,
            0,
        ];
        assert_eq!(words, expected);
        assert_eq!(read(0xE000_2000), None, "a register of the unit's own");
    }

    /// As OpenOCD printed them, but for the device's number: 0x411 there.
    #[test]
    fn each_part_says_what_a_chip_of_the_maker_said() {
        for (start, peripheral, class) in [
            (TABLE, 0x00_000A_0469, 0x1),
            (0xE000_E000, 0x04_000B_B00C, 0xE),
            (0xE000_1000, 0x04_003B_B002, 0xE),
            (0xE000_2000, 0x04_002B_B003, 0xE),
            (0xE000_0000, 0x04_003B_B001, 0xE),
            (0xE004_0000, 0x04_000B_B9A1, 0x9),
            (0xE004_1000, 0x04_000B_B925, 0x9),
        ] {
            let byte = |offset| u64::from(read(start + offset).unwrap());
            let read_0_to_3: u64 = (0..4).map(|k| byte(0xFE0 + 4 * k) << (8 * k)).sum();
            let said = byte(0xFD0) << 32 | read_0_to_3;
            assert_eq!(said, peripheral, "{start:#010x}: {said:#012x}");
            let component: Vec<_> = (0..4).map(|k| byte(0xFF0 + 4 * k)).collect();
            assert_eq!(component, [0x0D, class << 4, 0x05, 0xB1], "{start:#010x}");
        }
    }
}
