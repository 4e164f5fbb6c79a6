//! Friction whose sign turns round over a small speed, as in the simulation that made the shared recordings: such a
//! machine creeps where the plant's own sticks.

use plant::Axis;
use plant::effects::{Coordinate, EffectModel, Law, Place, Site};
use plant::machine::Machine;
use plant::model::Model;

/// Those of the simulation that made the shared recordings.
pub(super) const WIDTHS: Widths = Widths {
    bearing: 2.0,
    pair: 0.5,
    guideway: 0.2,
};

/// Speeds over which the sign of friction turns round, rad/s: of the bearings, of screw against nut, and of the table through the
/// lead.
#[derive(Debug, Clone, Copy)]
pub struct Widths {
    /// Of the bearings.
    pub bearing: f64,
    /// Of screw against nut.
    pub pair: f64,
    /// Of the table, through the lead.
    pub guideway: f64,
}

/// All Coulomb friction of a machine, taken off its model to act as torques and forces from outside.
pub struct Rounded {
    widths: Widths,
    coulomb: [f64; 2],
    bearing: [Vec<Law>; 2],
    pair: f64,
    guideway: f64,
    slide: Vec<Law>,
    load: f64,
    guideway_speed: f64,
}

fn laws(effects: &[EffectModel], at: impl Fn(Place) -> bool) -> Vec<Law> {
    effects
        .iter()
        .filter(|effect| at(effect.place()))
        .flat_map(|effect| effect.effect().terms())
        .filter(|term| term.site == Site::Friction && term.coordinate == Coordinate::Speed)
        .map(|term| term.law)
        .collect()
}

fn level(coulomb: f64, laws: &[Law], speed: f64) -> f64 {
    coulomb + laws.iter().map(|law| law.value(speed)).sum::<f64>()
}

impl Rounded {
    /// A machine without Coulomb friction, and its friction.
    pub fn split(model: &Model, widths: Widths) -> (Model, Self) {
        let mut smooth = model.clone();
        let friction = Rounded {
            widths,
            coulomb: Axis::ALL.map(|axis| model.motor(axis).coulomb_nm),
            bearing: Axis::ALL.map(|axis| laws(&model.effects, |place| place.has(axis))),
            pair: model.feed.pair_coulomb_nm,
            guideway: model.feed.guideway_coulomb_n,
            slide: laws(&model.effects, |place| place == Place::Feed),
            load: model.feed.load_n,
            guideway_speed: widths.guideway * model.feed.travel_per_radian(),
        };
        for axis in Axis::ALL {
            smooth.motor_mut(axis).coulomb_nm = 0.0;
        }
        smooth.feed.pair_coulomb_nm = 0.0;
        smooth.feed.guideway_coulomb_n = 0.0;
        smooth
            .effects
            .retain(|effect| effect.effect().kind() != "stribeck_friction");
        (smooth, friction)
    }

    /// Puts the friction of its present speeds on the machine.
    pub fn act(&self, machine: &mut Machine) {
        let speed = Axis::ALL.map(|axis| machine.motor(axis).omega);
        let pair = self.pair * ((speed[0] - speed[1]) / self.widths.pair).tanh();
        for axis in Axis::ALL {
            let (k, side) = match axis {
                Axis::Screw => (0, 1.0),
                Axis::Nut => (1, -1.0),
            };
            let bearing = level(self.coulomb[k], &self.bearing[k], speed[k])
                * (speed[k] / self.widths.bearing).tanh();
            machine.set_disturbance_torque(axis, -bearing - side * pair);
        }
        let table = machine.table_velocity();
        let slide = level(self.guideway, &self.slide, table) * (table / self.guideway_speed).tanh();
        machine.set_load_force(self.load + slide);
    }
}
