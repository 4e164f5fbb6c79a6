//! The seam between a motor's current loop and its registers: raw counts in, compare values out.
//!
//! The firmware implements [`MotorIo`] with registers, the simulated board with its peripherals. The loop on top of it is the
//! same code: see [`current_loop`](crate::current_loop).

use crate::current::encoder::Interface;
use crate::current::sense::Shunts;

/// How a board reads a motor and drives its bridge: its pins and its ADC have it so, and no setting changes it. A board that says it as a constant
/// spares its current loop what is for others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sensing {
    /// How the encoder's words are read.
    pub encoder: Interface,
    /// Which phases have a current sensor.
    pub shunts: Shunts,
    /// See [`CurrentSense::code_shift`](crate::current::sense::CurrentSense::code_shift).
    pub code_shift: u32,
    /// See [`ModulationConfig::fraction`](crate::current::modulation::ModulationConfig::fraction).
    pub fraction: u32,
}

/// The registers of one motor.
pub trait MotorIo {
    /// Acknowledges the interrupt and the timer's update; `true` if the break has opened the bridge.
    fn acknowledge(&mut self) -> bool;

    /// The encoder's raw word of this period: see [`Interface`].
    fn encoder(&mut self) -> u32;

    /// How the board reads this motor.
    fn sensing(&self) -> Sensing;

    /// ADC counts of the phases; of c only where it is measured.
    fn current(&mut self) -> [u16; 3];

    /// ADC counts of the bus voltage.
    fn bus(&mut self) -> u32;

    /// Writes the compare values of the next period.
    fn write(&mut self, compare: [u16; 3]);

    /// Closes the bridge: the outputs follow the compare values. Called once for each time that it is closed: a bridge that
    /// the break has opened since this interrupt read its flag must not be closed again by a write that merely repeats.
    fn close(&mut self);

    /// Opens the bridge.
    fn open(&mut self);

    /// Acknowledges the break, which holds while its input is active, and lets the encoder start again.
    fn clear_break(&mut self);

    /// The next period has not begun. Past its begin, what was written just now missed its deadline and the old values
    /// hold for a period more.
    fn in_time(&mut self) -> bool;
}
