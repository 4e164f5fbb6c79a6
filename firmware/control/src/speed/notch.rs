//! A notch at the axial mode: the current that a speed loop asks does not shake the table at its own frequency.
//!
//! `(s^2 + 2 zn w s + w^2) / (s^2 + 2 zd w s + w^2)` by the bilinear transform with its frequency prewarped (Franklin, Powell and
//! Workman, "Digital Control of Dynamic Systems", 3rd ed., 6.1), so that the notch is where it is asked, and 1 at rest; in direct
//! form I, whose state is what came and went. A step's sum is kept in 64 bits and rounded down once: off by
//! 2^-20 A over `1 + a1 + a2` at most.

use crate::base::format::{Current, Ratio};

/// Configuration of a notch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotchConfig {
    /// There is one.
    pub active: bool,
    /// Of the present input and the two before.
    pub b: [Ratio; 3],
    /// Less, of the two outputs before.
    pub a: [Ratio; 2],
}

/// State of a notch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notch {
    inputs: [i32; 2],
    outputs: [i32; 2],
}

/// Currents are cut to half of their format: a notch's coefficients are within 1, 2, 1 and 2, 1, so a sum is within 7 * 2^60.
const END: i32 = 1 << 30;

impl Notch {
    /// One at rest.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            inputs: [0; 2],
            outputs: [0; 2],
        }
    }

    /// A step.
    #[inline(always)]
    pub fn step(&mut self, config: &NotchConfig, current: Current) -> Current {
        let ([b0, b1, b2], [a1, a2]) = (config.b, config.a);
        let ([x1, x2], [y1, y2]) = (self.inputs, self.outputs);
        let x = current.to_bits().clamp(-END, END);
        let times = |k: Ratio, x: i32| i64::from(k.to_bits()).wrapping_mul(x.into());
        let sum = times(b0, x)
            .wrapping_add(times(b1, x1))
            .wrapping_add(times(b2, x2))
            .wrapping_sub(times(a1, y1))
            .wrapping_sub(times(a2, y2));
        const LIMIT: i64 = END as i64;
        #[allow(clippy::cast_possible_truncation)]
        let y = (sum >> Ratio::FRAC_NBITS).clamp(-LIMIT, LIMIT) as i32;
        (self.inputs, self.outputs) = ([x, x1], [y, y1]);
        Current::from_bits(y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{NotchPlate, RejectionPlate, test_plate};
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn config(notch: NotchPlate) -> (NotchConfig, f64) {
        let mut plate = test_plate();
        plate.rejection = RejectionPlate {
            notch,
            ..RejectionPlate::NONE
        };
        (plate.config().unwrap().notch, plate.speed_step())
    }

    proptest! {
        /// A sine through it, against the transfer function at the frequency that the bilinear transform makes of the sine's.
        #[test]
        fn a_sine_is_what_the_transfer_function_makes_of_it(
            hz in 60.0..900.0f64, damping in 0.1..1.0f64, depth in 0.0..0.9f64, at in 0.02..2.0f64,
        ) {
            let sine_hz = hz * at;
            let (config, step) = config(NotchPlate { hz, damping, depth });
            let tan = |hz: f64| (std::f64::consts::PI * hz * step).tan();
            let x = tan(sine_hz) / tan(hz);
            let part = |z: f64| (1.0 - x * x).hypot(2.0 * z * x);
            let expected = part(damping * depth) / part(damping);
            let mut notch = Notch::new();
            let (mut re, mut im, mut count) = (0.0, 0.0, 0.0);
            let amps = 3.0;
            // Whole periods after what the poles ring.
            let settle = (40.0 / (TAU * hz * damping.min(1.0) * 0.5) / step) as u32 + 200;
            let periods = (2000.0 * step * sine_hz).ceil();
            let steps = (periods / sine_hz / step).round() as u32;
            for k in 0..settle + steps {
                let angle = TAU * sine_hz * f64::from(k) * step;
                let out = notch.step(&config, Current::from_num(amps * angle.cos())).to_num::<f64>();
                if k >= settle {
                    (re, im, count) = (re + out * angle.cos(), im + out * angle.sin(), count + 1.0);
                }
            }
            let got = 2.0 * f64::hypot(re, im) / count / amps;
            prop_assert!((got - expected).abs() < 0.02, "{got} of a sine of {sine_hz} Hz, expected {expected}");
        }

        #[test]
        fn no_input_overflows(
            inputs in prop::collection::vec(any::<i32>(), 1..200), hz in 10.0..2000.0f64, damping in 0.05..1.0f64,
        ) {
            let (config, _) = config(NotchPlate { hz, damping, depth: 0.0 });
            let mut notch = Notch::new();
            for bits in inputs {
                notch.step(&config, Current::from_bits(bits));
            }
        }
    }

    #[test]
    fn what_stands_passes() {
        let (config, _) = config(NotchPlate {
            hz: 503.0,
            damping: 0.5,
            depth: 0.1,
        });
        let mut notch = Notch::new();
        let asked = Current::from_num(1.25);
        let last = (0..500).fold(Current::ZERO, |_, _| notch.step(&config, asked));
        let off = (last - asked).to_num::<f64>().abs();
        assert!(off < 1e-5, "{last} A of {asked} A, expected within 1e-5");
    }
}
