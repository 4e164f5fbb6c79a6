//! The table's speed while one motor brings the table to rest.
//!
//! Two sources give it: the table's scale, and the difference of both encoders. Either may be wrong after a fault, so one is preferred:
//!
//! | first fault | preferred | why |
//! | --- | --- | --- |
//! | an encoder, an angle, a voltage, a speed, a stalled shaft | scale | the motor's encoder may be the cause |
//! | a current or a gate driver | encoders | both encoders counted well until now |
//!
//! While both agree, the preferred source is used. A table on its way to rest can have a speed between the last agreed one and none. A
//! source that gives another speed is wild. A scale that counts the wrong way is, and so is an encoder that stands or jumps. From the first
//! disagreement on the preferred source is used, but not encoders that were wild in more steps than the scale. After [`DECIDES`] steps one
//! that is not wild is chosen for good, of two the same.
//!
//! An encoder that is found to fail later is not preferred any more. Where both motors are slow, a disagreement ends it: both motors coast
//! less far then than a wrong source could move the table.
//!
//! Without a scale that counts nobody knows the speed: nothing could contradict the encoders.

use crate::base::fault::Fault;
use crate::base::format::Speed;

/// Steps of the speed task, 2 ms at 5 kHz: an observer takes one to see that its encoder stands or has jumped.
const DECIDES: u8 = 10;

/// Both motors are slow below so much of what is slow: they coast by 0.2 mm of the table on the mains board, where 800 rpm are 9 mm.
const SLOW: i32 = 4;

/// What the table's speed is taken from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Scale,
    Encoders,
}

impl Source {
    const fn preferred(first: Fault) -> Self {
        match first {
            Fault::ScrewBreak
            | Fault::NutBreak
            | Fault::ScrewDriver
            | Fault::NutDriver
            | Fault::ScrewOverCurrent
            | Fault::NutOverCurrent
            | Fault::ScrewCurrentError
            | Fault::NutCurrentError
            | Fault::ScrewCurrentSum
            | Fault::NutCurrentSum => Self::Encoders,
            _ => Self::Scale,
        }
    }
}

/// A reading of both sources, electrical speeds of the shaft that follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    /// By the scale; `None`: it has not counted since the start, or there is none.
    pub(crate) scale: Option<Speed>,
    /// By both encoders.
    pub(crate) encoders: Speed,
    /// Of the shaft that follows.
    pub(crate) shaft: Speed,
    /// An encoder is accused, or an angle.
    pub(crate) doubted: bool,
    /// What is slow, of this shaft.
    pub(crate) slow: Speed,
}

/// The speed that is used, and whether it is the scale's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Table {
    pub(crate) speed: Speed,
    pub(crate) by_scale: bool,
}

/// State of the choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TableSpeed {
    preferred: Source,
    /// The choice, once both have disagreed.
    chosen: Option<Source>,
    /// The speed at which both last agreed, at first the planned one.
    agreed: Speed,
    /// Steps since they disagree.
    apart: u8,
    /// Of those, in how many each was wild: scale, encoders.
    wild: [u8; 2],
}

impl TableSpeed {
    /// After `first`, with the table's planned speed as an electrical speed of the shaft that follows.
    pub(crate) const fn after(first: Fault, planned: Speed) -> Self {
        Self {
            preferred: Source::preferred(first),
            chosen: None,
            agreed: planned,
            apart: 0,
            wild: [0; 2],
        }
    }

    /// A step. `None`: nobody knows the speed.
    pub(crate) fn step(&mut self, reading: &Reading) -> Option<Table> {
        if reading.doubted && self.preferred == Source::Encoders {
            (self.preferred, self.chosen) = (Source::Scale, None);
            (self.apart, self.wild) = (0, [0; 2]);
        }
        let scale = reading.scale?;
        if self.chosen.is_none() {
            self.choose(scale, reading);
        }
        let slow = reading.slow.saturating_mul_int(SLOW);
        let all = [scale, reading.encoders, reading.shaft];
        if self.apart > 0 && all.iter().all(|speed| speed.saturating_abs() < slow) {
            return None;
        }
        Some(match self.used() {
            Source::Scale => Table {
                speed: scale,
                by_scale: true,
            },
            Source::Encoders => Table {
                speed: reading.encoders,
                by_scale: false,
            },
        })
    }

    fn choose(&mut self, scale: Speed, reading: &Reading) {
        let Reading { encoders, slow, .. } = *reading;
        let size = self.agreed.saturating_abs();
        // A scale is a look older than the encoders.
        let limit = slow
            .saturating_mul_int(2)
            .saturating_add(Speed::from_bits(size.to_bits() / 4));
        let apart = scale.saturating_sub(encoders).saturating_abs() > limit;
        if !apart && self.apart == 0 {
            self.agreed = scale;
            return;
        }
        self.apart = self.apart.saturating_add(1);
        let least = self.agreed.min(Speed::ZERO).saturating_sub(limit);
        let most = self.agreed.max(Speed::ZERO).saturating_add(limit);
        let may_be = |speed: Speed| speed >= least && speed <= most;
        let now = [scale, encoders].map(may_be);
        for (wild, may_be) in self.wild.iter_mut().zip(now) {
            *wild = wild.saturating_add((!may_be).into());
        }
        if self.apart >= DECIDES {
            self.chosen = match now {
                [false, false] => None,
                [true, false] => Some(Source::Scale),
                [false, true] => Some(Source::Encoders),
                [true, true] => Some(self.used()),
            };
        }
    }

    /// What is used: until the choice is made, encoders only while they were not wild in more steps. A scale that is wild makes
    /// the motor swing, which ends it: an encoder that is accused is no better.
    fn used(&self) -> Source {
        let [scale, encoders] = self.wild;
        let used = match self.preferred {
            Source::Encoders if encoders > scale => Source::Scale,
            preferred => preferred,
        };
        self.chosen.unwrap_or(used)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOW_SPEED: f64 = 10.0;

    /// What is used in the last of 100 steps; `at` gives scale and encoders, planned is 100.
    fn used(first: Fault, at: impl Fn(u32) -> (Option<f64>, f64)) -> Option<Table> {
        let mut table = TableSpeed::after(first, Speed::from_num(100));
        let mut last = None;
        for step in 0..100 {
            let (scale, encoders) = at(step);
            last = table.step(&Reading {
                scale: scale.map(Speed::from_num),
                encoders: Speed::from_num(encoders),
                shaft: Speed::from_num(300),
                doubted: false,
                slow: Speed::from_num(SLOW_SPEED),
            });
        }
        last
    }

    /// A table that comes to rest within 50 steps.
    fn truth(step: u32) -> f64 {
        100.0 - f64::from(step.min(50)) * 2.0
    }

    const OF_CURRENT: Fault = Fault::NutBreak;
    const OF_ENCODER: Fault = Fault::NutEncoder;

    #[test]
    fn a_scale_that_counts_the_wrong_way_is_not_used() {
        for first in [OF_CURRENT, OF_ENCODER] {
            let table = used(first, |step| (Some(-truth(step)), truth(step)));
            assert!(!table.unwrap().by_scale, "{first:?}");
        }
    }

    #[test]
    fn an_encoder_that_stands_is_not_used() {
        // The nut's 300 are missing within four steps.
        let stands = |step: u32| truth(step) + f64::from(step.min(4)) * 75.0;
        for first in [OF_CURRENT, OF_ENCODER] {
            let table = used(first, |step| (Some(truth(step)), stands(step)));
            assert!(table.unwrap().by_scale, "{first:?}");
        }
    }

    /// It has its cable's neighbour from now on, which turns as fast: the table seems to stand.
    #[test]
    fn an_encoder_that_jumps_is_not_used() {
        let neighbour = |step: u32| if step < 5 { -400.0 } else { 0.0 };
        let slow = |step: u32| 100.0 - f64::from(step) * 0.5;
        for first in [OF_CURRENT, OF_ENCODER] {
            let table = used(first, |step| (Some(slow(step)), neighbour(step)));
            assert!(table.unwrap().by_scale, "{first:?}");
        }
    }

    #[test]
    fn a_late_scale_is_used_only_where_an_encoder_is_accused() {
        let late = |step: u32| truth(step.saturating_sub(40));
        for (first, by_scale) in [(OF_CURRENT, false), (OF_ENCODER, true)] {
            let table = used(first, |step| (Some(late(step)), truth(step)));
            assert_eq!(table.unwrap().by_scale, by_scale, "{first:?}");
        }
    }

    #[test]
    fn without_a_scale_nobody_knows_the_speed() {
        for first in [OF_CURRENT, OF_ENCODER] {
            assert_eq!(used(first, |step| (None, truth(step))), None);
        }
    }
}
