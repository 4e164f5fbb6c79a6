//! A burst as a person asks for it, and its samples in units.

use crate::burst::{BurstRequest, BurstSample, BurstStatus, SAMPLES, Signal, Trigger};
use crate::scale::{self, SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use anyhow::{Context, Result, ensure};
use std::f64::consts::TAU;
use std::str::FromStr;

/// Columns of a burst: time, each [`Signal`], the encoder's count.
pub const COLUMNS: [&str; 9] = [
    "time_s",
    Signal::PhaseA.name(),
    Signal::PhaseB.name(),
    Signal::TorqueCurrent.name(),
    Signal::TorqueReference.name(),
    Signal::VoltageD.name(),
    Signal::VoltageQ.name(),
    Signal::Speed.name(),
    "encoder_counts",
];

const RPM: f64 = 60.0 / TAU;

/// What begins a burst: `now`, `fault`, `state`, or a signal that rises or falls through a level, as in `ia_a>3`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// The trigger.
    pub trigger: Trigger,
    /// The signal and its level, A, V or rpm, where the trigger takes one.
    pub level: Option<(Signal, f64)>,
}

impl FromStr for Wanted {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let all = || Trigger::ALL.iter().copied();
        let plain = all().find(|trigger| !takes_level(*trigger) && trigger.name() == text);
        if let Some(trigger) = plain {
            return Ok(Self {
                trigger,
                level: None,
            });
        }
        let wanted = "give `now`, `fault`, `state`, or a signal that rises (>) or falls (<) through a level, as in ia_a>3";
        let at = text
            .find(['>', '<'])
            .ok_or_else(|| format!("`{text}` has neither > nor <: {wanted}"))?;
        let (name, level) = (text[..at].trim(), text[at + 1..].trim());
        let signal = Signal::ALL.iter().find(|signal| signal.name() == name);
        let signal = *signal.ok_or_else(|| {
            let names: Vec<&str> = Signal::ALL.iter().map(|signal| signal.name()).collect();
            format!(
                "a burst has no signal `{name}`; it has {}",
                names.join(", ")
            )
        })?;
        let level = level.parse().ok().filter(|level: &f64| level.is_finite());
        let level =
            level.ok_or_else(|| format!("`{text}` has no finite number for a level: {wanted}"))?;
        let trigger = if text[at..].starts_with('>') {
            Trigger::Rises
        } else {
            Trigger::Falls
        };
        Ok(Self {
            trigger,
            level: Some((signal, level)),
        })
    }
}

const fn takes_level(trigger: Trigger) -> bool {
    matches!(trigger, Trigger::Rises | Trigger::Falls)
}

impl Wanted {
    /// The request: of motor 0 (screw) or 1 (nut), with that share of the samples, %, before the trigger's, of each how manieth
    /// period.
    ///
    /// # Errors
    /// A level that its word does not hold, or a share that is no share.
    pub fn request(self, motor: u8, before_percent: f64, divider: u8) -> Result<BurstRequest> {
        ensure!(
            (0.0..=100.0).contains(&before_percent),
            "the share before the trigger is {before_percent} %, but 0 to 100 % are possible"
        );
        ensure!(
            divider > 0,
            "each 0th period is to be kept, but 1 to 255 are possible"
        );
        let (signal, level) = match self.level {
            None => (0, 0),
            Some((signal, level)) => (signal.word(), level_word(signal, level)?),
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let before = (before_percent / 100.0 * (SAMPLES - 1) as f64).round() as u16;
        Ok(BurstRequest {
            motor,
            trigger: self.trigger.word(),
            signal,
            level,
            before,
            divider,
        })
    }
}

/// Name of a signal's unit.
#[must_use]
pub const fn unit(signal: Signal) -> &'static str {
    match signal {
        Signal::PhaseA | Signal::PhaseB | Signal::TorqueCurrent | Signal::TorqueReference => "A",
        Signal::VoltageD | Signal::VoltageQ => "V",
        Signal::Speed => "rpm",
    }
}

fn level_word(signal: Signal, level: f64) -> Result<i32> {
    let si = match signal {
        Signal::Speed => level / RPM,
        _ => level,
    };
    scale::word(si, signal.fraction()).with_context(|| {
        let most = scale::value(i32::MAX, signal.fraction());
        let most = if signal == Signal::Speed {
            most * RPM
        } else {
            most
        };
        let unit = unit(signal);
        format!(
            "the level of {} is {level} {unit}, but -{most:.0} to {most:.0} {unit} are possible",
            signal.name()
        )
    })
}

/// A burst's samples in units.
#[derive(Clone, Debug, PartialEq)]
pub struct Burst {
    /// 0 is the screw, 1 the nut.
    pub motor: u8,
    /// Between two samples, s.
    pub interval_s: f64,
    /// Samples before the trigger's.
    pub before: usize,
    /// A row a sample, in the order of [`COLUMNS`].
    pub rows: Vec<[f64; COLUMNS.len()]>,
}

impl Burst {
    /// Of the samples of a complete burst, of a drive with so many PWM periods a second, whose motor's encoder counts
    /// `counts_per_turn`.
    ///
    /// The speed is what the encoder counted since the sample before it; the first sample has the second's.
    #[must_use]
    pub fn of(
        status: &BurstStatus,
        samples: &[BurstSample],
        pwm_hz: f64,
        counts_per_turn: u32,
    ) -> Self {
        let interval_s = f64::from(status.request.divider.max(1)) / pwm_hz;
        let before = usize::from(status.before);
        let current = |word| scale::value(word, scale::CURRENT - SAMPLE_CURRENT_DROPS);
        let voltage = |word| scale::value(word, scale::VOLTAGE - SAMPLE_VOLTAGE_DROPS);
        let counts = i64::from(counts_per_turn.max(1));
        let sense = if status.reversed { -1.0 } else { 1.0 };
        let speed = |k: usize| {
            let pair = samples.get(k.saturating_sub(1)..).unwrap_or_default();
            let [was, is, ..] = pair else { return 0.0 };
            let moved = (i64::from(is.encoder) - i64::from(was.encoder)).rem_euclid(counts);
            // The shorter way round.
            let moved = if 2 * moved > counts {
                moved - counts
            } else {
                moved
            };
            sense * moved as f64 / counts as f64 / interval_s * 60.0
        };
        let rows = samples.iter().enumerate().map(|(k, sample)| {
            [
                (k as f64 - before as f64) * interval_s,
                current(sample.phases[0]),
                current(sample.phases[1]),
                current(sample.i_q),
                current(sample.i_q_ref),
                voltage(sample.voltage[0]),
                voltage(sample.voltage[1]),
                speed(k),
                f64::from(sample.encoder),
            ]
        });
        Self {
            motor: status.request.motor,
            interval_s,
            before,
            rows: rows.collect(),
        }
    }

    /// The column of a signal.
    #[must_use]
    pub fn signal(&self, signal: Signal) -> Vec<f64> {
        let named = COLUMNS.iter().position(|name| *name == signal.name());
        named.map_or_else(Vec::new, |place| self.column(place))
    }

    /// The encoder's counts within the turn.
    #[must_use]
    pub fn counts(&self) -> Vec<f64> {
        self.column(COLUMNS.len() - 1)
    }

    /// A column by its place among [`COLUMNS`].
    #[must_use]
    pub fn column(&self, column: usize) -> Vec<f64> {
        self.rows.iter().map(|row| row[column]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trigger_is_read_and_asked_in_its_words() {
        let wanted: Wanted = "speed_rpm < -60".parse().unwrap();
        let request = wanted.request(1, 50.0, 2).unwrap();
        assert_eq!(
            (request.motor, request.trigger, request.signal),
            (1, Trigger::Falls.word(), Signal::Speed.word())
        );
        let rad_s = scale::value(request.level, Signal::Speed.fraction());
        assert!((rad_s + TAU).abs() < 1e-4, "{rad_s} rad/s");
        assert_eq!((request.before, request.divider), (256, 2));
        for plain in ["now", "fault", "state"] {
            let wanted: Wanted = plain.parse().unwrap();
            assert_eq!((wanted.trigger.name(), wanted.level), (plain, None));
        }
    }

    #[test]
    fn what_is_no_trigger_is_said() {
        for (text, expected) in [
            ("ia_a", "neither > nor <"),
            ("rises", "neither > nor <"),
            ("torque>3", "no signal `torque`"),
            ("ia_a>", "no finite number"),
            ("ia_a>inf", "no finite number"),
        ] {
            let error = text.parse::<Wanted>().unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
        let far: Wanted = "ia_a>1e9".parse().unwrap();
        let error = far.request(0, 0.0, 1).unwrap_err().to_string();
        assert!(error.contains("-2048 to 2048 A are possible"), "{error}");
        let now: Wanted = "now".parse().unwrap();
        for (percent, divider, expected) in [
            (101.0, 1, "0 to 100 % are possible"),
            (f64::NAN, 1, "0 to 100 % are possible"),
            (0.0, 0, "1 to 255 are possible"),
        ] {
            let error = now.request(0, percent, divider).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn samples_become_units_with_the_trigger_at_time_zero() {
        let sample = |encoder| BurstSample {
            encoder,
            phases: [4096, -2048],
            i_q: 1024,
            i_q_ref: 2048,
            voltage: [8192, -4096],
        };
        let mut status = BurstStatus {
            before: 1,
            request: BurstRequest {
                divider: 2,
                ..BurstRequest::default()
            },
            ..BurstStatus::default()
        };
        // Over the end of the turn, forwards.
        let samples = [sample(999), sample(1), sample(3)];
        let burst = Burst::of(&status, &samples, 20e3, 1000);
        let times: Vec<f64> = burst.column(0);
        assert_eq!(times, [-1e-4, 0.0, 1e-4]);
        assert_eq!(
            burst.rows[1][1..7],
            [1.0, -0.5, 0.25, 0.5, 1.0, -0.5],
            "{:?}",
            burst.rows[1]
        );
        for speed in burst.column(7) {
            assert!((speed - 1200.0).abs() < 1e-9, "{speed} rpm");
        }
        status.reversed = true;
        let turned = Burst::of(&status, &samples, 20e3, 1000);
        assert!((turned.rows[2][7] + 1200.0).abs() < 1e-9);
        assert_eq!(Burst::of(&status, &samples[..1], 20e3, 0).rows[0][7], 0.0);
    }
}
