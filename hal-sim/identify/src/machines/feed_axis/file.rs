//! The model file of an axis.

use super::axis::{Axis, Term};
use super::record::Law;
use super::width::NARROW_M_S;
use crate::machines::ModelFileError;
use crate::predict::curve::Over;
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::{Table, Value};

/// What a model file must have.
const EXPECTED: &str = "expected the table [axis] with mass_kg, viscous_n_s_per_m, coulomb_n, offset_n, lead_m, limit_v";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    axis: Plate,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    effects: Vec<Table>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Plate {
    /// Moving mass; above 0.
    mass_kg: f64,
    /// Viscous friction.
    viscous_n_s_per_m: f64,
    /// Coulomb friction.
    coulomb_n: f64,
    /// Force that the motor needs at rest.
    offset_n: f64,
    /// Travel per turn of the motor; above 0.
    lead_m: f64,
    /// Limit of the controller's output; above 0.
    limit_v: f64,
    /// Periods over which the controller differentiates; without it dq/dt is taken as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    difference_periods: Option<usize>,
    /// Speed over which dry friction turns round; above 0. Without it 0.5 mm/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    friction_width_m_s: Option<f64>,
}

impl Axis {
    /// Reads a model file.
    ///
    /// # Errors
    /// A file that cannot be read, or holds other keys or effects.
    pub fn load(path: &Path) -> Result<Self, ModelFileError> {
        ModelFileError::read(path, Self::parse)
    }

    /// The published model of the benchmark.
    pub fn published() -> Self {
        let text = include_str!("../../../mappings/emps-model.toml");
        Self::parse(text, "emps-model.toml").expect("the project's own file")
    }

    /// Reads a model from its text.
    ///
    /// # Errors
    /// As [`Axis::load`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, ModelFileError> {
        let fault = |reason| ModelFileError::new(origin, format!("{reason}; {EXPECTED}"));
        let File { axis, effects } = toml::from_str(text).map_err(|e| fault(e.to_string()))?;
        let terms = effects
            .iter()
            .map(|effect| term(effect).map_err(fault))
            .collect::<Result<_, _>>()?;
        let width_m_s = axis.friction_width_m_s.unwrap_or(NARROW_M_S);
        let plate = [axis.mass_kg, axis.lead_m, axis.limit_v, width_m_s];
        if !plate.iter().all(|v| v.is_finite() && *v > 0.0) {
            let names = "mass_kg, lead_m, limit_v and friction_width_m_s";
            return Err(fault(format!("{names} must be positive")));
        }
        let axis = Axis {
            base: [
                axis.mass_kg,
                axis.viscous_n_s_per_m,
                axis.coulomb_n,
                axis.offset_n,
            ],
            terms,
            homing: 0.0,
            width_m_s,
            lead_m: axis.lead_m,
            limit_v: axis.limit_v,
            law: axis
                .difference_periods
                .map_or(Law::Ideal, |periods| Law::Difference(periods.clamp(1, 64))),
        };
        if !axis.parameters().iter().all(|v| v.is_finite()) {
            return Err(fault("a number is nan, inf or as good as inf".into()));
        }
        Ok(axis)
    }

    /// As a model file has it.
    pub fn to_toml(&self) -> String {
        let [mass_kg, viscous_n_s_per_m, coulomb_n, offset_n] = self.base;
        let file = File {
            axis: Plate {
                mass_kg,
                viscous_n_s_per_m,
                coulomb_n,
                offset_n,
                lead_m: self.lead_m,
                limit_v: self.limit_v,
                difference_periods: match self.law {
                    Law::Ideal => None,
                    Law::Difference(periods) => Some(periods),
                },
                friction_width_m_s: Some(self.width_m_s).filter(|width| *width != NARROW_M_S),
            },
            effects: self
                .terms
                .iter()
                .map(|(term, values)| entry(*term, values))
                .collect(),
        };
        toml::to_string(&file).expect("numbers and names have a text")
    }
}

/// Key of a shape's values, N, from one half wave on.
const COSINES: &str = "cosines_n";

fn entry(term: Term, values: &[f64]) -> Table {
    let mut table = Table::new();
    table.insert("kind".into(), term.kind().into());
    table.insert("where".into(), term.place().into());
    match term {
        Term::Periodic(order) => {
            table.insert("order".into(), order.into());
        }
        Term::Travel {
            from_m, length_m, ..
        } => {
            table.insert("from_m".into(), from_m.into());
            table.insert("length_m".into(), length_m.into());
            table.insert(COSINES.into(), values.to_vec().into());
        }
        Term::Measured { over, range, .. } => {
            table.insert("over".into(), over.name().into());
            table.insert("range".into(), range.to_vec().into());
            table.insert(VALUES.into(), values.to_vec().into());
        }
        _ => {}
    }
    for ((name, _), value) in term.names().iter().zip(values) {
        table.insert((*name).into(), (*value).into());
    }
    table
}

/// Key of a measured force's values, N.
const VALUES: &str = "values_n";

/// A measured force from its table.
fn measured(effect: &Table) -> Result<(Term, Vec<f64>), String> {
    let list = |name: &str| -> Option<Vec<f64>> {
        let list = effect.get(name)?.as_array()?;
        let numbers: Option<Vec<f64>> = list.iter().map(Value::as_float).collect();
        numbers.filter(|numbers| numbers.iter().all(|x| x.is_finite()))
    };
    let named = effect
        .get("over")
        .and_then(Value::as_str)
        .unwrap_or_default();
    let over = Over::ALL
        .into_iter()
        .find(|over| over.name() == named)
        .ok_or_else(|| {
            let names = Over::ALL.map(Over::name).join("`, `");
            format!("a measured force has `over` = `{named}`, expected one of `{names}`")
        })?;
    match (list("range").as_deref(), list(VALUES)) {
        (Some([low, high]), Some(values)) if low < high && values.len() > 1 => {
            let points = values.len();
            Ok((
                Term::Measured {
                    over,
                    range: [*low, *high],
                    points,
                },
                values,
            ))
        }
        _ => Err(format!(
            "a measured force lacks `range` (two finite numbers, the smaller first) or `{VALUES}` (two finite numbers or more)"
        )),
    }
}

/// A shape over the travel, to be filled in.
fn over_travel(friction: bool) -> Term {
    Term::Travel {
        friction,
        from_m: 0.0,
        length_m: 1.0,
        half_waves: 0,
    }
}

fn term(effect: &Table) -> Result<(Term, Vec<f64>), String> {
    let number = |name: &str| {
        effect
            .get(name)
            .and_then(|v| v.as_float().or(v.as_integer().map(|v| v as f64)))
            .filter(|v| v.is_finite())
            .ok_or_else(|| format!("an effect lacks the finite number `{name}`"))
    };
    let kind = effect
        .get("kind")
        .and_then(Value::as_str)
        .unwrap_or_default();
    if kind == "measured" {
        return measured(effect);
    }
    let known = [
        Term::Lag,
        Term::Stribeck,
        Term::Saturation,
        Term::Asymmetry,
        Term::Presliding,
        Term::Periodic(1.0),
        Term::PositionFriction,
        Term::PositionLoad,
        Term::DirectionGain,
        over_travel(true),
        over_travel(false),
    ];
    let mut term = known
        .into_iter()
        .find(|term| term.kind() == kind)
        .ok_or_else(|| format!("the effect `{kind}` is unknown to an axis"))?;
    match &mut term {
        Term::Periodic(order) => *order = number("order")?,
        Term::Travel {
            from_m,
            length_m,
            half_waves,
            ..
        } => {
            let list = effect.get(COSINES).and_then(Value::as_array);
            let values: Option<Vec<f64>> =
                list.and_then(|list| list.iter().map(Value::as_float).collect());
            let values =
                values.ok_or_else(|| format!("an effect lacks the list of numbers `{COSINES}`"))?;
            (*from_m, *length_m) = (number("from_m")?, number("length_m")?);
            *half_waves = values.len();
            return match *length_m > 0.0 {
                true => Ok((term, values)),
                false => Err("length_m of a shape over the travel must be positive".into()),
            };
        }
        _ => {}
    }
    let values = term
        .names()
        .iter()
        .map(|(name, _)| number(name))
        .collect::<Result<_, _>>()?;
    Ok((term, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_file_is_read_as_it_was_written() {
        let mut axis = Axis::published();
        axis.law = Law::Difference(2);
        let shape = Term::Travel {
            friction: true,
            from_m: 0.1,
            length_m: 0.2,
            half_waves: 3,
        };
        let measured = Term::Measured {
            over: Over::PositionByDirection,
            range: [0.1, 0.3],
            points: 3,
        };
        axis.terms = vec![
            (Term::Stribeck, vec![3.5, 0.02]),
            (Term::Periodic(17.25), vec![0.1, -0.2]),
            (shape, vec![0.5, 0.0, -0.25]),
            (measured, vec![0.0, 2.5, -1.0]),
        ];
        let text = axis.to_toml();
        let again = Axis::parse(&text, "model.toml").expect("its own text");
        assert_eq!(again.parameters(), axis.parameters());
        assert_eq!(again.law, axis.law);
        let [again, axis] = [&again, &axis].map(|axis| axis.terms.iter().map(|(term, _)| *term));
        assert!(again.eq(axis));
        let error = Axis::parse(&text.replace("stribeck", "stribek"), "model.toml");
        assert!(error.unwrap_err().to_string().contains("stribek_friction"));
    }
}
