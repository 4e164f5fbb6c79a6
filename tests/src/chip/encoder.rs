//! TIM2, TIM4 and TIM5: in encoder mode, where a trigger captures the count; or framing a sensor's readings, where a
//! trigger starts the counter again and compare events select the sensor and ask for DMA (RM0440 30).

use super::registers::Registers;

const CR1: u32 = 0x00;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const CCR3: u32 = 0x3C;
const ECR: u32 = 0x58;

const IDXF: u32 = 1 << 20;

/// The value of `TS` that selects internal trigger `input`: 0 to 3 are coded as they are, 4 and above from 8 on.
#[must_use]
pub fn trigger_code(input: u32) -> u32 {
    if input < 4 { input } else { input + 4 }
}

/// What a compare event of a framing timer does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Channel 1's output falls: the sensor is selected.
    Select,
    /// This channel, 2 to 4, asks for DMA.
    Request(u32),
}

/// A timer.
pub struct EncoderTimer {
    registers: Registers,
    count: u32,
    flags: u32,
    /// Where the encoder last stood.
    stood: Option<u32>,
    /// When the counter of a framing timer was last put to zero, and how many of its events have happened since.
    framing: Option<(u64, usize)>,
}

impl EncoderTimer {
    /// A timer after reset.
    #[must_use]
    pub fn new(name: &'static str, reload: u32) -> Self {
        let registers = Registers::new(
            name,
            &[
                ("CR1", CR1, 0),
                ("SMCR", SMCR, 0),
                ("DIER", DIER, 0),
                ("CCMR1", CCMR1, 0),
                ("CCMR2", CCMR2, 0),
                ("CCER", CCER, 0),
                ("ARR", ARR, reload),
                ("CCR1", CCR1, 0),
                ("CCR2", CCR1 + 4, 0),
                ("CCR3", CCR3, 0),
                ("CCR4", CCR3 + 4, 0),
                ("ECR", ECR, 0),
            ],
        );
        Self {
            registers,
            count: 0,
            flags: 0,
            stood: None,
            framing: None,
        }
    }

    /// It counts both edges of both inputs, directly.
    fn counts(&self) -> bool {
        const ENCODER_MODE_3: u32 = 3;
        let inputs = self.registers.get("CCMR1") & 0x0303 == 0x0101;
        self.registers.get("CR1") & 1 == 1
            && self.registers.get("SMCR") & 7 == ENCODER_MODE_3
            && inputs
    }

    /// Counts of a turn, as the firmware has set the reload.
    #[must_use]
    pub fn counts_per_turn(&self) -> u32 {
        self.registers.get("ARR").saturating_add(1)
    }

    /// The encoder, of `counts_per_turn`, stands at `count` from its index or, before that, from where it stood when the timer
    /// began to count; `lost` of its edges were not seen on the way, and it passed its index or not.
    pub fn set_count(&mut self, count: u32, counts_per_turn: u32, lost: u32, index: bool) {
        if !self.counts() {
            return;
        }
        // What it moved since the last look, the short way round.
        let turn = i64::from(counts_per_turn);
        let from = i64::from(self.stood.replace(count).unwrap_or(count));
        let forward = (i64::from(count) - from).rem_euclid(turn);
        let moved = if forward > turn / 2 {
            forward - turn
        } else {
            forward
        };
        let reload = i64::from(self.registers.get("ARR")) + 1;
        let now = i64::from(self.count) + moved - i64::from(lost);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        {
            self.count = now.rem_euclid(reload) as u32;
        }
        if index && self.registers.get("ECR") & 1 == 1 {
            self.count = count;
            self.flags |= IDXF;
        }
    }

    fn selects(&self, code: u32) -> bool {
        let smcr = self.registers.get("SMCR");
        (smcr >> 4 & 7) | (smcr >> 20 & 3) << 3 == code
    }

    /// A rising edge of the trigger that `TS` codes as `code`: channel 3 captures, if it is set to, and a framing timer
    /// restarts. `true` if channel 1 of a framing timer rises.
    pub fn trigger(&mut self, code: u32, now: u64) -> bool {
        if !self.selects(code) {
            return false;
        }
        const RESET_AND_TRIGGER: u32 = 1 << 16;
        if self.registers.get("SMCR") & (1 << 16 | 7) == RESET_AND_TRIGGER {
            self.framing = Some((now, 0));
            return true;
        }
        let on_trigger = self.registers.get("CCMR2") & 3 == 3;
        let enabled = self.registers.get("CCER") >> 8 & 1 == 1;
        if on_trigger && enabled {
            self.registers.set("CCR3", self.count);
        }
        false
    }

    /// The compare events of a framing timer in their order, with their counts.
    fn events(&self) -> Vec<(u64, Frame)> {
        let mut events = Vec::new();
        let pwm_mode_1_out =
            self.registers.get("CCMR1") & 0x73 == 0x60 && self.registers.get("CCER") & 3 == 1;
        if pwm_mode_1_out {
            events.push((u64::from(self.registers.get("CCR1")), Frame::Select));
        }
        for (channel, name) in [(2, "CCR2"), (3, "CCR3"), (4, "CCR4")] {
            if self.registers.get("DIER") >> (8 + channel) & 1 == 1 {
                events.push((u64::from(self.registers.get(name)), Frame::Request(channel)));
            }
        }
        events.sort_by_key(|(count, _)| *count);
        events
    }

    /// When a framing timer's next compare event happens.
    #[must_use]
    pub fn next_frame_event(&self) -> Option<u64> {
        let (zero, happened) = self.framing?;
        let (count, _) = *self.events().get(happened)?;
        Some(zero + count)
    }

    /// The next compare event of a framing timer happens.
    pub fn frame_event(&mut self) -> Option<Frame> {
        let (_, happened) = self.framing.as_mut()?;
        let index = *happened;
        *happened += 1;
        self.events().get(index).map(|(_, event)| *event)
    }

    /// Its plain registers.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        match offset {
            CNT => Ok(self.count),
            SR => Ok(self.flags),
            _ => self.registers.read(offset),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        if offset == SR {
            self.flags &= value;
            return Ok(());
        }
        self.registers.write(offset, value).map(|_| ())
    }
}
