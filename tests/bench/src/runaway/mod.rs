//! A wrong electrical angle, injected while the drive works: what it does to the machine until the bridges are off.

pub mod report;

use control::fault::Fault;
use control::plate::{DrivePlate, MotorPlate};
use control::rates::STEPS_PER_LOOK;
use control::supervisor::State;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, RPM, Setup};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// The nut speed that is asked, rpm.
pub const NUT_RPM: f64 = 800.0;
/// The table velocity that is asked, m/s.
pub const VELOCITY: f64 = 2.5e-3;

/// The reference of a motor that stands at its torque limit gives way. Its current then hovers at the limit, and only looks at which the
/// limit cuts it count for the stall: of the boards as they ship, 6 to 8 in 10.
const GIVES_WAY: f64 = 1.6;

/// Within so many degrees of a quarter turn the current may make too little torque to turn the rotor at all.
const NO_TORQUE_DEG: f64 = 20.0;

/// A wrong angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrongAngle {
    /// Whose.
    pub axis: Axis,
    /// By how much, electrical degrees.
    pub degrees: f64,
    /// Injected while both motors turn at what is asked; otherwise at rest, before that is asked.
    pub running: bool,
}

/// Until both bridges are off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// How long it took, s.
    pub seconds: f64,
    /// Largest phase current, A.
    pub peak_a: f64,
    /// Furthest that the table was from where it started, m.
    pub travel_m: f64,
    /// Energy that went into both motors, J.
    pub energy_j: f64,
    /// What the drive was doing at the end.
    pub state: State,
}

/// The largest that an [`Outcome`] may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Time, s.
    pub seconds: f64,
    /// Phase current, A.
    pub peak_a: f64,
    /// Travel, m.
    pub travel_m: f64,
    /// Energy, J.
    pub energy_j: f64,
}

impl Outcome {
    /// The drive stopped, and says that something is wrong with this motor.
    #[must_use]
    pub fn names(&self, axis: Axis) -> bool {
        let [screw, nut] = [
            [
                Fault::ScrewAngle,
                Fault::ScrewCurrentError,
                Fault::ScrewOverSpeed,
                Fault::ScrewFollowing,
                Fault::ScrewStalled,
                Fault::ScrewVoltage,
            ],
            [
                Fault::NutAngle,
                Fault::NutCurrentError,
                Fault::NutOverSpeed,
                Fault::NutFollowing,
                Fault::NutStalled,
                Fault::NutVoltage,
            ],
        ];
        let faults = match axis {
            Axis::Screw => screw,
            Axis::Nut => nut,
        };
        matches!(self.state, State::Fault(fault) if faults.contains(&fault))
    }

    /// Each within its limit.
    #[must_use]
    pub fn within(&self, limits: &Limits) -> bool {
        self.seconds <= limits.seconds
            && self.peak_a <= limits.peak_a
            && self.travel_m <= limits.travel_m
            && self.energy_j <= limits.energy_j
    }
}

impl WrongAngle {
    /// 30 to 180 degrees in steps of 10, both signs, each motor, at rest and running.
    pub fn all() -> impl Iterator<Item = Self> {
        let degrees = (3..=18).flat_map(|tens| {
            let degrees = 10.0 * f64::from(tens);
            // Half a turn is the same both ways.
            [Some(degrees), (tens < 18).then_some(-degrees)]
        });
        let wrong = move |axis, running| {
            degrees.clone().flatten().map(move |degrees| Self {
                axis,
                degrees,
                running,
            })
        };
        [false, true]
            .into_iter()
            .flat_map(move |running| Axis::ALL.map(|axis| wrong.clone()(axis, running)))
            .flatten()
    }

    /// The set-up: the coupled machine on `board` as it ships; `None`: with a good drive's sensors.
    #[must_use]
    pub fn setup(board: Option<BoardKind>) -> Setup {
        match board {
            Some(kind) => Setup::shipped(kind, &Model::coupled(), Coupling::Coupled),
            None => Setup::real(Model::coupled(), Coupling::Coupled),
        }
    }

    /// Puts it into the drive of `setup` and waits until both bridges are off.
    ///
    /// # Errors
    /// [`ExperimentError`] if the drive cannot be configured, or does not run before the angle is put wrong.
    pub fn run(&self, setup: &Setup) -> Result<Outcome, ExperimentError> {
        const LONGEST_S: f64 = 2.0;
        const SETTLED_S: f64 = 1.0;
        let mut drive = setup.drive()?;
        if self.running {
            drive.command(VELOCITY, NUT_RPM * RPM)?;
            let before = until_safe(&mut drive, SETTLED_S);
            if !before.state.is_driven() {
                return Err(ExperimentError::NotSteady {
                    seconds: before.seconds,
                    velocity_mm_s: 1e3 * VELOCITY,
                    base_rpm: NUT_RPM,
                    state: before.state,
                });
            }
            drive.misalign(self.axis, self.degrees / 360.0);
        } else {
            // The angle is known from the first period on.
            drive.period();
            drive.misalign(self.axis, self.degrees / 360.0);
            drive.command(VELOCITY, NUT_RPM * RPM)?;
        }
        Ok(until_safe(&mut drive, LONGEST_S))
    }

    /// What the plate allows.
    ///
    /// - Time, running: the watch's patience, a look more for the phase of the looks, three time constants of the current
    ///   loop for the voltage to follow. At rest nothing shows before the back-EMF that is left over passes what the model may
    ///   be off by, so: the ramp to that speed besides. Near a quarter turn the current may make too little torque to get
    ///   there: the stall's patience besides, from when the speed loop asks for the largest torque.
    /// - Current: the torque limit's, and a quarter for the current loop's overshoot. (A break comes at twice as much.)
    /// - Travel, running: the asked velocity, and both motors pushed apart with their largest torque, for that time. At rest:
    ///   the one motor at the speed at which it shows for the time of the ramp, and at a stall's for the stall's patience.
    /// - Energy: what both motors' copper takes at the torque limit in that time, and the kinetic energy of both at the speed
    ///   at which it shows; running also the largest torque at the asked speed for that time.
    #[must_use]
    pub fn limits(&self, plate: &DrivePlate) -> Limits {
        let watch = &plate.runaway;
        let motor = &plate.motors[self.axis.index()];
        let i_max = motor.current_max();
        let look = f64::from(STEPS_PER_LOOK) * plate.speed_step();
        let seen_after = watch.angle_s + 2.0 * look + 3.0 / plate.tuning.current_rad_s;
        let (sine, cosine) = self.degrees.to_radians().sin_cos();
        // Of a unit vector that is turned, the larger component of the rest.
        let left_over = sine.abs().max(1.0 - cosine);
        let flux_e = f64::from(motor.pole_pairs) * motor.flux_wb;
        let unsure_v = watch.angle_floor * motor.speed_max() * flux_e
            + watch.resistance_error * motor.resistance_ohm * i_max;
        let shows_at = unsure_v / (left_over * flux_e);
        let feed = &plate.feed;
        // A ramp that begins and may end with its jerk.
        let ramp =
            shows_at / feed.base_acceleration_max + feed.base_acceleration_max / feed.base_jerk_max;
        let stall = if (self.degrees.abs() - 90.0).abs() <= NO_TORQUE_DEG {
            GIVES_WAY * watch.stall_s + wound_up_s(plate, motor)
        } else {
            0.0
        };
        let per_radian = feed.lead_m / std::f64::consts::TAU;
        let pushed = 2.0 * motor.torque_max_nm / motor.inertia_kg_m2;
        let (seconds, travel_m, speed) = if self.running {
            let pushed = per_radian * 0.5 * pushed * seen_after * seen_after;
            (
                seen_after,
                VELOCITY * seen_after + pushed,
                NUT_RPM * RPM + VELOCITY / per_radian,
            )
        } else {
            let seconds = ramp + seen_after + stall;
            let stands = watch.stall * motor.speed_max() * stall;
            (
                seconds,
                VELOCITY * seconds + per_radian * (shows_at * (ramp + seen_after) + stands),
                0.0,
            )
        };
        let copper: f64 = plate.motors.iter().map(copper_w).sum();
        let kinetic: f64 = plate
            .motors
            .iter()
            .map(|motor| 0.5 * motor.inertia_kg_m2 * shows_at * shows_at)
            .sum();
        let driven: f64 = plate
            .motors
            .iter()
            .map(|motor| motor.torque_max_nm * speed)
            .sum();
        Limits {
            seconds,
            peak_a: 1.25 * (2.0f64 / 3.0).sqrt() * i_max,
            travel_m,
            energy_j: (copper + driven) * seconds + kinetic,
        }
    }
}

/// How long a motor that stands takes to be asked for its largest torque, s: error of a ramp through the PI of Eqs 11 and 12, inertia
/// fed forward, `T = J a (1 + 2 xi w t + w^2 t^2 / 2)`.
fn wound_up_s(plate: &DrivePlate, motor: &MotorPlate) -> f64 {
    let (w, damping) = (plate.tuning.speed_rad_s, plate.tuning.damping);
    let accelerates = motor.inertia_kg_m2 * plate.feed.base_acceleration_max;
    let more = (motor.torque_max_nm / accelerates - 1.0).max(0.0);
    // w^2 t^2 / 2 + 2 xi w t = more
    ((4.0 * damping * damping + 2.0 * more).sqrt() - 2.0 * damping) / w
}

/// What the copper takes at the largest torque's current, W.
fn copper_w(motor: &MotorPlate) -> f64 {
    motor.resistance_ohm * motor.current_max().powi(2)
}

/// Lets the drive run until a fault, for at most `seconds`.
pub fn until_safe(drive: &mut Drive, seconds: f64) -> Outcome {
    let period = drive.board.config().pwm_period_s();
    let start = drive.board.machine.table_position();
    let mut outcome = Outcome {
        seconds: 0.0,
        peak_a: 0.0,
        travel_m: 0.0,
        energy_j: 0.0,
        state: drive.state(),
    };
    while outcome.seconds < seconds && !matches!(outcome.state, State::Fault(_)) {
        drive.period();
        outcome.seconds += period;
        for axis in Axis::ALL {
            let currents = drive.board.machine.phase_currents(axis);
            outcome.peak_a = currents.iter().fold(outcome.peak_a, |a, i| a.max(i.abs()));
            let power = drive.board.power_w(axis);
            outcome.energy_j += power.max(0.0) * period;
        }
        let travel = drive.board.machine.table_position() - start;
        outcome.travel_m = outcome.travel_m.max(travel.abs());
        outcome.state = drive.state();
    }
    outcome
}
