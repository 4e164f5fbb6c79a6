//! The alignment's plate -> its limits, times and thresholds in the formats of its steps.

use super::{attempt, positive, profile, within};
use crate::base::format::{Misfit, SpeedGain, fixed_point};
use crate::current::encoder::Interface;
use crate::plate::{DrivePlate, MotorPlate};
use crate::speed::alignment::swing::FULL;
use crate::speed::alignment::{
    AlignmentConfig, LONGEST_S, MotorAlignment, ProbeConfig, RotorSwing, SwingConfig, WiringConfig,
};
use crate::speed::coordinator::CoordinatorConfig;
use crate::speed::speed_loop::SpeedLoopConfig;
use core::f64::consts::TAU;

/// Seconds in which a probe's torque grows by e, of its rest, and rests at most.
const GROWTH_S: f64 = 24e-3;
const REST_S: f64 = 10e-3;
const RESTS_MAX: u8 = 100;
/// Seconds for which the load must be still.
const STILL_S: f64 = 20e-3;
/// And by which it must be, s: the paper's motors coast down from 3000 rpm on their friction alone in less.
const COAST_S: f64 = 3.0;
/// Longest that a kick waits for its current, s.
const KICK_S: f64 = 5e-3;
/// Part of the torque limit that is asked for: the rest is for a current loop that overshoots a step by an eighth, and for a flux
/// that is a twentieth more than the plate says.
const ASKED: f64 = 0.88;
/// Part of the torque limit that a kick asks for: a current loop that a wrong sign makes unstable then ends below the limit.
const KICK: f64 = 0.2;
/// A kick asks for more than what is clear: of the third phase, where it is not measured, the others have half each.
const KICK_OF_CLEAR: f64 = 2.6;
/// And for no more of the torque limit than this, where the dead time wants more than [`KICK`]: the loop of a wrong sign then makes up
/// to one and a half times the limit (measured with all signs wrong on drawn drives of which a kick is so large).
const KICK_MOST: f64 = 0.3;
/// Part of the travel past which alignment stops: the rest is for what the encoders do not show, the lead's error and the
/// screw's stretch, and for what shorted windings do not brake.
const STOPPED: f64 = 0.92;
/// Furthest that the rotors swing, electrical turns: thirty degrees. A tangent of 0.58 is clear of what torque varies over the angle.
const SWING: f64 = 1.0 / 12.0;
/// In so many seconds from the middle.
const SWING_S: f64 = 0.15;
/// Seconds in which that speed is reached.
const SWING_EASE_S: f64 = 30e-3;
/// Three swings have four such ways each, and may wait as often as it likes for a rotor within this time, s.
const SWING_MAX_S: f64 = 6.0;
/// Parts of the torque limit across the axis and along it: together less than all. The motor with fewer pole pairs swings by fewer
/// electrical degrees, and has more across for that, and less along.
const ACROSS: f64 = 0.3;
const ACROSS_MOST: f64 = 0.6;
const ALONG: f64 = 0.9;
const ALONG_LEAST: f64 = 0.74;
/// Part of the speed loop's cutoff with which a rotor catches up.
const CATCH_UP: f64 = 0.25;
/// Cutoff of the speed loops that alignment has at least, rad/s, where the observer is so many times as fast. Of 100 starts of the NUCLEO
/// board with loops of 133 rad/s five failed, with 200 none.
const ALIGNING_RAD_S: f64 = 200.0;
const OBSERVER_OF_SPEED: f64 = 5.0;
/// Seconds that it waits for a rotor that is held, before it turns round.
const SWING_WAITS_S: f64 = 100e-3;
/// Seconds in which the torque of a rotor that friction holds grows from none to its limit.
const BREAK_AWAY_S: f64 = 0.3;
/// Largest gain of a swing's catching up: its product with an angle is within 2^62.
const GAIN_MAX: f64 = 2_147_483_648.0;
/// Part of the travel that a rotor may be behind before the others wait.
const LATE: f64 = 0.06;
/// What is motion: counts of the encoder, and a part of the travel.
const MOTION_COUNTS: f64 = 2.0;
const MOTION: f64 = 1.0 / 128.0;
/// Part of the torque limit that accelerates the inertia while both turn.
const ACCELERATION: f64 = 0.25;
/// Seconds in which that acceleration is reached.
const EASE_S: f64 = 20e-3;
/// Electrical turns that a measurement lasts at least.
const MEASURED_TURNS: f64 = 2.0;
/// One, in the bits of a speed loop's gain.
const SPEED_GAIN_ONE: f64 = (1u32 << SpeedGain::FRAC_NBITS) as f64;
/// Turns in which an index is passed, and a little more.
const INDEX_TURNS: f64 = 1.25;
/// Part of the turning's speed above which the back-EMF is listened to.
const LEAST_SPEED: f64 = 0.125;
/// Part of it below which a motor is at rest.
const STILL_SPEED: f64 = 1.0 / 64.0;

impl MotorPlate {
    /// N m an ampere.
    const fn torque_per_ampere(&self) -> f64 {
        self.pole_pairs as f64 * self.flux_wb.abs()
    }

    /// In about what time a shorted winding stops its rotor, s: `J*R / (p*flux)^2` for the rotor (torque `(p*flux)^2 / R` per speed at low
    /// speed), `L / R` until the current flows.
    const fn braking_s(&self) -> f64 {
        let torque_per_ampere = self.torque_per_ampere();
        self.inertia_kg_m2 * self.resistance_ohm / (torque_per_ampere * torque_per_ampere)
            + self.inductance_h / self.resistance_ohm
    }
}

const fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

impl DrivePlate {
    /// Configuration of the alignment.
    ///
    /// # Errors
    /// [`Misfit`] naming the first number that does not fit its format or its physical range.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) const fn alignment(
        &self,
        speed_loops: &[SpeedLoopConfig; 2],
        coordinator: &CoordinatorConfig,
    ) -> Result<AlignmentConfig, Misfit> {
        let (plate, step) = (&self.alignment, self.speed_step());
        let [screw, nut] = &self.motors;
        let (screw_nm, nut_nm) = (screw.alignment_torque_nm, nut.alignment_torque_nm);
        let [screw_loop, nut_loop] = speed_loops;
        let travel = plate.travel_m / self.feed.lead_m;
        attempt!(within("alignment's travel", "turns", travel, 1e-4, 0.1));
        let speed = plate.speed_rpm * TAU / 60.0;
        let slower = if screw.speed_max() < nut.speed_max() {
            screw.speed_max()
        } else {
            nut.speed_max()
        };
        attempt!(within("alignment's speed", "rad/s", speed, 0.0, slower));
        let (of_screw, of_nut) = (screw_nm / screw.inertia_kg_m2, nut_nm / nut.inertia_kg_m2);
        let acceleration = ACCELERATION * if of_screw < of_nut { of_screw } else { of_nut };
        let slowest = if screw.pole_pairs < nut.pole_pairs {
            screw.pole_pairs
        } else {
            nut.pole_pairs
        };
        let most = if screw.pole_pairs > nut.pole_pairs {
            screw.pole_pairs
        } else {
            nut.pole_pairs
        };
        let swing = SWING / most as f64;
        let cutoff = self.aligning_rad_s();
        let measured_s = MEASURED_TURNS * TAU / (slowest as f64 * speed);
        Ok(AlignmentConfig {
            motors: [
                attempt!(self.motor_alignment(screw, *screw_loop, cutoff, swing, speed)),
                attempt!(self.motor_alignment(nut, *nut_loop, cutoff, swing, speed)),
            ],
            probes: ProbeConfig {
                growth: (65_536.0 * step / GROWTH_S) as u16,
                rest_steps: steps(REST_S, step),
                rests_max: RESTS_MAX,
                motion: motion([screw, nut], travel),
            },
            still_steps: steps(STILL_S, step),
            coast_steps: steps(COAST_S, step),
            travel: turns(STOPPED * travel),
            scale: (self.feed.scale_count_m / self.feed.lead_m * 1_099_511_627_776.0) as i64,
            swing: swing_config(swing, travel, step),
            braking_steps: steps(greater(screw.braking_s(), nut.braking_s()), step),
            turn_speed: attempt!(fixed_point("alignment's speed", "rad/s", speed)),
            turn: CoordinatorConfig {
                base: attempt!(profile(
                    ["alignment's acceleration", "alignment's jerk"],
                    acceleration * step,
                    acceleration / EASE_S * step * step,
                )),
                ..*coordinator
            },
            measure_steps: steps(measured_s, step),
            turn_steps: steps(
                1.0 + 8.0 * speed / acceleration + 2.0 * measured_s + INDEX_TURNS * TAU / speed,
                step,
            ),
            still_speed: attempt!(fixed_point(
                "alignment's speed of rest",
                "electrical rad/s",
                STILL_SPEED * speed * slowest as f64
            )),
            longest_steps: (LONGEST_S / step) as u32,
        })
    }

    /// Current of a kick of the wiring's test, and what is clear of it, A, under a torque limit's current. At rest the sign of a
    /// dead time's compensation is the noise's: within a period it moves a phase by the dead time's part of the bus over
    /// the inductance, and what is not clear of that says nothing of the wiring.
    const fn kick(&self, motor: &MotorPlate, limit: f64) -> (f64, f64) {
        let bus_v = self.bridge.brake_fade_from_v;
        let by_dead_time = self.bridge.dead_time_s * bus_v / motor.inductance_h;
        let clear = greater(KICK * limit / 4.0, by_dead_time);
        let kick = greater(KICK * limit, KICK_OF_CLEAR * clear);
        if kick > KICK_MOST * limit {
            return (KICK_MOST * limit, KICK_MOST / KICK_OF_CLEAR * limit);
        }
        (kick, clear)
    }

    /// A motor's torque per ampere, as a part of the stronger one's.
    const fn torque_part(&self, motor: &MotorPlate) -> f64 {
        let [screw, nut] = &self.motors;
        let stronger = greater(screw.torque_per_ampere(), nut.torque_per_ampere());
        motor.torque_per_ampere() / stronger
    }

    const fn motor_alignment(
        &self,
        motor: &MotorPlate,
        speed_loop: SpeedLoopConfig,
        cutoff: f64,
        swing: f64,
        speed: f64,
    ) -> Result<MotorAlignment, Misfit> {
        let torque_nm = motor.alignment_torque_nm;
        attempt!(positive("alignment's torque", "N m", torque_nm));
        attempt!(within(
            "alignment's torque",
            "N m",
            torque_nm,
            0.0,
            motor.torque_max_nm
        ));
        let faster = cutoff / self.tuning.speed_rad_s;
        let speed_loop = attempt!(self.faster_loop(motor, speed_loop, faster));
        let pole_pairs = motor.pole_pairs as f64;
        let limit = ASKED * torque_nm / (pole_pairs * motor.flux_wb);
        let step = self.speed_step();
        let limit_current = attempt!(fixed_point("alignment's torque limit", "A", limit));
        let (kick, clear) = self.kick(motor, limit);
        Ok(MotorAlignment {
            limit: limit_current,
            wiring: WiringConfig {
                kick: attempt!(fixed_point("alignment's kick", "A", kick)),
                clear: attempt!(fixed_point("alignment's clear current", "A", clear)),
                steps: steps(KICK_S, step),
                shunts: self.board.shunts,
            },
            reversed: motor.encoder.reversed,
            stored: if motor.encoder.interface.is_absolute() && motor.encoder.reversed.is_some() {
                Some(motor.encoder.alignment())
            } else {
                None
            },
            index: match motor.encoder.interface {
                Interface::IncrementalWithIndex => {
                    Some(motor.encoder_watch(self).jump_max_aligning)
                }
                Interface::Incremental | Interface::Mt6835 => None,
            },
            pole_pairs: motor.pole_pairs,
            speed_loop: SpeedLoopConfig {
                i_max: limit_current,
                ..speed_loop
            },
            swing: attempt!(self.rotor_swing(motor, speed_loop, cutoff, swing, limit)),
            resistance: attempt!(fixed_point("resistance", "ohm", motor.resistance_ohm)),
            inductance: attempt!(fixed_point("inductance", "H", motor.inductance_h)),
            least_speed: attempt!(fixed_point(
                "alignment's least speed",
                "electrical rad/s",
                LEAST_SPEED * speed * pole_pairs
            )),
            least_emf: attempt!(fixed_point(
                "alignment's back-EMF",
                "V",
                0.5 * speed * pole_pairs * motor.flux_wb.abs()
            )),
        })
    }

    /// Cutoff of the speed loops while rotors are found, rad/s: as the observer allows, up to [`ALIGNING_RAD_S`], or the drive's own where those
    /// are faster. Slower ones do not break a rotor away in time, or let go of the table.
    const fn aligning_rad_s(&self) -> f64 {
        let fast = self.tuning.observer_rad_s / OBSERVER_OF_SPEED;
        let fast = if fast < ALIGNING_RAD_S {
            fast
        } else {
            ALIGNING_RAD_S
        };
        greater(self.tuning.speed_rad_s, fast)
    }

    /// A speed loop with a cutoff so many times higher. Eq 11 and 12: one gain grows with the cutoff, the other with its square. They are scaled,
    /// since a chip without doubles needs milliseconds for a loop from its plate.
    const fn faster_loop(
        &self,
        motor: &MotorPlate,
        speed_loop: SpeedLoopConfig,
        faster: f64,
    ) -> Result<SpeedLoopConfig, Misfit> {
        if faster <= 1.0 {
            return Ok(speed_loop);
        }
        let k_pw = speed_loop.k_pw.to_bits() as f64 / SPEED_GAIN_ONE * faster;
        let k_iw = speed_loop.k_iw_step.to_bits() as f64 / SPEED_GAIN_ONE * faster * faster;
        Ok(SpeedLoopConfig {
            k_pw: attempt!(fixed_point(
                "alignment's proportional gain",
                "A s/rad",
                k_pw
            )),
            k_iw_step: attempt!(fixed_point(
                "alignment's integral gain per step",
                "A s/rad",
                k_iw
            )),
            slack: motor.slack(self, k_pw),
            ..speed_loop
        })
    }

    /// How a motor swings: with a loop of `cutoff` rad/s, `swing` turns far, under a torque limit of `limit` A.
    const fn rotor_swing(
        &self,
        motor: &MotorPlate,
        speed_loop: SpeedLoopConfig,
        cutoff: f64,
        swing: f64,
        limit: f64,
    ) -> Result<RotorSwing, Misfit> {
        let pole_pairs = motor.pole_pairs as f64;
        let across = ACROSS * SWING / (swing * pole_pairs);
        let across = if across < ACROSS_MOST {
            across
        } else {
            ACROSS_MOST
        };
        let more = (across - ACROSS) / (ACROSS_MOST - ACROSS);
        let along = ALONG + more * (ALONG_LEAST - ALONG);
        let catch_up = CATCH_UP * cutoff * TAU * pole_pairs;
        // A a second per electrical rad/s; a loop without an integral has none.
        let integral = speed_loop.k_iw_step.to_bits() as f64 / SPEED_GAIN_ONE / self.speed_step();
        let half_late = LATE * self.alignment.travel_m / self.feed.lead_m / 2.0;
        let break_away = if integral > 0.0 {
            along * limit / (BREAK_AWAY_S * integral * half_late)
        } else {
            0.0
        };
        Ok(RotorSwing {
            across: attempt!(fixed_point(
                "alignment's current across",
                "A",
                across * limit
            )),
            speed: attempt!(fixed_point(
                "alignment's speed of the swing",
                "electrical rad/s",
                swing * TAU * pole_pairs / SWING_S
            )),
            gain: bounded(catch_up * 65_536.0, GAIN_MAX),
            break_away_gain: bounded(break_away * 65_536.0, GAIN_MAX),
            torque_per_ampere: (self.torque_part(motor) * 32_768.0) as i32,
            speed_loop: SpeedLoopConfig {
                i_max: attempt!(fixed_point("alignment's current along", "A", along * limit)),
                ..speed_loop
            },
        })
    }
}

/// How both rotors swing: `swing` turns far, on a `travel` in turns, with steps of `step` seconds.
#[allow(clippy::cast_possible_truncation)]
const fn swing_config(swing: f64, travel: f64, step: f64) -> SwingConfig {
    SwingConfig {
        furthest: turns(swing).cast_signed(),
        step: turns(swing * step / SWING_S).cast_signed(),
        ramp: (FULL as f64 * step / SWING_EASE_S + 1.0) as i32,
        late: turns(LATE * travel),
        waits: steps(SWING_WAITS_S, step),
        steps: steps(SWING_MAX_S, step),
    }
}

/// The angle that is motion, by the coarser encoder: by another angle of each, what one motor takes along would be seen
/// before its own motion.
const fn motion([screw, nut]: [&MotorPlate; 2], travel: f64) -> u32 {
    let (screw, nut) = (screw.encoder.counts_per_turn, nut.encoder.counts_per_turn);
    let coarser = if screw < nut { screw } else { nut };
    let counts = MOTION_COUNTS / coarser as f64;
    let part = MOTION * travel;
    turns(if counts > part { counts } else { part })
}

/// A whole number that is `most` at most.
#[allow(clippy::cast_possible_truncation)]
const fn bounded(value: f64, most: f64) -> i64 {
    (if value < most { value } else { most }) as i64
}

/// Turns in 2^-32; fewer than one.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const fn turns(turns: f64) -> u32 {
    (turns * 4_294_967_296.0) as u32
}

/// Steps of the speed task in a time: one at least, and as many as the word holds at most.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const fn steps(seconds: f64, step: f64) -> u16 {
    let steps = (seconds / step + 0.5) as u16;
    if steps == 0 { 1 } else { steps }
}
