//! The timers' input filters: how long a level must last to be counted, from how close an encoder's edges can be.

use crate::hw::clock::CORE_HZ;
use control::format::Misfit;
use control::plate::{FeedPlate, MotorPlate};

/// Lengths of the timers' filters by code, from code 1, counts of the timer's clock: N samples at the clock or at a part of
/// it (RM0440 29.6.20 for BKF, 30.5.8 for ICxF, which has the same; CKD 0).
pub(crate) const LENGTHS: [u32; 15] = [2, 4, 8, 12, 16, 24, 32, 48, 64, 80, 96, 128, 160, 192, 256];

/// The code of an encoder's filter.
#[derive(Clone, Copy)]
pub(crate) struct InputFilter(pub(crate) u32);

impl InputFilter {
    /// Whether a filter passes counts as fast as that.
    ///
    /// # Errors
    /// [`Misfit`] with the fastest.
    pub(crate) const fn passes(counts_per_s: f64) -> Result<(), Misfit> {
        let below = CORE_HZ as f64 / (3.0 * LENGTHS[0] as f64);
        if counts_per_s > 0.0 && counts_per_s <= below {
            return Ok(());
        }
        Err(Misfit {
            name: "counts that a timer's filter passes",
            unit: "1/s",
            value: counts_per_s,
            least: 0.0,
            below,
        })
    }

    /// The longest within a third of the time of a count, which is how near two edges come with a quadrature error of 60
    /// electrical degrees. Fails to compile, in a constant, if counts come faster than any filter passes.
    const fn at(counts_per_s: f64) -> Self {
        assert!(
            Self::passes(counts_per_s).is_ok(),
            "edges so close are no encoder's: 28 MHz is the most that a timer counts through a filter"
        );
        let gap = CORE_HZ as f64 / counts_per_s / 3.0;
        let mut code = 1;
        while code < 15 && LENGTHS[code] as f64 <= gap {
            code += 1;
        }
        Self(code as u32)
    }

    /// Of a motor's encoder at the motor's top speed.
    pub(crate) const fn of_motor(motor: &MotorPlate) -> Self {
        Self::at(motor.speed_max_rpm / 60.0 * motor.encoder.counts_per_turn as f64)
    }

    /// Of the table's scale at the table's top velocity.
    pub(crate) const fn of_scale(feed: &FeedPlate) -> Self {
        Self::at(feed.velocity_max / feed.scale_count_m)
    }

    /// In both channels of `TIMx_CCMR1` as inputs: CC1S and CC2S 1, IC1F, IC2F.
    pub(crate) const fn both_channels(self) -> u32 {
        0x0101 | self.0 << 4 | self.0 << 12
    }
}
