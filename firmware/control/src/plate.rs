//! Plate data -> gains (Eqs 9 to 12) -> the loops' formats, once.
//!
//! Everything here is `const fn`, so a board's gains are computed while it is compiled: a gain that does not fit
//! its format is then a build error, and no float reaches the firmware. A host computes the same at run time.

use crate::coordinator::CoordinatorConfig;
use crate::current_loop::CurrentLoopConfig;
use crate::encoder::Interface;
use crate::encoder_watch::EncoderWatchConfig;
use crate::format::{
    Current, CurrentScale, Gain, MechanicalSpeed, Misfit, Ratio, SpeedChange, SpeedGain,
    TableVelocity, Voltage, quantise,
};
use crate::modulation::{DeadTime, ModulationConfig};
use crate::observer::{EncoderScale, ObserverConfig, SPEED_BITS_MAX};
use crate::profile::ProfileConfig;
use crate::regulator::{Induced, RegulatorConfig};
use crate::sense::{BusSense, CurrentSense, Shunts};
use crate::speed_loop::SpeedLoopConfig;
use crate::transform::AlphaBeta;
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};
use fixed::types::I20F12;

/// `?` for `const fn`.
macro_rules! attempt {
    ($result:expr) => {
        match $result {
            Ok(value) => value,
            Err(misfit) => return Err(misfit),
        }
    };
}

/// One motor as its plate and its encoder's plate give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorPlate {
    /// Stator resistance, ohm, of one phase.
    pub resistance_ohm: f64,
    /// Stator inductance `L_d = L_q`, H.
    pub inductance_h: f64,
    /// Electrical turns a mechanical turn.
    pub pole_pairs: u32,
    /// Magnet flux, Wb, power invariant: torque is `pole_pairs * flux_wb * i_q`.
    pub flux_wb: f64,
    /// Inertia that the motor moves, kg m^2: `J_M` of Eq 3.
    pub inertia_kg_m2: f64,
    /// Largest speed, mechanical rpm.
    pub speed_max_rpm: f64,
    /// Largest torque, N m: limits the `i_q` reference.
    pub torque_max_nm: f64,
    /// Gains of its current channels a, b, c relative to the board's: 1 where they are not calibrated.
    pub current_gains: [f64; 3],
    /// The encoder on its shaft.
    pub encoder: EncoderPlate,
}

/// An encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderPlate {
    /// How it is read.
    pub interface: Interface,
    /// Counts a mechanical turn, 2 to 2^30.
    pub counts_per_turn: u32,
    /// How much earlier than the currents the angle is taken, s: less than two PWM periods.
    pub age_s: f64,
    /// Electrical angle at count zero, electrical turns.
    pub theta_e_at_zero_turns: f64,
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
    /// A per ADC count.
    pub amps_per_count: f64,
    /// ADC counts at zero current.
    pub zero_counts: f64,
    /// V of the bus per ADC count.
    pub bus_volts_per_count: f64,
    /// Counts of the ADC's full scale.
    pub adc_counts: u32,
    /// Lowest bus voltage that the compensation divides by, V.
    pub bus_min_v: f64,
    /// Dead time of the timer, s; 0 switches its compensation off.
    pub dead_time_s: f64,
    /// Current at which the dead-time compensation is full, A.
    pub dead_time_fade_a: f64,
    /// Measure the current zeros before each start; otherwise the nominal ones are trusted.
    pub measure_zeros: bool,
    /// Shortest on-time of the low sides, s: what the shunts need to settle and be sampled.
    pub min_on_time_s: f64,
}

/// Damping and cutoff frequencies of the loops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Damping coefficient `xi` of Eqs 9 and 11.
    pub damping: f64,
    /// Cutoff of the current loop, rad/s.
    pub current_rad_s: f64,
    /// Cutoff of the speed loop, rad/s.
    pub speed_rad_s: f64,
    /// Natural frequency of the tracking observer, rad/s.
    pub observer_rad_s: f64,
    /// Damping of the tracking observer.
    pub observer_damping: f64,
}

/// The feed: what turns two speeds into a table velocity, and how it may be moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedPlate {
    /// Lead of the screw, m a turn.
    pub lead_m: f64,
    /// Largest table velocity, m/s.
    pub velocity_max: f64,
    /// Largest table acceleration, m/s^2.
    pub acceleration_max: f64,
    /// Largest table jerk, m/s^3.
    pub jerk_max: f64,
    /// Largest acceleration of the base speed, mechanical rad/s^2.
    pub base_acceleration_max: f64,
    /// Largest jerk of the base speed, mechanical rad/s^3.
    pub base_jerk_max: f64,
}

/// All that the drive needs to know: screw first, nut second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrivePlate {
    /// Screw motor, nut motor.
    pub motors: [MotorPlate; 2],
    /// The bridges, which are alike.
    pub board: BoardPlate,
    /// Loop tuning.
    pub tuning: Tuning,
    /// The feed.
    pub feed: FeedPlate,
}

/// Gains by Eqs 9 to 12, in the paper's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Eq 9, V/A.
    pub k_pc: f64,
    /// Eq 10, V/(A s).
    pub k_ic: f64,
    /// Eq 11, A per electrical rad/s.
    pub k_pw: f64,
    /// Eq 12, A per electrical rad.
    pub k_iw: f64,
}

/// Everything that the drive's steps are configured with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Screw, nut.
    pub current_loops: [CurrentLoopConfig; 2],
    /// Screw, nut.
    pub speed_loops: [SpeedLoopConfig; 2],
    /// The pair.
    pub coordinator: CoordinatorConfig,
    /// Current-loop periods per step of the speed task.
    pub speed_divider: u32,
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

    const fn modulation(&self, sense: &CurrentSense) -> Result<ModulationConfig, Misfit> {
        let period = self.period();
        attempt!(within(
            "PWM frequency",
            "Hz",
            self.pwm_hz,
            9_999.0,
            40_001.0
        ));
        attempt!(within(
            "PWM period",
            "timer counts",
            self.timer_hz / (2.0 * self.pwm_hz),
            100.0,
            32_768.0
        ));
        let low_side = self.min_on_time_s / self.sample_time();
        attempt!(within(
            "minimum on-time",
            "PWM periods",
            low_side,
            -1e-9,
            0.5
        ));
        let dead = self.dead_time_s / self.sample_time();
        attempt!(within("dead time", "PWM periods", dead, -1e-9, 0.2));
        let circle = ((1.0 - low_side) * FRAC_1_SQRT_2 - 2.0 * dead) * 0.999;
        attempt!(within("voltage circle", "bus", circle, 0.0, 1.0));
        // What divides by the bus, brought to [2^31, 2^32) of its word. A voltage is in 2^-17 V.
        let per_bus_count = period as f64 / self.bus_volts_per_count;
        attempt!(within(
            "PWM counts per volt and bus count",
            "counts/V",
            per_bus_count,
            1024.0,
            2_097_152.0
        ));
        let bus_counts_min = self.bus_min_v / self.bus_volts_per_count;
        let per_count = per_bus_count * 32_768.0 * (SQRT_2 / SQRT_3);
        // At the lowest bus the quotient must be within a quarter of its word.
        let mut fraction = 7u32;
        while per_count * power_of_two(fraction) > 536_870_912.0 * bus_counts_min && fraction > 3 {
            fraction = fraction.saturating_sub(1);
        }
        let full = per_count * power_of_two(fraction);
        let (mut numerator, mut scale_shift) = (full, 0u32);
        while numerator >= 4_294_967_295.0 {
            numerator /= 2.0;
            scale_shift = u32::saturating_add(scale_shift, 1);
        }
        // Below this it would leave that.
        let least = (full / 536_870_912.0 + 1.0) as u16;
        let bus_counts_min = bus_counts_min as u16;
        let radius = circle * self.bus_volts_per_count;
        attempt!(within(
            "voltage circle of a bus count",
            "V",
            radius,
            1e-4,
            0.2499
        ));
        Ok(ModulationConfig {
            period,
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            compare_max: (period as f64 * (1.0 - low_side)) as u16,
            fraction,
            scale_per_bus_count: numerator as u32,
            scale_inverse: (9_223_372_036_854_775_808.0 / numerator) as u32,
            scale_shift,
            bus_counts_min: if bus_counts_min > least {
                bus_counts_min
            } else {
                least
            },
            radius: (radius * 268_435_456.0) as u32,
            radius_square: (radius * radius * 17_179_869_184.0) as u32,
            dead_time: attempt!(self.dead_time(sense, fraction)),
        })
    }

    const fn dead_time(&self, sense: &CurrentSense, fraction: u32) -> Result<DeadTime, Misfit> {
        // Compare values are counted up to half a period.
        let counts = self.dead_time_s * self.timer_hz / 2.0;
        attempt!(within("dead time", "timer counts", counts, -1e-9, 256.0));
        attempt!(positive(
            "current of the full dead-time compensation",
            "A",
            self.dead_time_fade_a
        ));
        let [a, b, c] = sense.amperes;
        Ok(DeadTime {
            shunts: self.shunts,
            slopes: [
                self.dead_time_slope(a, sense.scale),
                self.dead_time_slope(b, sense.scale),
                self.dead_time_slope(c, sense.scale),
            ],
            #[allow(clippy::cast_possible_truncation)]
            full: (counts * 65_536.0 * power_of_two(fraction)) as i32,
        })
    }

    /// Codes to 2^-16 of the full compensation; the cast saturates where the current fades in within a count or two.
    #[allow(clippy::cast_possible_truncation)]
    const fn dead_time_slope(&self, amperes: i32, scale: CurrentScale) -> i32 {
        let ampere = power_of_two(scale.fraction);
        let slope = amperes as f64 / ampere * 65_536.0 / self.dead_time_fade_a;
        if slope < 1_073_741_824.0 {
            slope as i32
        } else {
            1 << 30
        }
    }

    #[allow(clippy::cast_possible_truncation)]
    const fn current_sense(&self, gains: [f64; 3]) -> Result<CurrentSense, Misfit> {
        attempt!(within(
            "ADC range",
            "counts",
            self.adc_counts as f64,
            1023.5,
            65_536.5
        ));
        attempt!(within(
            "ADC counts at zero current",
            "counts",
            self.zero_counts,
            -1e-9,
            self.adc_counts as f64
        ));
        let [ga, gb, gc] = gains;
        attempt!(within("gain of a current channel", "", ga, 0.5, 2.0));
        attempt!(within("gain of a current channel", "", gb, 0.5, 2.0));
        attempt!(within("gain of a current channel", "", gc, 0.5, 2.0));
        let largest = if ga > gb && ga > gc {
            ga
        } else if gb > gc {
            gb
        } else {
            gc
        };
        attempt!(within(
            "ADC full scale",
            "A",
            self.adc_counts as f64 * self.amps_per_count * largest,
            0.0,
            2048.0
        ));
        // The code of the whole range is 2^31.
        let bits = self.adc_counts.saturating_sub(1).ilog2().saturating_add(1);
        let code_shift = 31u32.saturating_sub(bits);
        let per_code = self.amps_per_count / power_of_two(code_shift);
        // As many fraction bits as the largest factor has room for: sqrt(2) of b in beta.
        let mut fraction = 30u32;
        while per_code * largest * SQRT_2 * power_of_two(fraction) * 8_589_934_592.0
            >= 2_147_483_647.0
            && fraction > 0
        {
            fraction = fraction.saturating_sub(1);
        }
        // Amperes of a code in 2^-32 of the unit of currents in the rotor's frame; of the vector's, twice that.
        let unit = per_code * power_of_two(fraction) * 4_294_967_296.0;
        attempt!(within(
            "current of a count",
            "A",
            unit,
            1.0e6,
            2_147_483_648.0
        ));
        let [a, b, c] = [unit * ga, unit * gb, unit * gc];
        let clarke = match self.shunts {
            Shunts::Two => AlphaBeta {
                alpha: [a * SQRT_2 * SQRT_3, 0.0, 0.0],
                beta: [a * SQRT_2, b * 2.0 * SQRT_2, 0.0],
            },
            Shunts::Three => AlphaBeta {
                alpha: [
                    a * 2.0 * SQRT_2 / SQRT_3,
                    -b * SQRT_2 / SQRT_3,
                    -c * SQRT_2 / SQRT_3,
                ],
                beta: [0.0, b * SQRT_2, -c * SQRT_2],
            },
        };
        let zero = (self.zero_counts * power_of_two(code_shift)) as i32;
        Ok(CurrentSense {
            shunts: self.shunts,
            code_shift,
            zeros: [zero; 3],
            clarke: AlphaBeta {
                alpha: rounded(clarke.alpha),
                beta: rounded(clarke.beta),
            },
            amperes: rounded([a, b, c]),
            scale: CurrentScale { fraction },
        })
    }

    const fn bus_sense(&self) -> Result<BusSense, Misfit> {
        attempt!(within(
            "bus full scale",
            "V",
            self.adc_counts as f64 * self.bus_volts_per_count,
            0.0,
            1024.0
        ));
        let bits = attempt!(quantise(
            "bus gain",
            "V/count",
            self.bus_volts_per_count,
            28
        ));
        Ok(BusSense {
            gain: TableVelocity::from_bits(bits),
        })
    }
}

impl MotorPlate {
    /// Eqs 9 to 12 for this motor.
    #[must_use]
    pub const fn gains(&self, tuning: &Tuning) -> Gains {
        let Tuning {
            damping,
            current_rad_s: w_c,
            speed_rad_s: w_w,
            ..
        } = *tuning;
        let torque_per_speed =
            self.inertia_kg_m2 / (self.pole_pairs as f64 * self.pole_pairs as f64 * self.flux_wb);
        Gains {
            k_pc: 2.0 * damping * self.inductance_h * w_c - self.resistance_ohm,
            k_ic: self.inductance_h * w_c * w_c,
            k_pw: 2.0 * damping * w_w * torque_per_speed,
            k_iw: w_w * w_w * torque_per_speed,
        }
    }

    /// Largest speed, mechanical rad/s.
    #[must_use]
    pub const fn speed_max(&self) -> f64 {
        self.speed_max_rpm * TAU / 60.0
    }

    /// Configuration of this motor's current loop on `drive`'s board.
    ///
    /// # Errors
    /// [`Misfit`] if a number does not fit its format or is out of its physical range.
    pub const fn current_loop(&self, drive: &DrivePlate) -> Result<CurrentLoopConfig, Misfit> {
        let (board, sample_time) = (&drive.board, drive.board.sample_time());
        let gains = self.gains(&drive.tuning);
        attempt!(positive("current-loop gain Kpc (Eq 9)", "V/A", gains.k_pc));
        attempt!(within("flux", "Wb", self.flux_wb, -64.0, 64.0));
        let sense = attempt!(board.current_sense(self.current_gains));
        let scale = sense.scale;
        Ok(CurrentLoopConfig {
            bus: attempt!(board.bus_sense()),
            encoder: self.encoder.interface,
            observer: attempt!(self.observer(&drive.tuning, sample_time)),
            encoder_watch: self.encoder_watch(&drive.tuning),
            regulator: RegulatorConfig {
                k_pc: attempt!(gain("Kpc (Eq 9)", gains.k_pc, scale)),
                k_ic_step: attempt!(gain(
                    "Kic (Eq 10) per sample",
                    gains.k_ic * sample_time,
                    scale
                )),
                induced: attempt!(self.induced(sample_time, scale)),
            },
            modulation: attempt!(board.modulation(&sense)),
            measure_zeros: board.measure_zeros,
            sense,
        })
    }

    #[allow(clippy::cast_possible_truncation)]
    const fn induced(&self, sample_time: f64, scale: CurrentScale) -> Result<Induced, Misfit> {
        attempt!(within("inductance", "H", self.inductance_h, 1e-7, 0.125));
        // A step of 2^-32 turn a sample in rad/s, times a flux linkage in Wb, in a voltage's last steps; times 2^32.
        let per_weber = TAU / sample_time * power_of_two(Voltage::FRAC_NBITS);
        let per_unit =
            self.inductance_h * per_weber * 4_294_967_296.0 / power_of_two(scale.fraction);
        let (mut inductance, mut flux) = (per_unit, self.flux_wb * per_weber);
        let mut shift = 0u32;
        while (inductance > 1_073_741_823.0 || flux.abs() > 536_870_911.0) && shift < 16 {
            inductance /= 2.0;
            flux /= 2.0;
            shift = shift.saturating_add(1);
        }
        attempt!(within(
            "induced voltage of a current",
            "2^-32",
            inductance,
            500.0,
            1_073_741_824.0
        ));
        attempt!(within(
            "induced voltage of the magnets",
            "2^-32",
            flux.abs(),
            -1.0,
            536_870_912.0
        ));
        Ok(Induced {
            inductance: inductance as i32,
            flux: flux as i32,
            shift,
        })
    }

    /// Travel: twice what a reversal at full torque lets the observer turn within one count (see
    /// [`encoder_watch`](crate::encoder_watch)), and four counts. Jump: four times the observer's lag at full torque,
    /// `a / omega_0^2`, and eight counts.
    const fn encoder_watch(&self, tuning: &Tuning) -> EncoderWatchConfig {
        let count = TAU / self.encoder.counts_per_turn as f64;
        let acceleration = self.torque_max_nm / self.inertia_kg_m2;
        let lag = 2.0 * tuning.observer_damping * acceleration / tuning.observer_rad_s;
        let stands = 2.0 * square_root(2.0 * count / acceleration);
        let turns = (2.0 * lag * stands + 4.0 * count) / TAU;
        let lag_max = acceleration / (tuning.observer_rad_s * tuning.observer_rad_s);
        let jump = (4.0 * lag_max + 8.0 * count) / TAU;
        // The casts saturate; a turn or more never fires.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        EncoderWatchConfig {
            travel_max: (turns * 4_294_967_296.0) as u32,
            jump_max: (jump * 4_294_967_296.0) as u32,
            checked: self.encoder.interface.is_checked(),
        }
    }

    const fn observer(&self, tuning: &Tuning, sample_time: f64) -> Result<ObserverConfig, Misfit> {
        let encoder = match EncoderScale::new(self.encoder.counts_per_turn) {
            Some(scale) => scale,
            None => {
                let value = self.encoder.counts_per_turn as f64;
                return Err(Misfit {
                    name: "encoder resolution",
                    unit: "counts/turn",
                    value,
                    least: 2.0,
                    below: 1_073_741_825.0,
                });
            }
        };
        let x = tuning.observer_rad_s * sample_time;
        attempt!(within(
            "observer frequency times sample time",
            "rad",
            x,
            1e-4,
            1.001
        ));
        attempt!(within("pole pairs", "", self.pole_pairs as f64, 0.5, 129.0));
        // The observer holds speeds below 1/16 turn a sample; electrically an eighth leaves the angle its advance.
        let electrical = self.speed_max_rpm / 60.0 * self.pole_pairs as f64 * sample_time;
        attempt!(within(
            "largest speed",
            "electrical turns a sample",
            electrical,
            0.0,
            0.125
        ));
        // omega_e [2^-16 rad/s] = speed [2^-32 turn a sample] * m / 2^shift, m as large as 31 bits hold.
        let mut multiplier =
            TAU * self.pole_pairs as f64 / sample_time * 65_536.0 / 4_294_967_296.0;
        let mut omega_shift = 0u32;
        while multiplier < 1_073_741_824.0 && omega_shift < 31 {
            multiplier *= 2.0;
            omega_shift = omega_shift.saturating_add(1);
        }
        // What `Speed` holds; the cast saturates.
        #[allow(clippy::arithmetic_side_effects)]
        let format_end = 32_767.0 * 65_536.0 * (1u64 << omega_shift) as f64 / multiplier;
        #[allow(clippy::cast_possible_truncation)]
        let step_max = format_end as i32;
        // A quarter electrical turn a sample is 2^30.
        let mut speed_bits = SPEED_BITS_MAX;
        while self.pole_pairs as f64 * power_of_two(speed_bits) > 1_073_741_824.0 {
            speed_bits = speed_bits.saturating_sub(1);
        }
        if matches!(self.encoder.interface, Interface::Mt6835) {
            let counts = crate::mt6835::COUNTS_PER_TURN as f64;
            attempt!(within(
                "resolution of an MT6835",
                "counts/turn",
                self.encoder.counts_per_turn as f64,
                counts - 0.5,
                counts + 0.5
            ));
        }
        let age = self.encoder.age_s / sample_time;
        attempt!(within(
            "age of an encoder reading",
            "PWM periods",
            age,
            -1e-9,
            2.0
        ));
        Ok(ObserverConfig {
            encoder,
            age: Ratio::from_bits(attempt!(quantise(
                "age of an encoder reading",
                "PWM periods",
                age,
                30
            ))),
            alpha: Ratio::from_bits(attempt!(quantise(
                "observer alpha",
                "",
                2.0 * tuning.observer_damping * x,
                30
            ))),
            beta: Ratio::from_bits(attempt!(quantise("observer beta", "", x * x, 30))),
            speed_bits,
            pole_pairs: self.pole_pairs,
            theta_e_offset: crate::format::Angle::from_turns(self.encoder.theta_e_at_zero_turns),
            omega_multiplier: attempt!(quantise("electrical speed scale", "", multiplier, 0)),
            omega_shift,
            step_max,
        })
    }

    /// Configuration of this motor's speed loop.
    ///
    /// # Errors
    /// [`Misfit`] if a number does not fit its format.
    pub const fn speed_loop(&self, drive: &DrivePlate) -> Result<SpeedLoopConfig, Misfit> {
        let gains = self.gains(&drive.tuning);
        let step = drive.speed_step();
        let pole_pairs = self.pole_pairs as f64;
        let torque_constant = pole_pairs * self.flux_wb;
        attempt!(positive("inertia", "kg m^2", self.inertia_kg_m2));
        Ok(SpeedLoopConfig {
            k_pw: SpeedGain::from_bits(attempt!(quantise(
                "Kpw (Eq 11)",
                "A s/rad",
                gains.k_pw,
                24
            ))),
            k_iw_step: SpeedGain::from_bits(attempt!(quantise(
                "Kiw (Eq 12) per step",
                "A s/rad",
                gains.k_iw * step,
                24
            ))),
            inertia: SpeedGain::from_bits(attempt!(quantise(
                "inertia feed-forward",
                "A per rad/s a step",
                self.inertia_kg_m2 / (pole_pairs * torque_constant * step),
                24
            ))),
            i_max: Current::from_bits(attempt!(quantise(
                "torque limit",
                "A",
                self.torque_max_nm / torque_constant,
                20
            ))),
        })
    }
}

impl DrivePlate {
    /// Time between two steps of the speed task, s.
    #[must_use]
    pub const fn speed_step(&self) -> f64 {
        self.board.sample_time() * self.board.speed_divider as f64
    }

    /// The drive's configuration.
    ///
    /// # Errors
    /// [`Misfit`] naming the first number that does not fit its format or its physical range.
    pub const fn config(&self) -> Result<DriveConfig, Misfit> {
        let [screw, nut] = &self.motors;
        attempt!(within(
            "speed divider",
            "periods",
            self.board.speed_divider as f64,
            0.5,
            64.5
        ));
        Ok(DriveConfig {
            current_loops: [
                attempt!(screw.current_loop(self)),
                attempt!(nut.current_loop(self)),
            ],
            speed_loops: [
                attempt!(screw.speed_loop(self)),
                attempt!(nut.speed_loop(self)),
            ],
            coordinator: attempt!(self.coordinator()),
            speed_divider: self.board.speed_divider,
        })
    }

    const fn coordinator(&self) -> Result<CoordinatorConfig, Misfit> {
        let (feed, step) = (&self.feed, self.speed_step());
        let [screw, nut] = &self.motors;
        attempt!(positive("lead", "m", feed.lead_m));
        let per_metre = TAU / feed.lead_m;
        let table = attempt!(profile(
            ["table acceleration", "table jerk"],
            feed.acceleration_max * per_metre * step,
            feed.jerk_max * per_metre * step * step,
        ));
        let base = attempt!(profile(
            ["base acceleration", "base jerk"],
            feed.base_acceleration_max * step,
            feed.base_jerk_max * step * step,
        ));
        Ok(CoordinatorConfig {
            pole_pairs: [screw.pole_pairs.cast_signed(), nut.pole_pairs.cast_signed()],
            radians_per_metre: I20F12::from_bits(attempt!(quantise(
                "screw turns per metre",
                "rad/m",
                per_metre,
                12
            ))),
            velocity_max: TableVelocity::from_bits(attempt!(quantise(
                "table velocity limit",
                "m/s",
                feed.velocity_max,
                28
            ))),
            speed_max: [
                MechanicalSpeed::from_bits(attempt!(quantise(
                    "screw speed limit",
                    "rad/s",
                    screw.speed_max(),
                    18
                ))),
                MechanicalSpeed::from_bits(attempt!(quantise(
                    "nut speed limit",
                    "rad/s",
                    nut.speed_max(),
                    18
                ))),
            ],
            table,
            base,
        })
    }
}

/// Square root by Newton's method, for configuration; 0 of what has none.
const fn square_root(x: f64) -> f64 {
    if !(x > 0.0 && x < f64::MAX) {
        return 0.0;
    }
    let mut root = if x > 1.0 { x } else { 1.0 };
    let mut step = 0u32;
    // Halves down to the root's size first: 600 steps are enough for any f64.
    while step < 600 {
        root = 0.5 * (root + x / root);
        step = step.saturating_add(1);
    }
    root
}

const fn profile(
    [acceleration_name, jerk_name]: [&'static str; 2],
    acceleration: f64,
    jerk: f64,
) -> Result<ProfileConfig, Misfit> {
    let acceleration = attempt!(quantise(
        acceleration_name,
        "rad/s a step",
        acceleration,
        28
    ));
    let jerk = attempt!(quantise(jerk_name, "rad/s a step^2", jerk, 28));
    attempt!(within(
        acceleration_name,
        "2^-28 rad/s a step",
        acceleration as f64,
        -0.5,
        2.2e9
    ));
    attempt!(within(
        jerk_name,
        "2^-28 rad/s a step^2",
        jerk as f64,
        -0.5,
        2.2e9
    ));
    Ok(ProfileConfig::new(
        SpeedChange::from_bits(acceleration),
        SpeedChange::from_bits(jerk),
    ))
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;

const fn power_of_two(n: u32) -> f64 {
    1u64.wrapping_shl(n) as f64
}

#[allow(clippy::cast_possible_truncation)]
const fn rounded([a, b, c]: [f64; 3]) -> [i32; 3] {
    [
        (a + half(a)) as i32,
        (b + half(b)) as i32,
        (c + half(c)) as i32,
    ]
}

const fn half(x: f64) -> f64 {
    if x < 0.0 { -0.5 } else { 0.5 }
}

/// A gain of the current loop, from V/A, for currents of `scale`: at most 2048 V/A.
const fn gain(name: &'static str, gain: f64, scale: CurrentScale) -> Result<Gain, Misfit> {
    attempt!(within(name, "V/A", gain, -2048.0, 2048.0));
    // Times 2^32 it makes a voltage's last steps of a current's.
    let fraction = Voltage::FRAC_NBITS
        .saturating_add(32)
        .saturating_sub(scale.fraction);
    let mut shift = 0u32;
    while gain.abs() * power_of_two(fraction.saturating_sub(shift)) >= 2_147_483_647.0 && shift < 16
    {
        shift = shift.saturating_add(1);
    }
    let multiplier = attempt!(quantise(name, "V/A", gain, fraction.saturating_sub(shift)));
    Ok(Gain { multiplier, shift })
}

const fn within(
    name: &'static str,
    unit: &'static str,
    value: f64,
    above: f64,
    below: f64,
) -> Result<(), Misfit> {
    if value > above && value < below {
        Ok(())
    } else {
        Err(Misfit {
            name,
            unit,
            value,
            least: above,
            below,
        })
    }
}

const fn positive(name: &'static str, unit: &'static str, value: f64) -> Result<(), Misfit> {
    within(name, unit, value, 0.0, f64::MAX)
}

#[cfg(test)]
pub(crate) use tests::test_plate;

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

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
            current_gains: [1.0; 3],
            encoder: EncoderPlate {
                interface: Interface::Incremental,
                age_s: 0.0,
                counts_per_turn: 1 << 20,
                theta_e_at_zero_turns: 0.0,
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
                bus_min_v: 30.0,
                dead_time_s: 0.0,
                dead_time_fade_a: 0.05,
                measure_zeros: true,
                min_on_time_s: 0.0,
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
                velocity_max: 0.1,
                acceleration_max: 1.0,
                jerk_max: 100.0,
                base_acceleration_max: 500.0,
                base_jerk_max: 50_000.0,
            },
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
            bus_min_v: 8.0,
            dead_time_s: 500e-9,
            dead_time_fade_a: 0.1,
            min_on_time_s: 1e-6,
            ..plate.board
        };
        match plate.config() {
            Ok(config) => config,
            Err(_) => panic!("a number of this plate does not fit its format"),
        }
    };

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
                |p| p.motors[1].current_gains[2] = -1.0,
                "gain of a current channel",
            ),
            (|p| p.motors[0].inertia_kg_m2 = 0.0, "inertia"),
            (|p| p.board.min_on_time_s = 40e-6, "minimum on-time"),
            (|p| p.motors[0].speed_max_rpm = 60_000.0, "largest speed"),
        ] {
            let mut plate = test_plate();
            spoil(&mut plate);
            assert_eq!(plate.config().unwrap_err().name, name);
        }
    }
}
