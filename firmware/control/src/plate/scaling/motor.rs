//! A motor's plate -> its current loop's and its speed loop's configuration.

use super::{attempt, gain, positive, power_of_two, square_root, within};
use crate::base::format::{CurrentScale, Misfit, Voltage, fixed_point, quantise};
use crate::current::current_loop::CurrentLoopConfig;
use crate::current::encoder::Interface;
use crate::current::encoder_watch::EncoderWatchConfig;
use crate::current::observer::{EncoderScale, ObserverConfig, SPEED_BITS_MAX, WideScale};
use crate::current::regulator::{Induced, RegulatorConfig};
use crate::plate::{DrivePlate, MotorPlate, Tuning};
use crate::speed::speed_loop::SpeedLoopConfig;
use core::f64::consts::TAU;

/// Half of the slack of a motor at rest, counts: the observer answers a count with a count and its overshoot.
const SLACK_COUNTS: f64 = 0.625;
/// The answer to a count above which a motor at rest has slack, parts of the torque limit: less does not overcome friction.
const SLACK_FROM: f64 = 0.01;
/// The largest speed that an observer sees in a count, counts times its natural frequency: `e^(-y/tan y)` with `cos y` its damping, for the
/// usual dampings of 0.7 to 0.9.
const COUNT_SPEED: f64 = 0.43;

impl MotorPlate {
    /// Configuration of this motor's current loop on `drive`'s board.
    ///
    /// # Errors
    /// [`Misfit`] if a number does not fit its format or is out of its physical range.
    pub const fn current_loop(&self, drive: &DrivePlate) -> Result<CurrentLoopConfig, Misfit> {
        let (board, bridge) = (&drive.board, &drive.bridge);
        let sample_time = board.sample_time();
        let gains = self.gains(&drive.tuning);
        attempt!(positive("current-loop gain Kpc (Eq 9)", "V/A", gains.k_pc));
        attempt!(within("flux", "Wb", self.flux_wb, -64.0, 64.0));
        let sense = attempt!(board.current_sense(self.current_gains()));
        let scale = sense.scale;
        Ok(CurrentLoopConfig {
            bus: attempt!(board.bus_sense()),
            encoder: self.encoder.interface,
            observer: attempt!(self.observer(&drive.tuning, sample_time)),
            alignment: None,
            encoder_watch: self.encoder_watch(drive),
            current_max_square: attempt!(current_max_square(bridge.over_current_a, scale)),
            regulator: RegulatorConfig {
                k_pc: attempt!(gain("Kpc (Eq 9)", gains.k_pc, scale)),
                k_ic_step: attempt!(gain(
                    "Kic (Eq 10) per sample",
                    gains.k_ic * sample_time,
                    scale
                )),
                induced: attempt!(self.induced(sample_time, scale)),
            },
            modulation: attempt!(board.modulation(bridge, &sense)),
            measure_zeros: bridge.measure_zeros,
            bootstrap_periods: attempt!(bridge.bootstrap_periods(sample_time)),
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
    /// `a / omega_0^2`, and eight counts; while aligning, at the larger of the alignment's torques. What an index may put right: the
    /// electrical angle that the watch of the voltage lets pass.
    pub(super) const fn encoder_watch(&self, drive: &DrivePlate) -> EncoderWatchConfig {
        let tuning = &drive.tuning;
        let [screw, nut] = &drive.motors;
        let aligning = screw
            .alignment_torque_nm
            .max(nut.alignment_torque_nm)
            .min(self.torque_max_nm)
            / self.torque_max_nm;
        let count = TAU / self.encoder.counts_per_turn as f64;
        let acceleration = self.torque_max_nm / self.inertia_kg_m2;
        let lag = 2.0 * tuning.observer_damping * acceleration / tuning.observer_rad_s;
        let stands = 2.0 * square_root(2.0 * count / acceleration);
        let turns = (2.0 * lag * stands + 4.0 * count) / TAU;
        let lag_max = acceleration / (tuning.observer_rad_s * tuning.observer_rad_s);
        let jump = (4.0 * lag_max + 8.0 * count) / TAU;
        let jump_aligning = (4.0 * aligning * lag_max + 8.0 * count) / TAU;
        // The casts saturate; a turn or more never fires.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        EncoderWatchConfig {
            travel_max: (turns * 4_294_967_296.0) as u32,
            jump_max: (jump * 4_294_967_296.0) as u32,
            jump_max_aligning: (jump_aligning * 4_294_967_296.0) as u32,
            lost_max: match self.encoder.interface {
                Interface::IncrementalWithIndex => {
                    (drive.runaway.angle_deg / 360.0 / self.pole_pairs as f64 * 4_294_967_296.0)
                        as u32
                }
                // Without an index a count is not put right; a frame that passes its check may be wrong, and the next one is right.
                Interface::Incremental | Interface::Mt6835 => u32::MAX,
            },
            checked: self.encoder.interface.is_checked(),
        }
    }

    const fn encoder_scale(&self) -> Result<EncoderScale, Misfit> {
        match EncoderScale::new(self.encoder.counts_per_turn) {
            Some(scale) => Ok(scale),
            None => Err(Misfit {
                name: "encoder resolution",
                unit: "counts/turn",
                value: self.encoder.counts_per_turn as f64,
                least: 2.0,
                below: 1_073_741_825.0,
            }),
        }
    }

    /// omega_e [2^-16 rad/s] = speed [2^-32 turn a sample] * m / 2^shift: m, as large as 31 bits hold, and the shift.
    const fn omega_scale(&self, sample_time: f64) -> (f64, u32) {
        let mut multiplier =
            TAU * self.pole_pairs as f64 / sample_time * 65_536.0 / 4_294_967_296.0;
        let mut shift = 0u32;
        while multiplier < 1_073_741_824.0 && shift < 31 {
            multiplier *= 2.0;
            shift = shift.saturating_add(1);
        }
        (multiplier, shift)
    }

    const fn observer(&self, tuning: &Tuning, sample_time: f64) -> Result<ObserverConfig, Misfit> {
        let encoder = attempt!(self.encoder_scale());
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
        let (multiplier, omega_shift) = self.omega_scale(sample_time);
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
            let counts = crate::current::mt6835::COUNTS_PER_TURN as f64;
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
            age: attempt!(fixed_point("age of an encoder reading", "PWM periods", age)),
            alpha: attempt!(fixed_point(
                "observer alpha",
                "",
                2.0 * tuning.observer_damping * x
            )),
            beta: attempt!(fixed_point("observer beta", "", x * x)),
            speed_end: 1 << speed_bits,
            pole_pairs: self.pole_pairs,
            omega_scale: WideScale::new(
                attempt!(quantise("electrical speed scale", "", multiplier, 0)),
                omega_shift,
            ),
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
            k_pw: attempt!(fixed_point("Kpw (Eq 11)", "A s/rad", gains.k_pw)),
            k_iw_step: attempt!(fixed_point(
                "Kiw (Eq 12) per step",
                "A s/rad",
                gains.k_iw * step
            )),
            inertia: attempt!(fixed_point(
                "inertia feed-forward",
                "A per rad/s a step",
                self.inertia_kg_m2 / (pole_pairs * torque_constant * step)
            )),
            i_max: attempt!(fixed_point(
                "torque limit",
                "A",
                self.torque_max_nm / torque_constant
            )),
            slack: self.slack(drive, gains.k_pw),
        })
    }

    /// Half of the slack at rest. A fine encoder needs none: the answer to its count is less than friction.
    #[allow(clippy::cast_possible_truncation)]
    pub(super) const fn slack(&self, drive: &DrivePlate, k_pw: f64) -> i32 {
        let counts = self.encoder.counts_per_turn as f64;
        let pole_pairs = self.pole_pairs as f64;
        let speed = COUNT_SPEED * drive.tuning.observer_rad_s * TAU / counts;
        let torque = k_pw * pole_pairs * speed * pole_pairs * self.flux_wb.abs();
        if torque < SLACK_FROM * self.torque_max_nm {
            return 0;
        }
        (SLACK_COUNTS / counts * 4_294_967_296.0 / drive.board.speed_divider as f64) as i32
    }
}

/// The square of the vector of a phase current of `amperes`, upper word, to seven bits: such a number is part of a compare
/// instruction. A vector is as long as `sqrt(3/2)` times the largest phase current, or longer.
#[allow(clippy::cast_possible_truncation)]
const fn current_max_square(amperes: f64, scale: CurrentScale) -> Result<i32, Misfit> {
    attempt!(positive("measured over-current", "A", amperes));
    let vector = amperes * power_of_two(scale.fraction);
    let mut square = 1.5 * vector * vector / 4_294_967_296.0;
    let mut shift = 0u32;
    while square >= 128.0 {
        square /= 2.0;
        shift = shift.saturating_add(1);
    }
    // No current of the ADC's range is beyond 2^28.
    Ok((square as i32).wrapping_shl(if shift < 22 { shift } else { 22 }))
}
