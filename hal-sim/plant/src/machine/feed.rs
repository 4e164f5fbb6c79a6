//! Screw-nut pair, table and guideway.

use super::friction::{Axial, Kick, Velocities};
use super::motors::sum;
use crate::effects::{Coordinate, Law, Place, Site, Term};
use crate::model::Model;
use std::f64::consts::TAU;

#[derive(Debug, Clone)]
pub(super) struct Feed {
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) acceleration: f64,
    pub(super) load: f64,
    /// Mass and viscous friction over a step.
    pub(super) kick: Kick<f64>,
    coupling: CouplingStep,
    mass: f64,
    viscous: f64,
    pub(super) pair_coulomb: f64,
    coulomb: f64,
    travel_per_radian: f64,
    stiffness: f64,
    damping: f64,
    half_gap: f64,
    /// Travel at which the spring is relaxed with the table at 0.
    pub(super) origin: f64,
    terms: FeedTerms,
}

/// The axial spring and damper over a step.
#[derive(Debug, Clone, Copy, Default)]
struct CouplingStep {
    /// Impulse of the spring per stretch.
    push: f64,
    /// Impulse of the spring per velocity gained in the step.
    spring: f64,
    /// Half the impulse of the damper per velocity.
    damper: f64,
}

/// The terms that act on the feed, sorted by site.
#[derive(Debug, Clone, Default)]
struct FeedTerms {
    /// Of the relative angle.
    travel: Vec<Law>,
    pair_torque: Vec<Law>,
    table_force: Vec<Law>,
    /// Measured forces over the angle of screw against nut, and over the table's velocity.
    force_by_angle: Vec<Law>,
    force_by_speed: Vec<Law>,
    friction: Vec<Law>,
    friction_by_position: Vec<Law>,
}

impl Feed {
    pub(super) fn new(model: &Model) -> Self {
        let feed = &model.feed;
        let mut this = Feed {
            position: 0.0,
            velocity: 0.0,
            acceleration: 0.0,
            load: feed.load_n,
            kick: Kick::default(),
            coupling: CouplingStep::default(),
            mass: feed.table_mass_kg,
            viscous: feed.guideway_viscous_n_s_per_m,
            pair_coulomb: feed.pair_coulomb_nm,
            coulomb: feed.guideway_coulomb_n,
            travel_per_radian: feed.travel_per_radian(),
            stiffness: feed.axial_stiffness_n_per_m,
            damping: 0.0,
            half_gap: 0.0,
            origin: 0.0,
            terms: FeedTerms::default(),
        };
        let nominal = this.travel_per_radian;
        for effect in model
            .effects
            .iter()
            .filter(|effect| effect.place() == Place::Feed)
        {
            effect
                .effect()
                .terms()
                .into_iter()
                .for_each(|term| this.add(term, nominal));
        }
        this.damping = 2.0 * feed.axial_damping_ratio * (this.stiffness * this.mass).sqrt();
        this.origin = this.travel(0.0);
        this
    }

    fn add(&mut self, term: Term, nominal: f64) {
        match (term.site, term.coordinate, term.law) {
            (Site::Travel, Coordinate::NominalTravel, law) => {
                self.travel_per_radian += nominal * law.value(1.0)
            }
            (Site::Travel, Coordinate::RelativeAngle, law) => self.terms.travel.push(law),
            (Site::PairTorque, Coordinate::RelativeAngle, law) => self.terms.pair_torque.push(law),
            (Site::TableForce, Coordinate::TablePosition, law) => self.terms.table_force.push(law),
            (Site::TableForce, Coordinate::RelativeAngle, law) => {
                self.terms.force_by_angle.push(law)
            }
            (Site::TableForce, Coordinate::Speed, law) => self.terms.force_by_speed.push(law),
            (Site::Friction, Coordinate::Speed, law) => self.terms.friction.push(law),
            (Site::Friction, Coordinate::TablePosition, law) => {
                self.terms.friction_by_position.push(law)
            }
            (Site::AxialResonance, _, law) => {
                self.stiffness = self.mass * (TAU * law.value(0.0)).powi(2)
            }
            (Site::AxialGap, _, law) => self.half_gap += 0.5 * law.value(0.0),
            (site, coordinate, _) => debug_assert!(
                false,
                "no feed takes a term at {site:?} over {coordinate:?}"
            ),
        }
    }

    /// Computes what depends on the length of the step.
    #[cold]
    pub(super) fn prepare(&mut self, dt: f64) {
        self.kick = Kick::new(self.mass, self.viscous, dt);
        let push = dt * self.stiffness;
        let blend = if push * dt < 2.0 * self.mass {
            1.0 / 3.0
        } else {
            1.0
        };
        self.coupling = CouplingStep {
            push,
            spring: 0.25 * blend * dt * push,
            damper: 0.5 * dt * self.damping,
        };
    }

    /// Travel at a relative angle of screw and nut, m.
    #[inline]
    pub(super) fn travel(&self, relative: f64) -> f64 {
        self.travel_per_radian * relative + sum(&self.terms.travel, relative)
    }

    /// Derivative of the travel by the relative angle, m/rad.
    #[inline]
    pub(super) fn ratio(&self, relative: f64) -> f64 {
        self.travel_per_radian
            + self
                .terms
                .travel
                .iter()
                .map(|law| law.slope(relative))
                .sum::<f64>()
    }

    /// Stretch of the spring beyond the gap, m.
    #[inline]
    fn stretch(&self, relative: f64, position: f64) -> f64 {
        let stretch = self.travel(relative) - self.origin - position;
        stretch - stretch.clamp(-self.half_gap, self.half_gap)
    }

    #[inline]
    fn in_contact(&self, stretch: f64) -> bool {
        self.half_gap == 0.0 || stretch != 0.0
    }

    /// Axial force at a state, N: what the thread pushes the table with.
    pub(super) fn force(&self, relative: f64, relative_speed: f64) -> f64 {
        let stretch = self.stretch(relative, self.position);
        if !self.in_contact(stretch) {
            return 0.0;
        }
        self.stiffness * stretch
            + self.damping * (self.ratio(relative) * relative_speed - self.velocity)
    }

    /// Torque of the pair against the screw, without friction, N m.
    #[inline]
    pub(super) fn pair_torque(&self, relative: f64) -> f64 {
        sum(&self.terms.pair_torque, relative)
    }

    /// Force against positive travel at the middle of the step, without friction, N.
    #[inline]
    pub(super) fn table_load(&self, relative: f64, position: f64) -> f64 {
        let terms = &self.terms;
        self.load
            + sum(&terms.table_force, position)
            + sum(&terms.force_by_angle, relative)
            + sum(&terms.force_by_speed, self.velocity)
    }

    /// Level of the guideway's friction at the middle of the step, N.
    #[inline]
    pub(super) fn friction_level(&self, half: f64) -> f64 {
        let terms = &self.terms;
        if terms.friction.is_empty() && terms.friction_by_position.is_empty() {
            return self.coulomb;
        }
        let velocity = self.velocity + half * self.acceleration;
        let position = self.position + half * self.velocity;
        let more = sum(&terms.friction, velocity) + sum(&terms.friction_by_position, position);
        (self.coulomb + more).max(0.0)
    }

    /// The axial coupling over a step, about relative angle and position at its middle; none within the gap.
    ///
    /// Spring: the force at the middle, with the share `blend` of the correction from the predicted to the implicit
    /// middle. 1/3 makes the error of the resonance's frequency fourth order; 1 is stable at any stiffness. Damper: the
    /// mean of the velocities before and after.
    #[inline]
    pub(super) fn axial(&self, relative: f64, position: f64, before: Velocities) -> Option<Axial> {
        let stretch = self.stretch(relative, position);
        if !self.in_contact(stretch) {
            return None;
        }
        let CouplingStep {
            push,
            spring,
            damper,
        } = self.coupling;
        let ratio = self.ratio(relative);
        Some(Axial {
            ratio,
            offset: push * stretch + (damper - spring) * Axial::speed(ratio, before),
            slope: damper + spring,
        })
    }
}
