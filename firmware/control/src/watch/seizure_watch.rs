//! An encoder that stands: whether its shaft does too.
//!
//! A shaft that seizes and an encoder that dies look alike at first: the count stands while the observer still turns, and the bridges
//! open within a millisecond, before currents and voltages differ. Then the other shaft runs out, and the table's scale tells the two
//! apart: it goes with the difference of both encoders where the shaft stands, and not where only its encoder does.

use crate::base::fault::Fault;
use crate::watch::scale_watch::ScaleWatchConfig;

/// Looks after the fault in which it may show: a motor that runs out slows by a tenth, and turns by a twentieth of a turn from 60 rpm.
const LOOKS: u32 = 50;
/// Furthest that a shaft which stands may turn, 2^-32 turn: a fiftieth of a turn, more than a seized bearing's play.
const STANDS: u64 = (1 << 32) / 50;

/// State of the watch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SeizureWatch {
    /// The fault that is looked at, and the looks that are left for it.
    accused: Option<Fault>,
    left: u32,
    /// What each shaft has turned since by its encoder, 2^-32 turn.
    turned: [i64; 2],
    /// What the scale has counted since.
    counted: i64,
}

impl SeizureWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            accused: None,
            left: 0,
            turned: [0; 2],
            counted: 0,
        }
    }

    /// One look: the fault that has stopped the drive, what each shaft has turned since the last by its encoder, 2^-32 turn, and
    /// what the scale has counted. The fault that it is, once the scale has shown that it is another.
    pub fn step(
        &mut self,
        config: &ScaleWatchConfig,
        stopped_by: Option<Fault>,
        turned: [i64; 2],
        counted: i64,
    ) -> Option<Fault> {
        let (motor, seized) = match stopped_by {
            Some(Fault::ScrewEncoder) => (0, Fault::ScrewStalled),
            Some(Fault::NutEncoder) => (1, Fault::NutStalled),
            _ => {
                *self = Self::new();
                return None;
            }
        };
        if self.accused != stopped_by {
            *self = Self {
                accused: stopped_by,
                left: LOOKS,
                ..Self::new()
            };
            return None;
        }
        self.left = self.left.checked_sub(1)?;
        for (sum, turned) in self.turned.iter_mut().zip(turned) {
            *sum = sum.saturating_add(turned);
        }
        self.counted = self.counted.saturating_add(counted);
        let [screw, nut] = self.turned;
        let accused = if motor == 0 { screw } else { nut };
        let expected = config.counts_of(screw.saturating_sub(nut));
        // As far as scale and motors may be apart on the whole way, of which these few turns show little.
        let enough = expected.unsigned_abs() > config.apart_max.unsigned_abs();
        if !enough || accused.unsigned_abs() > STANDS {
            return None;
        }
        self.left = 0;
        let apart = expected.saturating_sub(self.counted.saturating_mul(256));
        let agrees = apart.unsigned_abs() < expected.unsigned_abs() >> 1;
        agrees.then_some(seized)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::scale_watch::ScaleWatchPlate;

    /// What comes of a nut whose encoder stands while the screw turns by so many turns a look, and the nut by so many.
    fn verdict(screw: f64, nut: f64, by_encoder: f64) -> Option<Fault> {
        let (count_m, lead_m) = (100e-9, 5e-3);
        let config = ScaleWatchPlate::usual(count_m, lead_m).config().unwrap();
        let mut watch = SeizureWatch::new();
        let turn = |turns: f64| (turns * 2f64.powi(32)) as i64;
        let counts = ((screw - nut) * lead_m / count_m) as i64;
        (0..100).find_map(|_| {
            let turned = [turn(screw), turn(by_encoder)];
            watch.step(&config, Some(Fault::NutEncoder), turned, counts)
        })
    }

    #[test]
    fn the_scale_tells_a_shaft_that_stands_from_an_encoder_that_does() {
        let seized = Some(Fault::NutStalled);
        for way in [13e-3, -13e-3, 5e-3] {
            assert_eq!(
                verdict(way, 0.0, 0.0),
                seized,
                "it stands at {way} turns a look"
            );
            assert_eq!(
                verdict(way, 0.9 * way, 0.0),
                None,
                "it runs out with the screw"
            );
            assert_eq!(verdict(way, -way, 0.0), None, "it runs out the other way");
            assert_eq!(
                verdict(way, 0.0, 0.5 * way),
                None,
                "its encoder does not stand"
            );
        }
        assert_eq!(verdict(1e-4, 0.0, 0.0), None, "too little way to tell");
    }

    #[test]
    fn other_faults_are_not_looked_at() {
        let config = ScaleWatchPlate::usual(100e-9, 5e-3).config().unwrap();
        let mut watch = SeizureWatch::new();
        for fault in [None, Some(Fault::OverVoltage), Some(Fault::NutAngle)] {
            for _ in 0..100 {
                assert_eq!(watch.step(&config, fault, [1 << 26, 0], 800), None);
            }
        }
    }
}
