//! The steps one after the other, each kept when it is done.

use crate::electrical::{Electrical, MotorElectrical};
use crate::mechanical::Mechanical;
use crate::proposal::{changes, propose};
use crate::quantity::{Quantity, both, digits};
use crate::session::Session;
use crate::tune::{Wanted, tune};
use crate::{
    Bound, Estimate, Failure, LoopResponse, current_response, electrical, mechanical,
    speed_response,
};
use anyhow::{Context, Result, bail};
use link::host::dialogue::Dialogue;
use link::host::refused::Refused;
use link::settings::{EncoderDirection, EncoderInterface, Settings};
use serde::{Deserialize, Serialize};
use std::fmt;

/// A step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Zeros, wiring, directions, pole pairs, angles: the drive's own start.
    Start,
    /// [`electrical`].
    Electrical,
    /// [`mechanical`].
    Mechanical,
    /// [`tune`](crate::tune).
    Tuning,
    /// The angles of both rotors once more, by the parameters that are known now.
    Angle,
    /// [`current_response`] and [`speed_response`].
    Response,
}

impl Step {
    /// In their order.
    pub const ALL: [Self; 6] = [
        Self::Start,
        Self::Electrical,
        Self::Mechanical,
        Self::Tuning,
        Self::Angle,
        Self::Response,
    ];

    /// For a person.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Electrical => "electrical",
            Self::Mechanical => "mechanical",
            Self::Tuning => "tuning",
            Self::Angle => "angle",
            Self::Response => "response",
        }
    }

    /// What it does, for a person.
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::Start => {
                "current zeros, wiring, encoder directions, pole pairs and angles of both motors"
            }
            Self::Electrical => {
                "both motors turn together, with currents along d: resistance, inductance, flux, angle, dead time"
            }
            Self::Mechanical => {
                "both motors accelerate, and the table to and fro: inertia, friction, lead"
            }
            Self::Angle => "both motors turn together once more: their angles, which are put right",
            Self::Response => {
                "steps of the current along d and of the speed while both motors turn together: the loops, measured beside the model"
            }
            Self::Tuning => "gains of Eqs 9 to 12 for the bandwidth and margin that are wanted",
        }
    }
}

/// A limit and how near the step came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limited {
    /// Of what.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The largest that was measured.
    pub reached: f64,
    /// The limit.
    pub limit: f64,
}

impl fmt::Display for Limited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [reached, limit] = [self.reached, self.limit].map(digits);
        let Self { name, unit, .. } = self;
        write!(f, "{name:<39} {reached:>12} of {limit} {unit} allowed")
    }
}

/// What a machine's model needs beyond the drive's settings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Halves of the 95 % intervals of the inertias of screw and nut without the table, kg m^2.
    #[serde(default)]
    pub inertia_plus_minus_kg_m2: [f64; 2],
    /// Coulomb friction of the bearings of screw and nut, N m.
    pub coulomb_nm: [f64; 2],
    /// Viscous friction of the same, N m s/rad.
    pub viscous_nm_s: [f64; 2],
    /// The table's mass through the lead, kg m^2.
    pub table_kg_m2: f64,
    /// Half of its 95 % interval, kg m^2.
    #[serde(default)]
    pub table_plus_minus_kg_m2: f64,
    /// Coulomb friction of ball pair and guideway together, N m at the screw.
    pub feed_coulomb_nm: f64,
    /// Viscous friction of the same, N m s/rad.
    pub feed_viscous_nm_s: f64,
    /// Load against positive travel, N m at the screw.
    pub load_nm: f64,
    /// The table's resonance on the screw, Hz; `None` where the scale does not show it.
    #[serde(default)]
    pub axial_hz: Option<f64>,
}

/// A step that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Done {
    /// The acceleration of the base speed that a later step sets again, rpm/s.
    pub base_acceleration_rpm_s: Option<f64>,
    /// Frictions and the table, of the step that measures them.
    pub machine: Option<Machine>,
    /// Both motors' windings and magnets, of the step that measures them.
    #[serde(default)]
    pub motors: Option<[MotorElectrical; 2]>,
    /// Responses of the current loops, of the step that measures them; `None` for a motor whose step was not seen.
    #[serde(default)]
    pub responses: Option<[Option<LoopResponse>; 2]>,
    /// Responses of the speed loops, of the same step; `None` for a motor whose steps the ripple of its torque hides.
    #[serde(default)]
    pub speed_responses: Option<[Option<LoopResponse>; 2]>,
    /// Which.
    pub step: Step,
    /// How long it took, by the drive's time, s.
    pub seconds: f64,
    /// What it measured.
    pub quantities: Vec<Quantity>,
    /// What it had to keep.
    pub limits: Vec<Limited>,
}

impl Done {
    /// A step that measured nothing.
    fn of(step: Step, seconds: f64) -> Self {
        Self {
            base_acceleration_rpm_s: None,
            machine: None,
            motors: None,
            responses: None,
            speed_responses: None,
            step,
            seconds,
            quantities: Vec::new(),
            limits: Vec::new(),
        }
    }
}

/// The machine and its motors, once the steps that measure them are done.
#[must_use]
pub fn measured(done: &[Done]) -> Option<(Machine, [MotorElectrical; 2])> {
    let machine = done.iter().find_map(|done| done.machine)?;
    Some((machine, done.iter().find_map(|done| done.motors)?))
}

/// How far the steps may go, and what is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Furthest that the table may move to each side, m.
    pub travel_m: f64,
    /// Cutoff of the speed loops, rad/s, at most; `None`: as set.
    pub speed_rad_s: Option<f64>,
    /// Smallest phase margin, degrees.
    pub margin_deg: f64,
    /// The steps that are wanted: [`Step::Start`] first, and in their order.
    pub steps: &'static [Step],
}

impl Options {
    fn wanted(&self, settings: &Settings) -> Wanted {
        Wanted {
            speed_rad_s: self.speed_rad_s.unwrap_or(settings.tuning.speed_rad_s),
            margin_deg: self.margin_deg,
        }
    }
}

/// Largest travel while both motors turn together, m: what alignment and beats of their speeds leave.
const TOGETHER_M: f64 = 1e-3;

/// Does the steps that are not among `done`; each is put there when it is done and its settings hold. `progress` hears of the
/// step and how far it is, from 0 to 1; `keep` of all that is done.
///
/// # Errors
/// [`Failure`] of a step, a refusal, or a drive that is lost. It rests then, if it can.
pub async fn run<D: Dialogue>(
    session: &mut Session<D>,
    options: &Options,
    done: &mut Vec<Done>,
    progress: &mut dyn FnMut(Step, f64),
    keep: &mut dyn FnMut(&[Done]) -> Result<()>,
) -> Result<()> {
    for &step in options.steps {
        // The drive has to be ready for any of the others.
        if step != Step::Start && done.iter().any(|done| done.step == step) {
            continue;
        }
        progress(step, 0.0);
        let result = match step {
            Step::Start => start(session).await,
            Step::Electrical => {
                electrical_step(session, options, &mut |part| progress(step, part)).await
            }
            Step::Mechanical => {
                let held = done.iter().find_map(|done| done.base_acceleration_rpm_s);
                mechanical_step(session, options, held, &mut |part| progress(step, part)).await
            }
            Step::Tuning => tuning_step(session, options).await,
            Step::Angle => angle_step(session, options, &mut |part| progress(step, part)).await,
            Step::Response => {
                let table = done
                    .iter()
                    .find_map(|done| done.machine)
                    .map_or(0.0, |machine| machine.table_kg_m2);
                response_step(session, options, table, &mut |part| progress(step, part)).await
            }
        };
        let result = match result {
            Ok(result) => result,
            Err(error) => {
                // The step's own error is the cause, but a refusal's is the fault that the drive rests in.
                let cause = match session.rest().await {
                    Err(fault) if error.is::<Refused>() => fault,
                    _ => error,
                };
                return Err(cause).context(format!("step `{}`", step.name()));
            }
        };
        done.retain(|done| done.step != step);
        done.push(result);
        keep(done)?;
        progress(step, 1.0);
    }
    Ok(())
}

async fn start<D: Dialogue>(session: &mut Session<D>) -> Result<Done> {
    let begun = session.time_s();
    session.ready().await?;
    let rest = session.noise().await?;
    let mut quantities = Vec::new();
    for (name, phases) in ["screw", "nut"].into_iter().zip(rest) {
        for (phase, [mean, noise]) in ["a", "b"].into_iter().zip(phases) {
            quantities.push(Quantity {
                name: format!("{name}: current {phase} at rest"),
                unit: "A".to_owned(),
                estimate: Estimate {
                    value: mean,
                    plus_minus: 1.96 * noise,
                },
                before: None,
            });
        }
    }
    Ok(Done {
        quantities,
        ..Done::of(Step::Start, session.time_s() - begun)
    })
}

fn limits(of: [(&str, &str, Bound); 3]) -> Vec<Limited> {
    of.map(|(name, unit, bound)| Limited {
        name: name.to_owned(),
        unit: unit.to_owned(),
        reached: bound.reached,
        limit: bound.limit,
    })
    .to_vec()
}

async fn electrical_step<D: Dialogue>(
    session: &mut Session<D>,
    options: &Options,
    progress: &mut dyn FnMut(f64),
) -> Result<Done> {
    let (begun, old) = (session.time_s(), *session.settings());
    session.arm().await?;
    let travel_m = TOGETHER_M.min(options.travel_m);
    let found = electrical::measure(session, electrical::SPEEDS, travel_m, progress).await?;
    let dead_time_s = found.dead_time_s(session.pwm_period_s(), session.bus_v());
    let new = mechanical::prepared(&found.applied(&old, dead_time_s));
    session.configure(&new).await?;
    let quantities = electrical_quantities(&found, &old, &new);
    let [screw, nut] = found.current_a;
    Ok(Done {
        base_acceleration_rpm_s: Some(old.feed.base_acceleration_max_rpm_s),
        motors: Some(found.motors),
        quantities,
        limits: limits([
            ("current of the screw's motor", "A", screw),
            ("current of the nut's motor", "A", nut),
            ("travel of the table", "mm", found.travel_m.times(1e3)),
        ]),
        ..Done::of(Step::Electrical, session.time_s() - begun)
    })
}

/// What the electrical step measured, beside the settings before and after it.
fn electrical_quantities(found: &Electrical, old: &Settings, new: &Settings) -> Vec<Quantity> {
    let motors = found.motors;
    let was =
        |of: &dyn Fn(&link::settings::MotorSettings) -> f64| Some([of(&old.screw), of(&old.nut)]);
    let mut quantities = Vec::new();
    let q = &mut quantities;
    both(
        q,
        "resistance, line to line",
        "ohm",
        motors.map(|m| m.resistance_ohm.times(2.0)),
        was(&|m| m.resistance_line_to_line_ohm),
    );
    both(
        q,
        "inductance, line to line",
        "mH",
        motors.map(|m| m.inductance_h.times(2e3)),
        was(&|m| m.inductance_line_to_line_mh),
    );
    let constants = [(motors[0], &new.screw), (motors[1], &new.nut)].map(|(found, motor)| {
        let share = found.flux_wb.plus_minus / found.flux_wb.value;
        Estimate {
            value: motor.voltage_constant_v_rms_per_krpm,
            plus_minus: share * motor.voltage_constant_v_rms_per_krpm,
        }
    });
    both(
        q,
        "voltage constant, rms",
        "V/krpm",
        constants,
        was(&|m| m.voltage_constant_v_rms_per_krpm),
    );
    both(
        q,
        "angle behind the rotor",
        "electrical degrees",
        motors.map(|m| m.offset_deg),
        None,
    );
    both(
        q,
        "dead time not compensated",
        "V",
        motors.map(|m| m.dead_time_v),
        None,
    );
    if motors.iter().all(|motor| motor.turning_a.value > 0.0) {
        let turning = motors.map(|motor| motor.turning_a);
        both(q, "current that turns a leg", "A", turning, None);
    }
    let mut bridge = |name: &str, unit: &str, now, before| {
        q.push(Quantity {
            name: format!("bridge: {name}"),
            unit: unit.to_owned(),
            estimate: Estimate {
                value: now,
                plus_minus: 0.0,
            },
            before: Some(before),
        });
    };
    let (now, before) = (&new.bridge, &old.bridge);
    bridge(
        "dead time, compensated",
        "ns",
        now.dead_time_ns,
        before.dead_time_ns,
    );
    bridge(
        "current of full compensation",
        "A",
        now.dead_time_fade_a,
        before.dead_time_fade_a,
    );
    quantities
}

async fn mechanical_step<D: Dialogue>(
    session: &mut Session<D>,
    options: &Options,
    base_acceleration_rpm_s: Option<f64>,
    progress: &mut dyn FnMut(f64),
) -> Result<Done> {
    let (begun, old) = (session.time_s(), *session.settings());
    session.arm().await?;
    let found = mechanical::measure(session, options.travel_m, progress).await?;
    let mut new = found.applied(&old);
    if let Some(acceleration) = base_acceleration_rpm_s {
        new.feed.base_acceleration_max_rpm_s = acceleration;
    }
    // Tuned at once, and said here: the next step finds it done.
    let (period_s, step_s) = (session.pwm_period_s(), session.speed_step_s());
    let tuned = tune(&new, options.wanted(&new), period_s, step_s);
    let new = tuned.map_or(new, |tuned| tuned.settings);
    session.configure(&new).await?;
    let quantities = mechanical_quantities(&found, &old, &new);
    check_lead(&found, &old)?;
    let [screw, nut] = found.torque_nm;
    Ok(Done {
        machine: Some(Machine {
            inertia_plus_minus_kg_m2: found.motors.map(|motor| motor.inertia_kg_m2.plus_minus),
            coulomb_nm: found.motors.map(|motor| motor.coulomb_nm.value),
            viscous_nm_s: found.motors.map(|motor| motor.viscous_nm_s.value),
            table_kg_m2: found.table_kg_m2.value,
            table_plus_minus_kg_m2: found.table_kg_m2.plus_minus,
            feed_coulomb_nm: found.feed_coulomb_nm.value,
            feed_viscous_nm_s: found.feed_viscous_nm_s.value,
            load_nm: found.load_nm.value,
            axial_hz: found.axial_hz.map(|hz| hz.value),
        }),
        quantities,
        limits: limits([
            ("torque of the screw's motor", "N m", screw),
            ("torque of the nut's motor", "N m", nut),
            ("travel of the table", "mm", found.travel_m.times(1e3)),
        ]),
        ..Done::of(Step::Mechanical, session.time_s() - begun)
    })
}

/// What the mechanical step measured, beside the settings before and after it.
fn mechanical_quantities(found: &Mechanical, old: &Settings, new: &Settings) -> Vec<Quantity> {
    let mut quantities = Vec::new();
    let q = &mut quantities;
    changes(q, old, new);
    both(
        q,
        "inertia, with the table",
        "kg cm^2",
        found.moved_kg_m2().map(|j| j.times(1e4)),
        Some([old.screw.inertia_kg_cm2, old.nut.inertia_kg_cm2]),
    );
    both(
        q,
        "Coulomb friction",
        "N m",
        found.motors.map(|m| m.coulomb_nm),
        None,
    );
    both(
        q,
        "viscous friction",
        "N m s",
        found.motors.map(|m| m.viscous_nm_s),
        None,
    );
    let mut one = |name: &str, unit: &str, estimate, before| {
        quantities.push(Quantity {
            name: name.to_owned(),
            unit: unit.to_owned(),
            estimate,
            before,
        });
    };
    one(
        "feed: table through the lead",
        "kg cm^2",
        found.table_kg_m2.times(1e4),
        None,
    );
    one(
        "feed: Coulomb friction at the screw",
        "N m",
        found.feed_coulomb_nm,
        None,
    );
    one(
        "feed: viscous friction at the screw",
        "N m s",
        found.feed_viscous_nm_s,
        None,
    );
    one("feed: load at the screw", "N m", found.load_nm, None);
    one(
        "feed: lead by the scale",
        "mm",
        found.lead_m.times(1e3),
        Some(old.feed.lead_mm),
    );
    if let Some(hz) = found.axial_hz {
        one("feed: axial resonance by the scale", "Hz", hz, None);
    }
    quantities
}

/// The scale and the encoders show the lead that is set.
fn check_lead(found: &Mechanical, old: &Settings) -> Result<()> {
    let lead = found.lead_m.value / (old.feed.lead_mm * 1e-3);
    if !(0.9..1.1).contains(&lead) {
        bail!(Failure {
            measured: format!(
                "a turn of the screw moves the scale by {:.4} mm",
                found.lead_m.value * 1e3
            ),
            expected: format!("feed.lead_mm = {}", old.feed.lead_mm),
            check: if lead < 0.0 {
                "the direction in which the scale counts, or in which both motors turn: exchange its channels A and B".to_owned()
            } else {
                "feed.lead_mm and feed.scale_count_nm".to_owned()
            },
        });
    }
    Ok(())
}

async fn tuning_step<D: Dialogue>(session: &mut Session<D>, options: &Options) -> Result<Done> {
    let (begun, old) = (session.time_s(), *session.settings());
    let (period_s, step_s) = (session.pwm_period_s(), session.speed_step_s());
    let proposal = propose(&old, options.wanted(&old), period_s, step_s)?;
    if proposal.settings != old {
        session.configure(&proposal.settings).await?;
    }
    Ok(Done {
        quantities: proposal.quantities,
        ..Done::of(Step::Tuning, session.time_s() - begun)
    })
}

async fn angle_step<D: Dialogue>(
    session: &mut Session<D>,
    options: &Options,
    progress: &mut dyn FnMut(f64),
) -> Result<Done> {
    let (begun, old) = (session.time_s(), *session.settings());
    session.arm().await?;
    let travel_m = TOGETHER_M.min(options.travel_m);
    let found = electrical::measure(session, electrical::FAST, travel_m, progress).await?;
    let behind = found.motors.map(|motor| motor.offset_deg);
    session.correct(behind.map(|angle| angle.value)).await?;
    let mut quantities = Vec::new();
    both(
        &mut quantities,
        "angle put right by",
        "electrical degrees",
        behind,
        None,
    );
    // An absolute encoder has the same angle the next time.
    let mut new = old;
    for (k, motor) in [&mut new.screw, &mut new.nut].into_iter().enumerate() {
        if motor.encoder.interface == EncoderInterface::Mt6835 {
            let (zero_deg, backwards) = session.encoder_zero(k);
            motor.encoder.zero_deg = zero_deg;
            motor.encoder.direction = if backwards {
                EncoderDirection::Backwards
            } else {
                EncoderDirection::Forwards
            };
        }
    }
    if new != old {
        session.configure(&new).await?;
    }
    let [screw, nut] = found.current_a;
    Ok(Done {
        quantities,
        limits: limits([
            ("current of the screw's motor", "A", screw),
            ("current of the nut's motor", "A", nut),
            ("travel of the table", "mm", found.travel_m.times(1e3)),
        ]),
        ..Done::of(Step::Angle, session.time_s() - begun)
    })
}

async fn response_step<D: Dialogue>(
    session: &mut Session<D>,
    options: &Options,
    table_kg_m2: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<Done> {
    let begun = session.time_s();
    session.arm().await?;
    let responses = current_response::measure(session, &mut |part| progress(0.5 * part)).await?;
    session.arm().await?;
    let speed_responses =
        speed_response::measure(session, options.travel_m, table_kg_m2, &mut |part| {
            progress(0.5 + 0.5 * part);
        })
        .await?;
    Ok(Done {
        responses: Some(responses),
        speed_responses: Some(speed_responses),
        ..Done::of(Step::Response, session.time_s() - begun)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_printed_in_plain_decimals() {
        let limited = Limited {
            name: "current of the screw's motor".to_owned(),
            unit: "A".to_owned(),
            reached: 8.086,
            limit: 8.745,
        };
        let said = limited.to_string();
        assert!(said.ends_with(" 8.086 of 8.745 A allowed"), "{said}");
    }
}
