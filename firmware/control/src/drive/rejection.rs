//! What rejects torque ripple and disturbances, beside both speed loops.

use crate::base::format::{Current, Speed};
use crate::plate::DriveConfig;
use crate::speed::compensation::Compensation;
use crate::speed::disturbance::Disturbance;
use crate::speed::friction::Friction;
use crate::speed::notch::Notch;
use crate::speed::speed_loop::{SpeedLoopOutput, Wanted};

/// What keeps torque ripple and disturbances from the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rejection {
    pub(super) compensation: Compensation,
    friction: Friction,
    disturbances: [Disturbance; 2],
    /// What the observers see of the currents that were asked: without those that compensate what is known.
    unknown: [Current; 2],
    notches: [Notch; 2],
}

/// What both speed loops want, with what rejects disturbances.
pub(super) struct Rejected {
    /// With all.
    pub(super) wanted: [Wanted; 2],
    /// Of disturbance observer and notch alone.
    pub(super) fed_back: [Wanted; 2],
}

impl Rejection {
    /// Nothing learned and nothing observed.
    pub(super) const fn new(config: &DriveConfig) -> Self {
        Self {
            compensation: Compensation::new(&config.compensation),
            friction: Friction::new(),
            disturbances: [Disturbance::new(); 2],
            unknown: [Current::ZERO; 2],
            notches: [Notch::new(); 2],
        }
    }

    /// A step in which nothing is driven: all but what was learned starts at zero again.
    #[inline(always)]
    pub(super) fn rest(&mut self) {
        self.friction = Friction::new();
        self.disturbances = [Disturbance::new(); 2];
        self.unknown = [Current::ZERO; 2];
        self.notches = [Notch::new(); 2];
    }

    /// Adds to what both speed loops want: disturbance observer, notch, compensation and friction, at their speeds and references.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        config: &DriveConfig,
        mut wanted: [Wanted; 2],
        omega_e: [Speed; 2],
        references: [Speed; 2],
        relative: Speed,
    ) -> Rejected {
        let [screw_disturbance, nut_disturbance] = &config.disturbance;
        if screw_disturbance.active {
            let [screw, nut] = &mut self.disturbances;
            let [screw_asked, nut_asked] = self.unknown;
            let [screw_omega_e, nut_omega_e] = omega_e;
            let found = [
                screw.step(screw_disturbance, screw_asked, screw_omega_e),
                nut.step(nut_disturbance, nut_asked, nut_omega_e),
            ];
            for (wanted, found) in wanted.iter_mut().zip(found) {
                *wanted = wanted.plus(found);
            }
        }
        if config.notch.active {
            for (wanted, notch) in wanted.iter_mut().zip(&mut self.notches) {
                *wanted = wanted.asking(notch.step(&config.notch, wanted.current()));
            }
        }
        let fed_back = wanted;
        if config.compensation.active {
            let errors = wanted.map(Wanted::error);
            let given = self.compensation.currents(errors);
            for (wanted, given) in wanted.iter_mut().zip(given) {
                *wanted = wanted.plus(given);
            }
        }
        if config.friction.active {
            let rubbed = self
                .friction
                .currents(&config.friction, references, relative);
            for (wanted, given) in wanted.iter_mut().zip(rubbed) {
                *wanted = wanted.plus(given);
            }
        }
        Rejected { wanted, fed_back }
    }

    /// Keeps of the currents that were `asked` what the disturbance observers see. What was cut off is cut off what is fed back.
    #[inline(always)]
    pub(super) fn keep(
        &mut self,
        config: &DriveConfig,
        asked: [SpeedLoopOutput; 2],
        wanted: [Wanted; 2],
        fed_back: [Wanted; 2],
    ) {
        let [screw_disturbance, _] = &config.disturbance;
        if !screw_disturbance.active {
            return;
        }
        let without = |asked: SpeedLoopOutput, wanted: Wanted, back: Wanted| {
            asked
                .i_q
                .saturating_sub(wanted.current().saturating_sub(back.current()))
        };
        let [screw_asked, nut_asked] = asked;
        let [screw_wanted, nut_wanted] = wanted;
        let [screw_back, nut_back] = fed_back;
        self.unknown = [
            without(screw_asked, screw_wanted, screw_back),
            without(nut_asked, nut_wanted, nut_back),
        ];
    }
}
