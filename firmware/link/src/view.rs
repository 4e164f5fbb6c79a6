//! The debug view: words in the drive's RAM that a probe reads while the drive runs.
//!
//! Every word is whole by itself, so nothing has to be halted or locked. Each structure is declared once; of it come the
//! live one of atomics, which the firmware has, and the plain one that a host makes of the words that it read. The order
//! of the words is the order of the fields.

use core::sync::atomic::{AtomicI32, AtomicU32};

/// First word of the view: `DDFV`, little-endian.
pub const MAGIC: u32 = u32::from_le_bytes(*b"DDFV");

/// A kind of word, or a group of them.
pub trait Words {
    /// In the drive's memory.
    type Live;
    /// All zero.
    const ZERO: Self::Live;
    /// Taken from the memory's words, which `next` gives in their order.
    fn take(next: &mut impl FnMut() -> u32) -> Self;
}

impl Words for u32 {
    type Live = AtomicU32;
    #[allow(clippy::declare_interior_mutable_const)]
    const ZERO: AtomicU32 = AtomicU32::new(0);
    fn take(next: &mut impl FnMut() -> u32) -> Self {
        next()
    }
}

impl Words for i32 {
    type Live = AtomicI32;
    #[allow(clippy::declare_interior_mutable_const)]
    const ZERO: AtomicI32 = AtomicI32::new(0);
    fn take(next: &mut impl FnMut() -> u32) -> Self {
        next().cast_signed()
    }
}

impl<W: Words, const N: usize> Words for [W; N] {
    type Live = [W::Live; N];
    const ZERO: [W::Live; N] = [const { W::ZERO }; N];
    fn take(next: &mut impl FnMut() -> u32) -> Self {
        core::array::from_fn(|_| W::take(next))
    }
}

macro_rules! words {
    ($(#[$about:meta])* $live:ident, $plain:ident { $($(#[$doc:meta])* $name:ident: $kind:ty,)* }) => {
        $(#[$about])*
        #[derive(Debug)]
        #[repr(C)]
        pub struct $live {
            $($(#[$doc])* pub $name: <$kind as Words>::Live,)*
        }

        #[doc = concat!("A [`", stringify!($live), "`] as it was read.")]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct $plain {
            $($(#[$doc])* pub $name: $kind,)*
        }

        impl $live {
            /// All zero.
            #[must_use]
            pub const fn zero() -> Self {
                Self { $($name: <$kind as Words>::ZERO,)* }
            }
        }

        impl Words for $plain {
            type Live = $live;
            #[allow(clippy::declare_interior_mutable_const)]
            const ZERO: $live = $live::zero();
            fn take(next: &mut impl FnMut() -> u32) -> Self {
                Self { $($name: <$kind as Words>::take(next),)* }
            }
        }
    };
}
pub(crate) use words;

words! {
    /// One motor, as its current loop saw it in the last millisecond.
    MotorView, MotorWords {
        /// Currents d and q, 2^-20 A.
        current: [i32; 2],
        /// Speed of the shaft, 2^-16 rad/s.
        speed: i32,
        /// The encoder's count within the turn.
        encoder: u32,
        /// Steps of the current loop, one a PWM period.
        steps: u32,
        /// Steps that ended after their period had begun.
        missed: u32,
        /// Cycles of the last step.
        cycles: u32,
        /// Cycles of the longest step.
        cycles_max: u32,
    }
}

words! {
    /// The whole drive.
    DriveView, DriveWords {
        /// [`MAGIC`].
        magic: u32,
        /// [`LAYOUT`](crate::LAYOUT).
        layout: u32,
        /// A [`State`](crate::codes::State).
        state: u32,
        /// A [`Fault`](crate::codes::Fault).
        fault: u32,
        /// A [`ResetReason`](crate::codes::ResetReason).
        reset_reason: u32,
        /// Time since the start, ms.
        uptime_ms: u32,
        /// Steps of the speed task.
        speed_steps: u32,
        /// Times that the speed task was still at work when its next step was due.
        speed_missed: u32,
        /// Cycles of its last step, interruptions included.
        speed_cycles: u32,
        /// Cycles of its longest step, interruptions included.
        speed_cycles_max: u32,
        /// The table's scale, counts.
        scale: i32,
        /// 1: the drive is homed, and the next word is the scale's count at position zero.
        homed: u32,
        /// See above.
        origin: i32,
        /// Heat sinks, ADC counts: screw, nut.
        temperatures: [u32; 2],
        /// The controller's own supply, mV.
        supply: u32,
        /// Commands that were taken.
        taken: u32,
        /// Commands that were refused.
        refused: u32,
        /// Telemetry samples that found no room, since the start.
        telemetry_dropped: u32,
        /// Times that the supervision came a millisecond late or more.
        supervision_missed: u32,
        /// Readings of the motor encoders that were wrong: screw, nut.
        encoder_wrong: [u32; 2],
        /// Missing indices and transition errors of the incremental encoders: screw, nut.
        encoder_errors: [u32; 2],
        /// Bus voltage at the bridges, ADC counts: screw, nut.
        bus: [u32; 2],
        /// Why the last alignment failed: a [`Misalignment`](crate::codes::Misalignment).
        misalignment: u32,
        /// What was found of the tables of compensation that were saved: a [`TableFits`](control::compensation::fit::TableFits).
        tables: u32,
        /// All that was found since the drive last left a fault: a [`FaultSet`](crate::codes::FaultSet).
        latched: [u32; 2],
        /// What limits it, 80 times a second: [`ActiveLimits`](crate::codes::ActiveLimits).
        limits: u32,
        /// Screw, nut.
        motors: [MotorWords; 2],
    }
}

impl DriveView {
    /// A view that says what it is, and nothing yet of the drive.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            magic: AtomicU32::new(MAGIC),
            layout: AtomicU32::new(crate::LAYOUT),
            ..Self::zero()
        }
    }
}

impl Default for DriveView {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::{offset_of, size_of};

    /// The plain structure is read in the order in which the live one lies in memory, all of it.
    #[test]
    fn words_are_taken_from_where_they_are() {
        let mut next = 0;
        let view = DriveWords::take(&mut || {
            next += 1;
            next - 1
        });
        assert_eq!(next as usize, size_of::<DriveView>() / 4);
        let motor = offset_of!(DriveView, motors) + size_of::<MotorView>();
        for (taken, offset) in [
            (view.magic, offset_of!(DriveView, magic)),
            (view.fault, offset_of!(DriveView, fault)),
            (view.scale.cast_unsigned(), offset_of!(DriveView, scale)),
            (
                view.temperatures[1],
                offset_of!(DriveView, temperatures) + 4,
            ),
            (
                view.telemetry_dropped,
                offset_of!(DriveView, telemetry_dropped),
            ),
            (view.motors[1].current[1].cast_unsigned(), motor + 4),
            (
                view.motors[1].cycles_max,
                motor + offset_of!(MotorView, cycles_max),
            ),
        ] {
            assert_eq!(taken as usize, offset / 4);
        }
    }
}
