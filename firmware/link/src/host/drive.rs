//! The debug view as a host reads it.

use super::Memory;
use crate::codes::{Fault, Misalignment, ResetReason, State};
use crate::view::{DriveView, DriveWords, MAGIC, Words};
use crate::{LAYOUT, RTT_SYMBOL, VIEW_SYMBOL, scale};
use anyhow::{Result, ensure};
use std::f64::consts::TAU;
use std::fmt;
use std::mem::size_of;

/// Words of the view.
const VIEW_WORDS: usize = size_of::<DriveView>() / 4;

/// Where a firmware has what a host needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    view: u32,
    /// RTT's control block.
    pub rtt: u32,
}

impl Drive {
    /// Asks `symbol` for the addresses of the firmware's symbols.
    ///
    /// # Errors
    /// A symbol is missing.
    pub fn locate<E>(mut symbol: impl FnMut(&str) -> Result<u32, E>) -> Result<Self, E> {
        Ok(Self {
            view: symbol(VIEW_SYMBOL)?,
            rtt: symbol(RTT_SYMBOL)?,
        })
    }

    /// What the drive says of itself.
    ///
    /// # Errors
    /// The memory cannot be read, or holds another firmware's view.
    pub fn look(&self, memory: &mut impl Memory) -> Result<View> {
        let mut words = memory.words::<VIEW_WORDS>(self.view)?.into_iter();
        let view = DriveWords::take(&mut || words.next().unwrap_or_default());
        ensure!(
            view.magic == MAGIC && view.layout == LAYOUT,
            "at {:#010x} the chip has {:#010x}, layout {}, and not the view of this firmware (layout {LAYOUT}): flash it \
             first with `cargo xtask flash`",
            self.view,
            view.magic,
            view.layout
        );
        Ok(View(view))
    }
}

/// A drive at one look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View(DriveWords);

impl View {
    /// Its words.
    #[must_use]
    pub fn words(&self) -> &DriveWords {
        &self.0
    }

    /// What it is doing; `None` if that is no code of this layout.
    #[must_use]
    pub fn state(&self) -> Option<State> {
        State::of_words(self.0.state, self.0.fault)
    }

    /// What stopped it; `None` if nothing has, or if that is no code of this layout.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        Fault::of_word(self.0.fault)
    }

    /// Why the chip was last reset; `None` if that is no code of this layout.
    #[must_use]
    pub fn reset_reason(&self) -> Option<ResetReason> {
        ResetReason::of_word(self.0.reset_reason)
    }

    /// Currents d and q of motor 0 (screw) or 1 (nut), A.
    #[must_use]
    pub fn current(&self, motor: usize) -> [f64; 2] {
        self.0.motors[motor]
            .current
            .map(|word| scale::value(word, scale::CURRENT))
    }

    /// Speed of motor 0 (screw) or 1 (nut), rpm.
    #[must_use]
    pub fn rpm(&self, motor: usize) -> f64 {
        scale::value(self.0.motors[motor].speed, scale::SPEED) * 60.0 / TAU
    }
}

impl View {
    /// Why the rotors could not be aligned, if that is what stopped the drive.
    #[must_use]
    pub fn misalignment(&self) -> Option<Misalignment> {
        let reason = Misalignment::of_word(self.0.misalignment)?;
        self.fault()?.is_misalignment().then_some(reason)
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words = &self.0;
        let state = self.state().map_or("unknown", State::name);
        write!(f, "{:9.3} s  {state}", f64::from(words.uptime_ms) / 1e3)?;
        if words.fault != 0 {
            write!(f, " ({}", self.fault().map_or("unknown", Fault::name))?;
            if let Some(reason) = self.misalignment() {
                write!(f, ": {}", reason.name())?;
            }
            write!(f, ")")?;
        }
        for (motor, name) in ["screw", "nut"].into_iter().enumerate() {
            let ([i_d, i_q], rpm) = (self.current(motor), self.rpm(motor));
            let motor = &words.motors[motor];
            write!(
                f,
                "  {name}: {rpm:+8.2} rpm, i_d {i_d:+.3} A, i_q {i_q:+.3} A, {} cycles (at most {}, {} late)",
                motor.cycles, motor.cycles_max, motor.missed
            )?;
        }
        write!(
            f,
            "  speed task: {} cycles (at most {}, {} late)",
            words.speed_cycles, words.speed_cycles_max, words.speed_missed
        )
    }
}
