//! From a hum to silence: a machine that nobody has seen, and what its ripple becomes once its effects are known.

use super::smoothness;
use crate::draw::{self, between, pick};
use control::plate::CompensationPlate;
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use hal_sim::smooth::known::Known;
use plant::effects::AnyEffect;
use plant::machine::Coupling;
use plant::model::Model;
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// Table velocity at which a hum is heard, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Time that the drive learns on, from what identification found, s.
const LEARNS_S: f64 = 8.0;

/// A machine with its records, and where it hums.
pub struct Hum {
    /// The machine.
    pub machine: draw::Machine,
    /// Where its ripple is looked at.
    pub point: OperatingPoint,
    seed: u64,
}

/// A machine's ripple (Eq 19), %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silence {
    /// Of the machine under the drive that its plate gives.
    pub before: f64,
    /// With what the plate declares as orders: its torque harmonics.
    pub declared: f64,
    /// With what identification found as orders, which do not learn.
    pub after: f64,
    /// With the same as orders that learn on.
    pub learned: f64,
    /// What the identified model says of the first three.
    pub predicted: [f64; 3],
}

impl Hum {
    /// Draws one or two effects of kinds and sizes of the machine's own, and records it.
    #[must_use]
    pub fn draw(seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(!seed);
        let mut kinds = vec![*pick(&mut rng, AnyEffect::KINDS)];
        let other = *pick(&mut rng, AnyEffect::KINDS);
        if rng.random::<bool>() && other != kinds[0] {
            kinds.push(other);
        }
        let base = if rng.random::<bool>() {
            between(&mut rng, 150.0, 900.0) * RPM
        } else {
            0.0
        };
        Self {
            machine: draw::draw(seed, &kinds),
            point: OperatingPoint {
                velocity: VELOCITY,
                base,
            },
            seed,
        }
    }

    /// What its ripple was and becomes, with the model that identification left.
    ///
    /// # Errors
    /// [`ExperimentError`] if a drive cannot be configured or leaves the point by a fault.
    pub fn silence(&self, identified: &Model) -> Result<Silence, ExperimentError> {
        let [declared, known] =
            [&self.machine.declared, identified].map(|model| Known::of(model).compensation);
        let none = CompensationPlate::NONE;
        let learns = CompensationPlate {
            learning_s: super::bench::LEARNING_S,
            scale_count_m: self.setup().board.sensors.scale_count_m,
            ..known
        };
        let real = |plate, learns_s| self.ripple(&self.machine.real, plate, learns_s);
        let model = |plate| self.ripple(identified, plate, 0.0);
        Ok(Silence {
            before: real(none, 0.0)?,
            declared: real(declared, 0.0)?,
            after: real(known, 0.0)?,
            learned: real(learns, LEARNS_S)?,
            predicted: [model(none)?, model(declared)?, model(known)?],
        })
    }

    fn ripple(
        &self,
        machine: &Model,
        compensation: CompensationPlate,
        learns_s: f64,
    ) -> Result<f64, ExperimentError> {
        let setup = self.setup();
        let mut plate = setup.plate();
        plate.compensation = compensation;
        let mut drive = Drive::aligned(machine, setup.coupling, setup.board, &plate)?;
        Ok(smoothness(&mut drive, self.point, learns_s)?.vrf)
    }

    /// The drive that the plate gives, as the machine was recorded with it.
    fn setup(&self) -> Setup {
        let mut setup = Setup::declared(self.machine.declared.clone(), Coupling::Coupled);
        setup.board.seed = self.seed;
        // An offset that the drive measures before it starts would be none.
        setup.board.measure_zeros = false;
        setup
    }
}

impl Silence {
    /// Part of the measured fall that the identified model predicted, %: 100 is all of it, and no more than that fell.
    #[must_use]
    pub fn fall_predicted(&self) -> f64 {
        let [before, _, after] = self.predicted;
        100.0 * (before - after) / (self.before - self.after)
    }
}
