//! What supervision watches once a millisecond, beside what hardware and current loops stop by themselves.
//!
//! | what | tolerated | fault |
//! | --- | --- | --- |
//! | a current loop late, the speed task late, supervision late | five in a row, and one in 100 ms | `...LoopLate`, `SpeedTaskLate`, `SupervisionLate` |
//! | bus voltage above its limit | one look | `OverVoltage` |
//! | bus voltage below its limit while the bridges are on | one look | `UnderVoltage` |
//! | the controller's supply out of its range: see [`controller_supply`](crate::controller_supply) | one look in twenty | `ControllerSupply` |
//! | a heat sink out of its range: too hot, or its sensor torn or shorted | eight looks | `...Temperature` |
//! | an encoder that should have passed its index and did not, or whose channels changed together | five in a row, and one in 100 ms | `...Encoder` |
//! | an encoder whose count stands while the asked torque changes: see [`standing_watch`](crate::standing_watch) | three looks | `...Encoder` |
//! | three currents that do not add up to nothing while the bridges are on | one look up to twice the limit, none past it | `...CurrentSum` |
//! | scale and motors further apart than the limit: see [`scale_watch`](crate::scale_watch) | none | `Scale` |
//! | an encoder whose shaft stood with it, once the bridges are open: see [`seizure_watch`](crate::seizure_watch) | | `...Stalled` |
//! | an enable switch of which one contact opens alone: see [`enable_watch`](crate::enable_watch) | half a second | `EnableApart` |
//! | end switches that are exchanged: see [`ends_watch`](crate::ends_watch) | one look | `EndsExchanged` |

use crate::base::fault::Fault;
use crate::base::format::Misfit;
use crate::base::tolerance::{Tally, Tolerance};
use crate::watch::controller_supply::{SUPPLY_MV, SupplyReading};
use crate::watch::enable_watch::EnableWatch;
use crate::watch::ends_watch::EndsWatch;
use crate::watch::scale_watch::{ScaleWatch, ScaleWatchConfig, ScaleWatchPlate};
use crate::watch::seizure_watch::SeizureWatch;
use crate::watch::standing_watch::StandingWatch;
use crate::watch::thermometer::{Range, TemperaturePlate};
use core::mem;

/// Of late tasks and of encoder errors.
const SELDOM: Tolerance = Tolerance {
    weight: 100,
    events: 5,
};
/// Of the bus voltage.
const ONCE: Tolerance = Tolerance {
    weight: 2,
    events: 1,
};
/// Of the controller's supply: two looks of twenty.
const SPARSELY: Tolerance = Tolerance {
    weight: 20,
    events: 1,
};
/// Of a temperature.
const SLOWLY: Tolerance = Tolerance {
    weight: 2,
    events: 8,
};

/// Furthest that a shaft may turn without its index being seen: one and a half turns, in 2^-16 turn.
const INDEX_MISSING: u32 = 3 << 15;

/// A board's limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuardPlate {
    /// Highest bus voltage, V.
    pub bus_max_v: f64,
    /// Lowest bus voltage with the bridges on, V.
    pub bus_min_v: f64,
    /// V of the bus per ADC count.
    pub bus_volts_per_count: f64,
    /// Counts of the ADC's full scale.
    pub adc_counts: u32,
    /// Heat sinks: screw, nut.
    pub temperatures: [TemperaturePlate; 2],
    /// The encoders have an index: screw, nut.
    pub index: [bool; 2],
    /// The table's scale; none: it is not compared with the motors.
    pub scale: Option<ScaleWatchPlate>,
}

/// The limits in counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuardConfig {
    /// Most counts of the bus.
    pub bus_most: u16,
    /// Smallest counts of the bus with the bridges on.
    pub bus_least: u16,
    /// Heat sinks: screw, nut.
    pub temperatures: [Range; 2],
    /// The encoders have an index: screw, nut.
    pub index: [bool; 2],
    /// The table's scale.
    pub scale: Option<ScaleWatchConfig>,
}

impl GuardPlate {
    /// The limits in counts.
    ///
    /// # Errors
    /// [`Misfit`] naming the limit that the ADC cannot see.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub const fn config(&self) -> Result<GuardConfig, Misfit> {
        let most = self.bus_max_v / self.bus_volts_per_count;
        let least = self.bus_min_v / self.bus_volts_per_count;
        let top = self.adc_counts as f64 - 1.0;
        if !(0.0 < least && least < most && most < top) {
            return Err(Misfit {
                name: "largest bus voltage",
                unit: "counts",
                value: most,
                least,
                below: top,
            });
        }
        let [screw, nut] = &self.temperatures;
        Ok(GuardConfig {
            bus_most: most as u16,
            bus_least: least as u16,
            temperatures: [
                match screw.range(self.adc_counts) {
                    Ok(range) => range,
                    Err(misfit) => return Err(misfit),
                },
                match nut.range(self.adc_counts) {
                    Ok(range) => range,
                    Err(misfit) => return Err(misfit),
                },
            ],
            index: self.index,
            scale: match &self.scale {
                None => None,
                Some(plate) => match plate.config() {
                    Ok(config) => Some(config),
                    Err(misfit) => return Err(misfit),
                },
            },
        })
    }
}

/// What the guard looks at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Look {
    /// The bridges are on: screw, nut.
    pub running: [bool; 2],
    /// And both motors follow their references.
    pub driven: bool,
    /// What has stopped the drive.
    pub stopped_by: Option<Fault>,
    /// Deadlines missed since the start, modulo 2^32: screw loop, nut loop, speed task, supervision.
    pub missed: [u32; 4],
    /// ADC counts of the bus voltage: at the screw's bridge, at the nut's.
    pub bus: [u16; 2],
    /// The controller's supply.
    pub supply: SupplyReading,
    /// ADC counts of the heat sinks: screw, nut.
    pub temperatures: [u16; 2],
    /// Mechanical angles in the rotors' sense, 2^-32 turn: screw, nut.
    pub theta: [u32; 2],
    /// Asked torques, 2^-8 of the motors' limits: screw, nut.
    pub torque: [i32; 2],
    /// The enable switch's contacts are closed.
    pub enabled: [bool; 2],
    /// The end switches are open: ahead of positive velocity, and of negative.
    pub ends_open: [bool; 2],
    /// The table's scale, counts, which wrap.
    pub scale: u32,
    /// How far three currents are from adding up to nothing, in events: see [`sum_events`](crate::watch::runaway::sum_events).
    pub current_sum: [u32; 2],
    /// The index was seen since the last look: screw, nut.
    pub index: [bool; 2],
    /// An encoder's two channels changed together since the last look: screw, nut.
    pub transition_error: [bool; 2],
}

/// The rest for a shaft until its index is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct IndexWatch {
    theta: u32,
    /// Turned since the index, 2^-16 turn.
    turned: i32,
    /// Its errors since the start, modulo 2^32.
    errors: u32,
    tally: Tally,
}

/// State of the guard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guard {
    missed: [u32; 4],
    late: [Tally; 4],
    over_voltage: Tally,
    under_voltage: Tally,
    supply: Tally,
    temperatures: [Tally; 2],
    encoders: [IndexWatch; 2],
    standing: [StandingWatch; 2],
    sums: [Tally; 2],
    theta: Option<[u32; 2]>,
    scale: ScaleWatch,
    seizure: SeizureWatch,
    last_scale: u32,
    /// What the table moved in the last look, as a turn of screw against nut, 2^-32 turn.
    table: i64,
    ends: EndsWatch,
    enable: EnableWatch,
}

impl Guard {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        const NONE: IndexWatch = IndexWatch {
            theta: 0,
            turned: 0,
            errors: 0,
            tally: Tally::new(),
        };
        Self {
            missed: [0; 4],
            late: [Tally::new(); 4],
            over_voltage: Tally::new(),
            under_voltage: Tally::new(),
            supply: Tally::new(),
            temperatures: [Tally::new(); 2],
            encoders: [NONE; 2],
            standing: [StandingWatch::new(); 2],
            sums: [Tally::new(); 2],
            theta: None,
            scale: ScaleWatch::new(),
            seizure: SeizureWatch::new(),
            last_scale: 0,
            table: 0,
            ends: EndsWatch::new(),
            enable: EnableWatch::new(),
        }
    }

    /// What the table moved by its scale in the last look, as a turn of screw against nut in one of its `parts`, 2^-32 turn; `None`: the
    /// scale has not counted yet, or there is none.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub fn table_step(&self, parts: u32) -> Option<i32> {
        let table = self.table.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        let step = table.checked_div(parts.cast_signed())?;
        self.scale.is_there().then_some(step)
    }

    /// Errors of the incremental encoders since the start: screw, nut.
    #[must_use]
    pub fn encoder_errors(&self) -> [u32; 2] {
        self.encoders.map(|encoder| encoder.errors)
    }

    /// What is known of a fault at a look: its value and its limit in the fault's unit, 0 and 0 of others.
    #[must_use]
    pub fn values(&self, config: &GuardConfig, look: &Look, fault: Fault) -> [i32; 2] {
        let ([screw_bus, nut_bus], [screw_heat, nut_heat]) = (look.bus, look.temperatures);
        let [screw_missed, nut_missed, speed_missed, supervision_missed] = look.missed;
        let [screw_errors, nut_errors] = self.encoder_errors();
        let [screw_range, nut_range] = &config.temperatures;
        let within = |value: u16, range: &Range| [value, range.nearest(value)].map(i32::from);
        let count = |events: u32| [events.cast_signed(), 0];
        match fault {
            Fault::OverVoltage => [screw_bus.max(nut_bus), config.bus_most].map(i32::from),
            Fault::UnderVoltage => [screw_bus.min(nut_bus), config.bus_least].map(i32::from),
            Fault::ControllerSupply => within(look.supply.millivolts(), &SUPPLY_MV),
            Fault::ScrewTemperature => within(screw_heat, screw_range),
            Fault::NutTemperature => within(nut_heat, nut_range),
            Fault::ScrewLoopLate => count(screw_missed),
            Fault::NutLoopLate => count(nut_missed),
            Fault::SpeedTaskLate => count(speed_missed),
            Fault::SupervisionLate => count(supervision_missed),
            Fault::ScrewEncoder => count(screw_errors),
            Fault::NutEncoder => count(nut_errors),
            _ => [0; 2],
        }
    }

    /// One look, once a millisecond: what is past its limit, the likelier cause of others first.
    pub fn step(&mut self, config: &GuardConfig, look: &Look) -> Option<Fault> {
        let past = |bus: &u16| *bus > config.bus_most;
        let over = self
            .over_voltage
            .step(ONCE, look.bus.iter().any(past).into());
        let short = |bus: &u16| *bus < config.bus_least;
        let under = look.running.contains(&true) && look.bus.iter().any(short);
        let under = self.under_voltage.step(ONCE, under.into());

        let before = self.theta.replace(look.theta).unwrap_or(look.theta);
        let turned = |now: u32, before: u32| i64::from(now.wrapping_sub(before).cast_signed());
        let ([screw, nut], [screw_before, nut_before]) = (look.theta, before);
        let shafts_turned = [turned(screw, screw_before), turned(nut, nut_before)];
        let [screw_turned, nut_turned] = shafts_turned;
        // What the screw turned more than the nut.
        let moved = screw_turned.saturating_sub(nut_turned);
        let mut fault = None;
        let mut first = |found: bool, name: Fault| {
            if found && fault.is_none() {
                fault = Some(name);
            }
        };
        // All that is measured is measured against it.
        let ill = !SUPPLY_MV.has(look.supply.millivolts());
        let supply = self.supply.step(SPARSELY, ill.into());
        first(supply, Fault::ControllerSupply);
        first(over, Fault::OverVoltage);
        first(under, Fault::UnderVoltage);
        let sinks = self.temperatures.iter_mut().zip(&config.temperatures);
        let names = [Fault::ScrewTemperature, Fault::NutTemperature];
        for (((tally, range), counts), name) in sinks.zip(look.temperatures).zip(names) {
            first(tally.step(SLOWLY, (!range.has(counts)).into()), name);
        }
        let names = [Fault::ScrewCurrentSum, Fault::NutCurrentSum];
        let sums = self.sums.iter_mut().zip(look.current_sum).zip(names);
        for (((tally, events), name), running) in sums.zip(look.running) {
            let events = if running { events } else { 0 };
            first(tally.step(ONCE, events), name);
        }
        let shafts = look.theta.into_iter().zip(look.index).zip(config.index);
        let names = [Fault::ScrewEncoder, Fault::NutEncoder];
        let errors = look.transition_error.into_iter().zip(names);
        for ((encoder, ((theta, seen), has_index)), (torn, name)) in
            self.encoders.iter_mut().zip(shafts).zip(errors)
        {
            let missing = has_index && encoder.missing(theta, seen);
            let events = u32::from(missing).saturating_add(u32::from(torn));
            encoder.errors = encoder.errors.wrapping_add(events);
            first(encoder.tally.step(SELDOM, events), name);
        }
        let shafts = look.theta.into_iter().zip(look.torque).zip(names);
        for (watch, ((theta, torque), name)) in self.standing.iter_mut().zip(shafts) {
            first(watch.step(look.driven, theta, torque), name);
        }
        if let Some(found) = self.look_at_scale(config, look, shafts_turned) {
            first(true, found);
        }
        let exchanged = self.ends.step(moved, look.ends_open);
        first(exchanged && look.driven, Fault::EndsExchanged);
        let names = [
            Fault::ScrewLoopLate,
            Fault::NutLoopLate,
            Fault::SpeedTaskLate,
            Fault::SupervisionLate,
        ];
        let tasks = self.late.iter_mut().zip(&mut self.missed);
        for (((tally, before), now), name) in tasks.zip(look.missed).zip(names) {
            let events = now.wrapping_sub(*before);
            *before = now;
            first(tally.step(SELDOM, events), name);
        }
        first(self.enable.step(look.enabled), Fault::EnableApart);
        fault
    }

    /// The scale against the shafts: it is wrong, or something has seized.
    fn look_at_scale(
        &mut self,
        config: &GuardConfig,
        look: &Look,
        shafts_turned: [i64; 2],
    ) -> Option<Fault> {
        let before = mem::replace(&mut self.last_scale, look.scale);
        let config = config.scale.as_ref()?;
        let [screw_turned, nut_turned] = shafts_turned;
        let moved = screw_turned.saturating_sub(nut_turned);
        let apart = self.scale.step(config, look.driven, moved, look.scale);
        let counted = i64::from(look.scale.wrapping_sub(before).cast_signed());
        let seized = self
            .seizure
            .step(config, look.stopped_by, shafts_turned, counted);
        self.table = config.turned_by(counted);
        if apart { Some(Fault::Scale) } else { seized }
    }
}

impl Default for Guard {
    fn default() -> Self {
        Self::new()
    }
}

impl IndexWatch {
    /// The shaft stands at `theta`, and its index was seen or not: `true` if it is missing.
    fn missing(&mut self, theta: u32, seen: bool) -> bool {
        let moved = theta.wrapping_sub(self.theta).cast_signed() >> 16;
        self.theta = theta;
        self.turned = if seen {
            0
        } else {
            self.turned.saturating_add(moved)
        };
        let missing = self.turned.unsigned_abs() > INDEX_MISSING;
        if missing {
            // The next one is due in a turn.
            self.turned = 0;
        }
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::scale_watch::ScaleWatchPlate;
    use crate::watch::thermometer::{Side, Thermometer};

    const HEAT: TemperaturePlate = TemperaturePlate {
        sensor: Thermometer::Ntc {
            r25_ohm: 10e3,
            beta_k: 3977.0,
        },
        side: Side::Ground,
        divider_ohm: 4.7e3,
        max_celsius: 90.0,
        min_celsius: -30.0,
    };

    const PLATE: GuardPlate = GuardPlate {
        bus_max_v: 400.0,
        bus_min_v: 200.0,
        bus_volts_per_count: 0.11,
        adc_counts: 4096,
        temperatures: [HEAT; 2],
        index: [false, true],
        scale: Some(ScaleWatchPlate::usual(1e-6, 5e-3)),
    };

    const HEALTHY: Look = Look {
        running: [true; 2],
        driven: true,
        stopped_by: None,
        missed: [0; 4],
        bus: [2818; 2],
        supply: SupplyReading {
            reference: 1504,
            calibrated: 1655,
        },
        temperatures: [1500; 2],
        theta: [0; 2],
        torque: [0; 2],
        enabled: [true; 2],
        ends_open: [false; 2],
        scale: 0,
        current_sum: [0; 2],
        index: [false; 2],
        transition_error: [false; 2],
    };

    /// Steps a fresh guard over looks; the step at which it finds a fault.
    fn found(steps: u32, look: impl Fn(u32) -> Look) -> Option<(u32, Fault)> {
        let (config, mut guard) = (PLATE.config().unwrap(), Guard::new());
        (0..steps).find_map(|k| guard.step(&config, &look(k)).map(|fault| (k, fault)))
    }

    #[test]
    fn a_fault_of_the_bus_has_its_worse_end_and_its_limit() {
        let config = PLATE.config().unwrap();
        let look = Look {
            bus: [1800, 3700],
            ..HEALTHY
        };
        let values = |fault| Guard::new().values(&config, &look, fault);
        // 200 and 400 V of 0.11 V a count.
        assert_eq!(values(Fault::UnderVoltage), [1800, 1818]);
        assert_eq!(values(Fault::OverVoltage), [3700, 3636]);
    }

    #[test]
    fn each_limit_has_its_fault_and_its_patience() {
        assert_eq!(found(10_000, |_| HEALTHY), None);
        let from = |k: u32, spoil: fn(&mut Look)| {
            let mut look = HEALTHY;
            if k >= 100 {
                spoil(&mut look);
            }
            look
        };
        for (spoil, at, fault) in [
            (
                (|look| look.bus[1] = 3700) as fn(&mut Look),
                101,
                Fault::OverVoltage,
            ),
            (|look| look.bus[0] = 1800, 101, Fault::UnderVoltage),
            (
                |look| look.temperatures[0] = 300,
                115,
                Fault::ScrewTemperature,
            ),
            (
                |look| look.temperatures[1] = 4095,
                115,
                Fault::NutTemperature,
            ),
            (
                |look| look.transition_error[0] = true,
                105,
                Fault::ScrewEncoder,
            ),
            (|look| look.current_sum[1] = 1, 101, Fault::NutCurrentSum),
            (
                |look| look.supply.reference = 1620,
                101,
                Fault::ControllerSupply,
            ),
        ] {
            assert_eq!(found(200, |k| from(k, spoil)), Some((at, fault)));
            // A single look is tolerated.
            let once = |k| if k == 100 { from(k, spoil) } else { HEALTHY };
            assert_eq!(found(200, once), None, "{fault:?}");
        }
        let empty = |_| Look {
            running: [false; 2],
            bus: [0; 2],
            ..HEALTHY
        };
        assert_eq!(found(1000, empty), None, "a bus that is not on yet");
    }

    #[test]
    fn a_bus_at_its_limit_is_within_it() {
        let config = PLATE.config().unwrap();
        let at = |bus: u16| {
            found(100, |_| Look {
                bus: [bus, 2818],
                ..HEALTHY
            })
            .map(|(_, fault)| fault)
        };
        for (bus, expected) in [
            (config.bus_most, None),
            (config.bus_most + 1, Some(Fault::OverVoltage)),
            (config.bus_least, None),
            (config.bus_least - 1, Some(Fault::UnderVoltage)),
        ] {
            let limits = (config.bus_least, config.bus_most);
            assert_eq!(
                at(bus),
                expected,
                "{bus} counts, allowed are {limits:?} and between"
            );
        }
    }

    #[test]
    fn late_tasks_are_tolerated_up_to_their_limit() {
        let faults = [
            Fault::ScrewLoopLate,
            Fault::NutLoopLate,
            Fault::SpeedTaskLate,
            Fault::SupervisionLate,
        ];
        for (task, fault) in faults.into_iter().enumerate() {
            let late = |missed: u32| {
                let mut look = HEALTHY;
                // The count wraps.
                look.missed[task] = missed.wrapping_sub(3);
                look
            };
            // From a start like any other.
            let first = |k: u32| if k == 0 { HEALTHY } else { late(3) };
            assert_eq!(found(1000, first), None);
            assert_eq!(found(20_000, |k| late(3 + k / 101)), None, "one in 101 ms");
            let often = found(20_000, |k| late(3 + k / 50)).map(|(_, fault)| fault);
            assert_eq!(often, Some(fault), "one in 50 ms");
            let row = found(1000, |k| late(3 + k.saturating_sub(99).min(6)));
            assert_eq!(row, Some((105, fault)), "six in a row");
            let fewer = found(1000, |k| late(3 + k.saturating_sub(99).min(5)));
            assert_eq!(fewer, None, "five in a row");
        }
    }

    #[test]
    fn a_missing_index_is_counted_and_past_a_limit_a_fault() {
        // 5 turns/s.
        let theta = |k: u32| (f64::from(k) * 5e-3).rem_euclid(1.0) * 2f64.powi(32);
        let turning = |k: u32, seen: bool| Look {
            theta: [0, theta(k) as u32],
            index: [false, seen && k.is_multiple_of(200)],
            ..HEALTHY
        };
        assert_eq!(found(10_000, |k| turning(k, true)), None);
        // Backwards, with the index lost for one turn of three.
        assert_eq!(found(10_000, |k| turning(20_000 - k, k % 600 < 400)), None);
        let (config, mut guard) = (PLATE.config().unwrap(), Guard::new());
        for k in 0..700 {
            assert_eq!(guard.step(&config, &turning(k, false)), None);
        }
        assert_eq!(guard.encoder_errors(), [0, 2], "three turns and a half");
    }

    #[test]
    fn limits_beyond_the_adc_are_refused() {
        let beyond = GuardPlate {
            bus_max_v: 460.0,
            ..PLATE
        };
        assert_eq!(beyond.config().unwrap_err().name, "largest bus voltage");
    }
}
