//! What each exception costs, without those that interrupt it.

use crate::chip::nvic::EXTERNAL;
use crate::timing::{ENTRY, EXIT};
use std::collections::BTreeMap;

/// Instructions and cycles of one run of an exception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Instructions.
    pub instructions: u64,
    /// Estimated cycles, entry and exit included.
    pub cycles: u64,
    /// Instructions that ran from flash.
    pub from_flash: u64,
}

/// Every run of every exception.
#[derive(Clone, Debug, Default)]
pub struct Profile {
    stack: Vec<(usize, Cost)>,
    runs: BTreeMap<usize, Vec<Cost>>,
    /// Whether runs are kept.
    pub keep: bool,
}

impl Profile {
    pub(super) fn enter(&mut self, exception: usize) {
        self.stack.push((
            exception,
            Cost {
                cycles: ENTRY,
                ..Cost::default()
            },
        ));
    }

    pub(super) fn run(&mut self, address: u32, instructions: u64, cycles: u64) {
        if let Some((_, cost)) = self.stack.last_mut() {
            cost.instructions += instructions;
            cost.cycles += cycles;
            if (0x0800_0000..0x1000_0000).contains(&address) {
                cost.from_flash += instructions;
            }
        }
    }

    pub(super) fn leave(&mut self, exception: usize) {
        let Some((entered, mut cost)) = self.stack.pop() else {
            return;
        };
        cost.cycles += EXIT;
        if self.keep && entered == exception {
            self.runs.entry(exception).or_default().push(cost);
        }
    }

    /// The runs of interrupt line `line`, in their order.
    #[must_use]
    pub fn of_line(&self, line: usize) -> &[Cost] {
        self.runs.get(&(EXTERNAL + line)).map_or(&[], Vec::as_slice)
    }
}
