//! RCC, PWR, FLASH, SYSCFG, DBGMCU, GPIO: registers that hold their values, the ready flags that follow them, the crystal,
//! and what a supply that sags does.

use super::Reset;
use super::registers::Registers;

const RCC: u32 = 0x4002_1000;
const PWR: u32 = 0x4000_7000;
const FLASH: u32 = 0x4002_2000;
const SYSCFG: u32 = 0x4001_0000;
const DBGMCU: u32 = 0xE004_2000;
const GPIO: u32 = 0x4800_0000;
const PORTS: usize = 6;

const RCC_CR: u32 = 0x00;
const RCC_CFGR: u32 = 0x08;
const RCC_CIFR: u32 = 0x1C;
const RCC_CICR: u32 = 0x20;
const RCC_CSR: u32 = 0x94;
const PWR_CR2: u32 = 0x04;
const PWR_CR5: u32 = 0x80;
const SYSCFG_CFGR2: u32 = 0x1C;
const GPIO_ODR: u32 = 0x14;
const GPIO_BSRR: u32 = 0x18;
const GPIO_BRR: u32 = 0x28;

const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const CSSON: u32 = 1 << 19;
const CSSF: u32 = 1 << 8;
/// PWR_CR5: range 1 normal mode.
const R1MODE: u32 = 1 << 8;

/// Brown-out level 4, V falling, and the levels of the PVD (datasheet, embedded reset and power control block; memory).
const BROWN_OUT_V: f64 = 2.8;
const PVD_V: [f64; 7] = [2.0, 2.2, 2.4, 2.5, 2.6, 2.8, 2.9];

/// What a supply does to the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supply {
    /// Nothing.
    Enough,
    /// The PVD breaks the timers.
    Break,
    /// The brown-out reset.
    Reset,
}

/// A memory whose wrong bits the chip finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checked {
    /// Flash: two wrong bits in a double word, by ECC (RM0440 3.3.8).
    Flash,
    /// RAM: one wrong bit in a byte, by parity, where the option byte has it on (RM0440 2.4.1).
    Ram,
}

/// What only holds values.
pub struct System {
    rcc: Registers,
    power: Registers,
    flash: Registers,
    configuration: Registers,
    debug: Registers,
    ports: Vec<Registers>,
    reset_flags: u32,
    /// The supply, V.
    pub supply_v: f64,
    /// The crystal swings.
    pub crystal: bool,
    /// The clock security system does nothing, whatever is asked of it.
    pub security_off: bool,
    /// The core's regulator never reaches boost mode.
    pub no_boost: bool,
    /// The clock security system saw the crystal stop.
    clock_failed: bool,
}

const PORT_NAMES: [&str; PORTS] = ["GPIOA", "GPIOB", "GPIOC", "GPIOD", "GPIOE", "GPIOF"];

impl System {
    /// After a power-on reset.
    #[must_use]
    pub fn new() -> Self {
        let rcc = Registers::new(
            "RCC",
            &[
                ("CR", RCC_CR, 0x0000_0063),
                ("CFGR", RCC_CFGR, 0x0000_0005),
                ("CIFR", RCC_CIFR, 0),
                ("CICR", RCC_CICR, 0),
                ("PLLCFGR", 0x0C, 0x0000_1000),
                ("AHB1RSTR", 0x28, 0),
                ("AHB2RSTR", 0x2C, 0),
                ("APB1RSTR1", 0x38, 0),
                ("APB2RSTR", 0x40, 0),
                ("AHB1ENR", 0x48, 0x0000_0100),
                ("AHB2ENR", 0x4C, 0),
                ("APB1ENR1", 0x58, 0x0000_0400),
                ("APB1ENR2", 0x5C, 0),
                ("APB2ENR", 0x60, 0),
                ("CCIPR", 0x88, 0),
                ("CSR", RCC_CSR, 0),
            ],
        );
        // Reset values: RM0440 9.4.1 (GPIOx_MODER, OSPEEDR, PUPDR).
        let ports = PORT_NAMES.iter().enumerate().map(|(port, name)| {
            let (mode, speed, pull) = match port {
                0 => (0xABFF_FFFF, 0x0C00_0000, 0x6400_0000),
                1 => (0xFFFF_FEBF, 0, 0x0000_0100),
                _ => (0xFFFF_FFFF, 0, 0),
            };
            Registers::new(
                name,
                &[
                    ("MODER", 0x00, mode),
                    ("OTYPER", 0x04, 0),
                    ("OSPEEDR", 0x08, speed),
                    ("PUPDR", 0x0C, pull),
                    ("ODR", GPIO_ODR, 0),
                    ("AFRL", 0x20, 0),
                    ("AFRH", 0x24, 0),
                ],
            )
        });
        const POWER_ON: u32 = 1 << 27 | 1 << 26;
        Self {
            rcc,
            power: Registers::new(
                "PWR",
                &[
                    ("CR1", 0x00, 0x0000_0200),
                    ("CR2", PWR_CR2, 0),
                    ("CR3", 0x08, 0x0000_8000),
                    ("SR2", 0x14, 0),
                    ("CR5", PWR_CR5, R1MODE),
                ],
            ),
            // OPTR as ST ships it (RM0440 3.4.1), with brown-out level 4 and SRAM parity as the wiring page asks.
            flash: Registers::new(
                "FLASH",
                &[("ACR", 0x00, 0x0004_0600), ("OPTR", 0x20, 0xFAEF_FCAA)],
            ),
            configuration: Registers::new("SYSCFG", &[("CFGR2", SYSCFG_CFGR2, 0)]),
            debug: Registers::new(
                "DBGMCU",
                // Device 0x469, silicon revision X (RM0440 47.6.1; memory).
                &[
                    ("IDCODE", 0x00, 0x2003_0469),
                    ("CR", 0x04, 0),
                    ("APB1LFZR", 0x08, 0),
                    ("APB2FZR", 0x10, 0),
                ],
            ),
            ports: ports.collect(),
            reset_flags: POWER_ON,
            supply_v: 3.3,
            crystal: true,
            security_off: false,
            no_boost: false,
            clock_failed: false,
        }
    }

    /// Says at the next boot why the chip was reset; the pin's flag is set with every reason.
    pub fn set_reset_reason(&mut self, reason: Reset) {
        self.reset_flags = 1 << 26
            | match reason {
                Reset::Software => 1 << 28,
                Reset::Watchdog => 1 << 29,
                Reset::BrownOut => 1 << 27,
            };
    }

    /// Function of pin `pin` of port `port` (0 is A): its mode (0 input, 1 output, 2 alternate, 3 analog) and its
    /// alternate function.
    #[must_use]
    pub fn pin_function(&self, port: usize, pin: u32) -> (u32, u32) {
        let registers = &self.ports[port];
        let alternate = if pin < 8 {
            registers.get("AFRL") >> (4 * pin)
        } else {
            registers.get("AFRH") >> (4 * (pin - 8))
        };
        (registers.get("MODER") >> (2 * pin) & 3, alternate & 15)
    }

    /// What stops with a core that a debugger halts: the bits of DBGMCU_APB1FZR1 and DBGMCU_APB2FZR.
    #[must_use]
    pub fn stops_with_the_core(&self) -> [u32; 2] {
        ["APB1LFZR", "APB2FZR"].map(|name| self.debug.get(name))
    }

    /// DBGMCU's registers.
    #[must_use]
    pub fn debug(&self) -> &Registers {
        &self.debug
    }

    /// DBGMCU's registers are as they were before a reset that is no loss of power (RM0440 47.8.5).
    pub fn keep_debug(&mut self, registers: &Registers) {
        self.debug = registers.clone();
    }

    /// All that only hold values.
    pub fn registers(&self) -> impl Iterator<Item = &Registers> {
        let Self {
            rcc,
            power,
            flash,
            configuration,
            debug,
            ports,
            ..
        } = self;
        [rcc, power, flash, configuration, debug]
            .into_iter()
            .chain(ports)
    }

    /// A peripheral whose clock is off where it is accessed: its name.
    #[must_use]
    pub fn without_clock(&self, address: u32) -> Option<&'static str> {
        let gated = super::clocks::at(address)?;
        let enabled = self
            .rcc
            .read(gated.register)
            .is_ok_and(|word| word >> gated.bit & 1 == 1);
        (!enabled).then_some(gated.name)
    }

    /// The crystal stops now. `true` if the clock security system sees it (RM0440 7.2.10): it breaks the timers, raises the
    /// NMI and lets the core run on from the HSI; otherwise everything but the watchdog stands.
    pub fn stop_crystal(&mut self) -> bool {
        self.crystal = false;
        let control = self.rcc.get("CR");
        let watched = control & (HSEON | CSSON) == HSEON | CSSON && !self.security_off;
        if watched {
            self.rcc.set("CR", control & !HSEON);
            self.rcc.set("CFGR", self.rcc.get("CFGR") & !3 | 1);
            self.clock_failed = true;
        }
        watched
    }

    /// Whether the core reads wrong bits of `memory` and learns it by the NMI.
    #[must_use]
    pub fn finds_wrong_bits(&self, memory: Checked) -> bool {
        const SRAM_PE: u32 = 1 << 24;
        match memory {
            Checked::Flash => true,
            Checked::Ram => self.flash.get("OPTR") & SRAM_PE == 0,
        }
    }

    /// Whether wrong bits that are found in `memory` break the timers (RM0440 10.2.8, SYSCFG_CFGR2.ECCL and SPL).
    #[must_use]
    pub fn wrong_bits_break(&self, memory: Checked) -> bool {
        let lock = match memory {
            Checked::Flash => 3,
            Checked::Ram => 1,
        };
        self.system_breaks() >> lock & 1 == 1
    }

    /// What a supply of `volts` does.
    #[must_use]
    pub fn supply(&self, volts: f64) -> Supply {
        let cr2 = self.power.get("CR2");
        let level = PVD_V.get((cr2 >> 1 & 7) as usize);
        let locked = self.configuration.get("CFGR2") >> 2 & 1 == 1;
        if volts < BROWN_OUT_V && self.brown_out_level() == 4 {
            Supply::Reset
        } else if cr2 & 1 == 1 && locked && level.is_some_and(|level| volts < *level) {
            Supply::Break
        } else {
            Supply::Enough
        }
    }

    /// The chip is another one: what it says in DBGMCU_IDCODE.
    pub fn set_identity(&mut self, word: u32) {
        self.debug.set("IDCODE", word);
    }

    /// Sets the option bytes, as a programmer does, before the chip starts.
    pub fn set_option_bytes(&mut self, word: u32) {
        self.flash.set("OPTR", word);
    }

    /// The option bytes: a reset keeps them.
    #[must_use]
    pub fn option_bytes(&self) -> u32 {
        self.flash.get("OPTR")
    }

    /// The level of read-out protection, 0 to 2 (RM0440 3.5.1).
    #[must_use]
    pub fn readout_protection(&self) -> u8 {
        match self.option_bytes() & 0xFF {
            0xAA => 0,
            0xCC => 2,
            _ => 1,
        }
    }

    fn brown_out_level(&self) -> u32 {
        self.option_bytes() >> 8 & 7
    }

    /// The pull-downs that UCPD1 puts on PB4 and PB6 while PA10 and PA9 are high are off (RM0440 6.4.3).
    #[must_use]
    pub fn dead_battery_off(&self) -> bool {
        self.power.get("CR3") >> 14 & 1 == 1
    }

    /// An output is driven high; `None` if the pin is no output.
    #[must_use]
    pub fn output(&self, port: usize, pin: u32) -> Option<bool> {
        let (mode, _) = self.pin_function(port, pin);
        (mode == 1).then(|| self.ports[port].get("ODR") >> pin & 1 == 1)
    }

    /// The pull resistor of a pin that is on, to its level.
    #[must_use]
    pub fn pull(&self, port: usize, pin: u32) -> Option<bool> {
        match self.ports[port].get("PUPDR") >> (2 * pin) & 3 {
            1 => Some(true),
            2 => Some(false),
            _ => None,
        }
    }

    /// HSI16 / 16 is on MCO (RM0440 7.4.3, MCOSEL 3, MCOPRE 4).
    #[must_use]
    pub fn hsi_on_mco(&self) -> bool {
        self.rcc.get("CFGR") >> 24 & 0x7F == 0x43 && self.rcc.get("CR") >> 8 & 1 == 1
    }

    /// Whether RCC gives ADC1 and ADC2, or ADC3 and ADC4, a kernel clock of 42.5 MHz: the PLL's 340 MHz by 8 (RM0440 7.4.4, PLLPEN and
    /// PLLPDIV; 7.4.27, ADC12SEL and ADC345SEL). Without one their registers can be written, but nothing that the clock runs.
    ///
    /// # Errors
    /// Another clock is picked.
    pub fn kernel_clocks_adcs(&self, first_pair: bool) -> Result<(), String> {
        let (pll, picked) = (self.rcc.get("PLLCFGR"), self.rcc.get("CCIPR"));
        let picked = picked >> if first_pair { 28 } else { 30 } & 3;
        let by_8 = pll >> 16 & 1 == 1 && pll >> 27 == 8;
        match picked {
            0 => Ok(()),
            1 if by_8 => Ok(()),
            _ => Err(format!(
                "the ADCs' kernel clock {picked} is not 42.5 MHz: RCC_PLLCFGR is {pll:#010x}"
            )),
        }
    }

    /// The core's clock: the PLL's, or HSI16 as after a reset (RM0440 7.4.3, SW).
    #[must_use]
    pub fn core_hz(&self) -> u64 {
        const PLL: u32 = 3;
        match self.rcc.get("CFGR") & 3 {
            PLL => super::CORE_HZ,
            _ => 16_000_000,
        }
    }

    /// LSI is on.
    #[must_use]
    pub fn lsi_on(&self) -> bool {
        self.rcc.get("CSR") & 1 == 1
    }

    /// Speed of a pin, 0 to 3 (RM0440 9.4.3).
    #[must_use]
    pub fn pin_speed(&self, port: usize, pin: u32) -> u32 {
        self.ports[port].get("OSPEEDR") >> (2 * pin) & 3
    }

    /// What breaks the timers beside their own break inputs: the bits of SYSCFG_CFGR2 (RM0440 10.2.8).
    #[must_use]
    pub fn system_breaks(&self) -> u32 {
        self.configuration.get("CFGR2") & 0xF
    }

    /// A core that has locked up breaks the timers.
    #[must_use]
    pub fn lockup_breaks(&self) -> bool {
        self.configuration.get("CFGR2") & 1 != 0
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, address: u32) -> Result<u32, String> {
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        match block {
            RCC => Ok(match offset {
                // Each oscillator and the PLL are ready as soon as they are on: bit n + 1 follows bit n.
                RCC_CR => {
                    let word = self.rcc.read(offset)?;
                    let swings = if self.crystal { u32::MAX } else { !HSERDY };
                    let on = word & (1 << 8 | HSEON | 1 << 24);
                    (word & !(on << 1) | on << 1 | (on & 1 << 8) << 2) & swings
                }
                RCC_CIFR if self.clock_failed => CSSF,
                RCC_CIFR => 0,
                // The switch has been made: SWS follows SW.
                RCC_CFGR => {
                    let cfgr = self.rcc.read(offset)?;
                    cfgr & !0xC | (cfgr & 3) << 2
                }
                // LSIRDY follows LSION.
                RCC_CSR => {
                    let csr = self.rcc.read(offset)?;
                    csr | (csr & 1) << 1 | self.reset_flags
                }
                _ => self.rcc.read(offset)?,
            }),
            PWR => {
                let stuck = if offset == PWR_CR5 && self.no_boost {
                    R1MODE
                } else {
                    0
                };
                Ok(self.power.read(offset)? | stuck)
            }
            FLASH => self.flash.read(offset),
            SYSCFG => self.configuration.read(offset),
            DBGMCU => self.debug.read(offset),
            _ => match self.port(address) {
                Some(port) => self.ports[port].read(offset),
                None => Err("the model has no peripheral here".into()),
            },
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), String> {
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        match block {
            RCC => {
                const REMOVE_FLAGS: u32 = 1 << 23;
                if offset == RCC_CSR && value & REMOVE_FLAGS != 0 {
                    self.reset_flags = 0;
                }
                if offset == RCC_CICR && value & CSSF != 0 {
                    self.clock_failed = false;
                }
                let value = match offset {
                    RCC_CSR => value & 0x1,
                    // Set only, cleared by a reset.
                    RCC_CR => value | self.rcc.read(offset)? & CSSON,
                    _ => value,
                };
                self.rcc.write(offset, value)?;
            }
            // The lock holds it (RM0440 6.4.2).
            PWR if offset == PWR_CR2 && self.system_breaks() >> 2 & 1 == 1 => {}
            PWR => {
                self.power.write(offset, value)?;
            }
            FLASH => {
                self.flash.write(offset, value)?;
            }
            // The locks are set only, cleared by a reset.
            SYSCFG if offset == SYSCFG_CFGR2 => {
                let value = value & 0xF | self.system_breaks();
                self.configuration.write(offset, value)?;
            }
            SYSCFG => {
                self.configuration.write(offset, value)?;
            }
            DBGMCU => {
                self.debug.write(offset, value)?;
            }
            _ => match self.port(address) {
                Some(port) => {
                    let out = self.ports[port].get("ODR");
                    let (offset, value) = match offset {
                        GPIO_BSRR => (GPIO_ODR, out & !(value >> 16) | value & 0xFFFF),
                        GPIO_BRR => (GPIO_ODR, out & !value),
                        _ => (offset, value),
                    };
                    self.ports[port].write(offset, value)?;
                }
                None => return Err("the model has no peripheral here".into()),
            },
        }
        Ok(())
    }

    fn port(&self, address: u32) -> Option<usize> {
        let port = (address.checked_sub(GPIO)? / 0x400) as usize;
        (port < PORTS).then_some(port)
    }
}

impl Default for System {
    fn default() -> Self {
        Self::new()
    }
}
