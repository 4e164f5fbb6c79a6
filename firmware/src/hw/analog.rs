//! The ADCs.
//!
//! ADC1 and ADC2 serve the screw, ADC3 and ADC4 the nut: two injected conversions each, started together by the
//! motor's timer at its top. All four have one clock of 42.5 MHz, the PLL's, without a divider: ADCs that convert at the same time by
//! divided clocks disturb each other, by 8 counts on one public board (ES0430 2.7.9 or 2.7.11 by revision, quoted by others). The two heat sinks' temperatures are regular conversions of ADC1 and ADC2, started by the nut's timer
//! half a period away from their injected ones, and taken by DMA. The chip's internal reference is the regular conversion of ADC4, started by the
//! screw's timer, and read from its data register.
//!
//! The analog watchdogs hold each conversion of the bus voltage and of the currents, of either sign, against limits. Their
//! flags stay set until the speed task takes them: nothing slips through between two of its steps, and it costs the
//! current loops nothing. They are the second guard, within 200 us of a conversion; the first, without code, are the
//! comparators on the break inputs, which see positive currents only. (An analog watchdog of this chip reaches a timer's
//! external trigger but no break input, and ADC1's and ADC2's interrupt is the current loop's.)

use crate::crash::refuse;
use crate::hw::clock::{ADC_HZ, CORE_HZ};
use control::controller_supply::SupplyReading;
use control::fault::Fault;
use control::power_stage::{NOTHING, StageLook};
use control::sense::Shunts;
use core::sync::atomic::{AtomicU16, Ordering};
use link::bringup::SAMPLING_HALVES;
use stm32g4xx_hal::signature::VrefCal;
use stm32g4xx_hal::stm32::{
    ADC1, ADC2, ADC3, ADC4, ADC12_COMMON, ADC345_COMMON, DMA1, DMAMUX, adc1,
};

/// How long a channel samples: the code of its field of `ADC_SMPRx`.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Sampling {
    Cycles2 = 0,
    Cycles6 = 1,
    Cycles12 = 2,
    Cycles24 = 3,
    Cycles47 = 4,
    Cycles92 = 5,
    Cycles247 = 6,
    Cycles640 = 7,
}

impl Sampling {
    const ALL: [Self; 8] = [
        Self::Cycles2,
        Self::Cycles6,
        Self::Cycles12,
        Self::Cycles24,
        Self::Cycles47,
        Self::Cycles92,
        Self::Cycles247,
        Self::Cycles640,
    ];
    /// The sampling capacitor, F (DS12288, ADC characteristics: C_ADC).
    const CAPACITOR_F: f64 = 5e-12;

    /// The shortest that is at least so long, s: an amplifier's settling, for one.
    pub(crate) const fn of_at_least(seconds: f64) -> Self {
        let mut index = 0;
        while index < 8 {
            if SAMPLING_HALVES[index] as f64 / 2.0 / ADC_HZ as f64 >= seconds {
                return Self::ALL[index];
            }
            index += 1;
        }
        panic!("no sampling time is so long: put a capacitor to the pin")
    }

    /// What a pin with a capacitor of `farads` to ground needs, whatever stands before it: the capacitor gives its charge,
    /// and is so large that half a count is not missed. It is 6.5 clocks, the smallest that the datasheet allows for a slow
    /// channel (6 and above; DS12288, maximum R_AIN, see `link::bringup::time_constant_s`). Fails to compile, in a constant,
    /// below 41 nF.
    pub(crate) const fn behind(farads: f64) -> Self {
        assert!(
            farads >= Self::CAPACITOR_F * 8192.0,
            "below 41 nF the sampling takes more than half a count of the capacitor's charge"
        );
        Self::Cycles6
    }
}

/// A channel of an ADC.
#[derive(Clone, Copy)]
pub(crate) struct Input {
    /// Its number.
    pub(crate) channel: u8,
    /// How long it samples.
    pub(crate) sampling: Sampling,
}

/// Channels of one ADC: the injected sequence of two, and the regular channel if it has one.
#[derive(Clone, Copy)]
pub(crate) struct Channels {
    pub(crate) injected: [Input; 2],
    pub(crate) regular: Option<Input>,
}

/// The chip's internal reference (RM0440 21.4.11: of ADC1, ADC3, ADC4 and ADC5; `stm32g4xx-hal`, `adc/g4.rs`). It wants at least 4 us
/// (DS12288 Rev 6, embedded voltage reference), and is done a third of the period of 40 kHz before the next top.
pub(crate) const REFERENCE: Input = Input {
    channel: 18,
    sampling: Sampling::of_at_least(4e-6),
};

/// Whose top starts an ADC's injected conversions; the other motor's starts its regular one. Either by the same code: TIM1's TRGO2
/// is 8 in `JEXTSEL` and 10 in `EXTSEL`, TIM8's 10 and 8 (RM0440 tables 163 and 166; `stm32g4xx-hal`, `adc/config.rs`, alike for all).
#[derive(Clone, Copy)]
enum Top {
    Screw = 8,
    Nut = 10,
}

/// What the analog watchdogs compare with, ADC counts.
#[derive(Clone, Copy)]
pub(crate) struct WatchLimits {
    /// Minimum and maximum of a current channel, in counts whatever the sensor's sign; the watchdogs see steps of 16.
    pub(crate) current: [u16; 2],
    /// Most of the bus voltage.
    pub(crate) bus: u16,
    /// Which phases are measured.
    pub(crate) shunts: Shunts,
}

/// Minimum and maximum counts of a current channel from the counts at its two limits, whichever the sensor's sign makes the
/// lower. Fails to compile, in a constant, if the ADC cannot see one of them.
pub(crate) const fn watch_limits(one: f64, other: f64) -> [u16; 2] {
    let (least, most) = if one < other {
        (one, other)
    } else {
        (other, one)
    };
    assert!(
        least >= 16.0 && most < 4080.0,
        "a limit of the current watchdogs is beyond the ADC"
    );
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    [least as u16, most as u16]
}

/// Temperatures of the heat sinks as ADC counts. A static, for the DMA has its address.
static TEMPERATURES: [AtomicU16; 2] = [AtomicU16::new(0), AtomicU16::new(0)];

/// All ADCs in use.
pub(crate) struct Converters<'a> {
    pub(crate) screw: (&'a ADC1, &'a ADC2),
    pub(crate) nut: (&'a ADC4, &'a ADC3),
    pub(crate) common: (&'a ADC12_COMMON, &'a ADC345_COMMON),
    pub(crate) dma: (&'a DMA1, &'a DMAMUX),
}

impl Converters<'_> {
    /// Sets up and calibrates all four, with the channels of ADC1 to ADC4. Interrupts at the end of the injected
    /// sequence of ADC1 and of ADC4. The drive does not start if an ADC does not answer.
    pub(crate) fn prepare(&self, channels: [Channels; 4], limits: &WatchLimits) {
        // All from their kernel clock (CKMODE 0), undivided (PRESC 0): 42.5 MHz, within the 52 MHz of RM0440 for several ADCs. A trigger
        // starts them within an ADC clock of each other.
        // SAFETY: values of the fields (RM0440, ADCx_CCR).
        self.common.0.ccr().write(|w| unsafe { w.bits(0) });
        // The internal reference takes up to 12 us to start (DS12288 Rev 6, t_start_vrefint): the calibrations take longer.
        // SAFETY: as above.
        self.common
            .1
            .ccr()
            .write(|w| unsafe { w.bits(0).vrefen().set_bit() });
        self.start_dma();
        let (x1, y1) = self.screw;
        let (x2, y2) = self.nut;
        let [c1, c2, c3, c4] = channels;
        if !(enable(x1) & enable(y1) & enable(x2) & enable(y2)) {
            refuse("an ADC did not calibrate: check the analog supply");
        }
        sequence(x1, c1, Top::Screw);
        sequence(y1, c2, Top::Screw);
        sequence(y2, c3, Top::Nut);
        sequence(x2, c4, Top::Nut);
        let [(bus1, a1), (bus2, a2)] =
            [c1, c4].map(|c| (c.injected[1].channel, c.injected[0].channel));
        watch(x1, &[a1], Some(bus1), limits);
        watch(x2, &[a2], Some(bus2), limits);
        // Without a sensor in phase c its channel means nothing.
        let measured = match limits.shunts {
            Shunts::Two => 1,
            Shunts::Three => 2,
        };
        for (adc, channels) in [(y1 as &adc1::RegisterBlock, c2), (y2, c3)] {
            let currents = channels.injected.map(|input| input.channel);
            watch(adc, &currents[..measured], None, limits);
        }
        x1.ier().write(|w| w.jeosie().set_bit());
        x2.ier().write(|w| w.jeosie().set_bit());
    }

    /// Each ADC converts once, for nothing, less than a millisecond before [`Converters::arm`]: what comes later than that after
    /// the calibration may be wrong (ES0430 2.7.7), and the analog watchdogs would take it for a fault.
    pub(crate) fn convert_for_nothing(&self) {
        let (x1, y1) = self.screw;
        let (x2, y2) = self.nut;
        for adc in [x1 as &adc1::RegisterBlock, y1, x2, y2] {
            convert_for_nothing(adc);
        }
    }

    /// From here on each top of a motor's timer starts its ADCs.
    pub(crate) fn arm(&self) {
        let (x1, y1) = self.screw;
        let (x2, y2) = self.nut;
        for adc in [x1 as &adc1::RegisterBlock, y1, x2, y2] {
            adc.cr().modify(|_, w| w.jadstart().set_bit());
        }
        // Their regular conversions are the temperatures and the internal reference.
        for adc in [x1 as &adc1::RegisterBlock, y1, x2] {
            adc.cr().modify(|_, w| w.adstart().set_bit());
        }
    }

    /// DMA1 channel 1 follows ADC1 (request 5), channel 2 ADC2 (request 36): RM0440 table 91.
    fn start_dma(&self) {
        let (dma, mux) = self.dma;
        let sources = [
            self.screw.0.dr().as_ptr() as u32,
            self.screw.1.dr().as_ptr() as u32,
        ];
        for (index, (source, request)) in sources.into_iter().zip([5, 36]).enumerate() {
            let channel = dma.ch(index);
            // SAFETY: the addresses are a data register's and a static's, both of 16 bits as CR says; the static is
            // atomic, so the DMA may write it at any time.
            unsafe {
                mux.ccr(index).write(|w| w.bits(request));
                channel.par().write(|w| w.bits(source));
                channel
                    .mar()
                    .write(|w| w.bits(TEMPERATURES[index].as_ptr() as u32));
                channel.ndtr().write(|w| w.bits(1));
                // 16 bits on both sides (PSIZE, MSIZE 1), circular, from the peripheral, enabled.
                channel
                    .cr()
                    .write(|w| w.bits(1 << 8 | 1 << 10 | 1 << 5 | 1));
            }
        }
    }
}

/// Temperatures of the screw's and the nut's heat sinks, ADC counts.
pub(crate) fn temperatures() -> [u16; 2] {
    [
        TEMPERATURES[0].load(Ordering::Relaxed),
        TEMPERATURES[1].load(Ordering::Relaxed),
    ]
}

/// The internal reference as last converted, and as it was at the maker.
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn supply() -> SupplyReading {
    // SAFETY: a data register is read, which clears a flag that nobody looks at.
    let adc4: &adc1::RegisterBlock = unsafe { &*ADC4::ptr() };
    SupplyReading {
        reference: adc4.dr().read().bits() as u16,
        calibrated: calibrated(),
    }
}

/// The internal reference as the chip's maker read it.
pub(crate) fn calibrated() -> u16 {
    VrefCal::get().read()
}

/// Power up, calibrate, enable (RM0440 21.4.6 and 21.4.8).
fn enable(adc: &adc1::RegisterBlock) -> bool {
    const LOOKS: u32 = 100_000;
    adc.cr().write(|w| w.deeppwd().clear_bit());
    adc.cr().modify(|_, w| w.advregen().set_bit());
    // The regulator needs 20 us.
    cortex_m::asm::delay(CORE_HZ / 1_000_000 * 20);
    adc.cr().modify(|_, w| w.adcal().set_bit());
    let calibrated = (0..LOOKS).any(|_| adc.cr().read().adcal().bit_is_clear());
    // ADEN must not be set within four ADC clocks of the calibration's end: 16 core cycles, taken generously.
    cortex_m::asm::delay(100);
    adc.cr().modify(|_, w| w.aden().set_bit());
    let ready = (0..LOOKS).any(|_| adc.isr().read().adrdy().bit_is_set());
    calibrated && ready
}

/// A regular conversion by software of what is converted first (RM0440 21.4.16), and all flags cleared.
fn convert_for_nothing(adc: &adc1::RegisterBlock) {
    // A conversion takes 660 ADC clocks at most.
    const LOOKS: u32 = 10_000;
    let (cfgr, sqr1) = (adc.cfgr().read().bits(), adc.sqr1().read().bits());
    let first = adc.jsqr().read().bits() >> 9 & 31;
    // SAFETY: values of the fields (RM0440, ADC_CFGR: the queue is off; ADC_SQR1: one conversion), and what they held;
    // flags are cleared by writing ones.
    unsafe {
        adc.cfgr().write(|w| w.bits(1 << 31));
        adc.sqr1().write(|w| w.bits(first << 6));
        adc.cr().modify(|_, w| w.adstart().set_bit());
        let _ = (0..LOOKS).any(|_| adc.isr().read().eos().bit_is_set());
        adc.cfgr().write(|w| w.bits(cfgr));
        adc.sqr1().write(|w| w.bits(sqr1));
        adc.isr().write(|w| w.bits(0x7FF));
    }
}

fn sequence(adc: &adc1::RegisterBlock, channels: Channels, top: Top) {
    const RISING: u32 = 1;
    let all = channels.injected.into_iter().chain(channels.regular);
    let (mut low, mut high) = (0, 0);
    for Input { channel, sampling } in all {
        let sampling = sampling as u32;
        match u32::from(channel) {
            n @ 0..=9 => low |= sampling << (3 * n),
            n => high |= sampling << (3 * (n - 10)),
        }
    }
    let [first, second] = channels.injected.map(|input| u32::from(input.channel));
    // JL = 1 (two conversions), JEXTSEL, JEXTEN, JSQ1, JSQ2.
    let jsqr = 1 | (top as u32) << 2 | RISING << 7 | first << 9 | second << 15;
    // SAFETY: values of the fields (RM0440, ADC_SMPRx, ADC_JSQR).
    unsafe {
        adc.smpr1().write(|w| w.bits(low));
        adc.smpr2().write(|w| w.bits(high));
        adc.jsqr().write(|w| w.bits(jsqr));
    }
    if let Some(regular) = channels.regular {
        // What a channel of it follows: see `start_dma`.
        let dma = match top {
            Top::Screw => 0b11,
            Top::Nut => 0,
        };
        // SAFETY: values of the fields (RM0440, ADC_SQR1, ADC_CFGR): one conversion; DMA, circular; overwritten; queue off
        // (JQDIS).
        unsafe {
            adc.sqr1()
                .write(|w| w.bits(u32::from(regular.channel) << 6));
            adc.cfgr()
                .write(|w| w.bits(1 << 31 | 1 << 12 | RISING << 10 | (top as u32) << 5 | dma));
        }
    }
}

/// Watchdog 2 looks at currents, watchdog 1 at the bus.
fn watch(adc: &adc1::RegisterBlock, currents: &[u8], bus: Option<u8>, limits: &WatchLimits) {
    let [least, most] = limits.current.map(u32::from);
    let mask = currents.iter().fold(0, |mask, channel| mask | 1 << channel);
    // SAFETY: values of the fields (RM0440, ADC_TR2, ADC_AWD2CR): the upper 8 of 12 bits.
    unsafe {
        adc.tr2().write(|w| w.bits((most >> 4) << 16 | least >> 4));
        adc.awd2cr().write(|w| w.bits(mask));
    }
    if let Some(channel) = bus {
        // One channel (AWD1SGL, AWD1CH), injected (JAWD1EN).
        const ONE_INJECTED: u32 = 1 << 22 | 1 << 24;
        // SAFETY: values of the fields (RM0440, ADC_TR1, ADC_CFGR).
        unsafe {
            adc.tr1().write(|w| w.bits(u32::from(limits.bus) << 16));
            adc.cfgr()
                .modify(|r, w| w.bits(r.bits() | ONE_INJECTED | u32::from(channel) << 26));
        }
    }
}

/// The analog watchdogs' flags.
pub(crate) struct Watches(());

impl Watches {
    const BUS: u32 = 1 << 7;
    const CURRENT: u32 = 1 << 8;

    /// Of the converters that were set up.
    pub(crate) fn of(_: &Converters) -> Self {
        Self(())
    }

    /// What was past its limit since the last call.
    #[inline(always)]
    pub(crate) fn take(&self) -> Option<Fault> {
        // SAFETY: the flags are read, and those of the watchdogs, which nobody else touches, cleared by writing ones.
        let adcs: [&adc1::RegisterBlock; 4] =
            unsafe { [&*ADC1::ptr(), &*ADC2::ptr(), &*ADC3::ptr(), &*ADC4::ptr()] };
        let [a, b, c, d] = adcs.map(|adc| adc.isr().read().bits());
        if (a | b | c | d) & (Self::BUS | Self::CURRENT) == 0 {
            return None;
        }
        for adc in adcs {
            // SAFETY: as above.
            adc.isr()
                .write(|w| unsafe { w.bits(Self::BUS | Self::CURRENT) });
        }
        if (a | d) & Self::BUS != 0 {
            Some(Fault::OverVoltage)
        } else if (a | b) & Self::CURRENT != 0 && !is_silent(adcs[0], adcs[1]) {
            Some(Fault::ScrewOverCurrent)
        } else if (c | d) & Self::CURRENT != 0 && !is_silent(adcs[3], adcs[2]) {
            Some(Fault::NutOverCurrent)
        } else {
            None
        }
    }
}

/// The amplifiers of phases a and b give 0 V, which no current does: it would return through phase c beyond its range. The supervision
/// says why.
#[cold]
#[inline(never)]
fn is_silent(x: &adc1::RegisterBlock, y: &adc1::RegisterBlock) -> bool {
    let silent = |adc: &adc1::RegisterBlock| adc.jdr1().read().bits() < u32::from(NOTHING);
    silent(x) && silent(y)
}

/// What was last converted of both power stages: screw's, nut's.
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn stages() -> [StageLook; 2] {
    // SAFETY: data registers are read, which changes nothing.
    let [a, b, c, d]: [&adc1::RegisterBlock; 4] =
        unsafe { [&*ADC1::ptr(), &*ADC2::ptr(), &*ADC3::ptr(), &*ADC4::ptr()] };
    [(a, b), (d, c)].map(|(x, y)| {
        let third = match crate::config::PLATE.board.shunts {
            Shunts::Two => 0,
            Shunts::Three => y.jdr2().read().bits(),
        };
        StageLook {
            current: [x.jdr1().read().bits(), y.jdr1().read().bits(), third]
                .map(|code| code as u16),
            bus: x.jdr2().read().bits() as u16,
        }
    })
}

/// The bus voltage at the screw's and at the nut's bridge as last converted, ADC counts.
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn bus() -> [u16; 2] {
    // SAFETY: data registers are read, which changes nothing.
    let [screw, nut]: [&adc1::RegisterBlock; 2] = unsafe { [&*ADC1::ptr(), &*ADC4::ptr()] };
    [screw, nut].map(|adc| adc.jdr2().read().bits() as u16)
}
