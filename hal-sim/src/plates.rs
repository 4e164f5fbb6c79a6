//! The plate data that the control code gets for a model of a machine.

use crate::board::BoardConfig;
use crate::boards::BoardKind;
use control::plate::{
    AlignmentPlate, BasePlate, BoardPlate, BrakePlate, BridgePlate, CommandPlate,
    CompensationPlate, DrivePlate, FeedPlate, FrictionPlate, MotorPlate, RejectionPlate,
    RunawayPlate, ThermalPlate, TravelPlate, Tuning,
};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::{Brake, Model};

/// The paper's tuning (Table 1, `xi` = 0.7) with an observer of 1000 rad/s. The paper has no observer. Its damping of 0.9 was fitted:
/// with it the drive meets the ripple of independently computed loops with such an observer at all four nut speeds. So that
/// agreement is no evidence for the observer. Both boards use 0.7.
pub const PAPER_TUNING: Tuning = Tuning {
    damping: 0.7,
    current_rad_s: 3000.0,
    speed_rad_s: 200.0,
    observer_rad_s: 1000.0,
    observer_damping: 0.9,
};

/// The tuning of the drives that made the shared recordings. They declare the paper's gains and leave their speed
/// estimation open. The observer was fitted to them: it meets the ripple of the clean ones in every hold within 10 %, where
/// 1000 rad/s misses by up to 18 %.
pub const RECORDED_TUNING: Tuning = Tuning {
    observer_rad_s: 1500.0,
    observer_damping: 0.7,
    ..PAPER_TUNING
};

/// A brake with the delays of the settings' defaults, of a load that drives back.
const FITTED: BrakePlate = BrakePlate {
    fitted: true,
    load_drives_back: true,
    ..BrakePlate::NONE
};

/// Rated speed of the paper's motors, rpm.
pub const PAPER_SPEED_RPM: f64 = 3000.0;

/// Twice the rated torque of the paper's motors, N m.
pub const PAPER_TORQUE_NM: f64 = 2.6;

/// The tuning whose observer is deadbeat: with a fine encoder it adds no lag but half a sample.
#[must_use]
pub fn deadbeat(tuning: Tuning, board: &BoardConfig) -> Tuning {
    Tuning {
        observer_rad_s: 1.0 / board.pwm_period_s(),
        observer_damping: 0.5,
        ..tuning
    }
}

/// Plate data of the drive for `model` on a board of `board`.
///
/// The inertia is what each motor moves: lumped, the model's own `J_M`; coupled, the motor's plus the table's mass
/// through the lead.
#[must_use]
pub fn plates(
    model: &Model,
    coupling: Coupling,
    board: &BoardConfig,
    tuning: Tuning,
) -> DrivePlate {
    let r = model.feed.travel_per_radian();
    let table = match coupling {
        Coupling::Lumped => 0.0,
        Coupling::Coupled => model.feed.table_mass_kg * r * r,
    };
    DrivePlate {
        motors: Axis::ALL.map(|axis| motor_plate(model, axis, table, board)),
        board: board_plate(board),
        bridge: bridge_plate(board),
        tuning,
        feed: FeedPlate {
            lead_m: model.feed.lead_m,
            scale_count_m: board.sensors.scale_count_m,
            velocity_max: 0.1,
            acceleration_max: 0.25,
            jerk_max: 10.0,
            base_acceleration_max: 700.0,
            base_jerk_max: 20_000.0,
        },
        travel: TravelPlate::UNLIMITED,
        brake: match model.installation.brake {
            Brake::Ideal | Brake::None => BrakePlate::NONE,
            Brake::Fitted => FITTED,
        },
        alignment: AlignmentPlate {
            travel_m: 50e-6,
            speed_rpm: PAPER_SPEED_RPM / 10.0,
        },
        runaway: RunawayPlate::USUAL,
        compensation: CompensationPlate::NONE,
        friction: FrictionPlate::NONE,
        rejection: RejectionPlate::NONE,
        base: BasePlate::NONE,
        command: CommandPlate { heartbeat_s: 0.5 },
    }
}

/// Largest current along q, of the phase current that a board's bridge opens at.
const OF_OVER_CURRENT: f64 = 0.6;

/// `plate` with the electronics of a board: their scales, bridge and limits. Torques are no larger than its currents make.
pub(crate) fn on_electronics(kind: BoardKind, plate: DrivePlate) -> DrivePlate {
    let DrivePlate { board, bridge, .. } = kind.plate();
    let most_a = OF_OVER_CURRENT * 1.5f64.sqrt() * bridge.over_current_a;
    let motors = plate.motors.map(|motor| {
        let most_nm = most_a * f64::from(motor.pole_pairs) * motor.flux_wb.abs();
        let part = (most_nm / motor.torque_max_nm).min(1.0);
        MotorPlate {
            torque_max_nm: part * motor.torque_max_nm,
            alignment_torque_nm: part * motor.alignment_torque_nm,
            thermal: ThermalPlate {
                rated_rms_a: part * motor.thermal.rated_rms_a,
                ..motor.thermal
            },
            ..motor
        }
    });
    DrivePlate {
        motors,
        board,
        bridge,
        ..plate
    }
}

/// Of a motor that moves an inertia of `table` besides its own.
fn motor_plate(model: &Model, axis: Axis, table: f64, board: &BoardConfig) -> MotorPlate {
    let motor = model.motor(axis);
    MotorPlate {
        resistance_ohm: motor.resistance_ohm,
        inductance_h: motor.inductance_h,
        pole_pairs: motor.pole_pairs,
        flux_wb: motor.flux_wb,
        inertia_kg_m2: motor.inertia_kg_m2 + table,
        speed_max_rpm: PAPER_SPEED_RPM,
        torque_max_nm: PAPER_TORQUE_NM,
        // The rated torque; a small servo's winding.
        thermal: ThermalPlate {
            rated_rms_a: PAPER_TORQUE_NM
                / (2.0 * f64::from(motor.pole_pairs) * motor.flux_wb.abs() * 3f64.sqrt()),
            seconds: 60.0,
        },
        alignment_torque_nm: 0.3 * PAPER_TORQUE_NM / 2.0,
        current_gain_a: 1.0,
        current_gain_b: 1.0,
        current_gain_c: 1.0,
        encoder: board.sensors.encoders[axis.index()],
    }
}

fn board_plate(board: &BoardConfig) -> BoardPlate {
    let sensors = &board.sensors;
    BoardPlate {
        timer_hz: board.timer_hz,
        pwm_hz: board.pwm_hz,
        speed_divider: speed_divider(board.pwm_hz),
        shunts: board.shunts,
        amps_per_count: sensors.current.per_count,
        zero_counts: sensors.current.zero,
        bus_volts_per_count: sensors.bus.per_count,
        adc_counts: sensors.current.counts.max(sensors.bus.counts),
    }
}

fn bridge_plate(board: &BoardConfig) -> BridgePlate {
    BridgePlate {
        // The second line, behind the break.
        over_current_a: 1.2 * board.break_a,
        bus_min_v: 0.1 * board.bus_v,
        dead_time_s: board.dead_time_s,
        dead_time_fade_a: 0.02,
        measure_zeros: board.measure_zeros,
        min_on_time_s: 1e-6,
        bootstrap_s: 0.0,
        thermal: ThermalPlate {
            rated_rms_a: 0.5 * board.break_a,
            seconds: 20.0,
        },
        brake_fade_from_v: REGENERATION[0] * board.bus_v,
        brake_fade_to_v: REGENERATION[1] * board.bus_v,
    }
}

/// Bus voltages between which braking fades out, of the supply's: a chopper's, were there one, is below.
pub const REGENERATION: [f64; 2] = [1.2, 1.24];

/// Current-loop periods per speed step: 5 kHz, or the nearest that divides the PWM frequency.
fn speed_divider(pwm_hz: f64) -> u32 {
    (pwm_hz / 5000.0).round().clamp(1.0, 64.0) as u32
}
