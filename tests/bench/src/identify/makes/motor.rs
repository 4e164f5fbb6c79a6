//! A permanent-magnet motor by its equations in the rotor's frame, power-invariant (Krause, *Analysis of Electric Machinery*, chapter 4).

/// A motor with its load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motor {
    /// Ohm.
    pub(super) resistance: f64,
    /// H.
    pub(super) inductance: f64,
    pub(super) pole_pairs: f64,
    /// Wb.
    pub(super) flux: f64,
    /// kg m^2.
    pub(super) inertia: f64,
    /// N m s.
    pub(super) viscous: f64,
    /// N m.
    pub(super) coulomb: f64,
    pub(super) friction: Friction,
    /// Constant, N m.
    pub(super) load: f64,
    /// Of the flux over the electrical angle: its share of the flux, and its order.
    pub(super) harmonic: [f64; 2],
    /// V.
    pub(super) bus: f64,
}

/// How Coulomb friction turns its sign round.
#[derive(Debug, Clone, Copy)]
pub(super) enum Friction {
    /// Over so many rad/s.
    Rounded(f64),
    /// Over so many rad, on a bristle (Dahl).
    Bristle(f64),
}

/// What moves: currents in the rotor's frame, angle, speed, the bristle's share of the friction.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct State {
    pub(super) d: f64,
    pub(super) q: f64,
    pub(super) angle: f64,
    pub(super) speed: f64,
    bristle: f64,
}

impl Motor {
    pub(super) const fn typical(
        [
            resistance,
            inductance,
            pole_pairs,
            flux,
            inertia,
            viscous,
            coulomb,
            bus,
        ]: [f64; 8],
    ) -> Self {
        Motor {
            resistance,
            inductance,
            pole_pairs,
            flux,
            inertia,
            viscous,
            coulomb,
            friction: Friction::Rounded(0.1),
            load: 0.0,
            harmonic: [0.0; 2],
            bus,
        }
    }

    /// Speed at which the back EMF takes 55 % of what the bus gives, rad/s.
    pub(super) fn top_speed(&self) -> f64 {
        0.55 * self.bus / 2.0_f64.sqrt() / (self.pole_pairs * self.flux)
    }

    /// Current that friction at top speed takes ten times, A.
    pub(super) fn rated_a(&self) -> f64 {
        let friction = self.coulomb + self.viscous * self.top_speed();
        10.0 * friction / (self.pole_pairs * self.flux)
    }

    /// On voltages in the stator's frame, for `dt` seconds, by the midpoint rule: a step at the speed of the rotor would spiral outwards.
    pub(super) fn step(&self, state: &mut State, voltage: [f64; 2], dt: f64) {
        let start = self.rates(state, voltage);
        let half = State {
            d: state.d + 0.5 * dt * start[0],
            q: state.q + 0.5 * dt * start[1],
            angle: state.angle + 0.5 * dt * state.speed,
            ..*state
        };
        let [d_rate, q_rate] = self.rates(&half, voltage);
        let friction = match self.friction {
            Friction::Rounded(width) => (state.speed / width).tanh(),
            Friction::Bristle(reach) => {
                let turned = state.speed * dt / reach;
                state.bristle = (state.bristle + turned) / (1.0 + turned.abs());
                state.bristle
            }
        };
        let torque = self.pole_pairs * self.flux_at(half.angle) * half.q
            - self.viscous * state.speed
            - self.coulomb * friction
            - self.load;
        state.d += dt * d_rate;
        state.q += dt * q_rate;
        state.speed += dt * torque / self.inertia;
        state.angle += dt * state.speed;
    }

    /// Wb.
    fn flux_at(&self, angle: f64) -> f64 {
        let [share, order] = self.harmonic;
        self.flux * (1.0 + share * (order * self.pole_pairs * angle + 0.4).cos())
    }

    /// Of both currents, A/s.
    fn rates(&self, state: &State, [alpha, beta]: [f64; 2]) -> [f64; 2] {
        let electrical = self.pole_pairs * state.speed;
        let (sin, cos) = (self.pole_pairs * state.angle).sin_cos();
        let (u_d, u_q) = (alpha * cos + beta * sin, beta * cos - alpha * sin);
        let of_voltage = [u_d, u_q - electrical * self.flux_at(state.angle)];
        let of_turn = [electrical * state.q, -electrical * state.d];
        let currents = [state.d, state.q];
        [0, 1]
            .map(|k| (of_voltage[k] - self.resistance * currents[k]) / self.inductance + of_turn[k])
    }
}
