//! How large an error usually is, so that a disturbance is not learned: where a load falls, its error is fifty times the ripple's.
//!
//! A ripple may be short pulses, as dead time's is. So its peak counts, and not its mean.

/// An error within this is never cut, 2^-16 rad/s: else one that was nothing for a window would stay so.
const LEAST: i32 = 1 << 10;

/// The usual size of one error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UsualError {
    /// Its peak in this window.
    peak: i32,
    /// What is beyond is cut.
    most: i32,
}

impl UsualError {
    pub(super) const fn new() -> Self {
        Self {
            peak: 0,
            most: i32::MAX,
        }
    }

    /// A window ends. Where speed and load are `settled`, the next one cuts at one and a half of its peak.
    pub(super) fn next_window(&mut self, settled: bool) {
        self.most = if settled {
            // Within 2^25.
            self.peak.wrapping_add(self.peak >> 1).max(LEAST)
        } else {
            i32::MAX
        };
        self.peak = 0;
    }

    /// The error, cut.
    #[inline(always)]
    pub(super) fn cut(&mut self, error: i32) -> i32 {
        let cut = error.min(self.most).max(self.most.wrapping_neg());
        self.peak = self.peak.max(cut.wrapping_abs());
        cut
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ripple passes, also one of short pulses. Of what is larger no more passes than half of its peak more.
    #[test]
    fn a_disturbance_is_not_learned() {
        let mut usual = UsualError::new();
        let ripple = |k: i32| if k % 50 == 0 { 10_000 } else { k % 7 };
        for settled in [false, true, true] {
            assert!((0..500).all(|k| usual.cut(ripple(k)) == ripple(k)));
            usual.next_window(settled);
        }
        for (error, expected) in [(50_000, 15_000), (-50_000, -15_000), (900, 900)] {
            assert_eq!(usual.cut(error), expected);
        }
        usual.next_window(true);
        // After a window without an error it grows again.
        usual.next_window(true);
        assert_eq!(usual.cut(50_000), LEAST);
        usual.next_window(true);
        assert_eq!(usual.cut(50_000), LEAST + LEAST / 2);
        usual.next_window(false);
        assert_eq!(usual.cut(50_000), 50_000);
    }
}
