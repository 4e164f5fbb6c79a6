//! Settings -> the plate of a drive on a board, and its configuration.

use super::groups::{
    AlignmentSettings, BaseSettings, BrakeSettings, BridgeSettings, CommandSettings,
    CompensationSettings, FeedSettings, FrictionSettings, MotorSettings, RejectionSettings,
    SpeedOrderPlates, SpeedOrderSettings, TorqueOrderPlates, TorqueOrderSettings, TorqueSlopePlate,
    TravelSettings, TuningSettings, WatchSettings,
};
use super::parameter::{Effect, Value};
use super::settings::{Setting, Settings};
use super::{
    BoardPlate, CompensationPlate, DriveConfig, DrivePlate, FrictionPlate, OrderPlate,
    TorqueOrderPlate,
};
use crate::base::format::Misfit;
use crate::drive::journal::Warning;
use crate::speed::compensation::{ANGLES, TORQUES};
use core::fmt::{Display, Formatter, Result as Written};

impl Settings {
    /// The plate of a drive with these settings on `board`.
    #[must_use]
    pub const fn plate(&self, board: &BoardPlate) -> DrivePlate {
        DrivePlate {
            motors: [self.screw.plate(), self.nut.plate()],
            board: *board,
            bridge: self.bridge.plate(),
            tuning: self.tuning.plate(),
            feed: self.feed.plate(),
            travel: self.travel.plate(),
            brake: self.brake.plate(),
            alignment: self.alignment.plate(),
            runaway: self.watch.plate(),
            compensation: self.compensation_plate(),
            friction: FrictionPlate {
                bearings: [self.screw_friction.plate(), self.nut_friction.plate()],
                feed: self.feed_friction.plate(),
            },
            rejection: self.rejection.plate(),
            base: self.base.plate(),
            command: self.command.plate(),
        }
    }

    /// The settings of a plate that was made of a machine's model, in SI. Orders that are the usual ones are not set.
    #[must_use]
    pub fn of_plate(plate: &DrivePlate) -> Self {
        let [screw, nut] = &plate.motors;
        let [screw_bearing, nut_bearing] = &plate.friction.bearings;
        let compensation = &plate.compensation;
        let usual = CompensationPlate::usual(
            [screw.pole_pairs, nut.pole_pairs],
            compensation.learning_s,
            compensation.scale_count_m,
        );
        let none = CompensationPlate::NONE;
        let orders = if *compensation == usual {
            &none
        } else {
            compensation
        };
        let mut settings = Self {
            screw: MotorSettings::of_plate(screw),
            nut: MotorSettings::of_plate(nut),
            bridge: BridgeSettings::of_plate(&plate.bridge),
            feed: FeedSettings::of_plate(&plate.feed),
            alignment: AlignmentSettings::of_plate(&plate.alignment),
            tuning: TuningSettings::of_plate(&plate.tuning),
            watch: WatchSettings::of_plate(&plate.runaway),
            command: CommandSettings::of_plate(&plate.command),
            compensation: CompensationSettings {
                learning_s: compensation.learning_s,
            },
            screw_friction: FrictionSettings::of_plate(screw_bearing),
            nut_friction: FrictionSettings::of_plate(nut_bearing),
            feed_friction: FrictionSettings::of_plate(&plate.friction.feed),
            rejection: RejectionSettings::of_plate(&plate.rejection),
            base: BaseSettings::of_plate(&plate.base),
            travel: TravelSettings::of_plate(&plate.travel),
            brake: BrakeSettings::of_plate(&plate.brake),
            ..Self::DEFAULT
        };
        settings.put_orders(orders);
        settings
    }

    /// Takes these orders: what a drive has learned. In place, as all settings are kilobytes.
    pub fn put_orders(&mut self, orders: &CompensationPlate) {
        let [screw_torque, nut_torque] = &orders.torque;
        let [screw_encoder, nut_encoder] = &orders.angle;
        self.screw_torque = torque(screw_torque);
        self.nut_torque = torque(nut_torque);
        self.screw_encoder = speed(screw_encoder);
        self.nut_encoder = speed(nut_encoder);
        self.lead = speed(&orders.travel);
    }

    /// The same of a drive that learns what repeats with its angles in half a second and feeds forward the smallest friction. Its base speed
    /// wanders by one rpm, so that no harmonic of an encoder's counts keeps in step with an order.
    #[must_use]
    pub const fn smooth(mut self) -> Self {
        self.compensation.learning_s = CompensationPlate::LEARNING_S;
        (self.base.wander_rpm, self.base.wander_s) = (1.0, 2.0);
        self.screw_friction = FrictionSettings::LEAST;
        self.nut_friction = FrictionSettings::LEAST;
        self.feed_friction = FrictionSettings::LEAST;
        self
    }

    /// Orders that are set; where none is, the usual ones if they are learned.
    const fn compensation_plate(&self) -> CompensationPlate {
        let learning_s = self.compensation.learning_s;
        let scale_count_m = if learning_s == 0.0 {
            0.0
        } else {
            self.scale_count_m()
        };
        let set = CompensationPlate {
            torque: [
                torque_orders(&self.screw_torque),
                torque_orders(&self.nut_torque),
            ],
            angle: [
                self.screw_encoder.plate().orders,
                self.nut_encoder.plate().orders,
            ],
            travel: self.lead.plate().orders,
            learning_s,
            scale_count_m,
        };
        if learning_s == 0.0 || set.has_orders() {
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
    pub fn warnings(&self) -> impl Iterator<Item = Warning> + use<> {
        let motors = [&self.screw, &self.nut].map(MotorSettings::plate);
        Warning::of(motors.each_ref(), &self.bridge.plate(), &self.brake.plate())
    }

    /// Minimum and maximum homed position, mm; `None`: there is no limit.
    #[must_use]
    pub fn soft_limits_mm(&self) -> Option<[f64; 2]> {
        let travel = &self.travel;
        let ends = [travel.soft_least_mm, travel.soft_most_mm];
        (travel.soft_least_mm != travel.soft_most_mm).then_some(ends)
    }

    /// One count of the table's scale, m.
    #[must_use]
    pub const fn scale_count_m(&self) -> f64 {
        self.feed.plate().scale_count_m
    }

    /// Whether `self` may take the place of `before`, which fits: then `config`, that of `before`, becomes its configuration on `board`.
    ///
    /// # Errors
    /// [`Unfit`] with a setting with which it does not fit while it does with those before it, and the number that does not.
    pub fn fits(
        &self,
        before: &Self,
        board: &BoardPlate,
        config: &mut DriveConfig,
    ) -> Result<(), Unfit> {
        let configured = match before.effect(self) {
            Effect::AtOnce => self.plate(board).configure_at_once(config),
            Effect::AtRest | Effect::Restart => self.configure(board, config),
        };
        configured.map_err(|misfit| self.unfit(before, board, config, misfit))
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
            let next = tried.saturating_add(1);
            let mut now = *before;
            let mut last = None;
            for (setting, _, value) in before.differences(self).take(next) {
                now.put(setting.id, value);
                last = Some((setting, value));
            }
            match now.configure(board, config) {
                Ok(()) => fitting = next,
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

impl FrictionSettings {
    /// Less than bearings and a ball screw of any motor's size have, so that it helps each: our choice, until it is measured.
    const LEAST: Self = Self {
        coulomb_nm: 0.002,
        sticks_nm: 0.001,
        stribeck_rad_s: 1.0,
        presliding_mrad: 5.0,
    };
}

fn torque(orders: &[TorqueOrderPlate; TORQUES]) -> TorqueOrderSettings {
    let slope = |plate: &TorqueOrderPlate| TorqueSlopePlate {
        re: plate.re_per_a,
        im: plate.im_per_a,
    };
    TorqueOrderSettings::of_plate(&TorqueOrderPlates {
        orders: TorqueOrderPlate::without_load(orders),
        slopes: orders.each_ref().map(slope),
    })
}

const fn torque_orders(settings: &TorqueOrderSettings) -> [TorqueOrderPlate; TORQUES] {
    let TorqueOrderPlates { orders, slopes } = settings.plate();
    let mut plates = [TorqueOrderPlate::NONE; TORQUES];
    let mut left: (&mut [TorqueOrderPlate], &[OrderPlate], &[TorqueSlopePlate]) =
        (&mut plates, &orders, &slopes);
    while let ([plate, plates @ ..], [order, orders @ ..], [slope, slopes @ ..]) = left {
        *plate = TorqueOrderPlate {
            order: order.order,
            re: order.re,
            im: order.im,
            re_per_a: slope.re,
            im_per_a: slope.im,
        };
        left = (plates, orders, slopes);
    }
    plates
}

fn speed(orders: &[OrderPlate; ANGLES]) -> SpeedOrderSettings {
    SpeedOrderSettings::of_plate(&SpeedOrderPlates { orders: *orders })
}

/// A setting that the drive's fixed-point formats, or physics, do not allow.
#[derive(Clone, Copy, Debug)]
pub struct Unfit {
    /// The setting, and its value; `None` if the settings did not fit before either.
    pub setting: Option<(Setting, Value)>,
    /// What of the configuration does not fit with it.
    pub misfit: Misfit,
}

impl Display for Unfit {
    fn fmt(&self, f: &mut Formatter<'_>) -> Written {
        if let Some((setting, value)) = self.setting {
            write!(f, "{setting} = {} does not fit: ", value.shown(setting))?;
        }
        write!(f, "{}", self.misfit)
    }
}

impl core::error::Error for Unfit {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::groups::{Direction, EncoderDirection, EncoderInterface, Switch};
    use crate::plate::parameter::Kind;
    use crate::speed::compensation::CompensationConfig;
    use core::f64::consts::TAU;
    use std::string::ToString;

    /// Kollmorgen (AKD User Guide, `MOTOR.KT`): `Kt = sqrt(3) 60 / (2 pi) Ke`, in N m per A rms. Per A peak it is that over `sqrt(2)`.
    #[test]
    fn a_torque_past_the_bridge_s_current_is_warned_of_and_none_below_it() {
        let mut settings = Settings::DEFAULT;
        let kt_rms =
            3f64.sqrt() * 60.0 / (TAU * 1000.0) * settings.screw.voltage_constant_v_rms_per_krpm;
        let limit = kt_rms / 2f64.sqrt() * settings.bridge.over_current_a;
        for (part, warned) in [(0.999, false), (1.001, true)] {
            settings.screw.torque_max_nm = part * limit;
            let found = settings.warnings().any(|one| one == Warning::ScrewTorque);
            assert_eq!(found, warned, "{part} of {limit} N m");
        }
    }

    /// The board of a plate with the paper's motors: 170 MHz, 20 kHz, ±5 A, 450 V.
    fn board() -> BoardPlate {
        BoardPlate {
            timer_hz: 170e6,
            pwm_hz: 20e3,
            speed_divider: 4,
            shunts: crate::current::sense::Shunts::Two,
            amps_per_count: 10.0 / 4096.0,
            zero_counts: 2048.0,
            bus_volts_per_count: 0.11,
            adc_counts: 4096,
        }
    }

    /// The gains of the defaults are those that others computed for the paper's motors (Eqs 9 to 12), and its figures.
    /// Another value that fits, of a setting that has `before`.
    fn changed(before: &Settings, setting: &Setting, config: &mut DriveConfig) -> Settings {
        let Some(Value::Real(value)) = before.get(setting.id) else {
            panic!("{setting} has no number");
        };
        let whole = before.plate(&board()).config().unwrap();
        let tried = [1.1 * value, 0.9 * value, value + 0.01, 100.0];
        let fits = tried.into_iter().find_map(|other| {
            let mut after = *before;
            after.set(setting.id, Value::Real(other)).ok()?;
            *config = whole;
            after.fits(before, &board(), config).ok()?;
            (other != value).then_some(after)
        });
        // The base speeds of a table rise from its first on; of two soft limits there are both or none.
        fits.unwrap_or_else(|| {
            let name = setting.to_string();
            assert!(
                name.starts_with("base.table_") || name.starts_with("travel.soft_"),
                "{name}"
            );
            *before
        })
    }

    /// The compensation is on, so that each part of a configuration counts.
    #[test]
    fn what_needs_no_restart_leaves_current_loops_and_orders_and_is_the_whole_configuration() {
        let mut before = Settings::DEFAULT;
        before.compensation.learning_s = 1.0;
        let old = before.plate(&board()).config().unwrap();
        assert!(old.compensation.active);
        let mut config = old;
        for setting in Settings::all().filter(|setting| setting.effect() != Effect::Restart) {
            if matches!(setting.kind(), Kind::Choice(_)) {
                continue;
            }
            let after = changed(&before, &setting, &mut config);
            assert_eq!(config, after.plate(&board()).config().unwrap(), "{setting}");
            assert_eq!(config.current_loops, old.current_loops, "{setting}");
            assert_eq!(config.heat, old.heat, "{setting}");
            let lines = |config: &DriveConfig| {
                let CompensationConfig {
                    torque,
                    angle,
                    travel,
                    places,
                    slow,
                    learns,
                    ..
                } = config.compensation;
                (torque, angle, travel, places, slow, learns)
            };
            assert_eq!(lines(&config), lines(&old), "{setting}");
        }
    }

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
        settings.nut.encoder.direction = EncoderDirection::Unknown;
        settings.screw.encoder.interface = EncoderInterface::IncrementalWithIndex;
        settings.screw.encoder.zero_deg = -90.0;
        settings.bridge.dead_time_ns = 500.0;
        settings.compensation.learning_s = 0.5;
        let usual = settings.plate(&board());
        assert_eq!(
            usual.compensation,
            CompensationPlate::usual([5; 2], 0.5, settings.scale_count_m())
        );
        assert_eq!(
            Settings::of_plate(&usual).screw_torque,
            TorqueOrderSettings::DEFAULT
        );
        settings.feed_friction.coulomb_nm = 0.1;
        settings.nut_torque.orders[7].order = 36.0;
        settings.nut_torque.orders[7].im = -0.2;
        settings.nut_torque.slopes[7].im = 0.01;
        settings.lead.orders[1].order = 2.0;
        settings.rejection.notch.hz = 503.0;
        settings.base.wander_rpm = 60.0;
        settings.base.table[0].table_mm_s = 2.5;
        settings.base.table[0].nut_rpm = 800.0;
        settings.travel.home.direction = Direction::Forwards;
        settings.travel.soft_most_mm = 290.0;
        settings.brake.fitted = Switch::On;
        settings.brake.closing_ms = 35.0;
        let plate = settings.plate(&board());
        assert_eq!(plate.friction.feed.coulomb_nm, 0.1);
        assert_eq!(plate.rejection.notch.hz, 503.0);
        assert_eq!(
            [plate.travel.soft_least_m, plate.travel.soft_most_m],
            [0.0, 0.29]
        );
        assert!(plate.travel.home.forwards);
        assert_eq!(settings.soft_limits_mm(), Some([0.0, 290.0]));
        assert_eq!(Settings::DEFAULT.soft_limits_mm(), None);
        assert_eq!(plate.base.table[0].velocity, 2.5e-3);
        assert_eq!(
            plate.compensation.torque[1][7],
            TorqueOrderPlate {
                im: -0.2,
                im_per_a: 0.01,
                ..TorqueOrderPlate::unknown(36.0)
            }
        );
        assert_eq!(
            plate.compensation.torque[0],
            [TorqueOrderPlate::NONE; TORQUES]
        );
        let again = Settings::of_plate(&plate);
        for setting in Settings::all() {
            let values = [&settings, &again].map(|settings| settings.get(setting.id).unwrap());
            if let [Value::Real(a), Value::Real(b)] = values {
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
            after.set(setting.id, Value::Real(value)).unwrap();
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
