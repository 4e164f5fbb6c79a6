//! Heat of a winding or a bridge by its current (I2t): it folds the current back before it becomes a fault.
//!
//! First order: `tau * d(heat)/dt = i^2 - heat`, in squares of a current, so that a current that flows for long makes its
//! own square. From a heat `h` a current `i` takes `tau * ln((i^2 - h) / (i^2 - I^2))` to the heat `I^2`: the thermal relay's
//! curve of IEC 60255-149, hot with `h` of the load before, cold with 0.
//!
//! The current is the vector's: its square is the sum of the phases' squares, so that `R` times it is the winding's loss.
//! Each phase has a third of that while the rotor turns; while it stands one phase may have two thirds, so twice the square
//! is taken. A bridge's loss grows with the square too where its switches are MOSFETs; an IGBT's grows more slowly, so that
//! the same model is on the safe side above the rated current.
//!
//! Format: the upper word of a [`ScaledCurrent`]'s square, as the current loop's over-current limit has it: two are within
//! 2^29, twice that within 2^30. The state has 32 bits below it: a look moves it by as little as 2^-32 of the way, so that a
//! time constant of days still moves, and a product of 31 and 32 bits is added whole: nothing is rounded but the way itself.

use crate::base::format::{Current, Gain, ScaledCurrent, multiply_upper};
use crate::current::transform::DirectQuadrature;

/// What a thing's heat makes of its current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThermalConfig {
    /// Part of the way to the present current's heat in a look, 2^-32.
    pub part: u32,
    /// Heat of the rated current.
    pub rated: i32,
    /// The rated current, which is what the fold-back leaves at its heat.
    pub rated_current: Current,
    /// Heat below the rated one to current above the rated one: what the fold-back leaves.
    pub fold: Gain,
    /// Heat past which it is a fault: the fold-back keeps it below, so the current is not what was asked.
    pub trip: i32,
}

/// The heat of one thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thermal {
    heat: i64,
}

impl Thermal {
    /// How warm a thing is taken to be when the drive starts, which does not know: four fifths of the rated heat, so that
    /// a reset lets a hot one be taken for cooler by no more than a fifth.
    #[must_use]
    pub const fn starting(config: &ThermalConfig) -> Self {
        // Below 2^31 times 2^32.
        Self {
            heat: ((config.rated / 5) as i64).saturating_mul(4 << 32),
        }
    }

    /// One look, at a current of this square.
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub fn step(&mut self, config: &ThermalConfig, square: i32) {
        // Squares are within 2^30, so is the heat, which lies between those that it saw; a part is below 2^32.
        let way = square - self.squares();
        self.heat += i64::from(way) * i64::from(config.part);
    }

    /// The heat, as a square.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn squares(&self) -> i32 {
        (self.heat >> 32) as i32
    }

    /// The largest current that the heat leaves, A: the rated one at the rated heat, more below, less above.
    #[must_use]
    #[inline(always)]
    pub fn current_max(&self, config: &ThermalConfig) -> Current {
        let below = config.rated.saturating_sub(self.squares());
        let more = Current::from_bits(config.fold.times(below));
        config.rated_current.saturating_add(more).max(Current::ZERO)
    }

    /// It is a fault.
    #[must_use]
    #[inline(always)]
    pub fn trips(&self, config: &ThermalConfig) -> bool {
        self.squares() > config.trip
    }
}

/// A motor's winding and its bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HeatConfig {
    /// The winding.
    pub winding: ThermalConfig,
    /// The bridge.
    pub bridge: ThermalConfig,
    /// From here on the phases share the loss evenly, 2^-32 turn of the shaft a sample.
    pub turning: i32,
}

/// Heat of a motor's winding and its bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heat {
    winding: Thermal,
    bridge: Thermal,
}

impl Heat {
    /// As warm as [`Thermal::starting`].
    #[must_use]
    pub const fn starting(config: &HeatConfig) -> Self {
        Self {
            winding: Thermal::starting(&config.winding),
            bridge: Thermal::starting(&config.bridge),
        }
    }

    /// One look, at a measured current while the shaft turns by `theta_step` a sample.
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub fn step(
        &mut self,
        config: &HeatConfig,
        current: DirectQuadrature<ScaledCurrent>,
        theta_step: i32,
    ) {
        let square = |ScaledCurrent(x): ScaledCurrent| multiply_upper(x, x);
        // Each within 2^28.
        let square = square(current.d) + square(current.q);
        let stands = theta_step.unsigned_abs() < config.turning.unsigned_abs();
        let square = if stands { 2 * square } else { square };
        self.winding.step(&config.winding, square);
        self.bridge.step(&config.bridge, square);
    }

    /// The largest current that both leave, A.
    #[must_use]
    #[inline(always)]
    pub fn current_max(&self, config: &HeatConfig) -> Current {
        let winding = self.winding.current_max(&config.winding);
        winding.min(self.bridge.current_max(&config.bridge))
    }

    /// It is a fault.
    #[must_use]
    #[inline(always)]
    pub fn trips(&self, config: &HeatConfig) -> bool {
        self.winding.trips(&config.winding) || self.bridge.trips(&config.bridge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::rates::STEPS_PER_HEAT;
    use crate::plate::{DrivePlate, ThermalPlate, test_plate};
    use proptest::prelude::*;

    /// Looks a second: the test plate's speed task takes 5000 steps in it.
    const LOOKS_HZ: f64 = 5000.0 / STEPS_PER_HEAT as f64;

    fn with(thermal: ThermalPlate) -> DrivePlate {
        let mut plate = test_plate();
        plate.motors[0].thermal = thermal;
        plate
    }

    fn config(plate: &DrivePlate) -> HeatConfig {
        plate.config().unwrap().heat[0]
    }

    /// The vector of a phase's rms current, along d and q as `part` says.
    fn current(plate: &DrivePlate, rms_a: f64, part: f64) -> DirectQuadrature<ScaledCurrent> {
        let scale = plate.motors[0].current_loop(plate).unwrap().sense.scale;
        let vector = rms_a * 3f64.sqrt();
        let scaled = |a: f64| scale.scaled(Current::from_num(a));
        DirectQuadrature {
            d: scaled(vector * part.sin()),
            q: scaled(vector * part.cos()),
        }
    }

    const TURNING: i32 = 1 << 24;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        /// The heat is that of the closed form, after any two currents for any times.
        #[test]
        fn agrees_with_the_closed_form(
            rated in 0.8..1.4f64,
            seconds in 2.0..60.0f64,
            loads in prop::array::uniform3((0.0..2.0f64, 0.01..1.0f64, 0.0..6.3f64)),
        ) {
            let plate = with(ThermalPlate { rated_rms_a: rated, seconds });
            let config = config(&plate).winding;
            let unit = f64::from(config.rated) / (3.0 * rated * rated);
            let heat_config = HeatConfig { winding: config, bridge: config, turning: 0 };
            let mut heat = Heat::starting(&heat_config);
            let mut exact = 0.8 * 3.0 * rated * rated;
            for (load, part, direction) in loads {
                let looks = (part * seconds * LOOKS_HZ).round();
                let now = current(&plate, load * rated, direction);
                for _ in 0..looks as usize {
                    heat.step(&heat_config, now, TURNING);
                }
                let square = 3.0 * (load * rated).powi(2);
                exact = square + (exact - square) * (-looks / (seconds * LOOKS_HZ)).exp();
                let got = f64::from(heat.winding.squares()) / unit;
                // The way a look is rounded to 2^-32, a current to 2^-20 A, and the closed form is of a continuous time:
                // half a look in the time constant.
                let allowed = 3.0 * rated * rated * (2e-4 + 4.0 / (seconds * LOOKS_HZ));
                prop_assert!((got - exact).abs() < allowed, "heat {got} A^2, expected {exact} A^2 within {allowed}");
            }
        }

        /// The time to the rated heat is that of IEC 60255-149, hot (from the starting heat).
        #[test]
        fn the_time_is_the_relays(load in 1.2..2.0f64, seconds in 2.0..30.0f64) {
            let plate = with(ThermalPlate { rated_rms_a: 1.2, seconds });
            let config = config(&plate).winding;
            let heat_config = HeatConfig { winding: config, bridge: config, turning: 0 };
            let mut heat = Heat::starting(&heat_config);
            let now = current(&plate, 1.2 * load, 0.3);
            let looks = (1..10_000_000u32).find(|_| {
                heat.step(&heat_config, now, TURNING);
                heat.winding.squares() >= config.rated
            });
            let expected = seconds * ((load * load - 0.8) / (load * load - 1.0)).ln();
            let got = f64::from(looks.unwrap_or(0)) / LOOKS_HZ;
            prop_assert!((got / expected - 1.0).abs() < 0.01, "{got} s at {load} of the rated current, expected {expected} s");
        }

        /// Whatever is asked, a current that obeys the fold-back never trips, turning or standing, and settles at what
        /// may flow without end: the rated current, or at a standstill the one whose worst phase is not hotter than that.
        #[test]
        fn a_current_that_is_folded_back_never_trips(asked in 0.5..2.0f64, stands in any::<bool>()) {
            let plate = with(ThermalPlate { rated_rms_a: 1.3, seconds: 1.0 });
            let config = config(&plate);
            let mut heat = Heat::starting(&config);
            let i_max = plate.config().unwrap().speed_loops[0].i_max;
            let wanted = Current::from_num(asked * 1.3 * 3f64.sqrt()).min(i_max);
            let mut flows = wanted;
            let scale = plate.motors[0].current_loop(&plate).unwrap().sense.scale;
            for _ in 0..20_000 {
                flows = wanted.min(heat.current_max(&config));
                let q = scale.scaled(flows);
                let vector = DirectQuadrature { d: ScaledCurrent(0), q };
                heat.step(&config, vector, if stands { 0 } else { TURNING });
                prop_assert!(!heat.trips(&config), "tripped at {flows} A");
            }
            let rated = 1.3 * 3f64.sqrt();
            let forever = if stands { rated * 0.74 } else { rated * 1.001 };
            let flows = flows.to_num::<f64>();
            prop_assert!(flows <= forever, "{flows} A flow for ever, allowed are {forever} A");
            let least = forever.min(asked * rated) * 0.95;
            prop_assert!(flows >= least, "{flows} A are left of {least} A");
        }

        /// A debug build panics where a sum would leave its word.
        #[test]
        fn no_current_overflows(
            loads in prop::collection::vec((any::<i32>(), any::<i32>(), any::<i32>()), 1..200),
        ) {
            // As fast as can be.
            let plate = with(ThermalPlate { rated_rms_a: 1.3, seconds: 0.1 });
            let config = config(&plate);
            let mut heat = Heat::starting(&config);
            for (d, q, step) in loads {
                // The ADC's range leaves currents within 0.87 * 2^30.
                let vector = DirectQuadrature { d: ScaledCurrent(d / 3), q: ScaledCurrent(q / 3) };
                heat.step(&config, vector, step);
                let _ = (heat.current_max(&config), heat.trips(&config));
            }
        }
    }

    /// A current that does not obey is a fault, and the heat goes away with the time constant.
    #[test]
    fn a_current_that_is_not_folded_back_is_a_fault() {
        let plate = with(ThermalPlate {
            rated_rms_a: 1.3,
            seconds: 2.0,
        });
        let config = config(&plate);
        let mut heat = Heat::starting(&config);
        let locked = current(&plate, 1.3 * 1.2, 0.0);
        let looks = (1..100_000u32)
            .find(|_| {
                heat.step(&config, locked, 0);
                heat.trips(&config)
            })
            .unwrap();
        // Twice the square, from 0.8 to 1.1025.
        let (from, square): (f64, f64) = (0.8, 2.0 * 1.44);
        let expected = 2.0 * ((square - from) / (square - 1.1025)).ln();
        let got = f64::from(looks) / LOOKS_HZ;
        assert!(
            (got / expected - 1.0).abs() < 0.02,
            "tripped after {got} s, expected {expected} s"
        );
        assert!(heat.current_max(&config) < Current::from_num(1.3 * 1.75));
        for _ in 0..(4.0 * 2.0 * LOOKS_HZ) as usize {
            heat.step(&config, current(&plate, 0.0, 0.0), 0);
        }
        assert!(!heat.trips(&config));
    }
}
