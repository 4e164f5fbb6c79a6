//! Faults of chip and board that a bring-up is to find; each is injected from outside.

use super::flash::Worn;

/// An ADC's channel: number of the ADC, channel.
pub type Channel = (usize, u32);

/// All of them. The default is a board on which all is well.
#[derive(Clone, Debug)]
pub struct Faults {
    /// The crystal's frequency, Hz.
    pub crystal_hz: f64,
    /// LSI's frequency, Hz.
    pub lsi_hz: f64,
    /// Comparators (bit n is COMPn) whose output stays low.
    pub dead_comparators: u32,
    /// DACs whose outputs stay at ground: DAC3, DAC4.
    pub dead_dacs: [bool; 2],
    /// Comparators whose output does not reach the timers.
    pub unwired_breaks: u32,
    /// What stands before an ADC's channel where it is not 100 ohm.
    pub source_ohm: Vec<(Channel, f64)>,
    /// Standard deviation of a channel's noise, counts, where it is not half a count.
    pub noise: Vec<(Channel, f64)>,
    /// What a channel reads whatever is measured.
    pub stuck_channel: Vec<(Channel, u16)>,
    /// What a current amplifier that works adds to its zero, counts: screw's and nut's phases.
    pub zero_off: [[i16; 3]; 2],
    /// What the bus divider of the screw's and the nut's stage gives, of what it should.
    pub divider: [f64; 2],
    /// The reserved page of the flash.
    pub worn: Worn,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            crystal_hz: 24e6,
            lsi_hz: 32e3,
            dead_comparators: 0,
            dead_dacs: [false; 2],
            unwired_breaks: 0,
            source_ohm: Vec::new(),
            noise: Vec::new(),
            stuck_channel: Vec::new(),
            zero_off: [[0; 3]; 2],
            divider: [1.0; 2],
            worn: Worn::default(),
        }
    }
}

/// The entry of a channel, if it has one.
pub(super) fn of<T: Copy>(list: &[(Channel, T)], channel: Channel) -> Option<T> {
    list.iter()
        .find(|(other, _)| *other == channel)
        .map(|(_, value)| *value)
}
