//! TIM1 and TIM8: centre-aligned PWM with repetition counter, preload, break and lock (RM0440 29).

use super::registers::Registers;
use crate::pins::Bridge;
use hal_sim::sensors::Leg;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;
const CCR3: u32 = 0x3C;
const BDTR: u32 = 0x44;
const AF1: u32 = 0x60;

const MOE: u32 = 1 << 15;
/// EGR.BG.
const BREAK_EVENT: u32 = 1 << 7;
const UIF: u32 = 1;
const BIF: u32 = 1 << 7;
const SBIF: u32 = 1 << 13;

/// Counts of the timer's clock that the break filter waits, by `BDTR.BKF` (RM0440 29.6.20).
const BREAK_FILTER: [u64; 16] = [
    0, 2, 4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 128, 160, 192, 256,
];

/// A trigger output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The counter's enable bit.
    Enable,
    /// The update event.
    Update,
    /// Something that the firmware does not use.
    Other,
}

/// What a turn of the counter did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Turn {
    /// At the top, not at the bottom.
    pub top: bool,
    /// The update event happened.
    pub update: bool,
}

/// A PWM timer.
pub struct PwmTimer {
    registers: Registers,
    /// Position at the start in a run of `2 * ARR`: up from 0, down from `ARR`.
    phase: u64,
    started: Option<u64>,
    next_turn: u64,
    next_is_top: bool,
    repetitions: u32,
    active_repetitions: u32,
    active: [u16; 3],
    flags: u32,
    /// Main output enable.
    moe: bool,
    break_high: bool,
    /// When a break that has risen will have passed the filter.
    break_due: Option<u64>,
    /// The chip's own fault: clock, supply, memory, lock-up.
    system_break: bool,
    lock: u32,
    /// When a debugger halted the core, and it with it.
    held: Option<u64>,
}

impl PwmTimer {
    /// A timer after reset.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        let registers = Registers::new(
            name,
            &[
                ("CR1", CR1, 0),
                ("CR2", CR2, 0),
                ("SMCR", SMCR, 0),
                ("CCMR1", CCMR1, 0),
                ("CCMR2", CCMR2, 0),
                ("CCER", CCER, 0),
                ("ARR", ARR, 0xFFFF),
                ("RCR", RCR, 0),
                ("CCR1", CCR1, 0),
                ("CCR2", CCR1 + 4, 0),
                ("CCR3", CCR3, 0),
                ("BDTR", BDTR, 0),
                ("AF1", AF1, 1),
            ],
        );
        Self {
            registers,
            phase: 0,
            started: None,
            next_turn: 0,
            next_is_top: true,
            repetitions: 0,
            active_repetitions: 0,
            active: [0; 3],
            flags: 0,
            moe: false,
            break_high: false,
            break_due: None,
            system_break: false,
            lock: 0,
            held: None,
        }
    }

    /// It stands from `now` on with its outputs off. `true` if that stopped the bridge now.
    pub fn hold(&mut self, now: u64) -> bool {
        self.held = Some(now);
        self.moe
    }

    /// It goes on, and its outputs too. `true` if it stood.
    pub fn release(&mut self, now: u64) -> bool {
        let Some(held) = self.held.take() else {
            return false;
        };
        self.next_turn += now - held;
        self.started = self.started.map(|started| started + (now - held));
        true
    }

    /// When it stopped with the core, if it stands.
    #[must_use]
    pub fn held(&self) -> Option<u64> {
        self.held
    }

    /// Its outputs follow the compare values.
    fn drives(&self) -> bool {
        self.moe && self.held.is_none()
    }

    /// The counter runs.
    #[must_use]
    pub fn running(&self) -> bool {
        self.started.is_some()
    }

    /// When the counter next turns.
    #[must_use]
    pub fn next_turn(&self) -> Option<u64> {
        self.started
            .filter(|_| self.held.is_none())
            .map(|_| self.next_turn)
    }

    /// When the counter is next at its top.
    #[must_use]
    pub fn next_top(&self) -> Option<u64> {
        let half = if self.next_is_top { 0 } else { self.top() };
        self.next_turn().map(|turn| turn + half)
    }

    /// Cycles of a PWM period.
    #[must_use]
    pub fn period(&self) -> u64 {
        2 * self.top()
    }

    /// What the bridge does from the last update on.
    #[must_use]
    pub fn bridge(&self) -> Bridge {
        Bridge {
            compare: self.active,
            enabled: self.drives(),
        }
    }

    /// What conducts in each phase: the high side while the counter is below the compare value.
    #[must_use]
    pub fn legs(&self, now: u64) -> [Leg; 3] {
        let (top, position) = (self.top(), self.position(now));
        let count = if position < top {
            position
        } else {
            2 * top - position
        };
        self.active.map(|compare| match self.drives() {
            false => Leg::Open,
            true if count < u64::from(compare) => Leg::High,
            true => Leg::Low,
        })
    }

    /// When a phase next changes from one side to the other.
    #[must_use]
    pub fn next_edge(&self, now: u64) -> Option<u64> {
        self.next_turn()?;
        let (top, position) = (self.top(), self.position(now));
        let edges = self.active.iter().flat_map(|&compare| {
            let compare = u64::from(compare).min(top);
            // On the way up at the compare value; on the way down one count below it.
            [compare, 2 * top - compare + 1]
        });
        let after = edges.map(|edge| (edge + 2 * top - position) % (2 * top));
        after
            .filter(|&after| after > 0)
            .min()
            .map(|after| now + after)
    }

    /// With its outputs off it drives its pins to their idle level, low (OSSI; no OIS bit set).
    #[must_use]
    pub fn drives_idle(&self) -> bool {
        const OSSI: u32 = 1 << 10;
        self.registers.get("BDTR") & OSSI != 0 && self.registers.get("CCER") != 0
    }

    /// What TRGO follows.
    #[must_use]
    pub fn trigger_output(&self) -> Output {
        match self.registers.get("CR2") >> 4 & 7 {
            1 => Output::Enable,
            2 => Output::Update,
            _ => Output::Other,
        }
    }

    /// What TRGO2 follows.
    #[must_use]
    pub fn trigger_output_2(&self) -> Output {
        match self.registers.get("CR2") >> 20 & 15 {
            1 => Output::Enable,
            2 => Output::Update,
            _ => Output::Other,
        }
    }

    /// A rising edge of internal trigger `input`.
    pub fn start_by_trigger(&mut self, input: u32, now: u64) {
        let smcr = self.registers.get("SMCR");
        let selected = (smcr >> 4 & 7) | (smcr >> 20 & 3) << 3;
        const TRIGGER_MODE: u32 = 6;
        if smcr & 7 == TRIGGER_MODE && selected == input && !self.running() {
            self.start(now);
        }
    }

    fn top(&self) -> u64 {
        u64::from(self.registers.get("ARR") & 0xFFFF).max(1)
    }

    fn start(&mut self, now: u64) {
        let top = self.top();
        self.started = Some(now);
        self.next_is_top = self.phase < top;
        self.next_turn = now
            + if self.next_is_top {
                top - self.phase
            } else {
                2 * top - self.phase
            };
    }

    fn position(&self, now: u64) -> u64 {
        let run = 2 * self.top();
        let now = self.held.unwrap_or(now);
        let passed = self.started.map_or(0, |start| now - start);
        (self.phase + passed) % run
    }

    /// The counter turns now.
    pub fn turn(&mut self, now: u64) -> Turn {
        let top = self.next_is_top;
        self.next_is_top = !top;
        self.next_turn = now + self.top();
        let update = self.repetitions == 0;
        if update {
            self.update();
            self.flags |= UIF;
        } else {
            self.repetitions -= 1;
        }
        Turn { top, update }
    }

    fn update(&mut self) {
        self.active_repetitions = self.registers.get("RCR");
        self.repetitions = self.active_repetitions;
        #[allow(clippy::cast_possible_truncation)]
        let preloaded = ["CCR1", "CCR2", "CCR3"].map(|name| self.registers.get(name) as u16);
        self.active = preloaded;
    }

    /// Comparator outputs by number (bit n is COMPn) and the level of the break pin reach the break input now. What is there
    /// must hold for as long as the filter asks before it acts: see [`PwmTimer::break_due`].
    pub fn break_input(&mut self, comparators: u32, pin: bool, now: u64) {
        let af1 = self.registers.get("AF1");
        // BKINE, BKINP; BKCMPxE are bits 1 to 7 as the comparators' numbers (RM0440 29.6.26).
        let pin = af1 & 1 == 1 && pin != (af1 >> 9 & 1 == 1);
        let high = pin || comparators & af1 & 0xFE != 0;
        if high && !self.break_high {
            let filter = BREAK_FILTER[(self.registers.get("BDTR") >> 16 & 15) as usize];
            self.break_due = Some(now + filter);
        }
        if !high {
            self.break_due = None;
        }
        self.break_high = high;
    }

    /// When the break under way will have passed the filter.
    #[must_use]
    pub fn break_due(&self) -> Option<u64> {
        self.break_due
    }

    /// The break has passed the filter. `true` if that stopped the bridge now.
    pub fn break_passed(&mut self) -> bool {
        self.break_due = None;
        self.breaks(BIF)
    }

    /// A fault of the chip breaks the timer, unfiltered (RM0440 29.3.16). `true` if that stopped the bridge now.
    pub fn system_break(&mut self, lasts: bool) -> bool {
        self.system_break = lasts;
        self.breaks(SBIF)
    }

    /// The fault of the chip is gone.
    pub fn end_system_break(&mut self) {
        self.system_break = false;
    }

    fn breaks(&mut self, flag: u32) -> bool {
        const BREAK_ENABLE: u32 = 1 << 12;
        if self.registers.get("BDTR") & BREAK_ENABLE == 0 {
            return false;
        }
        self.flags |= flag;
        std::mem::take(&mut self.moe)
    }

    /// A break holds the outputs.
    fn broken(&self) -> bool {
        self.system_break || self.break_high && self.break_due.is_none()
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
    pub fn read(&self, offset: u32, now: u64) -> Result<u32, String> {
        let position = self.position(now);
        let down = position >= self.top();
        #[allow(clippy::cast_possible_truncation)]
        Ok(match offset {
            CR1 => self.registers.read(CR1)? | u32::from(down) << 4 | u32::from(self.running()),
            SR => self.flags,
            CNT => {
                (if down {
                    2 * self.top() - position
                } else {
                    position
                }) as u32
            }
            BDTR => self.registers.read(BDTR)? | if self.moe { MOE } else { 0 },
            _ => self.registers.read(offset)?,
        })
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or it is not used as the model has it.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), String> {
        match offset {
            CR1 => {
                const CENTRE_ALIGNED: u32 = 3 << 5;
                self.registers.write(CR1, value & !0x11)?;
                if value & 1 == 0 {
                    self.phase = self.position(now);
                    self.started = None;
                } else if !self.running() {
                    if value & CENTRE_ALIGNED == 0 {
                        return Err("this model counts in centre-aligned mode only".into());
                    }
                    self.start(now);
                }
            }
            // The break's flag cannot be cleared while its input is active.
            SR => {
                let held = if self.break_high && self.break_due.is_none() {
                    BIF
                } else {
                    0
                };
                self.flags &= value | held | if self.system_break { SBIF } else { 0 };
            }
            EGR if value == BREAK_EVENT => {
                self.breaks(BIF);
            }
            EGR => {
                if value != 1 {
                    return Err("of the events, this model generates update and break only".into());
                }
                self.update();
                self.flags |= UIF;
                self.phase = 0;
            }
            CNT => {
                if self.running() {
                    return Err("the counter is written while it runs".into());
                }
                self.phase = u64::from(value & 0xFFFF);
            }
            BDTR => self.write_bdtr(value)?,
            // Lock level 1 and above hold the break's sources and the idle levels, 2 the polarities, 3 the modes.
            AF1 if self.lock >= 1 => {}
            CCER if self.lock >= 2 => {
                let polarity = 0x0AAA;
                let held = self.registers.read(CCER)? & polarity;
                self.registers.write(CCER, value & !polarity | held)?;
            }
            CCMR1 | CCMR2 if self.lock >= 3 => {}
            CCER | CCMR1 | CCMR2 => {
                self.registers.write(offset, value)?;
            }
            CCR1..=CCR3 if value > 0xFFFF => return Err("a compare value beyond 16 bits".into()),
            _ => {
                self.registers.write(offset, value)?;
            }
        }
        Ok(())
    }

    fn write_bdtr(&mut self, value: u32) -> Result<(), String> {
        // What level 1 holds: dead time, break enable, polarity and filter. Level 2 adds OSSI and OSSR.
        const LEVEL_1: u32 = 0xFF | 1 << 12 | 1 << 13 | 1 << 14 | 0xF << 16;
        const LEVEL_2: u32 = LEVEL_1 | 3 << 10;
        let held_bits = match self.lock {
            0 => 0,
            1 => LEVEL_1 | 3 << 8,
            _ => LEVEL_2 | 3 << 8,
        };
        let old = self.registers.read(BDTR)?;
        let kept = old & held_bits | value & !held_bits & !MOE;
        self.registers.write(BDTR, kept)?;
        self.lock = kept >> 8 & 3;
        // The main output cannot be enabled while the break is active.
        self.moe = value & MOE != 0 && !self.broken();
        Ok(())
    }
}
