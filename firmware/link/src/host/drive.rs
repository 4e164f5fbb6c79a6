//! The drive's debug structures, read and written.

use super::Memory;
use crate::codes::{Fault, Misalignment, ResetReason, Run, State};
use crate::telemetry::Request;
use crate::view::{DriveCommand, DriveView, DriveWords, MAGIC, Words};
use crate::{COMMAND_SYMBOL, LAYOUT, RTT_SYMBOL, VIEW_SYMBOL, scale};
use anyhow::{Context, Result, ensure};
use std::f64::consts::TAU;
use std::fmt;
use std::mem::{offset_of, size_of};

/// Words of the view.
const VIEW_WORDS: usize = size_of::<DriveView>() / 4;

/// Where a firmware has what a host needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    view: u32,
    command: u32,
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
            command: symbol(COMMAND_SYMBOL)?,
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

    /// Asks for a table velocity, m/s, and a base speed, mechanical rad/s.
    ///
    /// # Errors
    /// The memory cannot be written, or the numbers are beyond the command's formats.
    pub fn ask(&self, memory: &mut impl Memory, velocity: f64, base: f64) -> Result<()> {
        let velocity = scale::word(velocity, scale::TABLE_VELOCITY).with_context(|| {
            format!("a table velocity of {velocity} m/s cannot be said: 8 m/s are the end")
        })?;
        let base = scale::word(base, scale::BASE_SPEED).with_context(|| {
            format!("a base speed of {base} rad/s cannot be said: 8192 rad/s are the end")
        })?;
        let [sequence] = memory.words(self.field(offset_of!(DriveCommand, sequence)))?;
        memory.write(
            self.field(offset_of!(DriveCommand, velocity)),
            velocity.cast_unsigned(),
        )?;
        memory.write(
            self.field(offset_of!(DriveCommand, base)),
            base.cast_unsigned(),
        )?;
        memory.write(
            self.field(offset_of!(DriveCommand, sequence)),
            sequence.wrapping_add(1),
        )
    }

    /// Says that who commands is still there: a drive that runs comes to rest when this is not said every half second.
    ///
    /// # Errors
    /// The memory cannot be reached.
    pub fn keep_alive(&self, memory: &mut impl Memory) -> Result<()> {
        let at = self.field(offset_of!(DriveCommand, heartbeat));
        let [beat] = memory.words(at)?;
        memory.write(at, beat.wrapping_add(1))
    }

    /// Asks to run, to rest, or to leave a fault.
    ///
    /// # Errors
    /// The memory cannot be reached.
    pub fn run(&self, memory: &mut impl Memory, run: Run) -> Result<()> {
        if run == Run::Run {
            self.keep_alive(memory)?;
        }
        memory.write(self.field(offset_of!(DriveCommand, run)), run.word())
    }

    /// Asks for telemetry at every `divider`th step of the speed task, 0 for none, in a new stream.
    ///
    /// # Errors
    /// The memory cannot be reached.
    pub fn record(&self, memory: &mut impl Memory, divider: u8) -> Result<Request> {
        let at = self.field(offset_of!(DriveCommand, record));
        let [last] = memory.words(at)?;
        let stream = Request::of_word(last).stream.wrapping_add(1) & 0xFF_FFFF;
        let request = Request { divider, stream };
        memory.write(at, request.word())?;
        Ok(request)
    }

    fn field(&self, offset: usize) -> u32 {
        // A structure of a few words.
        #[allow(clippy::cast_possible_truncation)]
        let offset = offset as u32;
        self.command + offset
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
        let alignment = matches!(
            self.fault(),
            Some(Fault::ScrewAlignment | Fault::NutAlignment | Fault::PairAlignment)
        );
        let reason = Misalignment::of_word(self.0.misalignment)?;
        alignment.then_some(reason)
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
