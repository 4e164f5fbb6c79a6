//! Encoder counts -> angle and speed, by a tracking observer.
//!
//! A second-order tracking loop (type II): it predicts the angle from its speed, compares it with the encoder,
//! and corrects angle and speed by fixed parts of the difference:
//!
//! `e = theta - (theta_hat + w)`, `theta_hat += w + alpha*e`, `w += beta*e`, with `alpha = 2*zeta*omega_0*T` and
//! `beta = (omega_0*T)^2`, `w` in turns a sample. It follows a constant speed with no lag and a constant
//! acceleration `a` with the angle lag `a / omega_0^2`. With `omega_0 = 1/T` and `zeta = 0.5` it is deadbeat: the
//! speed is then the difference of two angles.

use crate::base::format::{Angle, Ratio, Speed, cut_upper, multiply_upper};

/// A sixteenth of a turn, 2^-32 turn: the largest difference between encoder and prediction that counts.
const JUMP: i32 = 1 << 28;

/// Speeds are held below 1/16 turn a sample, 2^28: no drive commutates on fewer than sixteen samples a turn.
pub(crate) const SPEED_BITS_MAX: u32 = 28;

/// Encoder counts -> angle of the shaft, for any count from 2 to 2^30 a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderScale {
    /// 2^-32 turns of a count, whole ones.
    pub whole: u32,
    /// And the part of one, 2^-32: with it 32 bits or 33 of the quotient.
    pub part: u32,
    /// The count wraps at this value.
    pub counts_per_turn: u32,
}

impl EncoderScale {
    /// The scale of an encoder with `counts_per_turn`; `None` outside 2 to 2^30.
    #[must_use]
    pub const fn new(counts_per_turn: u32) -> Option<Self> {
        if counts_per_turn < 2 || counts_per_turn > 1 << 30 {
            return None;
        }
        let shift = counts_per_turn.saturating_sub(1).ilog2();
        // counts_per_turn > 2^shift, so the quotient is below 2^32.
        #[allow(clippy::arithmetic_side_effects, clippy::cast_possible_truncation)]
        let multiplier = ((1u64 << (32 + shift)) / counts_per_turn as u64) as u32;
        Some(Self {
            whole: multiplier >> shift,
            #[allow(clippy::cast_possible_truncation)]
            part: ((multiplier as u64) << 32u32.saturating_sub(shift)) as u32,
            counts_per_turn,
        })
    }

    /// The shaft's angle at `counts`, low by less than three of its 2^-32 turns. A count of a turn or more, which no
    /// healthy encoder gives, is taken modulo the turn.
    #[must_use]
    #[inline(always)]
    pub fn angle(&self, counts: u32) -> Angle {
        let part = u64::from(counts).wrapping_mul(u64::from(self.part)) >> 32;
        // Dropping the high bits is the modulo.
        #[allow(clippy::cast_possible_truncation)]
        Angle(counts.wrapping_mul(self.whole).wrapping_add(part as u32))
    }
}

/// A factor of more bits than a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WideScale {
    /// Nearest whole number.
    whole: i32,
    /// The rest for the factor, 2^-32.
    part: i32,
}

impl WideScale {
    /// `multiplier`, not negative, over 2^`shift`, 1 to 31.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn new(multiplier: i32, shift: u32) -> Self {
        let wide = (multiplier as i64).wrapping_shl(32u32.saturating_sub(shift));
        Self {
            whole: (wide.saturating_add(1 << 31) >> 32) as i32,
            part: wide as i32,
        }
    }

    /// The factor times `x`, rounded down: two instructions, where a shift by a variable is a dozen.
    #[must_use]
    #[inline(always)]
    pub(crate) fn times(self, x: i32) -> i32 {
        x.wrapping_mul(self.whole)
            .wrapping_add(multiply_upper(x, self.part))
    }
}

/// Configuration of a tracking observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObserverConfig {
    /// Counts to angle.
    pub encoder: EncoderScale,
    /// Part of the difference that corrects the angle, (0, 2).
    pub alpha: Ratio,
    /// Part of the difference that corrects the speed a sample, (0, 2).
    pub beta: Ratio,
    /// How much older than the currents a reading is, samples: the shaft's turning in that time is added to it.
    pub age: Ratio,
    /// Electrical turns a mechanical turn.
    pub pole_pairs: u32,
    /// Speeds are held below this, 2^-32 turn a sample: a power of two, at most 2^[`SPEED_BITS_MAX`], and electrically at most a
    /// quarter turn.
    pub speed_end: i32,
    /// `omega_e` in 2^-16 rad/s = speed in 2^-32 turn a sample times this.
    pub omega_scale: WideScale,
    /// Largest speed within the format of `omega_e`, 2^-32 turn a sample.
    pub step_max: i32,
}

impl ObserverConfig {
    /// The electrical speed of a shaft that turns by `theta_step` a sample, 2^-32 turn: 0.15 mrad/s on 5 pole pairs at 20 kHz.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    #[inline(always)]
    pub fn omega_e(&self, theta_step: i32) -> Speed {
        let step = theta_step
            .min(self.step_max)
            .max(self.step_max.wrapping_neg());
        // |step| <= step_max makes the result fit.
        Speed::from_bits(self.omega_scale.times(step))
    }
}

/// How an encoder lies to its rotor: `theta_e = pole_pairs * (theta, or -theta if it counts backwards) + theta_e_at_zero`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderAlignment {
    /// It counts down while the rotor turns electrically forwards.
    pub reversed: bool,
    /// Electrical angle at count zero.
    pub theta_e_at_zero: Angle,
    /// The count began where the shaft stood, and the index, which will put it to zero, was not yet passed: the first jump
    /// of the count moves `theta_e_at_zero`, and not the rotor.
    pub index_awaited: bool,
}

impl EncoderAlignment {
    /// An angle of the encoder, in the rotor's sense.
    #[must_use]
    pub const fn in_rotor_sense(self, theta: Angle) -> Angle {
        theta.times(self.factor())
    }

    /// The electrical angle at the encoder's angle `theta`.
    #[must_use]
    pub const fn theta_e(self, theta: Angle, pole_pairs: u32) -> Angle {
        self.in_rotor_sense(theta)
            .times(pole_pairs)
            .plus(self.theta_e_at_zero)
    }

    /// What an observer assumes where nothing is known: the default.
    #[must_use]
    pub const fn straight() -> Self {
        Self {
            reversed: false,
            theta_e_at_zero: Angle(0),
            index_awaited: false,
        }
    }

    /// The same after the count has jumped by `jump` 2^-32 turn without the rotor, by its index.
    #[must_use]
    pub const fn past_index(self, jump: i32, pole_pairs: u32) -> Self {
        let jumped = self.in_rotor_sense(Angle(0).turned(jump)).times(pole_pairs);
        Self {
            theta_e_at_zero: Angle(self.theta_e_at_zero.0.wrapping_sub(jumped.0)),
            index_awaited: false,
            ..self
        }
    }

    /// 1, or -1 modulo 2^32.
    const fn factor(self) -> u32 {
        if self.reversed { u32::MAX } else { 1 }
    }
}

/// Angle and speed as the observer knows them, in the rotor's sense.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Mechanical angle of the shaft.
    pub theta: Angle,
    /// Electrical angle.
    pub theta_e: Angle,
    /// Mechanical angle gained each sample, 2^-32 turn: [`ObserverConfig::omega_e`] makes the electrical speed of it.
    pub theta_step: i32,
    /// Electrical angle gained each sample, 2^-32 turn: a quarter turn at most.
    pub theta_e_step: i32,
    /// Encoder minus prediction, 2^-32 mechanical turn: what a stuck or jumping encoder shows first.
    pub innovation: i32,
}

/// State of a tracking observer, with the alignment of its encoder.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    /// What an angle of the encoder is multiplied with: 1 or -1.
    sense: u32,
    theta_e_at_zero: Angle,
    /// Angle. What its sums lose below 2^-32 turn a sample, the next innovation brings back.
    angle: Angle,
    /// Speed, 2^-64 turn a sample.
    speed: i64,
}

impl Observer {
    /// An observer of a shaft that stands at angle 0.
    #[must_use]
    pub const fn new(alignment: EncoderAlignment) -> Self {
        Self {
            sense: alignment.factor(),
            theta_e_at_zero: alignment.theta_e_at_zero,
            angle: Angle(0),
            speed: 0,
        }
    }

    /// An observer of a shaft that stands where `counts` say: the first sample is no jump from somewhere else.
    #[must_use]
    pub fn at(config: &ObserverConfig, alignment: EncoderAlignment, counts: u32) -> Self {
        let angle = config.encoder.angle(counts);
        Self {
            angle: alignment.in_rotor_sense(angle),
            ..Self::new(alignment)
        }
    }

    /// From here on the encoder lies like this. The shaft goes on turning as it did.
    pub fn align(&mut self, alignment: EncoderAlignment) {
        if alignment.factor() != self.sense {
            self.sense = alignment.factor();
            self.angle = Angle(0).turned(Angle(0).minus(self.angle));
            self.speed = self.speed.wrapping_neg();
        }
        self.theta_e_at_zero = alignment.theta_e_at_zero;
    }

    /// Takes back what the last step learned by `innovation` of a count that jumped without the shaft, and goes on from there:
    /// the shaft is at `counts`, and turns as it did. By how much the count jumped, 2^-32 turn of the encoder.
    #[cold]
    pub fn jumped(&mut self, config: &ObserverConfig, innovation: i32, counts: u32) -> i32 {
        let fine = innovation << 2;
        // What was added to it before; a speed that was cut is at its end, which no alignment turns at.
        self.speed = self
            .speed
            .wrapping_sub(i64::from(fine).wrapping_mul(config.beta.to_bits().into()));
        let corrected = multiply_upper(fine, config.alpha.to_bits());
        let predicted = self.angle.turned(corrected.wrapping_neg());
        let turning = gained(config.age, upper(self.speed));
        self.angle = config
            .encoder
            .angle(counts)
            .times(self.sense)
            .turned(turning);
        Angle(0)
            .turned(self.angle.minus(predicted))
            .times(self.sense)
            .minus(Angle(0))
    }

    /// Where the shaft is, in the rotor's sense, and how far it turns in a sample, 2^-32 turn.
    #[must_use]
    pub const fn shaft(&self) -> (Angle, i32) {
        (self.angle, upper(self.speed))
    }

    /// Takes one encoder count and says where the shaft is and how fast it turns.
    #[inline(always)]
    pub fn step(&mut self, config: &ObserverConfig, counts: u32) -> Motion {
        self.follow(config, Some(counts))
    }

    /// As [`Observer::step`], and without a count holds what it predicts.
    #[inline(always)]
    pub fn follow(&mut self, config: &ObserverConfig, counts: Option<u32>) -> Motion {
        let predicted = self.angle.turned(upper(self.speed));
        let measured = counts.map(|counts| {
            let angle = config.encoder.angle(counts).times(self.sense);
            angle.turned(gained(config.age, upper(self.speed)))
        });
        // A difference of more than a sixteenth of a turn, the fastest speed, is no difference but a jump; cut, it fits
        // its word in 2^-34 turn, which makes its products with the gains 2^-64 turn.
        let innovation = measured.map_or(0, |measured| {
            measured.minus(predicted).clamp(-JUMP, JUMP - 1)
        });
        let fine = innovation << 2;
        self.angle = predicted.turned(multiply_upper(fine, config.alpha.to_bits()));
        // |speed| <= 2^60 + 2^32 and the correction is within 2^61, so the sum fits.
        #[allow(clippy::arithmetic_side_effects)]
        let speed = self.speed + i64::from(fine) * i64::from(config.beta.to_bits());
        self.speed = cut_upper(speed, config.speed_end);

        Motion {
            innovation,
            ..self.motion(config)
        }
    }

    /// Where the shaft is and how fast it turns, as it is known without another count.
    #[inline(always)]
    #[must_use]
    pub fn motion(&self, config: &ObserverConfig) -> Motion {
        let (theta, theta_step) = (self.angle, upper(self.speed));
        Motion {
            theta,
            theta_e: theta.times(config.pole_pairs).plus(self.theta_e_at_zero),
            theta_step,
            theta_e_step: theta_step.wrapping_mul(config.pole_pairs.cast_signed()),
            innovation: 0,
        }
    }
}

/// A speed in 2^-32 turn a sample: it is within 2^60, so its upper word is 29 bits.
#[allow(clippy::cast_possible_truncation)]
#[inline(always)]
const fn upper(speed: i64) -> i32 {
    (speed >> 32) as i32
}

/// What a shaft that turns by `theta_step` a sample turns in a reading's `age`.
#[inline(always)]
fn gained(age: Ratio, theta_step: i32) -> i32 {
    // Below 2^28 a sample and below two samples: the product's upper word is in 2^-30 turn.
    multiply_upper(theta_step, age.to_bits()) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    fn config(counts_per_turn: u32) -> ObserverConfig {
        let mut plate = test_plate();
        plate.motors[0].encoder.counts_per_turn = counts_per_turn;
        plate.motors[0].current_loop(&plate).unwrap().observer
    }

    proptest! {
        #[test]
        fn every_count_is_its_angle(counts_per_turn in 2u32..=1 << 30, at in 0.0..1.0f64) {
            let scale = EncoderScale::new(counts_per_turn).unwrap();
            let counts = (at * f64::from(counts_per_turn)) as u32;
            let exact = f64::from(counts) / f64::from(counts_per_turn) * 2f64.powi(32);
            let got = f64::from(scale.angle(counts).0);
            prop_assert!(got <= exact && exact - got < 3.0, "{got} for {exact}");
        }

        #[test]
        fn a_constant_speed_is_followed_through_the_wrap(rpm in -6000.0..6000.0f64, start in 0.0..1.0f64) {
            let config = config(1 << 20);
            let counts = |k: i32| {
                let turns: f64 = start + rpm / 60.0 * f64::from(k) * 50e-6;
                (turns.rem_euclid(1.0) * f64::from(1 << 20)) as u32 % (1 << 20)
            };
            let mut observer = Observer::at(&config, EncoderAlignment::default(), counts(0));
            let mut motion = Motion::default();
            for k in 0..1500 {
                motion = observer.step(&config, counts(k));
            }
            let omega_e = rpm / 60.0 * core::f64::consts::TAU * 5.0;
            // One count of quantisation, seen through beta, is beta * 2pi * p / (2^20 * T) rad/s.
            let got = config.omega_e(motion.theta_step).to_num::<f64>();
            prop_assert!((got - omega_e).abs() < 0.005 * omega_e.abs() + 0.1);
        }

        #[test]
        fn agrees_with_the_law_in_floats(
            counts in prop::collection::vec(0u32..1 << 20, 1..120),
            alpha in 0.01..1.0f64,
            part in 0.01..1.0f64,
        ) {
            let (alpha, beta) = (Ratio::from_num(alpha), Ratio::from_num(part * alpha * alpha));
            let config = ObserverConfig { alpha, beta, ..config(1 << 20) };
            let (alpha, beta) = (alpha.to_num::<f64>(), beta.to_num::<f64>());
            let mut observer = Observer::at(&config, EncoderAlignment::default(), counts[0]);
            for count in counts {
                // Each step from the observer's own state: while jumps are cut nothing corrects, and two observers that
                // differ by a rounding part.
                let (mut angle, mut speed) = (f64::from(observer.angle.0) / 2f64.powi(32), observer.speed as f64 / 2f64.powi(64));
                let motion = observer.step(&config, count);
                let predicted = angle + speed;
                let error = f64::from(count) / f64::from(1 << 20) - predicted;
                // A jump of half a turn has no short way round.
                prop_assume!((error - error.floor() - 0.5).abs() > 1e-4);
                // And one of more than a sixteenth is taken as a sixteenth.
                let error = (error - error.round()).clamp(-1.0 / 16.0, 1.0 / 16.0);
                angle = predicted + alpha * error;
                let end = f64::from(config.speed_end) / 2f64.powi(32);
                speed = (speed + beta * error).clamp(-end, end);
                let omega_e = speed * core::f64::consts::TAU * 5.0 / 50e-6;
                let off = f64::from(motion.theta.0) / 2f64.powi(32) - angle;
                prop_assert!((off - off.round()).abs() < 1e-6, "angle off by {off}");
                let end = f64::from(config.step_max) / 2f64.powi(32) * core::f64::consts::TAU * 5.0 / 50e-6;
                let exact = omega_e.clamp(-end, end);
                let got = config.omega_e(motion.theta_step).to_num::<f64>();
                prop_assert!((got - exact).abs() < 0.02 + 1e-6 * exact.abs());
            }
        }

        #[test]
        fn no_input_overflows(counts in prop::collection::vec(any::<u32>(), 1..200), alpha in any::<i32>(), beta in any::<i32>()) {
            let config = ObserverConfig {
                alpha: Ratio::from_bits(alpha),
                beta: Ratio::from_bits(beta),
                ..config(1 << 23)
            };
            let mut observer = Observer::new(EncoderAlignment::default());
            for count in counts {
                let motion = observer.step(&config, count);
                prop_assert!(observer.speed.abs() <= 1 << 60);
                prop_assert!(motion.theta_e_step.abs() <= 1 << 30, "a quarter turn");
                let _ = config.omega_e(motion.theta_step);
            }
        }
    }

    #[test]
    fn the_electrical_angle_counts_from_the_encoder_s_zero() {
        for (reversed, turns) in [(false, 0.25), (true, -0.25)] {
            let mut plate = test_plate();
            plate.motors[0].encoder.theta_e_at_zero_turns = 0.3;
            plate.motors[0].encoder.reversed = Some(reversed);
            let config = plate.motors[0].current_loop(&plate).unwrap();
            let (alignment, config) = (plate.motors[0].encoder.alignment(), config.observer);
            // A quarter turn of the shaft is one and a quarter electrical turns at five pole pairs.
            let expected = Angle::from_turns(turns * 5.0 + 0.3);
            let mut observer = Observer::at(&config, alignment, 1 << 18);
            let motion = observer.step(&config, 1 << 18);
            assert!(motion.theta_e.minus(expected).abs() < 16, "{motion:?}");
            let theta = config.encoder.angle(1 << 18);
            let off = alignment.theta_e(theta, config.pole_pairs).minus(expected);
            assert!(off.abs() < 16, "{off}");
            // Aligned later, it goes on where it was.
            let mut late = Observer::at(&config, EncoderAlignment::default(), 1 << 18);
            late.align(alignment);
            assert_eq!(late.step(&config, 1 << 18), motion);
        }
    }

    #[test]
    fn a_reading_that_is_older_than_the_currents_is_brought_forward() {
        let age = 0.11;
        let mut config = config(1 << 21);
        config.age = Ratio::from_num(age);
        let turns = |k: f64| 3000.0 / 60.0 * k * 50e-6;
        let at = |k: f64| (turns(k).rem_euclid(1.0) * f64::from(1 << 21)) as u32 % (1 << 21);
        let mut observer = Observer::at(&config, EncoderAlignment::default(), at(0.0));
        let theta = |observer: &mut Observer, k: u32, counts| {
            let motion = observer.follow(&config, counts);
            let off = f64::from(motion.theta.0) / 2f64.powi(32) - turns(f64::from(k));
            off - off.round()
        };
        let mut off = 1.0;
        for k in 0..4000 {
            off = theta(&mut observer, k, Some(at(f64::from(k) - age)));
        }
        assert!(off.abs() < 1e-6, "{off} turns off");
        // Without readings the angle runs on with the speed.
        for k in 4000..4008 {
            off = theta(&mut observer, k, None);
        }
        assert!(off.abs() < 2e-5, "{off} turns off after eight periods");
    }

    #[test]
    fn bounds_of_the_resolution() {
        assert!(EncoderScale::new(1).is_none());
        assert!(EncoderScale::new((1 << 30) + 1).is_none());
        for bits in 1..=30 {
            assert_eq!(
                EncoderScale::new(1 << bits).unwrap().angle(1).0,
                (1u32 << (32 - bits))
            );
        }
    }

    #[test]
    fn deadbeat_speed_is_the_difference_of_two_angles() {
        let config = ObserverConfig {
            alpha: Ratio::ONE,
            beta: Ratio::ONE,
            ..config(1 << 20)
        };
        let mut observer = Observer::at(&config, EncoderAlignment::default(), 100);
        observer.step(&config, 150);
        let motion = observer.step(&config, 210);
        let exact = 60.0 / f64::from(1 << 20) * core::f64::consts::TAU * 5.0 / 50e-6;
        let got = config.omega_e(motion.theta_step).to_num::<f64>();
        assert!((got / exact - 1.0).abs() < 1e-4);
    }
}
