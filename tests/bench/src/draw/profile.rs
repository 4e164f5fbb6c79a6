//! Profiles: those of the shared recordings, others built like them, and others.

use super::{between, pick};
use hal_sim::experiment::RPM;
use rand::{Rng, RngExt};

/// One operating point.
#[derive(Clone, Copy)]
pub struct Leg {
    /// Of the table, m/s.
    pub velocity: f64,
    /// Of the nut, rad/s.
    pub base: f64,
    /// With the ramp to it, s.
    pub seconds: f64,
}

/// A run: a rest, then operating points.
pub struct Profile {
    /// s.
    pub rest_s: f64,
    /// In turn.
    pub legs: Vec<Leg>,
}

impl Profile {
    /// Of table velocities (mm/s), nut speeds (rpm) and times (s).
    pub fn of(rest_s: f64, legs: &[(f64, f64, f64)]) -> Self {
        Profile {
            rest_s,
            legs: legs
                .iter()
                .map(|&(velocity, rpm, seconds)| Leg {
                    velocity: 1e-3 * velocity,
                    base: RPM * rpm,
                    seconds,
                })
                .collect(),
        }
    }

    /// Length of the run.
    pub fn seconds(&self) -> f64 {
        self.rest_s + self.legs.iter().map(|leg| leg.seconds).sum::<f64>()
    }
}

/// The profiles of one machine.
pub struct Profiles {
    /// In words.
    pub style: &'static str,
    /// To identify from.
    pub fit: Profile,
    /// Another.
    pub check: Profile,
}

/// As most of the shared recordings are.
pub fn recorded() -> Profile {
    Profile::of(
        0.75,
        &[
            (2.5, 0.0, 2.75),
            (-2.5, 0.0, 1.45),
            (2.5, 120.0, 1.45),
            (2.5, 300.0, 1.45),
            (-5.0, 300.0, 1.45),
            (10.0, 500.0, 1.45),
            (2.5, 800.0, 1.45),
            (-10.0, 800.0, 1.05),
            (2.5, -400.0, 1.05),
        ],
    )
}

/// The shared recordings' other profile, with more speeds at a resting nut.
pub fn slow() -> Profile {
    Profile::of(
        0.75,
        &[
            (2.5, 0.0, 2.75),
            (-2.5, 0.0, 2.25),
            (5.0, 0.0, 1.75),
            (-8.0, 0.0, 1.45),
            (2.5, 300.0, 1.45),
            (-2.5, 300.0, 1.45),
            (1.0, 500.0, 1.45),
            (-1.0, 800.0, 1.4),
        ],
    )
}

/// The shared recordings' second run.
pub fn recorded_check() -> Profile {
    Profile::of(
        0.75,
        &[
            (3.5, 0.0, 2.25),
            (-2.0, 0.0, 1.25),
            (-2.5, 200.0, 1.45),
            (6.0, 400.0, 1.45),
            (2.5, 650.0, 1.45),
            (-4.0, -250.0, 1.05),
        ],
    )
}

/// The same legs at other speeds and of other lengths.
fn varied(rng: &mut impl Rng, mut profile: Profile) -> Profile {
    for leg in &mut profile.legs {
        leg.velocity *= between(rng, 0.6, 1.5);
        leg.base *= between(rng, 0.7, 1.2);
        leg.seconds *= between(rng, 0.85, 1.2);
    }
    profile
}

/// Slow legs with a resting nut first, then both motors at speed, both directions of the table in each.
fn own(rng: &mut impl Rng, legs: usize) -> Profile {
    let mut list = Vec::new();
    for side in [1.0, -1.0] {
        list.push((side * between(rng, 1.5, 4.0), 0.0, between(rng, 1.3, 2.5)));
    }
    for k in 2..legs {
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let turn = if rng.random::<f64>() < 0.2 { -1.0 } else { 1.0 };
        list.push((
            side * between(rng, 1.0, 10.0),
            turn * between(rng, 80.0, 850.0),
            between(rng, 1.2, 1.6),
        ));
    }
    Profile::of(0.4, &list)
}

/// Of a motor alone: slow and fast, both ways.
pub fn alone(rng: &mut impl Rng, legs: usize) -> Profile {
    let list: Vec<_> = (0..legs)
        .map(|leg| {
            let way = if leg % 3 == 2 { -1.0 } else { 1.0 };
            let rpm = match leg % 4 {
                0 => between(rng, 25.0, 80.0),
                _ => between(rng, 100.0, 800.0),
            };
            (0.0, way * rpm, between(rng, 1.2, 1.8))
        })
        .collect();
    Profile::of(0.3, &list)
}

/// The profiles of a machine: half of them as the shared recordings have them (`friction`: more speeds at a resting
/// nut), a quarter built like them, a quarter others.
pub fn draw(rng: &mut impl Rng, friction: bool) -> Profiles {
    let base = if friction { slow() } else { recorded() };
    match *pick(rng, &[0, 0, 1, 2]) {
        0 => Profiles {
            style: "recorded",
            fit: base,
            check: recorded_check(),
        },
        1 => Profiles {
            style: "varied",
            fit: varied(rng, base),
            check: varied(rng, recorded_check()),
        },
        _ => Profiles {
            style: "own",
            fit: own(rng, 9),
            check: own(rng, 6),
        },
    }
}
