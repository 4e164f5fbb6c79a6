//! The tuning that is proposed, beside the one that is set.

use crate::quantity::{Quantity, both};
use crate::tune::{Loops, Tuned, Wanted, tune};
use crate::{Estimate, Failure};
use link::settings::Settings;

/// A tuning, and what it makes of the loops.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The settings with it.
    pub settings: Settings,
    /// Bandwidths, phase margins and gains of both motors, and the settings that change; with those before, if any changes.
    pub quantities: Vec<Quantity>,
}

/// The largest cutoffs up to those wanted at which all loops have their margin, of settings with a PWM period of `period_s` and a
/// step of the speed task of `step_s`.
///
/// # Errors
/// There are none.
pub fn propose(
    old: &Settings,
    wanted: Wanted,
    period_s: f64,
    step_s: f64,
) -> Result<Proposal, Failure> {
    let before = Tuned::of(old, period_s, step_s);
    let Some(tuned) = tune(old, wanted, period_s, step_s) else {
        return Err(Failure {
            measured: format!("a phase margin of {:.0} degrees", before.margin_deg()),
            expected: format!("{} degrees", wanted.margin_deg),
            check: "tuning.damping, and the margin that is wanted".to_owned(),
        });
    };
    let changed = tuned.settings != *old;
    let mut quantities = Vec::new();
    let mut one = |what: &str, unit: &str, now: [f64; 2], before: [f64; 2]| {
        both(
            &mut quantities,
            what,
            unit,
            now.map(exact),
            changed.then_some(before),
        );
    };
    for (name, now, before) in [
        ("current", tuned.current, before.current),
        ("speed", tuned.speed, before.speed),
    ] {
        one(
            &format!("bandwidth of the {name} loop"),
            "rad/s",
            now.map(|loop_| loop_.bandwidth_rad_s),
            before.map(|loop_| loop_.bandwidth_rad_s),
        );
        one(
            &format!("phase margin of the {name} loop"),
            "degrees",
            now.map(|loop_| loop_.margin_deg),
            before.map(|loop_| loop_.margin_deg),
        );
    }
    let gains = |settings: &Settings| {
        [&settings.screw, &settings.nut]
            .map(|motor| Loops::of(motor, settings, period_s, step_s).gains())
    };
    let (now, before) = (gains(&tuned.settings), gains(old));
    for (k, (name, unit)) in GAINS.into_iter().enumerate() {
        one(name, unit, now.map(|of| of[k]), before.map(|of| of[k]));
    }
    changes(&mut quantities, old, &tuned.settings);
    Ok(Proposal {
        settings: tuned.settings,
        quantities,
    })
}

/// Names and units of [`Loops::gains`].
const GAINS: [(&str, &str); 4] = [
    ("gain Kpc (Eq 9)", "V/A"),
    ("gain Kic (Eq 10)", "V/(A s)"),
    ("gain Kpw (Eq 11)", "A s/rad (electrical)"),
    ("gain Kiw (Eq 12)", "A/rad (electrical)"),
];

/// What is computed, and has no interval.
fn exact(value: f64) -> Estimate {
    Estimate {
        value,
        plus_minus: 0.0,
    }
}

/// The settings that a tuning changes.
pub(crate) fn changes(quantities: &mut Vec<Quantity>, old: &Settings, new: &Settings) {
    for (name, before, now) in [
        (
            "tuning.current_rad_s",
            old.tuning.current_rad_s,
            new.tuning.current_rad_s,
        ),
        (
            "tuning.speed_rad_s",
            old.tuning.speed_rad_s,
            new.tuning.speed_rad_s,
        ),
        (
            "tuning.observer_rad_s",
            old.tuning.observer_rad_s,
            new.tuning.observer_rad_s,
        ),
    ] {
        if now != before {
            quantities.push(Quantity {
                name: name.to_owned(),
                unit: "rad/s".to_owned(),
                estimate: exact(now),
                before: Some(before),
            });
        }
    }
}
