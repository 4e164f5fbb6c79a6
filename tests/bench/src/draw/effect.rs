//! An effect, drawn.

use super::{between, pick, sign, spread};
use plant::effects::{AnyEffect, EffectModel, Place};
use rand::{Rng, RngExt};

/// An effect of one kind at a place of its own, from barely visible up, or, if `bold`, of the sort of sizes that the
/// shared recordings show: the upper part of the range.
pub fn effect(rng: &mut impl Rng, kind: &str, bold: bool) -> EffectModel {
    let motor = *pick(rng, &[Place::Screw, Place::Nut]);
    let phase = between(rng, -3.1, 3.1);
    let mut drawn = Drawn {
        rng,
        bold,
        motor,
        phase,
    };
    let (place, parameters) = if kind == "stribeck_friction" {
        drawn.stribeck()
    } else if let Some(of_motor) = drawn.of_motor(kind) {
        of_motor
    } else if let Some(of_feed) = drawn.of_feed(kind) {
        of_feed
    } else {
        drawn.of_example(kind)
    };
    let effect =
        AnyEffect::from_parameters(kind, parameters).expect("parameters within their ranges");
    EffectModel::new(place, effect).expect("a place that the kind allows")
}

type Parameters = Vec<(&'static str, f64)>;

/// What effects are drawn from: the motor and the phase of those that have one are drawn already.
struct Drawn<'a, R> {
    rng: &'a mut R,
    bold: bool,
    motor: Place,
    phase: f64,
}

fn periodic(phase: f64, order: f64, amplitude: f64) -> Parameters {
    vec![("order", order), ("amplitude", amplitude), ("phase", phase)]
}

impl<R: Rng> Drawn<'_, R> {
    fn spread(&mut self, low: f64, high: f64) -> f64 {
        let low = if self.bold { low.max(0.3 * high) } else { low };
        spread(self.rng, low, high)
    }

    fn of_motor(&mut self, kind: &str) -> Option<(Place, Parameters)> {
        let phase = self.phase;
        Some(match kind {
            "current_offset" => {
                let size = self.spread(0.008, 0.07);
                (
                    self.motor,
                    vec![
                        ("off_a", size * sign(self.rng)),
                        ("off_b", size * between(self.rng, 0.5, 1.2) * sign(self.rng)),
                    ],
                )
            }
            "current_gain" => {
                let size = self.spread(0.01, 0.06);
                (
                    self.motor,
                    vec![
                        ("gain_a", size),
                        ("gain_b", -size * between(self.rng, 0.5, 1.2)),
                    ],
                )
            }
            "torque_harmonic" => (
                self.motor,
                periodic(
                    phase,
                    *pick(self.rng, &[18.0, 24.0, 6.0]),
                    self.spread(0.006, 0.04),
                ),
            ),
            "flux_harmonic" => (
                self.motor,
                periodic(
                    phase,
                    *pick(self.rng, &[5.0, 6.0, 7.0, 12.0]),
                    self.spread(0.004, 0.04),
                ),
            ),
            "cogging" => (
                self.motor,
                periodic(
                    phase,
                    *pick(self.rng, &[12.0, 24.0, 36.0, 10.0, 20.0]),
                    self.spread(0.005, 0.04),
                ),
            ),
            "coupling_misalignment" => (
                self.motor,
                periodic(
                    phase,
                    *pick(self.rng, &[1.0, 2.0]),
                    self.spread(0.005, 0.05),
                ),
            ),
            "angle_periodic" => {
                let order = if self.rng.random::<bool>() {
                    *pick(self.rng, &[7.0, 11.0, 17.0, 23.0])
                } else {
                    between(self.rng, 2.2, 26.0)
                };
                (self.motor, periodic(phase, order, self.spread(0.006, 0.04)))
            }
            "time_periodic" => (
                self.motor,
                vec![
                    ("hz", between(self.rng, 6.0, 140.0)),
                    ("amplitude", self.spread(0.006, 0.04)),
                    ("phase", phase),
                ],
            ),
            "encoder_eccentricity" => (
                self.motor,
                periodic(phase, *pick(self.rng, &[1.0, 2.0]), self.spread(5e-5, 2e-3)),
            ),
            "dead_time" => {
                let place = *pick(self.rng, &[Place::Screw, Place::Nut, Place::Both]);
                (place, vec![("value", self.spread(0.2, 3.0))])
            }
            "resistance_drift" => (
                self.motor,
                vec![("value", self.spread(0.05, 0.3) * sign(self.rng))],
            ),
            "flux_drift" => (
                self.motor,
                vec![("value", self.spread(0.01, 0.08) * sign(self.rng))],
            ),
            _ => return None,
        })
    }

    fn of_feed(&mut self, kind: &str) -> Option<(Place, Parameters)> {
        let phase = self.phase;
        Some(match kind {
            "lead_error" => (
                Place::Feed,
                periodic(
                    phase,
                    *pick(self.rng, &[1.0, 2.0, 0.5]),
                    self.spread(2e-7, 5e-6),
                ),
            ),
            "lead_scale" => (
                Place::Feed,
                vec![("value", self.spread(3e-5, 5e-4) * sign(self.rng))],
            ),
            "ball_passage" => (
                Place::Feed,
                periodic(
                    phase,
                    between(self.rng, 3.2, 18.0),
                    self.spread(0.003, 0.02),
                ),
            ),
            "axial_compliance" => (Place::Feed, vec![("hz", between(self.rng, 120.0, 360.0))]),
            "position_load" => (
                Place::Feed,
                vec![("value", self.spread(500.0, 15_000.0) * sign(self.rng))],
            ),
            "backlash" => (Place::Feed, vec![("value", self.spread(5e-7, 2e-5))]),
            _ => return None,
        })
    }

    fn stribeck(&mut self) -> (Place, Parameters) {
        if self.rng.random::<bool>() {
            (
                self.motor,
                vec![
                    ("amplitude", self.spread(0.02, 0.08)),
                    ("speed", between(self.rng, 3.0, 12.0)),
                ],
            )
        } else {
            (
                Place::Feed,
                vec![
                    ("amplitude", self.spread(6.0, 30.0)),
                    ("speed", between(self.rng, 1.5e-3, 6e-3)),
                ],
            )
        }
    }

    /// A kind that is not listed, of its usual parameters.
    fn of_example(&mut self, kind: &str) -> (Place, Parameters) {
        let kind = AnyEffect::kind_named(kind).expect("a kind of the plant");
        let (place, usual) = kind.example;
        let sized = |(name, value): &(&'static str, f64)| match *name {
            "order" | "hz" | "phase" => (*name, *value),
            _ => (*name, value * self.spread(0.5, 2.0)),
        };
        (place, usual.iter().map(sized).collect())
    }
}
