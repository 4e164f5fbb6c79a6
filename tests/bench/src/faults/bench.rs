//! The seam of a faulty drive: its spoiled inputs, the supervision, the ends of the table's travel, and what is measured on the
//! machine itself.

use super::cell::{Defect, Input};
use super::spoiled::{Reading, Spoiled};
use control::current_loop::MotorSample;
use control::encoder::Interface;
use control::fault::Fault;
use control::format::Misfit;
use control::plate::DrivePlate;
use control::sense::Shunts;
use control::supervisor::{Demand, Request};
use control::travel::{Travel, TravelConfig, TravelLook, TravelSeen};
use hal_sim::boards::BoardKind;
use hal_sim::seam::Seam;
use hal_sim::sensors::encoder_word;
use hal_sim::supervision::Supervision;
use plant::Axis;
use plant::machine::Machine;
use std::f64::consts::TAU;

/// Stiffness of an end stop, N/m, and its damping, of that of the table's mass on it: a rubber buffer on a casting.
pub(super) const STOP_N_PER_M: f64 = 2e7;
const STOP_DAMPING: f64 = 0.3;

/// Where the table's travel ends, m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    /// Where the table is in the middle.
    pub(super) middle: f64,
    /// The switches, to either side.
    pub(super) switch: f64,
    /// The stops, to either side.
    pub(super) stop: f64,
}

/// The soft limits of a homed table, as the firmware's orders look at them once a millisecond.
#[derive(Clone, Debug)]
pub(super) struct Soft {
    config: TravelConfig,
    travel: Travel,
    /// The scale's count in the middle.
    origin: i32,
    seen: TravelSeen,
}

impl Soft {
    /// The table may go so far to either side of where it is, m.
    pub(super) fn new(plate: &DrivePlate, way_m: f64, scale: u32) -> Self {
        let mut plate = *plate;
        [plate.travel.soft_least_m, plate.travel.soft_most_m] = [-way_m, way_m];
        Self {
            config: plate.travel_config(),
            travel: Travel::new(),
            origin: scale.cast_signed(),
            seen: TravelSeen::default(),
        }
    }

    /// A look.
    pub(super) fn look(&mut self, look: TravelLook) {
        let origin = Some(self.origin);
        let look = TravelLook { origin, ..look };
        self.seen = self.travel.step(&self.config, &look);
    }
}

/// What is seen on the machine itself since the fault.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seen {
    pub(super) peak_a: f64,
    /// Half periods in a row with a phase current above the limit: now, and at most.
    over: u32,
    pub(super) over_most: u32,
    pub(super) end_force_n: f64,
}

pub(super) struct Bench {
    board: BoardKind,
    pub(super) plate: DrivePlate,
    pub(super) spoiled: Vec<Spoiled>,
    pub(super) supervision: Supervision,
    pub(super) ends: Ends,
    /// Where the table comes near an end of its way.
    pub(super) soft: Option<Soft>,
    pub(super) seen: Seen,
    /// The table was past the end switches since the fault: forwards, backwards.
    passed: [bool; 2],
    /// What is demanded, as the drive reads it.
    pub(super) demand: Demand,
    /// Somebody has opened the enable switch.
    pub(super) enable_opened: bool,
    pub(super) position: f64,
    pub(super) load_n: f64,
    mass_kg: f64,
    adc_counts: f64,
    /// Shaft angles as last read: screw, nut.
    angles: [f64; 2],
    bus: [f64; 2],
    /// What an index that is wrong has put the count off by, rad.
    index_off: [f64; 2],
    temperatures: [u16; 2],
    scale_count_m: f64,
    /// The enable switch's contacts and the end switches as they were last read.
    pub(super) enabled: [bool; 2],
    pub(super) ends_open: [bool; 2],
}

/// Heat sinks are at so many degrees Celsius.
const WARM: f64 = 40.0;

impl Bench {
    pub(super) fn new(
        board: BoardKind,
        plate: DrivePlate,
        load_n: f64,
        mass_kg: f64,
        spoiled: Vec<Spoiled>,
    ) -> Result<Self, Misfit> {
        Ok(Self {
            supervision: Supervision::new(&board.guards(), &plate)?,
            board,
            adc_counts: f64::from(plate.board.adc_counts),
            plate,
            spoiled,
            ends: Ends {
                middle: 0.0,
                switch: f64::INFINITY,
                stop: f64::INFINITY,
            },
            soft: None,
            seen: Seen::default(),
            passed: [false; 2],
            demand: Demand::Rest,
            enable_opened: false,
            position: 0.0,
            load_n,
            mass_kg,
            angles: [0.0; 2],
            bus: [0.0; 2],
            index_off: [0.0; 2],
            temperatures: board.counts_at(WARM),
            enabled: [true; 2],
            ends_open: [false; 2],
            scale_count_m: board.scale_count_m(),
        })
    }

    /// The chip begins again.
    pub(super) fn restart_supervision(&mut self) -> Result<(), Misfit> {
        self.supervision = Supervision::new(&self.board.guards(), &self.plate)?;
        Ok(())
    }

    /// The faults are there.
    pub(super) fn break_down(&mut self) {
        self.spoiled.iter_mut().for_each(|one| one.on = true);
        self.seen = Seen::default();
        self.passed = [false; 2];
    }

    /// `fault` names an end switch that the table really was past.
    pub(super) fn is_at_end(&self, fault: Fault) -> bool {
        let [forwards, backwards] = self.passed;
        match fault {
            Fault::EndForward => forwards,
            Fault::EndBackward => backwards,
            _ => false,
        }
    }

    /// One more fault is there from now on.
    pub(super) fn put_in(&mut self, input: Input, defect: Defect, seed: u64) {
        let mut one = Spoiled::new(input, defect, seed);
        one.on = true;
        self.spoiled.push(one);
        self.seen = Seen::default();
    }

    /// The table's scale, as it is counted.
    pub(super) fn scale_counts(&mut self) -> u32 {
        let mut metres = self.position;
        for one in &mut self.spoiled {
            if one.input == Input::Scale {
                metres = one.read(Reading {
                    now: metres,
                    missing: metres,
                    span: [0.0, 1.0],
                    offset: 10e-3,
                    sigma: 1e-3,
                    late: 80,
                    neighbour: metres,
                });
            }
        }
        (metres / self.scale_count_m).round() as i64 as u32
    }

    /// ADC counts of the heat sinks, as they are read.
    pub(super) fn temperatures(&mut self) -> [u16; 2] {
        let truth = self.temperatures;
        let (mut read, top) = (truth, self.adc_counts - 1.0);
        for one in &mut self.spoiled {
            if let Input::Temperature(axis) = one.input {
                let k = axis.index();
                let counts = one.read(Reading {
                    now: f64::from(truth[k]),
                    missing: top,
                    span: [0.0, top],
                    offset: 0.1 * top,
                    sigma: 0.1 * top,
                    late: 20,
                    neighbour: f64::from(truth[1 - k]),
                });
                read[k] = counts.clamp(0.0, top) as u16;
            }
        }
        read
    }

    /// An index flag of `axis` reaches the supervision.
    pub(super) fn index_seen(&self, axis: Axis, passed: bool) -> bool {
        let dead = |one: &Spoiled| {
            one.on && one.input == Input::Index(axis) && one.defect == Defect::Missing
        };
        passed && !self.spoiled.iter().any(dead)
    }

    /// The index of `axis` has been passed, which puts the count right: one in a wrong place puts it off by half a radian, one that is
    /// dead leaves it.
    pub(super) fn pass_index(&mut self, axis: Axis) {
        let defect = self
            .spoiled
            .iter()
            .find(|one| one.on && one.input == Input::Index(axis))
            .map(|one| one.defect);
        self.index_off[axis.index()] = match defect {
            Some(Defect::Missing) => return,
            Some(Defect::Offset) => 0.5,
            _ => 0.0,
        };
    }

    fn read_angle(&mut self, axis: Axis, word: u32) -> u32 {
        let k = axis.index();
        let encoder = self.plate.motors[k].encoder;
        let Some(counts) = encoder.interface.counts(word) else {
            return word;
        };
        let truth = f64::from(counts) / f64::from(encoder.counts_per_turn) * TAU;
        self.angles[k] = truth;
        let neighbour = self.angles[1 - k];
        let mut angle = truth;
        for one in &mut self.spoiled {
            match one.input {
                Input::Encoder(at) if at == axis => {
                    if one.on && one.defect == Defect::Missing {
                        if encoder.interface == Interface::Mt6835 {
                            return u32::MAX;
                        }
                        // One of two channels is torn: the other counts one up and one down.
                        let held = one.read(Reading {
                            now: truth,
                            missing: f64::NAN,
                            ..NONE
                        });
                        let held = if held.is_nan() { one.held(truth) } else { held };
                        let step = TAU / f64::from(encoder.counts_per_turn);
                        angle = held + f64::from(counts & 1) * step;
                        continue;
                    }
                    angle = one.read(Reading {
                        now: angle,
                        missing: angle,
                        span: [0.0, TAU * (1.0 - 1e-9)],
                        offset: TAU / 8.0 / f64::from(self.plate.motors[k].pole_pairs),
                        sigma: TAU / 720.0,
                        late: 4,
                        neighbour,
                    });
                }
                Input::Index(at) if at == axis && one.on && one.defect == Defect::Noisy => {
                    // A spike puts the count to zero, some every hundred milliseconds.
                    let spike = one.random().abs() < 1.0 / 2000.0;
                    if spike {
                        self.index_off[k] = -truth;
                    }
                }
                _ => {}
            }
        }
        angle += self.index_off[k];
        if angle == truth {
            word
        } else {
            encoder_word(&encoder, angle)
        }
    }
}

/// Nothing but its value.
const NONE: Reading = Reading {
    now: 0.0,
    missing: 0.0,
    span: [0.0; 2],
    offset: 0.0,
    sigma: 0.0,
    late: 0,
    neighbour: 0.0,
};

impl Seam for Bench {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        let limit = self.plate.bridge.over_current_a;
        let peak = Axis::ALL
            .iter()
            .flat_map(|&axis| machine.phase_currents(axis))
            .fold(0.0f64, |peak, amps| peak.max(amps.abs()));
        let seen = &mut self.seen;
        seen.peak_a = seen.peak_a.max(peak);
        seen.over = if peak > limit { seen.over + 1 } else { 0 };
        seen.over_most = seen.over_most.max(seen.over);

        self.position = machine.table_position();
        let from_middle = self.position - self.ends.middle;
        let past = from_middle.abs() - self.ends.stop;
        let mut force = self.load_n;
        if past > 0.0 {
            let damping = STOP_DAMPING * 2.0 * (STOP_N_PER_M * self.mass_kg).sqrt();
            let into = machine.table_velocity() * from_middle.signum();
            let push = (STOP_N_PER_M * past + damping * into).max(0.0);
            seen.end_force_n = seen.end_force_n.max(push);
            force += push * from_middle.signum();
        }
        machine.set_load_force(force);
    }

    fn currents(&mut self, axis: Axis, amps: &mut [f64; 3]) {
        let board = &self.plate.board;
        let ends = [0.0, self.adc_counts - 1.0]
            .map(|counts| (counts - board.zero_counts) * board.amps_per_count);
        let span = (ends[1] - ends[0]).abs();
        let truth = *amps;
        let phases = match board.shunts {
            Shunts::Two => 2,
            Shunts::Three => 3,
        };
        for one in &mut self.spoiled {
            if let Input::Current(at, phase) = one.input
                && at == axis
            {
                let next = (phase + 1) % phases;
                amps[phase] = one.read(Reading {
                    now: truth[phase],
                    missing: 0.0,
                    span: ends,
                    offset: 0.1 * span,
                    sigma: 0.03 * span,
                    late: 4,
                    neighbour: truth[next],
                });
                if one.on && one.defect == Defect::Swapped {
                    amps[next] = truth[phase];
                }
            }
        }
    }

    fn sample(&mut self, axis: Axis, sample: &mut MotorSample) {
        sample.encoder = self.read_angle(axis, sample.encoder);
        let (k, top) = (axis.index(), self.adc_counts - 1.0);
        self.bus[k] = f64::from(sample.bus);
        let neighbour = self.bus[1 - k];
        for one in &mut self.spoiled {
            if one.input == Input::Bus(axis) {
                let counts = one.read(Reading {
                    now: f64::from(sample.bus),
                    missing: 0.0,
                    span: [0.0, top],
                    offset: 0.1 * top,
                    sigma: 0.03 * top,
                    late: 4,
                    neighbour,
                });
                sample.bus = counts.clamp(0.0, top) as u16;
            }
        }
        self.supervision.converted(axis, sample);
    }

    fn request(&mut self, request: &mut Request) {
        let from_middle = self.position - self.ends.middle;
        let truth = [
            from_middle > self.ends.switch,
            from_middle < -self.ends.switch,
        ];
        for (passed, now) in self.passed.iter_mut().zip(truth) {
            *passed |= now;
        }
        for one in self
            .spoiled
            .iter_mut()
            .filter(|one| one.on && one.input == Input::Demand)
        {
            request.demand = one.demand(request.demand);
        }
        self.demand = request.demand;
        let inputs = &mut request.inputs;
        inputs.enabled = [!self.enable_opened; 2];
        [inputs.end_forward, inputs.end_backward] = truth;
        inputs.table_step = self.supervision.table_step();
        if let Some(soft) = &self.soft {
            inputs.blocked = soft.seen.blocked;
        }
        for one in &mut self.spoiled {
            match one.input {
                Input::EndForward => inputs.end_forward = one.contact(truth[0], truth[1]),
                Input::EndBackward => inputs.end_backward = one.contact(truth[1], truth[0]),
                Input::Enable(contact) => {
                    inputs.enabled[contact] = !one.contact(self.enable_opened, false);
                }
                Input::Heartbeat => {
                    let now = f64::from(request.heartbeat);
                    let held = one.read(Reading {
                        now,
                        missing: f64::NAN,
                        sigma: 100.0,
                        late: 2000,
                        ..NONE
                    });
                    // Missing, it stands; late, it comes in bursts.
                    request.heartbeat = if held.is_nan() {
                        one.held(now) as u32
                    } else if one.on && one.defect == Defect::Late {
                        request.heartbeat / 2000
                    } else {
                        held.abs() as u32
                    };
                }
                _ => {}
            }
        }
        // The motor that has the other's wire.
        for one in &self.spoiled {
            if one.on && one.defect == Defect::Swapped {
                match one.input {
                    Input::EndForward => inputs.end_backward = truth[0],
                    Input::EndBackward => inputs.end_forward = truth[1],
                    _ => {}
                }
            }
        }
        self.enabled = inputs.enabled;
        self.ends_open = [inputs.end_forward, inputs.end_backward];
    }

    fn found(&mut self) -> Option<Fault> {
        let past = self.soft.as_ref().and_then(|soft| soft.seen.fault);
        self.supervision.take().or(past)
    }
}
