//! The chip around the core: its peripherals, as far as the firmware touches them, and its time.
//!
//! Time is in core cycles since the reset, and it moves only when [`Chip::advance`] is called. The peripherals' clocks
//! are taken as the core's from the start: what runs before the PLL is up runs too fast, which nothing depends on.

pub mod adc;
pub mod analog;
mod asked;
pub mod basic_timer;
pub mod capture;
pub mod clocks;
pub mod debug;
pub mod dma;
pub mod encoder;
pub mod faults;
pub mod flash;
mod halt;
pub mod nvic;
pub mod outside;
pub mod power;
pub mod pwm;
pub mod registers;
pub mod serial;
pub mod spi;
pub mod stage;
pub mod system;
pub mod watchdog;
pub mod wiring;

use crate::pins::{Bridge, Machine, Motor, Sensors};
use adc::{Adc, Conversion};
use analog::{Comparators, Dac};
use basic_timer::BasicTimer;
use capture::CaptureTimer;
use debug::{Debug, Master};
use dma::{Dma, Transfer};
use encoder::{EncoderTimer, Frame};
use faults::Faults;
use flash::Flash;
use nvic::Nvic;
use outside::Outside;
use power::{PowerFault, PowerStage};
use pwm::{PwmTimer, Turn};
use serial::Serial;
use spi::Spi;
use stage::Stage;
use std::cell::RefCell;
use std::rc::Rc;
use system::{Checked, Supply, System};
use watchdog::Watchdog;
use wiring::Wiring;

/// Core clock, Hz.
pub const CORE_HZ: u64 = 170_000_000;

/// Requests to DMAMUX1 (RM0440 table 91): ADC1 to ADC4.
pub const ADC_REQUESTS: [u32; 4] = [5, 36, 37, 38];
/// Channel 1 of TIM2 and of TIM5; their other channels follow.
pub const TIMER_REQUESTS: [u32; 2] = [56, 72];
/// SPI1 has received.
pub const SPI1_RECEIVED: u32 = 10;

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
    /// TIM7.
    pub deadman: BasicTimer,
    /// ADC1 to ADC4.
    pub adcs: [Adc; 4],
    /// DAC3 and DAC4.
    pub dacs: [Dac; 2],
    /// COMP1 to COMP7.
    pub comparators: Comparators,
    /// DMA1 and its multiplexer.
    pub dma: Dma,
    /// SPI1.
    pub spi: Spi,
    /// LPUART1.
    pub serial: Serial,
    /// TIM16.
    pub capture: CaptureTimer,
    /// The flash's controller and its last pages.
    pub flash: Flash,
    /// What is outside the digital pins.
    pub outside: Outside,
    /// Faults of chip and board.
    pub faults: Faults,
    /// IWDG.
    pub watchdog: Watchdog,
    /// The core's debug registers.
    pub debug: Debug,
    /// The power stages' gate drivers: screw's, nut's.
    stages: [Stage; 2],
    /// The board that it is on.
    wiring: Wiring,
    /// The machine at the pins.
    machine: Rc<RefCell<dyn Machine>>,
    sensors: [Sensors; 2],
    /// Currents as the machine gave them last.
    sampled: [[u16; 3]; 2],
    /// Every top so far, if it is kept.
    pub tops: Option<Vec<Top>>,
    /// Faults injected from outside.
    pub provoked: Provoked,
    /// What DMA wants in memory: address, value, bytes of it.
    pub memory_writes: Vec<(u32, u16, usize)>,
    /// Cycles that bus accesses have added since the core last asked.
    pub bus_wait: u64,
    /// The first thing that the model does not have.
    pub error: Option<String>,
    /// Why the chip wants a reset.
    pub reset: Option<Reset>,
    /// The clock stands, and with it all but the watchdog; the pins stay as they are.
    pub frozen: bool,
    next_event: u64,
}

/// Faults injected from outside.
#[derive(Clone, Copy, Debug, Default)]
pub struct Provoked {
    /// Bits of the absolute encoders' frames that arrive turned over.
    pub frame_errors: [u32; 2],
    /// Edges of the incremental encoders that are not seen, once.
    pub lost_counts: [u32; 2],
    /// The next read of a motor's currents by its loop takes this many cycles.
    pub slow_read: [Option<u64>; 2],
    /// The incremental encoders' indices do not come.
    pub no_index: [bool; 2],
    /// The encoders hold this count.
    pub stuck_encoder: [Option<u32>; 2],
    /// The phase currents read this, at the ADCs and at the comparators, at once.
    pub over_current: [Option<u16>; 2],
    /// The gate drivers say that they have a fault.
    pub driver_fault: [bool; 2],
    /// A fault of a power stage.
    pub power_fault: [Option<(PowerStage, PowerFault)>; 2],
}

/// Why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The core asked (AIRCR).
    Software,
    /// The independent watchdog was not fed.
    Watchdog,
    /// The supply fell below the brown-out level.
    BrownOut,
}

impl Chip {
    /// A chip after a power-on reset on a board, with erased flash, joined to `machine`.
    #[must_use]
    pub fn new(machine: Rc<RefCell<dyn Machine>>, wiring: Wiring) -> Self {
        let sensors = [Motor::Screw, Motor::Nut].map(|motor| machine.borrow().still(motor));
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
            deadman: BasicTimer::new(),
            adcs: [1, 2, 3, 4].map(Adc::new),
            dacs: [Dac::new("DAC3"), Dac::new("DAC4")],
            comparators: Comparators::new(),
            dma: Dma::new(),
            spi: Spi::new(),
            serial: Serial::new(),
            capture: CaptureTimer::new(),
            flash: Flash::new(),
            outside: Outside::of(wiring),
            faults: Faults::default(),
            watchdog: Watchdog::new(),
            debug: Debug::default(),
            stages: [Stage::new(); 2],
            wiring,
            machine,
            sensors,
            sampled: [[0; 3]; 2],
            tops: None,
            provoked: Provoked::default(),
            memory_writes: Vec::new(),
            bus_wait: 0,
            error: None,
            reset: None,
            frozen: false,
            next_event: u64::MAX,
        }
    }

    /// Everything but time, machine and record goes back to its reset value; the flags say why.
    pub fn restart(&mut self, reason: Reset) {
        self.machine.borrow_mut().reset();
        let fresh = Self::new(Rc::clone(&self.machine), self.wiring);
        let old = std::mem::replace(self, fresh);
        self.tops = old.tops;
        self.outside = old.outside;
        self.faults = old.faults;
        self.provoked = old.provoked;
        self.stages = old.stages;
        self.flash = old.flash;
        self.flash.reset();
        self.system.crystal = old.system.crystal;
        // A brown-out's reset ends when the supply is back. What belongs to the debugger only a loss of power resets.
        if reason != Reset::BrownOut {
            self.system.supply_v = old.system.supply_v;
            self.system.keep_debug(old.system.debug());
            self.debug = old.debug;
        }
        self.system.no_boost = old.system.no_boost;
        self.system.set_option_bytes(old.system.option_bytes());
        self.system.set_reset_reason(reason);
        self.nvic.set_time_zero(old.now);
        self.now = old.now;
        self.drive_enables();
    }

    /// Changes a power stage's supply, its ENABLE wire or its driver's fault, now.
    pub fn change_stage(&mut self, motor: Motor, change: impl FnOnce(&mut Stage)) {
        change(&mut self.stages[motor as usize]);
        self.drive_enables();
        self.look_at_breaks();
        self.reschedule();
    }

    /// The levels of the ENABLE pins reach the drivers; a pin that floats is held low (wiring page).
    fn drive_enables(&mut self) {
        for (index, stage) in self.stages.iter_mut().enumerate() {
            let (port, pin) = self.wiring.driver(index).enable;
            let high = self.system.output(port, pin) == Some(true);
            stage.drive_enable(high, self.now);
        }
    }

    /// What a stage gives in place of what is measured: the bus of one without supply, and the amplifiers of a driver that sleeps, where
    /// they are the driver's.
    fn as_stage_gives(&self, index: usize, sensors: &mut Sensors) {
        let given = match self.stages[index].supplied {
            true => f64::from(sensors.bus) * self.faults.divider[index],
            false => 0.0,
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let bus = given.round() as u16;
        sensors.bus = bus;
        if self.amplifiers_are_silent(index) {
            sensors.current = [0; 3];
        } else {
            for (current, off) in sensors.current.iter_mut().zip(self.faults.zero_off[index]) {
                *current = current.saturating_add_signed(off).min(4095);
            }
        }
    }

    /// A stage's amplifiers give 0 V: they are those of a driver that sleeps.
    fn amplifiers_are_silent(&self, index: usize) -> bool {
        self.wiring.amplifiers_sleep() && !self.stages[index].is_awake(self.now)
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
        let frames = self
            .encoders
            .iter()
            .filter_map(EncoderTimer::next_frame_event)
            .chain(self.spi.done_at())
            .chain(self.serial.next_at());
        let breaks = self.pwm.iter().filter_map(PwmTimer::break_due);
        let others = [self.nvic.next_systick(), self.deadman.out_at()]
            .into_iter()
            .flatten();
        let edges = (0..2).filter_map(|index| self.next_edge(index));
        let clocked = pwm
            .chain(edges)
            .chain(adc)
            .chain(frames)
            .chain(breaks)
            .chain(others)
            .min()
            .filter(|_| !self.frozen);
        self.next_event = clocked
            .into_iter()
            .chain(self.watchdog.bites_at(self.faults.lsi_hz))
            .min()
            .unwrap_or(u64::MAX);
    }

    /// Lets time run to `to`; what falls due on the way happens in its order.
    pub fn advance(&mut self, to: u64) {
        // So many events at one instant do not exist: the model would go on without end.
        const MOST_AT_ONCE: u32 = 1000;
        let mut at_once = 0;
        while self.next_event <= to {
            at_once = if self.next_event > self.now {
                0
            } else {
                at_once + 1
            };
            if at_once > MOST_AT_ONCE {
                self.fail(format!(
                    "the chip has {at_once} events at {} cycles, and time does not pass",
                    self.now
                ));
                break;
            }
            self.now = self.now.max(self.next_event);
            self.happen();
            self.reschedule();
        }
        self.now = to;
    }

    fn happen(&mut self) {
        if !self.frozen {
            self.happen_clocked();
        }
        if self.watchdog.bites_at(self.faults.lsi_hz) == Some(self.now) {
            self.reset.get_or_insert(Reset::Watchdog);
            self.watchdog.stop();
        }
    }

    fn happen_clocked(&mut self) {
        for index in 0..2 {
            if self.pwm[index].break_due() == Some(self.now) && self.pwm[index].break_passed() {
                self.machine.borrow_mut().stopped(Self::motor(index));
            }
        }
        if self.provoked.power_fault.iter().any(Option::is_some) {
            self.look_at_breaks();
        }
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
        for index in 0..2 {
            if self.encoders[index].next_frame_event() == Some(self.now) {
                self.frame_event(index);
            }
        }
        if self.spi.done_at() == Some(self.now) {
            self.exchanged();
        }
        if self.serial.next_at() == Some(self.now) {
            self.byte_came();
        }
        if self.deadman.out_at() == Some(self.now) {
            self.deadman.run_out(self.now);
            self.nvic.set_level(nvic::TIM7, self.deadman.interrupt());
        }
        self.nvic.tick(self.now);
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
            self.sampled[index] = sensors.current;
            if let Some((stage, fault)) = self.provoked.power_fault[index] {
                for (phase, leg) in self.pwm[index].legs(self.now).into_iter().enumerate() {
                    sensors.current[phase] = stage.counts(fault, phase, leg);
                }
            }
            if let Some(counts) = self.provoked.over_current[index] {
                sensors.current = [counts; 3];
            }
            self.as_stage_gives(index, &mut sensors);
            self.sensors[index] = sensors;
            let lost = std::mem::take(&mut self.provoked.lost_counts[index]);
            let counts = self.encoders[index].counts_per_turn();
            let scale = self.machine.borrow_mut().scale();
            let scale_range = self.encoders[2].counts_per_turn();
            self.encoders[2].set_count(scale & 0xFFFF, scale_range, 0, false);
            self.encoders[index].set_count(
                sensors.encoder,
                counts,
                lost,
                sensors.index && !self.provoked.no_index[index],
            );
            if let Some(tops) = &mut self.tops {
                tops.push(Top {
                    motor,
                    time: self.now,
                    bridge,
                    sensors,
                });
            }
            self.look_at_breaks();
        }
        if update {
            if self.pwm[index].trigger_output() == pwm::Output::Update {
                // TIM1 is trigger 0, TIM8 trigger 5 of the encoders' timers (table 291).
                let trigger = encoder::trigger_code([0, 5][index]);
                self.trigger_encoder(index, trigger);
            }
            if self.pwm[index].trigger_output_2() == pwm::Output::Update {
                for adc in &mut self.adcs {
                    adc.trigger(index, self.now);
                }
            }
        }
    }

    /// The comparators hold the phase currents against the DACs; they and the gate drivers' fault lines reach the break
    /// inputs.
    fn look_at_breaks(&mut self) {
        let high = self.comparator_outputs() & !self.faults.unwired_breaks;
        for index in 0..2 {
            let mut driver_trips = false;
            if let Some((stage, fault)) = self.provoked.power_fault[index] {
                let legs = self.pwm[index].legs(self.now);
                for (phase, leg) in legs.into_iter().enumerate() {
                    driver_trips |= stage.driver_trips(fault, phase, leg);
                }
            }
            let pin = self.fault_line(index) && !driver_trips;
            self.pwm[index].break_input(high, pin, self.now);
        }
    }

    /// The level of a motor's break pin. A pin that is not the timer's reads low.
    fn fault_line(&self, index: usize) -> bool {
        let (port, pin, function) = self.wiring.driver(index).fault;
        self.system.pin_function(port, pin) == (2, function) && self.level((port, pin))
    }

    /// A power stage has a fault from now on, or has none again.
    pub fn power_fault(&mut self, motor: Motor, fault: Option<(PowerStage, PowerFault)>) {
        self.provoked.power_fault[motor as usize] = fault;
        self.look_at_breaks();
        self.reschedule();
    }

    /// When a switch next changes that a power stage's fault makes matter.
    fn next_edge(&self, index: usize) -> Option<u64> {
        self.provoked.power_fault[index]?;
        self.pwm[index].next_edge(self.now)
    }

    /// The driver of a motor says that it has a fault, or has none again.
    pub fn driver_fault(&mut self, motor: Motor, fault: bool) {
        self.provoked.driver_fault[motor as usize] = fault;
        self.look_at_breaks();
        self.reschedule();
    }

    /// A write to a motor's timer: one that takes its outputs off opens the bridge now.
    fn write_pwm(&mut self, index: usize, offset: u32, value: u32, now: u64) -> Result<(), String> {
        let was = self.pwm[index].bridge().enabled;
        self.pwm[index].write(offset, value, now)?;
        if was && !self.pwm[index].bridge().enabled {
            self.machine.borrow_mut().stopped(Self::motor(index));
        }
        Ok(())
    }

    /// A fault of the chip breaks both timers; it lasts or is over at once.
    fn system_break(&mut self, lasts: bool) {
        for index in 0..2 {
            if self.pwm[index].system_break(lasts) {
                self.machine.borrow_mut().stopped(Self::motor(index));
            }
        }
    }

    /// The crystal stops. Unless the clock security system sees it, nothing but the watchdog goes on.
    pub fn stop_crystal(&mut self) {
        if self.system.stop_crystal() {
            self.system_break(false);
            self.nvic.raise_nmi();
        } else {
            self.frozen = true;
        }
        self.reschedule();
    }

    /// A word of `memory` is read that has wrong bits.
    pub fn read_wrong_bits(&mut self, memory: Checked) {
        if self.system.finds_wrong_bits(memory) {
            if self.system.wrong_bits_break(memory) {
                self.system_break(false);
            }
            self.nvic.raise_nmi();
            self.reschedule();
        }
    }

    /// Power that was cut while the flash worked comes back: the chip starts.
    fn look_at_power(&mut self) {
        if self.flash.lost_power() {
            self.reset.get_or_insert(Reset::BrownOut);
        }
    }

    /// The supply is at `volts` from now on.
    pub fn set_supply(&mut self, volts: f64) {
        self.system.supply_v = volts;
        match self.system.supply(volts) {
            Supply::Enough => self.pwm.iter_mut().for_each(PwmTimer::end_system_break),
            Supply::Break => self.system_break(true),
            Supply::Reset => {
                self.reset.get_or_insert(Reset::BrownOut);
            }
        }
    }

    /// An encoder's timer is triggered: a frame that it had begun is over.
    fn trigger_encoder(&mut self, index: usize, code: u32) {
        if self.encoders[index].trigger(code, self.now) {
            self.spi.select(None);
        }
    }

    /// A compare event of a timer that frames a sensor's readings.
    fn frame_event(&mut self, index: usize) {
        match self.encoders[index].frame_event() {
            Some(Frame::Select) => {
                let frame = self
                    .machine
                    .borrow_mut()
                    .frame(Self::motor(index), self.now);
                let frame = self.provoked.stuck_encoder[index].unwrap_or(frame);
                self.spi
                    .select(Some(frame ^ self.provoked.frame_errors[index]));
            }
            Some(Frame::Request(channel)) => {
                // Both send through SPI1.
                let request = TIMER_REQUESTS[index] + channel - 1;
                let result =
                    self.dma
                        .request(request, SPI1_DATA)
                        .and_then(|transfer| match transfer {
                            Some(Transfer::FromMemory(address)) => {
                                self.spi.send(self.half_word_of_flash(address)?, self.now)
                            }
                            Some(Transfer::ToMemory(_)) => {
                                Err("a timer's request fetches from SPI1".into())
                            }
                            None => Ok(()),
                        });
                if let Err(error) = result {
                    self.fail(error);
                }
            }
            None => {}
        }
    }

    /// SPI1 has exchanged a word.
    fn exchanged(&mut self) {
        let result = self.spi.finish(self.now).and_then(|asks| {
            if !asks {
                return Ok(());
            }
            if let Some(Transfer::ToMemory(address)) = self.dma.request(SPI1_RECEIVED, SPI1_DATA)? {
                self.memory_writes.push((address, self.spi.receive(), 2));
            }
            Ok(())
        });
        if let Err(error) = result {
            self.fail(error);
        }
    }

    /// LPUART1 has received a byte.
    fn byte_came(&mut self) {
        let result = self.serial.come(self.now).and_then(|byte| {
            match self.dma.request_byte(serial::RECEIVED, serial::RDR)? {
                Some(address) => self.memory_writes.push((address, byte.into(), 1)),
                None => self.serial.lost += 1,
            }
            Ok(())
        });
        if let Err(error) = result {
            self.fail(error);
        }
    }

    /// A host sends bytes to LPUART1.
    pub fn host_sends(&mut self, bytes: &[u8]) {
        self.serial.host_sends(bytes, self.now);
        self.reschedule();
    }

    /// What LPUART1 has sent since the last call.
    pub fn host_takes(&mut self) -> Vec<u8> {
        self.serial.host_takes(self.now)
    }

    /// The piece of memory that LPUART1 is to send from now on: where and how many bytes. It is to be [given](Chip::give_piece).
    pub fn take_piece(&mut self) -> Option<(u32, usize)> {
        self.dma
            .take_piece(serial::SENDS, serial::TDR)
            .unwrap_or_else(|error| {
                self.fail(error);
                None
            })
    }

    /// Its bytes.
    pub fn give_piece(&mut self, piece: Vec<u8>) {
        if let Err(error) = self.serial.give(piece, self.now) {
            self.fail(error);
        }
    }

    /// A half word that the DMA reads: of flash only, which does not change.
    fn half_word_of_flash(&self, address: u32) -> Result<u16, String> {
        self.flash
            .half_word(address)
            .ok_or_else(|| format!("the DMA reads {address:#010x}, which is not in flash"))
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
        self.look_at_breaks();
        self.reschedule();
    }

    /// The over-current is gone: the comparators see what was sampled last.
    pub fn end_short_circuit(&mut self, motor: Motor) {
        let index = motor as usize;
        if self.provoked.over_current[index].take().is_some() {
            self.sensors[index].current = self.sampled[index];
            self.look_at_breaks();
            self.reschedule();
        }
    }

    /// An ADC finished a sequence.
    fn converted(&mut self, index: usize) {
        let by_software = self.adcs[index].by_software();
        let sources: Vec<_> = self.adcs[index]
            .channels()
            .into_iter()
            .map(|channel| (channel, self.source(index, channel)))
            .collect();
        let source = |channel| {
            sources
                .iter()
                .find(|(other, _)| *other == channel)
                .and_then(|(_, source)| *source)
        };
        match self.adcs[index].finish(source) {
            Ok(Conversion::Regular(_)) if by_software => {}
            Ok(Conversion::Injected) => {}
            Ok(Conversion::Regular(counts)) => {
                let from = 0x5000_0040 + 0x100 * u32::try_from(index).unwrap_or(0);
                match self.dma.request(ADC_REQUESTS[index], from) {
                    Ok(Some(Transfer::ToMemory(address))) => {
                        self.memory_writes.push((address, counts, 2));
                    }
                    Ok(Some(Transfer::FromMemory(_))) => {
                        self.fail("the DMA writes to an ADC's data".into());
                    }
                    Ok(None) => {}
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

    /// The debugger reads a word, while the core is as `core` says. The core does not wait for it.
    ///
    /// # Errors
    /// The model does not have the register.
    pub fn debugger_reads(&mut self, address: u32, core: debug::Core) -> Result<u32, String> {
        let waits = self.bus_wait;
        let word = if Debug::has(address) {
            self.debug.read(address, Master::Debugger, core)
        } else {
            self.read_word(address)
        };
        self.bus_wait = waits;
        word
    }

    /// The debugger writes a word.
    ///
    /// # Errors
    /// The model does not have the register, or not what is written.
    pub fn debugger_writes(&mut self, address: u32, value: u32) -> Result<(), String> {
        let waits = self.bus_wait;
        let written = if Debug::has(address) {
            self.debug.write(address, value, Master::Debugger)
        } else {
            self.write_word(address, value)
        };
        self.bus_wait = waits;
        self.reschedule();
        written
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
        // The watchdog's and the SPI's registers hold 16 bits, and half a word is a whole write of them.
        let of_16_bits = [0x4000_3000, 0x4001_3000].contains(&(address & !0x3FF));
        let halves = of_16_bits && size == 2 && shift == 0;
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
        self.needs_clock(address)?;
        let now = self.now;
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        self.bus_wait += bus_wait(address);
        match block {
            0x4001_2C00 => self.pwm[0].read(offset, now),
            0x4001_3400 => self.pwm[1].read(offset, now),
            0x4000_0000 => self.encoders[0].read(offset),
            0x4000_0C00 => self.encoders[1].read(offset),
            0x4000_0800 => self.encoders[2].read(offset),
            0x5000_0000 | 0x5000_0400 => {
                // The first injected result of ADC1 and of ADC4. The supervision reads them too.
                let runs =
                    |line: usize| self.nvic.active().last() == Some(&(nvic::EXTERNAL + line));
                let slow = match address {
                    0x5000_0080 if runs(nvic::ADC1_2) => self.provoked.slow_read[0].take(),
                    0x5000_0580 if runs(nvic::ADC4) => self.provoked.slow_read[1].take(),
                    _ => None,
                };
                self.bus_wait += slow.unwrap_or(0);
                adc::read(&mut self.adcs, address)
            }
            0x5000_1000 => self.dacs[0].read(offset),
            0x5000_1400 => self.dacs[1].read(offset),
            0x4001_0000 if offset >= 0x200 => {
                // VALUE (RM0440 24.6.1).
                let number = (offset - 0x200) / 4 + 1;
                let value = (self.comparator_outputs() >> number & 1) << 30;
                Ok(self.comparators.read(offset - 0x200)? | value)
            }
            0x4001_4400 => {
                let clocks = self.clocks();
                self.capture.read(offset, now, clocks)
            }
            0x4002_2000 if self.flash.read(offset, now).is_some() => {
                Ok(self.flash.read(offset, now).unwrap_or_default())
            }
            0x4800_0000..=0x4800_1400 if offset == 0x10 => {
                Ok(self.levels(((block - 0x4800_0000) / 0x400) as usize))
            }
            flash::START..flash::END => {
                let (word, waits, torn) = self.flash.load(address, now);
                self.bus_wait += waits;
                if torn {
                    self.read_wrong_bits(Checked::Flash);
                }
                Ok(word)
            }
            0x4001_3000 => self.spi.read(offset),
            0x4000_8000 => self.serial.read(offset),
            0x4002_0000 | 0x4002_0800 => {
                let left = self.serial.pass(now);
                self.dma.set_left(serial::SENDS, left);
                self.dma.read(address)
            }
            0x4000_1400 => self.deadman.read(offset),
            0x4000_3000 => self.watchdog.read(offset),
            0xE000_0000.. if Debug::has(address) => {
                self.debug
                    .read(address, Master::Core, debug::Core::default())
            }
            0xE000_0000..0xE004_0000 => self.nvic.read(address, now),
            _ => self.system.read(address),
        }
    }

    /// An access to a peripheral whose clock is off is not supported (RM0440 7.2.17): it is lost.
    fn needs_clock(&self, address: u32) -> Result<(), String> {
        match self.system.without_clock(address) {
            Some(name) => Err(format!("the clock of {name} is off, so it is lost")),
            None => Ok(()),
        }
    }

    fn write_word(&mut self, address: u32, value: u32) -> Result<(), String> {
        self.needs_clock(address)?;
        let now = self.now;
        let (block, offset) = (address & !0x3FF, address & 0x3FF);
        self.bus_wait += bus_wait(address);
        match block {
            flash::BEGIN..flash::END => {
                self.flash.worn = self.faults.worn;
                self.flash.core_hz = self.system.core_hz();
                self.flash.program(address, value, now)?;
                self.look_at_power();
                Ok(())
            }
            0x4002_2000 => {
                self.flash.worn = self.faults.worn;
                self.flash.core_hz = self.system.core_hz();
                match self.flash.write(offset, value, now)? {
                    true => self.look_at_power(),
                    false => self.system.write(address, value)?,
                }
                Ok(())
            }
            0x4001_4400 => self.capture.write(offset, value, now),
            0x4001_2C00 => {
                let ran = self.pwm[0].running();
                self.write_pwm(0, offset, value, now)?;
                // TIM8 starts with TIM1: trigger mode on ITR0.
                if self.pwm[0].trigger_output() == pwm::Output::Enable && self.pwm[0].running() {
                    self.pwm[1].start_by_trigger(0, now);
                    if !ran {
                        self.trigger_encoder(0, encoder::trigger_code(0));
                    }
                }
                self.breaks_written(offset);
                Ok(())
            }
            0x4001_3400 => {
                self.write_pwm(1, offset, value, now)?;
                self.breaks_written(offset);
                Ok(())
            }
            0x4000_0000 => self.encoders[0].write(offset, value),
            0x4000_0C00 => self.encoders[1].write(offset, value),
            0x4000_0800 => self.encoders[2].write(offset, value),
            0x5000_0000 | 0x5000_0400 => {
                self.system.kernel_clocks_adcs(block == 0x5000_0000)?;
                adc::write(&mut self.adcs, address, value, now)?;
                self.adcs
                    .iter_mut()
                    .for_each(|adc| adc.start_by_software(now));
                let level = self.adcs[0].interrupt() || self.adcs[1].interrupt();
                self.nvic.set_level(nvic::ADC1_2, level);
                self.nvic.set_level(nvic::ADC3, self.adcs[2].interrupt());
                self.nvic.set_level(nvic::ADC4, self.adcs[3].interrupt());
                Ok(())
            }
            0x5000_1000 | 0x5000_1400 => {
                self.dacs[usize::from(block == 0x5000_1400)].write(offset, value)?;
                self.look_at_breaks();
                Ok(())
            }
            // A driver's enable may be among them.
            0x4800_0000..=0x4800_1400 => {
                self.system.write(address, value)?;
                self.drive_enables();
                self.charge_pins();
                self.look_at_breaks();
                self.watch_gates();
                Ok(())
            }
            0x4001_0000 if offset >= 0x200 => self.comparators.write(offset - 0x200, value),
            0x4001_3000 => self.spi.write(offset, value),
            0x4000_8000 => self.serial.write(offset, value),
            0x4002_0000 | 0x4002_0800 => self.dma.write(address, value),
            0x4000_1400 => {
                self.deadman.write(offset, value, now)?;
                self.nvic.set_level(nvic::TIM7, self.deadman.interrupt());
                Ok(())
            }
            0x4000_3000 => self.watchdog.write(offset, value, now),
            0xE000_0000.. if Debug::has(address) => self.debug.write(address, value, Master::Core),
            0xE000_0000..0xE004_0000 => {
                if self.nvic.write(address, value, now)? {
                    self.reset.get_or_insert(Reset::Software);
                }
                Ok(())
            }
            _ => self.system.write(address, value),
        }
    }
}

/// SPI1's data register.
const SPI1_DATA: u32 = 0x4001_300C;

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
