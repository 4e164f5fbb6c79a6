//! ADC1 to ADC4: power-up, calibration, injected sequences on a trigger, regular conversions for DMA (RM0440 21).

use super::registers::Registers;
use hal_sim::board::REFERENCE_V;

const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const CFGR: u32 = 0x0C;
const SMPR1: u32 = 0x14;
const SMPR2: u32 = 0x18;
const TR1: u32 = 0x20;
const TR2: u32 = 0x24;
const SQR1: u32 = 0x30;
const JSQR: u32 = 0x4C;
const DR: u32 = 0x40;
const JDR1: u32 = 0x80;
const JDR4: u32 = 0x8C;
const AWD2CR: u32 = 0xA0;
/// Offset of the common registers from the first ADC of a pair.
const COMMON_CCR: u32 = 0x308;

const ADRDY: u32 = 1;
const EOC: u32 = 1 << 2;
const EOS: u32 = 1 << 3;
const JEOC: u32 = 1 << 5;
const JEOS: u32 = 1 << 6;

const AWD1: u32 = 1 << 7;
const AWD2: u32 = 1 << 8;

const ADEN: u32 = 1;
const ADSTART: u32 = 1 << 2;
const JADSTART: u32 = 1 << 3;
const ADVREGEN: u32 = 1 << 28;
const DEEPPWD: u32 = 1 << 29;
const ADCAL: u32 = 1 << 31;

/// Core cycles of an ADC clock, 42.5 MHz: the bus clock divided by 4, or the PLL's P output. The model has no other.
const CLOCK: u64 = 4;
/// CKMODE: the kernel clock of RCC_CCIPR, and the bus clock divided by 4.
const KERNEL: u32 = 0;
const BUS_BY_4: u32 = 3;
/// What conversions of another ADC add to one under way where their clocks are divided and not in step, counts (ES0430 2.7.9 or 2.7.11
/// by revision; the size is what a public board with this chip reports): even between these of either sign.
pub const DISTURBANCE: f64 = 8.0;
/// Half ADC clocks of the approximation, and of the sampling by the code of SMPRx (RM0440 21.4.12).
const APPROXIMATION_HALVES: u64 = 25;
const SAMPLING_HALVES: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];

/// ADC4's channel of the internal reference, which ADC1, ADC3 and ADC5 have too (RM0440 21.4.11).
pub const REFERENCE: (usize, u32) = (3, 18);

/// The internal reference at a supply of `supply_v`. It settles to half a count in the 4 us that the datasheet asks
/// for (embedded voltage reference; memory; `link::bringup::time_constant_s`).
#[must_use]
pub fn reference(supply_v: f64) -> Source {
    Source {
        counts: 4096.0 * REFERENCE_V / supply_v,
        ohm: 12.2e3,
        noise: 0.0,
        disturbance: 0.0,
    }
}

/// What an ADC finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conversion {
    /// Its injected sequence; the results are in its data registers.
    Injected,
    /// A regular conversion, for DMA.
    Regular(u16),
}

/// What a channel is connected to.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Counts at rest.
    pub counts: f64,
    /// Its resistance, ohm.
    pub ohm: f64,
    /// Standard deviation of its noise, counts.
    pub noise: f64,
    /// What the other ADCs put into it, counts of either sign at most.
    pub disturbance: f64,
}

/// An ADC.
pub struct Adc {
    number: usize,
    registers: Registers,
    flags: u32,
    control: u32,
    calibrated: bool,
    /// CKMODE of its pair.
    common_clock: u32,
    /// PRESC of its pair.
    prescaler: u32,
    /// The last injected and the last regular sequence: when it began, when it ends.
    sequences: [[u64; 2]; 2],
    /// VREFEN of its pair.
    reference: bool,
    results: [u16; 4],
    injected_done: Option<u64>,
    regular_done: Option<u64>,
    /// The regular sequence under way was started by software.
    software: bool,
    regular: u16,
    /// What the sampling capacitor holds, counts.
    held: f64,
    random: u64,
    /// When it last converted or calibrated, and the next conversion comes too long after that.
    last: u64,
    stale: bool,
}

impl Adc {
    /// ADC `number` after reset.
    #[must_use]
    pub fn new(number: usize) -> Self {
        let name = ["ADC", "ADC1", "ADC2", "ADC3", "ADC4"][number];
        let registers = Registers::new(
            name,
            &[
                ("IER", IER, 0),
                ("CFGR", CFGR, 1 << 31),
                ("SMPR1", SMPR1, 0),
                ("SMPR2", SMPR2, 0),
                ("TR1", TR1, 0x0FFF_0000),
                ("TR2", TR2, 0x00FF_0000),
                ("SQR1", SQR1, 0),
                ("JSQR", JSQR, 0),
                ("AWD2CR", AWD2CR, 0),
            ],
        );
        Self {
            number,
            registers,
            flags: 0,
            control: DEEPPWD,
            calibrated: false,
            common_clock: 0,
            prescaler: 0,
            sequences: [[0; 2]; 2],
            reference: false,
            results: [0; 4],
            injected_done: None,
            regular_done: None,
            software: false,
            regular: 0,
            held: 0.0,
            random: number as u64,
            last: 0,
            stale: false,
        }
    }

    /// Its injected conversions wait for their trigger.
    #[must_use]
    pub fn armed(&self) -> bool {
        self.control & JADSTART != 0
    }

    /// The internal reference is on its channel.
    #[must_use]
    pub fn has_reference(&self) -> bool {
        self.reference
    }

    /// The interrupt line.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.flags & self.registers.get("IER") != 0
    }

    /// When the conversion under way is done.
    #[must_use]
    pub fn done_at(&self) -> Option<u64> {
        [self.injected_done, self.regular_done]
            .into_iter()
            .flatten()
            .min()
    }

    /// TRGO2 of TIM1 (0) or TIM8 (1) rises.
    pub fn trigger(&mut self, timer: usize, now: u64) {
        const RISING: u32 = 1;
        let jsqr = self.registers.get("JSQR");
        // JEXTSEL (tables 167 and 168): TIM1_TRGO2, TIM8_TRGO2.
        if self.armed() && jsqr >> 7 & 3 == RISING && jsqr >> 2 & 31 == [8, 10][timer] {
            let halves: u64 = self
                .injected_channels()
                .into_iter()
                .map(|channel| self.conversion_halves(channel))
                .sum();
            let done = now + halves * CLOCK / 2;
            self.injected_done = Some(done);
            self.sequences[0] = [now, done];
            self.starts(now);
        }
        let cfgr = self.registers.get("CFGR");
        // EXTSEL (table 166): TIM1_TRGO2, TIM8_TRGO2.
        if self.control & ADSTART != 0
            && cfgr >> 10 & 3 == RISING
            && cfgr >> 5 & 31 == [10, 8][timer]
        {
            let channel = self.registers.get("SQR1") >> 6 & 31;
            let done = now + self.conversion_halves(channel) * CLOCK / 2;
            self.regular_done = Some(done);
            self.sequences[1] = [now, done];
            self.starts(now);
        }
    }

    /// The channels that it converts: injected, and regular if it converts those too.
    #[must_use]
    pub fn channels(&self) -> Vec<u32> {
        let mut channels = self.injected_channels();
        if self.control & ADSTART != 0 {
            channels.extend(self.regular_channels());
        }
        channels
    }

    /// Starts the regular sequence if software has asked for it (EXTEN 0).
    pub fn start_by_software(&mut self, now: u64) {
        let by_software = self.registers.get("CFGR") >> 10 & 3 == 0;
        if self.control & ADSTART != 0 && by_software && self.regular_done.is_none() {
            let halves: u64 = self
                .regular_channels()
                .into_iter()
                .map(|channel| self.conversion_halves(channel))
                .sum();
            self.software = true;
            let done = now + halves * CLOCK / 2;
            self.regular_done = Some(done);
            self.sequences[1] = [now, done];
            self.starts(now);
        }
    }

    /// Its clock is divided, so that the phase of two ADCs' clocks is any (the erratum's workaround is PRESC and CKMODE /1).
    #[must_use]
    pub fn clock_is_divided(&self) -> bool {
        self.prescaler != 0 || self.common_clock > 1
    }

    /// The sequence that ends at `now`, the injected one first: when it began.
    #[must_use]
    pub fn began(&self, now: u64) -> u64 {
        let mut sequences = self.sequences.iter();
        let ends = sequences.find(|[_, end]| *end == now);
        ends.map_or(now, |[begin, _]| *begin)
    }

    /// It converts at a time between `from` and `to`.
    #[must_use]
    pub fn converts_between(&self, from: u64, to: u64) -> bool {
        let mut sequences = self.sequences.iter();
        sequences.any(|[begin, end]| *begin < to && from < *end)
    }

    /// The regular sequence under way was started by software.
    #[must_use]
    pub fn by_software(&self) -> bool {
        self.software
    }

    /// The sampling capacitor comes from what it last held. What comes more than a millisecond after the last conversion or
    /// the calibration may be wrong (ES0430 2.7.7): it is as wrong as can be.
    fn sampled(&mut self, channel: u32, source: Source) -> u16 {
        if std::mem::take(&mut self.stale) {
            return 4095;
        }
        let clocks = SAMPLING_HALVES[self.sampling(channel)] as f64 / 2.0;
        let seconds = clocks * CLOCK as f64 / super::CORE_HZ as f64;
        let tau = link::bringup::time_constant_s(channel, source.ohm);
        self.held = source.counts + (self.held - source.counts) * (-seconds / tau).exp();
        let noise = match source.noise {
            0.0 => 0.0,
            noise => noise * self.deviate(),
        };
        let disturbed = source.disturbance * 3.0_f64.sqrt().recip() * self.deviate();
        let noisy = self.held + noise + disturbed.clamp(-source.disturbance, source.disturbance);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let counts = noisy.round().clamp(0.0, 4095.0) as u16;
        counts
    }

    /// A sequence starts.
    fn starts(&mut self, now: u64) {
        self.stale |= now - self.last > super::CORE_HZ / 1000;
        self.last = now;
    }

    /// Nearly normal: twelve uniform numbers less their mean.
    fn deviate(&mut self) -> f64 {
        let uniform = |state: &mut u64| {
            *state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (*state >> 33) as f64 / f64::from(1u32 << 31)
        };
        (0..12).map(|_| uniform(&mut self.random)).sum::<f64>() - 6.0
    }

    fn regular_channels(&self) -> Vec<u32> {
        let sqr1 = self.registers.get("SQR1");
        let ranks = [sqr1 >> 6, sqr1 >> 12, sqr1 >> 18, sqr1 >> 24].map(|field| field & 31);
        ranks.into_iter().take((sqr1 & 3) as usize + 1).collect()
    }

    fn injected_channels(&self) -> Vec<u32> {
        let jsqr = self.registers.get("JSQR");
        let ranks = [jsqr >> 9, jsqr >> 15, jsqr >> 21, jsqr >> 27].map(|field| field & 31);
        ranks.into_iter().take((jsqr & 3) as usize + 1).collect()
    }

    fn conversion_halves(&self, channel: u32) -> u64 {
        APPROXIMATION_HALVES + SAMPLING_HALVES[self.sampling(channel)]
    }

    /// Code of a channel's sampling time.
    fn sampling(&self, channel: u32) -> usize {
        let smpr = if channel < 10 {
            self.registers.get("SMPR1") >> (3 * channel)
        } else {
            self.registers.get("SMPR2") >> (3 * (channel - 10))
        };
        (smpr & 7) as usize
    }

    /// The conversion under way is done; `source` says what a channel is connected to.
    ///
    /// # Errors
    /// A channel that nothing is wired to.
    pub fn finish(&mut self, source: impl Fn(u32) -> Option<Source>) -> Result<Conversion, String> {
        let number = self.number;
        let source = |channel: u32| {
            source(channel)
                .ok_or_else(|| format!("nothing is wired to channel {channel} of ADC{number}"))
        };
        if self.injected_done.is_some()
            && self.injected_done <= self.regular_done.or(Some(u64::MAX))
        {
            let (mut results, mut watched) = (self.results, 0);
            for (result, channel) in results.iter_mut().zip(self.injected_channels()) {
                *result = self.sampled(channel, source(channel)?);
                watched |= self.watch(channel, *result, true);
            }
            self.flags |= watched;
            self.results = results;
            self.injected_done = None;
            self.flags |= JEOC | JEOS;
            return Ok(Conversion::Injected);
        }
        if self.software {
            for channel in self.regular_channels() {
                self.regular = self.sampled(channel, source(channel)?);
                self.flags |= self.watch(channel, self.regular, false);
            }
            self.software = false;
            self.control &= !ADSTART;
            self.flags |= EOS;
        } else {
            let channel = self.registers.get("SQR1") >> 6 & 31;
            self.regular = self.sampled(channel, source(channel)?);
            self.flags |= self.watch(channel, self.regular, false);
        }
        self.regular_done = None;
        self.flags |= EOC;
        Ok(Conversion::Regular(self.regular))
    }

    /// The analog watchdogs' flags for a conversion (RM0440 21.4.28).
    fn watch(&self, channel: u32, counts: u16, injected: bool) -> u32 {
        let (cfgr, counts) = (self.registers.get("CFGR"), u32::from(counts));
        let enabled = cfgr >> (if injected { 24 } else { 23 }) & 1 == 1;
        let selected = cfgr >> 22 & 1 == 0 || cfgr >> 26 & 31 == channel;
        let (first, second) = (self.registers.get("TR1"), self.registers.get("TR2"));
        let mut flags = 0;
        if enabled && selected && !(first & 0xFFF..=first >> 16 & 0xFFF).contains(&counts) {
            flags |= AWD1;
        }
        let watched = self.registers.get("AWD2CR") >> channel & 1 == 1;
        if watched && !(second & 0xFF..=second >> 16 & 0xFF).contains(&(counts >> 4)) {
            flags |= AWD2;
        }
        flags
    }

    /// Its plain registers.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    fn read(&self, offset: u32) -> Result<u32, String> {
        Ok(match offset {
            ISR => self.flags,
            CR => self.control,
            DR => u32::from(self.regular),
            JDR1..=JDR4 => u32::from(self.results[((offset - JDR1) / 4) as usize]),
            _ => self.registers.read(offset)?,
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), String> {
        match offset {
            ISR => self.flags &= !value,
            CR => self.write_control(value, now)?,
            JSQR | CFGR | SMPR1 | SMPR2 | SQR1 | AWD2CR
                if self.control & (ADSTART | JADSTART) != 0 =>
            {
                return Err(format!("ADC{} is set up while it converts", self.number));
            }
            _ => {
                self.registers.write(offset, value)?;
            }
        }
        Ok(())
    }

    fn write_control(&mut self, value: u32, now: u64) -> Result<(), String> {
        let powered = value & ADVREGEN != 0 && value & DEEPPWD == 0;
        let risen = value & !self.control;
        if risen & (ADCAL | ADEN) != 0 && !(powered && self.control & ADVREGEN != 0) {
            return Err(format!(
                "ADC{} calibrates or starts without its regulator",
                self.number
            ));
        }
        if risen & ADCAL != 0 {
            self.calibrated = true;
            self.last = now;
        }
        if risen & ADEN != 0 {
            if !self.calibrated {
                return Err(format!("ADC{} is enabled without calibration", self.number));
            }
            if self.prescaler != 0 || ![KERNEL, BUS_BY_4].contains(&self.common_clock) {
                return Err(format!("ADC{} is not clocked by 42.5 MHz", self.number));
            }
            self.flags |= ADRDY;
        }
        // These are set by writing one and cleared by the hardware.
        let set_only = ADEN | ADSTART | JADSTART;
        let set = (self.control | value) & set_only;
        if risen & (ADSTART | JADSTART) != 0 && set & ADEN == 0 {
            return Err(format!("ADC{} starts before it is enabled", self.number));
        }
        // Calibration is over at once: its end is all that the firmware waits for.
        self.control = value & (ADVREGEN | DEEPPWD) | set;
        Ok(())
    }
}

/// Splits an address of the ADCs into the ADC, or the pair's common registers, and the offset.
fn split(address: u32) -> (usize, u32) {
    let pair = if address & 0x400 == 0 { 0 } else { 2 };
    let offset = address & 0x3FF;
    match offset {
        0x000..=0x0FF => (pair, offset),
        0x100..=0x1FF => (pair + 1, offset - 0x100),
        _ => (pair, offset),
    }
}

/// Reads a register of the four ADCs.
///
/// # Errors
/// The model does not have it.
pub fn read(adcs: &mut [Adc; 4], address: u32) -> Result<u32, String> {
    let (index, offset) = split(address);
    match offset {
        COMMON_CCR => {
            let adc = &adcs[index];
            Ok(adc.common_clock << 16 | adc.prescaler << 18 | u32::from(adc.reference) << 22)
        }
        _ => adcs[index].read(offset),
    }
}

/// Writes a register of the four ADCs.
///
/// # Errors
/// The model does not have it, or the ADC is not used as the manual says.
pub fn write(adcs: &mut [Adc; 4], address: u32, value: u32, now: u64) -> Result<(), String> {
    let (index, offset) = split(address);
    if offset == COMMON_CCR {
        for adc in &mut adcs[index..index + 2] {
            adc.common_clock = value >> 16 & 3;
            adc.prescaler = value >> 18 & 0xF;
            adc.reference = value >> 22 & 1 == 1;
        }
        return Ok(());
    }
    adcs[index].write(offset, value, now)
}
