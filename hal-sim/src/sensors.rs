//! What measures the machine: resolution, range, noise.

use crate::mt6835;
use control::encoder::Interface;
use control::plate::EncoderPlate;
use plant::Axis;
use plant::model::{COMMON_SCALE_PERIOD_M, EncoderKind, Model, SensingModel};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

/// An analogue-to-digital converter with what stands before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adc {
    /// Counts of its range; readings are 0 to `counts - 1`.
    pub counts: u32,
    /// Units (A or V) of one count; negative where the count falls with the value.
    pub per_count: f64,
    /// Counts at zero.
    pub zero: f64,
    /// Standard deviation of its noise, counts.
    pub noise: f64,
}

impl Adc {
    /// A bipolar converter of `bits` bits over ±`range`.
    #[must_use]
    pub fn bipolar(bits: u32, range: f64, noise_counts: f64) -> Self {
        let counts = 1u32 << bits;
        Self {
            counts,
            per_count: 2.0 * range / f64::from(counts),
            zero: f64::from(counts) / 2.0,
            noise: noise_counts,
        }
    }

    /// A unipolar converter of `bits` bits over 0 to `range`.
    #[must_use]
    pub fn unipolar(bits: u32, range: f64, noise_counts: f64) -> Self {
        let counts = 1u32 << bits;
        Self {
            counts,
            per_count: range / f64::from(counts),
            zero: 0.0,
            noise: noise_counts,
        }
    }

    /// One conversion of `value`: rounded, and cut at the ends of the range.
    #[inline]
    pub fn convert(&self, value: f64, random: &mut Xoshiro256PlusPlus) -> u16 {
        let noise = if self.noise > 0.0 {
            let unit: f64 = StandardNormal.sample(random);
            unit * self.noise
        } else {
            0.0
        };
        let counts = value / self.per_count + self.zero + noise;
        // A float-to-integer cast saturates, and makes 0 of NaN.
        (counts + 0.5).clamp(0.0, f64::from(self.counts - 1)) as u16
    }
}

/// Where the phase currents are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurrentSensing {
    /// In the motor's lines: always.
    #[default]
    InLine,
    /// Under the low sides: only what flows there.
    LowSide,
}

/// What conducts in one phase of a bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leg {
    /// The low side is closed.
    Low,
    /// The high side is closed.
    High,
    /// Neither: the current goes on through a diode, into the motor through the lower one, out of it through the upper.
    Open,
}

impl CurrentSensing {
    /// What the sensor of a phase sees of a current into the motor, A.
    #[must_use]
    #[inline]
    pub fn seen(self, amps: f64, leg: Leg) -> f64 {
        match (self, leg) {
            (Self::InLine, _) | (Self::LowSide, Leg::Low) => amps,
            (Self::LowSide, Leg::High) => 0.0,
            (Self::LowSide, Leg::Open) => amps.max(0.0),
        }
    }
}

/// The sensors of both motors and of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    /// Motor encoders: screw, nut.
    pub encoders: [EncoderPlate; 2],
    /// Phase currents.
    pub current: Adc,
    /// Bus voltage.
    pub bus: Adc,
    /// One count of the table's scale, m.
    pub scale_count_m: f64,
    /// Standard deviation of the scale's noise, m.
    pub scale_noise_m: f64,
    /// Amplitude of the scale's error that repeats with its period, m.
    pub scale_error_m: f64,
    /// Period of that error along the travel, m.
    pub scale_period_m: f64,
    /// Standard deviation of the instant at which an encoder's angle is taken, s.
    pub encoder_jitter_s: f64,
}

/// The supply of a board that nothing else is said of, V.
pub(crate) const BUS_V: f64 = 310.0;
/// Full scale of the bus divider, of the supply: what regeneration lifts it to is below it.
const BUS_RANGE: f64 = 450.0 / BUS_V;

impl Sensors {
    /// So fine that they add nothing: 30-bit encoders, 16-bit converters without noise.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            encoders: incremental(1 << 30),
            current: Adc::bipolar(16, 5.0, 0.0),
            bus: Adc::unipolar(16, BUS_RANGE * BUS_V, 0.0),
            scale_count_m: 1e-12,
            scale_noise_m: 0.0,
            scale_error_m: 0.0,
            scale_period_m: COMMON_SCALE_PERIOD_M,
            encoder_jitter_s: 0.0,
        }
    }

    /// A good drive's: 20-bit encoders, 12-bit converters over ±5 A with half a count of noise.
    #[must_use]
    pub fn real() -> Self {
        Self {
            encoders: incremental(1 << 20),
            current: Adc::bipolar(12, 5.0, 0.5),
            bus: Adc::unipolar(12, BUS_RANGE * BUS_V, 0.5),
            scale_count_m: 1e-9,
            scale_noise_m: 1e-9,
            ..Self::ideal()
        }
    }

    /// What a model file says of them, beside rates.
    #[must_use]
    pub fn described(&self, rates: SensingModel) -> SensingModel {
        let [screw, nut] = &self.encoders;
        let kind = |encoder: &EncoderPlate| match encoder.interface {
            Interface::Incremental => EncoderKind::Incremental,
            Interface::IncrementalWithIndex => EncoderKind::Index,
            Interface::Mt6835 => EncoderKind::Absolute,
        };
        SensingModel {
            encoder_counts_per_turn: screw.counts_per_turn,
            encoder: kind(screw),
            nut_encoder_counts_per_turn: Some(nut.counts_per_turn)
                .filter(|counts| *counts != screw.counts_per_turn),
            nut_encoder: Some(kind(nut)).filter(|nut| *nut != kind(screw)),
            current_lsb_a: self.current.per_count.abs(),
            current_noise_a: self.current.noise * self.current.per_count.abs(),
            table_noise_m: self.scale_noise_m,
            table_error_m: self.scale_error_m,
            table_error_period_m: self.scale_period_m,
            encoder_jitter_s: self.encoder_jitter_s,
            ..rates
        }
    }

    /// What a model file declares. Its current count sets the range of a 12-bit converter, its supply that of the bus divider.
    #[must_use]
    pub fn declared(model: &Model) -> Self {
        let (sensing, installation) = (&model.sensing, &model.installation);
        let encoder = |axis| {
            let [encoder, _] = incremental(sensing.counts_per_turn(axis));
            let interface = match sensing.encoder_kind(axis) {
                EncoderKind::Incremental => Interface::Incremental,
                EncoderKind::Index => Interface::IncrementalWithIndex,
                EncoderKind::Absolute => Interface::Mt6835,
            };
            EncoderPlate {
                interface,
                ..encoder
            }
        };
        let current = if sensing.current_lsb_a > 0.0 {
            Adc::bipolar(
                12,
                sensing.current_lsb_a * 2048.0,
                sensing.current_noise_a / sensing.current_lsb_a,
            )
        } else {
            Self::ideal().current
        };
        Self {
            encoders: Axis::ALL.map(encoder),
            current,
            bus: Adc::unipolar(12, BUS_RANGE * installation.bus_v, 0.5),
            scale_count_m: installation.scale_count_m,
            scale_noise_m: sensing.table_noise_m,
            scale_error_m: sensing.table_error_m,
            scale_period_m: sensing.table_error_period_m,
            encoder_jitter_s: sensing.encoder_jitter_s,
        }
    }
}

/// Incremental encoders of that many counts a turn on both motors, aligned with their rotors.
#[must_use]
pub fn incremental(counts_per_turn: u32) -> [EncoderPlate; 2] {
    [EncoderPlate {
        interface: Interface::Incremental,
        counts_per_turn,
        age_s: 0.0,
        theta_e_at_zero_turns: 0.0,
        reversed: Some(false),
    }; 2]
}

/// The raw word of an encoder at a shaft angle, rad.
#[must_use]
#[inline]
pub fn encoder_word(encoder: &EncoderPlate, angle: f64) -> u32 {
    let counts = encoder_counts(angle, encoder.counts_per_turn);
    match encoder.interface {
        Interface::Incremental | Interface::IncrementalWithIndex => counts,
        Interface::Mt6835 => mt6835::frame(counts, 0),
    }
}

/// Encoder counts at a shaft angle in rad, modulo a turn.
#[must_use]
#[inline]
pub fn encoder_counts(angle: f64, counts_per_turn: u32) -> u32 {
    // 1.5 * 2^52: a sum with it is rounded to a whole number. Without SSE4.1, which x86-64 does not promise, `floor` is a call.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let turns = angle / std::f64::consts::TAU;
    let past = turns - ((turns + WHOLE) - WHOLE);
    let fraction = if past < 0.0 { past + 1.0 } else { past };
    let counts = fraction * f64::from(counts_per_turn);
    // A fraction just below one may round up to the whole turn.
    (counts as u32).min(counts_per_turn - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::rand_core::SeedableRng;

    #[test]
    fn a_converter_rounds_saturates_and_survives_nonsense() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let adc = Adc::bipolar(12, 5.0, 0.0);
        let mut counts = |amps| adc.convert(amps, &mut random);
        assert_eq!(counts(0.0), 2048);
        assert_eq!(counts(0.6 * 10.0 / 4096.0), 2049);
        assert_eq!(counts(5.1), 4095);
        assert_eq!(counts(-5.1), 0);
        assert_eq!(counts(f64::NAN), 0);
    }

    #[test]
    fn what_a_model_file_says_of_sensors_makes_the_same_sensors() {
        let real = Sensors::real();
        let mut model = Model::coupled();
        model.sensing = real.described(model.sensing);
        let again = Sensors::declared(&model);
        assert_eq!(again, real);
    }

    #[test]
    fn noise_has_its_standard_deviation() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(2);
        let adc = Adc::bipolar(12, 5.0, 3.0);
        let n = 20_000;
        let squares: f64 = (0..n)
            .map(|_| (f64::from(adc.convert(0.0, &mut random)) - 2048.0).powi(2))
            .sum();
        assert!(
            ((squares / f64::from(n)).sqrt() - 3.0).abs() < 0.1,
            "measured {}, expected {} within {:e}",
            (squares / f64::from(n)).sqrt(),
            3.0,
            0.1
        );
    }

    #[test]
    fn a_low_side_shunt_sees_what_flows_under_its_low_side() {
        let seen = |leg| [2.0, -2.0].map(|amps| CurrentSensing::LowSide.seen(amps, leg));
        assert_eq!(seen(Leg::Low), [2.0, -2.0]);
        assert_eq!(seen(Leg::High), [0.0, 0.0]);
        assert_eq!(seen(Leg::Open), [2.0, 0.0]);
        for leg in [Leg::Low, Leg::High, Leg::Open] {
            assert_eq!(CurrentSensing::InLine.seen(-2.0, leg), -2.0);
        }
    }

    #[test]
    fn an_encoder_wraps_both_ways() {
        let turn = std::f64::consts::TAU;
        for (angle, counts) in [
            (0.0, 0),
            (0.26 * turn, 260),
            (-0.26 * turn, 740),
            (7.0005 * turn, 0),
            (-1e-18, 999),
        ] {
            assert_eq!(encoder_counts(angle, 1000), counts);
        }
    }
}
