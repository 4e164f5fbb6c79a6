//! The controller's own supply, by the chip's internal reference: the ADC reads a voltage that does not change against a supply that
//! does, and the chip's maker has written what it read at 3.0 V (STM32G474: `VREFINT_CAL`; ST's LL driver,
//! `__LL_ADC_CALC_VREFANALOG_VOLTAGE`).
//!
//! A supply that falls slowly, or is noisy, is so found while the drive still has the time of a stop. What ends it without code is
//! further down: see `hw::clock` of the firmware.

use crate::watch::thermometer::Range;

/// The supply at which the maker read the reference, mV (`stm32g4xx-hal`, `signature.rs`: `VDDA_CALIB`).
pub const CALIBRATED_AT_MV: u32 = 3000;

/// Between which the supply is well, mV: 3.3 V and 6 % of either sign. A regulator of 3.3 V is good for 3 % over load and temperature, the
/// calibration for 10 mV of 3 V, and the reference for 1 % over temperature (memory: datasheets of LD39050 and of the chip, embedded
/// voltage reference).
pub const SUPPLY_MV: Range = Range {
    least: 3102,
    most: 3498,
};

/// The internal reference as it is read and as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SupplyReading {
    /// ADC counts, of 12 bits.
    pub reference: u16,
    /// ADC counts at 3.0 V.
    pub calibrated: u16,
}

impl SupplyReading {
    /// The supply, mV; of an ADC that reads nothing more than any supply.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub fn millivolts(self) -> u16 {
        // Below 2^28.
        let at_one_count = u32::from(self.calibrated).saturating_mul(CALIBRATED_AT_MV);
        at_one_count
            .checked_div(self.reference.into())
            .unwrap_or(u32::MAX)
            .min(u16::MAX.into()) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1.212 V is the reference's typical voltage (datasheet, embedded voltage reference).
    fn at(volts: f64) -> u16 {
        let counts = |supply: f64| (1.212 / supply * 4096.0).round() as u16;
        SupplyReading {
            reference: counts(volts),
            calibrated: counts(3.0),
        }
        .millivolts()
    }

    #[test]
    fn a_supply_is_read_to_a_part_in_a_thousand() {
        for volts in [2.0, 2.8, 3.0, 3.135, 3.3, 3.465, 3.6] {
            assert!((f64::from(at(volts)) / 1e3 / volts - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn what_a_regulator_may_give_is_well_and_what_a_fault_gives_is_not() {
        for (volts, well) in [
            (3.3 * 0.97, true),
            (3.3 * 1.03, true),
            (3.05, false),
            (3.55, false),
        ] {
            assert_eq!(SUPPLY_MV.has(at(volts)), well, "{volts} V");
        }
    }

    #[test]
    fn no_reading_and_no_calibration_are_no_supply() {
        for (reference, calibrated) in [(0, 1655), (1504, 0), (1504, u16::MAX), (0, 0)] {
            let reading = SupplyReading {
                reference,
                calibrated,
            };
            assert!(!SUPPLY_MV.has(reading.millivolts()), "{reading:?}");
        }
    }
}
