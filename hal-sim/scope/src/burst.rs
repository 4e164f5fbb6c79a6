//! A burst as the page reads it.

use link::burst::{BurstSample, BurstState, BurstStatus, SAMPLES, Signal};
use link::host::burst::{Burst, unit};
use link::settings::Settings;
use serde_json::{Value, json};

/// The signals of a burst as JSON, in the order of a row after its time: name, label, unit.
#[must_use]
pub fn signals() -> Value {
    Signal::ALL
        .iter()
        .map(|signal| {
            json!({ "name": signal.name(), "label": signal.sentence(), "unit": unit(*signal) })
        })
        .collect()
}

/// What was read so far.
#[derive(Clone, Debug, Default)]
pub struct ReadBurst {
    status: BurstStatus,
    samples: Vec<BurstSample>,
}

impl ReadBurst {
    /// Samples from this one on are asked: what came from there on before is dropped.
    pub fn ask(&mut self, from: u16) {
        self.samples.truncate(from.into());
    }

    /// How it is going, as JSON. Another burst than before drops what was read.
    pub fn going(&mut self, status: BurstStatus, pwm_hz: f64) -> Value {
        if status != self.status {
            self.samples.clear();
        }
        self.status = status;
        let state = BurstState::of_word(status.state);
        json!({
            "state": state.map_or("unknown", BurstState::name),
            "sentence": state.map_or("", BurstState::sentence),
            "motor": status.request.motor,
            "before": status.before,
            "interval_s": f64::from(status.request.divider) / pwm_hz,
            "samples": SAMPLES,
        })
    }

    /// Takes samples: how many there are now.
    pub fn take(&mut self, some: &[BurstSample]) -> usize {
        let room = SAMPLES - self.samples.len();
        self.samples.extend(some.iter().take(room));
        self.samples.len()
    }

    /// The whole burst, a row a sample: time, s, 0 at the trigger, and then [`signals`]. Nothing until it was read.
    #[must_use]
    pub fn rows(&self, settings: &Settings, pwm_hz: f64) -> Vec<f64> {
        if self.samples.len() < SAMPLES {
            return Vec::new();
        }
        let motor = if self.status.request.motor == 0 {
            &settings.screw
        } else {
            &settings.nut
        };
        let counts = motor.encoder.counts_per_turn;
        let burst = Burst::of(&self.status, &self.samples, pwm_hz, counts);
        let columns = 1 + Signal::ALL.len();
        let rows = burst.rows.iter();
        rows.flat_map(|row| row[..columns].to_vec()).collect()
    }
}
