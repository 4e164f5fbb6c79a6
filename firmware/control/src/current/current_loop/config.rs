//! What a current loop is configured with.

use crate::current::encoder::Interface;
use crate::current::encoder_watch::EncoderWatchConfig;
use crate::current::modulation::ModulationConfig;
use crate::current::motor_io::Sensing;
use crate::current::observer::{EncoderAlignment, ObserverConfig};
use crate::current::regulator::RegulatorConfig;
use crate::current::sense::{BusSense, CurrentSense};

/// Configuration of a motor's current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoopConfig {
    /// ADC counts to currents.
    pub sense: CurrentSense,
    /// ADC counts to bus voltage.
    pub bus: BusSense,
    /// Raw word to encoder counts: what the loop's [`MotorIo`](crate::current::motor_io::MotorIo) says.
    pub encoder: Interface,
    /// How the encoder lies to its rotor, if that is known when the drive starts.
    pub alignment: Option<EncoderAlignment>,
    /// Encoder counts to angle and speed.
    pub observer: ObserverConfig,
    /// Whether the encoder is to be trusted.
    pub encoder_watch: EncoderWatchConfig,
    /// Largest square of a measured current, upper word: past it the bridge is opened in the same period.
    pub current_max_square: i32,
    /// Current error to voltage.
    pub regulator: RegulatorConfig,
    /// Voltage to compare values.
    pub modulation: ModulationConfig,
    /// The current zeros are to be measured; otherwise the nominal ones are trusted.
    pub measure_zeros: bool,
    /// Periods with the low sides closed before the bridge is first driven: they charge the high sides' bootstrap
    /// capacitors.
    pub bootstrap_periods: u32,
}

impl CurrentLoopConfig {
    /// How the board that it was made for reads its motor.
    #[must_use]
    #[inline]
    pub const fn sensing(&self) -> Sensing {
        Sensing {
            encoder: self.encoder,
            shunts: self.sense.shunts,
            code_shift: self.sense.code_shift,
            fraction: self.modulation.fraction,
        }
    }
}
