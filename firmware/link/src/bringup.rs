//! The bring-up: what the firmware asks of itself on a board that it has not met.
//!
//! The first stage runs before any bus voltage is on. The second runs at 12 V, with the gate drivers awake and the bridges off.
//!
//! The host writes a [`BringupRequest`] into RAM that a reset keeps, and resets the chip. The firmware then starts as it
//! always does, but instead of arming its bridges it reads the board, item by item, into a [`BringupReport`]; the bridges'
//! pins stay inputs until the last item, which drives them to their idle level. Any further reset ends it: the request
//! holds for one start.
//!
//! The report has raw readings and, in [`Expected`], what the firmware was built for. What they mean is the host's.

use crate::view::{Words, words};
use control::codes;

/// Symbol of the firmware's [`BringupRequest`].
pub const REQUEST_SYMBOL: &str = "BRINGUP_REQUEST";
/// Symbol of the firmware's [`BringupReport`].
pub const REPORT_SYMBOL: &str = "BRINGUP_REPORT";
/// First word of a request: `DDFB`, little-endian. RAM that has just come up does not hold it and its complement.
pub const REQUEST_MAGIC: u32 = u32::from_le_bytes(*b"DDFB");
/// First word of a report: `DDFR`, little-endian.
pub const REPORT_MAGIC: u32 = u32::from_le_bytes(*b"DDFR");

/// Above this the firmware refuses to go on, V. A power stage's gate drivers lock out well above it (8 V and more for
/// 10 V gates), so that no transistor can be on.
pub const BUS_LIMIT_V: f64 = 5.0;

/// Between these the second stage runs, V: a driver works from 8 V on, and 30 V are little for its transistors.
pub const POWERED_V: [f64; 2] = [8.0, 30.0];
/// An amplifier that gives fewer counts gives 0 V.
pub const NOTHING: u32 = control::power_stage::NOTHING as u32;
/// Conversions of each current channel in the second stage.
pub const POWERED_CONVERSIONS: u32 = 512;
/// Bins of a histogram, a count each. The outer two hold what is farther away too.
pub const BINS: usize = 17;

/// Conversions of each channel at each sampling time.
pub const CONVERSIONS: u32 = 32;
/// Sampling times by their code, halves of an ADC clock (RM0440 21.4.12, ADC_SMPRx).
pub const SAMPLING_HALVES: [u32; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];

/// Seconds in which the sampling capacitor comes nearer to a pin by a factor e, behind a source of so many ohms.
///
/// By the datasheet's largest sources for each sampling time at 60 MHz, which settle to half a count of 12 bits, that is in
/// `ln(2^13)` of these (DS12288, maximum R_AIN: 330 ohm in 6.5 clocks and 39 kohm in 640.5 on the fast channels 1 to 5, 100
/// ohm and 33 kohm on the others; as public projects for this chip cite it): a line through the two.
#[must_use]
pub fn time_constant_s(channel: u32, ohm: f64) -> f64 {
    const TIME_CONSTANTS: f64 = 13.0 * core::f64::consts::LN_2;
    const CLOCK_HZ: f64 = 60e6;
    let [short, long] = match channel {
        1..=5 => [(6.5, 330.0), (640.5, 39e3)],
        _ => [(6.5, 100.0), (640.5, 33e3)],
    }
    .map(|(clocks, most)| (clocks / CLOCK_HZ / TIME_CONSTANTS, most));
    short.0 + (ohm - short.1) * (long.0 - short.0) / (long.1 - short.1)
}

/// Captures of HSI16 / 16, and edges of it from one to the next.
pub const HSI_CAPTURES: u32 = 32;
/// Edges of a clock from one capture to the next (TIMx_CCMR1.IC1PSC = 3).
pub const EDGES_A_CAPTURE: u32 = 8;
/// Captures of LSI.
pub const LSI_CAPTURES: u32 = 4;

/// Double words that the flash test programs.
pub const FLASH_DOUBLE_WORDS: u32 = 8;

/// Byte number `k` of the stream that measures how fast a probe reads.
#[must_use]
pub const fn stream_byte(k: u32) -> u8 {
    // A prime below 256: a piece that is lost or comes twice does not go unnoticed.
    #[allow(clippy::cast_possible_truncation)]
    let byte = (k % 251) as u8;
    byte
}

codes! {
    /// How far the bring-up is.
    Stage {
        Start = 1, "start", "The firmware has taken the request.";
        Clock = 2, "clock", "The clock is being started from the crystal.";
        Converters = 3, "converters", "The ADCs convert each channel at each sampling time.";
        Pins = 4, "pins", "Each pin is pulled up and down.";
        Comparators = 5, "comparators", "The DACs sweep over the comparators' pins.";
        Breaks = 6, "breaks", "Each break source stops its timer.";
        Encoders = 7, "encoders", "The encoders are listened to.";
        Idle = 8, "idle outputs", "The timers drive the bridges' inputs to their idle level.";
        Flash = 9, "flash", "The reserved page of the flash is erased and written.";
        Stream = 10, "stream", "A pattern is sent through RTT until the host has had enough.";
        Done = 11, "done", "All has been read; a reset starts the drive.";
        Refused = 12, "refused", "The bus voltage is not that of this stage, so nothing more is tried.";
        Powered = 13, "powered", "The drivers sleep, wake and sleep again; the timers convert the currents.";
    }
}

codes! {
    /// What an ADC's channel measures.
    Signal {
        ScrewA = 1, "screw phase a", "Current of the screw's phase a.";
        ScrewB = 2, "screw phase b", "Current of the screw's phase b.";
        ScrewC = 3, "screw phase c", "Current of the screw's phase c.";
        ScrewBus = 4, "bus at the screw's bridge", "Bus voltage at the screw's bridge.";
        ScrewHeatSink = 5, "screw heat sink", "Temperature of the screw's heat sink.";
        NutA = 6, "nut phase a", "Current of the nut's phase a.";
        NutB = 7, "nut phase b", "Current of the nut's phase b.";
        NutC = 8, "nut phase c", "Current of the nut's phase c.";
        NutBus = 9, "bus at the nut's bridge", "Bus voltage at the nut's bridge.";
        NutHeatSink = 10, "nut heat sink", "Temperature of the nut's heat sink.";
        Reference = 11, "internal reference", "The chip's internal reference, which shows its supply.";
    }
}

codes! {
    /// What a pin is for.
    PinUse {
        HighA = 1, "high side a", "Gate driver's input of phase a's high side.";
        HighB = 2, "high side b", "Gate driver's input of phase b's high side.";
        HighC = 3, "high side c", "Gate driver's input of phase c's high side.";
        LowA = 4, "low side a", "Gate driver's input of phase a's low side.";
        LowB = 5, "low side b", "Gate driver's input of phase b's low side.";
        LowC = 6, "low side c", "Gate driver's input of phase c's low side.";
        EncoderA = 7, "encoder A", "Channel A of an incremental encoder or scale.";
        EncoderB = 8, "encoder B", "Channel B of an incremental encoder or scale.";
        Index = 9, "encoder index", "Index of an incremental encoder.";
        Clock = 10, "SPI clock", "Clock to an absolute encoder.";
        DataIn = 11, "SPI data in", "Data from an absolute encoder.";
        DataOut = 12, "SPI data out", "Data to an absolute encoder.";
        Select = 13, "SPI select", "Chip select of an absolute encoder.";
        Fault = 14, "driver fault", "The gate driver's fault, into the timer's break.";
    }
}

codes! {
    /// Whose a pin, a break or an encoder is.
    Owner {
        Screw = 1, "screw", "The motor that turns the screw.";
        Nut = 2, "nut", "The motor that turns the nut.";
        Table = 3, "table", "The table's scale.";
    }
}

codes! {
    /// What stops a timer's outputs.
    BreakSource {
        Software = 1, "software", "The break event that software generates.";
        Comparator = 2, "comparator", "One comparator.";
        Pin = 3, "driver's fault pin", "The break's pin, by the pull resistor inside the chip.";
        Configured = 4, "all as configured", "The comparators, with the timer set up and locked as the drive runs.";
    }
}

codes! {
    /// How a motor's encoder is read.
    EncoderKind {
        Incremental = 1, "incremental", "Channels A and B on a timer.";
        IncrementalWithIndex = 2, "incremental with index", "Channels A and B and an index on a timer.";
        Mt6835 = 3, "MT6835", "Frames of 32 bits by SPI, with a check.";
    }
}

/// Bits of [`BreakReading::seen`].
pub mod seen {
    /// The main output could be enabled before.
    pub const ENABLED: u32 = 1;
    /// The source cleared it.
    pub const CLEARED: u32 = 1 << 1;
    /// The break's flag is set.
    pub const FLAG: u32 = 1 << 2;
    /// While the source is active the output cannot be enabled again. Not of [`Software`](super::BreakSource::Software).
    pub const HELD: u32 = 1 << 3;
    /// After the source has gone and the flag is cleared, the output can be enabled again.
    pub const RECOVERED: u32 = 1 << 4;
    /// The other timer's output stayed enabled. Not of [`Configured`](super::BreakSource::Configured): both motors'
    /// comparators have one threshold.
    pub const OTHER_STAYED: u32 = 1 << 5;
}

/// Bits of [`PinReading::levels`].
pub mod level {
    /// Reads high while pulled up.
    pub const PULLED_UP: u32 = 1;
    /// Reads high while pulled down.
    pub const PULLED_DOWN: u32 = 1 << 1;
    /// The timer was made to drive it to its idle level, low.
    pub const DRIVEN: u32 = 1 << 2;
    /// Reads high while the timer drives it low.
    pub const DRIVEN_HIGH: u32 = 1 << 3;
    /// A fault's line, which the drive pulls up: its fault level is low.
    pub const IDLE_HIGH: u32 = 1 << 4;
}

/// Bits of [`FlashReading::done`].
pub mod flash {
    /// The page was erased before, or held an earlier test.
    pub const WAS_OURS: u32 = 1;
    /// It reads as erased after the erase.
    pub const ERASED: u32 = 1 << 1;
}

words! {
    /// What the host asks for. Written to the drive's RAM before the reset, `magic` and `complement` last.
    BringupRequest, RequestWords {
        /// [`REQUEST_MAGIC`].
        magic: u32,
        /// Its complement.
        complement: u32,
        /// How long to listen to the encoders, ms.
        listen_ms: u32,
        /// 1: the host reads the stream. 0 ends it.
        stream: u32,
        /// 1: the second stage. 0: the first.
        powered: u32,
    }
}

words! {
    /// A heat sink's sensor as the board declares it.
    SensorPlate, SensorWords {
        /// 0: NTC; 1: platinum.
        platinum: u32,
        /// Resistance at 25 degrees Celsius (NTC) or at 0 (platinum), ohm.
        ohm: u32,
        /// B value of an NTC, K.
        beta_k: u32,
        /// The divider's other resistor, ohm.
        divider_ohm: u32,
        /// 0: the sensor is at ground; 1: at the reference.
        at_reference: u32,
        /// Counts between which the temperature is well: minimum, maximum.
        range: [u32; 2],
    }
}

words! {
    /// What the firmware was built for: what the readings are compared with.
    Expected, ExpectedWords {
        /// Core clock, Hz.
        core_hz: u32,
        /// Crystal, Hz.
        crystal_hz: u32,
        /// Clock of the ADCs, Hz.
        adc_hz: u32,
        /// Counts of the ADCs' range.
        adc_counts: u32,
        /// ADC counts of a current channel at zero current, times 16.
        zero_sixteenths: u32,
        /// How far a zero may be off, counts.
        zero_tolerance: u32,
        /// A current channel's worth of a count, uA; its sign is the channel's.
        microamperes: i32,
        /// Bus voltage of a count, uV.
        bus_microvolts: u32,
        /// 1: the current amplifiers are the gate drivers', and sleep with them.
        amplifiers_sleep: u32,
        /// What the power stage's inputs have to ground beside the gate driver's own resistor, ohm; 0: nothing.
        gate_pull_down_ohm: u32,
        /// What the chip's maker read of its internal reference at 3.0 V, counts.
        calibrated: u32,
        /// Heat sinks' sensors: screw, nut.
        sensors: [SensorWords; 2],
    }
}

words! {
    /// Clocks, power, flash interface.
    ClockReading, ClockWords {
        /// RCC_APB1ENR1 before the bring-up touches it: whether PWR had its clock.
        apb1enr1: u32,
        /// PWR_CR1.
        pwr_cr1: u32,
        /// PWR_CR5.
        pwr_cr5: u32,
        /// PWR_SR2.
        pwr_sr2: u32,
        /// FLASH_ACR.
        flash_acr: u32,
        /// FLASH_OPTR.
        flash_optr: u32,
        /// DBGMCU_IDCODE.
        idcode: u32,
        /// RCC_CR.
        rcc_cr: u32,
        /// RCC_CFGR.
        rcc_cfgr: u32,
        /// RCC_PLLCFGR.
        rcc_pllcfgr: u32,
        /// Timer clocks in [`HSI_CAPTURES`] times [`EDGES_A_CAPTURE`] periods of HSI16 / 16; 0: no edge came.
        hsi: u32,
        /// Timer clocks in [`LSI_CAPTURES`] times [`EDGES_A_CAPTURE`] periods of LSI; 0: no edge came.
        lsi: u32,
    }
}

words! {
    /// One channel at one sampling time.
    SampleReading, SampleWords {
        /// The first conversion.
        first: u32,
        /// Sum of all, each less the first.
        sum: i32,
        /// Sum of the squares of that.
        squares: u32,
    }
}

words! {
    /// One channel.
    ChannelReading, ChannelWords {
        /// A [`Signal`]; 0: no entry.
        signal: u32,
        /// The ADC, 1 to 4.
        adc: u32,
        /// Its channel.
        channel: u32,
        /// The channel that the sampling capacitor comes from in this test.
        before: u32,
        /// Code of the sampling time that the drive uses.
        sampling: u32,
        /// By the sampling time's code.
        samples: [SampleWords; 8],
    }
}

words! {
    /// A current channel in the second stage.
    CurrentReading, CurrentWords {
        /// Mean while the driver sleeps, is awake, and sleeps again, counts.
        levels: [u32; 3],
        /// [`POWERED_CONVERSIONS`] of an awake driver by their distance from `levels[1]`; that itself is in the middle.
        histogram: [u32; BINS],
        /// Sum of these distances.
        sum: i32,
        /// Sum of their squares, at most 2^32 - 1.
        squares: u32,
    }
}

words! {
    /// A power stage in the second stage.
    StageReading, StageWords {
        /// Phases a, b, c.
        currents: [CurrentWords; 3],
        /// Sum of [`POWERED_CONVERSIONS`] conversions of the bus.
        bus: u32,
        /// The fault line is at its fault level: bit 0 asleep, 1 awake, 2 asleep again.
        pulled: u32,
        /// Periods in which the currents were converted; 0: it did not come to that.
        conversions: u32,
    }
}

words! {
    /// One comparator, while its DAC goes up and down over the whole range.
    ComparatorReading, ComparatorWords {
        /// Its number, 1 to 7; 0: no entry.
        number: u32,
        /// The [`Signal`] at its pin.
        signal: u32,
        /// 1: its output is high with the DAC at 0.
        start: u32,
        /// DAC counts at its first change on the way up; 4096: none.
        up: u32,
        /// DAC counts at its first change on the way down; 4096: none.
        down: u32,
        /// Changes altogether: two of a healthy one.
        changes: u32,
    }
}

words! {
    /// One source of one timer's break.
    BreakReading, BreakWords {
        /// An [`Owner`]; 0: no entry.
        owner: u32,
        /// A [`BreakSource`].
        source: u32,
        /// The comparator's number, or 0.
        comparator: u32,
        /// Bits of [`seen`].
        seen: u32,
    }
}

words! {
    /// One pin.
    PinReading, PinWords {
        /// Port (0 is A) in the second byte, pin in the first.
        pin: u32,
        /// A [`PinUse`]; 0: no entry.
        function: u32,
        /// An [`Owner`].
        owner: u32,
        /// Bits of [`level`].
        levels: u32,
        /// Entries (bit n is entry n) that rise when this pin alone is pulled up.
        raised: u32,
        /// Entries that fall when this pin alone is pulled down.
        lowered: u32,
    }
}

words! {
    /// One motor's encoder.
    EncoderReading, EncoderWords {
        /// An [`EncoderKind`].
        kind: u32,
        /// Counts of a turn.
        counts_per_turn: u32,
        /// Looks, one a PWM period.
        looks: u32,
        /// Frames whose check failed.
        bad_checks: u32,
        /// Frames whose status says that the angle is not to be trusted.
        bad_status: u32,
        /// Status bits that were seen.
        status: u32,
        /// The last frame that was not right.
        bad_frame: u32,
        /// Looks whose count differs from the one before.
        changes: u32,
        /// The first count.
        first: u32,
        /// Smallest counts moved from the first look.
        least: i32,
        /// And the most.
        most: i32,
        /// Times that the index came.
        indices: u32,
        /// Times that both channels changed together.
        transition_errors: u32,
    }
}

words! {
    /// The reserved page of the flash.
    FlashReading, FlashWords {
        /// Where it is.
        address: u32,
        /// Bits of [`flash`].
        done: u32,
        /// FLASH_SR after the erase, and after the last double word that failed.
        status: [u32; 2],
        /// Core clocks of the erase.
        erase: u32,
        /// Core clocks of [`FLASH_DOUBLE_WORDS`] double words.
        program: u32,
        /// Double words that read back as they were written.
        right: u32,
    }
}

/// Room for channels, comparators, breaks and pins.
pub const CHANNELS: usize = 12;
/// Comparators of the chip.
pub const COMPARATORS: usize = 7;
/// Two timers: software, pin, all, and the comparators.
pub const BREAKS: usize = 14;
/// Bits of a word.
pub const PINS: usize = 32;

words! {
    /// All readings.
    BringupReport, ReportWords {
        /// [`REPORT_MAGIC`].
        magic: u32,
        /// [`LAYOUT`](crate::LAYOUT).
        layout: u32,
        /// A [`Stage`].
        stage: u32,
        /// What the firmware was built for.
        expected: ExpectedWords,
        /// Clocks, power, flash interface.
        clock: ClockWords,
        /// ADC channels.
        channels: [ChannelWords; CHANNELS],
        /// The power stages in the second stage: screw's, nut's.
        stages: [StageWords; 2],
        /// Comparators.
        comparators: [ComparatorWords; COMPARATORS],
        /// Breaks.
        breaks: [BreakWords; BREAKS],
        /// Pins.
        pins: [PinWords; PINS],
        /// Encoders: screw, nut.
        encoders: [EncoderWords; 2],
        /// The flash's reserved page.
        flash: FlashWords,
        /// Bytes that went into the stream.
        streamed: u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::size_of;

    #[test]
    fn the_report_is_read_whole() {
        let mut words = 0usize;
        let report = ReportWords::take(&mut || {
            words += 1;
            u32::try_from(words - 1).unwrap()
        });
        assert_eq!(words, size_of::<BringupReport>() / 4);
        assert_eq!(report.streamed as usize, words - 1);
    }

    #[test]
    fn the_stream_does_not_repeat_with_a_power_of_two() {
        for lost in [1, 64, 256, 1024, 32 * 1024] {
            assert_ne!(stream_byte(0), stream_byte(lost));
        }
    }
}
