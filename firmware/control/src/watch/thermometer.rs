//! A temperature sensor's plate -> the ADC counts between which all is well.
//!
//! Computed while the board is compiled, as the gains are: the firmware compares counts.

use crate::base::format::Misfit;

/// A resistor that changes with temperature, in a divider with a fixed one across the ADC's reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thermometer {
    /// `R = r25 * exp(beta * (1/T - 1/298.15 K))`.
    Ntc {
        /// Resistance at 25 degrees Celsius, ohm.
        r25_ohm: f64,
        /// Its B value, K.
        beta_k: f64,
    },
    /// Platinum: `R = r0 * (1 + 3.9083e-3*t - 5.775e-7*t^2)` (IEC 60751; below zero the cubic term is left out, half a
    /// percent at -50 degrees).
    Platinum {
        /// Resistance at 0 degrees Celsius, ohm.
        r0_ohm: f64,
    },
}

/// How the sensor stands in its divider.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Between the ADC's pin and ground.
    Ground,
    /// Between the reference and the ADC's pin.
    Reference,
}

/// A temperature channel as the board has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemperaturePlate {
    /// The sensor.
    pub sensor: Thermometer,
    /// Where it stands.
    pub side: Side,
    /// The divider's other resistor, ohm.
    pub divider_ohm: f64,
    /// Hotter is too hot, degrees Celsius.
    pub max_celsius: f64,
    /// Colder is no temperature but a broken wire, degrees Celsius.
    pub min_celsius: f64,
}

/// Between which values, both included, what is measured is well: counts of a temperature, a supply's mV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The least.
    pub least: u16,
    /// The most.
    pub most: u16,
}

impl Range {
    /// Whether `value` is in it.
    #[must_use]
    pub const fn has(&self, value: u16) -> bool {
        self.least <= value && value <= self.most
    }

    /// The end that `value` is nearer to.
    #[must_use]
    pub const fn nearest(&self, value: u16) -> u16 {
        if value.abs_diff(self.least) < value.abs_diff(self.most) {
            self.least
        } else {
            self.most
        }
    }
}

impl Thermometer {
    /// Its resistance, ohm.
    #[must_use]
    pub const fn resistance(&self, celsius: f64) -> f64 {
        match *self {
            Self::Ntc { r25_ohm, beta_k } => {
                r25_ohm * exponential(beta_k * (1.0 / (celsius + 273.15) - 1.0 / 298.15))
            }
            Self::Platinum { r0_ohm } => {
                r0_ohm * (1.0 + 3.9083e-3 * celsius - 5.775e-7 * celsius * celsius)
            }
        }
    }
}

impl TemperaturePlate {
    /// What the ADC, of `adc_counts`, reads at a temperature.
    #[must_use]
    pub const fn counts(&self, celsius: f64, adc_counts: u32) -> f64 {
        let sensor = self.sensor.resistance(celsius);
        let lower = match self.side {
            Side::Ground => sensor,
            Side::Reference => self.divider_ohm,
        };
        adc_counts as f64 * lower / (sensor + self.divider_ohm)
    }

    /// The counts between which the heat sink is cool enough and the sensor there.
    ///
    /// # Errors
    /// [`Misfit`] if the sensor tells the two limits apart by less than 100 counts.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub const fn range(&self, adc_counts: u32) -> Result<Range, Misfit> {
        let hot = self.counts(self.max_celsius, adc_counts);
        let cold = self.counts(self.min_celsius, adc_counts);
        let (least, most) = if hot < cold { (hot, cold) } else { (cold, hot) };
        if most - least < 100.0 || most - least > 65_535.0 {
            return Err(Misfit {
                name: "range of a temperature channel",
                unit: "counts",
                value: most - least,
                least: 100.0,
                below: 65_536.0,
            });
        }
        Ok(Range {
            least: (least + 0.5) as u16,
            most: (most + 0.5) as u16,
        })
    }
}

/// `e^x`, for configuration: by its series at `x / 2^10`, squared ten times.
const fn exponential(x: f64) -> f64 {
    let x = x / 1024.0;
    let mut power = 1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0)));
    let mut squared = 0u32;
    while squared < 10 {
        power *= power;
        squared = squared.saturating_add(1);
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_the_library() {
        for x in [-12.0, -1.0, 0.0, 0.3, 1.0, 9.0f64] {
            assert!((exponential(x) / x.exp() - 1.0).abs() < 1e-8, "{x}");
        }
    }

    #[test]
    fn resistances_are_those_of_the_makers_tables() {
        // Vishay NTCLE100E3103, B25/85 3977 K: 10 kohm at 25, 1070 ohm at 85 degrees.
        let ntc = Thermometer::Ntc {
            r25_ohm: 10e3,
            beta_k: 3977.0,
        };
        assert!((ntc.resistance(25.0) - 10e3).abs() < 1e-6);
        assert!((ntc.resistance(85.0) / 1070.0 - 1.0).abs() < 0.01);
        // IEC 60751: 138.51 ohm at 100 degrees, 80.31 at -50.
        let platinum = Thermometer::Platinum { r0_ohm: 100.0 };
        assert!((platinum.resistance(100.0) - 138.51).abs() < 0.01);
        assert!((platinum.resistance(-50.0) - 80.31).abs() < 0.01);
    }

    #[test]
    fn a_hot_a_torn_and_a_shorted_sensor_are_out_of_range_on_either_side() {
        for (sensor, divider_ohm) in [
            (
                Thermometer::Ntc {
                    r25_ohm: 10e3,
                    beta_k: 3977.0,
                },
                4.7e3,
            ),
            (Thermometer::Platinum { r0_ohm: 1000.0 }, 2.2e3),
        ] {
            for side in [Side::Ground, Side::Reference] {
                let plate = TemperaturePlate {
                    sensor,
                    side,
                    divider_ohm,
                    max_celsius: 90.0,
                    min_celsius: -30.0,
                };
                let range = plate.range(4096).unwrap();
                let at = |celsius| plate.counts(celsius, 4096) as u16;
                assert!(range.has(at(20.0)) && range.has(at(88.0)), "{plate:?}");
                assert!(!range.has(at(92.0)), "{plate:?}");
                assert!(!range.has(4095) && !range.has(0), "{plate:?}");
            }
        }
        let blind = TemperaturePlate {
            sensor: Thermometer::Platinum { r0_ohm: 100.0 },
            side: Side::Ground,
            divider_ohm: 100e3,
            max_celsius: 90.0,
            min_celsius: -30.0,
        };
        assert!(blind.range(4096).is_err());
    }
}
