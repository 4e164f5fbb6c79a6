//! Settings -> the plate that the control code is configured from, and back.

use super::{
    AlignmentSettings, BaseSettings, BrakeSettings, BridgeSettings, CommandSettings,
    CompensationSettings, Direction, EncoderDirection, EncoderInterface, FeedSettings,
    FrictionSettings, MotorSettings, PER_KRPM, RejectionSettings, Setting, Settings,
    SpeedOrderSettings, Switch, TorqueOrderSettings, TravelSettings, TuningSettings, Value,
    WatchSettings,
};
use control::compensation::{ANGLES, TORQUES};
use control::encoder::Interface;
use control::format::Misfit;
use control::journal::Warning;
use control::plate::{
    AlignmentPlate, BasePlate, BasePoint, BoardPlate, BrakePlate, CompensationPlate, DriveConfig,
    DrivePlate, EncoderPlate, FeedPlate, FrictionPlate, HomePlate, MotorPlate, NotchPlate,
    OrderPlate, RejectionPlate, RubbingPlate, RunawayPlate, ThermalPlate, TravelPlate, Tuning,
};
use core::f64::consts::TAU;

/// Rad/s of one rpm.
const RPM: f64 = TAU / 60.0;

impl MotorSettings {
    fn plate(&self) -> MotorPlate {
        let pole_pairs = self.pole_pairs;
        MotorPlate {
            // Two phases in series, or what is equivalent to that in a delta.
            resistance_ohm: self.resistance_line_to_line_ohm / 2.0,
            inductance_h: self.inductance_line_to_line_mh * 1e-3 / 2.0,
            pole_pairs,
            // See `datasheet`.
            flux_wb: self.voltage_constant_v_rms_per_krpm / PER_KRPM / f64::from(pole_pairs),
            inertia_kg_m2: self.inertia_kg_cm2 * 1e-4,
            speed_max_rpm: self.speed_max_rpm,
            torque_max_nm: self.torque_max_nm,
            thermal: ThermalPlate {
                rated_rms_a: self.rated_current_a_rms,
                seconds: self.thermal_time_s,
            },
            current_gains: [
                self.current_gain_a,
                self.current_gain_b,
                self.current_gain_c,
            ],
            encoder: EncoderPlate {
                interface: match self.encoder_interface {
                    EncoderInterface::Incremental => Interface::Incremental,
                    EncoderInterface::IncrementalWithIndex => Interface::IncrementalWithIndex,
                    EncoderInterface::Mt6835 => Interface::Mt6835,
                },
                counts_per_turn: self.encoder_counts_per_turn,
                age_s: self.encoder_age_us * 1e-6,
                theta_e_at_zero_turns: self.encoder_zero_deg / 360.0,
                reversed: match self.encoder_direction {
                    EncoderDirection::Unknown => None,
                    EncoderDirection::Forwards => Some(false),
                    EncoderDirection::Backwards => Some(true),
                },
            },
        }
    }

    fn of_plate(plate: &MotorPlate, alignment_torque_nm: f64) -> Self {
        let [current_gain_a, current_gain_b, current_gain_c] = plate.current_gains;
        let encoder = &plate.encoder;
        Self {
            resistance_line_to_line_ohm: plate.resistance_ohm * 2.0,
            inductance_line_to_line_mh: plate.inductance_h * 2.0 * 1e3,
            pole_pairs: plate.pole_pairs,
            voltage_constant_v_rms_per_krpm: plate.flux_wb * f64::from(plate.pole_pairs) * PER_KRPM,
            inertia_kg_cm2: plate.inertia_kg_m2 * 1e4,
            speed_max_rpm: plate.speed_max_rpm,
            torque_max_nm: plate.torque_max_nm,
            rated_current_a_rms: plate.thermal.rated_rms_a,
            thermal_time_s: plate.thermal.seconds,
            alignment_torque_nm,
            encoder_interface: match encoder.interface {
                Interface::Incremental => EncoderInterface::Incremental,
                Interface::IncrementalWithIndex => EncoderInterface::IncrementalWithIndex,
                Interface::Mt6835 => EncoderInterface::Mt6835,
            },
            encoder_counts_per_turn: encoder.counts_per_turn,
            encoder_direction: match encoder.reversed {
                None => EncoderDirection::Unknown,
                Some(false) => EncoderDirection::Forwards,
                Some(true) => EncoderDirection::Backwards,
            },
            encoder_zero_deg: encoder.theta_e_at_zero_turns * 360.0,
            encoder_age_us: encoder.age_s * 1e6,
            current_gain_a,
            current_gain_b,
            current_gain_c,
        }
    }
}

impl FrictionSettings {
    fn plate(&self) -> RubbingPlate {
        RubbingPlate {
            coulomb_nm: self.coulomb_nm,
            sticks_nm: self.sticks_nm,
            stribeck_rad_s: self.stribeck_rad_s,
            presliding_rad: self.presliding_mrad * 1e-3,
        }
    }

    fn of_plate(plate: &RubbingPlate) -> Self {
        if !plate.rubs() {
            return Self::DEFAULT;
        }
        Self {
            coulomb_nm: plate.coulomb_nm,
            sticks_nm: plate.sticks_nm,
            stribeck_rad_s: plate.stribeck_rad_s,
            presliding_mrad: plate.presliding_rad * 1e3,
        }
    }
}

const fn order(order: f64, re: f64, im: f64) -> OrderPlate {
    OrderPlate { order, re, im }
}

impl TorqueOrderSettings {
    fn plates(&self) -> [OrderPlate; TORQUES] {
        [
            order(self.order_1, self.re_1_a, self.im_1_a),
            order(self.order_2, self.re_2_a, self.im_2_a),
            order(self.order_3, self.re_3_a, self.im_3_a),
            order(self.order_4, self.re_4_a, self.im_4_a),
            order(self.order_5, self.re_5_a, self.im_5_a),
            order(self.order_6, self.re_6_a, self.im_6_a),
            order(self.order_7, self.re_7_a, self.im_7_a),
            order(self.order_8, self.re_8_a, self.im_8_a),
        ]
    }

    fn of_plates(plates: &[OrderPlate; TORQUES]) -> Self {
        let [a, b, c, d, e, f, g, h] = plates;
        Self {
            order_1: a.order,
            re_1_a: a.re,
            im_1_a: a.im,
            order_2: b.order,
            re_2_a: b.re,
            im_2_a: b.im,
            order_3: c.order,
            re_3_a: c.re,
            im_3_a: c.im,
            order_4: d.order,
            re_4_a: d.re,
            im_4_a: d.im,
            order_5: e.order,
            re_5_a: e.re,
            im_5_a: e.im,
            order_6: f.order,
            re_6_a: f.re,
            im_6_a: f.im,
            order_7: g.order,
            re_7_a: g.re,
            im_7_a: g.im,
            order_8: h.order,
            re_8_a: h.re,
            im_8_a: h.im,
        }
    }
}

impl SpeedOrderSettings {
    fn plates(&self) -> [OrderPlate; ANGLES] {
        [
            order(self.order_1, self.re_1, self.im_1),
            order(self.order_2, self.re_2, self.im_2),
        ]
    }

    fn of_plates([a, b]: &[OrderPlate; ANGLES]) -> Self {
        Self {
            order_1: a.order,
            re_1: a.re,
            im_1: a.im,
            order_2: b.order,
            re_2: b.re,
            im_2: b.im,
        }
    }
}

impl RejectionSettings {
    fn plate(&self) -> RejectionPlate {
        RejectionPlate {
            disturbance_rad_s: self.disturbance_rad_s,
            notch: NotchPlate {
                hz: self.notch_hz,
                damping: self.notch_damping,
                depth: self.notch_depth,
            },
        }
    }

    fn of_plate(plate: &RejectionPlate) -> Self {
        Self {
            disturbance_rad_s: plate.disturbance_rad_s,
            notch_hz: plate.notch.hz,
            notch_damping: plate.notch.damping,
            notch_depth: plate.notch.depth,
        }
    }
}

impl BaseSettings {
    fn plate(&self) -> BasePlate {
        let point = |table_mm_s: f64, nut_rpm: f64| BasePoint {
            velocity: table_mm_s * 1e-3,
            base: nut_rpm * RPM,
        };
        BasePlate {
            wander_rad_s: self.wander_rpm * RPM,
            wander_s: self.wander_s,
            table: [
                point(self.table_1_mm_s, self.nut_1_rpm),
                point(self.table_2_mm_s, self.nut_2_rpm),
                point(self.table_3_mm_s, self.nut_3_rpm),
                point(self.table_4_mm_s, self.nut_4_rpm),
                point(self.table_5_mm_s, self.nut_5_rpm),
                point(self.table_6_mm_s, self.nut_6_rpm),
                point(self.table_7_mm_s, self.nut_7_rpm),
                point(self.table_8_mm_s, self.nut_8_rpm),
            ],
        }
    }

    fn of_plate(plate: &BasePlate) -> Self {
        let [a, b, c, d, e, f, g, h] = plate
            .table
            .map(|point| (point.velocity * 1e3, point.base / RPM));
        Self {
            wander_rpm: plate.wander_rad_s / RPM,
            wander_s: plate.wander_s,
            table_1_mm_s: a.0,
            nut_1_rpm: a.1,
            table_2_mm_s: b.0,
            nut_2_rpm: b.1,
            table_3_mm_s: c.0,
            nut_3_rpm: c.1,
            table_4_mm_s: d.0,
            nut_4_rpm: d.1,
            table_5_mm_s: e.0,
            nut_5_rpm: e.1,
            table_6_mm_s: f.0,
            nut_6_rpm: f.1,
            table_7_mm_s: g.0,
            nut_7_rpm: g.1,
            table_8_mm_s: h.0,
            nut_8_rpm: h.1,
        }
    }
}

impl BrakeSettings {
    fn plate(&self) -> BrakePlate {
        BrakePlate {
            fitted: self.fitted == Switch::On,
            closing_s: self.closing_ms * 1e-3,
            opening_s: self.opening_ms * 1e-3,
            load_drives_back: self.load_drives_back == Switch::On,
        }
    }

    fn of_plate(plate: &BrakePlate) -> Self {
        Self {
            fitted: Switch::of_bool(plate.fitted),
            closing_ms: plate.closing_s * 1e3,
            opening_ms: plate.opening_s * 1e3,
            load_drives_back: Switch::of_bool(plate.load_drives_back),
        }
    }
}

impl Switch {
    const fn of_bool(on: bool) -> Self {
        if on { Self::On } else { Self::Off }
    }
}

impl TravelSettings {
    fn plate(&self) -> TravelPlate {
        TravelPlate {
            home: HomePlate {
                forwards: self.home_direction == Direction::Forwards,
                velocity: self.home_velocity_mm_s * 1e-3,
                leaving_velocity: self.home_leaving_mm_s * 1e-3,
                furthest_m: self.home_furthest_mm * 1e-3,
                position_m: self.home_position_mm * 1e-3,
            },
            soft_m: [self.soft_least_mm * 1e-3, self.soft_most_mm * 1e-3],
        }
    }

    fn of_plate(plate: &TravelPlate) -> Self {
        let home = &plate.home;
        let [soft_least_mm, soft_most_mm] = plate.soft_m.map(|m| m * 1e3);
        Self {
            home_direction: if home.forwards {
                Direction::Forwards
            } else {
                Direction::Backwards
            },
            home_velocity_mm_s: home.velocity * 1e3,
            home_leaving_mm_s: home.leaving_velocity * 1e3,
            home_furthest_mm: home.furthest_m * 1e3,
            home_position_mm: home.position_m * 1e3,
            soft_least_mm,
            soft_most_mm,
        }
    }
}

impl Settings {
    /// The plate of a drive with these settings on `board`, of which the rest is the board's own.
    #[must_use]
    pub fn plate(&self, board: &BoardPlate) -> DrivePlate {
        let Self {
            screw,
            nut,
            bridge,
            feed,
            alignment,
            tuning,
            watch,
            command,
            compensation: _,
            screw_friction,
            nut_friction,
            feed_friction,
            screw_torque: _,
            nut_torque: _,
            screw_encoder: _,
            nut_encoder: _,
            lead: _,
            rejection,
            base,
            travel,
            brake,
        } = self;
        DrivePlate {
            motors: [screw.plate(), nut.plate()],
            board: BoardPlate {
                over_current_a: bridge.over_current_a,
                measure_zeros: bridge.measure_zeros == Switch::On,
                dead_time_s: bridge.dead_time_ns * 1e-9,
                dead_time_fade_a: bridge.dead_time_fade_a,
                min_on_time_s: bridge.min_on_time_us * 1e-6,
                bootstrap_s: bridge.bootstrap_ms * 1e-3,
                thermal: ThermalPlate {
                    rated_rms_a: bridge.rated_current_a_rms,
                    seconds: bridge.thermal_time_s,
                },
                bus_min_v: bridge.bus_min_v,
                regeneration_v: [bridge.brake_fade_from_v, bridge.brake_fade_to_v],
                ..*board
            },
            tuning: Tuning {
                damping: tuning.damping,
                current_rad_s: tuning.current_rad_s,
                speed_rad_s: tuning.speed_rad_s,
                observer_rad_s: tuning.observer_rad_s,
                observer_damping: tuning.observer_damping,
            },
            feed: FeedPlate {
                lead_m: feed.lead_mm * 1e-3,
                velocity_max: feed.velocity_max_mm_s * 1e-3,
                acceleration_max: feed.acceleration_max_mm_s2 * 1e-3,
                jerk_max: feed.jerk_max_mm_s3 * 1e-3,
                base_acceleration_max: feed.base_acceleration_max_rpm_s * RPM,
                base_jerk_max: feed.base_jerk_max_rpm_s2 * RPM,
            },
            travel: travel.plate(),
            brake: brake.plate(),
            alignment: AlignmentPlate {
                torque_nm: [screw.alignment_torque_nm, nut.alignment_torque_nm],
                travel_m: alignment.travel_um * 1e-6,
                speed_rpm: alignment.speed_rpm,
            },
            runaway: RunawayPlate {
                over_speed: watch.over_speed_percent / 100.0,
                over_speed_s: watch.over_speed_ms * 1e-3,
                following: watch.following_percent / 100.0,
                following_s: watch.following_ms * 1e-3,
                current_error: watch.current_error_percent / 100.0,
                current_error_s: watch.current_error_ms * 1e-3,
                current_sum: watch.current_sum_percent / 100.0,
                angle_deg: watch.angle_deg,
                angle_floor: watch.angle_floor_percent / 100.0,
                resistance_error: watch.resistance_error_percent / 100.0,
                angle_s: watch.angle_ms * 1e-3,
                stall: watch.stall_percent / 100.0,
                stall_s: watch.stall_ms * 1e-3,
            },
            compensation: self.compensation_plate(),
            friction: FrictionPlate {
                bearings: [screw_friction.plate(), nut_friction.plate()],
                feed: feed_friction.plate(),
            },
            rejection: rejection.plate(),
            base: base.plate(),
            heartbeat_s: command.heartbeat_ms * 1e-3,
        }
    }

    /// The settings that make `plate`, of a drive whose table's scale has counts of `scale_count_m`.
    #[must_use]
    pub fn of_plate(plate: &DrivePlate, scale_count_m: f64) -> Self {
        let DrivePlate {
            motors: [screw, nut],
            board,
            tuning,
            feed,
            travel,
            brake,
            alignment,
            runaway,
            compensation,
            friction,
            rejection,
            base,
            heartbeat_s,
        } = plate;
        let [screw_bearing, nut_bearing] = &friction.bearings;
        let usual = CompensationPlate::usual(
            [screw.pole_pairs, nut.pole_pairs],
            compensation.learning_s,
            scale_count_m,
        );
        // Whose orders are the usual ones has set none.
        let orders = if *compensation == usual {
            &CompensationPlate::NONE
        } else {
            compensation
        };

        let [screw_nm, nut_nm] = alignment.torque_nm;
        let [brake_fade_from_v, brake_fade_to_v] = board.regeneration_v;
        Self {
            screw: MotorSettings::of_plate(screw, screw_nm),
            nut: MotorSettings::of_plate(nut, nut_nm),
            bridge: BridgeSettings {
                over_current_a: board.over_current_a,
                measure_zeros: Switch::of_bool(board.measure_zeros),
                dead_time_ns: board.dead_time_s * 1e9,
                dead_time_fade_a: board.dead_time_fade_a,
                min_on_time_us: board.min_on_time_s * 1e6,
                bootstrap_ms: board.bootstrap_s * 1e3,
                rated_current_a_rms: board.thermal.rated_rms_a,
                thermal_time_s: board.thermal.seconds,
                bus_min_v: board.bus_min_v,
                brake_fade_from_v,
                brake_fade_to_v,
            },
            feed: FeedSettings {
                lead_mm: feed.lead_m * 1e3,
                scale_count_nm: scale_count_m * 1e9,
                velocity_max_mm_s: feed.velocity_max * 1e3,
                acceleration_max_mm_s2: feed.acceleration_max * 1e3,
                jerk_max_mm_s3: feed.jerk_max * 1e3,
                base_acceleration_max_rpm_s: feed.base_acceleration_max / RPM,
                base_jerk_max_rpm_s2: feed.base_jerk_max / RPM,
            },
            alignment: AlignmentSettings {
                travel_um: alignment.travel_m * 1e6,
                speed_rpm: alignment.speed_rpm,
            },
            tuning: TuningSettings {
                damping: tuning.damping,
                current_rad_s: tuning.current_rad_s,
                speed_rad_s: tuning.speed_rad_s,
                observer_rad_s: tuning.observer_rad_s,
                observer_damping: tuning.observer_damping,
            },
            watch: WatchSettings {
                over_speed_percent: runaway.over_speed * 100.0,
                over_speed_ms: runaway.over_speed_s * 1e3,
                following_percent: runaway.following * 100.0,
                following_ms: runaway.following_s * 1e3,
                current_error_percent: runaway.current_error * 100.0,
                current_error_ms: runaway.current_error_s * 1e3,
                current_sum_percent: runaway.current_sum * 100.0,
                angle_deg: runaway.angle_deg,
                angle_floor_percent: runaway.angle_floor * 100.0,
                resistance_error_percent: runaway.resistance_error * 100.0,
                angle_ms: runaway.angle_s * 1e3,
                stall_percent: runaway.stall * 100.0,
                stall_ms: runaway.stall_s * 1e3,
            },
            command: CommandSettings {
                heartbeat_ms: heartbeat_s * 1e3,
            },
            compensation: CompensationSettings {
                learning_s: compensation.learning_s,
            },
            screw_friction: FrictionSettings::of_plate(screw_bearing),
            nut_friction: FrictionSettings::of_plate(nut_bearing),
            feed_friction: FrictionSettings::of_plate(&friction.feed),
            rejection: RejectionSettings::of_plate(rejection),
            base: BaseSettings::of_plate(base),
            travel: TravelSettings::of_plate(travel),
            brake: BrakeSettings::of_plate(brake),
            ..Self::DEFAULT
        }
        .with_orders(orders)
    }

    /// The same with these orders: what a drive has learned.
    #[must_use]
    pub fn with_orders(self, orders: &CompensationPlate) -> Self {
        let [screw_torque, nut_torque] = &orders.torque;
        let [screw_encoder, nut_encoder] = &orders.angle;
        Self {
            screw_torque: TorqueOrderSettings::of_plates(screw_torque),
            nut_torque: TorqueOrderSettings::of_plates(nut_torque),
            screw_encoder: SpeedOrderSettings::of_plates(screw_encoder),
            nut_encoder: SpeedOrderSettings::of_plates(nut_encoder),
            lead: SpeedOrderSettings::of_plates(&orders.travel),
            ..self
        }
    }

    /// Orders that are set; where none is, the usual ones if they are learned.
    fn compensation_plate(&self) -> CompensationPlate {
        let learning_s = self.compensation.learning_s;
        let scale_count_m = if learning_s == 0.0 {
            0.0
        } else {
            self.scale_count_m()
        };
        let set = CompensationPlate {
            torque: [self.screw_torque.plates(), self.nut_torque.plates()],
            angle: [self.screw_encoder.plates(), self.nut_encoder.plates()],
            travel: self.lead.plates(),
            learning_s,
            scale_count_m,
        };
        let torque = set.torque.iter().flatten();
        let mut all = torque.chain(set.angle.iter().flatten()).chain(&set.travel);
        if all.any(|order| order.order != 0.0) || learning_s == 0.0 {
            return set;
        }
        let pole_pairs = [self.screw.pole_pairs, self.nut.pole_pairs];
        CompensationPlate::usual(pole_pairs, learning_s, scale_count_m)
    }

    /// The base speed, rad/s, for a table velocity, m/s, for which none is commanded.
    #[must_use]
    pub fn base_for(&self, velocity: f64) -> f64 {
        self.base.plate().base_for(velocity)
    }

    /// What they do not provide for.
    #[must_use]
    pub fn warning(&self) -> Option<Warning> {
        Warning::of(&self.brake.plate())
    }

    /// Least and most homed position, mm; `None`: there is no limit.
    #[must_use]
    pub fn soft_limits_mm(&self) -> Option<[f64; 2]> {
        let travel = &self.travel;
        let ends = [travel.soft_least_mm, travel.soft_most_mm];
        (travel.soft_least_mm != travel.soft_most_mm).then_some(ends)
    }

    /// One count of the table's scale, m.
    #[must_use]
    pub fn scale_count_m(&self) -> f64 {
        self.feed.scale_count_nm * 1e-9
    }

    /// Whether `self` may take the place of `before`, which fits: then `config` is its configuration on `board`.
    ///
    /// # Errors
    /// [`Unfit`] with a setting with which it does not fit while it does with those before it, and the number that does not.
    pub fn fits(
        &self,
        before: &Self,
        board: &BoardPlate,
        config: &mut DriveConfig,
    ) -> Result<(), Unfit> {
        self.configure(board, config)
            .map_err(|misfit| self.unfit(before, board, config, misfit))
    }

    /// Makes `config` that of a drive with these settings.
    ///
    /// # Errors
    /// [`Misfit`]; `config` is of no use then.
    #[inline(never)]
    pub fn configure(&self, board: &BoardPlate, config: &mut DriveConfig) -> Result<(), Misfit> {
        self.plate(board).configure(config)
    }

    /// What does not fit, and the change that `misfit` comes with: looked for by halves, as a drive takes a tenth of a second for
    /// a configuration.
    #[inline(never)]
    fn unfit(
        &self,
        before: &Self,
        board: &BoardPlate,
        config: &mut DriveConfig,
        misfit: Misfit,
    ) -> Unfit {
        // With the first `fitting` changes it fits, with the first `changes` it does not.
        let (mut fitting, mut changes) = (0, before.differences(self).count());
        let mut unfit = Unfit {
            setting: None,
            misfit,
        };
        while fitting < changes {
            let tried = fitting.midpoint(changes);
            let mut now = *before;
            let mut last = None;
            for (setting, _, value) in before.differences(self).take(tried + 1) {
                now.put(setting.id, value);
                last = Some((setting, value));
            }
            match now.configure(board, config) {
                Ok(()) => fitting = tried + 1,
                Err(misfit) => {
                    changes = tried;
                    unfit = Unfit {
                        setting: last,
                        misfit,
                    };
                }
            }
        }
        unfit
    }
}

/// A setting that the drive's fixed-point formats, or physics, do not allow.
#[derive(Clone, Copy, Debug)]
pub struct Unfit {
    /// The setting, and its value; `None` if the settings did not fit before either.
    pub setting: Option<(Setting, Value)>,
    /// What of the configuration does not fit with it.
    pub misfit: Misfit,
}

impl core::fmt::Display for Unfit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        if let Some((setting, value)) = self.setting {
            write!(f, "{setting} = {} does not fit: ", value.shown(setting))?;
        }
        write!(f, "{}", self.misfit)
    }
}

impl core::error::Error for Unfit {}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use crate::telemetry::Real;
    use std::string::ToString;

    /// The board of a plate with the paper's motors: 170 MHz, 20 kHz, ±5 A, 450 V.
    fn board() -> BoardPlate {
        BoardPlate {
            timer_hz: 170e6,
            pwm_hz: 20e3,
            speed_divider: 4,
            shunts: control::sense::Shunts::Two,
            amps_per_count: 10.0 / 4096.0,
            zero_counts: 2048.0,
            bus_volts_per_count: 0.11,
            adc_counts: 4096,
            over_current_a: 0.0,
            bus_min_v: 0.0,
            dead_time_s: 0.0,
            dead_time_fade_a: 0.0,
            measure_zeros: false,
            min_on_time_s: 0.0,
            bootstrap_s: 0.0,
            thermal: ThermalPlate {
                rated_rms_a: 0.0,
                seconds: 0.0,
            },
            regeneration_v: [0.0; 2],
        }
    }

    /// The gains of the defaults are those that others computed for the paper's motors (Eqs 9 to 12), and its figures.
    #[test]
    fn the_defaults_are_the_paper_s_machine() {
        let plate = Settings::DEFAULT.plate(&board());
        let motor = &plate.motors[0];
        for (measured, expected) in [
            (motor.resistance_ohm, 1.7),
            (motor.inductance_h, 5.9e-3),
            (motor.flux_wb, 0.11),
            (motor.inertia_kg_m2, 7.2e-4),
            (plate.feed.lead_m, 5e-3),
        ] {
            assert!(
                (measured / expected - 1.0).abs() < 1e-12,
                "measured {measured}, expected {expected}"
            );
        }
        let gains = motor.gains(&plate.tuning);
        assert!((gains.k_pc - 23.08).abs() < 0.005, "{gains:?}");
        assert!((gains.k_pw - 0.07331).abs() < 5e-6, "{gains:?}");
        assert!(plate.config().is_ok());
    }

    #[test]
    fn a_plate_s_settings_make_the_plate() {
        let mut settings = Settings::DEFAULT;
        settings.nut.encoder_direction = EncoderDirection::Unknown;
        settings.screw.encoder_interface = EncoderInterface::IncrementalWithIndex;
        settings.screw.encoder_zero_deg = -90.0;
        settings.bridge.dead_time_ns = 500.0;
        settings.compensation.learning_s = 0.5;
        let usual = settings.plate(&board());
        assert_eq!(
            usual.compensation,
            CompensationPlate::usual([5; 2], 0.5, settings.scale_count_m())
        );
        assert_eq!(
            Settings::of_plate(&usual, settings.scale_count_m()).screw_torque,
            TorqueOrderSettings::DEFAULT
        );
        settings.feed_friction.coulomb_nm = 0.1;
        settings.nut_torque.order_8 = 36.0;
        settings.nut_torque.im_8_a = -0.2;
        settings.lead.order_2 = 2.0;
        settings.rejection.notch_hz = 503.0;
        settings.base.wander_rpm = 60.0;
        settings.base.table_1_mm_s = 2.5;
        settings.base.nut_1_rpm = 800.0;
        settings.travel.home_direction = Direction::Forwards;
        settings.travel.soft_most_mm = 290.0;
        settings.brake.fitted = Switch::On;
        settings.brake.closing_ms = 35.0;
        let plate = settings.plate(&board());
        assert_eq!(plate.friction.feed.coulomb_nm, 0.1);
        assert_eq!(plate.rejection.notch.hz, 503.0);
        assert_eq!(plate.travel.soft_m, [0.0, 0.29]);
        assert!(plate.travel.home.forwards);
        assert_eq!(plate.base.table[0].velocity, 2.5e-3);
        assert_eq!(plate.compensation.torque[1][7], order(36.0, 0.0, -0.2));
        assert_eq!(plate.compensation.torque[0], [OrderPlate::NONE; TORQUES]);
        let again = Settings::of_plate(&plate, settings.scale_count_m());
        for setting in Settings::all() {
            let values = [&settings, &again].map(|settings| settings.get(setting.id).unwrap());
            if let [Value::Real(a), Value::Real(b)] = values {
                let (a, b) = (a.get(), b.get());
                assert!((a - b).abs() <= 1e-13 * a.abs(), "{setting}: {a}, {b}");
            } else {
                assert_eq!(values[0], values[1], "{setting}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_named_by_its_setting_whatever_was_changed_beside_it() {
        let before = Settings::DEFAULT;
        for (name, value, misfit) in [
            (
                "nut.resistance_line_to_line_ohm",
                60.0,
                "current-loop gain Kpc (Eq 9)",
            ),
            ("screw.speed_max_rpm", 60_000.0, "largest speed"),
            ("bridge.brake_fade_from_v", 390.0, "begins to fade"),
            ("tuning.observer_rad_s", 30_000.0, "observer frequency"),
            ("travel.soft_most_mm", -1.0, "way between the soft limits"),
        ] {
            let setting = Setting::named(name).unwrap();
            let mut after = before;
            // Changes that fit, before and after it.
            after.screw.inertia_kg_cm2 = 8.0;
            after.command.heartbeat_ms = 400.0;
            after
                .set(setting.id, Value::Real(Real::new(value)))
                .unwrap();
            let mut config = before.plate(&board()).config().unwrap();
            let unfit = after.fits(&before, &board(), &mut config).unwrap_err();
            let unfit = unfit.to_string();
            let begin = std::format!("{name} = {value} ");
            assert!(
                unfit.starts_with(&begin) && unfit.contains(misfit),
                "{unfit:?} should begin with {begin:?} and name {misfit:?}"
            );
        }
    }
}
