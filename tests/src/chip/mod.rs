//! The chip around the core: its peripherals, as far as the firmware touches them, and its time.
//!
//! Time is in core cycles since the reset, and it moves only when [`Chip::advance`] is called. The peripherals' clocks
//! are taken as the core's from the start: what runs before the PLL is up runs too fast, which nothing depends on.

pub mod adc;
pub mod analog;
pub mod dma;
pub mod encoder;
pub mod nvic;
pub mod pwm;
pub mod registers;
pub mod system;
pub mod watchdog;

use crate::pins::{Bridge, Machine, Motor, Sensors};
use adc::{Adc, Conversion};
use analog::{Comparators, Dac};
use dma::Dma;
use encoder::EncoderTimer;
use nvic::Nvic;
use pwm::{PwmTimer, Turn};
use std::cell::RefCell;
use std::rc::Rc;
use system::System;
use watchdog::Watchdog;

/// Core clock, Hz.
pub const CORE_HZ: u64 = 170_000_000;

/// What happened at a bridge: for comparing streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Top {
    /// Whose.
    pub motor: Motor,
    /// When, core cycles since the reset.
    pub time: u64,
    /// What the bridge does from here on.
    pub bridge: Bridge,
    /// What was sampled.
    pub sensors: Sensors,
}

/// The chip.
pub struct Chip {
    /// Core cycles since the reset.
    pub now: u64,
    /// Clocks, power, flash interface, pins: what only holds values and ready flags.
    pub system: System,
    /// Interrupts, system control block, SysTick, cycle counter.
    pub nvic: Nvic,
    /// TIM1 and TIM8.
    pub pwm: [PwmTimer; 2],
    /// TIM2 and TIM5, then TIM4.
    pub encoders: [EncoderTimer; 3],
    /// ADC1 to ADC4.
    pub adcs: [Adc; 4],
    /// DAC3 and DAC4.
    pub dacs: [Dac; 2],
    /// COMP1 to COMP7.
    pub comparators: Comparators,
    /// DMA1 and its multiplexer.
    pub dma: Dma,
    /// IWDG.
    pub watchdog: Watchdog,
    /// The machine at the pins.
    machine: Rc<RefCell<dyn Machine>>,
    sensors: [Sensors; 2],
    /// Every top so far, if it is kept.
    pub tops: Option<Vec<Top>>,
    /// Faults put in from outside.
    pub provoked: Provoked,
    /// Words that DMA wants in memory.
    pub memory_writes: Vec<(u32, u16)>,
    /// Cycles that bus accesses have added since the core last asked.
    pub bus_wait: u64,
    /// The first thing that the model does not have.
    pub error: Option<String>,
    /// Why the chip wants a reset.
    pub reset: Option<Reset>,
    next_event: u64,
}

/// Faults put in from outside.
#[derive(Clone, Copy, Debug, Default)]
pub struct Provoked {
    /// The encoders hold this count.
    pub stuck_encoder: [Option<u32>; 2],
    /// The phase currents read this, at the ADCs and at the comparators, at once.
    pub over_current: [Option<u16>; 2],
}

/// Why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The core asked (AIRCR).
    Software,
    /// The independent watchdog was not fed.
    Watchdog,
}

impl Chip {
    /// A chip after a power-on reset, joined to `machine`.
    #[must_use]
    pub fn new(machine: Rc<RefCell<dyn Machine>>) -> Self {
        Self {
            now: 0,
            system: System::new(),
            nvic: Nvic::new(),
            pwm: [PwmTimer::new("TIM1"), PwmTimer::new("TIM8")],
            encoders: [
                EncoderTimer::new("TIM2", u32::MAX),
                EncoderTimer::new("TIM5", u32::MAX),
                EncoderTimer::new("TIM4", 0xFFFF),
            ],
            adcs: [1, 2, 3, 4].map(Adc::new),
            dacs: [Dac::new("DAC3"), Dac::new("DAC4")],
            comparators: Comparators::new(),
            dma: Dma::new(),
            watchdog: Watchdog::new(),
            machine,
            sensors: [Sensors::default(); 2],
            tops: None,
            provoked: Provoked::default(),
            memory_writes: Vec::new(),
            bus_wait: 0,
            error: None,
            reset: None,
            next_event: u64::MAX,
        }
    }

    /// Everything but time, machine and record goes back to its reset value; the flags say why.
    pub fn restart(&mut self, reason: Reset) {
        self.machine.borrow_mut().reset();
        let fresh = Self::new(Rc::clone(&self.machine));
        let old = std::mem::replace(self, fresh);
        self.tops = old.tops;
        self.system.set_reset_reason(reason);
        self.nvic.set_time_zero(old.now);
        self.now = old.now;
    }

    /// Joins TIM1 (0) or TIM8 (1) to its motor.
    fn motor(index: usize) -> Motor {
        if index == 0 { Motor::Screw } else { Motor::Nut }
    }

    /// When something next happens by itself.
    #[must_use]
    pub fn next_event(&self) -> u64 {
        self.next_event
    }

    fn reschedule(&mut self) {
        let pwm = self.pwm.iter().filter_map(PwmTimer::next_turn);
        let adc = self.adcs.iter().filter_map(Adc::done_at);
        let others = [self.nvic.next_systick(), self.watchdog.bites_at()]
            .into_iter()
            .flatten();
        self.next_event = pwm.chain(adc).chain(others).min().unwrap_or(u64::MAX);
    }

    /// Lets time run to `to`; what falls due on the way happens in its order.
    pub fn advance(&mut self, to: u64) {
        while self.next_event <= to {
            self.now = self.now.max(self.next_event);
            self.happen();
            self.reschedule();
        }
        self.now = to;
    }

    fn happen(&mut self) {
        for index in 0..2 {
            if self.pwm[index].next_turn() == Some(self.now) {
                self.turn(index);
            }
        }
        for index in 0..4 {
            if self.adcs[index].done_at() == Some(self.now) {
                self.converted(index);
            }
        }
        self.nvic.tick(self.now);
        if self.watchdog.bites_at() == Some(self.now) {
            self.reset.get_or_insert(Reset::Watchdog);
            self.watchdog.stop();
        }
    }

    /// A PWM timer's counter turned.
    fn turn(&mut self, index: usize) {
        let Turn { top, update } = self.pwm[index].turn(self.now);
        // The machine stands until its sensors are first sampled.
        let armed = [&self.adcs[0], &self.adcs[3]][index].armed();
        if top && armed {
            let motor = Self::motor(index);
            let bridge = self.pwm[index].bridge();
            let mut sensors = self.machine.borrow_mut().top(motor, self.now, bridge);
            if let Some(count) = self.provoked.stuck_encoder[index] {
                sensors.encoder = count;
            }
            if let Some(counts) = self.provoked.over_current[index] {
                sensors.current = [counts; 3];
            }
            self.sensors[index] = sensors;
            self.encoders[index].set_count(sensors.encoder);
            self.encoders[2].set_count(u32::from(sensors.scale));
            if let Some(tops) = &mut self.tops {
                tops.push(Top {
                    motor,
                    time: self.now,
                    bridge,
                    sensors,
                });
            }
            self.compare_currents();
        }
        if update {
            if self.pwm[index].trigger_output() == pwm::Output::Update {
                // TIM1 is trigger 0, TIM8 trigger 5 of the encoders' timers (table 291).
                let trigger = encoder::trigger_code([0, 5][index]);
                self.encoders[index].trigger(trigger);
            }
            if self.pwm[index].trigger_output_2() == pwm::Output::Update {
                for adc in &mut self.adcs {
                    adc.trigger(index, self.now);
                }
            }
        }
    }

    /// The comparators hold the phase currents against the DACs and drive the break inputs.
    fn compare_currents(&mut self) {
        let thresholds = [
            self.dacs[0].output(1),
            self.dacs[0].output(2),
            self.dacs[1].output(1),
        ];
        for index in 0..2 {
            let high = self
                .comparators
                .outputs(index, self.sensors[index].current, thresholds);
            if self.pwm[index].break_input(high) {
                self.machine.borrow_mut().stopped(Self::motor(index));
            }
        }
    }

    /// The count that the encoder of `motor` last had.
    #[must_use]
    pub fn last_count(&self, motor: Motor) -> u32 {
        self.sensors[motor as usize].encoder
    }

    /// Puts an over-current on a motor's shunts now, between two tops, as its comparators see it.
    pub fn short_circuit(&mut self, motor: Motor, counts: u16) {
        let index = motor as usize;
        self.provoked.over_current[index] = Some(counts);
        self.sensors[index].current = [counts; 3];
        self.compare_currents();
    }

    /// The over-current is gone.
    pub fn end_short_circuit(&mut self, motor: Motor) {
        self.provoked.over_current[motor as usize] = None;
    }

    /// An ADC finished a sequence.
    fn converted(&mut self, index: usize) {
        let (adc, sensors) = (&mut self.adcs[index], &self.sensors);
        match adc.finish(|channel| wired(index, channel, sensors)) {
            Ok(Conversion::Injected) => {}
            Ok(Conversion::Regular(counts)) => {
                let from = 0x5000_0040 + 0x100 * u32::try_from(index).unwrap_or(0);
                match self.dma.transfer(index, from, counts) {
                    Ok(write) => self.memory_writes.extend(write),
                    Err(error) => self.fail(error),
                }
            }
            Err(error) => self.fail(error),
        }
        let line = [nvic::ADC1_2, nvic::ADC1_2, nvic::ADC3, nvic::ADC4][index];
        let level = match index {
            0 | 1 => self.adcs[0].interrupt() || self.adcs[1].interrupt(),
            _ => self.adcs[index].interrupt(),
        };
        self.nvic.set_level(line, level);
    }

    fn fail(&mut self, error: String) {
        self.error.get_or_insert(error);
    }

    /// The core reads `size` bytes at `address`.
    pub fn read(&mut self, address: u32, size: usize) -> u32 {
        let word = address & !3;
        let shift = 8 * (address & 3);
        let value = self.read_word(word).unwrap_or_else(|error| {
            self.fail(format!("the firmware reads {address:#010x}: {error}"));
            0
        });
        (value >> shift) & mask(size)
    }

    /// The core writes `size` bytes at `address`.
    pub fn write(&mut self, address: u32, size: usize, value: u32) {
        let word = address & !3;
        let shift = 8 * (address & 3);
        // The watchdog's registers hold 16 bits, and half a word is a whole write of them.
        let halves = (0x4000_3000..0x4000_3400).contains(&address) && size == 2 && shift == 0;
        let result = if size == 4 || halves {
            self.write_word(word, value)
        } else if nvic::takes_bytes(word) {
            self.nvic.write_bytes(word, shift, mask(size), value)
        } else {
            Err(format!("a write of {size} bytes"))
        };
        if let Err(error) = result {
            self.fail(format!(
                "the firmware writes {value:#x} to {address:#010x}: {error}"
            ));
        }
        self.reschedule();
    }

    fn read_word(&mut self, address: u32) -> Result<u32, String> {
        let now = self.now;
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        self.bus_wait += bus_wait(address);
        match block {
            0x4001_2C00 => self.pwm[0].read(offset, now),
            0x4001_3400 => self.pwm[1].read(offset, now),
            0x4000_0000 => self.encoders[0].read(offset),
            0x4000_0C00 => self.encoders[1].read(offset),
            0x4000_0800 => self.encoders[2].read(offset),
            0x5000_0000 | 0x5000_0400 => adc::read(&mut self.adcs, address),
            0x5000_1000 => self.dacs[0].read(offset),
            0x5000_1400 => self.dacs[1].read(offset),
            0x4001_0000 if offset >= 0x200 => self.comparators.read(offset - 0x200),
            0x4002_0000 | 0x4002_0800 => self.dma.read(address),
            0x4000_3000 => self.watchdog.read(offset),
            0xE000_0000.. => self.nvic.read(address, now),
            _ => self.system.read(address),
        }
    }

    fn write_word(&mut self, address: u32, value: u32) -> Result<(), String> {
        let now = self.now;
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        self.bus_wait += bus_wait(address);
        match block {
            0x4001_2C00 => {
                self.pwm[0].write(offset, value, now)?;
                // TIM8 starts with TIM1: trigger mode on ITR0.
                if self.pwm[0].trigger_output() == pwm::Output::Enable && self.pwm[0].running() {
                    self.pwm[1].start_by_trigger(0, now);
                }
                Ok(())
            }
            0x4001_3400 => self.pwm[1].write(offset, value, now),
            0x4000_0000 => self.encoders[0].write(offset, value),
            0x4000_0C00 => self.encoders[1].write(offset, value),
            0x4000_0800 => self.encoders[2].write(offset, value),
            0x5000_0000 | 0x5000_0400 => {
                adc::write(&mut self.adcs, address, value)?;
                let level = self.adcs[0].interrupt() || self.adcs[1].interrupt();
                self.nvic.set_level(nvic::ADC1_2, level);
                self.nvic.set_level(nvic::ADC3, self.adcs[2].interrupt());
                self.nvic.set_level(nvic::ADC4, self.adcs[3].interrupt());
                Ok(())
            }
            0x5000_1000 => self.dacs[0].write(offset, value),
            0x5000_1400 => self.dacs[1].write(offset, value),
            0x4001_0000 if offset >= 0x200 => self.comparators.write(offset - 0x200, value),
            0x4002_0000 | 0x4002_0800 => self.dma.write(address, value),
            0x4000_3000 => self.watchdog.write(offset, value, now),
            0xE000_0000.. => {
                if self.nvic.write(address, value, now)? {
                    self.reset.get_or_insert(Reset::Software);
                }
                Ok(())
            }
            _ => self.system.write(address, value),
        }
    }
}

/// What channel `channel` of ADC `index` + 1 is wired to on the default board (see the firmware's board module).
fn wired(index: usize, channel: u32, [screw, nut]: &[Sensors; 2]) -> Option<u16> {
    Some(match (index + 1, channel) {
        (1, 1) => screw.current[0],
        (2, 2) => screw.current[1],
        (2, 4) => screw.current[2],
        (1, 6) => screw.bus,
        (1, 7) => screw.temperature,
        (4, 4) => nut.current[0],
        (3, 12) => nut.current[1],
        (3, 5) => nut.current[2],
        (4, 3) => nut.bus,
        (2, 8) => nut.temperature,
        _ => return None,
    })
}

/// Cycles that the bus adds to an access: the bridge to the APB peripherals (timers, comparators, watchdog) takes two
/// more than the core's own cycle, the AHB ones (ADC, DAC, GPIO, RCC) one.
fn bus_wait(address: u32) -> u64 {
    match address {
        0x4000_0000..0x4002_0000 => 2,
        0xE000_0000.. => 0,
        _ => 1,
    }
}

fn mask(size: usize) -> u32 {
    match size {
        1 => 0xFF,
        2 => 0xFFFF,
        _ => u32::MAX,
    }
}
