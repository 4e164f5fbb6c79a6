//! The axis as a model: mass, friction, what repeats with the screw, the amplifier's lag.

use super::record::Law;
use crate::predict::curve::Over;

/// A part of the model that can be added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Term {
    /// Lag of the force behind the controller's output, s: sampling, amplifier.
    Lag,
    /// Friction above Coulomb at rest (Stribeck), N, with the speed of its decay, m/s.
    Stribeck,
    /// Viscous friction that grows less than the speed, N s^2/m^2.
    Saturation,
    /// Viscous friction that differs by direction, N s/m.
    Asymmetry,
    /// Friction's spring before sliding: its stiffness, N/m, in place of a jump.
    Presliding,
    /// Force that repeats with the screw, periods per turn: cosine and sine, N.
    Periodic(f64),
    /// Friction that grows with position: N/m.
    PositionFriction,
    /// Load that grows with position: N/m.
    PositionLoad,
    /// Force per volt that differs by direction, as that of brushes off their neutral does: more of it forth and as much less back, a
    /// share.
    DirectionGain,
    /// A force over the travel that no hypothesis is the cause of: a cosine series, N for each number of half waves.
    Travel {
        /// Whether it is friction, against the motion, or a load.
        friction: bool,
        /// Position at which the cosines start, m.
        from_m: f64,
        /// Length of the first one's half wave, m.
        length_m: f64,
        /// How many there are.
        half_waves: usize,
    },
    /// A force that was measured and has no name: points at equal distances over a coordinate, N; straight lines between them,
    /// nothing outside.
    Measured {
        /// Over what: m, m/s, m since the reversal, or rad of the screw.
        over: Over,
        /// Coordinate of the first and the last point.
        range: [f64; 2],
        /// How many points.
        points: usize,
    },
}

impl Term {
    /// Starting values of its parameters.
    pub fn start(self) -> Vec<f64> {
        match self {
            Term::Lag => vec![1e-3],
            Term::Stribeck => vec![3.0, 0.02],
            Term::Presliding => vec![4e6],
            Term::Periodic(_) => vec![0.1, 0.1],
            Term::Travel { half_waves, .. } => vec![0.0; half_waves],
            Term::Measured { points, .. } => vec![0.0; points],
            _ => vec![0.0],
        }
    }

    /// Sizes in which its parameters are counted, so that a fit sees numbers of the same order.
    pub fn scale(self) -> Vec<f64> {
        match self {
            Term::Lag => vec![1e-3],
            Term::Stribeck => vec![5.0, 0.02],
            Term::Saturation => vec![300.0],
            Term::Asymmetry => vec![10.0],
            Term::Presliding => vec![2e6],
            Term::Periodic(_) => vec![1.0, 1.0],
            Term::PositionFriction | Term::PositionLoad => vec![5.0],
            Term::DirectionGain => vec![0.01],
            Term::Travel { half_waves, .. } => vec![1.0; half_waves],
            Term::Measured { points, .. } => vec![1.0; points],
        }
    }

    /// As in a model file.
    pub fn kind(self) -> &'static str {
        match self {
            Term::Lag => "force_lag",
            Term::Stribeck => "stribeck_friction",
            Term::Saturation => "viscous_saturation",
            Term::Asymmetry => "viscous_asymmetry",
            Term::Presliding => "presliding",
            Term::Periodic(_) => "angle_periodic",
            Term::PositionFriction => "position_friction",
            Term::PositionLoad => "position_load",
            Term::DirectionGain => "gain_by_direction",
            Term::Travel { friction: true, .. } => "friction_over_travel",
            Term::Travel { .. } => "load_over_travel",
            Term::Measured { .. } => "measured",
        }
    }

    /// Where it acts.
    pub fn place(self) -> &'static str {
        match self {
            Term::Periodic(_) => "screw",
            _ => "feed",
        }
    }

    /// Names and units of its parameters; those of what repeats with the screw are cosine and sine.
    pub fn names(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Term::Lag => &[("value", "s")],
            Term::Stribeck => &[("amplitude", "N"), ("speed", "m/s")],
            Term::Saturation => &[("value", "N s\u{B2}/m\u{B2}")],
            Term::Asymmetry => &[("value", "N s/m")],
            Term::Presliding => &[("stiffness", "N/m")],
            Term::Periodic(_) => &[("cosine", "N"), ("sine", "N")],
            Term::PositionFriction | Term::PositionLoad => &[("value", "N/m")],
            Term::DirectionGain => &[("value", "")],
            Term::Travel { .. } | Term::Measured { .. } => &[],
        }
    }

    /// In a table.
    pub fn name(self) -> String {
        match self {
            Term::Lag => "lag of the force".into(),
            Term::Stribeck => "friction at low speed".into(),
            Term::Saturation => "viscous friction that saturates".into(),
            Term::Asymmetry => "viscous friction by direction".into(),
            Term::Presliding => "presliding".into(),
            Term::Periodic(order) => format!(
                "force {} per turn of the screw",
                (100.0 * order).round() / 100.0
            ),
            Term::PositionFriction => "friction over position".into(),
            Term::PositionLoad => "load over position".into(),
            Term::DirectionGain => "force per volt by direction".into(),
            Term::Travel { .. } => "shape over the travel".into(),
            Term::Measured { over, .. } => format!("measured force over {}", over.name()),
        }
    }
}

/// The model: four base parameters and those of the terms.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Moving mass, kg; viscous friction, N s/m; Coulomb friction, N; offset, N.
    pub base: [f64; 4],
    /// Added parts with their parameters.
    pub terms: Vec<(Term, Vec<f64>)>,
    /// Angle of the screw at position 0, rad: the homing, which belongs to a record.
    pub homing: f64,
    /// Speed over which dry friction turns round, m/s.
    pub width_m_s: f64,
    /// Travel per turn of the motor, m.
    pub lead_m: f64,
    /// Limit of the controller's output, V.
    pub limit_v: f64,
    /// How the controller differentiates the position.
    pub law: Law,
}

impl Axis {
    /// Parameters in units of their scales.
    pub fn parameters(&self) -> Vec<f64> {
        let own = self.base.iter().zip(BASE_SCALE).map(|(v, s)| v / s);
        own.chain(self.terms.iter().flat_map(|(term, values)| {
            values
                .iter()
                .zip(term.scale())
                .map(|(v, s)| v / s)
                .collect::<Vec<_>>()
        }))
        .collect()
    }

    /// Scales of the parameters.
    pub(super) fn scales(&self) -> Vec<f64> {
        let terms = self.terms.iter().flat_map(|(term, _)| term.scale());
        BASE_SCALE.into_iter().chain(terms).collect()
    }

    /// The same model with other parameters, in units of their scales.
    pub fn with(&self, parameters: &[f64]) -> Self {
        let mut changed = self.clone();
        for (k, value) in changed.base.iter_mut().enumerate() {
            *value = parameters[k] * BASE_SCALE[k];
        }
        let mut at = 4;
        for (term, values) in &mut changed.terms {
            for (value, scale) in values.iter_mut().zip(term.scale()) {
                *value = parameters[at] * scale;
                at += 1;
            }
        }
        changed
    }

    /// Orders of what repeats with the screw.
    pub fn orders(&self) -> Vec<f64> {
        self.terms
            .iter()
            .filter_map(|(term, _)| match term {
                Term::Periodic(order) => Some(*order),
                _ => None,
            })
            .collect()
    }

    /// The same model with each of its orders moved by so much.
    pub(super) fn moved(&self, by: &[f64]) -> Self {
        let mut changed = self.clone();
        let orders = changed.terms.iter_mut().filter_map(|(term, _)| match term {
            Term::Periodic(order) => Some(order),
            _ => None,
        });
        orders.zip(by).for_each(|(order, by)| *order += by);
        changed
    }

    pub(super) fn find(&self, wanted: Term) -> Option<&[f64]> {
        self.terms
            .iter()
            .find(|(term, _)| *term == wanted)
            .map(|(_, values)| values.as_slice())
    }

    pub(super) fn one(&self, wanted: Term) -> f64 {
        self.find(wanted).map_or(0.0, |values| values[0])
    }
}

const BASE_SCALE: [f64; 4] = [100.0, 200.0, 20.0, 3.0];
