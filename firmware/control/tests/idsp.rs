//! The mathematics of the vector control against `idsp`, signal processing for microcontrollers that is not ours.
//!
//! Each tolerance is the sum of what the two say of themselves; where they differ by more, one of them is wrong.

use control::format::{Angle, Gain, Ratio, ScaledCurrent, Voltage, square_root};
use control::observer::{EncoderAlignment, EncoderScale, Observer, ObserverConfig, WideScale};
use control::regulator::{Circle, Induced, Regulator, RegulatorConfig, limit};
use control::transform::{AlphaBeta, DirectQuadrature, Rotation};
use dsp_process::SplitProcess;
use idsp::iir::{Biquad, DirectForm1, pid};
use idsp::{Build, Complex, PLL, PLLState, cossin};
use proptest::prelude::*;
use std::num::Wrapping;

/// Of a cosine or sine: ours is within 9.5e-6, `idsp`'s within 9e-6.
const SINE: f64 = 18.5e-6;
/// What `idsp`'s cosine has for 1, by its own tests.
const ONE: f64 = 2_147_483_648.0 - 0.85 * 32_768.0;

/// `idsp`'s unit vector at an angle.
fn unit(turn: u32) -> Complex<f64> {
    let (cos, sin) = cossin(turn.cast_signed());
    Complex::new(f64::from(cos) / ONE, f64::from(sin) / ONE)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn sine_and_cosine(turn in any::<u32>()) {
        let (cos, sin) = Angle(turn).cos_sin();
        let theirs = unit(turn);
        let off = (cos.to_num::<f64>() - theirs.re()).abs().max((sin.to_num::<f64>() - theirs.im()).abs());
        prop_assert!(off < SINE, "at {turn}: ours {cos}, {sin}; idsp {theirs:?}; off {off:e}, allowed {SINE:e}");
    }

    #[test]
    fn park_and_its_inverse(a in -1400.0..1400.0f64, b in -1400.0..1400.0f64, turn in any::<u32>()) {
        let (vector, unit) = (Complex::new(a, b), unit(turn));
        // Two components of up to 1400, each times a cosine that may be off.
        let allowed = 2.0 * 1400.0 * SINE;

        let bits = |x: f64| (x * 2f64.powi(18)) as i32;
        let ours = Rotation::new(Angle(turn)).park(AlphaBeta { alpha: bits(a), beta: bits(b) });
        let theirs = vector * unit.conj();
        let amperes = |x: ScaledCurrent| f64::from(x.0) / 2f64.powi(17);
        let off = (amperes(ours.d) - theirs.re()).abs().max((amperes(ours.q) - theirs.im()).abs());
        prop_assert!(off < allowed, "Park: ours {ours:?}; idsp {theirs:?}; off {off:e}, allowed {allowed:e}");

        let x = DirectQuadrature { d: Voltage::from_num(a), q: Voltage::from_num(b) };
        let ours = Rotation::new(Angle(turn)).inverse_park(x);
        let theirs = vector * unit;
        let off = (ours.alpha.to_num::<f64>() - theirs.re()).abs().max((ours.beta.to_num::<f64>() - theirs.im()).abs());
        prop_assert!(off < allowed, "inverse Park: ours {ours:?}; idsp {theirs:?}; off {off:e}, allowed {allowed:e}");
    }

    /// The root of a length's square, whose square `idsp` makes: ours has 16 significant bits and is rounded down.
    #[test]
    fn square_root_of_a_length(x in any::<i16>(), y in any::<i32>()) {
        let square = Complex::new(i32::from(x) << 14, y >> 1).norm_sqr();
        let root = i128::from(square_root(square.cast_unsigned()));
        let above = root + (root >> 15) + 1;
        prop_assert!(root * root <= i128::from(square) && i128::from(square) < above * above, "root {root} of {square}");
    }

    /// The voltage circle: the residual is no longer than the radius by `idsp`'s square, within a part in 2^15, and
    /// what was within it is left as it is.
    #[test]
    fn a_vector_is_cut_to_the_circle(d in any::<i32>(), q in any::<i32>(), radius in 0..=i32::MAX >> 2) {
        let wanted = DirectQuadrature { d: Voltage::from_bits(d >> 2), q: Voltage::from_bits(q >> 2) };
        let left = limit(wanted, Voltage::from_bits(radius));
        let square = |v: DirectQuadrature<Voltage>| Complex::new(v.d.to_bits(), v.q.to_bits()).norm_sqr();
        let most = i64::from(radius) * i64::from(radius);
        prop_assert!(square(left) <= most, "{left:?} of {wanted:?} is longer than {radius}");
        if square(wanted) < most - (most >> 14) {
            prop_assert_eq!(left, wanted, "within the circle of {}", radius);
        } else {
            // d has all it wants; q gets the rest, down to the root's sixteen bits.
            let short = most - square(left);
            let cut_in_d = left.d.to_bits().abs() == radius;
            prop_assert!(cut_in_d || left == wanted || short <= (most >> 14) + 1, "{left:?} of {wanted:?}: {short} short of {most}");
        }
    }

    /// The PI law. Ours gives out the integral before it adds the error, `idsp`'s after, so that its proportional gain is
    /// ours less the integral one.
    #[test]
    fn proportional_and_integral(
        p in 1 << 20..1 << 30,
        i in 1 << 14..1 << 24,
        errors in prop::collection::vec(-(1i32 << 24)..1 << 24, 1..200),
    ) {
        let gain = |multiplier| Gain { multiplier, shift: 0 };
        let config = RegulatorConfig {
            k_pc: gain(p),
            k_ic_step: gain(i),
            induced: Induced { inductance: 0, flux: 0, shift: 0 },
        };
        let [kp, ki] = [p, i].map(|multiplier: i32| f64::from(multiplier) / 2f64.powi(32));
        let law: Biquad<f64> = pid::Builder::default().kp(kp - ki).ki(ki).build(&1.0);
        let (mut ours, mut theirs) = (Regulator::new(), [0, 1].map(|_| DirectForm1::default()));
        for (k, &error) in errors.iter().enumerate() {
            let zero = DirectQuadrature { d: ScaledCurrent(0), q: ScaledCurrent(0) };
            let reference = DirectQuadrature { d: ScaledCurrent(-error), q: ScaledCurrent(error) };
            let wide = || Circle { radius: Voltage::MAX, square: u32::MAX };
            let out = ours.step(&config, reference, zero, 0, wide);
            let [d, q] = [-error, error].map(f64::from);
            let expected = [law.process(&mut theirs[0], d), law.process(&mut theirs[1], q)];
            let off = (f64::from(out.voltage.d.to_bits()) - expected[0])
                .abs()
                .max((f64::from(out.voltage.q.to_bits()) - expected[1]).abs());
            // Each product drops less than a step.
            let allowed = k as f64 + 2.0;
            prop_assert!(!out.limited && off < allowed, "step {k}: ours {:?}; idsp {expected:?}; off {off}, allowed {allowed}", out.voltage);
        }
    }
}

/// Two loops of different order, both without lag at a constant speed, that follow one turning shaft.
#[test]
fn the_observer_finds_the_speed_that_a_phase_locked_loop_finds() {
    const COUNTS: u32 = 1 << 30;
    let config = ObserverConfig {
        encoder: EncoderScale::new(COUNTS).expect("a possible encoder"),
        alpha: Ratio::from_num(0.1),
        beta: Ratio::from_num(0.005),
        age: Ratio::ZERO,
        pole_pairs: 1,
        speed_end: 1 << 28,
        omega_scale: WideScale::new(1, 1),
        step_max: i32::MAX,
    };
    let pll = PLL::from_bandwidth(1e-2, 4.0);
    for speed in [0i32, 1 << 12, -(1 << 16), 12_345_678, -(1 << 26)] {
        let (mut observer, mut state) = (
            Observer::new(EncoderAlignment::straight()),
            PLLState::default(),
        );
        let mut found = (0, Wrapping(0));
        for k in 0..20_000i32 {
            let theta = speed.wrapping_mul(k).cast_unsigned();
            found.0 = observer.step(&config, theta >> 2).theta_step;
            pll.process(&mut state, Wrapping(theta.cast_signed()));
            // It settles to the complement.
            found.1 = -state.frequency();
        }
        for (name, found) in [("observer", found.0), ("idsp's loop", found.1.0)] {
            // The encoder has steps of 4; the loops' bandwidths leave a part of one.
            assert!(
                (found - speed).abs() <= 4,
                "{name} finds {found} at {speed} * 2^-32 turn a sample, allowed 4 off"
            );
        }
    }
}
