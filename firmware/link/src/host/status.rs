//! A drive's status, faults and journal as values in SI units and as JSON.

use crate::codes::{
    ActiveLimits, EventKind, Fault, FaultSet, Limit, Misalignment, Origin, ResetReason, State,
    TableFit, TableFits, Warning,
};
use crate::message::{Event, Recorded, Status, Travel};
use crate::scale;
use crate::settings::{Setting, Settings};
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// A status with the meaning of its words.
pub struct StatusReport {
    status: Status,
    /// `None`: a state that this program does not know.
    pub state: Option<State>,
}

impl StatusReport {
    /// Of the drive's answer.
    #[must_use]
    pub fn of(status: Status) -> Self {
        Self {
            state: State::of_words(status.state, status.fault),
            status,
        }
    }

    /// The supply, V: the mean of both bridges' readings.
    #[must_use]
    pub fn bus_v(&self) -> f64 {
        let bridges = self.status.motors.iter();
        bridges
            .map(|motor| f64::from(motor.bus_mv) / 1e3)
            .sum::<f64>()
            / 2.0
    }

    /// The fault that has stopped it.
    pub fn fault(&self) -> Option<Fault> {
        Fault::of_word(self.status.fault)
    }

    /// What was found after that, in the order of their numbers: the journal has the times.
    pub fn further(&self) -> impl Iterator<Item = Fault> {
        let latched = FaultSet::of_words(self.status.latched);
        latched.iter().filter(|fault| Some(*fault) != self.fault())
    }

    /// What limits a motor, or the pair.
    pub fn limits(&self, motor: Option<usize>) -> impl Iterator<Item = Limit> {
        ActiveLimits::of_word(self.status.limits).iter(motor)
    }

    /// How a move is going.
    pub fn travel(&self) -> Option<Travel> {
        Travel::of_word(self.status.travel)
    }

    /// Name of the state.
    #[must_use]
    pub fn state_name(&self) -> &'static str {
        self.state.map_or("unknown", State::name)
    }

    /// Why the rotors could not be aligned, as long as they are not. The drive keeps the reason of its last failed alignment.
    pub fn misalignment(&self) -> Option<Misalignment> {
        let is_unaligned = match self.state {
            Some(State::Fault(fault)) => fault.is_misalignment(),
            state => matches!(state, Some(State::Unaligned) | None),
        };
        Misalignment::of_word(self.status.misalignment).filter(|_| is_unaligned)
    }

    /// Which settings the drive runs on.
    #[must_use]
    pub fn origin(&self) -> Option<Origin> {
        Origin::of_word(self.status.runs_on)
    }

    /// The stored setting that does not fit.
    pub fn unfit(&self) -> Option<Setting> {
        Setting::numbered(self.status.unfit)
    }

    /// The tables of compensation that were saved, and what was found of them.
    pub fn tables(&self) -> impl Iterator<Item = (&'static str, TableFit)> {
        let fits = TableFits(self.status.tables);
        let each = TableFits::NAMES.into_iter().enumerate();
        each.filter_map(move |(table, name)| {
            let fit = fits.of(table)?;
            (fit != TableFit::None).then_some((name, fit))
        })
    }

    /// Speed of motor 0 (screw) or 1 (nut), rpm.
    pub fn rpm(&self, motor: usize) -> f64 {
        scale::value(self.status.motors[motor].speed, scale::BASE_SPEED) * 60.0 / TAU
    }

    /// Currents d and q of motor 0 (screw) or 1 (nut), A.
    #[must_use]
    pub fn currents(&self, motor: usize) -> [f64; 2] {
        let current = self.status.motors[motor].current;
        current.map(|word| scale::value(word, scale::CURRENT))
    }

    /// The drive knows where its table is.
    pub fn homed(&self) -> bool {
        self.status.origin.is_some()
    }

    /// The table's place, mm: homed, or from where its scale counts zero.
    pub fn position_mm(&self, settings: &Settings) -> f64 {
        let origin = self.status.origin.unwrap_or_default();
        f64::from(self.status.scale.wrapping_sub(origin)) * settings.feed.scale_count_nm * 1e-6
    }

    /// The table's velocity by both motors' speeds, mm/s.
    #[must_use]
    pub fn velocity_mm_s(&self, settings: &Settings) -> f64 {
        (self.rpm(0) - self.rpm(1)) / 60.0 * settings.feed.lead_mm
    }

    /// In a line.
    pub fn line(&self, settings: &Settings) -> String {
        let mut line = format!("{:9.3} s  {}", self.seconds(), self.state_name());
        if self.status.armed {
            line += ", armed";
        }
        if let Some(fault) = self.fault() {
            line += &format!(" ({})", fault.name());
        }
        for (motor, name) in ["screw", "nut"].into_iter().enumerate() {
            let (rpm, [_, i_q]) = (self.rpm(motor), self.currents(motor));
            line += &format!("  {name} {rpm:+.1} rpm, i_q {i_q:+.3} A");
        }
        let homed = if self.homed() { "" } else { " (not homed)" };
        line + &format!(
            "  table {:+.4} mm{homed}, {:+.3} mm/s",
            self.position_mm(settings),
            self.velocity_mm_s(settings)
        )
    }

    /// Time since the drive's start, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        f64::from(self.status.uptime_ms) / 1e3
    }

    /// As JSON, each key with its unit.
    pub fn json(&self, settings: &Settings, simulated: bool) -> Value {
        json!({
            "state": self.state_name(),
            "fault": self.fault().map(fault_json),
            "further_faults": self.further().map(fault_json).collect::<Vec<_>>(),
            "limited_by": self.limits_json(None),
            "misalignment": self.misalignment().map(|reason| json!({
                "name": reason.name(),
                "sentence": reason.sentence(),
            })),
            "tables": self.tables().map(|(name, fit)| json!({
                "table": name,
                "name": fit.name(),
                "sentence": fit.sentence(),
            })).collect::<Vec<Value>>(),
            "warnings": settings.warnings().map(|warning| json!({
                "name": warning.name(),
                "sentence": warning.sentence(),
            })).collect::<Vec<Value>>(),
            "settings": self.origin().map(|origin| json!({
                "name": origin.name(),
                "sentence": origin.sentence(),
                "unfit": self.unfit().map(|setting| setting.to_string()),
            })),
            "armed": self.status.armed,
            "simulated": simulated,
            "uptime_s": self.seconds(),
            "travel": self.travel().map_or("unknown", Travel::name),
            "screw": self.motor_json(0, settings),
            "nut": self.motor_json(1, settings),
            "table": self.table_json(settings),
            "link": self.link_json(),
        })
    }

    fn limits_json(&self, motor: Option<usize>) -> Vec<Value> {
        let limits = self.limits(motor);
        let limit = |limit: Limit| json!({ "name": limit.name(), "sentence": limit.sentence() });
        limits.map(limit).collect()
    }

    fn motor_json(&self, motor: usize, settings: &Settings) -> Value {
        let (words, [i_d, i_q]) = (&self.status.motors[motor], self.currents(motor));
        let plate = [&settings.screw, &settings.nut][motor];
        let latched = FaultSet::of_words(self.status.latched);
        let state = self.state.map(|state| state.of_motor(motor, latched));
        let own = match state {
            Some(State::Fault(fault)) => Some(fault),
            _ => None,
        };
        json!({
            "state": state.map_or("unknown", State::name),
            "fault": own.map(fault_json),
            "limited_by": self.limits_json(Some(motor)),
            "speed_rpm": self.rpm(motor),
            "current_d_a": i_d,
            "current_q_a": i_q,
            "encoder_counts": words.encoder,
            "bus_v": f64::from(words.bus_mv) / 1e3,
            "limits": {
                "speed_rpm": plate.speed_max_rpm,
                "torque_nm": plate.torque_max_nm,
                "rated_current_a_rms": plate.thermal.rated_current_a_rms,
                "over_current_a": settings.bridge.over_current_a,
            },
        })
    }

    fn table_json(&self, settings: &Settings) -> Value {
        use Fault::{EndBackward, EndForward, TravelBackward, TravelForward};
        let fault = self.fault().filter(|fault| {
            matches!(
                fault,
                EndForward | EndBackward | TravelForward | TravelBackward
            )
        });
        let soft = settings.soft_limits_mm();
        json!({
            "fault": fault.map(fault_json),
            "homed": self.homed(),
            "position_mm": self.position_mm(settings),
            "velocity_mm_s": self.velocity_mm_s(settings),
            "limits": {
                "velocity_mm_s": settings.feed.velocity_max_mm_s,
                "acceleration_mm_s2": settings.feed.acceleration_max_mm_s2,
                "jerk_mm_s3": settings.feed.jerk_max_mm_s3,
                "position_mm": soft,
                "position_limits_act": self.homed() && soft.is_some(),
            },
        })
    }

    fn link_json(&self) -> Value {
        let frames = &self.status.frames;
        json!({
            "frames": frames.frames,
            "damaged": frames.damaged,
            "too_long": frames.too_long,
            "other_version": frames.versions,
            "repeated": self.status.repeated,
            "refused": self.status.refused,
            "telemetry_dropped": self.status.dropped,
        })
    }
}

/// A fault with its sentence and the reaction of the drive.
#[must_use]
pub fn fault_json(fault: Fault) -> Value {
    json!({
        "name": fault.name(),
        "sentence": fault.sentence(),
        "reaction": fault.reaction().name(),
    })
}

/// The event is a fault.
#[must_use]
pub fn is_fault(event: &Recorded) -> bool {
    [EventKind::Fault, EventKind::Further]
        .map(EventKind::word)
        .contains(&event.kind)
}

/// Name of the event's kind.
#[must_use]
pub fn kind(event: &Recorded) -> &'static str {
    EventKind::of_word(event.kind).map_or("unknown", EventKind::name)
}

/// Name of the event's code.
#[must_use]
pub fn code(event: &Recorded) -> &'static str {
    let name = match EventKind::of_word(event.kind) {
        Some(EventKind::Start) => ResetReason::of_word(event.code).map(ResetReason::name),
        // Which fault it is another event says.
        Some(EventKind::State) if event.code == State::FAULT_WORD => Some("fault"),
        Some(EventKind::State) => State::of_words(event.code, 0).map(State::name),
        Some(EventKind::Warning) => Warning::of_word(event.code).map(Warning::name),
        Some(EventKind::Settings) => Origin::of_word(event.code).map(Origin::name),
        Some(EventKind::Fault | EventKind::Further) => Fault::of_word(event.code).map(Fault::name),
        None => None,
    };
    name.unwrap_or("unknown")
}

/// An event of the journal as JSON.
#[must_use]
pub fn event_json(one: &Recorded) -> Value {
    let fault = Fault::of_word(one.code).filter(|_| is_fault(one));
    let unit = fault.and_then(Fault::unit);
    let [value, limit] = one.values;
    json!({
        "number": one.number,
        "uptime_s": f64::from(one.uptime_ms) / 1e3,
        "kind": kind(one),
        "name": code(one),
        "value": unit.map(|_| value),
        "limit": unit.filter(|_| limit != 0).map(|_| limit),
        "unit": unit,
        "reaction": fault.map(|fault| fault.reaction().name()),
    })
}

/// An entry of the last faults as JSON.
#[must_use]
pub fn entry_json(event: &Event) -> Value {
    json!({
        "uptime_s": f64::from(event.uptime_ms) / 1e3,
        "fault": Fault::of_word(event.fault).map(fault_json),
    })
}
