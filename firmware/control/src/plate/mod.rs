//! Plate data: the drive as its motors, its board and its feed are labelled.
//!
//! | part | module |
//! | --- | --- |
//! | each parameter, declared once | [`groups`], in the language of [`parameter`] |
//! | all settings, by number and name | [`settings`] |
//! | settings -> the plate in SI | `conversion` |
//! | board, orders, the plate as a whole | here |
//! | loop tuning, and the gains that follow from it (Eqs 9 to 12) | [`tuning`] |
//! | physical units -> the loops' fixed-point formats | [`scaling`] |
//!
//! Everything here is `const fn`, so a board's gains are computed while it is compiled: a gain that does not fit
//! its format is then a build error. Stored settings are computed by the same code at run time: on a host, and on the chip in
//! software floats, in the idle task alone. No interrupt uses a float.

mod conversion;
pub mod groups;
pub mod parameter;
pub mod scaling;
pub mod settings;
pub mod tuning;

pub use conversion::Unfit;
pub use groups::{
    AlignmentPlate, BasePlate, BasePoint, BrakePlate, BridgePlate, CommandPlate, EncoderPlate,
    FeedPlate, HomePlate, MotorPlate, NotchPlate, RejectionPlate, RubbingPlate, RunawayPlate,
    ThermalPlate, TravelPlate, Tuning,
};
pub use scaling::DriveConfig;
pub use settings::Settings;
pub use tuning::Gains;

use crate::base::format::Angle;
use crate::current::observer::EncoderAlignment;
use crate::current::sense::Shunts;
use crate::speed::compensation::line::Phasor;
use crate::speed::compensation::slope::PER_LOAD_BITS;
use crate::speed::compensation::{ANGLES, SPEED_BITS, TORQUE_BITS, TORQUES, TRAVELS};
use core::f64::consts::TAU;
use groups::{
    BaseSettings, BrakeSettings, FrictionSettings, RejectionSettings, TravelSettings, WatchSettings,
};

impl EncoderPlate {
    /// How it lies to its rotor, as this plate says.
    #[must_use]
    pub const fn alignment(&self) -> EncoderAlignment {
        EncoderAlignment {
            reversed: matches!(self.reversed, Some(true)),
            theta_e_at_zero: Angle::from_turns(self.theta_e_at_zero_turns),
            index_awaited: false,
        }
    }
}

/// One bridge and its sensors, as the board has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardPlate {
    /// Clock of the PWM timers, Hz.
    pub timer_hz: f64,
    /// PWM and current-loop frequency, Hz: 10 000 to 40 000.
    pub pwm_hz: f64,
    /// Current-loop periods per step of the speed task.
    pub speed_divider: u32,
    /// Which phases are measured.
    pub shunts: Shunts,
    /// A into the motor per ADC count. Negative where such a current lowers the count, as a low-side shunt behind a
    /// non-inverting amplifier has it: the current flows through it from minus into the motor.
    pub amps_per_count: f64,
    /// ADC counts at zero current.
    pub zero_counts: f64,
    /// V of the bus per ADC count.
    pub bus_volts_per_count: f64,
    /// Counts of the ADC's full scale.
    pub adc_counts: u32,
}

impl TravelPlate {
    /// No soft limits; homing backwards, the switch is zero. The velocities are our choice: from the first the usual feed stops in
    /// 0.4 mm, at the second a look of a millisecond is a micrometre.
    pub const UNLIMITED: Self = TravelSettings::DEFAULT.plate();
}

impl BrakePlate {
    /// An axis whose friction holds its load. The times are our choice until a brake's datasheet gives its own.
    pub const NONE: Self = BrakeSettings::DEFAULT.plate();

    /// The load drives the table back, and nothing holds it.
    #[must_use]
    pub const fn is_missing(&self) -> bool {
        self.load_drives_back && !self.fitted
    }
}

/// What repeats with an angle and is compensated: see [`compensation`](crate::speed::compensation).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationPlate {
    /// Torque of screw and nut, as currents, A. At most two thirds of the largest current each.
    pub torque: [[TorqueOrderPlate; TORQUES]; 2],
    /// Errors of the encoders of screw and nut: relative change of their speed.
    pub angle: [[OrderPlate; ANGLES]; 2],
    /// Error of the lead, of the relative angle of screw and nut: relative change of the table's velocity.
    pub travel: [OrderPlate; TRAVELS],
    /// Time constant with which each is learned, s; 0: nothing is.
    pub learning_s: f64,
    /// One count of the table's scale, m, negative where it falls with positive travel; 0: there is none.
    pub scale_count_m: f64,
}

impl CompensationPlate {
    /// Time constant of a drive that learns, s. `cargo xtask bench smooth` measures with it.
    pub const LEARNING_S: f64 = 0.5;

    /// Nothing is compensated.
    pub const NONE: Self = Self {
        torque: [[TorqueOrderPlate::NONE; TORQUES]; 2],
        angle: [[OrderPlate::NONE; ANGLES]; 2],
        travel: [OrderPlate::NONE; TRAVELS],
        learning_s: 0.0,
        scale_count_m: 0.0,
    };

    /// What motors of so many pole pairs usually have, of which nothing is known yet: once and twice an electrical turn are the
    /// offset and the gain of a current sensor (Eqs 13 and 14), multiples of six are flux, current and dead time (Eq 15), three
    /// and four an unequal winding. With a scale, once, twice and four times a turn of each encoder, once and twice of the lead. A
    /// motor's slots are its own.
    #[must_use]
    pub const fn usual([screw, nut]: [u32; 2], learning_s: f64, scale_count_m: f64) -> Self {
        let (angle, travel) = if scale_count_m == 0.0 {
            ([OrderPlate::NONE; ANGLES], [OrderPlate::NONE; TRAVELS])
        } else {
            let (once, twice) = (OrderPlate::unknown(1.0), OrderPlate::unknown(2.0));
            let (four_times, none) = (OrderPlate::unknown(4.0), OrderPlate::NONE);
            ([once, twice, four_times, none], [once, twice, none, none])
        };
        Self {
            torque: [electrical(screw), electrical(nut)],
            angle: [angle; 2],
            travel,
            learning_s,
            scale_count_m,
        }
    }
}

impl CompensationPlate {
    /// Whether any order is set.
    const fn has_orders(&self) -> bool {
        const fn any<const N: usize>(orders: &[OrderPlate; N]) -> bool {
            let mut left: &[OrderPlate] = orders;
            while let [order, more @ ..] = left {
                if order.order != 0.0 {
                    return true;
                }
                left = more;
            }
            false
        }
        let ([screw, nut], [screw_angle, nut_angle]) = (&self.torque, &self.angle);
        any(&TorqueOrderPlate::without_load(screw))
            || any(&TorqueOrderPlate::without_load(nut))
            || any(screw_angle)
            || any(nut_angle)
            || any(&self.travel)
    }

    /// Keeps what one of the [`LINES`](crate::speed::compensation::LINES) has learned: see
    /// [`coefficient`](crate::speed::compensation::Compensation::coefficient).
    pub fn keep(&mut self, line: usize, learned: Phasor) {
        let torques = self.torque.as_flattened_mut().iter_mut();
        let speeds = self
            .angle
            .as_flattened_mut()
            .iter_mut()
            .chain(&mut self.travel);
        let torques = torques.map(|order| (&mut order.re, &mut order.im, TORQUE_BITS));
        let speeds = speeds.map(|order| (&mut order.re, &mut order.im, SPEED_BITS));
        if let Some((re, im, bits)) = torques.chain(speeds).nth(line) {
            keep_part(re, learned.re, bits);
            keep_part(im, learned.im, bits);
        }
    }

    /// Keeps how what one of the first lines has learned changes with the load: see
    /// [`per_load`](crate::speed::compensation::Compensation::per_load).
    pub fn keep_slope(&mut self, line: usize, per_load: Phasor) {
        if let Some(order) = self.torque.as_flattened_mut().get_mut(line) {
            keep_part(&mut order.re_per_a, per_load.re, PER_LOAD_BITS);
            keep_part(&mut order.im_per_a, per_load.im, PER_LOAD_BITS);
        }
    }
}

/// Keeps what was learned, of so many fraction bits. A value that rounds to it stays: a drive that learned nothing changes no setting.
#[inline(never)]
fn keep_part(part: &mut f64, learned: i32, bits: u32) {
    let unit = 1.0 / (1u64 << bits) as f64;
    let learned = f64::from(learned) * unit;
    if (*part - learned).abs() > 0.5 * unit {
        *part = learned;
    }
}

/// What repeats with a motor's turn in its torque, as a current: `Re((re + j im) e^(j order angle))` without a load, and what an ampere of
/// the motor's load adds to both parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueOrderPlate {
    /// Repetitions in a turn, 1/65536 to 1000; 0: none.
    pub order: f64,
    /// Cosine's part, A.
    pub re: f64,
    /// Minus the sine's part, A.
    pub im: f64,
    /// Change of the cosine's part, A per A, within ±1.
    pub re_per_a: f64,
    /// Change of minus the sine's part, A per A, within ±1.
    pub im_per_a: f64,
}

impl TorqueOrderPlate {
    /// No order.
    pub const NONE: Self = Self::unknown(0.0);

    /// An order of which nothing is known yet.
    #[must_use]
    pub const fn unknown(order: f64) -> Self {
        Self {
            order,
            re: 0.0,
            im: 0.0,
            re_per_a: 0.0,
            im_per_a: 0.0,
        }
    }

    /// What each is without a load.
    #[must_use]
    pub const fn without_load(orders: &[Self; TORQUES]) -> [OrderPlate; TORQUES] {
        let mut plates = [OrderPlate::NONE; TORQUES];
        let mut left: (&mut [OrderPlate], &[Self]) = (&mut plates, orders);
        while let ([plate, plates @ ..], [order, orders @ ..]) = left {
            *plate = OrderPlate {
                order: order.order,
                re: order.re,
                im: order.im,
            };
            left = (plates, orders);
        }
        plates
    }
}

const fn electrical(pole_pairs: u32) -> [TorqueOrderPlate; TORQUES] {
    let p = pole_pairs as f64;
    [
        TorqueOrderPlate::unknown(p),
        TorqueOrderPlate::unknown(2.0 * p),
        TorqueOrderPlate::unknown(3.0 * p),
        TorqueOrderPlate::unknown(4.0 * p),
        TorqueOrderPlate::unknown(6.0 * p),
        TorqueOrderPlate::unknown(12.0 * p),
        TorqueOrderPlate::unknown(18.0 * p),
        TorqueOrderPlate::unknown(24.0 * p),
    ]
}

/// `Re((re + j im) e^(j order angle))`, added to what it compensates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrderPlate {
    /// Repetitions in a turn, 1/65536 to 1000; 0: none.
    pub order: f64,
    /// Cosine's part.
    pub re: f64,
    /// Minus the sine's part.
    pub im: f64,
}

impl OrderPlate {
    /// No order.
    pub const NONE: Self = Self::unknown(0.0);

    /// An order of which nothing is known yet.
    #[must_use]
    pub const fn unknown(order: f64) -> Self {
        Self {
            order,
            re: 0.0,
            im: 0.0,
        }
    }
}

impl RubbingPlate {
    /// None.
    pub const NONE: Self = FrictionSettings::DEFAULT.plate();

    /// There is some.
    #[must_use]
    pub const fn rubs(&self) -> bool {
        self.coulomb_nm != 0.0
    }
}

/// Friction that is known and fed forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionPlate {
    /// Of the bearings of screw and nut.
    pub bearings: [RubbingPlate; 2],
    /// Of ball pair and guideway, at the screw by the relative angle.
    pub feed: RubbingPlate,
}

impl FrictionPlate {
    /// Nothing is fed forward.
    pub const NONE: Self = Self {
        bearings: [RubbingPlate::NONE; 2],
        feed: RubbingPlate::NONE,
    };
}

impl RejectionPlate {
    /// No observer and no notch.
    pub const NONE: Self = RejectionSettings::DEFAULT.plate();
}

/// Points of the table of base speeds.
pub const BASES: usize = 8;

impl RejectionPlate {
    /// What a model says: a notch at its axial mode, and observers of a quarter of the speed loop's cutoff, with which the paper's
    /// loops keep 29 of 37 degrees of phase margin.
    #[must_use]
    pub const fn of_mode(hz: f64, speed_rad_s: f64) -> Self {
        Self {
            disturbance_rad_s: speed_rad_s / 4.0,
            notch: NotchPlate {
                hz,
                ..Self::NONE.notch
            },
        }
    }
}

impl BasePlate {
    /// The base speed, rad/s, for a table velocity, m/s either way, for which none is commanded: that of the first point of the
    /// table that is not below it, of the last above all; 0, the single drive, without a table.
    #[must_use]
    pub const fn base_for(&self, velocity: f64) -> f64 {
        let mut left: &[BasePoint] = &self.table;
        let mut base = 0.0;
        while let [point, more @ ..] = left {
            if point.velocity == 0.0 {
                break;
            }
            base = point.base;
            // Of a table velocity's last step, which is 4 nm/s.
            if velocity.abs() <= point.velocity + 4e-9 {
                break;
            }
            left = more;
        }
        base
    }

    /// The single drive at all velocities.
    pub const NONE: Self = BaseSettings::DEFAULT.plate();
}

impl RunawayPlate {
    /// What fits motors whose plate is right to a tenth.
    pub const USUAL: Self = WatchSettings::DEFAULT.plate();
}

/// All that the drive needs to know: screw first, nut second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivePlate {
    /// Screw motor, nut motor.
    pub motors: [MotorPlate; 2],
    /// The board that the bridges and their sensors are on.
    pub board: BoardPlate,
    /// The bridges, which are alike.
    pub bridge: BridgePlate,
    /// Loop tuning.
    pub tuning: Tuning,
    /// The feed.
    pub feed: FeedPlate,
    /// The table's way.
    pub travel: TravelPlate,
    /// What holds the table while the bridges are off.
    pub brake: BrakePlate,
    /// The alignment.
    pub alignment: AlignmentPlate,
    /// When motion is not in hand.
    pub runaway: RunawayPlate,
    /// What repeats with an angle and is compensated.
    pub compensation: CompensationPlate,
    /// What is fed forward against friction.
    pub friction: FrictionPlate,
    /// What keeps a disturbance from the table.
    pub rejection: RejectionPlate,
    /// The base speed, where it is not commanded.
    pub base: BasePlate,
    /// How the drive is commanded.
    pub command: CommandPlate,
}

impl BoardPlate {
    /// Top of the centre-aligned counter, timer counts.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub const fn period(&self) -> u16 {
        (self.timer_hz / (2.0 * self.pwm_hz) + 0.5) as u16
    }

    /// The PWM period that the counter really makes, s.
    #[must_use]
    pub const fn sample_time(&self) -> f64 {
        2.0 * self.period() as f64 / self.timer_hz
    }
}

impl MotorPlate {
    /// Largest speed, mechanical rad/s.
    #[must_use]
    pub const fn speed_max(&self) -> f64 {
        self.speed_max_rpm * TAU / 60.0
    }

    /// Gains of its current channels a, b, c.
    #[must_use]
    pub const fn current_gains(&self) -> [f64; 3] {
        [
            self.current_gain_a,
            self.current_gain_b,
            self.current_gain_c,
        ]
    }

    /// Current of the largest torque, A, as a vector.
    #[must_use]
    pub const fn current_max(&self) -> f64 {
        self.torque_max_nm / (self.pole_pairs as f64 * self.flux_wb.abs())
    }

    /// Peak current of a phase at the largest torque, A.
    #[must_use]
    pub const fn phase_current_max(&self) -> f64 {
        // `sqrt(2/3)`: vectors are `sqrt(3/2)` times as long as the amplitude of a phase.
        0.816_496_580_927_726 * self.current_max()
    }
}

impl DrivePlate {
    /// Time between two steps of the speed task, s.
    #[must_use]
    pub const fn speed_step(&self) -> f64 {
        self.board.sample_time() * self.board.speed_divider as f64
    }
}

#[cfg(test)]
pub(crate) use tests::test_plate;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::current::encoder::Interface;
    use std::format;
    use std::string::ToString;

    /// The paper's motors (Table 1) on a 310 V bus, 20-bit encoders, 12-bit ADC of ±5 A.
    pub(crate) const fn test_plate() -> DrivePlate {
        let motor = MotorPlate {
            resistance_ohm: 1.7,
            inductance_h: 5.9e-3,
            pole_pairs: 5,
            flux_wb: 0.11,
            inertia_kg_m2: 7.2e-4,
            speed_max_rpm: 3000.0,
            torque_max_nm: 2.6,
            thermal: ThermalPlate {
                rated_rms_a: 1.36,
                seconds: 60.0,
            },
            alignment_torque_nm: 0.39,
            current_gain_a: 1.0,
            current_gain_b: 1.0,
            current_gain_c: 1.0,
            encoder: EncoderPlate {
                interface: Interface::Incremental,
                age_s: 0.0,
                counts_per_turn: 1 << 20,
                theta_e_at_zero_turns: 0.0,
                reversed: Some(false),
            },
        };
        DrivePlate {
            motors: [motor; 2],
            board: BoardPlate {
                timer_hz: 170e6,
                pwm_hz: 20e3,
                speed_divider: 4,
                shunts: Shunts::Two,
                amps_per_count: 10.0 / 4096.0,
                zero_counts: 2048.0,
                bus_volts_per_count: 0.11,
                adc_counts: 4096,
            },
            bridge: BridgePlate {
                over_current_a: 4.9,
                bus_min_v: 30.0,
                dead_time_s: 0.0,
                dead_time_fade_a: 0.05,
                measure_zeros: true,
                min_on_time_s: 0.0,
                bootstrap_s: 0.0,
                thermal: ThermalPlate {
                    rated_rms_a: 3.0,
                    seconds: 20.0,
                },
                brake_fade_from_v: 360.0,
                brake_fade_to_v: 384.0,
            },
            tuning: Tuning {
                damping: 0.7,
                current_rad_s: 3000.0,
                speed_rad_s: 200.0,
                observer_rad_s: 1000.0,
                observer_damping: 0.7,
            },
            feed: FeedPlate {
                lead_m: 5e-3,
                scale_count_m: 10e-9,
                velocity_max: 0.1,
                acceleration_max: 1.0,
                jerk_max: 100.0,
                base_acceleration_max: 500.0,
                base_jerk_max: 50_000.0,
            },
            travel: TravelPlate::UNLIMITED,
            brake: BrakePlate::NONE,
            alignment: AlignmentPlate {
                travel_m: 50e-6,
                speed_rpm: 200.0,
            },
            runaway: RunawayPlate::USUAL,
            compensation: CompensationPlate::NONE,
            friction: FrictionPlate::NONE,
            rejection: RejectionPlate::NONE,
            base: BasePlate::NONE,
            command: CommandPlate { heartbeat_s: 0.5 },
        }
    }

    /// A plate of another kind in a constant: a misfit would fail the build, as it does for a board.
    const _: DriveConfig = {
        let mut plate = test_plate();
        let [screw, nut] = &mut plate.motors;
        screw.encoder = EncoderPlate {
            interface: Interface::IncrementalWithIndex,
            counts_per_turn: 10_000,
            theta_e_at_zero_turns: 0.25,
            ..screw.encoder
        };
        nut.encoder = EncoderPlate {
            interface: Interface::Mt6835,
            counts_per_turn: 1 << 21,
            age_s: 5.5e-6,
            ..screw.encoder
        };
        plate.board = BoardPlate {
            pwm_hz: 40e3,
            speed_divider: 8,
            shunts: Shunts::Three,
            amps_per_count: 0.02,
            bus_volts_per_count: 0.02,
            ..plate.board
        };
        plate.bridge = BridgePlate {
            bus_min_v: 8.0,
            dead_time_s: 500e-9,
            dead_time_fade_a: 0.1,
            min_on_time_s: 1e-6,
            brake_fade_from_v: 60.0,
            brake_fade_to_v: 75.0,
            ..plate.bridge
        };
        match plate.config() {
            Ok(config) => config,
            Err(_) => panic!("a number of this plate does not fit its format"),
        }
    };

    #[test]
    fn a_configuration_put_in_the_place_of_another_is_the_whole_one() {
        let before = test_plate();
        let mut after = test_plate();
        after.compensation = CompensationPlate::usual([5; 2], 0.5, 20e-9);
        after.friction.feed.coulomb_nm = 0.002;
        after.motors[0].resistance_ohm *= 1.3;
        after.motors[1].inertia_kg_m2 *= 0.8;
        after.motors[1].thermal.seconds = 40.0;
        (after.bridge.brake_fade_from_v, after.bridge.brake_fade_to_v) = (370.0, 380.0);
        after.feed.lead_m *= 0.5;
        after.alignment.travel_m *= 0.5;
        after.runaway.stall_s *= 2.0;
        after.rejection.disturbance_rad_s = 40.0;
        after.rejection.notch.hz = 503.0;
        after.brake.fitted = !after.brake.fitted;
        after.command.heartbeat_s *= 2.0;
        let mut config = before.config().unwrap();
        after.configure(&mut config).unwrap();
        let whole = after.config().unwrap();
        assert_eq!(config, whole);
        // Each part was another.
        let old = before.config().unwrap();
        assert!(
            old.current_loops != whole.current_loops
                && old.speed_loops != whole.speed_loops
                && old.coordinator != whole.coordinator
                && old.alignment != whole.alignment
                && old.runaway != whole.runaway
                && old.heat != whole.heat
                && old.regeneration != whole.regeneration
                && old.compensation != whole.compensation
                && old.friction != whole.friction
                && old.disturbance != whole.disturbance
                && old.notch != whole.notch
                && old.brake != whole.brake
                && old.heartbeat_looks != whole.heartbeat_looks
        );
        after.motors[0].inductance_h = 1e3;
        let misfit = after.configure(&mut config).unwrap_err();
        assert_eq!(misfit.to_string(), after.config().unwrap_err().to_string());
    }

    /// 0.1234567 A are 16,181.7 steps of 2^-17 A. A drive starts with 16,182.
    #[test]
    fn a_value_that_rounds_to_what_is_learned_stays() {
        let mut plate = test_plate().compensation;
        plate.torque[0][0] = TorqueOrderPlate {
            re: 0.123_456_7,
            im: -0.123_456_7,
            ..TorqueOrderPlate::unknown(5.0)
        };
        let before = plate;
        let learned = |re: i32, im: i32| Phasor { re, im };
        plate.keep(0, learned(16_182, -16_182));
        assert_eq!(plate, before);
        plate.keep(0, learned(16_183, -16_182));
        assert_eq!(plate.torque[0][0].re, 16_183.0 / 131_072.0);
        assert_eq!(plate.torque[0][0].im, -0.123_456_7);
    }

    #[test]
    fn gains_are_those_of_the_reference() {
        let plate = test_plate();
        let Gains {
            k_pc,
            k_ic,
            k_pw,
            k_iw,
        } = plate.motors[0].gains(&plate.tuning);
        assert!((k_pc - 23.08).abs() < 0.005);
        assert!((k_ic - 53_100.0).abs() < 1.0);
        assert!((k_pw - 0.07331).abs() < 5e-6);
        assert!((k_iw - 10.473).abs() < 5e-4);
    }

    #[test]
    fn a_velocity_has_the_base_speed_of_the_next_point_of_the_table() {
        let mut plate = test_plate();
        let points = [(1.0, 80.0), (5.0, 30.0), (20.0, 0.0)];
        for (point, (mm_s, base)) in plate.base.table.iter_mut().zip(points) {
            *point = BasePoint {
                velocity: mm_s * 1e-3,
                base,
            };
        }
        assert!(plate.config().is_ok());
        for (mm_s, base) in [
            (0.0, 80.0),
            (0.5, 80.0),
            (-1.0, 80.0),
            (1.1, 30.0),
            (-6.0, 0.0),
            (99.0, 0.0),
        ] {
            assert_eq!(plate.base.base_for(mm_s * 1e-3), base, "at {mm_s} mm/s");
        }
        assert_eq!(BasePlate::NONE.base_for(1e-3), 0.0);
        let spoils: [fn(&mut [BasePoint; BASES]); 2] = [
            |table| table[1].velocity = 0.5e-3,
            |table| table[1].velocity = 0.0,
        ];
        for spoil in spoils {
            let mut spoiled = plate;
            spoil(&mut spoiled.base.table);
            assert_eq!(
                spoiled.config().unwrap_err().name,
                "table velocity of a base speed"
            );
        }
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let mut plate = test_plate();
        plate.motors[1].inductance_h = 0.6;
        plate.tuning.current_rad_s = 30_000.0;
        let misfit = plate.config().unwrap_err();
        assert_eq!(misfit.name, "Kpc (Eq 9)");
        assert!(format!("{misfit}").contains("25198.3 V/A"), "{misfit}");

        for (spoil, name) in [
            (
                (|p: &mut DrivePlate| p.motors[0].encoder.counts_per_turn = 1)
                    as fn(&mut DrivePlate),
                "encoder resolution",
            ),
            (
                |p| p.motors[0].encoder.interface = Interface::Mt6835,
                "resolution of an MT6835",
            ),
            (
                |p| p.motors[1].encoder.age_s = 101e-6,
                "age of an encoder reading",
            ),
            (|p| p.board.pwm_hz = 50e3, "PWM frequency"),
            (|p| p.motors[0].flux_wb = f64::NAN, "flux"),
            (
                |p| p.motors[0].resistance_ohm = 30.0,
                "current-loop gain Kpc (Eq 9)",
            ),
            (|p| p.feed.lead_m = -5e-3, "lead"),
            (
                |p| p.motors[1].current_gain_c = -1.0,
                "gain of a current channel",
            ),
            (|p| p.motors[0].inertia_kg_m2 = 0.0, "inertia"),
            (|p| p.bridge.min_on_time_s = 40e-6, "minimum on-time"),
            (|p| p.motors[0].speed_max_rpm = 60_000.0, "largest speed"),
        ] {
            let mut plate = test_plate();
            spoil(&mut plate);
            assert_eq!(plate.config().unwrap_err().name, name);
        }
    }
}
