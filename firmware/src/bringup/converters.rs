//! Each channel that the drive converts, at each sampling time.
//!
//! A sampling time that is too short shows only if the sampling capacitor comes from somewhere else. So each conversion of
//! a channel follows, in one sequence, one of that channel of its ADC whose level is farthest away, sampled long.

use super::{put, wait_until};
use core::sync::atomic::Ordering::Relaxed;
use link::bringup::{CHANNELS, CONVERSIONS, ChannelReading, SampleReading, Signal};
use stm32g4xx_hal::stm32::{ADC1, ADC2, ADC3, ADC4, adc1};

/// 247.5 ADC clocks: what is before has settled.
const LONG: u32 = 6;
/// 640.5 ADC clocks.
const LONGEST: u32 = 7;
/// Flags of a regular sequence.
const EOC_EOS_OVR: u32 = 1 << 2 | 1 << 3 | 1 << 4;

/// The signals of an ADC: first and second injected, regular. See `hw::analog`.
const SIGNALS: [[Option<Signal>; 3]; 4] = [
    [
        Some(Signal::ScrewA),
        Some(Signal::ScrewBus),
        Some(Signal::ScrewHeatSink),
    ],
    [
        Some(Signal::ScrewB),
        Some(Signal::ScrewC),
        Some(Signal::NutHeatSink),
    ],
    [Some(Signal::NutB), Some(Signal::NutC), None],
    [
        Some(Signal::NutA),
        Some(Signal::NutBus),
        Some(Signal::Reference),
    ],
];

fn adcs() -> [&'static adc1::RegisterBlock; 4] {
    // SAFETY: interrupts are masked and no conversion is armed: nobody else is at the ADCs.
    unsafe { [&*ADC1::ptr(), &*ADC2::ptr(), &*ADC3::ptr(), &*ADC4::ptr()] }
}

/// Takes the channels and their sampling times from where the drive's start has put them.
pub(super) fn read(words: &[ChannelReading; CHANNELS]) {
    let mut entries = words.iter();
    for ((adc, signals), number) in adcs().into_iter().zip(SIGNALS).zip(1..) {
        let kept = Kept::take(adc);
        let jsqr = adc.jsqr().read().bits();
        let [first, second] = [jsqr >> 9 & 31, jsqr >> 15 & 31];
        let regular = adc.sqr1().read().bits() >> 6 & 31;
        let channels = [
            Some(first),
            // The same once more: a phase that has no sensor.
            (second != first).then_some(second),
            signals[2].map(|_| regular),
        ];
        adc.cfgr().write(|w| w.jqdis().set_bit().ovrmod().set_bit());
        let levels = channels.map(|channel| {
            channel.map(|channel| {
                sampled_with(adc, channel, LONGEST, channel, LONGEST);
                convert(adc, channel, channel)
            })
        });
        for ((channel, signal), level) in channels.into_iter().zip(signals).zip(levels) {
            let (Some(channel), Some(signal), Some(level)) = (channel, signal, level) else {
                continue;
            };
            let Some(entry) = entries.next() else {
                break;
            };
            let before = farthest(channels, levels, level).unwrap_or(channel);
            put(&entry.adc, number);
            put(&entry.channel, channel);
            put(&entry.before, before);
            put(&entry.sampling, kept.sampling(channel));
            for (sample, code) in entry.samples.iter().zip(0..) {
                sampled_with(adc, before, LONG, channel, code);
                sweep(adc, before, channel, sample);
            }
            put(&entry.signal, signal.word());
        }
        kept.give_back(adc);
    }
}

/// The bus by the divider that gives more, counts at the longest sampling time.
pub(super) fn bus(words: &[ChannelReading; CHANNELS]) -> i64 {
    let buses = words.iter().filter(|entry| {
        let signal = Signal::of_word(entry.signal.load(Relaxed));
        matches!(signal, Some(Signal::ScrewBus | Signal::NutBus))
    });
    buses
        .map(|entry| {
            let [.., longest] = &entry.samples;
            let first = i64::from(longest.first.load(Relaxed));
            first + i64::from(longest.sum.load(Relaxed)) / i64::from(CONVERSIONS)
        })
        .max()
        .unwrap_or(0)
}

/// The channel whose level is farthest from `level`.
fn farthest(channels: [Option<u32>; 3], levels: [Option<u32>; 3], level: u32) -> Option<u32> {
    let pairs = channels.into_iter().zip(levels);
    let known = pairs.filter_map(|(channel, other)| Some((channel?, other?)));
    known
        .max_by_key(|(_, other)| other.abs_diff(level))
        .map(|(channel, _)| channel)
}

/// Sampling times of two channels. The second's is written last: they may be one.
fn sampled_with(adc: &adc1::RegisterBlock, a: u32, code_a: u32, b: u32, code_b: u32) {
    for (channel, code) in [(a, code_a), (b, code_b)] {
        // SAFETY: values of the fields (RM0440, ADC_SMPR1: channels 0 to 9, ADC_SMPR2: 10 to 18).
        unsafe {
            match channel {
                0..=9 => adc
                    .smpr1()
                    .modify(|r, w| w.bits(field(r.bits(), channel, code))),
                _ => adc
                    .smpr2()
                    .modify(|r, w| w.bits(field(r.bits(), channel - 10, code))),
            };
        }
    }
}

fn field(word: u32, index: u32, code: u32) -> u32 {
    word & !(7 << (3 * index)) | code << (3 * index)
}

/// A sequence of two regular conversions by software (RM0440 21.4.16, 21.4.26): the second's result.
fn convert(adc: &adc1::RegisterBlock, before: u32, channel: u32) -> u32 {
    // Two conversions of at most 653 ADC clocks.
    const LOOKS: u32 = 10_000;
    // SAFETY: values of the fields (RM0440, ADC_SQR1: L 1; ADC_ISR: flags are cleared by writing one).
    unsafe {
        adc.sqr1()
            .write(|w| w.bits(1 | before << 6 | channel << 12));
        adc.isr().write(|w| w.bits(EOC_EOS_OVR));
    }
    adc.cr().modify(|_, w| w.adstart().set_bit());
    wait_until(LOOKS, || adc.isr().read().eos().bit_is_set());
    adc.dr().read().bits() & 0xFFFF
}

fn sweep(adc: &adc1::RegisterBlock, before: u32, channel: u32, words: &SampleReading) {
    let first = convert(adc, before, channel).cast_signed();
    let (mut sum, mut squares) = (0i32, 0u32);
    // 31 squares of at most 4095 are below 2^30.
    for _ in 1..CONVERSIONS {
        let less = convert(adc, before, channel)
            .cast_signed()
            .wrapping_sub(first);
        sum = sum.wrapping_add(less);
        squares = squares.wrapping_add(less.wrapping_mul(less).cast_unsigned());
    }
    put(&words.first, first.cast_unsigned());
    words.sum.store(sum, Relaxed);
    put(&words.squares, squares);
}

/// An ADC's set-up, as the drive has it.
struct Kept {
    cfgr: u32,
    smpr: [u32; 2],
    sqr1: u32,
}

impl Kept {
    fn take(adc: &adc1::RegisterBlock) -> Self {
        Self {
            cfgr: adc.cfgr().read().bits(),
            smpr: [adc.smpr1().read().bits(), adc.smpr2().read().bits()],
            sqr1: adc.sqr1().read().bits(),
        }
    }

    fn sampling(&self, channel: u32) -> u32 {
        let [low, high] = self.smpr;
        match channel {
            0..=9 => low >> (3 * channel) & 7,
            _ => high >> (3 * (channel - 10)) & 7,
        }
    }

    fn give_back(&self, adc: &adc1::RegisterBlock) {
        let [low, high] = self.smpr;
        // SAFETY: what these registers held; flags are cleared by writing ones.
        unsafe {
            adc.isr().write(|w| w.bits(EOC_EOS_OVR));
            adc.cfgr().write(|w| w.bits(self.cfgr));
            adc.smpr1().write(|w| w.bits(low));
            adc.smpr2().write(|w| w.bits(high));
            adc.sqr1().write(|w| w.bits(self.sqr1));
        }
    }
}
