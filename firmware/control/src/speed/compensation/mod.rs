//! Harmonic compensation: the drive removes ripple that repeats with an angle, and learns it while it runs.
//!
//! | repeats with | is | corrected at | learned from |
//! | --- | --- | --- | --- |
//! | the shaft of a motor | torque: harmonics of current and flux, cogging, errors of current sensors and dead time | the current reference | the speed error of that motor |
//! | the shaft of a motor | an error of its encoder, which that encoder cannot see | the speed reference | the table's scale |
//! | the relative angle | an error of the lead | the screw's speed reference | the table's scale |
//!
//! Each order has a complex coefficient that does not depend on speed; [`response`] says what the loops make of it at the
//! present one. Learning is adaptive feed-forward cancellation (Bodson, Sacks and Khosla, "Harmonic generation in adaptive
//! feedforward cancellation schemes", IEEE Trans. Automatic Control, 1994): the error is correlated with the ripple's own cosine and sine, turned by the phase of the loops. That
//! is an integrator at the order's frequency, and so equals a resonator there; its time constant is the same for all orders.
//!
//! Learning stands still in five cases:
//!
//! - A speed changes.
//! - A load changes, after it was steady: for 0.3 s.
//! - A limit cuts a current.
//! - The order is beyond what the loops can do.
//! - The encoder's counting [beats](beat) with the sampling.
//!
//! Each coefficient is bounded, so that nothing winds up. [`fit`] checks whether a saved table still fits. A torque's coefficient is a
//! straight line over the motor's load, by [`slope`].

pub mod beat;
pub mod fit;
pub mod line;
pub mod response;
pub mod slope;
mod usual;

use crate::base::format::{Angle, Current, Speed, multiply_upper};
use beat::BeatConfig;
use fit::TableChecks;
use line::{Line, Order, Phasor};
use response::Response;
use slope::LoadSlope;
use usual::UsualError;

/// Orders of torque of a motor.
pub const TORQUES: usize = 8;
/// Orders of an encoder's error.
pub const ANGLES: usize = 4;
/// Orders of the lead's error.
pub const TRAVELS: usize = 4;
/// Fraction bits of a torque's coefficient, A.
pub const TORQUE_BITS: u32 = 17;
/// Fraction bits of an encoder's and the lead's coefficient: relative change of speed.
pub const SPEED_BITS: u32 = 27;

/// An order with its coefficient at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineConfig {
    /// How often it repeats in a turn.
    pub order: Order,
    /// What it starts with.
    pub start: Phasor,
}

/// How fast orders are learned from the table's scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RateConfig {
    /// For a slow shaft: 2^-44 per 2^-16 rad/s.
    pub slow: i32,
    /// For a fast one the same over its speed: `fast / (theta_step >> FAST_DROPS) << fast_shift`.
    pub fast: u32,
    /// See `fast`.
    pub fast_shift: u32,
}

/// Bits of a speed that a rate over speed does without.
pub(crate) const FAST_DROPS: u32 = 10;

/// The table's scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScaleConfig {
    /// Relative speed of screw and nut per count in [`SPEED_STEPS`] steps, 2^-24 rad/s.
    pub per_count: i32,
    /// Learning of the encoders' and the lead's errors.
    pub rate: RateConfig,
}

/// Configuration of the compensation. In memory the lists, which only the start reads, come last.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct CompensationConfig {
    /// There is an order to compensate.
    pub active: bool,
    /// It learns.
    pub learns: bool,
    /// The table's scale, if there is one.
    pub scale: Option<ScaleConfig>,
    /// Electrical turns a mechanical turn: screw, nut.
    pub pole_pairs: [i32; 2],
    /// Places of a turn that an alignment cannot tell apart: as many as pole pairs, 1 of an encoder that knows its turn.
    pub places: [u32; 2],
    /// Part of the full learning rate for a shaft that turns by 1 a PWM period, 2^-32 turn: 2^-47. A slow shaft is learned
    /// by its turns, and not by time.
    pub slow: i32,
    /// Checks of a torque's table at the full learning rate, 2^-15, after which one that has not moved fits.
    pub checked: u32,
    /// Largest part of a torque's coefficient, 2^-17 A.
    pub torque_max: i32,
    /// Where the encoders beat: screw, nut.
    pub beat: [BeatConfig; 2],
    /// How the loops answer: screw, nut.
    pub response: [Response; 2],
    /// Torque: screw, nut.
    pub torque: [[LineConfig; TORQUES]; 2],
    /// How the torques change with the motor's load, 2^-24 A per A.
    pub per_load: [[Phasor; TORQUES]; 2],
    /// Errors of the encoders: screw, nut.
    pub angle: [[LineConfig; ANGLES]; 2],
    /// Errors of the lead.
    pub travel: [LineConfig; TRAVELS],
}

impl CompensationConfig {
    /// Part of the full learning rate for a shaft that turns by `theta_step` a PWM period, either way, 2^-31.
    #[inline(always)]
    fn part(&self, theta_step: u32) -> i32 {
        // Within 2^28 times 2^31, in 2^-47; a part is in 2^-31.
        let part = i64::from(theta_step).wrapping_mul(self.slow.into()) >> 16;
        #[allow(clippy::cast_possible_truncation)]
        let part = part.min(i32::MAX.into()) as i32;
        part
    }
}

/// What the compensation sees of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Angle of the shaft.
    pub theta: Angle,
    /// Its turning in a PWM period, 2^-32 turn.
    pub theta_step: i32,
    /// Electrical speed.
    pub omega_e: Speed,
    /// The same that it is asked.
    pub asked: Speed,
    /// It follows a steady reference without a limit.
    pub steady: bool,
}

/// State of the compensation.
#[derive(Clone, Copy, Debug)]
pub struct Compensation {
    torque: [[Line; TORQUES]; 2],
    /// How the torques' coefficients change with the loads.
    slopes: [[LoadSlope; TORQUES]; 2],
    angle: [[Line; ANGLES]; 2],
    travel: [Line; TRAVELS],
    /// Angles over many turns, 2^-32 turn: screw, nut.
    turned: [u64; 2],
    /// The scale's last count.
    counted: Option<u32>,
    /// What is added to the speed references: screw, nut.
    given: [Speed; 2],
    /// Counts the steps.
    step: u8,
    /// The line that is tuned next.
    next: u8,
    /// Both motors are steady since as many steps as it takes to tune all lines.
    steady_steps: u8,
    /// Rounds in which nothing is learned yet, after a load or a speed that was steady has changed.
    waits: u8,
    /// Loads of screw and nut that the learning has settled at, 2^-8 A.
    loads: [i32; 2],
    checks: TableChecks,
    /// Rounds of this window of errors.
    rounds: u8,
    /// Sizes of the errors: of screw and nut, and of the table.
    usual: [UsualError; 3],
}

/// Rounds of a window: 1.5 s at 5 kHz, in which a shaft of 40 rpm turns once.
const WINDOW_ROUNDS: u8 = 64;

/// Steps of the speed task in which each motor's torque learns once.
pub const TORQUE_STEPS: u8 = 2;
/// Steps in which the speed references are computed and learn once, and one line is tuned.
pub(crate) const SPEED_STEPS: u8 = 4;

/// Lines in all: torque of screw and nut, angles of both, lead.
pub const LINES: usize = 2 * TORQUES + 2 * ANGLES + TRAVELS;
/// Steps in which all lines are tuned once, and one table is checked.
const ROUND_STEPS: u8 = SPEED_STEPS * (LINES as u8 + 1);
/// Rounds until a load or a speed that has changed has arrived, and the speed error of that has gone: 0.3 s at 5 kHz. Slow orders would learn it.
const LOAD_ROUNDS: u8 = 13;
/// Steps from one check of a table to its next.
pub(crate) const CHECK_STEPS: u32 = ROUND_STEPS as u32 * fit::TABLES as u32;

impl Compensation {
    /// A compensation that gives what its configuration starts with.
    #[must_use]
    pub const fn new(config: &CompensationConfig) -> Self {
        let [screw, nut] = &config.torque;
        let [screw_per_load, nut_per_load] = &config.per_load;
        let [screw_angle, nut_angle] = &config.angle;
        Self {
            torque: [starting(screw), starting(nut)],
            slopes: [slopes(screw_per_load), slopes(nut_per_load)],
            angle: [starting(screw_angle), starting(nut_angle)],
            travel: starting(&config.travel),
            turned: [0; 2],
            counted: None,
            given: [Speed::ZERO; 2],
            step: 0,
            next: 0,
            steady_steps: 0,
            waits: 0,
            loads: [0; 2],
            checks: TableChecks::new(),
            rounds: 0,
            usual: [UsualError::new(); 3],
        }
    }

    /// What was learned by one of the [`LINES`], in their order: 2^-17 A of a torque, 2^-27 of a speed.
    #[must_use]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    pub fn coefficient(&self, line: usize) -> Phasor {
        const ANGLES_FROM: usize = 2 * TORQUES;
        const TRAVELS_FROM: usize = ANGLES_FROM + 2 * ANGLES;
        let found = match line {
            ..ANGLES_FROM => self.torque.as_flattened().get(line),
            ANGLES_FROM..TRAVELS_FROM => {
                let angles = self.angle.as_flattened();
                angles.get(line.wrapping_sub(ANGLES_FROM))
            }
            _ => self.travel.get(line.wrapping_sub(TRAVELS_FROM)),
        };
        found.map_or(Phasor::ZERO, Line::coefficient)
    }

    /// How the coefficient of one of the first `2 * TORQUES` lines changes with the motor's load, 2^-24 A per A.
    #[must_use]
    pub fn per_load(&self, line: usize) -> Phasor {
        let slope = self.slopes.as_flattened().get(line);
        slope.map_or(Phasor::ZERO, LoadSlope::per_load)
    }

    /// A step in which nothing is driven: the table may be moved meanwhile. What was learned stays.
    #[inline(always)]
    pub fn rest(&mut self) {
        (self.steady_steps, self.counted) = (0, None);
    }

    /// First in a step: gives what is added to the speed references. `scale` is the table's count. `relative` is the reference of screw less
    /// nut, mechanical rad/s. `loads` gives the motors' loads, 2^-8 A; one step in four calls it.
    #[inline(always)]
    pub fn references(
        &mut self,
        config: &CompensationConfig,
        shafts: [Turning; 2],
        scale: Option<u32>,
        relative: Speed,
        loads: impl FnOnce() -> [i32; 2],
    ) -> [Speed; 2] {
        let [screw, nut] = shafts;
        let [screw_turned, nut_turned] = &mut self.turned;
        *screw_turned = on(*screw_turned, screw.theta);
        *nut_turned = on(*nut_turned, nut.theta);
        self.steady_steps = if screw.steady && nut.steady {
            self.steady_steps.saturating_add(1)
        } else {
            0
        };
        self.step = self.step.wrapping_add(1);
        match self.step % SPEED_STEPS {
            0 => {
                let error = self.table_error(config, scale, relative);
                self.give(config, [screw.omega_e, nut.omega_e], error, relative);
            }
            2 => self.tune(
                config,
                [screw.theta_step, nut.theta_step],
                [screw.asked, nut.asked],
                loads(),
            ),
            _ => {}
        }
        self.given
    }

    /// What is added to the speed references, from here on.
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn give(
        &mut self,
        config: &CompensationConfig,
        omega_e: [Speed; 2],
        error: i32,
        relative: Speed,
    ) {
        let error = if self.learns() {
            let [.., usual] = &mut self.usual;
            usual.cut(held(error))
        } else {
            0
        };
        let [screw_turned, nut_turned] = self.turned;
        let [screw_lines, nut_lines] = &mut self.angle;
        let to_screw = learn(screw_lines, screw_turned << 16, error);
        let to_nut = learn(nut_lines, nut_turned << 16, error);
        let turned = screw_turned.wrapping_sub(nut_turned);
        let to_relative = learn(&mut self.travel, turned << 16, error);
        let [pole_pairs, _] = config.pole_pairs;
        let relative = relative.saturating_mul_int(pole_pairs);
        let [screw, nut] = omega_e;
        self.given = [
            speed_part(screw, to_screw).saturating_add(speed_part(relative, to_relative)),
            speed_part(nut, to_nut),
        ];
    }

    /// Then: both speed errors -> what is added to the current references. The motors learn by turns.
    #[inline(always)]
    pub fn currents(&mut self, errors: [Speed; 2]) -> [Current; 2] {
        let learns = self.learns();
        let [screw_turned, nut_turned] = self.turned;
        let [screw_lines, nut_lines] = &mut self.torque;
        let [screw_error, nut_error] = errors;
        let [screw_usual, nut_usual, _] = &mut self.usual;
        let screws_turn = self.step.is_multiple_of(TORQUE_STEPS);
        let of_screw = if learns && screws_turn {
            let error = screw_usual.cut(held(screw_error.to_bits()));
            learn(screw_lines, screw_turned << 16, error)
        } else {
            sum(screw_lines, screw_turned << 16)
        };
        let of_nut = if learns && !screws_turn {
            let error = nut_usual.cut(held(nut_error.to_bits()));
            learn(nut_lines, nut_turned << 16, error)
        } else {
            sum(nut_lines, nut_turned << 16)
        };
        [of_screw, of_nut].map(|sum| Current::from_bits(sum.saturating_add(sum)))
    }

    /// All lines are tuned to speeds that have not changed since.
    #[inline(always)]
    fn learns(&self) -> bool {
        self.steady_steps > ROUND_STEPS && self.waits == 0
    }

    /// How much slower the table is than asked, as a relative speed, 2^-16 mechanical rad/s.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    fn table_error(
        &mut self,
        config: &CompensationConfig,
        scale: Option<u32>,
        relative: Speed,
    ) -> i32 {
        let (Some(scale_config), Some(count)) = (config.scale, scale) else {
            self.counted = None;
            return 0;
        };
        let Some(before) = self.counted.replace(count) else {
            return 0;
        };
        let moved = i64::from(count.wrapping_sub(before).cast_signed());
        let speed = moved.wrapping_mul(scale_config.per_count.into()) >> 8;
        let error = i64::from(relative.to_bits()).wrapping_sub(speed);
        error.clamp(i32::MIN.into(), i32::MAX.into()) as i32
    }

    fn end_window(&mut self, settled: bool) {
        self.rounds = 0;
        for usual in &mut self.usual {
            usual.next_window(settled);
        }
    }

    /// A load or a speed that is another one begins a new window.
    #[inline(always)]
    fn look_at_loads(&mut self, config: &CompensationConfig, loads: [i32; 2], least: u32) {
        let other = |(load, settled): (&i32, &i32)| load.abs_diff(*settled) > least;
        if self.steady_steps < SPEED_STEPS || loads.iter().zip(&self.loads).any(other) {
            self.loads = loads;
            if self.checks.unsettle(config) {
                self.waits = LOAD_ROUNDS;
            }
            self.end_window(false);
        }
    }

    /// After the last line: a table is checked, and the first line is the next.
    #[inline(always)]
    fn end_round(&mut self, config: &CompensationConfig, theta_steps: [i32; 2]) {
        self.next = 0;
        self.waits = self.waits.saturating_sub(1);
        self.check(config, theta_steps);
        self.rounds = self.rounds.wrapping_add(1);
        if self.rounds >= WINDOW_ROUNDS {
            self.end_window(self.checks.is_settled(config));
        }
    }

    /// Tunes one line to the present speeds; after the last a table is checked.
    #[inline(never)]
    fn tune(
        &mut self,
        config: &CompensationConfig,
        theta_steps: [i32; 2],
        asked: [Speed; 2],
        loads: [i32; 2],
    ) {
        // An eighth of the largest coefficient.
        let least = (config.torque_max >> (TORQUE_BITS - 8 + 3)).unsigned_abs();
        self.look_at_loads(config, loads, least);
        let next = usize::from(self.next);
        if next >= LINES {
            self.end_round(config, theta_steps);
            return;
        }
        self.next = self.next.wrapping_add(1);
        let motor = next & 1;
        let index = next >> 1;
        let (Some(response), Some(&theta_step)) =
            (config.response.get(motor), theta_steps.get(motor))
        else {
            return;
        };
        if index < TORQUES {
            let lines = self.torque.get_mut(motor);
            let slopes = self.slopes.get_mut(motor);
            if let Some(line) = lines.and_then(|lines| lines.get_mut(index))
                && let Some(slope) = slopes.and_then(|slopes| slopes.get_mut(index))
                && let Some(&load) = loads.get(motor)
                && line.order().0 != 0
            {
                let beats = |frequency| match (config.beat.get(motor), asked.get(motor)) {
                    (Some(beat), Some(asked)) => beat.is_near(*asked, frequency),
                    _ => false,
                };
                let halved = self.checks.halved(config, motor);
                let mut more = slope.at(load);
                if halved != 0 && line.learns() {
                    let learned = line.coefficient().plus(more);
                    if slope.take(learned, load, least) {
                        more = slope.at(load);
                        line.learn_anew(learned.minus(more));
                        self.checks.divide(motor, index);
                    }
                }
                tune_torque(config, line, more, response, theta_step, halved, beats);
            }
            return;
        }
        let [screw, nut] = theta_steps;
        let relative = screw.wrapping_sub(nut);
        let index = index.wrapping_sub(TORQUES);
        if index < ANGLES {
            let halved = self.checks.halved(config, 2usize.wrapping_add(motor));
            let lines = self.angle.get_mut(motor);
            let torque = self.torque.get(motor);
            if let Some(line) = lines.and_then(|lines| lines.get_mut(index)) {
                let slower = theta_step.unsigned_abs().min(relative.unsigned_abs());
                let shared = torque.is_some_and(|torque| has(torque, line.order()));
                let Some(point) = response.at(line.order().frequency(theta_step)) else {
                    return line.tune(Phasor::ZERO, Phasor::ZERO, SPEED_PART_MAX);
                };
                let sense = point.sense();
                let follow = through(point.learning(|point| point.follow), sense);
                let follow = if shared { between_both(follow) } else { follow };
                let learns = if shared && lags(follow) {
                    Phasor::ZERO
                } else {
                    learning(config, follow, line.order(), theta_step, slower).halved(halved)
                };
                let learns = if motor == 0 { learns } else { negative(learns) };
                // 2^-27 times 2^-30 is 2^-57, of which the upper word is in 2^-25.
                let gives = line.coefficient().times(sense.turned_by(theta_step), 2);
                line.tune(gives, learns, SPEED_PART_MAX);
            }
            return;
        }
        let index = index.wrapping_sub(ANGLES).wrapping_mul(2);
        let halved = self.checks.halved(config, 4);
        let [screw_torque, _] = &self.torque;
        if let Some(line) = self.travel.get_mut(index.wrapping_add(motor)) {
            let [response, _] = &config.response;
            let slower = relative.unsigned_abs();
            // Where the nut stands, the lead repeats with the screw.
            let stands = nut.unsigned_abs() < slower >> 3;
            let shared = stands && has(screw_torque, line.order());
            let learns = match response.at(line.order().frequency(relative)) {
                Some(point) => {
                    let follow = point.learning(|point| point.follow);
                    match shared && lags(through(follow, point.sense())) {
                        true => Phasor::ZERO,
                        false => {
                            learning(config, follow, line.order(), relative, slower).halved(halved)
                        }
                    }
                }
                None => Phasor::ZERO,
            };
            line.tune(line.coefficient(), learns, SPEED_PART_MAX);
        }
    }
}

/// An error of an encoder or the lead changes the speed by no more than a sixteenth.
const SPEED_PART_MAX: i32 = 1 << (SPEED_BITS - 4);

/// An error within ±512 rad/s, so that the learning of as many steps as lie between two tunings of a line fits: see
/// [`Line::learn`].
#[inline(always)]
fn held(error: i32) -> i32 {
    // The SSAT instruction takes this range, and no symmetric one.
    const END: i32 = 1 << 25;
    error.clamp(-END, END - 1)
}

/// An angle over many turns, of which the lower word is the angle within one, moved on to `theta`.
#[inline(always)]
#[allow(clippy::cast_possible_truncation)]
fn on(turned: u64, theta: Angle) -> u64 {
    turned.wrapping_add_signed(theta.minus(Angle(turned as u32)).into())
}

const fn starting<const N: usize>(configs: &[LineConfig; N]) -> [Line; N] {
    let mut lines = [Line::NONE; N];
    let mut left: (&mut [Line], &[LineConfig]) = (&mut lines, configs);
    while let ([line, lines @ ..], [config, configs @ ..]) = left {
        *line = Line::starting(config.order, config.start);
        left = (lines, configs);
    }
    lines
}

const fn slopes(per_load: &[Phasor; TORQUES]) -> [LoadSlope; TORQUES] {
    let mut slopes = [LoadSlope::NONE; TORQUES];
    let mut left: (&mut [LoadSlope], &[Phasor]) = (&mut slopes, per_load);
    while let ([slope, slopes @ ..], [per_load, more @ ..]) = left {
        *slope = LoadSlope::starting(*per_load);
        left = (slopes, more);
    }
    slopes
}

/// The sum of lines at an angle over many turns, shifted up by 16, in twice their unit.
///
/// It and [`learn`] are one loop each. With two loops in one function the compiler keeps the cosine's constant in 64 bits. A product
/// with such a constant takes three instructions.
#[inline(never)]
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
fn sum<const N: usize>(lines: &[Line; N], turned: u64) -> i32 {
    let mut sum = 0i32;
    for line in lines {
        if line.order().0 != 0 {
            let at = line.order().angle_of_shifted(turned).cos_sin();
            sum = sum.saturating_add(line.value(at));
        }
    }
    sum
}

/// The same of lines that learn from an error.
#[inline(never)]
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
fn learn<const N: usize>(lines: &mut [Line; N], turned: u64, error: i32) -> i32 {
    let mut sum = 0i32;
    for line in lines {
        if line.order().0 != 0 {
            let at = line.order().angle_of_shifted(turned).cos_sin();
            sum = sum.saturating_add(line.value(at));
            line.learn(at, error);
        }
    }
    sum
}

/// A part of a speed, 2^-26.
#[inline(always)]
fn speed_part(speed: Speed, part: i32) -> Speed {
    let wide = i64::from(speed.to_bits()).wrapping_mul(part.into()) >> (SPEED_BITS - 1);
    #[allow(clippy::cast_possible_truncation)]
    Speed::from_bits(wide.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
}

/// Tunes a torque's line, to whose coefficient the load adds `more`.
#[inline(always)]
fn tune_torque(
    config: &CompensationConfig,
    line: &mut Line,
    more: Phasor,
    response: &Response,
    theta_step: i32,
    halved: u32,
    beats: impl FnOnce(u32) -> bool,
) {
    let frequency = line.order().frequency(theta_step);
    let Some(point) = response.at(frequency) else {
        return line.tune(Phasor::ZERO, Phasor::ZERO, config.torque_max);
    };
    // 2^-17 A times 2^-27 is 2^-44; a current is in 2^-20 A.
    let gives = line
        .coefficient()
        .plus(more)
        .times(point.of(|point| point.realise).turned_by(theta_step), 8);
    let learns = if config.learns && !beats(frequency) {
        let part = config.part(theta_step.unsigned_abs()) >> halved;
        let learn = point.learning(|point| point.learn);
        learn.turned_by(theta_step).part(part)
    } else {
        Phasor::ZERO
    };
    line.tune(gives, learns, config.torque_max);
}

/// That a motor's torque has an order.
fn has(lines: &[Line; TORQUES], order: Order) -> bool {
    lines.iter().any(|line| line.order() == order)
}

/// What must be given per true speed that an encoder with an error shows, 2^-29. The phase is that of `follow` over `sense`, less that of
/// the hold of what is given, which is small. The size is smaller: what is seen little is learned more slowly.
fn through(follow: Phasor, sense: Phasor) -> Phasor {
    // 2^-29 times 2^-30 is 2^-59, of which the upper word is in 2^-27.
    follow.times(sense.turned_by(-1), 2)
}

/// That a speed follows by more than 76 degrees late.
fn lags(follow: Phasor) -> bool {
    follow.re < follow.im.saturating_abs() >> 2
}

/// What must be given per true speed by a line whose order the motor's torque has too. While that torque is being learned, the speed follows
/// the loops: `follow` is the inverse. Once it is learned, the measured speed has no error, and the true one follows at once. So the phase is
/// half of that of `follow`, within 76 degrees of both up to 152, and the size at most 1.
fn between_both(follow: Phasor) -> Phasor {
    const ONE: i32 = 1 << 29;
    let mut follow = follow;
    // A word is four at most.
    for _ in 0..2 {
        if follow.re.saturating_abs().max(follow.im.saturating_abs()) > ONE {
            follow = follow.halved(1);
        }
    }
    let (re, im) = (follow.re.saturating_abs(), follow.im.saturating_abs());
    let (larger, smaller) = (re.max(im), re.min(im));
    // Its length, within 7 %. The sum of a number and its length has half its angle.
    let length = larger
        .saturating_add(smaller >> 2)
        .saturating_add(smaller >> 3);
    Phasor {
        re: follow.re.saturating_add(length) >> 1,
        im: follow.im >> 1,
    }
}

/// What an error of the table's speed adds to a line of a shaft that turns by `theta_step`. `follow` is what must be given per true speed.
/// `slower` is the slower motion of those that distinguish the line from others. Zero without a scale: encoders and lead then keep their
/// saved values.
#[inline(never)]
fn learning(
    config: &CompensationConfig,
    follow: Phasor,
    order: Order,
    theta_step: i32,
    slower: u32,
) -> Phasor {
    let Some(scale) = config.scale.filter(|_| config.learns && order.0 != 0) else {
        return Phasor::ZERO;
    };
    let turned = follow.turned_by(theta_step);
    let slower = order.frequency(slower.min(i32::MAX as u32).cast_signed());
    let rate = rate(scale.rate, theta_step, slower);
    let times = |x| multiply_upper(x, rate).saturating_mul(8);
    let learns = Phasor {
        re: times(turned.re),
        im: times(turned.im),
    };
    if theta_step < 0 {
        negative(learns)
    } else {
        learns
    }
}

fn negative(x: Phasor) -> Phasor {
    Phasor {
        re: x.re.wrapping_neg(),
        im: x.im.wrapping_neg(),
    }
}

/// An order above is learned as fast as this one.
const ORDERS_MAX: u32 = 16;

/// The rate for a shaft that turns by `theta_step`, by the slower of the motions that distinguish it from others. The higher an order, the
/// fewer turns distinguish it from the same order of another shaft.
#[inline(always)]
#[allow(clippy::cast_possible_truncation)]
fn rate(config: RateConfig, theta_step: i32, slower: u32) -> i32 {
    let speed = theta_step.unsigned_abs() >> FAST_DROPS;
    let fast = config.fast.checked_div(speed).unwrap_or(u32::MAX);
    let fast = (u64::from(fast) << (config.fast_shift & 31)).min(i32::MAX as u64) as i32;
    // Slow in the slower motion: as much less as that is slower than the shaft.
    let part = (slower >> FAST_DROPS).min(u16::MAX.into()).wrapping_shl(16);
    let part = part.checked_div(speed).unwrap_or(0).min(ORDERS_MAX << 16);
    let slow = i64::from(config.slow).wrapping_mul(part.into()) >> 16;
    slow.min(fast.into()) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{CompensationPlate, OrderPlate, TorqueOrderPlate, test_plate};

    #[test]
    fn a_line_that_a_torque_shares_learns_halfway_between_both() {
        for degrees in [-150.0f64, -120.0, -60.0, -5.0, 0.0, 30.0, 95.0, 150.0] {
            for size in [0.2, 1.0, 3.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let one = 536_870_912.0 * size;
                let follow = Phasor {
                    re: (one * cos) as i32,
                    im: (one * sin) as i32,
                };
                let half = between_both(follow);
                let (re, im) = (f64::from(half.re), f64::from(half.im));
                let off = im.atan2(re).to_degrees() - degrees / 2.0;
                assert!(off.abs() < 8.0, "{degrees} degrees, {size}: off by {off}");
                assert!(re.hypot(im) < 1.1 * 536_870_912.0, "{size}");
            }
        }
    }

    /// Every line has an order, and a scale shows them.
    fn config() -> CompensationConfig {
        let mut plate = test_plate();
        let orders = |k: usize| OrderPlate::unknown(1.0 + k as f64);
        let torques = |k: usize| TorqueOrderPlate::unknown(1.0 + k as f64);
        plate.compensation = CompensationPlate {
            torque: [core::array::from_fn(torques); 2],
            angle: [core::array::from_fn(orders); 2],
            travel: core::array::from_fn(orders),
            learning_s: 0.5,
            scale_count_m: 20e-9,
        };
        plate.config().unwrap().compensation
    }

    /// Shafts at 1 and 2 turns a second, under a load, for as many steps.
    fn run(compensation: &mut Compensation, config: &CompensationConfig, load: i32, steps: u32) {
        let shaft = |theta_step: i32| Turning {
            theta_step,
            omega_e: Speed::from_num(62.8),
            asked: Speed::from_num(62.8),
            steady: true,
            ..Turning::default()
        };
        let shafts = [shaft(429_497), shaft(214_748)];
        for _ in 0..steps {
            let _ =
                compensation.references(config, shafts, Some(0), Speed::from_num(6), || [load; 2]);
            let _ = compensation.currents([Speed::ZERO; 2]);
        }
    }

    #[test]
    fn every_line_is_tuned_in_a_round() {
        let config = config();
        let mut compensation = Compensation::new(&config);
        run(&mut compensation, &config, 0, 2 * u32::from(ROUND_STEPS));
        let speeds = compensation.angle.as_flattened().iter();
        let torques = compensation.torque.as_flattened().iter();
        for (k, line) in torques
            .chain(speeds)
            .chain(&compensation.travel)
            .enumerate()
        {
            assert!(line.learns(), "line {k} learns nothing");
        }
    }

    /// A torque's table has learned for four of its time constants after 2 s; a load that comes makes it quick again.
    #[test]
    fn learning_slows_down_while_speed_and_load_are_steady() {
        let config = config();
        let mut compensation = Compensation::new(&config);
        let mut halved = |load, steps| {
            run(&mut compensation, &config, load, steps);
            compensation.checks.halved(&config, 0)
        };
        let (second, heavy) = (5_000, 2 * 256);
        assert_eq!(halved(0, second), 0, "after 1 s");
        assert_eq!(halved(0, 2 * second), 1, "after 3 s");
        assert_eq!(
            halved(1, 20 * second),
            3,
            "after 23 s, under a load of 4 mA"
        );
        assert_eq!(halved(heavy, second / 10), 0, "under a load of 2 A");
        assert_eq!(halved(heavy, 3 * second), 1, "3 s under that load");
    }
}
