//! RCC, PWR, FLASH, SYSCFG, DBGMCU, GPIO: registers that hold their values, and the ready flags that follow them.

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
const RCC_CSR: u32 = 0x94;

/// What only holds values.
pub struct System {
    rcc: Registers,
    power: Registers,
    flash: Registers,
    configuration: Registers,
    debug: Registers,
    ports: Vec<Registers>,
    reset_flags: u32,
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
                ("PLLCFGR", 0x0C, 0x0000_1000),
                ("AHB1RSTR", 0x28, 0),
                ("AHB2RSTR", 0x2C, 0),
                ("APB1RSTR1", 0x38, 0),
                ("APB2RSTR", 0x40, 0),
                ("AHB1ENR", 0x48, 0x0000_0100),
                ("AHB2ENR", 0x4C, 0),
                ("APB1ENR1", 0x58, 0x0000_0400),
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
                    ("ODR", 0x14, 0),
                    ("BSRR", 0x18, 0),
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
                    ("SR2", 0x14, 0),
                    ("CR5", 0x80, 0x0000_0100),
                ],
            ),
            flash: Registers::new("FLASH", &[("ACR", 0x00, 0x0004_0600)]),
            configuration: Registers::new("SYSCFG", &[("CFGR2", 0x1C, 0)]),
            debug: Registers::new("DBGMCU", &[("APB1FZR1", 0x08, 0), ("APB2FZR", 0x10, 0)]),
            ports: ports.collect(),
            reset_flags: POWER_ON,
        }
    }

    /// Says at the next boot why the chip was reset; the pin's flag is set with every reason.
    pub fn set_reset_reason(&mut self, reason: Reset) {
        self.reset_flags = 1 << 26
            | match reason {
                Reset::Software => 1 << 28,
                Reset::Watchdog => 1 << 29,
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
        ["APB1FZR1", "APB2FZR"].map(|name| self.debug.get(name))
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
                    let on = self.rcc.read(offset)? & (1 << 8 | 1 << 16 | 1 << 24);
                    self.rcc.read(offset)? & !(on << 1) | on << 1 | (on & 1 << 8) << 2
                }
                // The switch has been made: SWS follows SW.
                RCC_CFGR => {
                    let cfgr = self.rcc.read(offset)?;
                    cfgr & !0xC | (cfgr & 3) << 2
                }
                RCC_CSR => self.rcc.read(offset)? | self.reset_flags,
                _ => self.rcc.read(offset)?,
            }),
            PWR => self.power.read(offset),
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
                let value = if offset == RCC_CSR {
                    value & 0x1
                } else {
                    value
                };
                self.rcc.write(offset, value)?;
            }
            PWR => {
                self.power.write(offset, value)?;
            }
            FLASH => {
                self.flash.write(offset, value)?;
            }
            SYSCFG => {
                self.configuration.write(offset, value)?;
            }
            DBGMCU => {
                self.debug.write(offset, value)?;
            }
            _ => match self.port(address) {
                Some(port) => {
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
