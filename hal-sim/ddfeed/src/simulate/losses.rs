//! Where the power of a drive at a point goes: into the copper of both motors and into friction.

use hal_sim::drive::Drive;
use hal_sim::experiment::Setup;
use plant::Axis;

/// Mean losses of a record, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Copper of the screw's motor and of the nut's.
    pub copper_w: [f64; 2],
    /// All friction: bearings, pair, guideway. It is what the shafts give and the load does not take.
    pub friction_w: f64,
}

impl Losses {
    /// All of them, W.
    pub fn total_w(&self) -> f64 {
        let [screw, nut] = self.copper_w;
        screw + nut + self.friction_w
    }
}

/// Adds up the losses of a drive over a record, from the true currents and speeds of its machine.
pub struct LossMeter<'a> {
    setup: &'a Setup,
    sums: Losses,
    periods: u32,
}

impl<'a> LossMeter<'a> {
    /// For a drive of `setup`.
    pub fn new(setup: &'a Setup) -> Self {
        Self {
            setup,
            sums: Losses::default(),
            periods: 0,
        }
    }

    /// Takes one PWM period of the drive.
    pub fn take(&mut self, drive: &Drive) {
        let machine = &drive.board.machine;
        for axis in Axis::ALL {
            let (motor, state) = (self.setup.model.motor(axis), machine.motor(axis));
            let pole_pairs = f64::from(motor.pole_pairs);
            // Power-invariant: the squares are those of the three phases, 1.5 times that of a phase's peak.
            let squares = state.i_alpha * state.i_alpha + state.i_beta * state.i_beta;
            let (sin, cos) = (pole_pairs * state.theta).sin_cos();
            let i_q = state.i_beta * cos - state.i_alpha * sin;
            self.sums.copper_w[axis.index()] += motor.resistance_ohm * squares;
            self.sums.friction_w += pole_pairs * motor.flux_wb * i_q * state.omega;
        }
        self.sums.friction_w -= self.setup.model.feed.load_n * machine.table_velocity();
        self.periods += 1;
    }

    /// The means; none before the first period.
    pub fn losses(&self) -> Option<Losses> {
        let count = f64::from(self.periods);
        (self.periods > 0).then(|| Losses {
            copper_w: self.sums.copper_w.map(|sum| sum / count),
            friction_w: self.sums.friction_w / count,
        })
    }
}
