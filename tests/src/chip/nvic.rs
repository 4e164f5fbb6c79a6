//! Interrupts and the core's own peripherals: NVIC, system control block, SysTick, cycle counter (PM0214 4, ARMv7-M B3).

use super::registers::Registers;

/// ADC1's and ADC2's interrupt.
pub const ADC1_2: usize = 18;
/// ADC3's interrupt.
pub const ADC3: usize = 47;
/// TIM7's interrupt.
pub const TIM7: usize = 55;
/// ADC4's interrupt.
pub const ADC4: usize = 61;

const LINES: usize = 102;
/// Exception number of interrupt 0.
pub const EXTERNAL: usize = 16;
const EXCEPTIONS: usize = EXTERNAL + LINES;
/// The non-maskable interrupt, above all priorities.
const NMI: usize = 2;
/// The hard fault, above all but the NMI.
pub const HARD_FAULT: usize = 3;
const SYSTICK: usize = 15;
const PENDSV: usize = 14;

/// An exception's priority while nothing runs.
const THREAD: i32 = 256;

const DWT_CTRL: u32 = 0xE000_1000;
const DWT_CYCCNT: u32 = 0xE000_1004;
/// DWT_CTRL: four comparators, which are [`super::debug::watchpoints`].
const COMPARATORS: u32 = 4 << 28;
const SYST_CSR: u32 = 0xE000_E010;
const SYST_RVR: u32 = 0xE000_E014;
const SYST_CVR: u32 = 0xE000_E018;
const ISER: u32 = 0xE000_E100;
const ICER: u32 = 0xE000_E180;
const ISPR: u32 = 0xE000_E200;
const ICPR: u32 = 0xE000_E280;
const IPR: u32 = 0xE000_E400;
const ICSR: u32 = 0xE000_ED04;
const AIRCR: u32 = 0xE000_ED0C;
const SHPR1: u32 = 0xE000_ED18;

/// The registers at `word` take byte writes: priorities.
#[must_use]
pub fn takes_bytes(word: u32) -> bool {
    (IPR..IPR + 128).contains(&word) || (SHPR1..SHPR1 + 12).contains(&word)
}

/// NVIC and what belongs to the core.
pub struct Nvic {
    enabled: [bool; EXCEPTIONS],
    pending: [bool; EXCEPTIONS],
    level: [bool; EXCEPTIONS],
    priority: [u8; EXCEPTIONS],
    /// Exceptions under way, the innermost last.
    active: Vec<usize>,
    any_pending: bool,
    control: Registers,
    counter_on: bool,
    counter_zero: u64,
    systick: SysTick,
    /// When a debugger halted the core, which stops both counters.
    held: Option<u64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct SysTick {
    control: u32,
    reload: u32,
    next: u64,
    wrapped: bool,
}

impl Nvic {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        let mut enabled = [false; EXCEPTIONS];
        enabled[..EXTERNAL].fill(true);
        let control = Registers::new(
            "the system control space",
            &[
                ("ACTLR", 0x008, 0),
                ("CPUID", 0xD00, 0x410F_C241),
                ("VTOR", 0xD08, 0),
                ("SCR", 0xD10, 0),
                ("CCR", 0xD14, 0x200),
                ("SHCSR", 0xD24, 0),
                ("CFSR", 0xD28, 0),
                ("HFSR", 0xD2C, 0),
                ("CPACR", 0xD88, 0),
                ("MPU_CTRL", 0xD94, 0),
                ("MPU_RNR", 0xD98, 0),
                ("MPU_RBAR", 0xD9C, 0),
                ("MPU_RASR", 0xDA0, 0),
                ("FPCCR", 0xF34, 0xC000_0000),
            ],
        );
        Self {
            enabled,
            pending: [false; EXCEPTIONS],
            level: [false; EXCEPTIONS],
            priority: [0; EXCEPTIONS],
            active: Vec::new(),
            any_pending: false,
            control,
            counter_on: false,
            counter_zero: 0,
            systick: SysTick::default(),
            held: None,
        }
    }

    /// The core is halted from `now` on: SysTick and the cycle counter stand (ARMv7-M B3.3, C1.8.3).
    pub fn hold(&mut self, now: u64) {
        self.held = Some(now);
    }

    /// Since when they stand with a halted core.
    #[must_use]
    pub fn held(&self) -> Option<u64> {
        self.held
    }

    /// They go on.
    pub fn release(&mut self, now: u64) {
        let stood = self.held.take().map_or(0, |held| now - held);
        self.counter_zero += stood;
        self.systick.next += stood;
    }

    /// The cycle counter counts from `time`.
    pub fn set_time_zero(&mut self, time: u64) {
        self.counter_zero = time;
    }

    /// Where the vector table is.
    #[must_use]
    pub fn vector_table(&self) -> u32 {
        self.control.get("VTOR")
    }

    /// Exceptions save float registers if they are in use.
    #[must_use]
    pub fn saves_float_state(&self) -> bool {
        self.control.get("FPCCR") >> 31 == 1
    }

    /// The priority of an interrupt line, as the register holds it.
    #[must_use]
    pub fn line_priority(&self, line: usize) -> u8 {
        self.priority[EXTERNAL + line]
    }

    /// The interrupt line `line` is high or low.
    pub fn set_level(&mut self, line: usize, high: bool) {
        let exception = EXTERNAL + line;
        self.level[exception] = high;
        if high && !self.active.contains(&exception) {
            self.set_pending(exception);
        }
    }

    /// The memory that the protection unit closes now: start and size (PM0214 4.2). This model has one region, of no access,
    /// on top of the default map; hard faults and the NMI go past it.
    #[must_use]
    pub fn closed_memory(&self) -> Option<(u32, u32)> {
        const ENABLE_AND_BACKGROUND: u32 = 0b101;
        const NO_ACCESS: u32 = 0;
        let (base, attributes) = (self.control.get("MPU_RBAR"), self.control.get("MPU_RASR"));
        let closes = self.control.get("MPU_CTRL") == ENABLE_AND_BACKGROUND
            && attributes & 1 == 1
            && attributes >> 24 & 7 == NO_ACCESS;
        let above_all = self.active.iter().any(|&n| n <= HARD_FAULT);
        (closes && !above_all).then(|| {
            let size = 2 << (attributes >> 1 & 31);
            (base & !(size - 1), size)
        })
    }

    /// Says in the fault status why a hard fault comes: a memory protection fault, escalated.
    pub fn memory_fault(&mut self, stacking: bool) {
        const DATA: u32 = 1 << 1;
        const STACKING: u32 = 1 << 4;
        const FORCED: u32 = 1 << 30;
        let status = self.control.get("CFSR");
        self.control
            .set("CFSR", status | if stacking { STACKING } else { DATA });
        self.control.set("HFSR", FORCED);
    }

    /// Says in the fault status why a hard fault comes: an instruction that there is not, escalated.
    pub fn usage_fault(&mut self) {
        const UNDEFINED: u32 = 1 << 16;
        const FORCED: u32 = 1 << 30;
        let status = self.control.get("CFSR");
        self.control.set("CFSR", status | UNDEFINED);
        self.control.set("HFSR", FORCED);
    }

    /// The clock security system, the flash or the RAM raises the non-maskable interrupt.
    pub fn raise_nmi(&mut self) {
        self.set_pending(NMI);
    }

    fn set_pending(&mut self, exception: usize) {
        self.pending[exception] = true;
        self.any_pending = true;
    }

    /// Something is pending, whether or not it can be taken.
    #[must_use]
    pub fn any_pending(&self) -> bool {
        self.any_pending
    }

    /// Something pending and enabled would wake the core from its sleep, were `PRIMASK` clear.
    #[must_use]
    pub fn wakes(&self, basepri: u8) -> bool {
        self.takeable(basepri, false).is_some()
    }

    /// The exception that the core takes next, if any.
    #[must_use]
    pub fn takeable(&self, basepri: u8, primask: bool) -> Option<usize> {
        if self.pending[NMI] && !self.active.contains(&NMI) {
            return Some(NMI);
        }
        let above_all = self.active.iter().any(|&n| n <= HARD_FAULT);
        if !self.any_pending || primask || above_all {
            return None;
        }
        let boost = if basepri == 0 {
            THREAD
        } else {
            i32::from(basepri)
        };
        let running = self
            .active
            .iter()
            .map(|&n| i32::from(self.priority[n]))
            .min()
            .unwrap_or(THREAD);
        let limit = boost.min(running);
        (0..EXCEPTIONS)
            .filter(|&n| self.pending[n] && self.enabled[n] && i32::from(self.priority[n]) < limit)
            .min_by_key(|&n| (self.priority[n], n))
    }

    /// The core enters `exception`.
    pub fn enter(&mut self, exception: usize) {
        self.pending[exception] = false;
        self.any_pending = self.pending.contains(&true);
        self.active.push(exception);
    }

    /// The core returns from its innermost exception: which, and what it returns to.
    pub fn leave(&mut self) -> Option<usize> {
        let exception = self.active.pop()?;
        if self.level[exception] {
            self.set_pending(exception);
        }
        Some(exception)
    }

    /// Exceptions under way, the innermost last.
    #[must_use]
    pub fn active(&self) -> &[usize] {
        &self.active
    }

    /// When SysTick next reaches zero.
    #[must_use]
    pub fn next_systick(&self) -> Option<u64> {
        (self.systick.control & 1 == 1 && self.held.is_none()).then_some(self.systick.next)
    }

    /// Time is `now`.
    pub fn tick(&mut self, now: u64) {
        while self.next_systick().is_some_and(|next| next <= now) {
            self.systick.next += u64::from(self.systick.reload) + 1;
            self.systick.wrapped = true;
            if self.systick.control & 2 != 0 {
                self.set_pending(SYSTICK);
            }
        }
    }

    fn bits(&self, of: &[bool; EXCEPTIONS], word: u32) -> u32 {
        let first = EXTERNAL + 32 * word as usize;
        (0..32)
            .filter(|bit| of.get(first + bit) == Some(&true))
            .map(|bit| 1 << bit)
            .sum()
    }

    fn each_line(address: u32, base: u32, value: u32) -> impl Iterator<Item = usize> {
        let first = EXTERNAL + 8 * (address - base) as usize;
        (0..32)
            .filter(move |bit| value >> bit & 1 == 1)
            .map(move |bit| first + bit)
            .filter(|&n| n < EXCEPTIONS)
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&mut self, address: u32, now: u64) -> Result<u32, String> {
        let now = self.held.unwrap_or(now);
        #[allow(clippy::cast_possible_truncation)]
        Ok(match address {
            DWT_CTRL => COMPARATORS | u32::from(self.counter_on),
            DWT_CYCCNT => (now - self.counter_zero) as u32,
            SYST_CSR => {
                self.systick.control | u32::from(std::mem::take(&mut self.systick.wrapped)) << 16
            }
            SYST_RVR => self.systick.reload,
            SYST_CVR if self.systick.control & 1 == 1 => {
                self.systick.next.saturating_sub(now) as u32
            }
            SYST_CVR => 0,
            ISER..0xE000_E180 => self.bits(&self.enabled, (address - ISER) / 4),
            ISPR..0xE000_E280 => self.bits(&self.pending, (address - ISPR) / 4),
            IPR..0xE000_E480 => self.priorities(EXTERNAL + (address - IPR) as usize),
            SHPR1..0xE000_ED24 => self.priorities(4 + (address - SHPR1) as usize),
            ICSR => self.active.last().map_or(0, |&n| n as u32),
            AIRCR => 0xFA05_0000,
            0xE000_E000.. => self.control.read(address & 0xFFF)?,
            _ => return Err("the model has no register here".into()),
        })
    }

    fn priorities(&self, first: usize) -> u32 {
        let at = |k: usize| self.priority.get(first + k).copied().unwrap_or(0);
        u32::from_le_bytes([at(0), at(1), at(2), at(3)])
    }

    /// Writes one byte or two of a priority register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write_bytes(
        &mut self,
        word: u32,
        shift: u32,
        mask: u32,
        value: u32,
    ) -> Result<(), String> {
        let old = self.read(word, 0)?;
        self.write(word, old & !(mask << shift) | (value & mask) << shift, 0)
            .map(|_| ())
    }

    /// Writes a register; `true` asks for a reset of the chip.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, address: u32, value: u32, now: u64) -> Result<bool, String> {
        match address {
            DWT_CTRL => {
                if value & 1 == 1 && !self.counter_on {
                    self.counter_zero = now;
                }
                self.counter_on = value & 1 == 1;
            }
            SYST_CSR => {
                if value & 1 == 1 && self.systick.control & 1 == 0 {
                    self.systick.next = now + u64::from(self.systick.reload) + 1;
                }
                self.systick.control = value & 7;
            }
            SYST_RVR => self.systick.reload = value & 0x00FF_FFFF,
            SYST_CVR => self.systick.next = now + u64::from(self.systick.reload) + 1,
            ISER..0xE000_E180 => {
                Self::each_line(address, ISER, value).for_each(|n| self.enabled[n] = true)
            }
            ICER..0xE000_E200 => {
                Self::each_line(address, ICER, value).for_each(|n| self.enabled[n] = false)
            }
            ISPR..0xE000_E280 => {
                Self::each_line(address, ISPR, value).for_each(|n| self.set_pending(n))
            }
            ICPR..0xE000_E300 => {
                Self::each_line(address, ICPR, value).for_each(|n| self.pending[n] = false);
                self.any_pending = self.pending.contains(&true);
            }
            IPR..0xE000_E480 => self.set_priorities(EXTERNAL + (address - IPR) as usize, value),
            SHPR1..0xE000_ED24 => self.set_priorities(4 + (address - SHPR1) as usize, value),
            ICSR => {
                const PEND_PENDSV: u32 = 1 << 28;
                const PEND_SYSTICK: u32 = 1 << 26;
                if value & PEND_PENDSV != 0 {
                    self.set_pending(PENDSV);
                }
                if value & PEND_SYSTICK != 0 {
                    self.set_pending(SYSTICK);
                }
            }
            AIRCR => {
                const KEY: u32 = 0x05FA;
                const SYSRESETREQ: u32 = 4;
                return Ok(value >> 16 == KEY && value & SYSRESETREQ != 0);
            }
            0xE000_E000.. => {
                self.control.write(address & 0xFFF, value)?;
            }
            _ => return Err("the model has no register here".into()),
        }
        Ok(false)
    }

    fn set_priorities(&mut self, first: usize, value: u32) {
        // Four bits of priority: the upper half of each byte.
        for (k, byte) in value.to_le_bytes().into_iter().enumerate() {
            if let Some(priority) = self.priority.get_mut(first + k) {
                *priority = byte & 0xF0;
            }
        }
    }
}

impl Default for Nvic {
    fn default() -> Self {
        Self::new()
    }
}
